#include "render/detail.h"

#include "core/memory.h"

#include "render/embree_adapter.h"
#include "render/meshopt_adapter.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { PATCH_TRIANGLES = 4096, TRIES = 4 };
/* Of what a vertex may be off by, the part that a try asks of the simplification: its error is a mean, the bound is not. */
static const double part_of_try[TRIES] = {0.5, 0.5, 0.25, 0.1};
/* Edges longer than this are not worth leaving out. */
static const double longest_edge_px = 0.5;

tsuya_detail_options tsuya_detail_options_default(void) { return (tsuya_detail_options){0.1, 1.0, 1.0, 3.0}; }

/* Triangles that lie together. */
typedef struct patch {
    size_t first, count;  /* in the order of `order` */
    double pixel;         /* the smallest size of a pixel on it */
    uint32_t *coarse;     /* what it is now, 3 × coarse_count; NULL: its own triangles */
    size_t coarse_count;
    bool wanted;          /* small enough to be simplified */
} patch;

typedef struct placed { uint32_t code, triangle; } placed;

typedef struct work {
    const tsuya_mesh *mesh;
    const tsuya_detail_options *options;
    const tsuya_context *context;
    placed *order;
    patch *patch;
    size_t patch_count;
    uint8_t *kept; /* vertices that were off once: their triangles stay */
} work;

/* --- patches --- */

static uint32_t spread_bits(uint32_t x)
{
    x = (x | x << 16) & 0x030000ffu;
    x = (x | x << 8) & 0x0300f00fu;
    x = (x | x << 4) & 0x030c30c3u;
    return (x | x << 2) & 0x09249249u;
}

static tsuya_vec3 centroid(const tsuya_mesh *m, size_t t)
{
    const uint32_t *v = m->triangle + 3 * t;
    tsuya_vec3 sum = tsuya_vec3_add(tsuya_vec3_add(tsuya_mesh_position(m, v[0]), tsuya_mesh_position(m, v[1])), tsuya_mesh_position(m, v[2]));
    return tsuya_vec3_scale(sum, 1.0 / 3.0);
}

static int compare_places(const void *a, const void *b)
{
    const placed *x = a, *y = b;
    return x->code != y->code ? (x->code > y->code) - (x->code < y->code) : (x->triangle > y->triangle) - (x->triangle < y->triangle);
}

/* Along Morton's curve. */
static void order_triangles(placed *order, const tsuya_mesh *m)
{
    tsuya_vec3 low, high;
    tsuya_mesh_bounds(m, &low, &high);
    double side = fmax(fmax(high.x - low.x, high.y - low.y), fmax(high.z - low.z, 1e-30));
    for (size_t t = 0; t < m->triangle_count; ++t) {
        tsuya_vec3 c = tsuya_vec3_scale(tsuya_vec3_sub(centroid(m, t), low), 1023.0 / side);
        order[t] = (placed){spread_bits((uint32_t)c.x) | spread_bits((uint32_t)c.y) << 1 | spread_bits((uint32_t)c.z) << 2, (uint32_t)t};
    }
    qsort(order, m->triangle_count, sizeof *order, compare_places);
}

static const uint32_t *corners(const work *w, size_t place) { return w->mesh->triangle + 3 * (size_t)w->order[place].triangle; }

/* The smallest pixel on a patch, and whether its edges are shorter than it is worth. */
static void look_at_patch(patch *p, const work *w, const tsuya_detail_view *view, int view_count)
{
    tsuya_vec3 low = {INFINITY, INFINITY, INFINITY}, high = {-INFINITY, -INFINITY, -INFINITY};
    double edges = 0.0;
    for (size_t t = p->first; t < p->first + p->count; ++t) {
        for (int c = 0; c < 3; ++c) {
            tsuya_vec3 a = tsuya_mesh_position(w->mesh, corners(w, t)[c]), b = tsuya_mesh_position(w->mesh, corners(w, t)[(c + 1) % 3]);
            edges += tsuya_vec3_norm(tsuya_vec3_sub(b, a));
            low = (tsuya_vec3){fmin(low.x, a.x), fmin(low.y, a.y), fmin(low.z, a.z)};
            high = (tsuya_vec3){fmax(high.x, a.x), fmax(high.y, a.y), fmax(high.z, a.z)};
        }
    }
    p->pixel = INFINITY;
    for (int k = 0; k < view_count; ++k) {
        tsuya_vec3 e = view[k].eye;
        tsuya_vec3 out = {fmax(0.0, fmax(low.x - e.x, e.x - high.x)), fmax(0.0, fmax(low.y - e.y, e.y - high.y)), fmax(0.0, fmax(low.z - e.z, e.z - high.z))};
        p->pixel = fmin(p->pixel, view[k].pixel_rad * tsuya_vec3_norm(out));
    }
    p->wanted = edges / (3.0 * (double)p->count) < longest_edge_px * p->pixel && isfinite(p->pixel);
}

