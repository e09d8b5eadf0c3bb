#include "reconstruct/pinhole.h"

#include "core/file.h"
#include "core/image.h"
#include "reconstruct/undistort.h"

#include <math.h>
#include <string.h>

/* SAMPLES along each edge, and a grid of GRID × GRID for the figures. */
enum { SAMPLES = 64, GRID = 48, LEAST_PX = 64, JPEG_QUALITY = 98 };
static const double MOST_TAN = 1.7320508075688772 /* 60 degrees */, STEP_TAN = 1e-4, SHRINK = 0.99, OUTSIDE_PX = 1.0, CLOSURE_PX = 1e-3;

/* Directions (x/z, y/z) between low and high. */
typedef struct box { tsuya_vec2 low, high; } box;

bool tsuya_pinhole_needed(const tsuya_camera *lens) { return lens->lens > TSUYA_LENS_OPENCV8; }

static bool direction(tsuya_vec2 *tangent, const tsuya_camera *lens, tsuya_vec2 pixel)
{
    tsuya_vec3 ray;
    if (!tsuya_camera_unproject(lens, pixel, &ray) || !(ray.z > 0.0)) {
        return false;
    }
    *tangent = (tsuya_vec2){ray.x / ray.z, ray.y / ray.z};
    return true;
}

/* Each side goes inward until the whole edge of the image lies outside; an edge farther off than MOST_TAN limits nothing. */
static box seen_box(const tsuya_camera *lens)
{
    box b = {{-MOST_TAN, -MOST_TAN}, {MOST_TAN, MOST_TAN}};
    tsuya_vec2 t;
    for (int i = 0; i <= SAMPLES; i++) {
        double x = (double)i / SAMPLES * lens->width_px - 0.5, y = (double)i / SAMPLES * lens->height_px - 0.5;
        b.low.x = direction(&t, lens, (tsuya_vec2){-0.5, y}) ? fmax(b.low.x, t.x) : b.low.x;
        b.high.x = direction(&t, lens, (tsuya_vec2){lens->width_px - 0.5, y}) ? fmin(b.high.x, t.x) : b.high.x;
        b.low.y = direction(&t, lens, (tsuya_vec2){x, -0.5}) ? fmax(b.low.y, t.y) : b.low.y;
        b.high.y = direction(&t, lens, (tsuya_vec2){x, lens->height_px - 0.5}) ? fmin(b.high.y, t.y) : b.high.y;
    }
    return b;
}

/* The lens images this direction, within its picture, and before any fold of its distortion. */
static bool sees(double *closure, const tsuya_camera *lens, double x, double y)
{
    tsuya_vec2 pixel, back;
    if (!tsuya_camera_project(lens, (tsuya_vec3){x, y, 1.0}, &pixel) || pixel.x < -0.5 - OUTSIDE_PX || pixel.y < -0.5 - OUTSIDE_PX
        || pixel.x > lens->width_px - 0.5 + OUTSIDE_PX || pixel.y > lens->height_px - 0.5 + OUTSIDE_PX || !direction(&back, lens, pixel)) {
        return false;
    }
    *closure = fmax(*closure, lens->fx_px * hypot(back.x - x, back.y - y));
    return lens->fx_px * hypot(back.x - x, back.y - y) < CLOSURE_PX;
}

static bool holds(double *closure, const tsuya_camera *lens, const box *b)
{
    for (int i = 0; i <= SAMPLES; i++) {
        double x = b->low.x + (b->high.x - b->low.x) * i / SAMPLES, y = b->low.y + (b->high.y - b->low.y) * i / SAMPLES;
        if (!sees(closure, lens, x, b->low.y) || !sees(closure, lens, x, b->high.y) || !sees(closure, lens, b->low.x, y) || !sees(closure, lens, b->high.x, y)) {
            return false;
        }
    }
    return true;
}

/* Pixels for a unit of x/z or y/z on the axis, the larger. */
static double focal_on_axis(const tsuya_camera *lens)
{
    tsuya_vec2 middle, x, y;
    if (!tsuya_camera_project(lens, (tsuya_vec3){0.0, 0.0, 1.0}, &middle) || !tsuya_camera_project(lens, (tsuya_vec3){STEP_TAN, 0.0, 1.0}, &x)
        || !tsuya_camera_project(lens, (tsuya_vec3){0.0, STEP_TAN, 1.0}, &y)) {
        return 0.0;
    }
    return fmax(hypot(x.x - middle.x, x.y - middle.y), hypot(y.x - middle.x, y.y - middle.y)) / STEP_TAN;
}

static void measure(tsuya_pinhole_info *info, const tsuya_camera *pinhole, const tsuya_camera *lens, double closure)
{
    int inside = 0;
    *info = (tsuya_pinhole_info){.closure_px = closure};
    for (int i = 0; i < GRID * GRID; i++) {
        tsuya_vec2 seen = {(i % GRID + 0.5) / GRID * lens->width_px - 0.5, (i / GRID + 0.5) / GRID * lens->height_px - 0.5}, pixel;
        double growth;
        if (tsuya_pinhole_pixel(&pixel, &growth, pinhole, lens, seen) && pixel.x >= -0.5 && pixel.y >= -0.5 && pixel.x <= pinhole->width_px - 0.5
            && pixel.y <= pinhole->height_px - 0.5) {
            inside++;
            info->stretch = fmax(info->stretch, growth * growth);
        }
    }
    info->kept = (double)inside / (GRID * GRID);
}

