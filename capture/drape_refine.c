/* Each triangle of a sheet into four: as it stands, or smoothed (C. Loop, "Smooth Subdivision Surfaces Based on Triangles", 1987,
 * with J. Warren's weights). */
#include "capture/drape_parts.h"

#include "core/memory.h"

#include <math.h>
#include <string.h>

typedef struct refinement {
    const tsuya_drape_sheet *from;
    tsuya_drape_sheet *to;
    tsuya_side *side;
    uint32_t *edge;      /* of each side's corner: the new vertex' number among the edges */
    double *sum, *ring;  /* per vertex: sum of neighbours; of neighbours along the border */
    uint32_t *valence, *border;
    bool smooth;
} refinement;

static void add_vertex(double *sum, uint32_t to, tsuya_vec3 p, uint32_t *count)
{
    drape_add(sum, to, 1.0, p);
    count[to]++;
}

static void place_edges(refinement *r)
{
    const double *x = r->from->position;
    size_t count = 3 * r->from->triangle_count;
    uint32_t number = (uint32_t)r->from->vertex_count;
    for (size_t i = 0, j; i < count; i = j, number++) {
        uint32_t a = r->side[i].low, b = r->side[i].high;
        for (j = i; j < count && tsuya_side_same_edge(&r->side[j], &r->side[i]); j++) {
            r->edge[r->side[j].corner] = number;
        }
        tsuya_vec3 p = drape_at(x, a), q = drape_at(x, b), middle = tsuya_vec3_scale(tsuya_vec3_add(p, q), 0.5);
        add_vertex(r->sum, a, q, r->valence);
        add_vertex(r->sum, b, p, r->valence);
        if (j - i == 2 && r->smooth) {
            tsuya_vec3 across = tsuya_vec3_add(drape_at(x, r->from->triangle[r->side[i].corner]), drape_at(x, r->from->triangle[r->side[i + 1].corner]));
            middle = tsuya_vec3_mad(tsuya_vec3_scale(middle, 0.75), 0.125, across);
        } else if (j - i == 1) {
            add_vertex(r->ring, a, q, r->border);
            add_vertex(r->ring, b, p, r->border);
        }
        drape_add(r->to->position, number, 1.0, middle);
        r->to->fixed[number] = r->from->fixed[a] && r->from->fixed[b];
    }
}

static void place_vertices(refinement *r)
{
    for (uint32_t v = 0; v < r->from->vertex_count; v++) {
        double n = r->valence[v], beta = !r->smooth || n < 3 ? 0.0 : n > 3 ? 0.375 / n : 0.1875;
        tsuya_vec3 p = drape_at(r->from->position, v), q = tsuya_vec3_mad(tsuya_vec3_scale(p, 1.0 - n * beta), beta, drape_at(r->sum, v));
        if (r->border[v] > 0) {
            q = r->smooth && r->border[v] == 2 ? tsuya_vec3_mad(tsuya_vec3_scale(p, 0.75), 0.125, drape_at(r->ring, v)) : p;
        }
        drape_add(r->to->position, v, 1.0, q);
        r->to->fixed[v] = r->from->fixed[v];
    }
}

static void split_triangles(refinement *r)
{
    for (size_t t = 0; t < r->from->triangle_count; t++) {
        const uint32_t *v = r->from->triangle + 3 * t, *e = r->edge + 3 * t;
        const double *c = r->from->uv + 6 * t;
        const uint32_t corner[6] = {v[0], v[1], v[2], e[0], e[1], e[2]};
        double uv[6][2];
        static const int part[4][3] = {{0, 5, 4}, {5, 1, 3}, {4, 3, 2}, {3, 4, 5}};
        for (int k = 0; k < 2; k++) {
            for (int i = 0; i < 3; i++) {
                uv[i][k] = c[2 * i + k];
                uv[3 + i][k] = 0.5 * (c[2 * ((i + 1) % 3) + k] + c[2 * ((i + 2) % 3) + k]);
            }
        }
        for (size_t p = 0; p < 4; p++) {
            for (size_t i = 0; i < 3; i++) {
                r->to->triangle[3 * (4 * t + p) + i] = corner[part[p][i]];
                memcpy(r->to->uv + 6 * (4 * t + p) + 2 * i, uv[part[p][i]], sizeof uv[0]);
            }
        }
    }
}

