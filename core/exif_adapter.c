#include "core/exif_adapter.h"

#include <libexif/exif-data.h>
#include <stdio.h>
#include <string.h>

static const ExifEntry *find(ExifData *data, ExifTag tag)
{
    for (int ifd = 0; ifd < EXIF_IFD_COUNT; ifd++) {
        ExifEntry *entry = exif_content_get_entry(data->ifd[ifd], tag);
        if (entry && entry->data && entry->components > 0) {
            return entry;
        }
    }
    return NULL;
}

/* First component as a number; 0 where absent, of another kind, or a ratio with denominator 0. */
static double number_of(ExifData *data, ExifTag tag)
{
    const ExifEntry *entry = find(data, tag);
    if (!entry || entry->size < exif_format_get_size(entry->format)) {
        return 0.0;
    }
    ExifByteOrder order = exif_data_get_byte_order(data);
    switch (entry->format) {
    case EXIF_FORMAT_BYTE: return entry->data[0];
    case EXIF_FORMAT_SHORT: return exif_get_short(entry->data, order);
    case EXIF_FORMAT_LONG: return exif_get_long(entry->data, order);
    case EXIF_FORMAT_RATIONAL: {
        ExifRational ratio = exif_get_rational(entry->data, order);
        return ratio.denominator ? (double)ratio.numerator / ratio.denominator : 0.0;
    }
    case EXIF_FORMAT_SRATIONAL: {
        ExifSRational ratio = exif_get_srational(entry->data, order);
        return ratio.denominator ? (double)ratio.numerator / ratio.denominator : 0.0;
    }
    default: return 0.0;
    }
}

static void text_of(ExifData *data, ExifTag tag, char *text, size_t size)
{
    const ExifEntry *entry = find(data, tag);
    if (!entry || entry->format != EXIF_FORMAT_ASCII) {
        return;
    }
    size_t length = strnlen((const char *)entry->data, entry->size);
    snprintf(text, size, "%.*s", (int)(length < size ? length : size - 1), (const char *)entry->data);
    for (size_t end = strlen(text); end > 0 && text[end - 1] == ' '; end--) {
        text[end - 1] = '\0';
    }
}

static double positive(double value)
{
    return value > 0.0 && value < 1e9 ? value : 0.0;
}

void tsuya_exif_read(tsuya_photo *photo, const char *path)
{
    ExifData *data = exif_data_new_from_file(path);
    if (!data) {
        return;
    }
    double orientation = number_of(data, EXIF_TAG_ORIENTATION);
    if (orientation >= 1 && orientation <= 8) {
        photo->orientation = (int)orientation;
    }
    photo->focal_mm = positive(number_of(data, EXIF_TAG_FOCAL_LENGTH));
    photo->focal_35mm = positive(number_of(data, EXIF_TAG_FOCAL_LENGTH_IN_35MM_FILM));
    photo->exposure_s = positive(number_of(data, EXIF_TAG_EXPOSURE_TIME));
    photo->f_number = positive(number_of(data, EXIF_TAG_FNUMBER));
    photo->iso = positive(number_of(data, EXIF_TAG_ISO_SPEED_RATINGS));
    text_of(data, EXIF_TAG_MAKE, photo->make, sizeof photo->make);
    text_of(data, EXIF_TAG_MODEL, photo->model, sizeof photo->model);
    text_of(data, EXIF_TAG_DATE_TIME_ORIGINAL, photo->taken, sizeof photo->taken);
    if (!photo->taken[0]) {
        text_of(data, EXIF_TAG_DATE_TIME, photo->taken, sizeof photo->taken);
    }
    exif_data_unref(data);
}
