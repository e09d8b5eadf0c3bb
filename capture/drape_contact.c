/* What touches: pairs found by a grid, the barrier on their distances, lagged friction, steps cut before they collide. */
#include "capture/drape_parts.h"

#include "core/memory.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double SLIDE_M = 1e-4;   /* per step: below it friction is smooth */
static const double LEAST_GAP = 0.1;  /* of its distance that a pair keeps in one step */

typedef struct bounds { double low[3], high[3]; } bounds;
typedef struct entry { int cell[3]; uint32_t item; } entry;
typedef struct grid { double cell; uint32_t mask; uint32_t *start; entry *entry; bounds *item; } grid;

static bounds swept(const drape_state *s, const double *from, const double *to, const uint32_t *v, int count)
{
    bounds b = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    for (int k = 0; k < count; k++) {
        for (int i = 0; i < 3; i++) {
            double p = from[3 * v[k] + (uint32_t)i], q = to[3 * v[k] + (uint32_t)i];
            b.low[i] = fmin(b.low[i], fmin(p, q) - 0.51 * s->near_m);
            b.high[i] = fmax(b.high[i], fmax(p, q) + 0.51 * s->near_m);
        }
    }
    return b;
}

static uint32_t bucket(const grid *g, const int c[3])
{
    uint32_t h = (uint32_t)c[0] * 73856093u ^ (uint32_t)c[1] * 19349663u ^ (uint32_t)c[2] * 83492791u;
    return (h ^ h >> 15) & g->mask;
}

#define FOR_CELLS(g, b, c)                                                                                               \
    for (int c[3] = {(int)floor((b).low[0] / (g)->cell), 0, 0}; c[0] <= (int)floor((b).high[0] / (g)->cell); c[0]++)      \
        for (c[1] = (int)floor((b).low[1] / (g)->cell); c[1] <= (int)floor((b).high[1] / (g)->cell); c[1]++)              \
            for (c[2] = (int)floor((b).low[2] / (g)->cell); c[2] <= (int)floor((b).high[2] / (g)->cell); c[2]++)

static void grid_free(grid *g)
{
    tsuya_free(g->start);
    tsuya_free(g->entry);
    tsuya_free(g->item);
}

static tsuya_status grid_create(grid *g, const drape_state *s, const double *from, const double *to, const uint32_t *vertex, int each, size_t count)
{
    tsuya_status status = TSUYA_OK;
    size_t total = 0;
    *g = (grid){.cell = 1.5 * s->mean_edge_m, .mask = 1023};
    while (g->mask < 2 * count) {
        g->mask = 2 * g->mask + 1;
    }
    TSUYA_NEW(status, g->start, (size_t)g->mask + 3);
    TSUYA_NEW(status, g->item, count);
    for (size_t k = 0; k < count; k++) {
        g->item[k] = swept(s, from, to, vertex + (size_t)each * k, each);
        FOR_CELLS(g, g->item[k], c) { g->start[bucket(g, c) + 1]++, total++; }
    }
    for (uint32_t b = 0; b <= g->mask; b++) {
        g->start[b + 1] += g->start[b];
    }
    g->start[g->mask + 2] = (uint32_t)total;
    TSUYA_NEW(status, g->entry, total);
    for (size_t k = count; k-- > 0;) { /* filled from the back: items ascend in a bucket once start has moved down */
        FOR_CELLS(g, g->item[k], c) {
            g->entry[--g->start[bucket(g, c) + 1]] = (entry){{c[0], c[1], c[2]}, (uint32_t)k};
        }
    }
done:
    return status;
}

static tsuya_status add_pair(drape_list *l, drape_pair pair)
{
    if (l->count == l->room) {
        size_t room = 2 * l->room + 4096;
        drape_pair *p = tsuya_realloc(l->pair, room, sizeof *p);
        if (!p) {
            return TSUYA_ERROR_MEMORY;
        }
        l->pair = p;
        l->room = room;
    }
    l->pair[l->count++] = pair;
    return TSUYA_OK;
}

