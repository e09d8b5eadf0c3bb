#include "render/compare.h"

#include "core/color.h"
#include "core/memory.h"

#include <math.h>
#include <string.h>

enum { WINDOW = 11, BAND = WINDOW / 2, PLANES = 6 };

tsuya_compare_options tsuya_compare_options_default(void)
{
    return (tsuya_compare_options){.gain = {NAN, NAN, NAN}};
}

/* Everything of one comparison, pixel by pixel at the render's size. */
typedef struct pair {
    int width, height;
    const tsuya_image *render;
    tsuya_image photo; /* linear float */
    uint8_t *compared; /* 0 or 1 */
    size_t mask_pixels, pixels;
    int threads;
} pair;

static void pair_free(pair *p)
{
    tsuya_image_free(&p->photo);
    tsuya_free(p->compared);
}

static tsuya_status check_shape(const tsuya_image *image, const tsuya_image *render, const char *what, const char *name)
{
    double ratio = (double)image->width_px / render->width_px, other = (double)image->height_px / render->height_px;
    if (fabs(ratio - other) * render->height_px > 1.5 * fmax(1.0, ratio) || ratio < 1.0 - 1e-9) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: the %s has %d × %d pixels, the render %d × %d; the same shape and no fewer pixels are needed",
                          name, what, image->width_px, image->height_px, render->width_px, render->height_px);
    }
    return TSUYA_OK;
}

/* Linear light at the render's size. */
static tsuya_status take_photo(pair *p, const tsuya_image *photo, const char *name)
{
    if (photo->channels < 3 || photo->encoding == TSUYA_ENCODING_DATA) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: %d channels; a colour photograph is needed", name, photo->channels);
    }
    TSUYA_TRY(check_shape(photo, p->render, "photograph", name));
    tsuya_image linear = {0};
    TSUYA_TRY(tsuya_image_convert(&linear, photo, TSUYA_SAMPLE_F32, TSUYA_ENCODING_LINEAR));
    tsuya_status status = tsuya_image_resize(&p->photo, &linear, p->width, p->height);
    tsuya_image_free(&linear);
    return status;
}

static tsuya_status choose_pixels(pair *p, const tsuya_image *mask, const char *name)
{
    tsuya_image kept = {0};
    if (mask) {
        TSUYA_TRY(check_shape(mask, p->render, "mask", name));
        TSUYA_TRY(tsuya_image_resize(&kept, mask, p->width, p->height));
    }
    for (int y = 0; y < p->height; ++y) {
        for (int x = 0; x < p->width; ++x) {
            float coverage = tsuya_image_f32(p->render, x, y)[3];
            bool inside = mask ? tsuya_image_get(&kept, x, y, 0) > 0.5f : coverage > 0.0f;
            bool compared = inside && coverage > 0.995f;
            p->compared[(size_t)y * (size_t)p->width + (size_t)x] = compared;
            p->mask_pixels += inside;
            p->pixels += compared;
        }
    }
    tsuya_image_free(&kept);
    return p->pixels > 0 ? TSUYA_OK
                         : tsuya_fail(TSUYA_ERROR_INPUT, "%s: no pixel of the mask shows the cloth in the render; nothing can be compared", name);
}

static tsuya_status fit_gain(double gain[3], const pair *p, const char *name)
{
    const float low = tsuya_srgb_decode(2.0f / 255.0f), high = tsuya_srgb_decode(250.0f / 255.0f);
    double shown[3] = {0, 0, 0}, rendered[3] = {0, 0, 0};
    for (size_t k = 0; k < (size_t)p->width * (size_t)p->height; ++k) {
        int x = (int)(k % (size_t)p->width), y = (int)(k / (size_t)p->width);
        const float *a = tsuya_image_f32(&p->photo, x, y), *b = tsuya_image_f32(p->render, x, y);
        bool clipped = fmaxf(a[0], fmaxf(a[1], a[2])) > high || fmaxf(a[0], fmaxf(a[1], a[2])) < low;
        for (int c = 0; c < 3 && p->compared[k] && !clipped; ++c) {
            shown[c] += a[c];
            rendered[c] += b[c];
        }
    }
    for (int c = 0; c < 3; ++c) {
        gain[c] = shown[c] / rendered[c];
        if (!(gain[c] > 0.0 && isfinite(gain[c]))) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: the %s of photograph and render sum to %g and %g; no exposure can be fitted", name,
                              c == 0 ? "reds" : c == 1 ? "greens" : "blues", shown[c], rendered[c]);
        }
    }
    return TSUYA_OK;
}

