#include "reconstruct/reconstruct.h"

#include "core/image.h"
#include "core/order.h"
#include "reconstruct/background.h"
#include "reconstruct/color.h"
#include "reconstruct/fusion.h"
#include "reconstruct/pinhole.h"
#include "reconstruct/silhouette.h"
#include "reconstruct/sparse_steps.h"
#include "reconstruct/stereo.h"
#include "reconstruct/surface.h"

#include <math.h>
#include <string.h>

/* Longer photographs are matched densely at half their size unless the options say otherwise. */
enum { HALF_ABOVE_PX = 1600, LEAST_PHOTOS = 3 };

tsuya_reconstruct_options tsuya_reconstruct_options_default(void)
{
    return (tsuya_reconstruct_options){.output = "reconstruct"};
}

static tsuya_status check_photos(const tsuya_photo_set *photos, const char *folder)
{
    if (photos->count < LEAST_PHOTOS) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: %d photograph%s; at least %d are needed, 20 or more all around a garment are usual", folder, photos->count,
                          photos->count == 1 ? "" : "s", LEAST_PHOTOS);
    }
    tsuya_hash first, other;
    bool all_same = true;
    TSUYA_TRY(tsuya_hash_file(&first, photos->photo[0].path));
    for (int i = 1; all_same && i < photos->count; i++) {
        TSUYA_TRY(tsuya_hash_file(&other, photos->photo[i].path));
        all_same = strcmp(first.hex, other.hex) == 0;
    }
    if (all_same) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: all %d photographs are the same file; different viewpoints are needed", folder, photos->count);
    }
    for (int i = 0; i < photos->count; i++) { /* a truncated file is said here, by name, and not by a child's exit */
        tsuya_image image;
        TSUYA_TRY(tsuya_check_interrupt());
        TSUYA_TRY(tsuya_image_load(&image, photos->photo[i].path));
        tsuya_image_free(&image);
    }
    return TSUYA_OK;
}

static tsuya_status hash_inputs(tsuya_hash *hash, const tsuya_reconstruct_options *o)
{
    tsuya_hasher *hasher;
    tsuya_hash folder;
    const char *const folders[] = {o->photos, o->masks, o->poses};
    tsuya_status status = tsuya_hasher_create(&hasher);
    for (int i = 0; status == TSUYA_OK && i < 3; i++) {
        if (folders[i]) {
            status = tsuya_hash_folder(&folder, folders[i]);
            tsuya_hasher_add_text(hasher, folder.hex);
        }
        tsuya_hasher_add_text(hasher, folders[i] ? "given" : "none");
    }
    if (status == TSUYA_OK && o->camera_model) {
        status = tsuya_hasher_add_file(hasher, o->camera_model);
    }
    if (hasher) {
        *hash = tsuya_hasher_end(hasher);
    }
    return status;
}

static double median(double *values, size_t count)
{
    if (count == 0) {
        return NAN;
    }
    tsuya_sort_doubles(values, count);
    return values[count / 2];
}

static int longer_side(const tsuya_photo_set *photos)
{
    return photos->photo[0].width_px > photos->photo[0].height_px ? photos->photo[0].width_px : photos->photo[0].height_px;
}

/* Sizes of the dense steps: what the options say, else what the tolerance needs, else the defaults. */
static tsuya_status choose_precision(tsuya_reconstruction *r, const tsuya_sparse_model *model)
{
    const tsuya_reconstruct_options *o = r->options;
    const int longer = longer_side(&r->photos);
    tsuya_precision_step given = {.long_side_px = o->dense_long_side_px, .source_views = o->source_views};
    if (o->tolerance > 0.0 && o->tolerance_in_metres && !o->scale && !o->poses) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "tolerance: %g m, but the reconstruction has no metres: a scale or known poses are needed, or a "
                          "number without a unit", o->tolerance);
    }
    given.long_side_px = given.long_side_px > longer ? longer : given.long_side_px;
    if (!(o->tolerance > 0.0)) {
        given.long_side_px = given.long_side_px > 0 ? given.long_side_px : longer > HALF_ABOVE_PX ? (longer + 1) / 2 : longer;
        given.source_views = given.source_views > 0 ? given.source_views : tsuya_stereo_options_default().source_views;
    }
    TSUYA_TRY(tsuya_precision_choose(&r->precision, model, r->info->gsd, longer, o->tolerance, given, r->arena));
    if (!r->precision.reached) {
        tsuya_warn("tolerance: %.3g is finer than these photographs give: %.3g is expected", o->tolerance, r->precision.chosen.error);
    }
    return TSUYA_OK;
}