static bool overlap(const bounds *a, const bounds *b)
{
    for (int i = 0; i < 3; i++) {
        if (a->low[i] > b->high[i] || b->low[i] > a->high[i]) {
            return false;
        }
    }
    return true;
}

/* Each pair once: in the cell of the overlap's lowest corner. */
static bool is_first_cell(const grid *g, const bounds *a, const bounds *b, const int c[3])
{
    for (int i = 0; i < 3; i++) {
        if ((int)floor(fmax(a->low[i], b->low[i]) / g->cell) != c[i]) {
            return false;
        }
    }
    return true;
}

static tsuya_status query(drape_list *l, const grid *g, const bounds *b, const uint32_t *own, int own_count, uint32_t self, const uint32_t *vertex,
                          int each)
{
    FOR_CELLS(g, *b, c) {
        uint32_t at = bucket(g, c);
        for (uint32_t k = g->start[at + 1]; k < g->start[at + 2]; k++) {
            const entry *e = &g->entry[k];
            const uint32_t *v = vertex + (size_t)each * e->item;
            bool shared = own_count == 2 && e->item <= self;
            for (int i = 0; i < own_count * each && !shared; i++) {
                shared = own[i / each] == v[i % each];
            }
            if (shared || memcmp(e->cell, c, sizeof e->cell) != 0 || !overlap(b, &g->item[e->item]) ||
                !is_first_cell(g, b, &g->item[e->item], c)) {
                continue;
            }
            drape_pair pair = {{own[0], own_count == 2 ? own[1] : v[0], own_count == 2 ? v[0] : v[1], own_count == 2 ? v[1] : v[2]}, own_count == 2};
            TSUYA_TRY(add_pair(l, pair));
        }
    }
    return TSUYA_OK;
}

tsuya_status tsuya_drape_find_pairs(drape_state *s, const double *from, const double *to)
{
    tsuya_status status = TSUYA_OK;
    s->pairs.count = 0;
    for (int edges = 0; edges < 2 && s->options->self_contact && status == TSUYA_OK; edges++) {
        grid g;
        const uint32_t *vertex = edges ? s->edge : s->sheet->triangle;
        size_t count = edges ? s->edge_count : s->sheet->triangle_count, asked = edges ? s->edge_count : s->n;
        status = grid_create(&g, s, from, to, vertex, edges ? 2 : 3, count);
        for (size_t k = 0; k < asked && status == TSUYA_OK; k++) {
            uint32_t own = (uint32_t)k;
            const uint32_t *v = edges ? s->edge + 2 * k : &own;
            bounds b = swept(s, from, to, v, edges ? 2 : 1);
            status = query(&s->pairs, &g, &b, v, edges ? 2 : 1, own, vertex, edges ? 2 : 3);
        }
        grid_free(&g);
    }
    return status;
}

static double pair_at(const double *x, const drape_pair *pair, double p[12], double w[4])
{
    for (int k = 0; k < 4; k++) {
        memcpy(p + 3 * k, x + 3 * pair->v[k], 3 * sizeof *p);
    }
    return tsuya_drape_pair_distance(p, pair->is_edges, w);
}

/* (d − near)² ln(near / d) */
static double barrier(double d, double near_m)
{
    return d >= near_m ? 0.0 : d <= 0.0 ? INFINITY : (d - near_m) * (d - near_m) * log(near_m / d);
}
double tsuya_drape_barrier_slope(double d, double near_m)
{
    return d >= near_m ? 0.0 : 2.0 * (d - near_m) * log(near_m / d) - (d - near_m) * (d - near_m) / d;
}
static double barrier_curvature(double d, double near_m)
{
    double k = d - near_m;
    return d >= near_m ? 0.0 : 2.0 * log(near_m / d) - 4.0 * k / d + k * k / (d * d);
}

