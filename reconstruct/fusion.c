#include "reconstruct/fusion.h"

#include "core/memory.h"
#include "core/order.h"
#include "reconstruct/fusion_views.h"
#include "reconstruct/precision.h"
#include "reconstruct/stereo_views.h"

#include <string.h>

enum { MOST_NEIGHBOURS = 12, BAND_ROWS = 64 };

tsuya_fusion_options tsuya_fusion_options_default(void)
{
    return (tsuya_fusion_options){
        .prior = true, .geometric = true, .min_views = 3, .neighbours = 10, .max_reprojection_px = 1.5, .max_depth_error = 0.01,
        .max_normal_deg = 25.0,
    };
}

typedef struct point_list {
    size_t count, capacity;
    struct fused_point { float position[3], normal[3], evidence, sigma; uint8_t color[3]; } *point;
} point_list;

typedef struct run {
    const tsuya_fusion_options *options;
    const tsuya_context *context;
    tsuya_sparse_model model;
    tsuya_view_plan *plan;
    tsuya_fusion_views *views;
    tsuya_arena *arena;
    uint8_t **used;  /* one bit a pixel of each view, NULL before it is first seen */
    int *used_width; /* of the maps, to notice maps that change size */
    point_list points;
    size_t points_prior;
    double *gsd;
    int gsd_count;
} run;

/* ---- one pixel ---- */

static bool bit_get(const uint8_t *bits, size_t at) { return bits[at >> 3] >> (at & 7) & 1; }
static void bit_set(uint8_t *bits, size_t at) { bits[at >> 3] |= (uint8_t)(1u << (at & 7)); }

static bool from_prior(const tsuya_fusion_view *v, size_t at) { return v->prior && v->prior[at]; }

static tsuya_vec3 pixel_ray(const tsuya_camera *c, double x, double y)
{
    return (tsuya_vec3){(x - c->cx_px) / c->fx_px, (y - c->cy_px) / c->fy_px, 1.0};
}

static tsuya_vec3 map_normal_world(const tsuya_fusion_view *v, size_t at)
{
    const size_t pixels = (size_t)v->map.width_px * (size_t)v->map.height_px;
    const float *n = v->map.normal + at;
    return tsuya_mat3_apply(v->world_from_camera.rotation, (tsuya_vec3){n[0], n[pixels], n[2 * pixels]});
}

static tsuya_vec3 map_point_world(const tsuya_fusion_view *v, size_t at)
{
    const size_t width = (size_t)v->map.width_px;
    tsuya_vec3 ray = pixel_ray(&v->camera, (double)(at % width), (double)(at / width));
    return tsuya_pose_apply(v->world_from_camera, tsuya_vec3_scale(ray, v->map.depth[at]));
}

/* The neighbour's pixel that agrees with a reference pixel's point, or −1. */
static ptrdiff_t agreeing_pixel(const tsuya_fusion_view *reference, size_t at, tsuya_vec3 point, tsuya_vec3 normal,
                                const tsuya_fusion_view *neighbour, const tsuya_fusion_options *o)
{
    tsuya_vec2 pixel, back;
    tsuya_vec3 seen = tsuya_pose_apply(neighbour->camera_from_world, point);
    if (!tsuya_camera_project(&neighbour->camera, seen, &pixel)) {
        return -1;
    }
    double x = floor(pixel.x + 0.5), y = floor(pixel.y + 0.5);
    if (!(x >= 0 && y >= 0 && x < neighbour->map.width_px && y < neighbour->map.height_px)) {
        return -1;
    }
    size_t there = (size_t)y * (size_t)neighbour->map.width_px + (size_t)x;
    double depth = neighbour->map.depth[there];
    if (!(depth > 0.0)) {
        return -1;
    }
    /* Along the projection's own ray: comparing at the pixel's centre would add half a pixel of slope. */
    tsuya_vec3 ray = pixel_ray(&neighbour->camera, pixel.x, pixel.y);
    tsuya_vec3 theirs = tsuya_pose_apply(neighbour->world_from_camera, tsuya_vec3_scale(ray, depth));
    tsuya_vec3 returned = tsuya_pose_apply(reference->camera_from_world, theirs);
    if (!tsuya_camera_project(&reference->camera, returned, &back)) {
        return -1;
    }
    const size_t width = (size_t)reference->map.width_px;
    double own = reference->map.depth[at];
    double off = hypot(back.x - (double)(at % width), back.y - (double)(at / width));
    bool same = off <= o->max_reprojection_px && fabs(returned.z - own) <= o->max_depth_error * own &&
                tsuya_vec3_dot(normal, map_normal_world(neighbour, there)) >= cos(tsuya_rad_from_deg(o->max_normal_deg));
    return same ? (ptrdiff_t)there : -1;
}

