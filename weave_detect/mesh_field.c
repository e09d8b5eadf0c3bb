#include "weave_detect/mesh_field.h"

#include "core/memory.h"
#include "weave_detect/census.h"
#include "weave_detect/evidence.h"
#include "weave_detect/field_figures.h"
#include "weave_detect/smooth.h"
#include "weave_detect/spanning.h"
#include "weave_detect/weft_hints.h"

#include <string.h>

/* Smoothing length of full evidence, in patch spacings; texture holds a tenth as strongly as threads. */
static const double LENGTH = 0.35, FLOW_PULL = 0.1;
/* Rounds in which the crosses are smoothed, first over a few patches, so that a patch that went wrong among right ones is outvoted, then closely:
 * evidence that is farther than ASTRAY from the field loses its hold, edges over which the field turns faster than SEAM let go. */
enum { ROUNDS = 4 };
static const double REACH[ROUNDS] = {3.0, 3.0, 1.0, 1.0};
static const double ASTRAY_RAD = 12.0 * M_PI / 180.0, SEAM_RAD = 30.0 * M_PI / 180.0 /* per patch spacing */, SEAM_LENGTH = 0.2;
static const double SEEN_FRACTION = 0.01; /* of the area with threads: below it the surface shows none */
static const float SEEN_CONFIDENCE = 0.2f; /* from which a vertex's own threads are counted */

tsuya_weave_mesh_options tsuya_weave_mesh_options_default(void)
{
    return (tsuya_weave_mesh_options){.patch_px = 64, .step_px = 32};
}

typedef struct field {
    tsuya_mesh *mesh;
    const tsuya_weave_mesh_options *options;
    const tsuya_context *context;
    tsuya_votes votes;
    tsuya_mesh_graph graph;
    tsuya_evidence *evidence;
    tsuya_complex *z, *target;
    double *pull;
    float *keep;       /* of the evidence, [0, 1]: less where it is astray */
    float *edge_scale; /* one a graph entry, [0, 1]: less over seams */
    uint8_t *choice;
    uint32_t *root;
    tsuya_choice_edge *edge;
    size_t edge_count;
    float *weft_rad, *warp_rad;
    bool threads_seen;
    tsuya_weft_told weft_told;
} field;

static double area_scale(const field *f, size_t v)
{
    double length = LENGTH * f->votes.spacing;
    return (double)f->graph.area[v] / (length * length);
}

static void merge_all(field *f)
{
#pragma omp parallel for schedule(static) num_threads(f->context->threads)
    for (long long v = 0; v < (long long)f->mesh->vertex_count; v++) {
        tsuya_evidence_merge(&f->evidence[v], f->votes.vote + v * TSUYA_VOTES, f->votes.count[v]);
    }
    double seen = 0.0, all = 0.0;
    for (size_t v = 0; v < f->mesh->vertex_count; v++) {
        all += (double)f->graph.area[v];
        seen += f->evidence[v].confidence >= 0.5f ? (double)f->graph.area[v] : 0.0;
    }
    f->threads_seen = seen > SEEN_FRACTION * all;
}

static void set_target(field *f, size_t v, double angle_rad, int fold, double pull)
{
    f->target[v] = (tsuya_complex){cos(fold * angle_rad), sin(fold * angle_rad)};
    f->pull[v] = pull * area_scale(f, v);
}

static double cross_of(const tsuya_evidence *e)
{
    double a = 4.0 * (double)e->a_rad, b = 4.0 * (double)e->b_rad;
    return 0.25 * atan2(sin(a) + sin(b), cos(a) + cos(b));
}

/* Geman and McClure's weight. */
static double robust(double miss, double scale)
{
    double t = miss / scale;
    return 1.0 / ((1.0 + t * t) * (1.0 + t * t));
}

static double cross_difference(double a_rad, double b_rad) { return fabs(remainder(a_rad - b_rad, 0.5 * M_PI)); }

