#include "brdf/samples_join.h"

#include "brdf/fit.h"
#include "brdf/samples_color.h"
#include "core/memory.h"

#include <string.h>

enum { FEWEST_LINKS = 4 };

/* Pairs that link the two: the camera's r g b and the radiometer's channels at the same directions, each divided by the pair's
 * weight so that dark and bright pairs count alike. */
typedef struct pairs {
    int count, channels;
    double *camera; /* count × 3 */
    double *radiometer, *rgb; /* count × channels, count × 3 */
    double *weight;
} pairs;

static void free_pairs(pairs *p)
{
    tsuya_free(p->camera);
    tsuya_free(p->radiometer);
    tsuya_free(p->rgb);
    tsuya_free(p->weight);
}

static bool near_camera(const tsuya_samples *camera, tsuya_vec3 wi, tsuya_vec3 wo)
{
    const double farthest = cos(7.0 * M_PI / 180.0);
    for (int k = 0; k < camera->count; ++k) {
        if (tsuya_vec3_dot(camera->wi[k], wi) >= farthest && tsuya_vec3_dot(camera->wo[k], wo) >= farthest) {
            return true;
        }
    }
    return false;
}

static bool usable(const double *value, int count)
{
    double sum = 0.0;
    for (int c = 0; c < count; ++c) {
        sum += value[c]; /* NaN spreads */
    }
    return sum > 0.0;
}

static void take_pair(pairs *p, const double camera[3], const double *radiometer, const double rgb[3])
{
    int n = p->count++;
    memcpy(p->camera + 3 * n, camera, 3 * sizeof *camera);
    memcpy(p->rgb + 3 * n, rgb, 3 * sizeof *rgb);
    memcpy(p->radiometer + n * p->channels, radiometer, (size_t)p->channels * sizeof *radiometer);
}

/* A camera's numbers may be any multiple of a reflectance, and a fit that seems to exceed energy is held at it: so the fit sees
 * them this much darker. */
static const double darker = 1e-3;

static tsuya_status darkened(tsuya_samples *copy, const tsuya_samples *camera)
{
    unsigned char *keep = tsuya_calloc((size_t)camera->count, 1);
    if (!keep) {
        return TSUYA_ERROR_MEMORY;
    }
    memset(keep, 1, (size_t)camera->count);
    tsuya_status status = tsuya_samples_copy(copy, camera, keep);
    copy->relative = true;
    for (size_t k = 0; status == TSUYA_OK && k < (size_t)copy->count * (size_t)copy->channel_count; ++k) {
        copy->value[k] *= darker;
    }
    tsuya_free(keep);
    return status;
}

static tsuya_status link_tables(pairs *p, const tsuya_samples *camera, const tsuya_samples *wanted, const tsuya_samples *rgb, const tsuya_context *context)
{
    const tsuya_fit_options options = {"camera", "ndf", NAN};
    tsuya_material *m = NULL;
    tsuya_samples dark = {0};
    tsuya_fit_info fit;
    tsuya_status status = TSUYA_OK;
    size_t n = (size_t)wanted->count;
    int linked = 0;
    p->channels = wanted->channel_count;
    TSUYA_NEW(status, p->camera, n * 3);
    TSUYA_NEW(status, p->rgb, n * 3);
    TSUYA_NEW(status, p->radiometer, n * (size_t)p->channels);
    TSUYA_NEW(status, p->weight, n);
    for (size_t k = 0; k < n; ++k) {
        linked += near_camera(camera, wanted->wi[k], wanted->wo[k]) && usable(wanted->value + k * (size_t)p->channels, p->channels) && usable(rgb->value + 3 * k, 3);
    }
    if (linked < FEWEST_LINKS) {
        TSUYA_GOTO_DONE(status, tsuya_fail(TSUYA_ERROR_INPUT, "%d of the radiometer's %d rows lie within 7° of the camera's readings and are not clipped; at least %d "
                                                              "must link them", linked, wanted->count, FEWEST_LINKS));
    }
    TSUYA_GOTO_DONE(status, darkened(&dark, camera));
    TSUYA_GOTO_DONE(status, tsuya_brdf_fit(&m, &fit, NULL, NULL, &dark, &options, context));
    for (size_t k = 0; k < n; ++k) {
        double seen[3];
        const double *value = wanted->value + k * (size_t)p->channels;
        tsuya_material_eval(m, NULL, wanted->wi[k], wanted->wo[k], seen);
        for (int c = 0; c < 3; ++c) {
            seen[c] /= darker;
        }
        if (near_camera(camera, wanted->wi[k], wanted->wo[k]) && usable(value, p->channels) && usable(rgb->value + 3 * k, 3)) {
            take_pair(p, seen, value, rgb->value + 3 * k);
        }
    }
done:
    tsuya_material_free(m);
    tsuya_samples_free(&dark);
    return status;
}