static float shown(const tsuya_comparison *r, const float *render, int c)
{
    return fminf(1.0f, fmaxf(0.0f, (float)(r->gain[c] * (double)render[c])));
}

/* ΔE00 per pixel (−1 outside), and the sum of squared differences of encoded values. */
static tsuya_status measure_color(tsuya_comparison *r, tsuya_image *map, tsuya_de00_histogram *histogram, const pair *p)
{
    tsuya_status status = TSUYA_OK;
    double *row_squares = NULL, squares = 0.0, sum = 0.0;
    tsuya_de00_histogram *own = NULL;
    TSUYA_NEW(status, row_squares, (size_t)p->height);
    TSUYA_NEW(status, own, 1);
#pragma omp parallel for schedule(static) num_threads(p->threads)
    for (int y = 0; y < p->height; ++y) {
        for (int x = 0; x < p->width; ++x) {
            const float *a = tsuya_image_f32(&p->photo, x, y), *b = tsuya_image_f32(p->render, x, y);
            float *out = tsuya_image_f32(map, x, y), g[3];
            *out = -1.0f;
            if (!p->compared[(size_t)y * (size_t)p->width + (size_t)x]) {
                continue;
            }
            for (int c = 0; c < 3; ++c) {
                g[c] = shown(r, b, c);
                double d = (double)tsuya_srgb_encode(a[c]) - (double)tsuya_srgb_encode(g[c]);
                row_squares[y] += d * d;
            }
            *out = (float)tsuya_color_difference(tsuya_lab_from_rgb((tsuya_vec3){a[0], a[1], a[2]}),
                                                 tsuya_lab_from_rgb((tsuya_vec3){g[0], g[1], g[2]}));
        }
    }
    for (int y = 0; y < p->height; ++y) {
        squares += row_squares[y];
        for (int x = 0; x < p->width; ++x) {
            double e = *tsuya_image_f32(map, x, y);
            if (e >= 0.0) {
                sum += e;
                own->count[(int)fmin(e * 50.0, TSUYA_DE00_BINS - 1)]++;
                own->pixels++;
            }
        }
    }
    r->psnr_db = squares > 0.0 ? -10.0 * log10(squares / (3.0 * (double)p->pixels)) : INFINITY;
    r->de00_mean = sum / (double)p->pixels;
    r->de00_median = tsuya_de00_quantile(own, 0.5);
    r->de00_p95 = tsuya_de00_quantile(own, 0.95);
    for (int k = 0; histogram && k < TSUYA_DE00_BINS; ++k) {
        histogram->count[k] += own->count[k];
    }
    if (histogram) {
        histogram->sum += sum;
        histogram->pixels += own->pixels;
    }
done:
    tsuya_free(row_squares);
    tsuya_free(own);
    return status;
}

double tsuya_de00_quantile(const tsuya_de00_histogram *histogram, double share)
{
    double wanted = share * (double)histogram->pixels, before = 0.0;
    for (int k = 0; k < TSUYA_DE00_BINS && histogram->pixels > 0; ++k) {
        double here = (double)histogram->count[k];
        if (here > 0.0 && before + here >= wanted) {
            return 0.02 * (k + fmin(1.0, fmax(0.0, (wanted - before) / here)));
        }
        before += here;
    }
    return histogram->pixels > 0 ? 0.02 * TSUYA_DE00_BINS : NAN;
}

/* Weight, a, b, a², b², ab of every compared pixel; zeros elsewhere. */
static void fill_planes(float *plane, const pair *p, const tsuya_comparison *r)
{
    size_t pixels = (size_t)p->width * (size_t)p->height;
#pragma omp parallel for schedule(static) num_threads(p->threads)
    for (int y = 0; y < p->height; ++y) {
        for (int x = 0; x < p->width; ++x) {
            size_t k = (size_t)y * (size_t)p->width + (size_t)x;
            float a[3], b[3];
            for (int c = 0; c < 3 && p->compared[k]; ++c) {
                a[c] = tsuya_srgb_encode(tsuya_image_f32(&p->photo, x, y)[c]);
                b[c] = tsuya_srgb_encode(shown(r, tsuya_image_f32(p->render, x, y), c));
            }
            double u = p->compared[k] ? tsuya_rgb_luminance_f32(a) : 0.0, v = p->compared[k] ? tsuya_rgb_luminance_f32(b) : 0.0;
            const double value[PLANES] = {p->compared[k], u, v, u * u, v * v, u * v};
            for (size_t i = 0; i < PLANES; ++i) {
                plane[i * pixels + k] = (float)value[i];
            }
        }
    }
}

