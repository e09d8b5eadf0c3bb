#include "pipeline/reduced.h"

#include "core/file.h"
#include "core/image.h"

#include <string.h>

/* The APP1 segment that holds EXIF, with its marker; size 0 where there is none (JPEG: ISO 10918-1, annex B). */
static void find_exif(const uint8_t *jpeg, size_t size, size_t *offset, size_t *length)
{
    *offset = *length = 0;
    for (size_t at = 2; at + 10 < size && jpeg[at] == 0xFF;) {
        size_t segment = 2 + ((size_t)jpeg[at + 2] << 8 | jpeg[at + 3]);
        if (jpeg[at + 1] == 0xE1 && memcmp(jpeg + at + 4, "Exif", 4) == 0 && at + segment <= size) {
            *offset = at;
            *length = segment;
            return;
        }
        at += segment;
    }
}

/* COLMAP starts from the focal length that EXIF tells; image writers drop it. */
static tsuya_status keep_exif(const char *to, const char *from)
{
    char *original = NULL, *reduced = NULL;
    size_t original_size, reduced_size, offset, length;
    tsuya_file_writer writer;
    tsuya_status status;
    TSUYA_GOTO_DONE(status, tsuya_file_load(&original, &original_size, from, (size_t)64 << 20));
    TSUYA_GOTO_DONE(status, tsuya_file_load(&reduced, &reduced_size, to, (size_t)64 << 20));
    find_exif((const uint8_t *)original, original_size, &offset, &length);
    TSUYA_GOTO_DONE(status, tsuya_file_begin(&writer, to));
    fwrite(reduced, 1, 2, writer.stream);
    fwrite(original + offset, 1, length, writer.stream);
    fwrite(reduced + 2, 1, reduced_size - 2, writer.stream);
    status = tsuya_file_commit(&writer);
done:
    tsuya_free(original);
    tsuya_free(reduced);
    return status;
}

static tsuya_status reduce(const char *to, const char *from, int divisor)
{
    tsuya_image full = {0}, small = {0};
    tsuya_image_save_options options = tsuya_image_save_options_default();
    options.jpeg_quality = 95;
    tsuya_status status;
    TSUYA_GOTO_DONE(status, tsuya_image_load(&full, from));
    TSUYA_GOTO_DONE(status, tsuya_image_resize(&small, &full, full.width_px / divisor, full.height_px / divisor));
    TSUYA_GOTO_DONE(status, tsuya_image_save(&small, to, &options));
done:
    tsuya_image_free(&full);
    tsuya_image_free(&small);
    return status;
}

static tsuya_status reduce_one(const char *folder, const char *data, const char *name, int divisor)
{
    char from[4096], to[4096], mask[256];
    snprintf(from, sizeof from, "%s/images/%s", data, name);
    snprintf(to, sizeof to, "%s/photos/%s", folder, name);
    TSUYA_TRY(reduce(to, from, divisor));
    TSUYA_TRY(keep_exif(to, from));
    snprintf(mask, sizeof mask, "%.*s.png", (int)strcspn(name, "."), name);
    snprintf(from, sizeof from, "%s/masks/%s", data, mask);
    snprintf(to, sizeof to, "%s/masks/%s", folder, mask);
    return reduce(to, from, divisor);
}

static tsuya_status write_job(const char *folder, const char *extra)
{
    char text[4096], path[4096];
    int length = snprintf(text, sizeof text, "name: reduced\nphotos: photos/\nmasks: masks/\n%s", extra);
    snprintf(path, sizeof path, "%s/JOB.yaml", folder);
    return tsuya_file_write(path, text, (size_t)length);
}

tsuya_status reduced_job_write(const char *folder, const char *data, int first, int count, int divisor, const char *extra)
{
    char path[4096];
    tsuya_arena *arena;
    char **names;
    int name_count;
    snprintf(path, sizeof path, "%s/photos", folder);
    TSUYA_TRY(tsuya_folder_make(path));
    snprintf(path, sizeof path, "%s/masks", folder);
    TSUYA_TRY(tsuya_folder_make(path));
    snprintf(path, sizeof path, "%s/images", data);
    TSUYA_TRY(tsuya_arena_create(&arena, 1 << 14));
    tsuya_status status = tsuya_folder_list(&names, &name_count, path, arena);
    for (int i = first; status == TSUYA_OK && i < first + count && i < name_count; i++) {
        status = reduce_one(folder, data, names[i], divisor);
    }
    tsuya_arena_free(arena);
    return status == TSUYA_OK ? write_job(folder, extra) : status;
}
