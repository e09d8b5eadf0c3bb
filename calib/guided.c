#include "calib/guided.h"

#include "calib/planar.h"
#include "core/memory.h"

#include <string.h>

enum { NEAREST = 6, FEWEST = 3 };
/* Of the code's cells alone; the wrong code of the family stays below 0.5. */
static const double ENOUGH = 0.75;

typedef struct anchor { int index, tag; double distance; } anchor;

/* The nearest sightings on the tag's plate. */
static int nearest(anchor out[NEAREST], const tsuya_tag_sighting *seen, const int *tag_of, int count, const tsuya_board *board, int tag)
{
    int n = 0;
    tsuya_vec2 here = tsuya_board_tag_middle(&board->tag[tag]);
    for (int i = 0; i < count; i++) {
        if (board->tag[tag_of[i]].plate != board->tag[tag].plate) {
            continue;
        }
        tsuya_vec2 there = tsuya_board_tag_middle(&board->tag[tag_of[i]]);
        anchor a = {i, tag_of[i], hypot(there.x - here.x, there.y - here.y)};
        int at = n < NEAREST ? n++ : a.distance < out[NEAREST - 1].distance ? NEAREST - 1 : -1;
        for (; at > 0 && out[at - 1].distance > a.distance; at--) {
            out[at] = out[at - 1];
        }
        if (at >= 0) {
            out[at] = a;
        }
    }
    (void)seen;
    return n;
}

static bool predict(tsuya_mat3 *h, const anchor *a, int n, const tsuya_tag_sighting *seen, const tsuya_board *board)
{
    tsuya_vec2 plane[4 * NEAREST], image[4 * NEAREST];
    for (int i = 0; i < n; i++) {
        memcpy(plane + 4 * i, board->tag[a[i].tag].corner_m, 4 * sizeof *plane);
        memcpy(image + 4 * i, seen[a[i].index].corner_px, 4 * sizeof *image);
    }
    return tsuya_homography_fit(h, plane, image, 4 * n);
}

static bool inside(const tsuya_image *grey, tsuya_vec2 p, double margin_px)
{
    return p.x > margin_px && p.y > margin_px && p.x < grey->width_px - 1 - margin_px && p.y < grey->height_px - 1 - margin_px;
}

/* Correlation of the code's inner cells with what is seen at the homography. */
static double read_code(tsuya_mat3 h, const tsuya_board_tag *tag, const tsuya_tag_pattern *pattern, int border_bits, const tsuya_image *grey)
{
    double cell = (tag->corner_m[1].x - tag->corner_m[0].x) / pattern->border_width, s = 0, t = 0, ss = 0, tt = 0, st = 0;
    int rim = (pattern->width - pattern->border_width) / 2, n = 0;
    for (int y = border_bits; y < pattern->border_width - border_bits; y++) {
        for (int x = border_bits; x < pattern->border_width - border_bits; x++) {
            tsuya_vec2 p = tsuya_homography_apply(h, (tsuya_vec2){tag->corner_m[0].x + (x + 0.5) * cell, tag->corner_m[3].y - (y + 0.5) * cell});
            float value;
            tsuya_image_sample_bilinear(grey, p.x, p.y, &value);
            double a = (double)value, b = pattern->white[(y + rim) * pattern->width + x + rim];
            s += a, t += b, ss += a * a, tt += b * b, st += a * b;
            n++;
        }
    }
    double va = ss - s * s / n, vb = tt - t * t / n;
    return va > 0.0 && vb > 0.0 ? (st - s * t / n) / sqrt(va * vb) : 0.0;
}

static tsuya_status look(tsuya_tag_sighting *out, bool *found, const tsuya_board *board, int tag, tsuya_mat3 h, const tsuya_image *grey)
{
    tsuya_tag_pattern pattern;
    *found = false;
    *out = (tsuya_tag_sighting){.id = board->tag[tag].id};
    for (int c = 0; c < 4; c++) {
        out->corner_px[c] = tsuya_homography_apply(h, board->tag[tag].corner_m[c]);
        if (!inside(grey, out->corner_px[c], 1.0)) {
            return TSUYA_OK;
        }
    }
    TSUYA_TRY(tsuya_tag_pattern_create(&pattern, board->family, board->border_bits, board->tag[tag].id));
    *found = read_code(h, &board->tag[tag], &pattern, board->border_bits, grey) > ENOUGH;
    tsuya_tag_pattern_free(&pattern);
    return TSUYA_OK;
}

tsuya_status tsuya_guided_search(tsuya_tag_sighting *seen, int *count, const tsuya_board *board, const tsuya_image *grey)
{
    int known = *count;
    bool *there = tsuya_calloc((size_t)board->tag_count, sizeof *there);
    int *tag_of = tsuya_calloc((size_t)known, sizeof *tag_of);
    tsuya_status status = there && tag_of ? TSUYA_OK : TSUYA_ERROR_MEMORY;
    for (int i = 0; i < known && status == TSUYA_OK; i++) {
        tag_of[i] = tsuya_board_find(board, seen[i].id);
        there[tag_of[i]] = true;
    }
    for (int tag = 0; tag < board->tag_count && status == TSUYA_OK; tag++) {
        anchor a[NEAREST];
        tsuya_mat3 h;
        bool found;
        int n = there[tag] ? 0 : nearest(a, seen, tag_of, known, board, tag);
        if (n >= FEWEST && predict(&h, a, n, seen, board)) {
            status = look(&seen[*count], &found, board, tag, h, grey);
            *count += status == TSUYA_OK && found;
        }
    }
    tsuya_free(there);
    tsuya_free(tag_of);
    return status;
}
