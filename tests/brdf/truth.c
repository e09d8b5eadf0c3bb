#include "brdf/truth.h"

#include "core/context.h"
#include "support.h"

void truth_read(tsuya_samples *s, const tsuya_microcylinder *cloth, const truth_bench *b)
{
    int per = (int)((b->last_tilt_deg - b->first_tilt_deg) / b->step_deg + 1.5), n = 0;
    uint64_t counter = 0;
    assert_ok(tsuya_samples_create(s, b->azimuths * per, 3, NULL));
    for (int a = 0; a < b->azimuths; ++a) {
        for (int k = 0; k < per; ++k) {
            double tilt = b->first_tilt_deg + k * b->step_deg;
            tsuya_vec3 wi = tsuya_goniometer_direction(b->light_deg, 0.0, b->azimuth_deg[a], tilt);
            tsuya_vec3 wo = tsuya_goniometer_direction(b->view_deg, 180.0, b->azimuth_deg[a], tilt);
            const double lowest = cos(80.01 * M_PI / 180.0);
            if (wi.z < lowest || wo.z < lowest) {
                continue;
            }
            s->wi[n] = wi;
            s->wo[n] = wo;
            tsuya_microcylinder_eval_reciprocal(cloth, wi, wo, s->value + 3 * n);
            for (int c = 0; c < 3; ++c) {
                s->value[3 * n + c] *= fmax(0.0, 1.0 + b->noise * tsuya_random_normal(b->seed, 5, counter++));
            }
            n++;
        }
    }
    s->count = n;
}

void truth_set_read(truth_set *set, const tsuya_microcylinder *cloth, double noise, uint64_t seed)
{
    static const double measured[] = {0, 45, 90, 135}, between[] = {22.5, 67.5, 112.5, 157.5}, other[] = {0, 30, 60, 90};
    truth_bench fit = {30, 30, measured, 4, -48, 48, 3, noise, seed}, tilts = {30, 30, measured, 4, -46.5, 46.5, 3, 0, seed};
    truth_bench azimuths = {30, 30, between, 4, -48, 48, 3, 0, seed}, geometry = {60, 10, other, 4, -48, 69, 3, 0, seed};
    truth_read(&set->fit, cloth, &fit);
    truth_read(&set->tilts, cloth, &tilts);
    truth_read(&set->azimuths, cloth, &azimuths);
    truth_read(&set->geometry, cloth, &geometry);
}

void truth_set_free(truth_set *set)
{
    tsuya_samples_free(&set->fit);
    tsuya_samples_free(&set->tilts);
    tsuya_samples_free(&set->azimuths);
    tsuya_samples_free(&set->geometry);
}