/* Ground sample distance: median over views of (median depth of the points seen) / focal length, at full size. */
static tsuya_status measure_sparse(tsuya_reconstruction *r)
{
    tsuya_sparse_model model;
    tsuya_status status = TSUYA_OK;
    double *depth = NULL, *distance = NULL, error = 0.0;
    size_t observations = 0, views = 0;
    TSUYA_TRY(tsuya_sparse_model_load(&model, tsuya_reconstruction_path(r, "sparse/0")));
    TSUYA_NEW(status, distance, (size_t)model.view_count);
    for (size_t i = 0; i < model.point_count; i++) {
        error += model.point[i].error_px * model.point[i].track_count;
        observations += (size_t)model.point[i].track_count;
    }
    for (int v = 0; v < model.view_count; v++) {
        const tsuya_view *view = &model.view[v];
        size_t count = 0;
        TSUYA_NEW(status, depth, (size_t)view->observation_count);
        for (int k = 0; k < view->observation_count; k++) {
            int64_t point = view->observation[k].point;
            double z = point < 0 ? 0.0 : tsuya_pose_apply(view->camera_from_world, model.point[point].position).z;
            if (z > 0.0) {
                depth[count++] = z;
            }
        }
        if (count > 0) {
            distance[views++] = median(depth, count) / model.camera[view->camera].fx_px;
        }
        tsuya_free(depth);
        depth = NULL;
    }
    r->info->registered = model.view_count;
    r->info->sparse_points = model.point_count;
    r->info->reprojection_px = observations > 0 ? error / (double)observations : NAN;
    r->info->gsd = median(distance, views);
    status = choose_precision(r, &model);
done:
    tsuya_free(depth);
    tsuya_free(distance);
    tsuya_sparse_model_free(&model);
    return status;
}

/* A step's figures go into its record, so that a later run that passes it over still has them. */
static tsuya_status close_step(tsuya_reconstruction *r, tsuya_json *figures)
{
    tsuya_status status = tsuya_step_end(&r->steps, figures);
    tsuya_json_free(figures);
    return status;
}

static double figure(const tsuya_reconstruction *r, const char *step, const char *name, double fallback)
{
    return tsuya_json_number_or(tsuya_json_member(tsuya_step_figures(&r->steps, step), name), fallback);
}

/* Where no masks are given and the background stands still, masks of it; `own` names them. */
static tsuya_status background(tsuya_reconstruction *r, tsuya_reconstruct_options *own)
{
    const char *folder = tsuya_reconstruction_path(r, "background");
    if (own->masks) {
        return TSUYA_OK;
    }
    if (!tsuya_step_begin(&r->steps, "background", "1", folder)) {
        tsuya_background_info info;
        tsuya_json *figures = tsuya_json_create_object();
        TSUYA_TRY(tsuya_folder_remove(folder));
        TSUYA_TRY(tsuya_folder_make(folder));
        TSUYA_TRY(tsuya_background_masks(&info, &r->photos, folder, r->context));
        tsuya_json_set_number(figures, "found", info.found);
        tsuya_json_set_number(figures, "border", info.border);
        tsuya_json_set_number(figures, "masked", info.masked);
        if (info.found) {
            tsuya_note("the background stands still and is masked (%.0f %% of the pixels); all-white masks would keep it", 100.0 * info.masked);
        }
        TSUYA_TRY(close_step(r, figures));
    }
    if (figure(r, "background", "found", 0.0) > 0.0) {
        own->masks = folder;
        tsuya_photo_set_free(&r->photos);
        return tsuya_photo_set_load(&r->photos, own->photos, folder);
    }
    return TSUYA_OK;
}

/* Photographs through a lens that COLMAP lacks go in as a pinhole sees them; `own`, a copy of the options, names them, and `scale` holds what
 * was seen in them.  Given poses have cameras of their own. */