static tsuya_status cut_into_patches(work *w, const tsuya_detail_view *view, int view_count)
{
    tsuya_status status = TSUYA_OK;
    size_t triangles = w->mesh->triangle_count;
    w->patch_count = (triangles + PATCH_TRIANGLES - 1) / PATCH_TRIANGLES;
    TSUYA_NEW(status, w->order, triangles);
    TSUYA_NEW(status, w->patch, w->patch_count);
    TSUYA_NEW(status, w->kept, w->mesh->vertex_count);
    order_triangles(w->order, w->mesh);
    for (size_t k = 0; k < w->patch_count; ++k) {
        patch *p = &w->patch[k];
        p->first = k * PATCH_TRIANGLES;
        p->count = triangles - p->first < PATCH_TRIANGLES ? triangles - p->first : PATCH_TRIANGLES;
        look_at_patch(p, w, view, view_count);
    }
done:
    return status;
}

/* --- one patch made simpler --- */

/* Room for one patch, and for numbers of its own for its vertices (0: not in it). */
typedef struct bench {
    uint32_t vertex[3 * PATCH_TRIANGLES], index[3 * PATCH_TRIANGLES], coarse[3 * PATCH_TRIANGLES];
    float position[9 * PATCH_TRIANGLES];
    bool left[3 * PATCH_TRIANGLES];
    size_t vertices;
    uint32_t number[];
} bench;

static bench *bench_create(const work *w) { return tsuya_calloc(1, sizeof(bench) + w->mesh->vertex_count * sizeof(uint32_t)); }

/* Numbers the patch's vertices. */
static void enter(bench *b, const work *w, const patch *p)
{
    for (size_t k = 0; k < b->vertices; ++k) {
        b->number[b->vertex[k]] = 0;
    }
    b->vertices = 0;
    for (size_t k = 0; k < 3 * p->count; ++k) {
        uint32_t v = corners(w, p->first + k / 3)[k % 3];
        if (b->number[v] == 0) {
            b->vertex[b->vertices++] = v;
            b->number[v] = (uint32_t)b->vertices;
        }
    }
}

static bool stays(const work *w, const uint32_t v[3]) { return w->kept[v[0]] || w->kept[v[1]] || w->kept[v[2]]; }

/* The triangles that may change, in the patch's own numbers; returns 3 × their number. */
static size_t list_free(bench *b, const work *w, const patch *p)
{
    size_t count = 0;
    for (size_t t = 0; t < p->count; ++t) {
        const uint32_t *v = corners(w, p->first + t);
        for (int c = 0; c < 3 && !stays(w, v); ++c) {
            b->index[count++] = b->number[v[c]] - 1;
        }
    }
    return count;
}

static tsuya_status simplify_patch(patch *p, const work *w, bench *b, double error)
{
    enter(b, w, p);
    for (size_t k = 0; k < b->vertices; ++k) {
        memcpy(b->position + 3 * k, w->mesh->position + 3 * (size_t)b->vertex[k], 3 * sizeof *b->position);
    }
    size_t free_count = list_free(b, w, p), left = tsuya_simplify_patch(b->coarse, b->index, free_count, b->position, b->vertices, error);
    tsuya_free(p->coarse);
    p->coarse = tsuya_calloc(left + 3 * p->count - free_count + 1, sizeof *p->coarse);
    if (!p->coarse) {
        return TSUYA_ERROR_MEMORY;
    }
    for (size_t k = 0; k < left; ++k) {
        p->coarse[k] = b->vertex[b->coarse[k]];
    }
    p->coarse_count = left / 3;
    for (size_t t = 0; t < p->count; ++t) {
        const uint32_t *v = corners(w, p->first + t);
        if (stays(w, v)) {
            memcpy(p->coarse + 3 * p->coarse_count++, v, 3 * sizeof *v);
        }
    }
    return TSUYA_OK;
}

