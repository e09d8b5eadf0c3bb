#include "calib/apriltag_adapter.h"

#include "core/memory.h"

#include <apriltag/apriltag.h>
#include <apriltag/tag16h5.h>
#include <apriltag/tag25h9.h>
#include <apriltag/tag36h10.h>
#include <apriltag/tag36h11.h>
#include <apriltag/tagStandard41h12.h>
#include <apriltag/tagStandard52h13.h>

#include <stdlib.h>
#include <string.h>

typedef struct family_entry {
    const char *name;
    apriltag_family_t *(*create)(void);
    void (*destroy)(apriltag_family_t *);
} family_entry;

static const family_entry families[] = {
    {"tag36h11", tag36h11_create, tag36h11_destroy}, {"tag25h9", tag25h9_create, tag25h9_destroy},
    {"tag16h5", tag16h5_create, tag16h5_destroy},    {"tag36h10", tag36h10_create, tag36h10_destroy},
    {"tagStandard41h12", tagStandard41h12_create, tagStandard41h12_destroy},
    {"tagStandard52h13", tagStandard52h13_create, tagStandard52h13_destroy},
};
enum { FAMILY_COUNT = sizeof families / sizeof families[0] };

struct tsuya_tag_detector {
    apriltag_detector_t *library;
    apriltag_family_t *family;
    const family_entry *entry;
};

/* A wider black border: the code's cells move inwards, the square and the quiet zone grow around them. */
static void widen_border(apriltag_family_t *family, int extra)
{
    family->width_at_border += 2 * extra;
    family->total_width += 2 * extra;
    for (uint32_t i = 0; i < family->nbits; i++) {
        family->bit_x[i] += (uint32_t)extra;
        family->bit_y[i] += (uint32_t)extra;
    }
}

static tsuya_status make_family(apriltag_family_t **family, const family_entry **entry, const char *name, int border_bits)
{
    for (int i = 0; i < FAMILY_COUNT; i++) {
        if (strcmp(families[i].name, name) == 0) {
            *entry = &families[i];
            *family = families[i].create();
            if (!*family) {
                return TSUYA_ERROR_MEMORY;
            }
            widen_border(*family, border_bits - 1);
            return TSUYA_OK;
        }
    }
    return tsuya_fail(TSUYA_ERROR_INPUT, "tag family '%s' is unknown", name);
}

tsuya_status tsuya_tag_detector_create(tsuya_tag_detector **detector, const tsuya_tag_detector_options *options)
{
    tsuya_tag_detector *d = tsuya_calloc(1, sizeof *d);
    *detector = NULL;
    if (!d) {
        return TSUYA_ERROR_MEMORY;
    }
    tsuya_status status = make_family(&d->family, &d->entry, options->family, options->border_bits);
    if (status == TSUYA_OK) {
        d->library = apriltag_detector_create();
        status = d->library ? TSUYA_OK : TSUYA_ERROR_MEMORY;
    }
    if (status != TSUYA_OK) {
        tsuya_tag_detector_free(d);
        return status;
    }
    apriltag_detector_add_family_bits(d->library, d->family, d->family->nbits > 30 ? 2 : 1);
    d->library->nthreads = 1;
    d->library->quad_decimate = (float)options->decimate;
    d->library->refine_edges = true;
    *detector = d;
    return TSUYA_OK;
}

void tsuya_tag_detector_free(tsuya_tag_detector *detector)
{
    if (!detector) {
        return;
    }
    if (detector->library) {
        apriltag_detector_destroy(detector->library);
    }
    if (detector->family) {
        detector->entry->destroy(detector->family);
    }
    tsuya_free(detector);
}

void tsuya_tag_detector_decimate(tsuya_tag_detector *detector, double decimate) { detector->library->quad_decimate = (float)decimate; }
int tsuya_tag_detector_codes(const tsuya_tag_detector *detector) { return (int)detector->family->ncodes; }
int tsuya_tag_detector_cells(const tsuya_tag_detector *detector) { return detector->family->width_at_border; }