/* One direction of the Gaussian; `step` pixels apart along it, `length` of them. */
static void blur_line(float *out, const float *in, int length, size_t step, const float weight[WINDOW])
{
    for (int i = 0; i < length; ++i) {
        float sum = 0.0f;
        for (int k = 0; k < WINDOW; ++k) {
            int j = i + k - BAND;
            sum += j >= 0 && j < length ? weight[k] * in[(size_t)j * step] : 0.0f;
        }
        out[(size_t)i * step] = sum;
    }
}

static void blur(float *plane, float *scratch, const pair *p)
{
    float weight[WINDOW], sum = 0.0f;
    for (int k = 0; k < WINDOW; ++k) {
        double d = (k - BAND) / 1.5;
        weight[k] = (float)exp(-0.5 * d * d);
        sum += weight[k];
    }
    for (int k = 0; k < WINDOW; ++k) {
        weight[k] /= sum;
    }
    size_t width = (size_t)p->width;
#pragma omp parallel for schedule(static) num_threads(p->threads)
    for (int y = 0; y < p->height; ++y) {
        blur_line(scratch + (size_t)y * width, plane + (size_t)y * width, p->width, 1, weight);
    }
#pragma omp parallel for schedule(static) num_threads(p->threads)
    for (int x = 0; x < p->width; ++x) {
        blur_line(plane + x, scratch + x, p->height, width, weight);
    }
}

static tsuya_status measure_structure(tsuya_comparison *r, const pair *p)
{
    tsuya_status status = TSUYA_OK;
    float *plane = NULL, *scratch = NULL;
    size_t pixels = (size_t)p->width * (size_t)p->height, windows = 0;
    double sum = 0.0;
    const double c1 = 0.01 * 0.01, c2 = 0.03 * 0.03;
    TSUYA_NEW(status, plane, PLANES * pixels);
    TSUYA_NEW(status, scratch, pixels);
    fill_planes(plane, p, r);
    for (size_t i = 0; i < PLANES; ++i) {
        blur(plane + i * pixels, scratch, p);
    }
    for (size_t k = 0; k < pixels; ++k) {
        double w = plane[k];
        if (!p->compared[k] || w < 0.5) {
            continue;
        }
        double a = plane[pixels + k] / w, b = plane[2 * pixels + k] / w;
        double aa = fmax(0.0, plane[3 * pixels + k] / w - a * a), bb = fmax(0.0, plane[4 * pixels + k] / w - b * b);
        double ab = plane[5 * pixels + k] / w - a * b;
        sum += (2.0 * a * b + c1) * (2.0 * ab + c2) / ((a * a + b * b + c1) * (aa + bb + c2));
        ++windows;
    }
    r->ssim = windows > 0 ? sum / (double)windows : NAN;
done:
    tsuya_free(plane);
    tsuya_free(scratch);
    return status;
}

tsuya_status tsuya_compare(tsuya_comparison *result, tsuya_image *map, tsuya_de00_histogram *histogram, const tsuya_image *render,
                           const tsuya_image *photo, const tsuya_image *mask, const tsuya_compare_options *options, const char *name,
                           const tsuya_context *context)
{
    tsuya_status status = TSUYA_OK;
    tsuya_image own = {0};
    pair p = {.width = render->width_px, .height = render->height_px, .render = render, .threads = context->threads};
    *result = (tsuya_comparison){.fitted = isnan(options->gain[0])};
    memcpy(result->gain, options->gain, sizeof result->gain);
    if (render->channels != 4 || render->sample != TSUYA_SAMPLE_F32) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: the render has %d channels; linear float red, green, blue and coverage are needed", name,
                          render->channels);
    }
    TSUYA_NEW(status, p.compared, (size_t)p.width * (size_t)p.height);
    TSUYA_GOTO_DONE(status, take_photo(&p, photo, name));
    TSUYA_GOTO_DONE(status, choose_pixels(&p, mask, name));
    result->pixels = (double)p.pixels;
    result->compared = (double)p.pixels / (double)p.mask_pixels;
    if (result->fitted) {
        TSUYA_GOTO_DONE(status, fit_gain(result->gain, &p, name));
    }
    TSUYA_GOTO_DONE(status, tsuya_image_create(&own, p.width, p.height, 1, TSUYA_SAMPLE_F32, TSUYA_ENCODING_DATA));
    TSUYA_GOTO_DONE(status, measure_color(result, &own, histogram, &p));
    TSUYA_GOTO_DONE(status, measure_structure(result, &p));
    if (map) {
        *map = own;
        own = (tsuya_image){0};
    }