typedef struct vote_sum {
    double weight, depth, depth2; /* depths along the reference's ray, relative to its own */
    tsuya_vec3 normal, color;
    int count, measured;
    double sine; /* largest sine between two rays */
} vote_sum;

/* A view's vote: where its tangent plane cuts the reference's ray.  Steep and near views see sharper. */
static void add_vote(vote_sum *sum, tsuya_vec3 origin, tsuya_vec3 ray, double own, const tsuya_fusion_view *v, size_t at)
{
    tsuya_vec3 p = map_point_world(v, at), n = map_normal_world(v, at);
    tsuya_vec3 from = tsuya_vec3_sub(p, v->world_from_camera.translation);
    double facing = -tsuya_vec3_dot(n, from) / tsuya_vec3_norm(from), gsd = v->map.depth[at] / v->camera.fx_px;
    double along = tsuya_vec3_dot(n, ray), t = own;
    if (fabs(along) > 0.05 * tsuya_vec3_norm(ray)) {
        t = tsuya_vec3_dot(n, tsuya_vec3_sub(p, origin)) / along;
    }
    const double weight = fmax(facing, 0.05) / (gsd * gsd);
    const size_t width = (size_t)v->map.width_px;
    const uint8_t *c = tsuya_image_u8(&v->color, (int)(at % width), (int)(at / width));
    sum->weight += weight;
    sum->depth += weight * (t - own);
    sum->depth2 += weight * (t - own) * (t - own);
    sum->normal = tsuya_vec3_mad(sum->normal, weight, n);
    int g = v->color.channels >= 3 ? 1 : 0, b = v->color.channels >= 3 ? 2 : 0;
    sum->color = tsuya_vec3_mad(sum->color, weight, (tsuya_vec3){c[0], c[g], c[b]});
    sum->count++;
    sum->measured += !from_prior(v, at);
    double sine = tsuya_vec3_norm(tsuya_vec3_cross(tsuya_vec3_unit(from), tsuya_vec3_unit(ray)));
    sum->sine = sine > sum->sine ? sine : sum->sine;
}

/* Mean and its standard deviation.  The spread of a few votes says little, so it is held together with what matching to
 * a seventh of a pixel would give at this triangulation angle, as two more degrees of freedom (scaled inverse chi-square
 * prior).  The votes share photographs and windows: their errors are taken to correlate by 0.7, so that more of them
 * shrink sigma only so far.  Where the curved prior had to help, its own bound stands instead: no angle makes it better. */
static void settle(struct fused_point *out, const vote_sum *sum, tsuya_vec3 origin, tsuya_vec3 ray, double own, double gsd, bool helped)
{
    const double prior_freedom = 2.0, correlation = 0.7;
    double mean = sum->depth / sum->weight, spread2 = fmax(sum->depth2 / sum->weight - mean * mean, 0.0);
    double expected = helped ? gsd : tsuya_matching_sigma(gsd, sum->sine);
    double variance = (prior_freedom * expected * expected + sum->count * spread2) / (prior_freedom + sum->count - 1);
    tsuya_vec3 n = tsuya_vec3_unit(sum->normal), p = tsuya_vec3_mad(origin, own + mean, ray);
    double slant = fabs(tsuya_vec3_dot(n, ray));
    *out = (struct fused_point){
        .position = {(float)p.x, (float)p.y, (float)p.z},
        .normal = {(float)n.x, (float)n.y, (float)n.z},
        .evidence = (float)sum->measured,
        .sigma = (float)(sqrt(variance * (correlation + (1.0 - correlation) / sum->count)) * slant),
        .color = {(uint8_t)(sum->color.x / sum->weight + 0.5), (uint8_t)(sum->color.y / sum->weight + 0.5),
                  (uint8_t)(sum->color.z / sum->weight + 0.5)},
    };
}

