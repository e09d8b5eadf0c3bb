#include "brdf/export_loss.h"

#include "brdf/model.h"
#include "brdf/samples_color.h"
#include "core/color.h"
#include "core/context.h"
#include "core/memory.h"
#include "core/order.h"

#include <math.h>
#include <string.h>

enum { PAIRS = 4000 };

static tsuya_vec3 direction(uint64_t seed, uint64_t stream, int k)
{
    double z = 1.0 - (1.0 - cos(80.0 * M_PI / 180.0)) * tsuya_random_uniform(seed, stream, 2 * (uint64_t)k);
    double phi = 2.0 * M_PI * tsuya_random_uniform(seed, stream, 2 * (uint64_t)k + 1), r = sqrt(1.0 - z * z);
    return (tsuya_vec3){r * cos(phi), r * sin(phi), z};
}

void tsuya_export_pairs(tsuya_samples *s, uint64_t seed)
{
    for (int k = 0; k < s->count; ++k) {
        s->wi[k] = direction(seed, 1, k);
        s->wo[k] = direction(seed, 2, k);
        if (k % 2) {
            tsuya_vec3 mirror = {-s->wi[k].x, -s->wi[k].y, s->wi[k].z}, w = tsuya_vec3_unit(tsuya_vec3_mad(mirror, 0.5, s->wo[k]));
            s->wo[k] = w.z > cos(80.0 * M_PI / 180.0) ? w : mirror;
        }
    }
}

static tsuya_lab lab_of(const double *value, const double *nm, int channels)
{
    double rgb[3] = {0.0, 0.0, 0.0};
    if (nm) {
        tsuya_color_of_spectrum(rgb, nm, value, channels, TSUYA_COLOR_RGB);
    } else {
        for (int c = 0; c < 3; ++c) {
            rgb[c] = value[channels == 3 ? c : 0];
        }
    }
    return tsuya_lab_from_rgb((tsuya_vec3){M_PI * rgb[0], M_PI * rgb[1], M_PI * rgb[2]});
}

tsuya_status tsuya_export_measure(tsuya_export_loss *loss, const tsuya_material *m, tsuya_export_reader reader, const void *user)
{
    tsuya_samples s = {0};
    double *seen = NULL, *difference = NULL, nm[TSUYA_MATERIAL_MAX_CHANNELS];
    int n = m->channel_count;
    bool spectral = true;
    tsuya_status status;
    for (int c = 0; c < n; ++c) {
        spectral &= tsuya_channel_nm(&nm[c], m->channel[c]);
    }
    TSUYA_GOTO_DONE(status, tsuya_samples_create(&s, PAIRS, n, m->channel));
    TSUYA_NEW(status, seen, (size_t)PAIRS * (size_t)n);
    TSUYA_NEW(status, difference, PAIRS);
    tsuya_export_pairs(&s, 3);
    for (int k = 0; k < PAIRS; ++k) {
        double *truth = s.value + (size_t)k * (size_t)n, *read = seen + (size_t)k * (size_t)n;
        tsuya_material_eval(m, NULL, s.wi[k], s.wo[k], truth);
        reader(read, user, s.wi[k], s.wo[k]);
        difference[k] = tsuya_color_difference(lab_of(truth, spectral ? nm : NULL, n), lab_of(read, spectral ? nm : NULL, n));
    }
    loss->cbrt = tsuya_samples_error(&s, seen, -1).cbrt;
    tsuya_sort_doubles(difference, PAIRS);
    loss->de00_median = difference[PAIRS / 2];
    loss->de00_p95 = difference[PAIRS * 19 / 20];
done:
    tsuya_free(seen);
    tsuya_free(difference);
    tsuya_samples_free(&s);
    return status;
}