/* Bodies are felt by the vertices and by the middles of the edges. */
static tsuya_vec3 probe(const drape_state *s, const double *x, size_t k, uint32_t v[4], double w[4])
{
    bool middle = k >= s->n;
    v[0] = v[2] = v[3] = middle ? s->edge[2 * (k - s->n)] : (uint32_t)k;
    v[1] = middle ? s->edge[2 * (k - s->n) + 1] : (uint32_t)k;
    w[0] = middle ? 0.5 : 1.0;
    w[1] = middle ? 0.5 : 0.0;
    w[2] = w[3] = 0.0;
    return tsuya_vec3_mad(tsuya_vec3_scale(drape_at(x, v[0]), w[0]), w[1], drape_at(x, v[1]));
}

double tsuya_drape_contact_energy(const drape_state *s, const double *x)
{
    double sum = 0.0, p[12], w[4];
    uint32_t v[4];
    for (size_t k = 0; k < s->pairs.count; k++) {
        sum += barrier(pair_at(x, &s->pairs.pair[k], p, w), s->near_m);
    }
    for (int b = 0; b < s->body_count; b++) {
        for (size_t k = 0; k < s->n + s->edge_count; k++) {
            sum += barrier(tsuya_drape_body_distance(&s->body[b], probe(s, x, k, v, w), NULL), s->near_m);
        }
    }
    return s->stiffness_n_m * sum;
}

static tsuya_status add_touch(drape_touches *l, drape_touch touch)
{
    if (l->count == l->room) {
        size_t room = 2 * l->room + 1024;
        drape_touch *t = tsuya_realloc(l->touch, room, sizeof *t);
        if (!t) {
            return TSUYA_ERROR_MEMORY;
        }
        l->touch = t;
        l->room = room;
    }
    l->touch[l->count++] = touch;
    return TSUYA_OK;
}

tsuya_status tsuya_drape_find_touches(drape_touches *touches, const drape_state *s, const double *x)
{
    touches->count = 0;
    for (size_t k = 0; k < s->pairs.count; k++) {
        drape_touch t = {.normal = {0, 0, 0}};
        double p[12];
        t.distance_m = pair_at(x, &s->pairs.pair[k], p, t.w);
        if (t.distance_m < s->near_m && t.distance_m > 0.0) {
            memcpy(t.v, s->pairs.pair[k].v, sizeof t.v);
            for (int i = 0; i < 4; i++) {
                t.normal = tsuya_vec3_mad(t.normal, t.w[i] / t.distance_m, drape_at(x, t.v[i]));
            }
            TSUYA_TRY(add_touch(touches, t));
        }
    }
    for (int b = 0; b < s->body_count; b++) {
        for (size_t k = 0; k < s->n + s->edge_count; k++) {
            drape_touch t;
            t.distance_m = tsuya_drape_body_distance(&s->body[b], probe(s, x, k, t.v, t.w), &t.normal);
            if (t.distance_m < s->near_m) {
                TSUYA_TRY(add_touch(touches, t));
            }
        }
    }
    for (size_t k = 0; k < touches->count; k++) {
        touches->touch[k].force_n = -s->fabric->friction * s->stiffness_n_m * tsuya_drape_barrier_slope(touches->touch[k].distance_m, s->near_m);
    }
    return TSUYA_OK;
}

void tsuya_drape_contact_gradient(const drape_state *s, double *g)
{
    for (size_t k = 0; k < s->touches.count; k++) {
        const drape_touch *t = &s->touches.touch[k];
        for (int i = 0; i < 4; i++) {
            drape_add(g, t->v[i], t->w[i] * s->stiffness_n_m * tsuya_drape_barrier_slope(t->distance_m, s->near_m), t->normal);
        }
    }
}

