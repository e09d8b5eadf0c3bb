/* COLMAP's dense maps (mvs/mat.h): an ASCII header "W&H&C&", then float32 little-endian, slice by slice. */
#include "core/camera.h"

#include "core/file.h"

#include <string.h>

enum { LARGEST_SIDE = 65535, MOST_CHANNELS = 16 };

tsuya_status tsuya_colmap_map_save(const char *path, int width_px, int height_px, int channels, const float *values)
{
    tsuya_file_writer writer;
    TSUYA_TRY(tsuya_file_begin(&writer, path));
    size_t count = (size_t)width_px * (size_t)height_px * (size_t)channels;
    fprintf(writer.stream, "%d&%d&%d&", width_px, height_px, channels);
    if (fwrite(values, sizeof *values, count, writer.stream) != count) {
        tsuya_status status = tsuya_fail_errno(path, "cannot write");
        tsuya_file_abort(&writer);
        return status;
    }
    return tsuya_file_commit(&writer);
}

tsuya_status tsuya_colmap_map_load(float **values, int *width_px, int *height_px, int *channels, const char *path)
{
    char *bytes;
    size_t size;
    *values = NULL;
    TSUYA_TRY(tsuya_file_load(&bytes, &size, path, (size_t)8 << 30));
    tsuya_status status = TSUYA_OK;
    int header = 0;
    bool fine = sscanf(bytes, "%5d&%5d&%2d&%n", width_px, height_px, channels, &header) == 3 && header > 0;
    if (!fine || *width_px < 1 || *height_px < 1 || *channels < 1 || *width_px > LARGEST_SIDE || *height_px > LARGEST_SIDE
        || *channels > MOST_CHANNELS) {
        status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: not a COLMAP map: \"WIDTH&HEIGHT&CHANNELS&\" expected", path);
        goto done;
    }
    size_t count = (size_t)*width_px * (size_t)*height_px * (size_t)*channels;
    if (size - (size_t)header != count * sizeof **values) {
        status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: %zu bytes of values, %d x %d x %d floats expected", path, size - (size_t)header,
                            *width_px, *height_px, *channels);
        goto done;
    }
    TSUYA_NEW(status, *values, count);
    memcpy(*values, bytes + header, count * sizeof **values);
done:
    tsuya_free(bytes);
    return status;
}
