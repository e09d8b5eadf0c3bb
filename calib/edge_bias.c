#include "calib/edge_bias.h"

#include "calib/planar.h"
#include "core/memory.h"
#include "core/order.h"

#include <math.h>

enum { ROUNDS = 5, NEIGHBOURS = 24 /* that fit within NEAR */ };
static const double NEAR = 2.2;       /* of a tag's side, between the middles of neighbours */
static const double TRIAL = 0.5;      /* blur widths */
static const double OUTLIER = 3.5, NORMAL = 1.4826;
static const double SHARED = 2.0;     /* each tag speaks in several pairs, which are no independent witnesses */
static const double FLOOR_PX = 0.03;  /* no pair is surer than this */

/* What one tag says of a neighbour's middle: how far it lies from where the size puts it, and how that changes with the bias. */
typedef struct pair { tsuya_vec2 off, by_bias; double weight; } pair;

/* A tag that shows all four corners, and its plane's homography without a bias and with TRIAL. */
typedef struct seen_tag {
    const tsuya_corner *corner; /* four */
    int tag;
    tsuya_mat3 h[2];
} seen_tag;

static bool take_tag(seen_tag *t, const tsuya_corner *corner, const tsuya_board *board)
{
    *t = (seen_tag){.corner = corner, .tag = tsuya_board_find(board, corner->tag_id)};
    bool good = t->tag >= 0;
    for (int k = 0; good && k < 2; k++) {
        tsuya_vec2 image[4];
        for (int c = 0; c < 4; c++) {
            image[c] = (tsuya_vec2){corner[c].x_px - k * TRIAL * corner[c].spread_x_px, corner[c].y_px - k * TRIAL * corner[c].spread_y_px};
        }
        good = tsuya_homography_fit(&t->h[k], board->tag[t->tag].corner_m, image, 4);
    }
    return good;
}

/* Of b's middle: as b shows it, from where a's size puts it. */
static bool make_pair(pair *p, const seen_tag *a, const seen_tag *b, const tsuya_board *board)
{
    const tsuya_board_tag *ta = &board->tag[a->tag], *tb = &board->tag[b->tag];
    tsuya_vec2 ma = tsuya_board_tag_middle(ta), mb = tsuya_board_tag_middle(tb), off[2];
    double side = hypot(ta->corner_m[1].x - ta->corner_m[0].x, ta->corner_m[1].y - ta->corner_m[0].y), away = hypot(mb.x - ma.x, mb.y - ma.y);
    if (ta->plate != tb->plate || away > NEAR * side) {
        return false;
    }
    for (int k = 0; k < 2; k++) {
        tsuya_vec2 told = tsuya_homography_apply(a->h[k], mb), seen = tsuya_homography_apply(b->h[k], mb);
        off[k] = (tsuya_vec2){seen.x - told.x, seen.y - told.y};
    }
    double variance = FLOOR_PX * FLOOR_PX, reach = 2.0 * away / side;
    for (int c = 0; c < 4; c++) {
        variance += 0.25 * a->corner[c].sigma_px * a->corner[c].sigma_px * reach * reach;
    }
    *p = (pair){off[0], {(off[1].x - off[0].x) / TRIAL, (off[1].y - off[0].y) / TRIAL}, 1.0 / variance};
    return isfinite(off[0].x + off[0].y + off[1].x + off[1].y) && isfinite(p->weight);
}

static double left(const pair *p, double bias) /* along the direction that tells */
{
    double length = hypot(p->by_bias.x, p->by_bias.y);
    return length > 0.0 ? ((p->off.x + bias * p->by_bias.x) * p->by_bias.x + (p->off.y + bias * p->by_bias.y) * p->by_bias.y) / length : 0.0;
}

static void solve(tsuya_edge_bias *out, const pair *p, int n, double *list)
{
    double cut = INFINITY;
    *out = (tsuya_edge_bias){.sigma = INFINITY};
    for (int round = 0; round < ROUNDS && n > 0; round++) {
        double up = 0.0, down = 0.0, scatter = 0.0;
        int used = 0;
        for (int k = 0; k < n; k++) {
            if (fabs(left(&p[k], out->bias)) <= cut) {
                up -= p[k].weight * (p[k].off.x * p[k].by_bias.x + p[k].off.y * p[k].by_bias.y);
                down += p[k].weight * (p[k].by_bias.x * p[k].by_bias.x + p[k].by_bias.y * p[k].by_bias.y);
                used++;
            }
        }
        if (!(down > 0.0)) {
            return;
        }
        out->bias = up / down;
        for (int k = 0; k < n; k++) {
            double e = left(&p[k], out->bias);
            list[k] = fabs(e);
            scatter += list[k] <= cut ? p[k].weight * p[k].weight * e * e * (p[k].by_bias.x * p[k].by_bias.x + p[k].by_bias.y * p[k].by_bias.y) : 0.0;
        }
        out->sigma = SHARED * sqrt(scatter) / down;
        out->pairs = used;
        tsuya_sort_doubles(list, (size_t)n);
        cut = OUTLIER * fmax(NORMAL * list[n / 2], FLOOR_PX);
    }
}

/* Tags of one photograph that show all four corners. */
static int complete_tags(seen_tag *out, const tsuya_corner *corner, int count, const tsuya_board *board)
{
    int n = 0;
    for (int i = 0; i + 3 < count; i++) {
        bool whole = true;
        for (int c = 0; whole && c < 4; c++) {
            const tsuya_corner *k = &corner[i + c];
            whole = k->tag_id == corner[i].tag_id && k->corner == c && (k->spread_x_px != 0.0 || k->spread_y_px != 0.0) && isfinite(k->sigma_px);
        }
        if (whole) {
            n += take_tag(&out[n], &corner[i], board);
            i += 3;
        }
    }
    return n;
}

static int add_pairs(pair *pairs, const seen_tag *tag, int n, const tsuya_board *board)
{
    int count = 0;
    for (int a = 0; a < n; a++) {
        for (int b = 0, own = 0; b < n && own < NEIGHBOURS; b++) {
            bool good = a != b && make_pair(&pairs[count], &tag[a], &tag[b], board);
            count += good;
            own += good;
        }
    }
    return count;
}

tsuya_status tsuya_edge_bias_measure(tsuya_edge_bias *bias, const tsuya_corner_set *corners, const tsuya_board *board)
{
    const size_t most = (size_t)corners->count / 4 + 1;
    tsuya_status status = TSUYA_OK;
    seen_tag *tag = NULL;
    pair *pairs = NULL;
    double *list = NULL;
    int count = 0;
    *bias = (tsuya_edge_bias){.sigma = INFINITY};
    TSUYA_NEW(status, tag, most);
    TSUYA_NEW(status, pairs, NEIGHBOURS * most + 1);
    TSUYA_NEW(status, list, NEIGHBOURS * most + 1);
    for (int first = 0, end; first < corners->count; first = end) {
        for (end = first; end < corners->count && corners->corner[end].photo == corners->corner[first].photo;) {
            end++;
        }
        int n = complete_tags(tag, &corners->corner[first], end - first, board);
        count += add_pairs(pairs + count, tag, n, board);
    }
    solve(bias, pairs, count, list);
done:
    tsuya_free(tag);
    tsuya_free(pairs);
    tsuya_free(list);
    return status;
}

void tsuya_edge_bias_remove(tsuya_corner_set *corners, double bias)
{
    for (int i = 0; i < corners->count; i++) {
        corners->corner[i].x_px -= bias * corners->corner[i].spread_x_px;
        corners->corner[i].y_px -= bias * corners->corner[i].spread_y_px;
    }
}