/* Mean logarithm of radiometer over camera and its standard error, per channel; each above 2 % of its channel's largest. */
static void gains(tsuya_join_info *info, double *level, double *level_sigma, const pairs *p)
{
    double all = 0.0, variance = 0.0;
    for (int c = 0; c < 3; ++c) {
        double sum = 0.0, square = 0.0, largest = 0.0;
        int n = 0;
        for (int k = 0; k < p->count; ++k) {
            largest = fmax(largest, p->rgb[3 * k + c]);
        }
        for (int k = 0; k < p->count; ++k) {
            if (p->rgb[3 * k + c] > 0.02 * largest && p->camera[3 * k + c] > 0.0) {
                double l = log(p->rgb[3 * k + c] / p->camera[3 * k + c]);
                sum += l;
                square += l * l;
                n++;
            }
        }
        double mean = n ? sum / n : 0.0, error = n > 1 ? sqrt(fmax(0.0, (square - n * mean * mean) / (n - 1) / n)) : INFINITY;
        info->gain[c] = exp(mean);
        info->gain_sigma[c] = info->gain[c] * error;
        all += mean / 3.0;
        variance += error * error / 9.0;
    }
    *level = all;
    *level_sigma = sqrt(variance);
}

static void share_scales(tsuya_join_info *info, double level, double level_sigma, const tsuya_samples *camera, const tsuya_samples *radiometer)
{
    double c = camera->relative ? INFINITY : camera->scale_sigma, r = radiometer->relative ? INFINITY : radiometer->scale_sigma, shift = 0.0;
    info->relative = camera->relative && radiometer->relative;
    info->scale_sigma = NAN;
    if (info->relative || (isnan(c) && isnan(r)) || isinf(c)) {
        info->scale_sigma = info->relative || isinf(r) ? NAN : r; /* the radiometer's scale stands */
    } else if (isinf(r) || isnan(r)) {
        shift = -level;
        info->scale_sigma = hypot(c, level_sigma);
    } else if (!isnan(c)) {
        double own = r * r, other = c * c + level_sigma * level_sigma;
        shift = -level * own / (own + other);
        info->scale_sigma = sqrt(own * other / (own + other));
    } else {
        info->scale_sigma = r;
    }
    info->radiometer_scale = exp(shift);
    info->camera_scale = exp(level + shift);
}

