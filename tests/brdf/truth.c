#include "brdf/truth.h"

#include "brdf/fit.h"
#include "core/context.h"
#include "core/memory.h"
#include "support.h"

#include <string.h>

const tsuya_microcylinder truth_steep_twill = {
    .warp = {1.46, {0.06, 0.05, 0.03}, 0.2, 6.0, 12.0, 0.7, 3, {8, 14, 30}, {1, 1}},
    .weft = {1.46, {0.1, 0.1, 0.1}, 0.3, 12.0, 24.0, 0.3, 2, {-24, -10}, {1}},
};

static void eval_microcylinder(double value[3], const void *cloth, tsuya_vec3 wi, tsuya_vec3 wo)
{
    tsuya_microcylinder_eval_reciprocal(cloth, wi, wo, value);
}

truth_cloth truth_of_microcylinder(const tsuya_microcylinder *cloth) { return (truth_cloth){eval_microcylinder, cloth}; }

static void eval_irawan(double value[3], const void *cloth, tsuya_vec3 wi, tsuya_vec3 wo) { tsuya_irawan_eval(cloth, wi, wo, value); }

truth_cloth truth_of_irawan(const tsuya_irawan *cloth) { return (truth_cloth){eval_irawan, cloth}; }

const char *const truth_weaves[] = {"silk_charmeuse", "silk_shantung", "cotton_denim", "cotton_twill", "wool_gabardine", "polyester_lining", NULL};

bool truth_weave_load(tsuya_irawan *cloth, const char *name)
{
    static const double warp[3] = {0.12, 0.04, 0.03}, weft[3] = {0.25, 0.22, 0.20};
    const char *path = test_data("brdf/irawan_weaves.txt");
    if (!path) {
        return false;
    }
    assert_ok(tsuya_irawan_load(cloth, path, name));
    memcpy(cloth->warp.diffuse, warp, sizeof warp);
    memcpy(cloth->weft.diffuse, weft, sizeof weft);
    return true;
}

void truth_read_cloth(tsuya_samples *s, const truth_cloth *cloth, const truth_bench *b)
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
            cloth->eval(s->value + 3 * n, cloth->user, wi, wo);
            for (int c = 0; c < 3; ++c) {
                s->value[3 * n + c] *= fmax(0.0, 1.0 + b->noise * tsuya_random_normal(b->seed, 5, counter++));
            }
            n++;
        }
    }
    s->count = n;
}

void truth_read(tsuya_samples *s, const tsuya_microcylinder *cloth, const truth_bench *b)
{
    const truth_cloth any = truth_of_microcylinder(cloth);
    truth_read_cloth(s, &any, b);
}

void truth_set_read_cloth(truth_set *set, const truth_cloth *cloth, double noise, uint64_t seed)
{
    static const double measured[] = {0, 45, 90, 135}, between[] = {22.5, 67.5, 112.5, 157.5}, other[] = {0, 30, 60, 90};
    truth_bench fit = {30, 30, measured, 4, -48, 48, 3, noise, seed}, tilts = {30, 30, measured, 4, -46.5, 46.5, 3, 0, seed};
    truth_bench azimuths = {30, 30, between, 4, -48, 48, 3, 0, seed}, geometry = {60, 10, other, 4, -48, 69, 3, 0, seed};
    truth_read_cloth(&set->fit, cloth, &fit);
    truth_read_cloth(&set->tilts, cloth, &tilts);
    truth_read_cloth(&set->azimuths, cloth, &azimuths);
    truth_read_cloth(&set->geometry, cloth, &geometry);
}

void truth_set_read(truth_set *set, const tsuya_microcylinder *cloth, double noise, uint64_t seed)
{
    const truth_cloth any = truth_of_microcylinder(cloth);
    truth_set_read_cloth(set, &any, noise, seed);
}

void truth_set_free(truth_set *set)
{
    tsuya_samples_free(&set->fit);
    tsuya_samples_free(&set->tilts);
    tsuya_samples_free(&set->azimuths);
    tsuya_samples_free(&set->geometry);
}

bool truth_fabric_read(tsuya_samples *fit, tsuya_samples *held)
{
    static const double exits[17] = {-82.5, -70, -60, -50, -40, -30, -20, -10, 0, 10, 20, 30, 40, 50, 60, 70, 82.5};
    static const char *const channel[] = {"visible"};
    const char *path = test_data("brdf/woven_shade_front_curves.csv");
    FILE *f = path ? fopen(path, "r") : NULL;
    char line[1024];
    if (!f) {
        return false;
    }
    assert_ok(tsuya_samples_create(fit, 8 * 9 * 17, 1, channel));
    assert_ok(tsuya_samples_create(held, 8 * 9 * 17, 1, channel));
    fit->count = held->count = 0;
    assert_non_null(fgets(line, sizeof line, f));
    while (fgets(line, sizeof line, f)) {
        char *at = line;
        double phi = strtod(at, &at), theta = strtod(at + 1, &at);
        tsuya_samples *s = (int)theta / 10 % 2 ? held : fit;
        for (int k = 0; k < 17; ++k) {
            double value = strtod(at + 1, &at);
            if (theta <= 60.0 && fabs(exits[k]) <= 70.0) {
                s->wi[s->count] = tsuya_goniometer_direction(theta, 0, phi, 0);
                s->wo[s->count] = tsuya_goniometer_direction(exits[k], 180, phi, 0);
                s->value[s->count++] = value;
            }
        }
    }
    fclose(f);
    return true;
}

void truth_at_azimuth(tsuya_samples *part, const tsuya_samples *s, double phi_deg)
{
    unsigned char *keep = tsuya_calloc((size_t)s->count, 1);
    assert_non_null(keep);
    for (int k = 0; k < s->count; ++k) {
        keep[k] = fabs(remainder(atan2(s->wi[k].y, s->wi[k].x) - tsuya_rad_from_deg(phi_deg), 2.0 * M_PI)) < 0.01;
    }
    assert_ok(tsuya_samples_copy(part, s, keep));
    tsuya_free(keep);
}

double truth_error(const tsuya_material *m, const tsuya_samples *s, int channel)
{
    double *g = tsuya_calloc((size_t)s->count * (size_t)s->channel_count, sizeof *g);
    assert_non_null(g);
    tsuya_material_predict(g, m, s);
    double e = tsuya_samples_error(s, g, channel).cbrt;
    tsuya_free(g);
    return e;
}
