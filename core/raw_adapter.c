/* LibRaw behind core/image_adapters.h: linear 16-bit, camera white balance, sRGB primaries, no auto-brightness, unrotated. */
#include "core/image_adapters.h"

#include <libraw/libraw.h>
#include <string.h>

static tsuya_status fail_raw(const char *path, int code)
{
    return tsuya_fail(TSUYA_ERROR_INPUT, "%s: not camera raw that can be read: %s", path, libraw_strerror(code));
}

static tsuya_status open_raw(libraw_data_t **raw, const char *path)
{
    *raw = libraw_init(0);
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
    TSUYA_TRY(open_raw(&raw, path));
    *width_px = raw->sizes.iwidth;
    *height_px = raw->sizes.iheight;
    libraw_close(raw);
    return TSUYA_OK;
}

tsuya_status tsuya_raw_load(tsuya_image *image, const char *path)
{
    libraw_data_t *raw;
    int code = LIBRAW_SUCCESS;
    TSUYA_TRY(open_raw(&raw, path));
    libraw_close(raw); /* adjust_sizes_info_only leaves the processor in a state that cannot unpack */
    raw = libraw_init(0);
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
