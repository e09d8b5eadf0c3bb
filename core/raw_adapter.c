/* LibRaw behind core/image_adapters.h: linear 16-bit, camera white balance, sRGB primaries, no auto-brightness, unrotated. */
#include "core/exif_adapter.h"
#include "core/image_adapters.h"

#include <libraw/libraw.h>
#include <string.h>
#include <time.h>

static tsuya_status fail_raw(const char *path, int code)
{
    return tsuya_fail(TSUYA_ERROR_INPUT, "%s: not camera raw that can be read: %s", path, libraw_strerror(code));
}

/* LibRaw goes on where the file ends too early, and would print it; the offset is −1 at the end of the file. */
static void note_damage(void *damaged, const char *file, const int offset)
{
    (void)file, (void)offset;
    *(bool *)damaged = true;
}

static libraw_data_t *create_raw(bool *damaged)
{
    libraw_data_t *raw = libraw_init(0);
    *damaged = false;
    if (raw) {
        libraw_set_dataerror_handler(raw, note_damage, damaged);
    }
    return raw;
}

static tsuya_status open_raw(libraw_data_t **raw, bool *damaged, const char *path)
{
    *raw = create_raw(damaged);
    if (!*raw) {
        return tsuya_fail(TSUYA_ERROR_MEMORY, "%s: out of memory", path);
    }
    int code = libraw_open_file(*raw, path);
    if (code == LIBRAW_SUCCESS) {
        (*raw)->params.user_flip = 0;
        code = libraw_adjust_sizes_info_only(*raw);
    }
    if (code != LIBRAW_SUCCESS) {
        tsuya_status status = fail_raw(path, code);
        libraw_close(*raw);
        *raw = NULL;
        return status;
    }
    return TSUYA_OK;
}

tsuya_status tsuya_raw_probe(int *width_px, int *height_px, const char *path)
{
    libraw_data_t *raw;
    bool damaged;
    TSUYA_TRY(open_raw(&raw, &damaged, path));
    *width_px = raw->sizes.iwidth;
    *height_px = raw->sizes.iheight;
    libraw_close(raw);
    return TSUYA_OK;
}

static double known(float value)
{
    return value > 0.0f && value < 1e9f ? (double)value : 0.0;
}

/* LibRaw's flip (0, 3: half a turn, 5: 90° against the clock, 6: 90° with it) as EXIF's orientation. */
static int orientation_of(int flip)
{
    return flip == 3 ? 3 : flip == 5 ? 8 : flip == 6 ? 6 : 1;
}

void tsuya_raw_exif_read(tsuya_photo *photo, const char *path)
{
    bool damaged;
    libraw_data_t *raw = create_raw(&damaged);
    if (!raw) {
        return;
    }
    if (libraw_open_file(raw, path) == LIBRAW_SUCCESS) {
        photo->orientation = orientation_of(raw->sizes.flip);
        photo->focal_mm = known(raw->other.focal_len);
        photo->focal_35mm = known(raw->lens.FocalLengthIn35mmFormat);
        photo->exposure_s = known(raw->other.shutter);
        photo->f_number = known(raw->other.aperture);
        photo->iso = known(raw->other.iso_speed);
        snprintf(photo->make, sizeof photo->make, "%.*s", (int)sizeof photo->make - 1, raw->idata.make);
        snprintf(photo->model, sizeof photo->model, "%.*s", (int)sizeof photo->model - 1, raw->idata.model);
        struct tm taken;
        if (raw->other.timestamp > 0 && localtime_r(&raw->other.timestamp, &taken)) { /* LibRaw made it of the camera's own clock */
            strftime(photo->taken, sizeof photo->taken, "%Y:%m:%d %H:%M:%S", &taken);
        }
    }
    libraw_close(raw);
}

tsuya_status tsuya_raw_load(tsuya_image *image, const char *path)
{
    int code = LIBRAW_SUCCESS;
    bool damaged;
    libraw_data_t *raw = create_raw(&damaged);
    libraw_processed_image_t *pixels = NULL;
    tsuya_status status = TSUYA_OK;
    if (!raw) {
        return tsuya_fail(TSUYA_ERROR_MEMORY, "%s: out of memory", path);
    }
    raw->params.output_bps = 16;
    raw->params.gamm[0] = raw->params.gamm[1] = 1.0;
    raw->params.no_auto_bright = 1;
    raw->params.use_camera_wb = 1;
    raw->params.output_color = 1;
    raw->params.user_flip = 0;
    if ((code = libraw_open_file(raw, path)) != LIBRAW_SUCCESS || (code = libraw_unpack(raw)) != LIBRAW_SUCCESS
        || (code = libraw_dcraw_process(raw)) != LIBRAW_SUCCESS || !(pixels = libraw_dcraw_make_mem_image(raw, &code))) {
        status = fail_raw(path, code);
        goto done;
    }
    if (damaged) {
        status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: the camera raw is truncated or damaged", path);
        goto done;
    }
    if (pixels->bits != 16 || (pixels->colors != 1 && pixels->colors != 3)) {
        status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: raw with %d colours of %d bits cannot be used", path, pixels->colors, pixels->bits);
        goto done;
    }
    TSUYA_GOTO_DONE(status, tsuya_image_create(image, pixels->width, pixels->height, pixels->colors, TSUYA_SAMPLE_U16, TSUYA_ENCODING_LINEAR));
    memcpy(image->data, pixels->data, (size_t)image->height_px * image->row_bytes);
done:
    if (pixels) {
        libraw_dcraw_clear_mem(pixels);
    }
    libraw_close(raw);
    return status;
}