static tsuya_status pinhole(tsuya_reconstruction *r, tsuya_reconstruct_options *own, tsuya_scale_input *scale)
{
    tsuya_camera lens, camera;
    tsuya_pinhole_info info;
    bool needed = own->camera_model && !own->poses;
    const char *folder = tsuya_reconstruction_path(r, "pinhole");
    TSUYA_TRY(needed ? tsuya_reconstruction_camera(&lens, r) : TSUYA_OK);
    if (!needed || !tsuya_pinhole_needed(&lens)) {
        return tsuya_folder_remove(folder); /* of another camera */
    }
    TSUYA_TRY(tsuya_pinhole_of(&camera, &info, &lens, own->camera_model));
    const char *model = tsuya_reconstruction_path(r, "pinhole/camera.cameramodel");
    if (!tsuya_step_begin(&r->steps, "pinhole", "lanczos", model)) {
        char name[TSUYA_LENS_NAME];
        tsuya_json *figures = tsuya_json_create_object();
        tsuya_cameramodel_lens(name, &lens);
        tsuya_note("COLMAP has no lens model for %s: the photographs are drawn anew as a pinhole of %d x %d pixels sees them (%.0f %% of each)", name,
                   camera.width_px, camera.height_px, 100.0 * info.kept);
        TSUYA_TRY(tsuya_folder_remove(folder));
        TSUYA_TRY(tsuya_folder_make(folder));
        TSUYA_TRY(tsuya_pinhole_photos(folder, &camera, &lens, &r->photos, r->context));
        TSUYA_TRY(tsuya_cameramodel_save(&camera, tsuya_pose_identity(), model));
        tsuya_json_set_text(figures, "lens", name);
        tsuya_json_set_number(figures, "width", camera.width_px);
        tsuya_json_set_number(figures, "height", camera.height_px);
        tsuya_json_set_number(figures, "focal_px", camera.fx_px);
        tsuya_json_set_number(figures, "kept", info.kept);
        tsuya_json_set_number(figures, "stretch", info.stretch);
        tsuya_json_set_number(figures, "closure_px", info.closure_px);
        TSUYA_TRY(close_step(r, figures));
    }
    if (own->scale) {
        TSUYA_TRY(tsuya_pinhole_sightings(scale, own->scale, &camera, &lens, r->arena));
        own->scale = scale;
    }
    own->photos = tsuya_reconstruction_path(r, "pinhole/photos");
    own->masks = own->masks ? tsuya_reconstruction_path(r, "pinhole/masks") : NULL;
    own->camera_model = model;
    tsuya_photo_set_free(&r->photos);
    return tsuya_photo_set_load(&r->photos, own->photos, own->masks);
}

static tsuya_status stereo(tsuya_reconstruction *r)
{
    const tsuya_reconstruct_options *o = r->options;
    const int longer = longer_side(&r->photos);
    tsuya_stereo_options options = tsuya_stereo_options_default();
    options.workspace = tsuya_reconstruction_path(r, "dense");
    options.long_side_px = r->precision.chosen.long_side_px < longer ? r->precision.chosen.long_side_px : 0;
    options.source_views = r->precision.chosen.source_views;
    options.hold_out = o->hold_out;
    options.hold_out_count = o->hold_out_count;
    r->info->dense_long_side_px = options.long_side_px > 0 ? options.long_side_px : longer;
    const char *text = tsuya_arena_printf(r->arena, "%d|%d|%d|prior", options.long_side_px, options.source_views, o->hold_out_count);
    for (int i = 0; text && i < o->hold_out_count; i++) {
        text = tsuya_arena_printf(r->arena, "%s|%s", text, o->hold_out[i]);
    }
    if (!text || tsuya_step_begin(&r->steps, "stereo", text, tsuya_reconstruction_path(r, "dense/stereo/depth_maps"))) {
        return text ? TSUYA_OK : TSUYA_ERROR_MEMORY;
    }
    tsuya_stereo_info info;
    TSUYA_TRY(tsuya_stereo(&info, &options, r->context));
    tsuya_json *figures = tsuya_json_create_object();
    tsuya_stereo_info_to_json(figures, &info);
    return close_step(r, figures);
}

