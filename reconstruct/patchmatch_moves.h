/* Second half of patchmatch_lanes.h: where planes come from (neighbours, chance, a parabola), and the row kernel. */

/* Adaptive checkerboard (Xu and Tao 2019, fig. 3): four V-shaped areas of 7 pixels and four strips of 11, all of the
 * other colour; each area hands over the plane of its cheapest pixel. */
typedef struct area_offsets { int count; int8_t d[11][2]; } area_offsets;

#define V_UP {7, {{0, -1}, {-1, -2}, {1, -2}, {-2, -3}, {2, -3}, {-3, -4}, {3, -4}}}
#define V_DOWN {7, {{0, 1}, {-1, 2}, {1, 2}, {-2, 3}, {2, 3}, {-3, 4}, {3, 4}}}
#define V_LEFT {7, {{-1, 0}, {-2, -1}, {-2, 1}, {-3, -2}, {-3, 2}, {-4, -3}, {-4, 3}}}
#define V_RIGHT {7, {{1, 0}, {2, -1}, {2, 1}, {3, -2}, {3, 2}, {4, -3}, {4, 3}}}
#define STRIP(sx, sy)                                                                                        \
    {11, {{3 * (sx), 3 * (sy)}, {5 * (sx), 5 * (sy)}, {7 * (sx), 7 * (sy)}, {9 * (sx), 9 * (sy)},             \
          {11 * (sx), 11 * (sy)}, {13 * (sx), 13 * (sy)}, {15 * (sx), 15 * (sy)}, {17 * (sx), 17 * (sy)},     \
          {19 * (sx), 19 * (sy)}, {21 * (sx), 21 * (sy)}, {23 * (sx), 23 * (sy)}}}

static const area_offsets areas[NEIGHBOURS] = {
    V_UP, V_DOWN, V_LEFT, V_RIGHT, STRIP(0, -1), STRIP(0, 1), STRIP(-1, 0), STRIP(1, 0),
};

/* Index of the cheapest active pixel of an area, or −1. */
INLINE ptrdiff_t area_best(const plane_field *field, const area_offsets *area, int x, int y)
{
    ptrdiff_t best = -1;
    float least = PATCH_COST_IMPOSSIBLE;
    for (int i = 0; i < area->count; i++) {
        int nx = x + area->d[i][0], ny = y + area->d[i][1];
        if (nx < 0 || ny < 0 || nx >= field->width_px || ny >= field->height_px) {
            continue;
        }
        ptrdiff_t at = (ptrdiff_t)ny * field->width_px + nx;
        if (field->active[at] && field->cost[at] < least) {
            least = field->cost[at];
            best = at;
        }
    }
    return best;
}

/* The area's plane, continued to each lane's pixel; `own` where the area has none. */
INLINE lane_plane area_plane(const plane_field *field, const lane_batch *b, int area, lane_plane own)
{
    lane_plane p = own;
    for (int l = 0; l < b->count; l++) {
        ptrdiff_t at = area_best(field, &areas[area], b->x[l], b->y);
        if (at >= 0) {
            float dx = (float)(b->x[l] - (int)(at % field->width_px)), dy = (float)(b->y - (int)(at / field->width_px));
            p.wx[l] = field->wx[at];
            p.wy[l] = field->wy[at];
            p.w[l] = field->w[at] + field->wx[at] * dx + field->wy[at] * dy;
        }
    }
    return p;
}

/* A plane anywhere in the range, its normal uniform over the directions that face the camera within about 75 degrees. */
INLINE lane_plane random_plane(const lane_batch *b, const patch_level *level, const patch_pass *pass, int draw)
{
    vf r[3];
    lane_random(r, level, b, pass, draw);
    vf w = level->w_min + r[0] * (level->w_max - level->w_min);
    /* Uniform in a square around the axis: n = (a, b, 1) unnormalised, |a|, |b| ≤ 1.6. */
    return plane_with_normal(b, level, w, 3.2f * r[1] - 1.6f, 3.2f * r[2] - 1.6f, splat(1.0f));
}

/* A step of either sign whose size is log-uniform over 1/32 … 1 of `most`. */
INLINE vf log_step(vf r, vf most)
{
    vf side = select_f(r < 0.5f, splat(-1.0f), splat(1.0f));
    vf t = select_f(r < 0.5f, r * 2.0f, r * 2.0f - 1.0f);
    return side * most * lane_exp(t * -3.4657359f);
}