/* ---- one reference ---- */

typedef struct reference_run {
    tsuya_fusion_view *view[1 + MOST_NEIGHBOURS]; /* the reference first */
    int count;
    int32_t *agreed; /* of the band: for each pixel and neighbour the agreeing pixel, or −1 */
} reference_run;

static tsuya_status points_grow(point_list *list)
{
    if (list->count < list->capacity) {
        return TSUYA_OK;
    }
    size_t capacity = list->capacity ? 2 * list->capacity : 65536;
    struct fused_point *grown = tsuya_realloc(list->point, capacity, sizeof *grown);
    if (!grown) {
        return TSUYA_ERROR_MEMORY;
    }
    list->point = grown;
    list->capacity = capacity;
    return TSUYA_OK;
}

/* Finds the agreements of a band of rows; independent for each pixel. */
static void band_agreements(const run *r, const reference_run *ref, int first, int rows)
{
    const tsuya_fusion_view *reference = ref->view[0];
    const size_t width = (size_t)reference->map.width_px;
#pragma omp parallel for schedule(dynamic, 2) num_threads(r->context->threads)
    for (int row = 0; row < rows; row++) {
        for (size_t x = 0; x < width; x++) {
            size_t at = (size_t)(first + row) * width + x;
            int32_t *out = ref->agreed + ((size_t)row * width + x) * MOST_NEIGHBOURS;
            bool open = reference->map.depth[at] > 0.0f && !bit_get(r->used[reference->view], at);
            tsuya_vec3 point = {0, 0, 0}, normal = {0, 0, 0};
            if (open) {
                point = map_point_world(reference, at);
                normal = map_normal_world(reference, at);
            }
            for (int k = 1; k < ref->count; k++) {
                out[k - 1] = open ? (int32_t)agreeing_pixel(reference, at, point, normal, ref->view[k], r->options) : -1;
            }
        }
    }
}

/* Makes the band's points in the pixels' order: a neighbour's pixel belongs to the first that asks for it. */
static tsuya_status band_points(run *r, const reference_run *ref, int first, int rows)
{
    const tsuya_fusion_view *reference = ref->view[0];
    const size_t width = (size_t)reference->map.width_px;
    const tsuya_vec3 origin = reference->world_from_camera.translation;
    for (size_t i = 0; i < (size_t)rows * width; i++) {
        const size_t at = (size_t)first * width + i;
        const int32_t *agreed = ref->agreed + i * MOST_NEIGHBOURS;
        const int own_measured = !from_prior(reference, at);
        int support = 1, measured = own_measured;
        for (int k = 1; k < ref->count; k++) {
            bool votes = agreed[k - 1] >= 0 && !bit_get(r->used[ref->view[k]->view], (size_t)agreed[k - 1]);
            support += votes;
            measured += votes && !from_prior(ref->view[k], (size_t)agreed[k - 1]);
        }
        if (support < r->options->min_views || !(reference->map.depth[at] > 0.0f)) {
            continue;
        }
        const bool helped = measured < r->options->min_views;
        vote_sum sum = {0};
        tsuya_vec3 ray = tsuya_mat3_apply(reference->world_from_camera.rotation,
                                          pixel_ray(&reference->camera, (double)(at % width), (double)(at / width)));
        const double own = reference->map.depth[at];
        if (own_measured || helped) {
            add_vote(&sum, origin, ray, own, reference, at);
        }
        bit_set(r->used[reference->view], at);
        for (int k = 1; k < ref->count; k++) {
            const tsuya_fusion_view *v = ref->view[k];
            if (agreed[k - 1] < 0 || bit_get(r->used[v->view], (size_t)agreed[k - 1])) {
                continue;
            }
            if (helped || !from_prior(v, (size_t)agreed[k - 1])) {
                add_vote(&sum, origin, ray, own, v, (size_t)agreed[k - 1]);
            }
            bit_set(r->used[v->view], (size_t)agreed[k - 1]);
        }
        TSUYA_TRY(points_grow(&r->points));
        settle(&r->points.point[r->points.count++], &sum, origin, ray, own, own / reference->camera.fx_px, helped);
        r->points_prior += helped;
    }
    return TSUYA_OK;
}