static tsuya_status fusion(tsuya_reconstruction *r)
{
    const char *path = tsuya_reconstruction_path(r, "cloud.ply");
    if (tsuya_step_begin(&r->steps, "fusion", "", path)) {
        return TSUYA_OK;
    }
    tsuya_fusion_options options = tsuya_fusion_options_default();
    options.workspace = tsuya_reconstruction_path(r, "dense");
    options.hold_out = r->options->hold_out;
    options.hold_out_count = r->options->hold_out_count;
    tsuya_mesh cloud = {0};
    tsuya_fusion_info info;
    TSUYA_TRY(tsuya_fusion(&cloud, &info, &options, r->context));
    tsuya_status status = tsuya_ply_save(&cloud, path, NULL);
    tsuya_mesh_free(&cloud);
    TSUYA_TRY(status);
    tsuya_json *figures = tsuya_json_create_object();
    tsuya_fusion_info_to_json(figures, &info);
    return close_step(r, figures);
}

static tsuya_status surface(tsuya_reconstruction *r)
{
    const char *path = tsuya_reconstruction_path(r, "surface.ply");
    if (tsuya_step_begin(&r->steps, "surface", tsuya_arena_printf(r->arena, "%.17g", r->precision.mesh_tolerance), path)) {
        return TSUYA_OK;
    }
    tsuya_mesh cloud = {0}, mesh = {0};
    tsuya_surface_info info;
    tsuya_surface_options options = tsuya_surface_options_default();
    options.tolerance = r->precision.mesh_tolerance;
    options.masks_workspace = r->options->masks ? tsuya_reconstruction_path(r, "dense") : NULL;
    tsuya_status status;
    TSUYA_GOTO_DONE(status, tsuya_ply_load(&cloud, tsuya_reconstruction_path(r, "cloud.ply")));
    TSUYA_GOTO_DONE(status, tsuya_surface_make(&mesh, &info, &cloud, &options, r->context));
    TSUYA_GOTO_DONE(status, tsuya_ply_save(&mesh, path, NULL));
    tsuya_json *figures = tsuya_json_create_object();
    tsuya_surface_info_to_json(figures, &info);
    status = close_step(r, figures);
done:
    tsuya_mesh_free(&cloud);
    tsuya_mesh_free(&mesh);
    return status;
}

static tsuya_status color(tsuya_reconstruction *r)
{
    const char *path = tsuya_reconstruction_path(r, "mesh.ply");
    if (tsuya_step_begin(&r->steps, "color", "", path)) {
        return TSUYA_OK;
    }
    tsuya_mesh mesh = {0};
    tsuya_silhouette_info silhouette = {0};
    tsuya_color_options options = tsuya_color_options_default();
    options.workspace = tsuya_reconstruction_path(r, "dense");
    options.hold_out = r->options->hold_out;
    options.hold_out_count = r->options->hold_out_count;
    tsuya_json *figures = tsuya_json_create_object();
    tsuya_status status;
    TSUYA_GOTO_DONE(status, tsuya_ply_load(&mesh, tsuya_reconstruction_path(r, "surface.ply")));
    TSUYA_GOTO_DONE(status, tsuya_mesh_color(&mesh, &options, r->context));
    TSUYA_GOTO_DONE(status, tsuya_ply_save(&mesh, path, NULL));
    if (r->options->masks) {
        TSUYA_GOTO_DONE(status, tsuya_silhouette(&silhouette, &mesh, options.workspace, r->context));
        tsuya_silhouette_info_to_json(figures, &silhouette);
    }
    tsuya_json_set_number(figures, "mesh_vertices", (double)mesh.vertex_count);
    tsuya_json_set_number(figures, "mesh_triangles", (double)mesh.triangle_count);
    status = tsuya_step_end(&r->steps, figures);
done:
    tsuya_json_free(figures);
    tsuya_silhouette_info_free(&silhouette);
    tsuya_mesh_free(&mesh);
    return status;
}

/* Of stereo, fusion and surface, all of which grow with the maps. */
static double dense_seconds(const tsuya_reconstruction *r)
{
    double sum = 0.0;
    for (int i = 0; i < r->steps.count; i++) {
        const tsuya_step *step = &r->steps.step[i];
        bool dense = strcmp(step->name, "stereo") == 0 || strcmp(step->name, "fusion") == 0 || strcmp(step->name, "surface") == 0;
        sum += dense ? step->seconds : 0.0;
    }
    return sum;
}