done:
    tsuya_image_free(&own);
    pair_free(&p);
    return status;
}

/* Smallest box around what was compared, with a rim. */
static void find_box(int box[4], const tsuya_image *map)
{
    int low_x = map->width_px, low_y = map->height_px, high_x = -1, high_y = -1, rim = 2 + map->width_px / 50;
    for (int y = 0; y < map->height_px; ++y) {
        for (int x = 0; x < map->width_px; ++x) {
            if (*tsuya_image_f32(map, x, y) >= 0.0f) {
                low_x = x < low_x ? x : low_x;
                low_y = y < low_y ? y : low_y;
                high_x = x > high_x ? x : high_x;
                high_y = y;
            }
        }
    }
    box[0] = low_x > rim ? low_x - rim : 0;
    box[1] = low_y > rim ? low_y - rim : 0;
    box[2] = high_x + rim < map->width_px ? high_x + rim : map->width_px - 1;
    box[3] = high_y + rim < map->height_px ? high_y + rim : map->height_px - 1;
}

static uint8_t byte_of(double value)
{
    return (uint8_t)lrint(255.0 * fmin(1.0, fmax(0.0, value)));
}

tsuya_status tsuya_compare_picture(tsuya_image *picture, const tsuya_comparison *result, const tsuya_image *map,
                                   const tsuya_image *render, const tsuya_image *photo)
{
    int box[4];
    tsuya_image linear = {0}, fitted = {0};
    *picture = (tsuya_image){0};
    tsuya_status status;
    find_box(box, map);
    int width = box[2] - box[0] + 1, height = box[3] - box[1] + 1, gap = 2 + width / 60;
    TSUYA_GOTO_DONE(status, tsuya_image_convert(&linear, photo, TSUYA_SAMPLE_F32, TSUYA_ENCODING_LINEAR));
    TSUYA_GOTO_DONE(status, tsuya_image_resize(&fitted, &linear, map->width_px, map->height_px));
    TSUYA_GOTO_DONE(status, tsuya_image_create(picture, 3 * width + 2 * gap, height, 3, TSUYA_SAMPLE_U8, TSUYA_ENCODING_SRGB));
    for (int y = 0; y < height; ++y) {
        memset(tsuya_image_u8(picture, 0, y), 255, picture->row_bytes);
        for (int x = 0; x < width; ++x) {
            const float *a = tsuya_image_f32(&fitted, box[0] + x, box[1] + y), *b = tsuya_image_f32(render, box[0] + x, box[1] + y);
            double t = 3.0 * fmax(0.0, (double)*tsuya_image_f32(map, box[0] + x, box[1] + y)) / 20.0;
            for (int c = 0; c < 3; ++c) {
                tsuya_image_u8(picture, x, y)[c] = byte_of(tsuya_srgb_encode(a[c]));
                tsuya_image_u8(picture, width + gap + x, y)[c] = byte_of(tsuya_srgb_encode(shown(result, b, c)));
                tsuya_image_u8(picture, 2 * (width + gap) + x, y)[c] = byte_of(t - c);
            }
        }
    }
done:
    tsuya_image_free(&linear);
    tsuya_image_free(&fitted);
    return status;
}

void tsuya_comparison_to_json(tsuya_json *object, const tsuya_comparison *r)
{
    tsuya_json_set_numbers(object, "gain", r->gain, 3);
    tsuya_json_set_bool(object, "gain_fitted", r->fitted);
    tsuya_json_set_number(object, "compared", r->compared);
    tsuya_json_set_number(object, "pixels", r->pixels);
    tsuya_json_set_number(object, "psnr_db", r->psnr_db);
    tsuya_json_set_number(object, "ssim", r->ssim);
    tsuya_json *de00 = tsuya_json_set_object(object, "de00");
    tsuya_json_set_number(de00, "mean", r->de00_mean);
    tsuya_json_set_number(de00, "median", r->de00_median);
    tsuya_json_set_number(de00, "p95", r->de00_p95);
}
