#include "calib/mrcal_inputs.h"

#include "core/file.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { NAMES = 64, MODEL_LIMIT = 64 << 20 };

void tsuya_mrcal_board_free(tsuya_mrcal_board *board)
{
    tsuya_free(board->frame);
    tsuya_free(board->observation);
    *board = (tsuya_mrcal_board){0};
}

/* A growing run of bytes; the first shortage of memory stays. */
typedef struct bytes {
    uint8_t *at;
    size_t size, capacity;
    bool failed;
} bytes;

static void put(bytes *b, const void *data, size_t size)
{
    if (b->size + size > b->capacity && !b->failed) {
        size_t capacity = 2 * (b->size + size) + 4096;
        uint8_t *more = tsuya_realloc(b->at, capacity, 1);
        b->failed = !more;
        b->at = more ? more : b->at;
        b->capacity = more ? capacity : b->capacity;
    }
    if (!b->failed && size) {
        memcpy(b->at + b->size, data, size);
        b->size += size;
    }
}

static void put_number(bytes *b, uint32_t value, int size)
{
    uint8_t little[4] = {(uint8_t)value, (uint8_t)(value >> 8), (uint8_t)(value >> 16), (uint8_t)(value >> 24)};
    put(b, little, (size_t)size);
}

/* The zip's checksum (CRC-32, reflected polynomial). */
static uint32_t checksum(const uint8_t *data, size_t size)
{
    uint32_t crc = 0xffffffffu;
    for (size_t i = 0; i < size; i++) {
        crc ^= data[i];
        for (int k = 0; k < 8; k++) {
            crc = (crc >> 1) ^ (0xedb88320u & (0u - (crc & 1u)));
        }
    }
    return ~crc;
}

/* A zip of stored files. */
typedef struct archive {
    bytes files, directory;
    int count;
} archive;

static void put_record(bytes *b, bool central, const char *name, const bytes *file, size_t offset)
{
    uint32_t size = (uint32_t)file->size, crc = checksum(file->at, file->size);
    put_number(b, central ? 0x02014b50u : 0x04034b50u, 4);
    if (central) {
        put_number(b, 20, 2);
    }
    put_number(b, 20, 2);
    put_number(b, 0, 4);          /* flags, stored */
    put_number(b, 0x00210000u, 4); /* 1 January 1980: the same inputs give the same bytes */
    put_number(b, crc, 4);
    put_number(b, size, 4);
    put_number(b, size, 4);
    put_number(b, (uint32_t)strlen(name), 2);
    put_number(b, 0, 2);
    if (central) {
        put_number(b, 0, 4);
        put_number(b, 0, 2);
        put_number(b, 0, 4);
        put_number(b, (uint32_t)offset, 4);
    }
    put(b, name, strlen(name));
}

/* One array: type as NumPy writes it, shape as Python writes a tuple. */
static void put_array(archive *z, const char *key, const char *type, const char *shape, const void *data, size_t size)
{
    char name[NAMES + 8], header[128];
    bytes file = {0};
    int length = snprintf(header, sizeof header, "{'descr': '%s', 'fortran_order': False, 'shape': (%s), }", type, shape);
    for (; (10 + length + 1) % 64 != 0; length++) {
        header[length] = ' ';
    }
    header[length++] = '\n';
    put(&file, "\x93NUMPY\x01\x00", 8);
    put_number(&file, (uint32_t)length, 2);
    put(&file, header, (size_t)length);
    put(&file, data, size);
    snprintf(name, sizeof name, "%s.npy", key);
    put_record(&z->directory, true, name, &file, z->files.size);
    put_record(&z->files, false, name, &file, 0);
    put(&z->files, file.at, file.size);
    z->files.failed |= file.failed;
    z->count++;
    tsuya_free(file.at);
}

static void put_text(archive *z, const char *key, const char *text)
{
    char type[16];
    uint32_t wide[TSUYA_LENS_NAME] = {0};
    size_t n = strlen(text) < TSUYA_LENS_NAME ? strlen(text) : TSUYA_LENS_NAME - 1;
    for (size_t i = 0; i < n; i++) {
        wide[i] = (uint8_t)text[i];
    }
    n = n ? n : 1; /* None is an empty text of one character */
    snprintf(type, sizeof type, "<U%d", (int)n);
    put_array(z, key, type, "", wide, n * sizeof *wide);
}

static void put_flag(archive *z, const char *key, bool flag)
{
    uint8_t byte = flag;
    put_array(z, key, "|b1", "", &byte, 1);
}

static void put_doubles(archive *z, const char *key, const char *shape, const double *value, size_t count)
{
    put_array(z, key, "<f8", shape, value, count * sizeof *value);
}