/* Every patch that is still wanted. */
static tsuya_status simplify(work *w, int attempt)
{
    tsuya_failure failure = {0};
#pragma omp parallel num_threads(w->context->threads)
    {
        bench *b = bench_create(w);
#pragma omp for schedule(dynamic, 1)
        for (size_t k = 0; k < w->patch_count; ++k) {
            patch *p = &w->patch[k];
            tsuya_status one = !p->wanted ? TSUYA_OK : !b ? TSUYA_ERROR_MEMORY
                               : simplify_patch(p, w, b, part_of_try[attempt] * w->options->distance_px * p->pixel);
            if (one != TSUYA_OK) {
#pragma omp critical(tsuya_detail)
                tsuya_failure_keep(&failure, k, one);
            }
        }
        tsuya_free(b);
    }
    return tsuya_failure_raise(&failure);
}

/* --- the simplified mesh, held against every vertex --- */

static tsuya_status gather(tsuya_mesh *coarse, const work *w)
{
    size_t count = 0;
    for (size_t k = 0; k < w->patch_count; ++k) {
        count += w->patch[k].coarse ? w->patch[k].coarse_count : w->patch[k].count;
    }
    *coarse = *w->mesh; /* the vertices are the mesh's own */
    coarse->triangle_count = 0;
    coarse->triangle = tsuya_calloc(3 * count + 1, sizeof *coarse->triangle);
    if (!coarse->triangle) {
        return TSUYA_ERROR_MEMORY;
    }
    for (size_t k = 0; k < w->patch_count; ++k) {
        const patch *p = &w->patch[k];
        for (size_t t = 0; !p->coarse && t < p->count; ++t) {
            memcpy(coarse->triangle + 3 * coarse->triangle_count++, corners(w, p->first + t), 3 * sizeof *coarse->triangle);
        }
        if (p->coarse) {
            memcpy(coarse->triangle + 3 * coarse->triangle_count, p->coarse, 3 * p->coarse_count * sizeof *p->coarse);
            coarse->triangle_count += p->coarse_count;
        }
    }
    return TSUYA_OK;
}

/* How far a vertex is off. */
typedef struct offence { double distance, normal_deg, weft_deg, color; bool strange; } offence;

static tsuya_vec3 vector_at(const float *array, uint32_t v) { return (tsuya_vec3){array[3 * (size_t)v], array[3 * (size_t)v + 1], array[3 * (size_t)v + 2]}; }

/* Interpolated over a triangle, corners turned to the side of `like`. */
static tsuya_vec3 interpolate(const float *array, const uint32_t *v, const double b[3], tsuya_vec3 like)
{
    tsuya_vec3 sum = {0, 0, 0};
    for (int k = 0; k < 3; ++k) {
        tsuya_vec3 x = vector_at(array, v[k]);
        sum = tsuya_vec3_mad(sum, tsuya_vec3_dot(x, like) < 0.0 ? -b[k] : b[k], x);
    }
    return sum;
}

static double angle_deg(tsuya_vec3 a, tsuya_vec3 b)
{
    return tsuya_deg_from_rad(atan2(tsuya_vec3_norm(tsuya_vec3_cross(a, b)), fabs(tsuya_vec3_dot(a, b))));
}

/* The nearest place of the simplified surface along the vertex's normal, both ways. */
static bool find_place(tsuya_ray_hit *hit, const tsuya_ray_scene *rays, tsuya_vec3 at, tsuya_vec3 normal, double reach)
{
    bool found = false;
    for (int side = -1; side <= 1; side += 2) {
        tsuya_ray_hit here;
        const tsuya_ray ray = {{(float)at.x, (float)at.y, (float)at.z},
                               {(float)(side * normal.x), (float)(side * normal.y), (float)(side * normal.z)}, 0.0f, (float)reach};
        if (tsuya_ray_scene_intersect(rays, &ray, &here) && (!found || here.distance < hit->distance)) {
            *hit = here;
            found = true;
        }
    }
    return found;
}