static void judge_evidence(field *f)
{
    for (size_t v = 0; v < f->mesh->vertex_count; v++) {
        double angle = 0.25 * atan2(f->z[v].im, f->z[v].re);
        f->keep[v] = (float)robust(cross_difference(cross_of(&f->evidence[v]), angle), ASTRAY_RAD);
    }
}

/* Edges over which the cross turns too fast.  What lies between vertices that know little is left to the smoothing. */
static void judge_edges(field *f)
{
#pragma omp parallel for schedule(static) num_threads(f->context->threads)
    for (long long v = 0; v < (long long)f->mesh->vertex_count; v++) {
        for (uint32_t e = f->graph.start[v]; e < f->graph.start[v + 1]; e++) {
            uint32_t u = f->graph.neighbour[e];
            double length = tsuya_vec3_norm(tsuya_vec3_sub(tsuya_mesh_position(f->mesh, u), tsuya_mesh_position(f->mesh, (size_t)v)));
            double there = 0.25 * atan2(f->z[u].im, f->z[u].re) + (double)f->graph.turn_rad[e], here = 0.25 * atan2(f->z[v].im, f->z[v].re);
            double known = fmin(hypot(f->z[u].re, f->z[u].im), hypot(f->z[v].re, f->z[v].im));
            double rate = cross_difference(there, here) * f->votes.spacing / fmax(length, 1e-12);
            f->edge_scale[e] = known > SEAM_LENGTH ? (float)fmax(robust(rate, SEAM_RAD), 1e-3) : 1.0f;
        }
    }
}

/* Four-fold: where the cross of threads stands. */
static tsuya_status solve_cross(field *f)
{
    memset(f->z, 0, f->mesh->vertex_count * sizeof *f->z);
    for (size_t v = 0; v < f->mesh->vertex_count; v++) {
        f->keep[v] = 1.0f;
    }
    for (int round = 0; round < ROUNDS; round++) {
        for (size_t v = 0; v < f->mesh->vertex_count; v++) {
            const tsuya_evidence *e = &f->evidence[v];
            set_target(f, v, cross_of(e), 4, (double)(e->weight * f->keep[v]) / (REACH[round] * REACH[round]));
        }
        TSUYA_TRY(tsuya_smooth_directions(f->z, f->target, f->pull, round > 0 ? f->edge_scale : NULL, 4, &f->graph, f->context));
        judge_evidence(f);
        judge_edges(f);
    }
    return TSUYA_OK;
}

static void set_angles(float *angle_rad, const tsuya_complex *z, int fold, size_t count)
{
    for (size_t v = 0; v < count; v++) {
        angle_rad[v] = (float)(atan2(z[v].im, z[v].re) / fold);
    }
}

/* The edges with, for each, whether the choices at its ends differ: an odd number of steps of π/2 (crosses) or of π (signs). */
static void list_edges(field *f, const float *angle_rad, double step_rad)
{
    f->edge_count = 0;
    for (uint32_t v = 0; v < f->mesh->vertex_count; v++) {
        for (uint32_t e = f->graph.start[v]; e < f->graph.start[v + 1]; e++) {
            uint32_t u = f->graph.neighbour[e];
            if (u > v) {
                double steps = ((double)angle_rad[u] + (double)f->graph.turn_rad[e] - (double)angle_rad[v]) / step_rad;
                double nearest = round(steps), miss = fabs(steps - nearest);
                double sure = fmin(hypot(f->z[u].re, f->z[u].im), hypot(f->z[v].re, f->z[v].im));
                bool odd = fabs(fmod(nearest, 2.0)) > 0.5;
                f->edge[f->edge_count++] = (tsuya_choice_edge){v, u, (float)(sure * (1.0 - 2.0 * miss)), odd};
            }
        }
    }
}

/* Of the two lines of the evidence, the one nearer to `angle`: 0 a, 1 b. */
static int nearer_family(const tsuya_evidence *e, double angle_rad)
{
    return tsuya_line_difference((double)e->b_rad, angle_rad) < tsuya_line_difference((double)e->a_rad, angle_rad);
}