/* Perturbed plane: depth by up to `reach` pixels in the sources, normal by up to `tilt` (tangent of the angle). */
INLINE lane_plane perturbed(const lane_batch *b, const patch_level *level, const patch_pass *pass, lane_plane p,
                            float reach, float tilt, int draw)
{
    vf r[3];
    lane_random(r, level, b, pass, draw);
    vf w = p.w + log_step(r[0], splat(reach * level->w_per_px));
    vf nx = p.wx * level->fx_px, ny = p.wy * level->fy_px;
    vf nz = p.w - nx * b->ray_x - ny * b->ray_y;
    vf length = lane_sqrt(nx * nx + ny * ny + nz * nz) * tilt;
    nx += log_step(r[1], length);
    ny += log_step(r[2], length);
    return plane_with_normal(b, level, w, nx, ny, nz);
}

INLINE lane_plane refinement(int k, const lane_batch *b, const patch_level *level, const patch_pass *pass, lane_plane p)
{
    switch (k) {
    case 0: return perturbed(b, level, pass, p, pass->reach_px, 0.0f, 20);
    case 1: return perturbed(b, level, pass, p, 0.0f, pass->tilt, 21);
    case 2: return perturbed(b, level, pass, p, pass->reach_px, pass->tilt, 22);
    case 3: return pass->anywhere ? random_plane(b, level, pass, 23)
                                  : perturbed(b, level, pass, p, 0.25f * pass->reach_px, 0.5f * pass->tilt, 23);
    default: {
        if (!pass->anywhere) {
            return perturbed(b, level, pass, p, 0.0f, 0.25f * pass->tilt, 24);
        }
        lane_plane q = random_plane(b, level, pass, 24);
        vf k_w = p.w / q.w; /* the random normal at the present depth */
        return (lane_plane){p.w, q.wx * k_w, q.wy * k_w};
    }
    }
}

/* Vertex of the parabola through the cost at w and w ± a quarter pixel. */
INLINE void polish(lane_plane *best, vf *best_cost, const lane_trust *trust, const lane_batch *b,
                   const patch_level *level)
{
    float step = 0.25f * level->w_per_px;
    lane_plane below = *best, above = *best;
    below.w -= step, above.w += step;
    const vf any = splat(2.0f * PATCH_COST_IMPOSSIBLE);
    vf centre = *best_cost;
    vf c0 = plane_cost_trusted(trust, b, level, below, any), c1 = plane_cost_trusted(trust, b, level, above, any);
    vf bend = c0 + c1 - 2.0f * centre;
    vf move = lane_max(lane_min(0.5f * (c0 - c1) / lane_max(bend, splat(1e-6f)), splat(1.0f)), splat(-1.0f));
    lane_plane vertex = *best;
    vertex.w += step * move;
    take_better(best, best_cost, below, c0);
    take_better(best, best_cost, above, c1);
    take_better(best, best_cost, vertex, plane_cost_trusted(trust, b, level, vertex, *best_cost));
}

INLINE lane_plane load_plane(const plane_field *field, const lane_batch *b)
{
    lane_plane p;
    for (int l = 0; l < LANES; l++) {
        size_t at = (size_t)b->y * (size_t)field->width_px + (size_t)b->x[l];
        p.w[l] = field->w[at];
        p.wx[l] = field->wx[at];
        p.wy[l] = field->wy[at];
    }
    return p;
}

INLINE void store_plane(plane_field *field, const lane_batch *b, lane_plane p, vf cost, const lane_trust *trust, int sources)
{
    vi view = {};
    vf most = trust->weight[0];
    for (int s = 1; s < sources; s++) {
        vi more = trust->weight[s] > most;
        most = select_f(more, trust->weight[s], most);
        view = (more & s) | (~more & view);
    }
    for (int l = 0; l < b->count; l++) {
        size_t at = (size_t)b->y * (size_t)field->width_px + (size_t)b->x[l];
        field->w[at] = p.w[l];
        field->wx[at] = p.wx[l];
        field->wy[at] = p.wy[l];
        field->cost[at] = cost[l];
        field->view[at] = (uint8_t)view[l];
    }
}

