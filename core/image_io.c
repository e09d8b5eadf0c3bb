/* Reading and writing image files: the format is told by the first bytes, sizes are checked before anything is decoded. */
#include "core/image.h"

#include "core/file.h"
#include "core/image_adapters.h"

#include <string.h>
#include <strings.h>

enum { LARGEST_SIDE = 65535, LARGEST_AREA = 400000000 };
static const size_t LARGEST_FILE = (size_t)2 << 30;

typedef enum format { FORMAT_UNKNOWN, FORMAT_JPEG, FORMAT_PNG, FORMAT_TIFF, FORMAT_BMP, FORMAT_WEBP, FORMAT_EXR, FORMAT_RAW } format;

static const uint8_t *u8(const char *bytes)
{
    return (const uint8_t *)bytes;
}

static uint32_t big(const char *bytes, int count)
{
    uint32_t value = 0;
    for (int i = 0; i < count; i++) {
        value = value << 8 | u8(bytes)[i];
    }
    return value;
}

static uint32_t little(const char *bytes, int count)
{
    uint32_t value = 0;
    for (int i = count - 1; i >= 0; i--) {
        value = value << 8 | u8(bytes)[i];
    }
    return value;
}

bool tsuya_raw_extension(const char *path)
{
    static const char *const KNOWN[] = {".dng", ".nef", ".cr2", ".cr3", ".arw", ".raf", ".orf", ".rw2", ".pef", ".srw", ".x3f", ".iiq", ".3fr"};
    for (size_t i = 0; i < sizeof KNOWN / sizeof KNOWN[0]; i++) {
        if (strcasecmp(tsuya_path_extension(path), KNOWN[i]) == 0) {
            return true;
        }
    }
    return false;
}

static format format_of(const char *b, size_t size, const char *path)
{
    if (tsuya_raw_extension(path)) {
        return FORMAT_RAW;
    }
    if (size >= 3 && memcmp(b, "\xff\xd8\xff", 3) == 0) {
        return FORMAT_JPEG;
    }
    if (size >= 8 && memcmp(b, "\x89PNG\r\n\x1a\n", 8) == 0) {
        return FORMAT_PNG;
    }
    if (size >= 4 && (memcmp(b, "II*\0", 4) == 0 || memcmp(b, "MM\0*", 4) == 0)) {
        return FORMAT_TIFF;
    }
    if (size >= 4 && memcmp(b, "\x76\x2f\x31\x01", 4) == 0) {
        return FORMAT_EXR;
    }
    if (size >= 12 && memcmp(b, "RIFF", 4) == 0 && memcmp(b + 8, "WEBP", 4) == 0) {
        return FORMAT_WEBP;
    }
    return size >= 2 && memcmp(b, "BM", 2) == 0 ? FORMAT_BMP : FORMAT_UNKNOWN;
}

/* Walks the markers of a JPEG (ITU-T T.81, B.1) up to the frame header or, with `whole`, to the end of the image. */
static bool probe_jpeg(const char *b, size_t size, bool whole, int *width, int *height)
{
    size_t at = 2;
    *width = *height = 0;
    while (at + 4 <= size) {
        if (u8(b)[at] != 0xff) {
            return false;
        }
        uint8_t marker = u8(b)[at + 1];
        if (marker == 0xff) { /* fill */
            at++;
            continue;
        }
        size_t length = big(b + at + 2, 2);
        if (length < 2 || at + 2 + length > size) {
            return false;
        }
        bool frame = marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc;
        if (frame && length >= 8) {
            *height = (int)big(b + at + 5, 2);
            *width = (int)big(b + at + 7, 2);
            if (!whole) {
                return true;
            }
        }
        at += 2 + length;
        if (marker != 0xda) {
            continue;
        }
        for (;; at++) { /* entropy-coded data: to the next marker that is no stuffing and no restart */
            const char *next = at < size ? memchr(b + at, 0xff, size - at) : NULL;
            if (!next || (at = (size_t)(next - b)) + 1 >= size) {
                return false;
            }
            uint8_t code = u8(b)[at + 1];
            if (code == 0xd9) {
                return *width > 0;
            }
            if (code != 0 && code != 0xff && !(code >= 0xd0 && code <= 0xd7)) {
                break;
            }
        }
    }
    return at + 2 <= size && u8(b)[at] == 0xff && u8(b)[at + 1] == 0xd9 && *width > 0;
}