static double angle_of(const field *f, size_t v, tsuya_vec3 direction, double *length)
{
    const float *n = f->mesh->normal + 3 * v;
    tsuya_vec3 first, second;
    tsuya_tangent_basis(&first, &second, (tsuya_vec3){(double)n[0], (double)n[1], (double)n[2]});
    double x = tsuya_vec3_dot(direction, first), y = tsuya_vec3_dot(direction, second);
    *length = hypot(x, y);
    return atan2(y, x);
}

/* What speaks for the first axis of a vertex's cross (or, `turned`, for the second) being the weft. */
static void add_hints(tsuya_weft_hints *h, const field *f, size_t v, bool turned)
{
    const tsuya_evidence *e = &f->evidence[v];
    double angle = (double)f->weft_rad[v] + (turned ? 0.5 * M_PI : 0.0), length, weight = (double)e->weight * (double)f->graph.area[v];
    if (f->options->has_weft) {
        double wanted = angle_of(f, v, f->options->weft, &length);
        h->user += weight * length * cos(2.0 * (wanted - angle));
    }
    int coarser = tsuya_coarser_family((double)e->period_a, (double)e->period_b);
    h->count += weight * (nearer_family(e, angle) ? -coarser : coarser);
    h->count_weight += weight;
    tsuya_vec3 along;
    if (tsuya_rim_direction(&along, f->mesh, &f->graph, v)) {
        double rim = angle_of(f, v, along, &length);
        h->rim += weight * tsuya_rim_hint(angle - rim, tsuya_vec3_dot(along, f->votes.up));
        h->rim_weight += weight;
    }
    double upright = angle_of(f, v, f->votes.up, &length);
    h->level -= weight * length * cos(2.0 * (upright - angle));
}

/* Labels: every vertex's weft axis out of its cross, the same family all over a connected piece. */
static tsuya_status label(field *f)
{
    size_t n = f->mesh->vertex_count;
    tsuya_status status = TSUYA_OK;
    tsuya_weft_hints *hints = NULL;
    set_angles(f->weft_rad, f->z, 4, n);
    list_edges(f, f->weft_rad, 0.5 * M_PI);
    TSUYA_GOTO_DONE(status, tsuya_spanning_choices(f->choice, f->root, f->edge, f->edge_count, n));
    TSUYA_NEW(status, hints, n);
    double most = 0.0;
    for (size_t v = 0; v < n; v++) {
        hints[f->root[v]].has_user = f->options->has_weft;
        add_hints(&hints[f->root[v]], f, v, f->choice[v]);
    }
    for (size_t v = 0; v < n; v++) {
        tsuya_weft_told told;
        const tsuya_weft_hints *h = &hints[f->root[v]];
        bool turned = f->choice[v] ^ tsuya_weft_decide(&told, h);
        f->weft_rad[v] += turned ? (float)(0.5 * M_PI) : 0.0f;
        f->warp_rad[v] = f->weft_rad[v] + (float)(0.5 * M_PI);
        f->weft_told = h->count_weight > most ? told : f->weft_told;
        most = fmax(most, h->count_weight);
    }
done:
    tsuya_free(hints);
    return status;
}

/* What one family is smoothed with; the weft's is the field's own. */
typedef struct family {
    float *angle_rad;
    tsuya_complex *z, *target;
    double *pull;
} family;

/* Smooths one family as a field of lines about its labels. */
static tsuya_status solve_family(const field *f, const family *own)
{
    for (size_t v = 0; v < f->mesh->vertex_count; v++) {
        const tsuya_evidence *e = &f->evidence[v];
        double start = (double)own->angle_rad[v], line = (double)(nearer_family(e, start) ? e->b_rad : e->a_rad);
        own->target[v] = (tsuya_complex){cos(2.0 * line), sin(2.0 * line)};
        own->pull[v] = (double)(e->weight * f->keep[v]) * area_scale(f, v);
        own->z[v] = (tsuya_complex){cos(2.0 * start), sin(2.0 * start)};
    }
    TSUYA_TRY(tsuya_smooth_directions(own->z, own->target, own->pull, f->edge_scale, 2, &f->graph, f->context));
    set_angles(own->angle_rad, own->z, 2, f->mesh->vertex_count);
    return TSUYA_OK;
}

