#include "reconstruct/surface.h"

#include "core/memory.h"
#include "core/order.h"
#include "reconstruct/cloud_clean.h"
#include "reconstruct/mesh_distance.h"
#include "reconstruct/mesh_refine.h"
#include "reconstruct/mesh_topology.h"
#include "reconstruct/meshopt_adapter.h"
#include "reconstruct/pcl_adapter.h"
#include "reconstruct/surface_support.h"

#include <string.h>

enum { POINTS_MIN = 32, DEPTH_MIN = 4, DEPTH_MAX = 12, GAP_SMOOTHING = 4, HULL_MARGIN_PX = 4, SIMPLIFY_TRIALS = 4 };
static const float POINT_WEIGHT = 4.0f; /* Kazhdan & Hoppe's default */
/* Between irregular samples a place may well be a spacing from the nearest: it still counts as measured half a spacing
 * farther out than where hems are cut. */
static const double EVIDENCE_MARGIN = 0.5;

tsuya_surface_options tsuya_surface_options_default(void)
{
    return (tsuya_surface_options){
        .outlier_sigmas = 3.0, .trim_spacings = 1.0, .bridge_spacings = 5.0, .island_fraction = 0.01, .smoothing = 2,
        .color_spacings = 6.0,
    };
}

static tsuya_status check_options(const tsuya_surface_options *o)
{
    if (!isfinite(o->tolerance) || !(o->thin >= 0.0) || !isfinite(o->thin) || !(o->min_evidence >= 0.0)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "surface: tolerance %g, thin %g, min_evidence %g: finite ones are accepted, the last "
                          "two from 0", o->tolerance, o->thin, o->min_evidence);
    }
    if (!(o->trim_spacings > 0.0) || !(o->bridge_spacings >= 0.0) || !(o->close_holes >= 0.0) || !(o->outlier_sigmas >= 0.0) ||
        !(o->color_spacings >= 0.0)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "surface: trim_spacings %g must be above 0; bridge_spacings %g, close_holes %g, "
                          "outlier_sigmas %g and color_spacings %g not below", o->trim_spacings, o->bridge_spacings,
                          o->close_holes, o->outlier_sigmas, o->color_spacings);
    }
    if (!(o->island_fraction >= 0.0 && o->island_fraction <= 1.0) || o->smoothing < 0 || o->smoothing > 100) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "surface: island_fraction %g must lie in 0 to 1 and smoothing %d in 0 to 100",
                          o->island_fraction, o->smoothing);
    }
    if (o->depth != 0 && (o->depth < DEPTH_MIN || o->depth > DEPTH_MAX)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "surface: depth %d; 0 or %d to %d are accepted", o->depth, DEPTH_MIN, DEPTH_MAX);
    }
    return TSUYA_OK;
}

/* Neither NaN nor so far out that squares overflow. */
static tsuya_status check_cloud(const tsuya_mesh *cloud)
{
    for (size_t k = 0; k < 3 * cloud->vertex_count; k++) {
        if (!(fabsf(cloud->position[k]) < 1e15f)) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "cloud: point %zu has a coordinate of %g; finite ones below 1e15 are accepted",
                              k / 3, (double)cloud->position[k]);
        }
        if (cloud->normal && !isfinite(cloud->normal[k])) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "cloud: point %zu has a normal of %g", k / 3, (double)cloud->normal[k]);
        }
    }
    for (size_t v = 0; v < cloud->vertex_count; v++) {
        if ((cloud->evidence && !isfinite(cloud->evidence[v])) || (cloud->sigma && !isfinite(cloud->sigma[v]))) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "cloud: point %zu has evidence or sigma that is not finite", v);
        }
    }
    return TSUYA_OK;
}

static size_t count_dropped(const uint8_t *keep, size_t count)
{
    size_t dropped = 0;
    for (size_t v = 0; v < count; v++) {
        dropped += !keep[v];
    }
    return dropped;
}

static tsuya_status require_points(const tsuya_mesh *points, const char *what)
{
    return points->vertex_count >= POINTS_MIN
               ? TSUYA_OK
               : tsuya_fail(TSUYA_ERROR_INPUT, "cloud: %zu points %s; a surface needs at least %d", points->vertex_count, what,
                            POINTS_MIN);
}