static tsuya_status claim_bits(run *r, const tsuya_fusion_view *v)
{
    size_t pixels = (size_t)v->map.width_px * (size_t)v->map.height_px;
    if (!r->used[v->view]) {
        r->used[v->view] = tsuya_arena_alloc(r->arena, (pixels + 7) / 8, 1);
        r->used_width[v->view] = v->map.width_px;
    }
    if (r->used[v->view] && r->used_width[v->view] != v->map.width_px) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s/stereo: the maps of %s changed while they were fused",
                          r->options->workspace, r->model.view[v->view].name);
    }
    return r->used[v->view] ? TSUYA_OK : TSUYA_ERROR_MEMORY;
}

/* Median of the positive values; 0 where there are none. */
static tsuya_status median_positive(double *median, const float *value, size_t stride, size_t count)
{
    float *kept = tsuya_calloc(count, sizeof *kept);
    size_t n = 0;
    if (!kept) {
        return TSUYA_ERROR_MEMORY;
    }
    for (size_t i = 0; i < count; i++) {
        if (value[i * stride] > 0.0f) {
            kept[n++] = value[i * stride];
        }
    }
    tsuya_sort_floats(kept, n);
    *median = n ? kept[n / 2] : 0.0;
    tsuya_free(kept);
    return TSUYA_OK;
}

static tsuya_status fuse_reference(run *r, int view)
{
    const tsuya_view_plan *plan = &r->plan[view];
    reference_run ref = {.count = 1 + plan->source_count};
    int index[1 + MOST_NEIGHBOURS] = {view};
    memcpy(index + 1, plan->source, (size_t)plan->source_count * sizeof *index);
    TSUYA_TRY(tsuya_fusion_views_get(ref.view, r->views, index, ref.count));
    for (int k = 0; k < ref.count; k++) {
        TSUYA_TRY(claim_bits(r, ref.view[k]));
    }
    const tsuya_depth_map *map = &ref.view[0]->map;
    double depth = 0.0;
    TSUYA_TRY(median_positive(&depth, map->depth, 1, (size_t)map->width_px * (size_t)map->height_px));
    if (depth > 0.0) {
        r->gsd[r->gsd_count++] = depth / ref.view[0]->camera.fx_px;
    }
    ref.agreed = tsuya_calloc((size_t)BAND_ROWS * (size_t)map->width_px * MOST_NEIGHBOURS, sizeof *ref.agreed);
    tsuya_status status = ref.agreed ? TSUYA_OK : TSUYA_ERROR_MEMORY;
    for (int first = 0; first < map->height_px && status == TSUYA_OK; first += BAND_ROWS) {
        int rows = map->height_px - first < BAND_ROWS ? map->height_px - first : BAND_ROWS;
        band_agreements(r, &ref, first, rows);
        status = band_points(r, &ref, first, rows);
    }
    tsuya_free(ref.agreed);
    return status;
}

/* ---- the stage ---- */

static tsuya_status prepare(run *r)
{
    const tsuya_fusion_options *o = r->options;
    char *sparse = tsuya_arena_printf(r->arena, "%s/sparse", o->workspace);
    if (!sparse) {
        return TSUYA_ERROR_MEMORY;
    }
    TSUYA_TRY(tsuya_sparse_model_load(&r->model, sparse));
    TSUYA_TRY(tsuya_view_plans_make(&r->plan, &r->model, o->hold_out, o->hold_out_count, o->neighbours, o->workspace,
                                    r->arena));
    TSUYA_TRY(tsuya_fusion_views_create(&r->views, &r->model, o->workspace, o->geometric ? "geometric" : "photometric",
                                        o->prior, 1 + o->neighbours));
    r->used = tsuya_arena_alloc(r->arena, (size_t)r->model.view_count, sizeof *r->used);
    r->used_width = tsuya_arena_alloc(r->arena, (size_t)r->model.view_count, sizeof *r->used_width);
    r->gsd = tsuya_arena_alloc(r->arena, (size_t)r->model.view_count, sizeof *r->gsd);
    return r->used && r->used_width && r->gsd ? TSUYA_OK : TSUYA_ERROR_MEMORY;
}