/* Each for itself, side by side. */
static tsuya_status solve_families(field *f)
{
    tsuya_status status = TSUYA_OK;
    tsuya_failure failure = {0};
    family both[2] = {{f->weft_rad, f->z, f->target, f->pull}, {.angle_rad = f->warp_rad}};
    TSUYA_NEW(status, both[1].z, f->mesh->vertex_count);
    TSUYA_NEW(status, both[1].target, f->mesh->vertex_count);
    TSUYA_NEW(status, both[1].pull, f->mesh->vertex_count);
#pragma omp parallel for schedule(static, 1) num_threads(f->context->threads < 2 ? 1 : 2)
    for (int k = 0; k < 2; k++) {
        tsuya_status own = solve_family(f, &both[k]);
        if (own != TSUYA_OK) {
#pragma omp critical(tsuya_weave_families)
            tsuya_failure_keep(&failure, (size_t)k, own);
        }
    }
    status = tsuya_failure_raise(&failure);
done:
    tsuya_free(both[1].z);
    tsuya_free(both[1].target);
    tsuya_free(both[1].pull);
    return status;
}

/* No threads anywhere: along the texture. */
static tsuya_status solve_flow(field *f)
{
    for (size_t v = 0; v < f->mesh->vertex_count; v++) {
        const tsuya_evidence *e = &f->evidence[v];
        set_target(f, v, (double)e->flow_rad, 2, FLOW_PULL * (double)e->flow_weight);
    }
    memset(f->z, 0, f->mesh->vertex_count * sizeof *f->z);
    TSUYA_TRY(tsuya_smooth_directions(f->z, f->target, f->pull, NULL, 2, &f->graph, f->context));
    set_angles(f->weft_rad, f->z, 2, f->mesh->vertex_count);
    for (size_t v = 0; v < f->mesh->vertex_count; v++) {
        f->warp_rad[v] = f->weft_rad[v] + (float)(0.5 * M_PI);
    }
    return TSUYA_OK;
}

static tsuya_status set_signs(field *f)
{
    size_t n = f->mesh->vertex_count;
    list_edges(f, f->weft_rad, M_PI);
    TSUYA_TRY(tsuya_spanning_choices(f->choice, f->root, f->edge, f->edge_count, n));
    for (size_t v = 0; v < n; v++) {
        f->weft_rad[v] += f->choice[v] ? (float)M_PI : 0.0f;
    }
    return TSUYA_OK;
}

/* The vertex's shear, and its threads where they were seen. */
static void write_cloth(field *f, size_t v)
{
    const tsuya_evidence *e = &f->evidence[v];
    bool b = nearer_family(e, (double)f->weft_rad[v]);
    double between = tsuya_line_wrap((double)f->warp_rad[v] - (double)f->weft_rad[v]);
    f->mesh->shear_deg[v] = f->threads_seen ? (float)tsuya_deg_from_rad(between - 0.5 * M_PI) : 0.0f;
    if (f->threads_seen && f->mesh->weave_confidence[v] > SEEN_CONFIDENCE) {
        f->mesh->threads_per_m[2 * v] = 1.0f / (b ? e->period_b : e->period_a);
        f->mesh->threads_per_m[2 * v + 1] = 1.0f / (b ? e->period_a : e->period_b);
    }
}

