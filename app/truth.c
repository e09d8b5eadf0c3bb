#include "app/truth.h"

#include "brdf/material.h"
#include "core/camera.h"
#include "core/file.h"
#include "core/mesh.h"
#include "core/order.h"
#include "core/raster.h"
#include "reconstruct/mesh_distance.h"

#include <math.h>

typedef struct comparison {
    const tsuya_context *context;
    tsuya_sparse_model model, true_model;
    tsuya_mesh mesh, true_mesh; /* `mesh` moved into the truth's frame */
    tsuya_similarity truth_from_job;
    double gsd_m;
    bool metric; /* the job has a scale of its own */
} comparison;

static void set_median_p90(tsuya_json *figures, const char *key, double *value, size_t count)
{
    tsuya_json *object = tsuya_json_set_object(figures, key);
    tsuya_sort_doubles(value, count);
    tsuya_json_set_number(object, "median", count > 0 ? value[count / 2] : NAN);
    tsuya_json_set_number(object, "p90", count > 0 ? value[(size_t)(0.9 * (double)(count - 1))] : NAN);
}

static void set_null_pair(tsuya_json *figures, const char *key, const char *first, const char *second)
{
    tsuya_json *object = tsuya_json_set_object(figures, key);
    tsuya_json_set_null(object, first);
    tsuya_json_set_null(object, second);
}

/* Camera centres of the photographs that both models have. */
static tsuya_status align(comparison *c, tsuya_json *figures, double gsd_job)
{
    int n = 0;
    double rms, focal = 0.0, true_focal = 0.0;
    tsuya_status status = TSUYA_OK;
    tsuya_vec3 *own = NULL, *truth = NULL;
    TSUYA_NEW(status, own, (size_t)c->model.view_count);
    TSUYA_NEW(status, truth, (size_t)c->model.view_count);
    for (int v = 0; v < c->model.view_count; v++) {
        int other = tsuya_sparse_model_find(&c->true_model, c->model.view[v].name);
        if (other >= 0) {
            own[n] = tsuya_pose_center(c->model.view[v].camera_from_world);
            truth[n++] = tsuya_pose_center(c->true_model.view[other].camera_from_world);
            focal += c->model.camera[c->model.view[v].camera].fx_px;
            true_focal += c->true_model.camera[c->true_model.view[other].camera].fx_px;
        }
    }
    if (n < 3 || !tsuya_similarity_align(&c->truth_from_job, &rms, truth, own, n)) {
        status = tsuya_fail(TSUYA_ERROR_NUMERIC, "truth: %d photographs placed, their cameras do not fix a frame", n);
        goto done;
    }
    if (c->metric) { /* in the mat's frame, as the truth is: nothing is moved */
        tsuya_json_set_number(figures, "scale_rel", fabs(c->truth_from_job.scale - 1.0));
        c->truth_from_job = (tsuya_similarity){1.0, {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}}, {0, 0, 0}};
    } else {
        tsuya_json_set_null(figures, "scale_rel");
    }
    c->gsd_m = gsd_job * c->truth_from_job.scale;
    tsuya_json_set_number(figures, "focal_rel", fabs(focal / true_focal - 1.0));
    tsuya_json_set_number(figures, "camera_center_gsd", rms / c->gsd_m);
done:
    tsuya_free(own);
    tsuya_free(truth);
    return status;
}

static void move_mesh(comparison *c)
{
    for (size_t v = 0; v < c->mesh.vertex_count; v++) {
        tsuya_vec3 p = tsuya_similarity_apply(c->truth_from_job, tsuya_mesh_position(&c->mesh, v));
        float *position = c->mesh.position + 3 * v;
        position[0] = (float)p.x;
        position[1] = (float)p.y;
        position[2] = (float)p.z;
    }
}

/* `unit`: 1 gives distances in the meshes' unit. */
static tsuya_status surface_distance(const comparison *c, tsuya_json *figures, const char *key, double unit)
{
    tsuya_status status = TSUYA_OK;
    double *value = NULL;
    float *distance = NULL;
    size_t count = c->mesh.vertex_count;
    TSUYA_NEW(status, distance, count);
    TSUYA_NEW(status, value, count);
    TSUYA_GOTO_DONE(status, tsuya_mesh_distances(distance, &c->true_mesh, c->mesh.position, count, c->context));
    for (size_t v = 0; v < count; v++) {
        value[v] = (double)distance[v] / unit;
    }
    set_median_p90(figures, key, value, count);
done:
    tsuya_free(value);
    tsuya_free(distance);
    return status;
}

