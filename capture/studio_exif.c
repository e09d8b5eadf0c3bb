/* JPEG with EXIF, by hand: the encoder knows none.  CIPA DC-008 (Exif 2.3), TIFF 6.0; big endian. */
#include "capture/studio_sensor.h"

#include "core/file.h"

#include <math.h>
#include <string.h>

enum { TYPE_ASCII = 2, TYPE_SHORT = 3, TYPE_LONG = 4, TYPE_RATIONAL = 5, ENTRY = 12, LONGEST = 1024 };

typedef struct segment {
    uint8_t bytes[LONGEST]; /* from the TIFF header */
    size_t entry;           /* where the next entry of the directory goes */
    size_t data;            /* where the next value outside of the directory goes */
} segment;

static void put16(segment *s, size_t at, unsigned value)
{
    s->bytes[at] = (uint8_t)(value >> 8);
    s->bytes[at + 1] = (uint8_t)value;
}

static void put32(segment *s, size_t at, unsigned long value)
{
    put16(s, at, (unsigned)(value >> 16) & 0xFFFF);
    put16(s, at + 2, (unsigned)value & 0xFFFF);
}

/* The place of the entry's value, four bytes. */
static size_t entry(segment *s, unsigned tag, unsigned type, unsigned long count)
{
    size_t at = s->entry;
    put16(s, at, tag);
    put16(s, at + 2, type);
    put32(s, at + 4, count);
    s->entry += ENTRY;
    return at + 8;
}

static void add_text(segment *s, unsigned tag, const char *text)
{
    size_t length = strlen(text) + 1, at = entry(s, tag, TYPE_ASCII, length);
    if (length <= 4) {
        memcpy(s->bytes + at, text, length);
    } else {
        put32(s, at, s->data);
        memcpy(s->bytes + s->data, text, length);
        s->data += length + length % 2;
    }
}

static void add_short(segment *s, unsigned tag, int value) { put16(s, entry(s, tag, TYPE_SHORT, 1), (unsigned)value); }

static void add_rational(segment *s, unsigned tag, double value)
{
    unsigned long denominator = value < 1.0 ? 1000000 : 1000;
    put32(s, entry(s, tag, TYPE_RATIONAL, 1), s->data);
    put32(s, s->data, (unsigned long)lround(value * (double)denominator));
    put32(s, s->data + 4, denominator);
    s->data += 8;
}

/* Opens a directory of `count` entries; its values follow it. */
static void open_directory(segment *s, size_t at, unsigned count)
{
    put16(s, at, count);
    s->entry = at + 2;
    s->data = s->entry + count * ENTRY + 4;
}

static size_t make_segment(segment *s, const tsuya_studio_exif *exif)
{
    memset(s, 0, sizeof *s);
    memcpy(s->bytes, "MM\0*\0\0\0\10", 8);
    open_directory(s, 8, 4);
    add_text(s, 0x010F, exif->make);
    add_text(s, 0x0110, exif->model);
    add_text(s, 0x0132, exif->taken);
    put32(s, entry(s, 0x8769, TYPE_LONG, 1), s->data);
    open_directory(s, s->data, 6);
    add_rational(s, 0x829A, exif->exposure_s);
    add_rational(s, 0x829D, exif->f_number);
    add_short(s, 0x8827, exif->iso);
    add_text(s, 0x9003, exif->taken);
    add_rational(s, 0x920A, exif->focal_mm);
    add_short(s, 0xA405, exif->focal_35mm);
    return s->data;
}

static tsuya_status splice(const char *path, const char *encoded, const tsuya_studio_exif *exif)
{
    segment s;
    size_t size, length = make_segment(&s, exif);
    char *jpeg = NULL;
    tsuya_file_writer writer;
    TSUYA_TRY(tsuya_file_load(&jpeg, &size, encoded, (size_t)1 << 30));
    tsuya_status status = tsuya_file_begin(&writer, path);
    if (status == TSUYA_OK) {
        uint8_t head[10] = {0xFF, 0xE1, (uint8_t)((length + 8) >> 8), (uint8_t)(length + 8), 'E', 'x', 'i', 'f', 0, 0};
        fwrite(jpeg, 1, 2, writer.stream); /* SOI */
        fwrite(head, 1, sizeof head, writer.stream);
        fwrite(s.bytes, 1, length, writer.stream);
        fwrite(jpeg + 2, 1, size - 2, writer.stream);
        status = tsuya_file_commit(&writer);
    }
    tsuya_free(jpeg);
    return status;
}

tsuya_status tsuya_studio_save_jpeg(const tsuya_image *photograph, const char *path, int quality, const tsuya_studio_exif *exif)
{
    if (strlen(exif->make) > 60 || strlen(exif->model) > 60 || strlen(exif->taken) > 30) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: EXIF text longer than 60 characters", path);
    }
    char *encoded;
    tsuya_image_save_options options = tsuya_image_save_options_default();
    options.jpeg_quality = quality;
    TSUYA_TRY(tsuya_file_temporary_name(&encoded, path));
    tsuya_status status = tsuya_image_save(photograph, encoded, &options);
    if (status == TSUYA_OK) {
        status = splice(path, encoded, exif);
        remove(encoded);
    }
    tsuya_free(encoded);
    return status;
}