/* How far a pair has slid since the step began. */
static tsuya_vec3 slid(const drape_state *s, const double *x, const drape_touch *t)
{
    tsuya_vec3 u = {0, 0, 0};
    for (int i = 0; i < 4; i++) {
        u = tsuya_vec3_mad(u, t->w[i], tsuya_vec3_sub(drape_at(x, t->v[i]), drape_at(s->x_step, t->v[i])));
    }
    return tsuya_vec3_mad(u, -tsuya_vec3_dot(u, t->normal), t->normal);
}

/* Derivative of friction's potential by the distance slid, over that distance. */
static double grip(double y) { return y < SLIDE_M ? (2.0 - y / SLIDE_M) / SLIDE_M : 1.0 / y; }

double tsuya_drape_friction_energy(const drape_state *s, const double *x)
{
    double sum = 0.0;
    for (size_t k = 0; k < s->friction.count; k++) {
        double y = tsuya_vec3_norm(slid(s, x, &s->friction.touch[k]));
        sum += s->friction.touch[k].force_n * (y < SLIDE_M ? y * y / SLIDE_M * (1.0 - y / (3.0 * SLIDE_M)) : y - SLIDE_M / 3.0);
    }
    return sum;
}

void tsuya_drape_friction_gradient(const drape_state *s, const double *x, double *g)
{
    for (size_t k = 0; k < s->friction.count; k++) {
        const drape_touch *t = &s->friction.touch[k];
        tsuya_vec3 u = slid(s, x, t);
        for (int i = 0; i < 4; i++) {
            drape_add(g, t->v[i], t->w[i] * t->force_n * grip(tsuya_vec3_norm(u)), u);
        }
    }
}

/* w wᵀ ⊗ (along · n nᵀ + across · (1 − n nᵀ)) */
static void add_outer(drape_matrix *m, const drape_touch *t, double along, double across)
{
    const double *n = &t->normal.x;
    for (int i = 0; i < 4; i++) {
        for (int j = 0; j <= i; j++) {
            double w = t->w[i] * t->w[j] * (i != j && t->v[i] == t->v[j] ? 2.0 : 1.0), block[3][3];
            for (int p = 0; w != 0.0 && p < 3; p++) {
                for (int q = 0; q < 3; q++) {
                    block[p][q] = w * ((along - across) * n[p] * n[q] + (p == q ? across : 0.0));
                }
            }
            if (w != 0.0) {
                tsuya_drape_matrix_add(m, t->v[i], t->v[j], block);
            }
        }
    }
}

tsuya_status tsuya_drape_contact_hessian(drape_state *s, const double *x)
{
    TSUYA_TRY(tsuya_drape_matrix_reserve(&s->matrix, 90 * (s->touches.count + s->friction.count)));
    for (size_t k = 0; k < s->touches.count; k++) {
        add_outer(&s->matrix, &s->touches.touch[k], s->stiffness_n_m * barrier_curvature(s->touches.touch[k].distance_m, s->near_m), 0.0);
    }
    for (size_t k = 0; k < s->friction.count; k++) {
        const drape_touch *t = &s->friction.touch[k];
        add_outer(&s->matrix, t, 0.0, t->force_n * grip(tsuya_vec3_norm(slid(s, x, t))));
    }
    return TSUYA_OK;
}