/* Axes of a symmetric 3 × 3 matrix by Jacobi rotations, columns of `axis`, largest first. */
static void principal_axes(double axis[3][3], double m[3][3])
{
    for (int i = 0; i < 9; ++i) {
        axis[i / 3][i % 3] = i / 3 == i % 3;
    }
    for (int sweep = 0; sweep < 30; ++sweep) {
        for (int p = 0; p < 2; ++p) {
            for (int q = p + 1; q < 3; ++q) {
                if (fabs(m[p][q]) <= 1e-300) {
                    continue;
                }
                double t = 0.5 * atan2(2.0 * m[p][q], m[p][p] - m[q][q]), c = cos(t), s = sin(t);
                for (int k = 0; k < 3; ++k) {
                    double a = m[k][p], b = m[k][q], u = axis[k][p], v = axis[k][q];
                    m[k][p] = c * a + s * b;
                    m[k][q] = c * b - s * a;
                    axis[k][p] = c * u + s * v;
                    axis[k][q] = c * v - s * u;
                }
                for (int k = 0; k < 3; ++k) {
                    double a = m[p][k], b = m[q][k];
                    m[p][k] = c * a + s * b;
                    m[q][k] = c * b - s * a;
                }
            }
        }
    }
    for (int i = 0; i < 2; ++i) {
        for (int j = i + 1; j < 3; ++j) {
            if (m[j][j] > m[i][i]) {
                double t = m[i][i];
                m[i][i] = m[j][j];
                m[j][j] = t;
                for (int k = 0; k < 3; ++k) {
                    t = axis[k][i];
                    axis[k][i] = axis[k][j];
                    axis[k][j] = t;
                }
            }
        }
    }
}

/* Scores of every pair on the axes, orthogonal over the pairs, and their squared lengths. */
static void make_scores(double *score, double length[3], double axis[3][3], const pairs *p)
{
    double m[3][3] = {{0}};
    for (int k = 0; k < p->count; ++k) {
        for (int i = 0; i < 9; ++i) {
            m[i / 3][i % 3] += p->camera[3 * k + i / 3] * p->camera[3 * k + i % 3] * p->weight[k] * p->weight[k];
        }
    }
    principal_axes(axis, m);
    for (int a = 0; a < 3; ++a) {
        length[a] = 0.0;
        for (int k = 0; k < p->count; ++k) {
            double s = 0.0;
            for (int i = 0; i < 3; ++i) {
                s += axis[i][a] * p->camera[3 * k + i] * p->weight[k];
            }
            score[3 * k + a] = s;
            length[a] += s * s;
        }
    }
}

/* One wanted channel on the first `rank` axes; returns Σ of squared differences of cube roots over left-out pairs. */
static double regress(double coefficient[3], const double *score, const double length[3], const pairs *p, int channel, int rank)
{
    double error = 0.0;
    for (int a = 0; a < 3; ++a) {
        coefficient[a] = 0.0;
        for (int k = 0; a < rank && k < p->count; ++k) {
            coefficient[a] += score[3 * k + a] * p->radiometer[k * p->channels + channel] * p->weight[k] / length[a];
        }
    }
    for (int k = 0; k < p->count; ++k) {
        double y = p->radiometer[k * p->channels + channel], fitted = 0.0, leverage = 0.0;
        for (int a = 0; a < rank; ++a) {
            fitted += coefficient[a] * score[3 * k + a];
            leverage += score[3 * k + a] * score[3 * k + a] / length[a];
        }
        double residual = (y * p->weight[k] - fitted) / fmax(1.0 - leverage, 1e-3), d = cbrt(fmax(0.0, y - residual / p->weight[k])) - cbrt(y);
        error += d * d;
    }
    return error;
}

/* map: channels × 3, from the camera's r g b. */
static tsuya_status fit_map(double *map, tsuya_join_info *info, pairs *p)
{
    double *score = tsuya_calloc((size_t)p->count * 3, sizeof *score), axis[3][3], length[3], brightest = 0.0, roots = 0.0, best = INFINITY;
    if (!score) {
        return TSUYA_ERROR_MEMORY;
    }
    for (int k = 0; k < p->count; ++k) {
        for (int c = 0; c < p->channels; ++c) {
            double y = p->radiometer[k * p->channels + c];
            p->weight[k] += y / p->channels;
            roots += cbrt(y) * cbrt(y);
        }
        brightest = fmax(brightest, p->weight[k]);
    }
    for (int k = 0; k < p->count; ++k) {
        p->weight[k] = 1.0 / (p->weight[k] + 0.05 * brightest);
    }
    make_scores(score, length, axis, p);
    for (int rank = 1; rank <= 3 && length[rank - 1] > 1e-12 * length[0]; ++rank) {
        double error = 0.0, b[3];
        for (int c = 0; c < p->channels; ++c) {
            error += regress(b, score, length, p, c, rank);
        }
        if (error < 0.98 * best) { /* another axis must be worth it */
            best = error;
            info->rank = rank;
        }
    }
    info->residual = sqrt(best / roots);
    for (int c = 0; c < p->channels; ++c) {
        double b[3];
        (void)regress(b, score, length, p, c, info->rank);
        for (int i = 0; i < 3; ++i) {
            map[3 * c + i] = b[0] * axis[i][0] + b[1] * axis[i][1] + b[2] * axis[i][2];
        }
    }
    tsuya_free(score);
    return TSUYA_OK;
}