tsuya_status tsuya_drape_sheet_subdivide(tsuya_drape_sheet *fine, const tsuya_drape_sheet *coarse, bool smooth)
{
    tsuya_status status;
    refinement r = {.from = coarse, .to = fine, .smooth = smooth};
    *fine = (tsuya_drape_sheet){0};
    TSUYA_NEW(status, r.side, 3 * coarse->triangle_count);
    TSUYA_NEW(status, r.edge, 3 * coarse->triangle_count);
    TSUYA_NEW(status, r.sum, 3 * coarse->vertex_count);
    TSUYA_NEW(status, r.ring, 3 * coarse->vertex_count);
    TSUYA_NEW(status, r.valence, coarse->vertex_count);
    TSUYA_NEW(status, r.border, coarse->vertex_count);
    size_t edges = tsuya_mesh_sides(r.side, coarse->triangle, coarse->triangle_count);
    TSUYA_GOTO_DONE(status, tsuya_drape_sheet_create(fine, coarse->vertex_count + edges, 4 * coarse->triangle_count));
    place_edges(&r);
    place_vertices(&r);
    split_triangles(&r);
done:
    tsuya_free(r.side);
    tsuya_free(r.edge);
    tsuya_free(r.sum);
    tsuya_free(r.ring);
    tsuya_free(r.valence);
    tsuya_free(r.border);
    return status;
}

/* Corners that a coarse mesh cut stick in the body once it is finer: their ends move out, a tenth of a triangle at most. */
static tsuya_status push_out(tsuya_drape_sheet *s, const tsuya_drape_body *body, int body_count, double least_m)
{
    enum { PASSES = 60 };
    drape_element *element = NULL;
    uint32_t *edge = NULL;
    size_t edges, inside = 1;
    tsuya_status status = tsuya_drape_elements_create(&element, &edge, &edges, s);
    for (int pass = 0; pass < PASSES && inside > 0 && status == TSUYA_OK; pass++) {
        inside = 0;
        for (size_t k = 0; k < s->vertex_count + edges; k++) {
            uint32_t a = k < s->vertex_count ? (uint32_t)k : edge[2 * (k - s->vertex_count)];
            uint32_t b = k < s->vertex_count ? (uint32_t)k : edge[2 * (k - s->vertex_count) + 1];
            for (int i = 0; i < body_count; i++) {
                tsuya_vec3 n, p = tsuya_vec3_scale(tsuya_vec3_add(drape_at(s->position, a), drape_at(s->position, b)), 0.5);
                double d = tsuya_drape_body_distance(&body[i], p, &n);
                if (d < least_m) {
                    inside++;
                    drape_add(s->position, a, s->fixed[a] ? 0.0 : 1.1 * least_m - d, n);
                    drape_add(s->position, b, s->fixed[b] || a == b ? 0.0 : 1.1 * least_m - d, n);
                }
            }
        }
    }
    tsuya_free(element);
    tsuya_free(edge);
    if (status == TSUYA_OK && inside > 0) {
        status = tsuya_fail(TSUYA_ERROR_NUMERIC, "drape: the finer sheet sticks in a body at %zu places; fewer levels are accepted", inside);
    }
    return status;
}

/* The finer sheet, outside of the bodies and still without intersections. */
static tsuya_status refine(tsuya_drape_sheet *sheet, const tsuya_drape_body *body, int body_count, double near_m)
{
    tsuya_drape_sheet fine;
    size_t crossings;
    TSUYA_TRY(tsuya_drape_sheet_subdivide(&fine, sheet, false));
    tsuya_drape_sheet_free(sheet);
    *sheet = fine;
    TSUYA_TRY(push_out(sheet, body, body_count, 0.2 * near_m));
    TSUYA_TRY(tsuya_drape_intersections(&crossings, sheet));
    return crossings == 0 ? TSUYA_OK : tsuya_fail(TSUYA_ERROR_NUMERIC, "drape: %zu edges of the finer sheet cross it; fewer levels are accepted", crossings);
}

tsuya_status tsuya_drape_settle(tsuya_drape_info *info, tsuya_drape_sheet *sheet, const tsuya_drape_fabric *fabric, const tsuya_drape_body *body,
                                int body_count, const tsuya_drape_options *options, int levels, const tsuya_context *context)
{
    tsuya_drape_info all = {0};
    for (int level = 0; level <= levels; level++) {
        tsuya_drape_options own = *options;
        if (level > 0) {
            TSUYA_TRY(refine(sheet, body, body_count, fabric->thickness_m));
            own.step_s = fmin(fmax(own.step_s, 0.1), own.step_most_s);
        }
        TSUYA_TRY(tsuya_drape_run(info, sheet, fabric, body, body_count, &own, NULL, NULL, context));
        all.steps += info->steps;
        all.newton_steps += info->newton_steps;
        all.energy_rise_j = fmax(all.energy_rise_j, info->energy_rise_j);
    }
    info->steps = all.steps;
    info->newton_steps = all.newton_steps;
    info->energy_rise_j = all.energy_rise_j;
    return TSUYA_OK;
}