/* Share of the way that a pair can go before its distance falls to LEAST_GAP of what it was. */
static double time_of_impact(const drape_state *s, const drape_pair *pair)
{
    double p[12], q[12], w[4], mean[3] = {0, 0, 0}, most[4];
    double d = pair_at(s->x, pair, p, w), gap = LEAST_GAP * d, t = 0.0;
    for (int k = 0; k < 12; k++) {
        q[k] = s->limit[pair->v[k / 3]] * s->step[3 * pair->v[k / 3] + (uint32_t)(k % 3)];
        mean[k % 3] += 0.25 * q[k];
    }
    for (int k = 0; k < 4; k++) {
        for (int i = 0; i < 3; i++) {
            q[3 * k + i] -= mean[i];
        }
        most[k] = sqrt(q[3 * k] * q[3 * k] + q[3 * k + 1] * q[3 * k + 1] + q[3 * k + 2] * q[3 * k + 2]);
    }
    double speed = pair->is_edges ? fmax(most[0], most[1]) + fmax(most[2], most[3]) : most[0] + fmax(most[1], fmax(most[2], most[3]));
    for (int i = 0; i < 1000 && d > gap; i++) {
        double dt = fmax(d - gap, 0.02 * gap) * 0.95 / fmax(speed, 1e-300);
        if (t + dt >= 1.0) {
            return 1.0;
        }
        for (int k = 0; k < 12; k++) {
            p[k] += dt * q[k];
        }
        d = tsuya_drape_pair_distance(p, pair->is_edges, w);
        if (d <= gap * 1.05) {
            return t;
        }
        t += dt;
    }
    return t;
}

static void limit_by_bodies(drape_state *s)
{
    for (int b = 0; b < s->body_count; b++) {
        for (size_t k = 0; k < s->n + s->edge_count; k++) {
            uint32_t v[4];
            double w[4], t = 0.0;
            tsuya_vec3 p = probe(s, s->x, k, v, w), q = tsuya_vec3_sub(probe(s, s->trial, k, v, w), p);
            double d = tsuya_drape_body_distance(&s->body[b], p, NULL), gap = LEAST_GAP * d, speed = tsuya_vec3_norm(q);
            for (int i = 0; i < 100 && t < 1.0 && d > 1.05 * gap; i++) {
                t += 0.95 * (d - gap) / fmax(speed, 1e-300);
                d = t < 1.0 ? tsuya_drape_body_distance(&s->body[b], tsuya_vec3_mad(p, t, q), NULL) : d;
            }
            if (t < 1.0) {
                s->limit[v[0]] = fmin(s->limit[v[0]], fmax(0.9 * t, 0.0));
                s->limit[v[1]] = fmin(s->limit[v[1]], fmax(0.9 * t, 0.0));
            }
        }
    }
}

static tsuya_status room_for_times(drape_state *s)
{
    if (s->toi_room < s->pairs.count) {
        double *toi = tsuya_realloc(s->toi, s->pairs.count, sizeof *toi);
        if (!toi) {
            return TSUYA_ERROR_MEMORY;
        }
        s->toi = toi;
        s->toi_room = s->pairs.count;
    }
    return TSUYA_OK;
}

/* Cuts each vertex' way until no pair collides; where cutting goes on, all are cut alike. */
tsuya_status tsuya_drape_limit_step(drape_state *s)
{
    enum { PASSES = 12 };
    double *cut = s->trial; /* free here */
    TSUYA_TRY(room_for_times(s));
    limit_by_bodies(s);
    for (int pass = 0; pass < PASSES; pass++) {
        double least = 1.0;
#pragma omp parallel for num_threads(s->context->threads)
        for (size_t k = 0; k < s->pairs.count; k++) {
            s->toi[k] = time_of_impact(s, &s->pairs.pair[k]);
        }
        for (size_t v = 0; v < s->n; v++) {
            cut[v] = 1.0;
        }
        for (size_t k = 0; k < s->pairs.count; k++) {
            least = fmin(least, s->toi[k]);
            for (int i = 0; i < 4; i++) {
                cut[s->pairs.pair[k].v[i]] = fmin(cut[s->pairs.pair[k].v[i]], s->toi[k]);
            }
        }
        for (size_t v = 0; v < s->n && least < 1.0; v++) {
            s->limit[v] *= pass + 1 == PASSES ? 0.9 * least : cut[v] < 1.0 ? 0.9 * cut[v] : 1.0;
        }
        if (least >= 1.0) {
            break;
        }
    }
    return TSUYA_OK;
}