/* Adds one to every vertex that a photograph sees: inside the picture, and not behind another part of the cloth. */
static tsuya_status count_seen(uint8_t *seen, const comparison *c, const tsuya_view *view)
{
    const tsuya_camera *camera = &c->true_model.camera[view->camera];
    tsuya_raster raster;
    TSUYA_TRY(tsuya_raster_create(&raster, camera->width_px, camera->height_px));
    tsuya_status status = tsuya_raster_draw(&raster, &c->true_mesh, camera, view->camera_from_world, c->context);
    for (size_t v = 0; status == TSUYA_OK && v < c->true_mesh.vertex_count; v++) {
        tsuya_vec3 p = tsuya_pose_apply(view->camera_from_world, tsuya_mesh_position(&c->true_mesh, v));
        tsuya_vec2 pixel;
        if (!tsuya_camera_project(camera, p, &pixel)) {
            continue;
        }
        int x = (int)lround(pixel.x), y = (int)lround(pixel.y);
        if (x >= 0 && x < raster.width_px && y >= 0 && y < raster.height_px) {
            float depth = raster.depth[(size_t)y * (size_t)raster.width_px + (size_t)x];
            seen[v] = (uint8_t)(seen[v] + (depth > 0.0f && p.z < (double)depth + 4.0 * c->gsd_m && seen[v] < 255));
        }
    }
    tsuya_raster_free(&raster);
    return status;
}

/* Each vertex stands for a third of the triangles around it. */
static void vertex_areas(double *area, const tsuya_mesh *mesh)
{
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        const uint32_t *v = mesh->triangle + 3 * t;
        tsuya_vec3 a = tsuya_mesh_position(mesh, v[0]);
        tsuya_vec3 normal = tsuya_vec3_cross(tsuya_vec3_sub(tsuya_mesh_position(mesh, v[1]), a),
                                             tsuya_vec3_sub(tsuya_mesh_position(mesh, v[2]), a));
        for (int k = 0; k < 3; k++) {
            area[v[k]] += tsuya_vec3_norm(normal) / 6.0;
        }
    }
}

static tsuya_status completeness(const comparison *c, tsuya_json *figures)
{
    tsuya_status status = TSUYA_OK;
    uint8_t *seen = NULL;
    double *area = NULL, there = 0.0, all = 0.0;
    float *distance = NULL;
    size_t count = c->true_mesh.vertex_count;
    TSUYA_NEW(status, seen, count);
    TSUYA_NEW(status, area, count);
    TSUYA_NEW(status, distance, count);
    for (int v = 0; v < c->true_model.view_count; v++) {
        TSUYA_GOTO_DONE(status, count_seen(seen, c, &c->true_model.view[v]));
    }
    TSUYA_GOTO_DONE(status, tsuya_mesh_distances(distance, &c->mesh, c->true_mesh.position, count, c->context));
    vertex_areas(area, &c->true_mesh);
    for (size_t v = 0; v < count; v++) {
        if (seen[v] >= 3) {
            all += area[v];
            there += (double)distance[v] <= 2.0 * c->gsd_m ? area[v] : 0.0;
        }
    }
    tsuya_json *object = tsuya_json_set_object(figures, "completeness");
    tsuya_json_set_number(object, "tolerance_m", 2.0 * c->gsd_m);
    tsuya_json_set_number(object, "fraction", all > 0.0 ? there / all : NAN);
done:
    tsuya_free(seen);
    tsuya_free(area);
    tsuya_free(distance);
    return status;
}

/* The truth's weft on a triangle: the mean of its corners, which agree but for their sign. */
static tsuya_vec3 triangle_weft(const tsuya_mesh *mesh, uint32_t triangle)
{
    const uint32_t *v = mesh->triangle + 3 * (size_t)triangle;
    tsuya_vec3 first = {0, 0, 0}, sum = {0, 0, 0};
    for (int k = 0; k < 3; k++) {
        const float *w = mesh->weft + 3 * (size_t)v[k];
        tsuya_vec3 weft = {w[0], w[1], w[2]};
        if (k == 0) {
            first = weft;
        }
        sum = tsuya_vec3_mad(sum, tsuya_vec3_dot(weft, first) < 0.0 ? -1.0 : 1.0, weft);
    }
    return tsuya_vec3_unit(sum);
}