/* Angles to vectors, and the confidence: that of the evidence, less where the smoothed field left it. */
static void write_field(field *f)
{
    for (size_t v = 0; v < f->mesh->vertex_count; v++) {
        const tsuya_evidence *e = &f->evidence[v];
        const float *n = f->mesh->normal + 3 * v;
        double angle = (double)f->weft_rad[v];
        tsuya_vec3 first, second;
        tsuya_tangent_basis(&first, &second, (tsuya_vec3){(double)n[0], (double)n[1], (double)n[2]});
        tsuya_vec3 weft = tsuya_vec3_unit(tsuya_vec3_mad(tsuya_vec3_scale(first, cos(angle)), sin(angle), second));
        f->mesh->weft[3 * v] = (float)weft.x;
        f->mesh->weft[3 * v + 1] = (float)weft.y;
        f->mesh->weft[3 * v + 2] = (float)weft.z;
        double own = (double)(nearer_family(e, angle) ? e->b_rad : e->a_rad), left = tsuya_line_difference(own, angle);
        double agree = exp(-0.5 * (left / 0.05) * (left / 0.05));
        f->mesh->weave_confidence[v] = f->threads_seen ? (float)((double)e->confidence * agree) : 0.1f * e->confidence;
        write_cloth(f, v);
    }
}

static tsuya_status allocate(field *f)
{
    tsuya_status status = TSUYA_OK;
    size_t n = f->mesh->vertex_count;
    TSUYA_NEW(status, f->evidence, n);
    TSUYA_NEW(status, f->z, n);
    TSUYA_NEW(status, f->target, n);
    TSUYA_NEW(status, f->pull, n);
    TSUYA_NEW(status, f->keep, n);
    TSUYA_NEW(status, f->edge_scale, n > 0 ? f->graph.start[n] : 0);
    TSUYA_NEW(status, f->choice, n);
    TSUYA_NEW(status, f->root, n);
    TSUYA_NEW(status, f->weft_rad, n);
    TSUYA_NEW(status, f->warp_rad, n);
    TSUYA_NEW(status, f->edge, n > 0 ? f->graph.start[n] / 2 + 1 : 1);
done:
    return status;
}

static void free_field(field *f)
{
    tsuya_votes_free(&f->votes);
    tsuya_mesh_graph_free(&f->graph);
    tsuya_free(f->evidence);
    tsuya_free(f->z);
    tsuya_free(f->target);
    tsuya_free(f->pull);
    tsuya_free(f->keep);
    tsuya_free(f->edge_scale);
    tsuya_free(f->choice);
    tsuya_free(f->root);
    tsuya_free(f->weft_rad);
    tsuya_free(f->warp_rad);
    tsuya_free(f->edge);
}

static tsuya_status solve(field *f)
{
    if (!f->threads_seen) {
        TSUYA_TRY(solve_flow(f));
        return set_signs(f);
    }
    TSUYA_TRY(solve_cross(f));
    TSUYA_TRY(label(f));
    TSUYA_TRY(solve_families(f));
    return set_signs(f);
}

tsuya_status tsuya_weave_mesh(tsuya_mesh *mesh, tsuya_weave_mesh_info *info, const tsuya_weave_mesh_options *options,
                              const tsuya_context *context)
{
    field f = {.mesh = mesh, .options = options, .context = context};
    double begin = tsuya_clock_s();
    tsuya_status status = TSUYA_OK;
    if (!mesh->normal) {
        TSUYA_TRY(tsuya_mesh_compute_normals(mesh));
    }
    TSUYA_TRY(tsuya_mesh_add_arrays(mesh, TSUYA_MESH_WEFT | TSUYA_MESH_CONFIDENCE | TSUYA_MESH_SHEAR | TSUYA_MESH_THREADS));
    TSUYA_GOTO_DONE(status, tsuya_mesh_graph_create(&f.graph, mesh));
    TSUYA_GOTO_DONE(status, allocate(&f));
    TSUYA_GOTO_DONE(status, tsuya_votes_gather(&f.votes, mesh, options, context));
    TSUYA_GOTO_DONE(status, tsuya_census_apply(&f.votes, f.graph.area));
    merge_all(&f);
    TSUYA_GOTO_DONE(status, solve(&f));
    write_field(&f);
    tsuya_field_view view = {mesh, &f.graph, &f.votes, f.evidence, f.weft_rad, f.edge_scale, f.threads_seen, f.weft_told};
    TSUYA_GOTO_DONE(status, tsuya_field_figures(info, &view));
    info->seconds = tsuya_clock_s() - begin;
done:
    free_field(&f);
    return status;
}