/* CRC-32 of PNG (ISO 15948, D). */
static uint32_t crc32(const char *bytes, size_t size)
{
    uint32_t table[256], crc = UINT32_MAX;
    for (uint32_t i = 0; i < 256; i++) {
        uint32_t c = i;
        for (int k = 0; k < 8; k++) {
            c = c & 1 ? 0xedb88320u ^ c >> 1 : c >> 1;
        }
        table[i] = c;
    }
    for (size_t i = 0; i < size; i++) {
        crc = table[(crc ^ u8(bytes)[i]) & 0xff] ^ crc >> 8;
    }
    return ~crc;
}

/* PNG chunks from the header to IEND; the checksums of those that the picture is made of. */
static bool probe_png(const char *b, size_t size, bool whole, int *width, int *height)
{
    if (size < 33 || memcmp(b + 12, "IHDR", 4) != 0 || big(b + 16, 4) > INT32_MAX || big(b + 20, 4) > INT32_MAX) {
        return false;
    }
    *width = (int)big(b + 16, 4);
    *height = (int)big(b + 20, 4);
    for (size_t at = 8; whole; at += 12 + (size_t)big(b + at, 4)) {
        if (at + 12 > size || big(b + at, 4) > size - at - 12) {
            return false;
        }
        size_t length = 4 + (size_t)big(b + at, 4);
        bool critical = !(b[at + 4] & 0x20), letters = true;
        for (size_t k = at + 4; k < at + 8; k++) {
            letters = letters && ((b[k] >= 'A' && b[k] <= 'Z') || (b[k] >= 'a' && b[k] <= 'z'));
        }
        if (!letters || (critical && crc32(b + at + 4, length) != big(b + at + 4 + length, 4))) {
            return false;
        }
        if (memcmp(b + at + 4, "IEND", 4) == 0) {
            break;
        }
    }
    return true;
}

static bool probe_tiff(const char *b, size_t size, int *width, int *height)
{
    uint32_t (*number)(const char *, int) = b[0] == 'I' ? little : big;
    size_t folder = number(b + 4, 4);
    *width = *height = 0;
    if (size < 8 || folder + 2 > size) {
        return false;
    }
    size_t entries = number(b + folder, 2);
    if (folder + 2 + entries * 12 > size) {
        return false;
    }
    for (size_t i = 0; i < entries; i++) {
        const char *entry = b + folder + 2 + i * 12;
        uint32_t tag = number(entry, 2), type = number(entry + 2, 2);
        uint32_t value = type == 3 ? number(entry + 8, 2) : number(entry + 8, 4);
        if (tag == 256) {
            *width = value > INT32_MAX ? -1 : (int)value;
        } else if (tag == 257) {
            *height = value > INT32_MAX ? -1 : (int)value;
        }
    }
    return true;
}

static bool probe_webp(const char *b, size_t size, int *width, int *height)
{
    if (size < 30) {
        return false;
    }
    if (memcmp(b + 12, "VP8X", 4) == 0) {
        *width = (int)little(b + 24, 3) + 1;
        *height = (int)little(b + 27, 3) + 1;
    } else if (memcmp(b + 12, "VP8L", 4) == 0) {
        *width = (int)(little(b + 21, 4) & 0x3fff) + 1;
        *height = (int)(little(b + 21, 4) >> 14 & 0x3fff) + 1;
    } else {
        *width = (int)(little(b + 26, 2) & 0x3fff);
        *height = (int)(little(b + 28, 2) & 0x3fff);
    }
    return true;
}

static bool probe_bmp(const char *b, size_t size, int *width, int *height)
{
    if (size < 26) {
        return false;
    }
    int32_t w = (int32_t)little(b + 18, 4), h = (int32_t)little(b + 22, 4);
    *width = w;
    *height = h < 0 && h > INT32_MIN ? -h : h;
    return true;
}

static tsuya_status check_size(int width, int height, const char *path)
{
    if (width < 1 || height < 1 || width > LARGEST_SIDE || height > LARGEST_SIDE || (long long)width * height > LARGEST_AREA) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: %d x %d pixels; 1 … %d a side and %d megapixels are accepted", path, width, height, LARGEST_SIDE,
                          LARGEST_AREA / 1000000);
    }
    return TSUYA_OK;
}