double tsuya_tag_pixel(double library_px) { return library_px - 0.5; }

static int compare(const void *pa, const void *pb)
{
    const tsuya_tag_sighting *a = pa, *b = pb;
    if (a->id != b->id) {
        return a->id < b->id ? -1 : 1;
    }
    return (a->corner_px[0].y > b->corner_px[0].y) - (a->corner_px[0].y < b->corner_px[0].y);
}

tsuya_status tsuya_tag_detect(tsuya_tag_sighting **sighting, int *count, tsuya_tag_detector *detector, const tsuya_image *grey)
{
    *sighting = NULL;
    *count = 0;
    image_u8_t image = {.width = grey->width_px, .height = grey->height_px, .stride = (int32_t)grey->row_bytes, .buf = grey->data};
    zarray_t *found = apriltag_detector_detect(detector->library, &image);
    int n = found ? zarray_size(found) : 0;
    tsuya_tag_sighting *out = tsuya_calloc((size_t)n, sizeof *out);
    for (int i = 0; out && i < n; i++) {
        apriltag_detection_t *d;
        zarray_get(found, i, &d);
        out[i] = (tsuya_tag_sighting){.id = d->id, .hamming = d->hamming, .margin = (double)d->decision_margin};
        for (int c = 0; c < 4; c++) {
            out[i].corner_px[c] = (tsuya_vec2){tsuya_tag_pixel(d->p[c][0]), tsuya_tag_pixel(d->p[c][1])};
        }
    }
    if (found) {
        apriltag_detections_destroy(found);
    }
    if (!out) {
        return TSUYA_ERROR_MEMORY;
    }
    qsort(out, (size_t)n, sizeof *out, compare);
    *sighting = out;
    *count = n;
    return TSUYA_OK;
}

/* White ring (outside the black square, or inside it where the family is reversed), then the code's bits, highest first. */
static void paint(tsuya_tag_pattern *pattern, const apriltag_family_t *family, uint64_t code)
{
    int width = pattern->width, ring = family->width_at_border + (family->reversed_border ? 0 : 2), start = (width - ring) / 2;
    for (int i = start; i < start + ring; i++) {
        pattern->white[start * width + i] = pattern->white[(start + ring - 1) * width + i] = 1;
        pattern->white[i * width + start] = pattern->white[i * width + start + ring - 1] = 1;
    }
    int origin = (width - family->width_at_border) / 2;
    for (uint32_t i = 0; i < family->nbits; i++) {
        bool white = (code >> (family->nbits - 1 - i)) & 1;
        pattern->white[((int)family->bit_y[i] + origin) * width + (int)family->bit_x[i] + origin] = white;
    }
}

tsuya_status tsuya_tag_pattern_create(tsuya_tag_pattern *pattern, const char *name, int border_bits, int id)
{
    apriltag_family_t *family;
    const family_entry *entry;
    *pattern = (tsuya_tag_pattern){0};
    TSUYA_TRY(make_family(&family, &entry, name, border_bits));
    tsuya_status status = TSUYA_OK;
    if (id < 0 || id >= (int)family->ncodes) {
        status = tsuya_fail(TSUYA_ERROR_INPUT, "tag id %d: %s has the ids 0 to %d", id, name, (int)family->ncodes - 1);
    }
    if (status == TSUYA_OK) {
        pattern->width = family->total_width;
        pattern->border_width = family->width_at_border;
        pattern->white = tsuya_calloc((size_t)pattern->width * (size_t)pattern->width, 1);
        if (pattern->white) {
            paint(pattern, family, family->codes[id]);
        }
    }
    entry->destroy(family);
    return status != TSUYA_OK ? status : pattern->white ? TSUYA_OK : TSUYA_ERROR_MEMORY;
}

void tsuya_tag_pattern_free(tsuya_tag_pattern *pattern)
{
    tsuya_free(pattern->white);
    *pattern = (tsuya_tag_pattern){0};
}
