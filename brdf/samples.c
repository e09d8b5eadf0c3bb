#include "brdf/samples_internal.h"

#include "core/file.h"
#include "core/memory.h"

#include <stdio.h>
#include <string.h>

tsuya_vec3 tsuya_goniometer_direction(double theta_deg, double phi_deg, double azimuth_deg, double tilt_deg)
{
    double t = tsuya_rad_from_deg(theta_deg), p = tsuya_rad_from_deg(phi_deg);
    double a = tsuya_rad_from_deg(azimuth_deg), tilt = tsuya_rad_from_deg(tilt_deg);
    tsuya_vec3 w = {sin(t) * cos(p), sin(t) * sin(p), cos(t)};
    tsuya_vec3 tipped = {cos(tilt) * w.x - sin(tilt) * w.z, w.y, sin(tilt) * w.x + cos(tilt) * w.z};
    return (tsuya_vec3){cos(a) * tipped.x - sin(a) * tipped.y, sin(a) * tipped.x + cos(a) * tipped.y, tipped.z};
}

tsuya_status tsuya_samples_create(tsuya_samples *samples, int count, int channel_count, const char *const *channels)
{
    static const char *const rgb[] = {"r", "g", "b"};
    tsuya_status status = TSUYA_OK;
    tsuya_samples *s = samples;
    *s = (tsuya_samples){.count = count, .channel_count = channel_count, .scale_sigma = NAN};
    TSUYA_NEW(status, s->wi, (size_t)count);
    TSUYA_NEW(status, s->wo, (size_t)count);
    TSUYA_NEW(status, s->value, (size_t)count * (size_t)channel_count);
    TSUYA_NEW(status, s->channel, (size_t)channel_count);
    for (int c = 0; c < channel_count; ++c) {
        snprintf(s->channel[c], sizeof s->channel[c], "%s", channels ? channels[c] : rgb[c % 3]);
    }
    return TSUYA_OK;
done:
    tsuya_samples_free(s);
    return status;
}

void tsuya_samples_free(tsuya_samples *samples)
{
    tsuya_free(samples->wi);
    tsuya_free(samples->wo);
    tsuya_free(samples->value);
    tsuya_free(samples->channel);
    tsuya_free(samples->azimuth_deg);
    tsuya_free(samples->tilt_deg);
    *samples = (tsuya_samples){0};
}

tsuya_status tsuya_samples_copy_frame(tsuya_samples *samples, const tsuya_samples *of, int channel_count, const char *const *channels)
{
    tsuya_status status = TSUYA_OK;
    size_t n = (size_t)of->count;
    TSUYA_TRY(tsuya_samples_create(samples, of->count, channel_count, channels));
    memcpy(samples->wi, of->wi, n * sizeof *of->wi);
    memcpy(samples->wo, of->wo, n * sizeof *of->wo);
    samples->relative = of->relative;
    samples->scale_sigma = of->scale_sigma;
    if (of->azimuth_deg) {
        TSUYA_NEW(status, samples->azimuth_deg, n);
        TSUYA_NEW(status, samples->tilt_deg, n);
        memcpy(samples->azimuth_deg, of->azimuth_deg, n * sizeof *of->azimuth_deg);
        memcpy(samples->tilt_deg, of->tilt_deg, n * sizeof *of->tilt_deg);
    }
    return TSUYA_OK;
done:
    tsuya_samples_free(samples);
    return status;
}

static void copy_row(tsuya_samples *to, int row, const tsuya_samples *of, int k)
{
    size_t n = (size_t)of->channel_count;
    to->wi[row] = of->wi[k];
    to->wo[row] = of->wo[k];
    memcpy(to->value + (size_t)row * n, of->value + (size_t)k * n, n * sizeof *to->value);
    if (of->azimuth_deg) {
        to->azimuth_deg[row] = of->azimuth_deg[k];
        to->tilt_deg[row] = of->tilt_deg[k];
    }
}

tsuya_status tsuya_samples_copy(tsuya_samples *samples, const tsuya_samples *of, const unsigned char *keep)
{
    tsuya_status status = TSUYA_OK;
    int count = 0;
    for (int k = 0; k < of->count; ++k) {
        count += keep[k] != 0;
    }
    TSUYA_TRY(tsuya_samples_create(samples, count, of->channel_count, NULL));
    memcpy(samples->channel, of->channel, (size_t)of->channel_count * sizeof *of->channel);
    samples->relative = of->relative;
    samples->scale_sigma = of->scale_sigma;
    if (of->azimuth_deg) {
        TSUYA_NEW(status, samples->azimuth_deg, (size_t)count);
        TSUYA_NEW(status, samples->tilt_deg, (size_t)count);
    }
    for (int k = 0, row = 0; k < of->count; ++k) {
        if (keep[k]) {
            copy_row(samples, row++, of, k);
        }
    }
    return TSUYA_OK;
done:
    tsuya_samples_free(samples);
    return status;
}

tsuya_brdf_error tsuya_samples_error(const tsuya_samples *s, const double *predicted, int channel)
{
    double difference = 0.0, sum = 0.0, logs = 0.0, peak = 0.0;
    size_t n = (size_t)s->channel_count, used = 0;
    for (int pass = 0; pass < 2; ++pass) {
        double epsilon = 1e-3 * peak;
        for (int k = 0; k < s->count; ++k) {
            for (int c = 0; c < s->channel_count; ++c) {
                double f = s->value[(size_t)k * n + (size_t)c] * s->wi[k].z, g = predicted[(size_t)k * n + (size_t)c] * s->wi[k].z;
                if (isnan(f) || (channel >= 0 && c != channel)) {
                    continue;
                }
                if (pass == 0) {
                    double d = cbrt(g) - cbrt(f);
                    difference += d * d;
                    sum += cbrt(f) * cbrt(f);
                    peak = fmax(peak, f);
                } else if (g + epsilon > 0.0 && f + epsilon > 0.0) {
                    logs += fabs(log((g + epsilon) / (f + epsilon)));
                    used++;
                }
            }
        }
    }
    return (tsuya_brdf_error){sum > 0.0 ? sqrt(difference / sum) : NAN, used ? logs / (double)used : NAN};
}

tsuya_status tsuya_samples_load(tsuya_samples *samples, const char *path)
{
    char *bytes = NULL;
    size_t size = 0;
    *samples = (tsuya_samples){0};
    TSUYA_TRY(tsuya_file_load(&bytes, &size, path, (size_t)2 << 30));
    tsuya_status status;
    const char *extension = tsuya_path_extension(path);
    if (size >= 12 && memcmp(bytes, "tensor_file", 12) == 0) {
        status = tsuya_samples_from_rgl(samples, bytes, size, path);
    } else if (memchr(bytes, '\0', size)) {
        status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: not text; samples are a CSV table, a Klems .xml or an RGL .bsdf", path);
    } else if (strcmp(extension, ".xml") == 0) {
        status = tsuya_samples_from_klems(samples, bytes, path);
    } else {
        status = tsuya_samples_parse(samples, bytes, path);
    }
    tsuya_free(bytes);
    return status;
}
