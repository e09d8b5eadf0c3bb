/* A TIFF structure in memory, entry by entry (TIFF 6.0, 2): enough for an EXIF block and for a small DNG. */
#ifndef TSUYA_TESTS_CORE_TIFF_WRITER_H
#define TSUYA_TESTS_CORE_TIFF_WRITER_H

#include "support.h"

enum { TIFF_BYTE = 1, TIFF_ASCII = 2, TIFF_SHORT = 3, TIFF_LONG = 4, TIFF_RATIONAL = 5, TIFF_SRATIONAL = 10, TIFF_ROOM = 1 << 18 };

/* Folders are written one after the other; each begins with tiff_folder and may hold as many entries as it said. */
typedef struct tiff {
    unsigned char bytes[TIFF_ROOM];
    size_t size;
    bool big_endian;
} tiff;

static inline void tiff_put(tiff *t, size_t at, uint32_t value, int bytes)
{
    for (int k = 0; k < bytes; k++) {
        t->bytes[at + (size_t)k] = (unsigned char)(value >> 8 * (t->big_endian ? bytes - 1 - k : k));
    }
}

static inline void tiff_begin(tiff *t, bool big_endian)
{
    t->big_endian = big_endian;
    memset(t->bytes, 0, sizeof t->bytes);
    memcpy(t->bytes, big_endian ? "MM" : "II", 2);
    tiff_put(t, 2, 42, 2);
    tiff_put(t, 4, 8, 4);
    t->size = 8;
}

/* Room for `entries`; returns where the next entry goes. */
static inline size_t tiff_folder(tiff *t, int entries)
{
    size_t at = t->size;
    tiff_put(t, at, (uint32_t)entries, 2);
    t->size += 2 + 12 * (size_t)entries + 4;
    return at + 2;
}

/* One entry of `count` numbers (pairs for ratios); values beyond four bytes go to the end of the file. */
static inline void tiff_entry(tiff *t, size_t *at, int tag, int type, int count, const uint32_t *values)
{
    int item = type == TIFF_SHORT ? 2 : type == TIFF_LONG ? 4 : type == TIFF_RATIONAL || type == TIFF_SRATIONAL ? 8 : 1;
    size_t place = *at + 8;
    tiff_put(t, *at, (uint32_t)tag, 2);
    tiff_put(t, *at + 2, (uint32_t)type, 2);
    tiff_put(t, *at + 4, (uint32_t)count, 4);
    if (item * count > 4) {
        tiff_put(t, place, (uint32_t)t->size, 4);
        place = t->size;
        t->size += ((size_t)(item * count) + 1) & ~(size_t)1;
    }
    int parts = item == 8 ? 2 * count : count, part = item == 8 ? 4 : item;
    for (int k = 0; k < parts; k++) {
        tiff_put(t, place + (size_t)(k * part), values[k], part);
    }
    *at += 12;
}

static inline void tiff_number(tiff *t, size_t *at, int tag, int type, uint32_t value) { tiff_entry(t, at, tag, type, 1, &value); }
static inline void tiff_ratio(tiff *t, size_t *at, int tag, uint32_t numerator, uint32_t denominator)
{
    tiff_entry(t, at, tag, TIFF_RATIONAL, 1, (const uint32_t[]){numerator, denominator});
}
static inline void tiff_text(tiff *t, size_t *at, int tag, const char *text)
{
    uint32_t values[64];
    int count = (int)strlen(text) + 1;
    for (int k = 0; k < count; k++) {
        values[k] = (unsigned char)text[k];
    }
    tiff_entry(t, at, tag, TIFF_ASCII, count, values);
}

#endif
