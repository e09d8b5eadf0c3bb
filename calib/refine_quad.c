#include "calib/refine_quad.h"

#include "calib/planar.h"

#include <string.h>

enum { MOST_PASSES = 3 };

static double depth_between(const tsuya_edge *edge, tsuya_vec2 p)
{
    return (p.x - edge->middle.x) * edge->inward.x + (p.y - edge->middle.y) * edge->inward.y;
}

/* The blur of an earlier fit stays as the next one's start. */
static void place(tsuya_edge_quad *q, const tsuya_vec2 corner[4])
{
    for (int i = 0; i < 4; i++) {
        double blur = q->edge[i].p[EDGE_BLUR];
        tsuya_edge_place(&q->edge[i], corner[i], corner[(i + 1) % 4]);
        q->edge[i].p[EDGE_BLUR] = blur;
    }
}

/* Mean depth of a cell behind edge i. */
static double cell_px(const tsuya_edge_quad *q, int i, int cells) { return depth_between(&q->edge[i], q->edge[(i + 2) % 4].middle) / cells; }

static double grey_at(const tsuya_image *grey, tsuya_vec2 p)
{
    const double x = fmin(fmax(p.x, 0.0), grey->width_px - 1.0), y = fmin(fmax(p.y, 0.0), grey->height_px - 1.0);
    return (double)*tsuya_image_f32(grey, (int)(x + 0.5), (int)(y + 0.5));
}

typedef struct level { double sum, least, most; int count; } level;

static void add_level(level *l, double v)
{
    l->least = l->count > 0 ? fmin(l->least, v) : v;
    l->most = l->count > 0 ? fmax(l->most, v) : v;
    l->sum += v;
    l->count++;
}

/* Greys of the cells' middles, and of the border and of what is around the tag. */
static void sample_cells(double value[EDGE_MOST_CELLS][EDGE_MOST_CELLS], level *border, level *around, tsuya_mat3 px_from_cells, const tsuya_image *grey,
                         const tsuya_edge_grid *grid)
{
    const int end = grid->cells - grid->border_bits;
    for (int y = -1; y <= grid->cells; y++) {
        for (int x = -1; x <= grid->cells; x++) {
            const double v = grey_at(grey, tsuya_homography_apply(px_from_cells, (tsuya_vec2){x + 0.5, y + 0.5}));
            const bool beside = x < 0 || x == grid->cells, above = y < 0 || y == grid->cells;
            if (beside || above) {
                if (beside != above) { /* some grids have black squares at their corners */
                    add_level(around, v);
                }
                continue;
            }
            value[y][x] = v;
            if (x < grid->border_bits || y < grid->border_bits || x >= end || y >= end) {
                add_level(border, v);
            }
        }
    }
}

/* Reads the code from the middles of its cells, where they are small beside the blur and what is around the tag is even: cells like that,
 * white but for families with a white border, send their light into the border. */
static void read_code(tsuya_edge_quad *q, const tsuya_vec2 corner[4], const tsuya_image *grey, const tsuya_edge_grid *grid)
{
    const double n = grid->cells;
    const tsuya_vec2 plane[4] = {{0, 0}, {n, 0}, {n, n}, {0, n}};
    double value[EDGE_MOST_CELLS][EDGE_MOST_CELLS];
    level border = {0}, around = {0};
    tsuya_mat3 h;
    bool narrow = false;
    for (int i = 0; i < 4; i++) {
        narrow = narrow || tsuya_edge_is_narrow(grid->border_bits * cell_px(q, i, grid->cells), fmax(q->edge[i].p[EDGE_BLUR], 0.8));
    }
    q->code = (tsuya_edge_code){.cells = grid->cells, .border = grid->border_bits};
    if (!narrow || grid->cells > EDGE_MOST_CELLS || !tsuya_homography_fit(&h, plane, corner, 4) || !tsuya_homography_fit(&q->code.cells_from_px, corner, plane, 4)) {
        return;
    }
    sample_cells(value, &border, &around, h, grey, grid);
    const double dark = border.sum / border.count, light = around.sum / around.count;
    for (int k = 0; k < grid->cells * grid->cells; k++) {
        const double v = value[k / grid->cells][k % grid->cells];
        q->code.white[k / grid->cells][k % grid->cells] = fabs(v - light) < fabs(v - dark);
    }
    q->code.read = around.most - around.least < 0.5 * fabs(light - dark);
}

static void fit_edge(tsuya_edge_quad *q, int i, const tsuya_image *grey, const tsuya_edge_grid *grid, const tsuya_edge_look *look, bool learn)
{
    const double cell = cell_px(q, i, grid->cells);
    tsuya_edge_fit(&q->edge[i], grey, &q->edge[(i + 3) % 4], &q->edge[(i + 1) % 4], grid->border_bits * cell, cell, &q->code, look, learn);
}