static tsuya_status put_together(tsuya_samples *joined, const double *map, const tsuya_join_info *info, const tsuya_samples *camera, const tsuya_samples *wanted)
{
    const char *names[TSUYA_MATERIAL_MAX_CHANNELS];
    size_t n = (size_t)wanted->channel_count, rows = (size_t)camera->count;
    for (size_t c = 0; c < n; ++c) {
        names[c] = wanted->channel[c];
    }
    TSUYA_TRY(tsuya_samples_create(joined, camera->count + wanted->count, wanted->channel_count, names));
    for (size_t k = 0; k < rows; ++k) {
        const double *rgb = camera->value + 3 * k;
        for (size_t c = 0; c < n; ++c) {
            double v = map[3 * c] * rgb[0] + map[3 * c + 1] * rgb[1] + map[3 * c + 2] * rgb[2];
            joined->value[k * n + c] = info->radiometer_scale * (v < 0.0 ? 0.0 : v); /* NaN stays */
        }
    }
    for (size_t k = 0; k < (size_t)wanted->count * n; ++k) {
        joined->value[rows * n + k] = info->radiometer_scale * wanted->value[k];
    }
    memcpy(joined->wi, camera->wi, rows * sizeof *camera->wi);
    memcpy(joined->wo, camera->wo, rows * sizeof *camera->wo);
    memcpy(joined->wi + rows, wanted->wi, (size_t)wanted->count * sizeof *wanted->wi);
    memcpy(joined->wo + rows, wanted->wo, (size_t)wanted->count * sizeof *wanted->wo);
    joined->relative = info->relative;
    joined->scale_sigma = info->scale_sigma;
    return TSUYA_OK;
}

tsuya_status tsuya_samples_join(tsuya_samples *joined, tsuya_join_info *info, const tsuya_samples *camera, const tsuya_samples *radiometer, bool spectral,
                                const tsuya_context *context)
{
    tsuya_samples rgb = {0};
    pairs p = {0};
    double map[3 * TSUYA_MATERIAL_MAX_CHANNELS], level, level_sigma;
    tsuya_status status;
    *joined = (tsuya_samples){0};
    *info = (tsuya_join_info){.camera = camera->count, .radiometer = radiometer->count};
    if (camera->channel_count != 3 || strcmp(camera->channel[0], "r") != 0) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "the camera's table has %d channels from %s on; expected r, g, b", camera->channel_count, camera->channel[0]);
    }
    TSUYA_TRY(tsuya_samples_to_color(&rgb, radiometer, TSUYA_COLOR_RGB));
    TSUYA_GOTO_DONE(status, link_tables(&p, camera, spectral ? radiometer : &rgb, &rgb, context));
    info->linked = p.count;
    gains(info, &level, &level_sigma, &p);
    share_scales(info, level, level_sigma, camera, radiometer);
    TSUYA_GOTO_DONE(status, fit_map(map, info, &p));
    status = put_together(joined, map, info, camera, spectral ? radiometer : &rgb);
done:
    free_pairs(&p);
    tsuya_samples_free(&rgb);
    return status;
}