static tsuya_status make_cloud(tsuya_mesh *cloud, const point_list *list)
{
    TSUYA_TRY(tsuya_mesh_create(cloud, list->count, 0,
                                TSUYA_MESH_NORMAL | TSUYA_MESH_COLOR | TSUYA_MESH_EVIDENCE | TSUYA_MESH_SIGMA));
    for (size_t i = 0; i < list->count; i++) {
        const struct fused_point *p = &list->point[i];
        memcpy(cloud->position + 3 * i, p->position, sizeof p->position);
        memcpy(cloud->normal + 3 * i, p->normal, sizeof p->normal);
        memcpy(cloud->color + 3 * i, p->color, sizeof p->color);
        cloud->evidence[i] = p->evidence;
        cloud->sigma[i] = p->sigma;
    }
    return TSUYA_OK;
}

static tsuya_status summarise(tsuya_fusion_info *info, const run *r)
{
    double views = 0.0;
    for (size_t i = 0; i < r->points.count; i++) {
        views += r->points.point[i].evidence;
    }
    info->points = r->points.count;
    info->points_prior = r->points_prior;
    info->mean_views = views / (double)r->points.count;
    tsuya_sort_doubles(r->gsd, (size_t)r->gsd_count);
    info->gsd = r->gsd_count ? r->gsd[r->gsd_count / 2] : NAN;
    return median_positive(&info->median_sigma, &r->points.point[0].sigma, sizeof *r->points.point / sizeof(float),
                           r->points.count);
}

static tsuya_status check_options(const tsuya_fusion_options *o)
{
    if (o->neighbours < 1 || o->neighbours > MOST_NEIGHBOURS) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "neighbours: %d, 1 to %d are accepted", o->neighbours, MOST_NEIGHBOURS);
    }
    if (o->min_views < 1 || o->min_views > o->neighbours + 1) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "min_views: %d, 1 to neighbours + 1 (%d) are accepted", o->min_views,
                          o->neighbours + 1);
    }
    return TSUYA_OK;
}

tsuya_status tsuya_fusion(tsuya_mesh *cloud, tsuya_fusion_info *info, const tsuya_fusion_options *options,
                          const tsuya_context *context)
{
    memset(cloud, 0, sizeof *cloud);
    memset(info, 0, sizeof *info);
    TSUYA_TRY(check_options(options));
    const double began = tsuya_clock_s();
    run r = {.options = options, .context = context};
    tsuya_status status = TSUYA_OK;
    TSUYA_GOTO_DONE(status, tsuya_arena_create(&r.arena, 1 << 16));
    TSUYA_GOTO_DONE(status, prepare(&r));
    for (int v = 0; v < r.model.view_count; v++) {
        if (r.plan[v].used) {
            TSUYA_GOTO_DONE(status, tsuya_check_interrupt());
            tsuya_progress_update(context, "fusion", v, r.model.view_count, r.model.view[v].name);
            TSUYA_GOTO_DONE(status, fuse_reference(&r, v));
            info->views++;
        }
    }
    if (r.points.count == 0) {
        status = tsuya_fail(TSUYA_ERROR_INPUT, "%s/stereo: no pixel of the %d maps is supported by %d views",
                            options->workspace, info->views, options->min_views);
        goto done;
    }
    TSUYA_GOTO_DONE(status, make_cloud(cloud, &r.points));
    TSUYA_GOTO_DONE(status, summarise(info, &r));
    tsuya_progress_update(context, "fusion", r.model.view_count, r.model.view_count, NULL);
done:
    info->seconds = tsuya_clock_s() - began;
    if (status != TSUYA_OK) {
        tsuya_mesh_free(cloud);
    }
    tsuya_fusion_views_free(r.views);
    tsuya_free(r.points.point);
    tsuya_sparse_model_free(&r.model);
    tsuya_arena_free(r.arena);
    return status;
}

void tsuya_fusion_info_to_json(tsuya_json *object, const tsuya_fusion_info *info)
{
    tsuya_json_set_number(object, "views", info->views);
    tsuya_json_set_number(object, "points", (double)info->points);
    tsuya_json_set_number(object, "points_prior", (double)info->points_prior);
    tsuya_json_set_number(object, "mean_views", info->mean_views);
    tsuya_json_set_number(object, "median_sigma", info->median_sigma);
    tsuya_json_set_number(object, "gsd", info->gsd);
    tsuya_json_set_number(object, "seconds", info->seconds);
}