static void fit_quad(tsuya_edge_quad *q, const tsuya_image *grey, const tsuya_edge_grid *grid, const tsuya_edge_look *look, bool learn)
{
    for (int i = 0; i < 4; i++) {
        fit_edge(q, i, grey, grid, look, learn);
    }
}

/* Where two neighbouring curves meet (Newton), and how their errors move that point. */
static bool meet(tsuya_vec2 *corner, double *sigma_px, const tsuya_edge *in, const tsuya_edge *out)
{
    double u = 1.0, v = -1.0;
    tsuya_vec2 a, b, da, db;
    for (int i = 0; i < 6; i++) {
        a = tsuya_edge_point(in, u, &da);
        b = tsuya_edge_point(out, v, &db);
        double ex = b.x - a.x, ey = b.y - a.y, determinant = -da.x * db.y + db.x * da.y;
        if (fabs(determinant) < 1e-6 * in->half_length_px * out->half_length_px) {
            return false;
        }
        u += (-ex * db.y + ey * db.x) / determinant;
        v += (da.x * ey - da.y * ex) / determinant;
    }
    if (!(fabs(u - 1.0) < 0.5) || !(fabs(v + 1.0) < 0.5)) {
        return false;
    }
    *corner = tsuya_edge_point(in, u, &da);
    double g[2][3] = {{1.0, u, u * u - 1.0 / 3.0}, {1.0, v, v * v - 1.0 / 3.0}}, variance[2] = {0};
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++) {
            variance[0] += g[0][i] * in->covariance[i][k] * g[0][k];
            variance[1] += g[1][i] * out->covariance[i][k] * g[1][k];
        }
    }
    double sine = in->inward.x * out->inward.y - in->inward.y * out->inward.x;
    *sigma_px = sqrt(0.5 * (variance[0] + variance[1])) / fmax(fabs(sine), 1e-6);
    return isfinite(*sigma_px);
}

bool tsuya_edge_quad_corner(tsuya_vec2 *corner, double *sigma_px, const tsuya_edge_quad *q, int i)
{
    const tsuya_edge *in = &q->edge[(i + 3) % 4], *out = &q->edge[i];
    *sigma_px = INFINITY;
    return in->reason == TSUYA_REFINE_FINE && out->reason == TSUYA_REFINE_FINE && meet(corner, sigma_px, in, out);
}

/* The corners of the last fit; how far the farthest went. */
static double follow(tsuya_vec2 corner[4], const tsuya_edge_quad *q)
{
    double farthest = 0.0, sigma_px;
    for (int i = 0; i < 4; i++) {
        tsuya_vec2 old = corner[i];
        (void)tsuya_edge_quad_corner(&corner[i], &sigma_px, q, i);
        farthest = fmax(farthest, hypot(corner[i].x - old.x, corner[i].y - old.y));
    }
    return farthest;
}

void tsuya_edge_quad_settle(tsuya_edge_quad *q, tsuya_vec2 corner[4], const tsuya_image *grey, const tsuya_edge_grid *grid, const tsuya_edge_look *look, bool learn)
{
    for (int pass = 0; pass < MOST_PASSES; pass++) {
        double blur[4], change = 0.0;
        for (int i = 0; i < 4; i++) {
            blur[i] = q->edge[i].p[EDGE_BLUR];
        }
        place(q, corner);
        read_code(q, corner, grey, grid);
        fit_quad(q, grey, grid, look, learn);
        for (int i = 0; i < 4; i++) {
            change = q->edge[i].reason == TSUYA_REFINE_FINE ? fmax(change, fabs(q->edge[i].p[EDGE_BLUR] / blur[i] - 1.0)) : change;
        }
        const bool close = q->code.read; /* light from the code wants blur and corners as they are */
        if (follow(corner, q) < (close ? 0.1 : 0.75) && change < (close ? 0.05 : 0.3)) {
            return;
        }
    }
}

void tsuya_edge_quad_start(tsuya_edge_quad *q, double blur_px)
{
    for (int i = 0; i < 4; i++) {
        q->edge[i].p[EDGE_BLUR] = blur_px;
    }
}

tsuya_vec2 tsuya_edge_quad_spread(const tsuya_edge_quad *q, int i)
{
    const tsuya_edge *a = &q->edge[(i + 3) % 4], *b = &q->edge[i];
    double sine = a->inward.x * b->inward.y - a->inward.y * b->inward.x, ra = -a->p[EDGE_BLUR], rb = -b->p[EDGE_BLUR];
    return fabs(sine) < 0.05 ? (tsuya_vec2){0, 0} : (tsuya_vec2){(ra * b->inward.y - rb * a->inward.y) / sine, (a->inward.x * rb - b->inward.x * ra) / sine};
}
