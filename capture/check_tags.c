/* What the tags in a photograph say of its lens: they are flat squares of known size, so a plate that is seen at a slant tells the
 * focal length (calib/planar.h), without a calibration.  Zooming changes it, and so does focusing anew.  How sure it is comes from leaving out
 * each tag in turn (the jackknife; B. Efron, "The Jackknife, the Bootstrap and Other Resampling Plans", 1982). */
#include "capture/check_photo.h"

#include "calib/detect.h"
#include "calib/planar.h"
#include "core/memory.h"

#include <math.h>

enum { FEWEST_TAGS = 4 }; /* of a plate */
static const double LEAST_CHANGE = 0.01; /* of the focal length, as by EXIF */

typedef struct sighting {
    const tsuya_board *board;
    const tsuya_corner_set *corners;
    tsuya_vec2 *plane, *image; /* room for all corners */
    double cx_px, cy_px;
} sighting;

/* All plates' tags but one (−1: all of them); 0 where they do not tell. */
static double focal_without(const sighting *s, int left_out)
{
    double sum_b = 0.0, sum_a = 0.0;
    for (int plate = 0; plate < s->board->plate_count; plate++) {
        int n = 0;
        for (int k = 0; k < s->corners->count; k++) {
            const tsuya_corner *c = &s->corners->corner[k];
            int tag = tsuya_board_find(s->board, c->tag_id);
            if (tag >= 0 && tag != left_out && s->board->tag[tag].plate == plate) {
                s->plane[n] = s->board->tag[tag].corner_m[c->corner];
                s->image[n++] = (tsuya_vec2){c->x_px, c->y_px};
            }
        }
        tsuya_mat3 h;
        double certainty, weight = n;
        if (n < 4 * (FEWEST_TAGS - 1) || !tsuya_homography_fit(&h, s->plane, s->image, n)) {
            continue;
        }
        double f = tsuya_homography_focal(&certainty, &h, &weight, 1, s->cx_px, s->cy_px);
        sum_a += f > 0.0 ? certainty : 0.0;
        sum_b += f > 0.0 ? certainty * log(f) : 0.0;
    }
    return sum_a > 0.0 ? exp(sum_b / sum_a) : 0.0;
}

static int tags_seen(const tsuya_board *board, const tsuya_corner_set *corners, int *tag)
{
    int n = 0;
    for (int k = 0; k < corners->count; k++) {
        int t = tsuya_board_find(board, corners->corner[k].tag_id);
        bool known = t < 0;
        for (int i = 0; i < n && !known; i++) {
            known = tag[i] == t;
        }
        if (!known) {
            tag[n++] = t;
        }
    }
    return n;
}

static void tell_focal(tsuya_checked_photo *p, const sighting *s, const int *tag)
{
    double all = p->tags >= FEWEST_TAGS ? focal_without(s, -1) : 0.0, spread = 0.0;
    for (int k = 0; all > 0.0 && k < p->tags; k++) {
        double f = focal_without(s, tag[k]);
        double off = f > 0.0 ? log(f / all) : 1.0; /* hangs on a single tag */
        spread += off * off * (p->tags - 1) / p->tags;
    }
    p->tags_focal_px = all > 0.0 ? all : NAN;
    p->tags_focal_sigma_px = all > 0.0 ? all * sqrt(spread) : NAN;
}

tsuya_status tsuya_check_tags(tsuya_checked_photo *p, const tsuya_board *board, const tsuya_image *image)
{
    tsuya_status status;
    tsuya_corner_set corners = {0};
    tsuya_detect_report report;
    sighting s = {.board = board, .corners = &corners, .cx_px = 0.5 * (image->width_px - 1), .cy_px = 0.5 * (image->height_px - 1)};
    int *tag = NULL;
    const char *const name = p->photo.name;
    TSUYA_GOTO_DONE(status, tsuya_corner_set_create(&corners, &name, 1));
    TSUYA_GOTO_DONE(status, tsuya_detect_image(&corners, &report, board, image, 0, NULL));
    TSUYA_NEW(status, s.plane, (size_t)corners.count + 1);
    TSUYA_NEW(status, s.image, (size_t)corners.count + 1);
    TSUYA_NEW(status, tag, (size_t)board->tag_count);
    p->tags = tags_seen(board, &corners, tag);
    tell_focal(p, &s, tag);
done:
    tsuya_corner_set_free(&corners);
    tsuya_free(s.plane);
    tsuya_free(s.image);
    tsuya_free(tag);
    return status;
}

/* The session's focal length by its tags, and who was taken at another one. */
tsuya_status tsuya_check_tags_verdicts(tsuya_check *check)
{
    tsuya_status status = TSUYA_OK;
    double *list = NULL;
    int n = 0;
    TSUYA_NEW(status, list, (size_t)check->count);
    for (int i = 0; i < check->count; i++) {
        if (check->photo[i].tags_focal_px > 0.0) {
            list[n++] = log(check->photo[i].tags_focal_px);
        }
    }
    double middle = tsuya_check_median(list, n);
    check->tags_focal_px = n > 2 ? exp(middle) : NAN;
    for (int k = 0; k < n; k++) {
        list[k] = fabs(list[k] - middle);
    }
    double own = n > 2 ? 1.4826 * tsuya_check_median(list, n) : INFINITY;
    for (int i = 0; i < check->count; i++) {
        tsuya_checked_photo *p = &check->photo[i];
        double off = log(p->tags_focal_px / check->tags_focal_px), sure = fmax(own, p->tags_focal_sigma_px / p->tags_focal_px);
        if (isfinite(off) && fabs(off) > fmax(LEAST_CHANGE, TSUYA_CHECK_OUTLIER * sure)) {
            tsuya_check_fault(p, "zoomed or focused anew: its tags tell a focal length of %.0f px, the others' %.0f px", p->tags_focal_px,
                              check->tags_focal_px);
        }
    }
done:
    tsuya_free(list);
    return status;
}