static tsuya_status collect(tsuya_reconstruction *r)
{
    tsuya_reconstruct_info *info = r->info;
    static const char *const PARTS[] = {"pinhole", "background", "features", "matching", "mapping", "scale", "stereo", "fusion", "surface", "color"};
    if (!(info->parts = tsuya_json_create_object())) {
        return TSUYA_ERROR_MEMORY;
    }
    for (size_t i = 0; i < sizeof PARTS / sizeof PARTS[0]; i++) {
        const tsuya_json *figures = tsuya_step_figures(&r->steps, PARTS[i]);
        if (figures) {
            tsuya_json_set_copy(info->parts, PARTS[i], figures);
        }
    }
    if (!(info->precision = tsuya_json_create_object())) {
        return TSUYA_ERROR_MEMORY;
    }
    tsuya_precision_to_json(info->precision, &r->precision, dense_seconds(r));
    info->scale_m_per_unit = figure(r, "scale", "scale_m_per_unit", NAN);
    info->scale_rms_m = figure(r, "scale", "scale_rms_m", NAN);
    info->points = (size_t)figure(r, "fusion", "points", 0);
    info->mesh_vertices = (size_t)figure(r, "color", "mesh_vertices", 0);
    info->mesh_triangles = (size_t)figure(r, "color", "mesh_triangles", 0);
    info->tolerance = figure(r, "surface", "tolerance", NAN);
    const tsuya_json *simplification = tsuya_json_member(tsuya_step_figures(&r->steps, "surface"), "simplification");
    info->simplification_max = tsuya_json_number_or(tsuya_json_member(simplification, "max"), NAN);
    info->silhouette_median = figure(r, "color", "iou_median", NAN);
    info->silhouette_min = figure(r, "color", "iou_min", NAN);
    info->silhouette_views = tsuya_json_count(tsuya_json_member(tsuya_step_figures(&r->steps, "color"), "views"));
    info->step_count = r->steps.count;
    memcpy(info->step, r->steps.step, sizeof info->step);
    for (int i = 0; i < info->step_count; i++) {
        info->peak_mb = fmax(info->peak_mb, info->step[i].peak_mb);
    }
    tsuya_json *figures = tsuya_json_create_object();
    tsuya_reconstruct_info_to_json(figures, info);
    tsuya_status status = tsuya_json_save(figures, tsuya_reconstruction_path(r, "reconstruct.json"));
    tsuya_json_free(figures);
    return status;
}

tsuya_status tsuya_reconstruct(tsuya_reconstruct_info *info, const tsuya_reconstruct_options *options, const tsuya_context *context)
{
    double start = tsuya_clock_s();
    tsuya_reconstruct_options own = *options;
    tsuya_reconstruction r = {.options = &own, .context = context, .info = info};
    tsuya_scale_input scale;
    tsuya_hash inputs;
    tsuya_status status;
    *info = (tsuya_reconstruct_info){.scale_m_per_unit = NAN, .scale_rms_m = NAN, .reprojection_px = NAN, .gsd = NAN,
                                     .calibrated = options->camera_model || options->poses};
    TSUYA_GOTO_DONE(status, tsuya_arena_create(&r.arena, 1 << 16));
    TSUYA_GOTO_DONE(status, tsuya_photo_set_load(&r.photos, options->photos, options->masks));
    info->photos = r.photos.count;
    TSUYA_GOTO_DONE(status, check_photos(&r.photos, options->photos));
    TSUYA_GOTO_DONE(status, tsuya_folder_make(options->output));
    TSUYA_GOTO_DONE(status, hash_inputs(&inputs, options));
    TSUYA_GOTO_DONE(status, tsuya_steps_load(&r.steps, options->output, inputs));
    TSUYA_GOTO_DONE(status, pinhole(&r, &own, &scale));
    TSUYA_GOTO_DONE(status, tsuya_colmap_create(&r.colmap, own.output, own.photos, context));
    snprintf(info->colmap_version, sizeof info->colmap_version, "%s", r.colmap.version);
    TSUYA_GOTO_DONE(status, background(&r, &own));
    TSUYA_GOTO_DONE(status, tsuya_sparse_steps(&r));
    TSUYA_GOTO_DONE(status, measure_sparse(&r));
    TSUYA_GOTO_DONE(status, stereo(&r));
    TSUYA_GOTO_DONE(status, fusion(&r));
    TSUYA_GOTO_DONE(status, surface(&r));
    TSUYA_GOTO_DONE(status, color(&r));
    info->seconds = tsuya_clock_s() - start;
    status = collect(&r);
done:
    tsuya_steps_free(&r.steps);
    tsuya_photo_set_free(&r.photos);
    tsuya_arena_free(r.arena);
    if (status != TSUYA_OK) {
        tsuya_reconstruct_info_free(info);
    }
    return status;
}