/* Points with too little evidence, with a zero normal, or outside the masks. */
static tsuya_status drop_unwanted(tsuya_mesh *points, tsuya_surface_info *info, const tsuya_surface_options *options,
                                  const tsuya_context *context)
{
    tsuya_status status = TSUYA_OK;
    uint8_t *keep;
    TSUYA_NEW(status, keep, points->vertex_count);
    memset(keep, 1, points->vertex_count);
    if (options->masks_workspace) {
        TSUYA_GOTO_DONE(status, tsuya_cloud_mark_outside_hull(keep, points, options->masks_workspace, HULL_MARGIN_PX, context));
        info->points_outside_masks = count_dropped(keep, points->vertex_count);
    }
    for (size_t v = 0; v < points->vertex_count; v++) {
        const float *n = points->normal ? points->normal + 3 * v : NULL;
        bool normal = !n || n[0] * n[0] + n[1] * n[1] + n[2] * n[2] > 0.25f;
        bool evident = !points->evidence || (double)points->evidence[v] >= options->min_evidence;
        keep[v] = keep[v] && normal && evident;
    }
    status = tsuya_mesh_filter(points, keep, false);
done:
    tsuya_free(keep);
    return status;
}

static tsuya_status drop_outliers(tsuya_mesh *points, tsuya_surface_info *info, const tsuya_surface_options *options,
                                  const tsuya_context *context)
{
    tsuya_status status = TSUYA_OK;
    uint8_t *keep;
    TSUYA_NEW(status, keep, points->vertex_count);
    TSUYA_GOTO_DONE(status, tsuya_cloud_mark_outliers(keep, points, options->outlier_sigmas, context));
    info->points_outlying = count_dropped(keep, points->vertex_count);
    status = tsuya_mesh_filter(points, keep, false);
done:
    tsuya_free(keep);
    return status;
}

static tsuya_status clean(tsuya_mesh *points, tsuya_surface_info *info, const tsuya_mesh *cloud,
                          const tsuya_surface_options *options, const tsuya_context *context)
{
    TSUYA_TRY(check_cloud(cloud));
    TSUYA_TRY(tsuya_mesh_copy(points, cloud));
    tsuya_free(points->triangle);
    points->triangle = NULL;
    points->triangle_count = 0;
    TSUYA_TRY(drop_unwanted(points, info, options, context));
    TSUYA_TRY(tsuya_cloud_thin(points, options->thin));
    TSUYA_TRY(require_points(points, "with normals, evidence and different places"));
    if (!points->normal) {
        TSUYA_TRY(tsuya_cloud_estimate_normals(points, context));
    }
    TSUYA_TRY(drop_outliers(points, info, options, context));
    TSUYA_TRY(require_points(points, "left without outliers"));
    info->points_kept = points->vertex_count;
    return TSUYA_OK;
}

/* Cells of about one spacing (0.7 to 1.4: halving them further doubles the time and gains a tenth of the residual); coarser
 * where the tolerance does not ask for that. */
static tsuya_status choose_depth(tsuya_surface_info *info, const tsuya_mesh *points, const tsuya_surface_options *options)
{
    tsuya_vec3 low, high;
    tsuya_mesh_bounds(points, &low, &high);
    double side = fmax(high.x - low.x, fmax(high.y - low.y, high.z - low.z));
    if (!(side > 0.0) || !(info->spacing > 0.0)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "cloud: all points lie in one place");
    }
    double depth = ceil(log2(1.1 * side / fmax(info->spacing, info->tolerance)) - 0.5);
    info->poisson_depth = options->depth ? options->depth : (int)fmin(fmax(depth, DEPTH_MIN), DEPTH_MAX);
    return TSUYA_OK;
}

static double bridged_fraction(const tsuya_mesh *mesh)
{
    double bridged = 0.0, total = 0.0;
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        const uint32_t *i = mesh->triangle + 3 * t;
        tsuya_vec3 a = tsuya_mesh_position(mesh, i[0]);
        double area = tsuya_vec3_norm(tsuya_vec3_cross(tsuya_vec3_sub(tsuya_mesh_position(mesh, i[1]), a),
                                                       tsuya_vec3_sub(tsuya_mesh_position(mesh, i[2]), a)));
        int without = (mesh->evidence[i[0]] == 0.0f) + (mesh->evidence[i[1]] == 0.0f) + (mesh->evidence[i[2]] == 0.0f);
        bridged += area * without / 3.0;
        total += area;
    }
    return total > 0.0 ? bridged / total : 0.0;
}