/* Size from encoded bytes; with `whole` also that the file goes on to its end. */
static tsuya_status probe_bytes(const char *b, size_t size, format kind, bool whole, int *width, int *height, const char *path)
{
    bool fine = false;
    *width = *height = 0;
    switch (kind) {
    case FORMAT_JPEG: fine = probe_jpeg(b, size, whole, width, height); break;
    case FORMAT_PNG: fine = probe_png(b, size, whole, width, height); break;
    case FORMAT_TIFF: fine = size >= 8 && probe_tiff(b, size, width, height); break;
    case FORMAT_WEBP: fine = probe_webp(b, size, width, height); break;
    case FORMAT_BMP: fine = probe_bmp(b, size, width, height); break;
    case FORMAT_EXR: return tsuya_exr_probe(width, height, path);
    case FORMAT_RAW: return tsuya_raw_probe(width, height, path);
    default:
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: not an image; JPEG, PNG, TIFF, EXR, BMP, WebP and camera raw are accepted", path);
    }
    if (fine || (*width > 0 && *height > 0)) { /* a size that nobody wants is said first */
        TSUYA_TRY(check_size(*width, *height, path));
    }
    return fine ? TSUYA_OK : tsuya_fail(TSUYA_ERROR_INPUT, "%s: the image is truncated or damaged", path);
}

tsuya_status tsuya_image_probe(int *width_px, int *height_px, const char *path)
{
    char *bytes;
    size_t size;
    TSUYA_TRY(tsuya_file_load(&bytes, &size, path, LARGEST_FILE));
    tsuya_status status = probe_bytes(bytes, size, format_of(bytes, size, path), false, width_px, height_px, path);
    tsuya_free(bytes);
    return status;
}

tsuya_status tsuya_image_load(tsuya_image *image, const char *path)
{
    char *bytes;
    size_t size;
    *image = (tsuya_image){0};
    TSUYA_TRY(tsuya_file_load(&bytes, &size, path, LARGEST_FILE));
    format kind = format_of(bytes, size, path);
    int width, height;
    tsuya_status status = probe_bytes(bytes, size, kind, true, &width, &height, path);
    if (status == TSUYA_OK) {
        status = kind == FORMAT_EXR ? tsuya_exr_load(image, path)
               : kind == FORMAT_RAW ? tsuya_raw_load(image, path)
                                    : tsuya_opencv_decode(image, bytes, size, path);
    }
    tsuya_free(bytes);
    return status;
}

tsuya_image_save_options tsuya_image_save_options_default(void)
{
    return (tsuya_image_save_options){.jpeg_quality = 92};
}

tsuya_status tsuya_image_save(const tsuya_image *image, const char *path, const tsuya_image_save_options *options)
{
    tsuya_image_save_options chosen = options ? *options : tsuya_image_save_options_default();
    const char *extension = tsuya_path_extension(path);
    bool jpeg = strcasecmp(extension, ".jpg") == 0 || strcasecmp(extension, ".jpeg") == 0, png = strcasecmp(extension, ".png") == 0;
    bool tiff = strcasecmp(extension, ".tif") == 0 || strcasecmp(extension, ".tiff") == 0, exr = strcasecmp(extension, ".exr") == 0;
    if (!jpeg && !png && !tiff && !exr) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: .png, .jpg, .tif and .exr can be written", path);
    }
    if ((jpeg && image->sample != TSUYA_SAMPLE_U8) || (png && image->sample == TSUYA_SAMPLE_F32) || (exr && image->sample != TSUYA_SAMPLE_F32)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: this format cannot hold the image's samples (JPEG 8 bits, PNG 8 or 16, EXR float)", path);
    }
    if (image->channels != 1 && image->channels != 3 && image->channels != 4) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: %d channels; 1, 3 or 4 can be written", path, image->channels);
    }
    char *temporary;
    TSUYA_TRY(tsuya_file_temporary_name(&temporary, path));
    tsuya_status status = exr ? tsuya_exr_save(image, temporary, &chosen) : tsuya_opencv_encode(image, temporary, chosen.jpeg_quality);
    if (status == TSUYA_OK) {
        status = tsuya_file_rename_into_place(temporary, path);
    } else {
        remove(temporary);
    }
    tsuya_free(temporary);
    return status;
}
