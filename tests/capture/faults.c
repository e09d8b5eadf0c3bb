#include "support.h"

#include "capture/faults.h"
#include "core/image.h"

#include <math.h>

void faults_take_all(const char *to_folder, const char *from_folder)
{
    tsuya_arena *arena;
    char **name;
    int count;
    assert_ok(tsuya_folder_make(to_folder));
    assert_ok(tsuya_arena_create(&arena, 1 << 12));
    assert_ok(tsuya_folder_list(&name, &count, from_folder, arena));
    for (int i = 0; i < count; i++) {
        char *from = tsuya_path_join(from_folder, name[i]), *to = tsuya_path_join(to_folder, name[i]);
        const char *extension = tsuya_path_extension(name[i]);
        if (strcmp(extension, ".jpg") == 0 || strcmp(extension, ".png") == 0) {
            assert_int_equal(symlink(from, to), 0);
        }
        tsuya_free(from);
        tsuya_free(to);
    }
    tsuya_arena_free(arena);
}

static void load_linear(tsuya_image *linear, const char *from)
{
    tsuya_image loaded;
    assert_ok(tsuya_image_load(&loaded, from));
    assert_ok(tsuya_image_convert(linear, &loaded, TSUYA_SAMPLE_F32, TSUYA_ENCODING_LINEAR));
    tsuya_image_free(&loaded);
}

static void save(const tsuya_image *linear, const char *to)
{
    tsuya_image encoded;
    tsuya_image_save_options options = tsuya_image_save_options_default();
    options.jpeg_quality = 95;
    assert_ok(tsuya_image_convert(&encoded, linear, TSUYA_SAMPLE_U8, TSUYA_ENCODING_SRGB));
    unlink(to);
    assert_ok(tsuya_image_save(&encoded, to, &options));
    tsuya_image_free(&encoded);
}

/* Convolution of the linear light along (dx, dy). */
static void convolve(tsuya_image *out, const tsuya_image *in, const double *kernel, int radius, int dx, int dy)
{
    assert_ok(tsuya_image_copy(out, in));
    for (int y = 0; y < in->height_px; y++) {
        for (int x = 0; x < in->width_px; x++) {
            double sum[3] = {0, 0, 0};
            for (int k = -radius; k <= radius; k++) {
                int sx = x + k * dx, sy = y + k * dy;
                sx = sx < 0 ? 0 : sx >= in->width_px ? in->width_px - 1 : sx;
                sy = sy < 0 ? 0 : sy >= in->height_px ? in->height_px - 1 : sy;
                for (int c = 0; c < 3; c++) {
                    sum[c] += kernel[k + radius] * (double)tsuya_image_f32(in, sx, sy)[c];
                }
            }
            for (int c = 0; c < 3; c++) {
                tsuya_image_f32(out, x, y)[c] = (float)sum[c];
            }
        }
    }
}

void fault_gaussian(const char *to, const char *from, double sigma_px)
{
    double kernel[65], sum = 0.0;
    int radius = (int)ceil(3.0 * sigma_px);
    for (int k = -radius; k <= radius; k++) {
        sum += kernel[k + radius] = exp(-0.5 * k * k / (sigma_px * sigma_px));
    }
    for (int k = 0; k <= 2 * radius; k++) {
        kernel[k] /= sum;
    }
    tsuya_image linear, rows, both;
    load_linear(&linear, from);
    convolve(&rows, &linear, kernel, radius, 1, 0);
    convolve(&both, &rows, kernel, radius, 0, 1);
    save(&both, to);
    tsuya_image_free(&linear);
    tsuya_image_free(&rows);
    tsuya_image_free(&both);
}