static tsuya_status trim(tsuya_mesh *mesh, tsuya_surface_info *info, const tsuya_mesh *points, const float *spacing,
                         const tsuya_surface_options *options, const tsuya_context *context)
{
    tsuya_status status = TSUYA_OK;
    float *gap;
    float level = (float)options->trim_spacings;
    float bridge = (float)fmax(options->bridge_spacings, options->close_holes / info->spacing);
    TSUYA_NEW(status, gap, mesh->vertex_count);
    double area = tsuya_mesh_area(mesh);
    TSUYA_GOTO_DONE(status, tsuya_mesh_compute_normals(mesh));
    TSUYA_GOTO_DONE(status, tsuya_surface_measure(mesh, gap, points, spacing, info->spacing,
                                                  options->trim_spacings + EVIDENCE_MARGIN, context));
    TSUYA_GOTO_DONE(status, tsuya_surface_bridge(gap, mesh, level, bridge));
    TSUYA_GOTO_DONE(status, tsuya_surface_smooth_gap(gap, mesh, 2.0f * level, GAP_SMOOTHING));
    TSUYA_GOTO_DONE(status, tsuya_mesh_cut(mesh, gap, level));
    TSUYA_GOTO_DONE(status, tsuya_mesh_drop_islands(mesh, options->island_fraction, &info->components));
    info->trimmed_fraction = area > 0.0 ? 1.0 - tsuya_mesh_area(mesh) / area : 0.0;
    if (mesh->triangle_count == 0) {
        status = tsuya_fail(TSUYA_ERROR_INPUT, "cloud: no part of the surface lies within %g spacings of the points",
                            options->trim_spacings);
    }
done:
    tsuya_free(gap);
    return status;
}

/* Distances of points to a mesh: value at a share of them, and the largest. */
static tsuya_status distance_statistics(double share[2], double value[2], double *largest, const tsuya_mesh *mesh,
                                        const tsuya_mesh *points, const tsuya_context *context)
{
    float *distance = tsuya_calloc(points->vertex_count, sizeof *distance);
    if (!distance) {
        return TSUYA_ERROR_MEMORY;
    }
    tsuya_status status = tsuya_mesh_distances(distance, mesh, points->position, points->vertex_count, context);
    if (status == TSUYA_OK) {
        tsuya_sort_floats(distance, points->vertex_count);
        for (int k = 0; k < 2; k++) {
            value[k] = (double)distance[(size_t)(share[k] * (double)(points->vertex_count - 1))];
        }
        *largest = (double)distance[points->vertex_count - 1];
    }
    tsuya_free(distance);
    return status;
}

/* The quadric error is a mean over planes, so the true distance may exceed it: measured, and tried again with less where
 * its 95th percentile is above the tolerance. */
static tsuya_status decimate(tsuya_mesh *mesh, tsuya_surface_info *info, const tsuya_context *context)
{
    tsuya_status status = TSUYA_OK;
    tsuya_mesh before = *mesh, after = {0};
    double error = info->tolerance;
    info->triangles_before = mesh->triangle_count;
    for (int trial = 0; trial < SIMPLIFY_TRIALS; trial++) {
        double share[2] = {0.5, 0.95}, value[2];
        TSUYA_GOTO_DONE(status, tsuya_check_interrupt());
        TSUYA_GOTO_DONE(status, tsuya_mesh_copy(&after, &before));
        TSUYA_GOTO_DONE(status, tsuya_meshopt_simplify(&after, error));
        if (after.triangle_count == 0) { /* collapsed altogether */
            tsuya_mesh_free(&after);
            error *= 0.25;
            continue;
        }
        TSUYA_GOTO_DONE(status, distance_statistics(share, value, &info->simplification_max, &after, &before, context));
        info->simplification_p95 = value[1];
        if (value[1] <= info->tolerance) {
            tsuya_mesh_free(mesh);
            *mesh = after;
            return TSUYA_OK;
        }
        tsuya_mesh_free(&after);
        error *= 0.8 * info->tolerance / value[1];
    }
    info->simplification_p95 = info->simplification_max = 0.0; /* left as it was */
done:
    tsuya_mesh_free(&after);
    return status;
}