static tsuya_status weft_error(const comparison *c, tsuya_json *figures, const tsuya_json *weave)
{
    const tsuya_mesh *mesh = &c->mesh;
    if (!mesh->weft || !mesh->weave_confidence || !c->true_mesh.weft) {
        set_null_pair(figures, "weft_deg", "median", "p90");
        set_null_pair(figures, "weft_all_deg", "median", "p90");
        return TSUYA_OK;
    }
    tsuya_mesh_tree *tree = NULL;
    double *error = NULL, *covered = NULL;
    size_t count = 0, covered_count = 0;
    tsuya_status status = TSUYA_OK;
    TSUYA_NEW(status, error, mesh->vertex_count);
    TSUYA_NEW(status, covered, mesh->vertex_count);
    TSUYA_GOTO_DONE(status, tsuya_mesh_tree_create(&tree, &c->true_mesh));
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        tsuya_mesh_hit hit = tsuya_mesh_tree_closest(tree, tsuya_mesh_position(mesh, v), 10.0 * c->gsd_m);
        if (hit.triangle == UINT32_MAX) {
            continue;
        }
        const float *w = mesh->weft + 3 * v, *nf = mesh->normal + 3 * v;
        tsuya_vec3 normal = tsuya_mat3_apply(c->truth_from_job.rotation, (tsuya_vec3){nf[0], nf[1], nf[2]});
        tsuya_vec3 weft = tsuya_mat3_apply(c->truth_from_job.rotation, (tsuya_vec3){w[0], w[1], w[2]});
        tsuya_vec3 truth = tsuya_vec3_tangent(triangle_weft(&c->true_mesh, hit.triangle), tsuya_vec3_unit(normal));
        error[count++] = tsuya_deg_from_rad(acos(fmin(fabs(tsuya_vec3_dot(tsuya_vec3_unit(weft), truth)), 1.0)));
        if (mesh->weave_confidence[v] > 0.0f) {
            covered[covered_count++] = error[count - 1];
        }
    }
    set_median_p90(figures, "weft_deg", covered, covered_count);
    set_median_p90(figures, "weft_all_deg", error, count);
    tsuya_json_set_number(figures, "covered_fraction", tsuya_json_number_or(tsuya_json_member(weave, "covered_fraction"), NAN));
done:
    tsuya_mesh_tree_free(tree);
    tsuya_free(error);
    tsuya_free(covered);
    return status;
}

/* What the render stage measured on the photographs that were held out. */
static void rerender_error(tsuya_json *figures, const tsuya_json *render)
{
    const tsuya_json *de00 = tsuya_json_member(tsuya_json_member(tsuya_json_member(render, "like"), "hold_out"), "de00");
    tsuya_json *pair = tsuya_json_set_object(figures, "rerender_de00");
    tsuya_json_set_number(pair, "median", tsuya_json_number_or(tsuya_json_member(de00, "median"), NAN));
    tsuya_json_set_number(pair, "p95", tsuya_json_number_or(tsuya_json_member(de00, "p95"), NAN));
}

/* The material of a job that measured one, on directions that no reading has: a table of the truth. */
static tsuya_status table_error(double *error, const tsuya_job *job, const char *truth_folder, const char *name)
{
    tsuya_material *material;
    const char *path = tsuya_stage_material_path(job, 0, true), *table = tsuya_arena_printf(job->arena, "%s/%s", truth_folder, name);
    *error = NAN;
    if (!path || !table) {
        return TSUYA_ERROR_MEMORY;
    }
    if (job->materials.count == 0 || !tsuya_job_material_at(job, 0)->samples || !tsuya_path_exists(table)) {
        return TSUYA_OK;
    }
    TSUYA_TRY(tsuya_material_load(&material, path));
    tsuya_status status = tsuya_truth_reflectance(error, material, table);
    tsuya_material_free(material);
    return status;
}