tsuya_status tsuya_reconstruct_cameras(tsuya_sparse_model *model, const char *output, const char *camera_model, const char *poses)
{
    tsuya_camera lens;
    tsuya_status status = TSUYA_OK;
    *model = (tsuya_sparse_model){0};
    char *path = tsuya_path_join(output, "sparse/0");
    TSUYA_GOTO_DONE(status, path ? TSUYA_OK : TSUYA_ERROR_MEMORY);
    TSUYA_GOTO_DONE(status, camera_model && !poses ? tsuya_cameramodel_load(&lens, NULL, camera_model) : TSUYA_OK);
    TSUYA_GOTO_DONE(status, tsuya_sparse_model_load(model, path));
    for (int c = 0; camera_model && !poses && tsuya_pinhole_needed(&lens) && c < model->camera_count; c++) {
        model->camera[c] = lens;
    }
done:
    tsuya_free(path);
    return status;
}

void tsuya_reconstruct_info_free(tsuya_reconstruct_info *info)
{
    tsuya_json_free(info->parts);
    tsuya_json_free(info->precision);
    info->parts = info->precision = NULL;
}

void tsuya_reconstruct_info_to_json(tsuya_json *object, const tsuya_reconstruct_info *info)
{
    bool metric = isfinite(info->scale_m_per_unit);
    tsuya_json_set_number(object, "registered", info->registered);
    tsuya_json_set_number(object, "photos", info->photos);
    tsuya_json_set_bool(object, "calibrated", info->calibrated);
    tsuya_json_set_number(object, "scale_m_per_unit", info->scale_m_per_unit);
    tsuya_json_set_number(object, "scale_rms_m", info->scale_rms_m);
    tsuya_json_set_number(object, "reprojection_px", info->reprojection_px);
    tsuya_json_set_number(object, "sparse_points", (double)info->sparse_points);
    tsuya_json_set_number(object, "points", (double)info->points);
    tsuya_json_set_number(object, "mesh_vertices", (double)info->mesh_vertices);
    tsuya_json_set_number(object, "mesh_triangles", (double)info->mesh_triangles);
    tsuya_json_set_number(object, "gsd_m", metric ? info->gsd : NAN);
    tsuya_json_set_number(object, "gsd_units", info->gsd);
    tsuya_json_set_null(object, "accuracy_m");
    tsuya_json_set_null(object, "completeness");
    tsuya_json_set_number(object, "dense_long_side_px", info->dense_long_side_px);
    tsuya_json_set_number(object, "tolerance_units", info->tolerance);
    tsuya_json_set_number(object, "simplification_max_units", info->simplification_max);
    tsuya_json_set_number(object, "models", info->models);
    tsuya_json *pairs = tsuya_json_set_object(object, "pairs");
    tsuya_json_set_number(pairs, "matched", info->pairs_matched);
    tsuya_json_set_number(pairs, "verified", info->pairs_verified);
    tsuya_json_set_number(pairs, "possible", info->pairs_possible);
    if (info->silhouette_views > 0) {
        tsuya_json *iou = tsuya_json_set_object(object, "silhouette_iou");
        tsuya_json_set_number(iou, "median", info->silhouette_median);
        tsuya_json_set_number(iou, "min", info->silhouette_min);
        tsuya_json_set_number(iou, "count", info->silhouette_views);
    }
    tsuya_json_set_text(object, "colmap", info->colmap_version);
    tsuya_json *stages = tsuya_json_set_object(object, "stages");
    for (int i = 0; i < info->step_count; i++) {
        const tsuya_step *step = &info->step[i];
        tsuya_json *entry = tsuya_json_set_object(stages, step->name);
        tsuya_json_set_number(entry, "seconds", step->seconds);
        tsuya_json_set_number(entry, "peak_mb", step->peak_mb);
        tsuya_json_set_bool(entry, "skipped", step->skipped);
    }
    if (info->precision) {
        tsuya_json_set_copy(object, "precision", info->precision);
    }
    if (info->parts) {
        tsuya_json_set_copy(object, "parts", info->parts);
    }
    tsuya_json_set_number(object, "seconds", info->seconds);
    tsuya_json_set_number(object, "peak_mb", info->peak_mb);
}