static tsuya_status finish(tsuya_mesh *mesh, tsuya_surface_info *info, const tsuya_mesh *points,
                           const tsuya_surface_options *options, const tsuya_context *context)
{
    double share[2] = {0.5, 0.95}, value[2], largest;
    TSUYA_TRY(tsuya_mesh_smooth(mesh, options->smoothing));
    TSUYA_TRY(tsuya_mesh_compute_normals(mesh));
    info->bridged_fraction = bridged_fraction(mesh); /* before triangles become large */
    if (info->tolerance > 0.0) {
        TSUYA_TRY(decimate(mesh, info, context));
        if (mesh->color && options->color_spacings > 0.0) {
            TSUYA_TRY(tsuya_mesh_refine(mesh, options->color_spacings * info->spacing));
        }
    }
    TSUYA_TRY(distance_statistics(share, value, &largest, mesh, points, context));
    info->residual_median = value[0];
    info->residual_p95 = value[1];
    uint32_t *boundary;
    TSUYA_TRY(tsuya_mesh_boundary(&boundary, &info->boundary_edges, mesh));
    tsuya_free(boundary);
    info->vertices = mesh->vertex_count;
    info->triangles = mesh->triangle_count;
    return TSUYA_OK;
}

tsuya_status tsuya_surface_make(tsuya_mesh *mesh, tsuya_surface_info *info, const tsuya_mesh *cloud,
                           const tsuya_surface_options *options, const tsuya_context *context)
{
    *mesh = (tsuya_mesh){0};
    *info = (tsuya_surface_info){.points_in = cloud->vertex_count};
    TSUYA_TRY(check_options(options));
    tsuya_status status = TSUYA_OK;
    tsuya_mesh points = {0};
    float *spacing = NULL;
    double start = tsuya_clock_s();
    TSUYA_GOTO_DONE(status, clean(&points, info, cloud, options, context));
    TSUYA_NEW(status, spacing, points.vertex_count);
    TSUYA_GOTO_DONE(status, tsuya_cloud_spacing(spacing, &info->spacing, &points, context));
    info->tolerance = options->tolerance > 0.0 ? options->tolerance : options->tolerance < 0.0 ? 0.0 : 0.5 * info->spacing;
    TSUYA_GOTO_DONE(status, choose_depth(info, &points, options));
    TSUYA_GOTO_DONE(status, tsuya_check_interrupt());
    tsuya_progress_update(context, "Poisson surface", 0.0, 1.0, NULL);
    TSUYA_GOTO_DONE(status, tsuya_pcl_poisson(mesh, &points, info->poisson_depth, POINT_WEIGHT));
    tsuya_progress_update(context, "Poisson surface", 1.0, 1.0, NULL);
    TSUYA_GOTO_DONE(status, trim(mesh, info, &points, spacing, options, context));
    TSUYA_GOTO_DONE(status, finish(mesh, info, &points, options, context));
    info->seconds = tsuya_clock_s() - start;
done:
    tsuya_mesh_free(&points);
    tsuya_free(spacing);
    if (status != TSUYA_OK) {
        tsuya_mesh_free(mesh);
    }
    return status;
}

void tsuya_surface_info_to_json(tsuya_json *object, const tsuya_surface_info *info)
{
    tsuya_json_set_number(object, "points_in", (double)info->points_in);
    tsuya_json_set_number(object, "points", (double)info->points_kept);
    tsuya_json_set_number(object, "points_outside_masks", (double)info->points_outside_masks);
    tsuya_json_set_number(object, "points_outlying", (double)info->points_outlying);
    tsuya_json_set_number(object, "spacing", info->spacing);
    tsuya_json_set_number(object, "poisson_depth", info->poisson_depth);
    tsuya_json_set_number(object, "mesh_vertices", (double)info->vertices);
    tsuya_json_set_number(object, "mesh_triangles", (double)info->triangles);
    tsuya_json_set_number(object, "mesh_triangles_before_decimation", (double)info->triangles_before);
    tsuya_json_set_number(object, "trimmed_fraction", info->trimmed_fraction);
    tsuya_json_set_number(object, "bridged_fraction", info->bridged_fraction);
    tsuya_json_set_number(object, "tolerance", info->tolerance);
    tsuya_json *error = tsuya_json_set_object(object, "simplification");
    tsuya_json_set_number(error, "p95", info->simplification_p95);
    tsuya_json_set_number(error, "max", info->simplification_max);
    tsuya_json *residual = tsuya_json_set_object(object, "residual");
    tsuya_json_set_number(residual, "median", info->residual_median);
    tsuya_json_set_number(residual, "p95", info->residual_p95);
    tsuya_json_set_number(object, "components", (double)info->components);
    tsuya_json_set_number(object, "boundary_edges", (double)info->boundary_edges);
    tsuya_json_set_number(object, "seconds", info->seconds);
}