static tsuya_status load(comparison *c, const tsuya_job *job, const char *truth_folder)
{
    const char *sparse = tsuya_job_path(job, "reconstruct/sparse/0"), *mesh = tsuya_job_path(job, "weave/weave.ply");
    if (mesh && !tsuya_path_exists(mesh)) {
        mesh = tsuya_job_path(job, "reconstruct/mesh.ply"); /* a job without a weft field */
    }
    const char *true_sparse = tsuya_arena_printf(job->arena, "%s/sparse", truth_folder);
    const char *true_mesh = tsuya_arena_printf(job->arena, "%s/mesh.ply", truth_folder);
    if (!sparse || !mesh || !true_sparse || !true_mesh) {
        return TSUYA_ERROR_MEMORY;
    }
    TSUYA_TRY(tsuya_sparse_model_load(&c->model, sparse));
    TSUYA_TRY(tsuya_sparse_model_load(&c->true_model, true_sparse));
    TSUYA_TRY(tsuya_ply_load(&c->mesh, mesh));
    TSUYA_TRY(tsuya_ply_load(&c->true_mesh, true_mesh));
    return c->mesh.normal ? TSUYA_OK : tsuya_mesh_compute_normals(&c->mesh);
}

tsuya_status tsuya_truth_compare(tsuya_json *figures, const tsuya_job *job, const tsuya_state *state, const char *truth_folder,
                                 const tsuya_context *context)
{
    comparison c = {.context = context};
    const tsuya_json *reconstruct = tsuya_json_member(tsuya_state_record(state, "reconstruct"), "figures");
    double gsd_job, table, hemispheres, photos;
    tsuya_status status;
    c.metric = isfinite(tsuya_json_number_or(tsuya_json_member(reconstruct, "scale_m_per_unit"), NAN));
    TSUYA_GOTO_DONE(status, tsuya_json_get_number(&gsd_job, reconstruct, "gsd_units"));
    TSUYA_GOTO_DONE(status, load(&c, job, truth_folder));
    TSUYA_GOTO_DONE(status, align(&c, figures, gsd_job));
    move_mesh(&c);
    TSUYA_GOTO_DONE(status, surface_distance(&c, figures, "surface_gsd", c.gsd_m));
    TSUYA_GOTO_DONE(status, completeness(&c, figures));
    TSUYA_GOTO_DONE(status, weft_error(&c, figures, tsuya_json_member(tsuya_state_record(state, "weave"), "figures")));
    TSUYA_GOTO_DONE(status, table_error(&table, job, truth_folder, "held_out.csv"));
    TSUYA_GOTO_DONE(status, table_error(&hemispheres, job, truth_folder, "reflectance.csv"));
    TSUYA_GOTO_DONE(status, tsuya_truth_swatch(&photos, truth_folder, context));
    tsuya_json *reflectance = tsuya_json_set_object(figures, "brdf_cbrt");
    tsuya_json_set_number(reflectance, "table", table);
    tsuya_json_set_number(reflectance, "table_hemispheres", hemispheres);
    tsuya_json_set_number(reflectance, "photos", photos);
    rerender_error(figures, tsuya_json_member(tsuya_state_record(state, "render"), "figures"));
done:
    tsuya_sparse_model_free(&c.model);
    tsuya_sparse_model_free(&c.true_model);
    tsuya_mesh_free(&c.mesh);
    tsuya_mesh_free(&c.true_mesh);
    return status;
}

tsuya_status tsuya_truth_compare_surface(tsuya_json *figures, const char *folder, const char *true_mesh_path, double gsd,
                                         const tsuya_context *context)
{
    comparison c = {.context = context, .gsd_m = gsd};
    char *mesh = tsuya_path_join(folder, "mesh.ply"), *sparse = tsuya_path_join(folder, "sparse/0");
    tsuya_status status = mesh && sparse ? TSUYA_OK : TSUYA_ERROR_MEMORY;
    TSUYA_GOTO_DONE(status, status);
    TSUYA_GOTO_DONE(status, tsuya_ply_load(&c.mesh, mesh));
    TSUYA_GOTO_DONE(status, tsuya_ply_load(&c.true_mesh, true_mesh_path));
    TSUYA_GOTO_DONE(status, tsuya_sparse_model_load(&c.true_model, sparse));
    TSUYA_GOTO_DONE(status, surface_distance(&c, figures, "accuracy_m", 1.0));
    TSUYA_GOTO_DONE(status, completeness(&c, figures));
done:
    tsuya_sparse_model_free(&c.true_model);
    tsuya_mesh_free(&c.mesh);
    tsuya_mesh_free(&c.true_mesh);
    tsuya_free(mesh);
    tsuya_free(sparse);
    return status;
}