static offence offence_of(const work *w, const tsuya_mesh *coarse, const tsuya_ray_scene *rays, uint32_t vertex, double reach)
{
    const tsuya_mesh *m = w->mesh;
    offence o = {0};
    tsuya_ray_hit hit = {0};
    tsuya_vec3 normal = vector_at(m->normal, vertex);
    if (!(fabs(tsuya_vec3_norm(normal) - 1.0) < 1e-3) || !find_place(&hit, rays, tsuya_mesh_position(m, vertex), normal, reach)) {
        o.strange = true;
        return o;
    }
    const uint32_t *v = coarse->triangle + 3 * (size_t)hit.triangle;
    const double b[3] = {1.0 - hit.u - hit.v, hit.u, hit.v};
    o.distance = hit.distance;
    o.normal_deg = angle_deg(interpolate(m->normal, v, b, normal), normal);
    if (m->weft) {
        tsuya_vec3 weft = vector_at(m->weft, vertex), there = interpolate(m->weft, v, b, weft);
        bool known = tsuya_vec3_norm(weft) > 0.5 && !(m->weave_confidence && !(m->weave_confidence[vertex] > 0.0f));
        o.weft_deg = known ? angle_deg(there, weft) : 0.0;
        for (int k = 0; k < 3; ++k) {
            o.strange |= known != (tsuya_vec3_norm(vector_at(m->weft, v[k])) > 0.5 && !(m->weave_confidence && !(m->weave_confidence[v[k]] > 0.0f)));
        }
    }
    for (size_t c = 0; m->color && c < 3; ++c) {
        double there = 0.0;
        for (int k = 0; k < 3; ++k) {
            there += b[k] * m->color[3 * (size_t)v[k] + c];
        }
        o.color = fmax(o.color, fabs(there - m->color[3 * (size_t)vertex + c]));
    }
    for (int k = 0; m->material && k < 3; ++k) {
        o.strange |= m->material[v[k]] != m->material[vertex];
    }
    return o;
}

static void take_larger(offence *a, offence b)
{
    a->distance = fmax(a->distance, b.distance);
    a->normal_deg = fmax(a->normal_deg, b.normal_deg);
    a->weft_deg = fmax(a->weft_deg, b.weft_deg);
    a->color = fmax(a->color, b.color);
    a->strange |= b.strange;
}

/* The largest of what the patch's vertices are off by, those apart that it still has; which of them are off by too much. */
static offence offence_of_patch(const patch *p, const work *w, bench *b, const tsuya_mesh *coarse, const tsuya_ray_scene *rays)
{
    offence worst = {0};
    double allowed = w->options->distance_px * p->pixel;
    enter(b, w, p);
    memset(b->left, 0, b->vertices * sizeof *b->left);
    for (size_t k = 0; k < 3 * p->coarse_count; ++k) {
        b->left[b->number[p->coarse[k]] - 1] = true;
    }
    for (size_t k = 0; k < b->vertices; ++k) {
        if (!b->left[k]) {
            offence o = offence_of(w, coarse, rays, b->vertex[k], allowed);
            o.strange |= o.normal_deg > w->options->normal_deg || o.weft_deg > w->options->weft_deg || o.color > w->options->color;
            w->kept[b->vertex[k]] = o.strange; /* no other patch has it: borders stay */
            take_larger(&worst, o);
        }
    }
    return worst;
}