tsuya_status tsuya_pinhole_of(tsuya_camera *pinhole, tsuya_pinhole_info *info, const tsuya_camera *lens, const char *name)
{
    box b = seen_box(lens);
    const double focal = focal_on_axis(lens);
    double closure = 0.0, size = 1.0;
    box own = b;
    for (closure = 0.0; size * focal * fmin(b.high.x - b.low.x, b.high.y - b.low.y) >= LEAST_PX && !holds(&closure, lens, &own); closure = 0.0) {
        size *= SHRINK;
        own = (box){{size * b.low.x, size * b.low.y}, {size * b.high.x, size * b.high.y}};
    }
    const double width = focal * (own.high.x - own.low.x), height = focal * (own.high.y - own.low.y);
    if (!(own.low.x < 0.0 && own.low.y < 0.0 && own.high.x > 0.0 && own.high.y > 0.0) || !(width >= LEAST_PX) || !(height >= LEAST_PX)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: the lens images less than %d pixels around its axis; COLMAP has no model for it, and a pinhole would see nothing",
                          name, LEAST_PX);
    }
    *pinhole = (tsuya_camera){.lens = TSUYA_LENS_PINHOLE, .width_px = (int)floor(width), .height_px = (int)floor(height), .fx_px = focal, .fy_px = focal,
                              .cx_px = -own.low.x * focal - 0.5, .cy_px = -own.low.y * focal - 0.5};
    measure(info, pinhole, lens, closure);
    return TSUYA_OK;
}

bool tsuya_pinhole_pixel(tsuya_vec2 *pixel, double *growth, const tsuya_camera *pinhole, const tsuya_camera *lens, tsuya_vec2 seen)
{
    tsuya_vec3 ray;
    if (!tsuya_camera_unproject(lens, seen, &ray) || !tsuya_camera_project(pinhole, ray, pixel)) {
        return false;
    }
    if (growth) {
        tsuya_vec2 x, y;
        if (!tsuya_pinhole_pixel(&x, NULL, pinhole, lens, (tsuya_vec2){seen.x + 0.5, seen.y})
            || !tsuya_pinhole_pixel(&y, NULL, pinhole, lens, (tsuya_vec2){seen.x, seen.y + 0.5})) {
            return false;
        }
        *growth = 2.0 * sqrt(fabs((x.x - pixel->x) * (y.y - pixel->y) - (x.y - pixel->y) * (y.x - pixel->x)));
    }
    return true;
}

static tsuya_status draw_photo(const char *path, const tsuya_photo *photo, const tsuya_camera *pinhole, const tsuya_camera *lens, const tsuya_context *context)
{
    tsuya_image in = {0}, samples = {0}, out = {0}, rounded = {0};
    tsuya_image_save_options options = tsuya_image_save_options_default();
    tsuya_status status;
    options.jpeg_quality = JPEG_QUALITY;
    TSUYA_GOTO_DONE(status, tsuya_image_load(&in, photo->path));
    TSUYA_GOTO_DONE(status, tsuya_image_convert(&samples, &in, TSUYA_SAMPLE_F32, in.encoding));
    TSUYA_GOTO_DONE(status, tsuya_undistort(&out, &samples, pinhole, lens, TSUYA_RESAMPLE_LANCZOS, context->threads));
    TSUYA_GOTO_DONE(status, tsuya_image_convert(&rounded, &out, in.sample, in.encoding));
    status = tsuya_image_save(&rounded, path, &options);
done:
    tsuya_image_free(&in);
    tsuya_image_free(&samples);
    tsuya_image_free(&out);
    tsuya_image_free(&rounded);
    return status;
}

tsuya_status tsuya_pinhole_photos(const char *folder, const tsuya_camera *pinhole, const tsuya_camera *lens, const tsuya_photo_set *photos,
                                  const tsuya_context *context)
{
    char path[8192];
    bool masks = false;
    for (int i = 0; i < photos->count; i++) {
        masks = masks || photos->photo[i].mask_path;
    }
    snprintf(path, sizeof path, "%s/photos", folder);
    TSUYA_TRY(tsuya_folder_make(path));
    snprintf(path, sizeof path, "%s/masks", folder);
    TSUYA_TRY(masks ? tsuya_folder_make(path) : TSUYA_OK);
    for (int i = 0; i < photos->count; i++) {
        const tsuya_photo *photo = &photos->photo[i];
        TSUYA_TRY(tsuya_check_interrupt());
        tsuya_progress_update(context, "pinhole photographs", i, photos->count, photo->name);
        snprintf(path, sizeof path, "%s/photos/%s", folder, photo->name);
        TSUYA_TRY(draw_photo(path, photo, pinhole, lens, context));
        snprintf(path, sizeof path, "%s/masks/%s.png", folder, photo->name);
        TSUYA_TRY(photo->mask_path ? tsuya_undistort_mask(path, photo->mask_path, pinhole, lens, context->threads) : TSUYA_OK);
    }
    tsuya_progress_update(context, "pinhole photographs", photos->count, photos->count, NULL);
    return TSUYA_OK;
}

tsuya_status tsuya_pinhole_sightings(tsuya_scale_input *out, const tsuya_scale_input *in, const tsuya_camera *pinhole, const tsuya_camera *lens,
                                     tsuya_arena *arena)
{
    tsuya_scale_sighting *sighting = tsuya_arena_alloc(arena, (size_t)in->sighting_count + 1, sizeof *sighting);
    if (!sighting) {
        return TSUYA_ERROR_MEMORY;
    }
    *out = *in;
    out->sighting = sighting;
    out->sighting_count = 0;
    for (int i = 0; i < in->sighting_count; i++) {
        tsuya_scale_sighting s = in->sighting[i];
        double growth;
        if (tsuya_pinhole_pixel(&s.pixel, &growth, pinhole, lens, in->sighting[i].pixel)) {
            s.sigma_px *= growth;
            sighting[out->sighting_count++] = s;
        }
    }
    return TSUYA_OK;
}