/* The planes that compete before refinement: the present one first, then neighbours or chance.  Returns how many. */
INLINE int candidates(lane_plane *plane, const plane_field *field, const lane_batch *b, const patch_level *level,
                      const patch_pass *pass)
{
    plane[0] = load_plane(field, b);
    if (pass->mode == PATCH_SWEEP) {
        const int first = pass->strips < 0 ? NEAR + 2 : NEAR, last = pass->strips == 2 ? NEAR + 2 : NEIGHBOURS;
        int count = 1;
        for (int k = 0; k < NEIGHBOURS; k++) {
            if (k < NEAR || (k >= first && k < last)) {
                plane[count++] = area_plane(field, b, k, plane[0]);
            }
        }
        return count;
    }
    if (pass->mode == PATCH_START) {
        vi blank = plane[0].w <= 0.0f;
        for (int k = 0; k < START_PLANES; k++) {
            plane[1 + k] = random_plane(b, level, pass, k);
        }
        plane[0].w = select_f(blank, plane[1].w, plane[0].w);
        plane[0].wx = select_f(blank, plane[1].wx, plane[0].wx);
        plane[0].wy = select_f(blank, plane[1].wy, plane[0].wy);
        return 1 + START_PLANES;
    }
    return 1;
}

enum { MOST_PLANES = 1 + (NEIGHBOURS > START_PLANES ? NEIGHBOURS : START_PLANES) };

static void batch_pass(const patch_level *level, plane_field *field, const patch_pass *pass, lane_batch *b)
{
    vf cost[MOST_PLANES][TSUYA_STEREO_MAX_SOURCES], geometric[MOST_PLANES][TSUYA_STEREO_MAX_SOURCES];
    lane_plane plane[MOST_PLANES];
    batch_begin(b, level);
    int count = candidates(plane, field, b, level, pass);
    vi best_view = splat_int(-1);
    for (int l = 0; l < LANES && pass->mode == PATCH_SWEEP; l++) {
        best_view[l] = field->view[(size_t)b->y * (size_t)field->width_px + (size_t)b->x[l]];
    }
    for (int k = 0; k < count; k++) {
        plane_costs(cost[k], geometric[k], b, level, plane[k]);
    }
    lane_trust trust = {0};
    lane_plane best = plane[0];
    vf best_cost = splat(2.0f * PATCH_COST_IMPOSSIBLE);
    /* Random planes say nothing together; each is judged by the sources that like it. */
    if (pass->mode == PATCH_SWEEP) {
        select_views(&trust, cost + 1, count - 1, level, pass, best_view);
    }
    for (int k = 0; k < count; k++) {
        if (pass->mode != PATCH_SWEEP) {
            select_views(&trust, cost + k, 1, level, pass, best_view);
        }
        vf c = trusted_cost(&trust, cost[k], level->geometric ? geometric[k] : NULL, level->source_count);
        take_better(&best, &best_cost, plane[k], select_f(possible(b, level, plane[k]), c, splat(PATCH_COST_IMPOSSIBLE)));
    }
    for (int k = 0; k < pass->refinements && pass->mode == PATCH_SWEEP; k++) {
        lane_plane p = refinement(k, b, level, pass, best);
        take_better(&best, &best_cost, p, plane_cost_trusted(&trust, b, level, p, best_cost));
    }
    if (pass->polish) {
        polish(&best, &best_cost, &trust, b, level);
    }
    store_plane(field, b, best, best_cost, &trust, level->source_count);
}

void KERNEL(const patch_level *level, plane_field *field, const patch_pass *pass, int y)
{
    lane_batch b;
    b.y = y;
    b.count = 0;
    int first = pass->color < 0 ? 0 : (y ^ pass->color) & 1, step = pass->color < 0 ? 1 : 2;
    for (int x = first; x < field->width_px; x += step) {
        if (!field->active[(size_t)y * (size_t)field->width_px + (size_t)x]) {
            continue;
        }
        b.x[b.count++] = x;
        if (b.count == LANES) {
            batch_pass(level, field, pass, &b);
            b.count = 0;
        }
    }
    if (b.count > 0) {
        batch_pass(level, field, pass, &b);
    }
}