void fault_motion(const char *to, const char *from, int length_px)
{
    double kernel[65];
    int radius = length_px / 2;
    for (int k = 0; k <= 2 * radius; k++) {
        kernel[k] = 1.0 / (2 * radius + 1);
    }
    tsuya_image linear, moved;
    load_linear(&linear, from);
    convolve(&moved, &linear, kernel, radius, 1, 0);
    save(&moved, to);
    tsuya_image_free(&linear);
    tsuya_image_free(&moved);
}

void fault_gain(const char *to, const char *from, double red, double green, double blue)
{
    double gain[3] = {red, green, blue};
    tsuya_image linear;
    load_linear(&linear, from);
    for (int y = 0; y < linear.height_px; y++) {
        for (int x = 0; x < linear.width_px; x++) {
            for (int c = 0; c < 3; c++) {
                tsuya_image_f32(&linear, x, y)[c] = (float)fmin(1.0, gain[c] * (double)tsuya_image_f32(&linear, x, y)[c]);
            }
        }
    }
    save(&linear, to);
    tsuya_image_free(&linear);
}

void fault_again(const char *to, const char *from) { fault_gain(to, from, 1.0, 1.0, 1.0); }

void fault_foreign(const char *to, const char *from, int width_px, int height_px)
{
    tsuya_image linear, sized;
    load_linear(&linear, from);
    assert_ok(tsuya_image_resize(&sized, &linear, width_px, height_px));
    save(&sized, to);
    tsuya_image_free(&linear);
    tsuya_image_free(&sized);
}

void fault_zoom(const char *to, const char *from, double factor)
{
    tsuya_image linear, zoomed;
    load_linear(&linear, from);
    assert_ok(tsuya_image_copy(&zoomed, &linear));
    double cx = 0.5 * (linear.width_px - 1), cy = 0.5 * (linear.height_px - 1);
    for (int y = 0; y < linear.height_px; y++) {
        for (int x = 0; x < linear.width_px; x++) {
            double sx = cx + (x - cx) / factor, sy = cy + (y - cy) / factor;
            int ix = (int)fmin(floor(sx), linear.width_px - 2), iy = (int)fmin(floor(sy), linear.height_px - 2);
            float fx = (float)(sx - ix), fy = (float)(sy - iy);
            const float *a = tsuya_image_f32(&linear, ix, iy), *b = tsuya_image_f32(&linear, ix + 1, iy);
            const float *c = tsuya_image_f32(&linear, ix, iy + 1), *d = tsuya_image_f32(&linear, ix + 1, iy + 1);
            for (int k = 0; k < linear.channels; k++) {
                tsuya_image_f32(&zoomed, x, y)[k] = (1 - fy) * ((1 - fx) * a[k] + fx * b[k]) + fy * ((1 - fx) * c[k] + fx * d[k]);
            }
        }
    }
    save(&zoomed, to);
    tsuya_image_free(&linear);
    tsuya_image_free(&zoomed);
}

const tsuya_checked_photo *checked(const tsuya_check *check, const char *name)
{
    for (int i = 0; i < check->count; i++) {
        if (strcmp(check->photo[i].photo.name, name) == 0) {
            return &check->photo[i];
        }
    }
    fail_msg("%s: not among the photographs", name);
    return NULL;
}

void assert_accused(const tsuya_check *check, const char *name, const char *part)
{
    const tsuya_checked_photo *p = checked(check, name);
    bool found = false;
    for (int k = 0; k < p->fault_count; k++) {
        found = found || strstr(p->fault[k], part);
    }
    if (!found) {
        fail_msg("%s: not accused of \"%s\" (edges %.2f px, %.2f EV, apart %.2f %.2f %.2f EV, limits %.2f %.2f %.2f EV, %d neighbours, strongest %d; first fault: %s)", name, part,
                 p->blur.worst_px, p->exposure_ev, p->apart_ev[0], p->apart_ev[1], p->apart_ev[2], check->limit_ev[0], check->limit_ev[1], check->limit_ev[2],
                 p->neighbours, p->strongest, p->fault_count ? p->fault[0] : "none");
    }
}