/* Patches that hold stay as they are, and are `wanted` no more; `last`: the others get their triangles back.  Returns how many failed. */
static tsuya_status judge(work *w, offence *worst, bool last, size_t *failed)
{
    tsuya_mesh coarse = {0};
    tsuya_ray_scene *rays = NULL;
    tsuya_status status;
    tsuya_failure failure = {0};
    size_t bad = 0;
    TSUYA_GOTO_DONE(status, gather(&coarse, w));
    TSUYA_GOTO_DONE(status, tsuya_ray_scene_create(&rays, &coarse));
#pragma omp parallel num_threads(w->context->threads) reduction(+ : bad)
    {
        bench *b = bench_create(w);
#pragma omp for schedule(dynamic, 1)
        for (size_t k = 0; k < w->patch_count; ++k) {
            patch *p = &w->patch[k];
            if (p->wanted && !b) {
#pragma omp critical(tsuya_detail)
                tsuya_failure_keep(&failure, k, TSUYA_ERROR_MEMORY);
            } else if (p->wanted && p->coarse) {
                worst[k] = offence_of_patch(p, w, b, &coarse, rays);
                p->wanted = worst[k].strange;
                bad += p->wanted;
            }
        }
        tsuya_free(b);
    }
    TSUYA_GOTO_DONE(status, tsuya_failure_raise(&failure));
    for (size_t k = 0; k < w->patch_count; ++k) {
        if (w->patch[k].wanted && last) {
            tsuya_free(w->patch[k].coarse);
            w->patch[k].coarse = NULL;
            worst[k] = (offence){0};
        }
    }
    *failed = bad;
done:
    tsuya_ray_scene_free(rays);
    tsuya_free(coarse.triangle);
    return status;
}

static void fill_info(tsuya_detail_info *info, const work *w, const offence *worst)
{
    for (size_t k = 0; k < w->patch_count; ++k) {
        if (w->patch[k].coarse) {
            info->distance_px = fmax(info->distance_px, worst[k].distance / w->patch[k].pixel);
            info->normal_deg = fmax(info->normal_deg, worst[k].normal_deg);
            info->weft_deg = fmax(info->weft_deg, worst[k].weft_deg);
            info->color = fmax(info->color, worst[k].color);
        }
    }
}

/* A copy with the simplified triangles and the vertices that they need. */
static tsuya_status finish(tsuya_mesh *coarse, const work *w)
{
    tsuya_mesh borrowed = {0};
    uint8_t *keep = NULL;
    tsuya_status status = gather(&borrowed, w);
    TSUYA_GOTO_DONE(status, status);
    TSUYA_GOTO_DONE(status, tsuya_mesh_copy(coarse, &borrowed));
    TSUYA_NEW(status, keep, coarse->vertex_count);
    memset(keep, 1, coarse->vertex_count);
    TSUYA_GOTO_DONE(status, tsuya_mesh_filter(coarse, keep, true));
done:
    tsuya_free(borrowed.triangle);
    tsuya_free(keep);
    return status;
}

static bool any_wanted(const work *w)
{
    for (size_t k = 0; k < w->patch_count; ++k) {
        if (w->patch[k].wanted) {
            return true;
        }
    }
    return false;
}

tsuya_status tsuya_mesh_detail(tsuya_mesh *coarse, tsuya_detail_info *info, const tsuya_mesh *mesh, const tsuya_detail_view *view,
                               int view_count, const tsuya_detail_options *options, const tsuya_context *context)
{
    tsuya_status status = TSUYA_OK;
    work w = {.mesh = mesh, .options = options, .context = context};
    offence *worst = NULL;
    size_t failed = 1;
    *coarse = (tsuya_mesh){0};
    *info = (tsuya_detail_info){.triangles_before = mesh->triangle_count, .triangles_after = mesh->triangle_count};
    if (!(options->distance_px > 0.0) || mesh->triangle_count == 0 || !mesh->normal) {
        return TSUYA_OK;
    }
    TSUYA_GOTO_DONE(status, cut_into_patches(&w, view, view_count));
    if (!any_wanted(&w)) {
        goto done;
    }
    TSUYA_NEW(status, worst, w.patch_count);
    for (int attempt = 0; attempt < TRIES && failed > 0; ++attempt) {
        TSUYA_GOTO_DONE(status, simplify(&w, attempt));
        TSUYA_GOTO_DONE(status, judge(&w, worst, attempt == TRIES - 1, &failed));
    }
    TSUYA_GOTO_DONE(status, finish(coarse, &w));
    info->triangles_after = coarse->triangle_count;
    fill_info(info, &w, worst);
done:
    for (size_t k = 0; w.patch && k < w.patch_count; ++k) {
        tsuya_free(w.patch[k].coarse);
    }
    tsuya_free(w.patch);
    tsuya_free(w.order);
    tsuya_free(w.kept);
    tsuya_free(worst);
    if (status != TSUYA_OK) {
        tsuya_mesh_free(coarse);
    }
    return status;
}