static tsuya_status put_inputs(archive *z, const tsuya_mrcal_board *b)
{
    char shape[64], lens[TSUYA_LENS_NAME];
    int32_t size[2] = {b->camera.width_px, b->camera.height_px}, *index = tsuya_calloc(3 * (size_t)b->frames, sizeof *index);
    if (!index) {
        return TSUYA_ERROR_MEMORY;
    }
    for (int i = 0; i < b->frames; i++) {
        index[3 * i] = i;
        index[3 * i + 2] = -1;
    }
    snprintf(shape, sizeof shape, "1, %d", b->intrinsics_count);
    put_doubles(z, "intrinsics", shape, b->intrinsics, (size_t)b->intrinsics_count);
    put_doubles(z, "extrinsics_rt_fromref", "0, 6", NULL, 0);
    snprintf(shape, sizeof shape, "%d, 6", b->frames);
    put_doubles(z, "frames_rt_toref", shape, b->frame, 6 * (size_t)b->frames);
    snprintf(shape, sizeof shape, "%d, %d, %d, 3", b->frames, b->rows, b->cols);
    put_doubles(z, "observations_board", shape, b->observation, 3 * (size_t)b->frames * (size_t)b->rows * (size_t)b->cols);
    snprintf(shape, sizeof shape, "%d, 3", b->frames);
    put_array(z, "indices_frame_camintrinsics_camextrinsics", "<i4", shape, index, 3 * (size_t)b->frames * sizeof *index);
    put_array(z, "imagersizes", "<i4", "1, 2", size, sizeof size);
    put_doubles(z, "calobject_warp", "2,", b->warp_m, 2);
    put_doubles(z, "calibration_object_spacing", "", &b->spacing_m, 1);
    tsuya_cameramodel_lens(lens, &b->camera);
    put_text(z, "lensmodel", lens);
    static const char *const none[] = {"points", "observations_point", "indices_point_camintrinsics_camextrinsics"};
    for (size_t i = 0; i < sizeof none / sizeof none[0]; i++) {
        put_text(z, none[i], "");
    }
    bool splined = tsuya_lens_locked(&b->camera) > 0;
    put_flag(z, "do_optimize_intrinsics_core", !splined);
    put_flag(z, "do_apply_regularization", splined);
    static const char *const yes[] = {"do_optimize_intrinsics_distortions", "do_optimize_extrinsics", "do_optimize_frames",
                                      "do_optimize_calobject_warp"};
    for (size_t i = 0; i < sizeof yes / sizeof yes[0]; i++) {
        put_flag(z, yes[i], true);
    }
    static const char *const no[] = {"do_apply_outlier_rejection", "verbose"};
    for (size_t i = 0; i < sizeof no / sizeof no[0]; i++) {
        put_flag(z, no[i], false);
    }
    tsuya_free(index);
    return TSUYA_OK;
}

static void finish(archive *z)
{
    size_t start = z->files.size, size = z->directory.size;
    put(&z->files, z->directory.at, size);
    put_number(&z->files, 0x06054b50u, 4);
    put_number(&z->files, 0, 4);
    put_number(&z->files, (uint32_t)z->count, 2);
    put_number(&z->files, (uint32_t)z->count, 2);
    put_number(&z->files, (uint32_t)size, 4);
    put_number(&z->files, (uint32_t)start, 4);
    put_number(&z->files, 0, 2);
    z->files.failed |= z->directory.failed;
}

/* Base 85 as Python has it (RFC 1924's letters): five letters for four bytes, the last group cut to its length. */
static void put_letters(FILE *out, const bytes *data)
{
    static const char letters[] = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz!#$%&()*+-;<=>?@^_`{|}~";
    for (size_t i = 0; i < data->size; i += 4) {
        uint32_t value = 0;
        char group[5];
        size_t n = data->size - i < 4 ? data->size - i : 4;
        for (size_t k = 0; k < 4; k++) {
            value = value << 8 | (k < n ? data->at[i + k] : 0u);
        }
        for (int k = 4; k >= 0; k--) {
            group[k] = letters[value % 85];
            value /= 85;
        }
        fwrite(group, 1, n + 1, out);
    }
}

static tsuya_status rewrite(const char *path, const char *text, const bytes *inputs)
{
    const char *end = strrchr(text, '}');
    tsuya_file_writer writer;
    if (!end) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: no closing brace; a .cameramodel is expected", path);
    }
    TSUYA_TRY(tsuya_file_begin(&writer, path));
    fwrite(text, 1, (size_t)(end - text), writer.stream);
    fprintf(writer.stream, "\n    'icam_intrinsics': 0,\n\n    # what mrcal's tools compute uncertainty from\n    'optimization_inputs': b'");
    put_letters(writer.stream, inputs);
    fprintf(writer.stream, "',\n}\n");
    return tsuya_file_commit(&writer);
}

tsuya_status tsuya_mrcal_inputs_add(const char *path, const tsuya_mrcal_board *board)
{
    archive z = {0};
    char *text = NULL;
    size_t size;
    tsuya_status status = put_inputs(&z, board);
    if (status == TSUYA_OK) {
        finish(&z);
        status = z.files.failed ? TSUYA_ERROR_MEMORY : tsuya_file_load(&text, &size, path, MODEL_LIMIT);
    }
    if (status == TSUYA_OK) {
        status = rewrite(path, text, &z.files);
    }
    tsuya_free(text);
    tsuya_free(z.files.at);
    tsuya_free(z.directory.at);
    return status;
}
