#include "reconstruct/sparse_steps.h"

#include "core/colmap_lens.h"
#include "core/image.h"
#include "reconstruct/adjust.h"
#include "reconstruct/adjust_tags.h"
#include "reconstruct/database_adapter.h"
#include "reconstruct/groups.h"
#include "reconstruct/join.h"
#include "reconstruct/match_steps.h"
#include "reconstruct/poses.h"
#include "reconstruct/scale_step.h"
#include "reconstruct/undistort.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* From so many photographs of one lens on, COLMAP refines tangential distortion too. */
enum { ENOUGH_FOR_OPENCV = 10 };
/* Pixels a side at which two lenses are compared. */
enum { CONVERSION_GRID = 25 };
/* Features of a photograph: a small one has no more than this many pixels for each, so that threads in a close-up, all alike, do not crowd out its pattern. */
enum { FEATURES_MOST = 8192, FEATURES_LEAST = 1024, PIXELS_OF_FEATURE = 64 };

const char *tsuya_reconstruction_path(const tsuya_reconstruction *r, const char *name)
{
    const char *path = tsuya_arena_printf(r->arena, "%s/%s", r->options->output, name);
    return path ? path : "";
}

tsuya_status tsuya_reconstruction_end_step(tsuya_reconstruction *r, const tsuya_json *figures)
{
    r->steps.child_mb = r->colmap.peak_mb;
    r->colmap.peak_mb = 0.0;
    return tsuya_step_end(&r->steps, figures);
}

/* COLMAP wants masks as NAME.jpg.png. */
static tsuya_status link_masks(tsuya_reconstruction *r, const char **folder)
{
    *folder = NULL;
    if (!r->options->masks) {
        return TSUYA_OK;
    }
    *folder = tsuya_reconstruction_path(r, "masks");
    TSUYA_TRY(tsuya_folder_remove(*folder));
    TSUYA_TRY(tsuya_folder_make(*folder));
    for (int i = 0; i < r->photos.count; i++) {
        const tsuya_photo *photo = &r->photos.photo[i];
        if (!photo->mask_path) {
            tsuya_warn("%s: no mask; the whole photograph is used", photo->name);
            continue;
        }
        char *target = realpath(photo->mask_path, NULL);
        const char *link = tsuya_arena_printf(r->arena, "%s/%s.png", *folder, photo->name);
        int code = target && link ? symlink(target, link) : -1;
        free(target);
        if (code != 0) {
            return tsuya_fail_errno(photo->mask_path, "cannot be linked");
        }
    }
    return TSUYA_OK;
}

tsuya_status tsuya_reconstruction_camera(tsuya_camera *camera, const tsuya_reconstruction *r)
{
    TSUYA_TRY(tsuya_cameramodel_load(camera, NULL, r->options->camera_model));
    const tsuya_photo *first = &r->photos.photo[0];
    if (camera->width_px != first->width_px || camera->height_px != first->height_px) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: made for %d x %d pixels, the photographs have %d x %d", r->options->camera_model,
                          camera->width_px, camera->height_px, first->width_px, first->height_px);
    }
    return TSUYA_OK;
}

/* The given model with the database's ids and no points; its lenses written into the database. */
static tsuya_status adopt_poses(tsuya_reconstruction *r, const char *output)
{
    const char *base = tsuya_reconstruction_path(r, "database.db");
    tsuya_sparse_model model = {0};
    tsuya_database database = {0};
    tsuya_status status;
    TSUYA_GOTO_DONE(status, tsuya_poses_load(&model, r->options->poses, &r->photos));
    TSUYA_GOTO_DONE(status, tsuya_database_load(&database, base));
    for (int c = 0; c < model.camera_count; c++) {
        if (c == 0 && database.image_count > 0) {
            model.camera_id[c] = database.image[0].camera_id;
            TSUYA_GOTO_DONE(status, tsuya_database_set_camera(base, model.camera_id[c], &model.camera[c]));
        } else {
            TSUYA_GOTO_DONE(status, tsuya_database_add_camera(&model.camera_id[c], base, &model.camera[c]));
        }
    }
    int kept = 0;
    for (int v = 0; v < model.view_count; v++) {
        tsuya_view *view = &model.view[v];
        int found = -1;
        for (int i = 0; i < database.image_count; i++) {
            found = strcmp(database.image[i].name, view->name) == 0 ? i : found;
        }
        const tsuya_camera *camera = &model.camera[view->camera];
        if (found >= 0 && (camera->width_px != r->photos.photo[0].width_px || camera->height_px != r->photos.photo[0].height_px)) {
            status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: the camera of %s is for %d x %d pixels, the photograph has %d x %d", r->options->poses, view->name,
                                camera->width_px, camera->height_px, r->photos.photo[0].width_px, r->photos.photo[0].height_px);
            goto done;
        }
        tsuya_free(view->observation);
        view->observation = NULL;
        view->observation_count = 0;
        if (found < 0) {
            tsuya_warn("%s: its photograph %s does not exist and is passed over", r->options->poses, view->name);
            tsuya_free(view->name);
            *view = (tsuya_view){0};
            continue;
        }
        view->image_id = database.image[found].image_id;
        view->camera_id = model.camera_id[view->camera];
        if (view->camera > 0) {
            TSUYA_GOTO_DONE(status, tsuya_database_assign_camera(base, view->image_id, view->camera_id));
        }
        tsuya_view moved = *view;
        *view = (tsuya_view){0}; /* whatever fails later frees it once */
        model.view[kept++] = moved;
    }
    model.view_count = kept;
    for (size_t i = 0; i < model.point_count; i++) {
        tsuya_free(model.point[i].track);
    }
    model.point_count = 0;
    status = kept < 3 ? tsuya_fail(TSUYA_ERROR_INPUT, "%s: has poses for %d of the photographs; at least 3 are needed", r->options->poses, kept)
                      : tsuya_sparse_model_save_binary(&model, output);
done:
    tsuya_sparse_model_free(&model);
    tsuya_database_free(&database);
    return status;
}

/* How far a pixel moves from the given lens to the one that COLMAP gets, over a grid. */
static tsuya_status measure_conversion(double *most_px, const tsuya_camera *camera)
{
    double p[12] = {0};
    const tsuya_colmap_lens *lens = tsuya_colmap_parameters(p, camera);
    tsuya_camera converted = {.width_px = camera->width_px, .height_px = camera->height_px};
    *most_px = 0.0;
    if (!lens) {
        return TSUYA_ERROR_INPUT;
    }
    tsuya_colmap_camera(&converted, lens, p);
    for (int k = 0; k < CONVERSION_GRID * CONVERSION_GRID; k++) {
        tsuya_vec2 pixel = {(k % CONVERSION_GRID + 0.5) * camera->width_px / CONVERSION_GRID - 0.5,
                            (k / CONVERSION_GRID + 0.5) * camera->height_px / CONVERSION_GRID - 0.5}, there;
        tsuya_vec3 ray;
        if (tsuya_camera_unproject(camera, pixel, &ray) && tsuya_camera_project(&converted, ray, &there)) {
            *most_px = fmax(*most_px, hypot(there.x - pixel.x, there.y - pixel.y));
        }
    }
    return TSUYA_OK;
}

static tsuya_status features(tsuya_reconstruction *r)
{
    tsuya_lens lens = r->photos.count >= ENOUGH_FOR_OPENCV ? TSUYA_LENS_OPENCV4 : TSUYA_LENS_SIMPLE_RADIAL;
    const tsuya_photo *first = &r->photos.photo[0];
    const double share = (double)first->width_px * first->height_px / PIXELS_OF_FEATURE;
    const int most = (int)fmin(fmax(share, FEATURES_LEAST), FEATURES_MOST);
    const char *how = tsuya_arena_printf(r->arena, "%s, by name, zeroed, %d", lens == TSUYA_LENS_OPENCV4 ? "opencv4" : "simple_radial", most);
    if (!how || tsuya_step_begin(&r->steps, "features", how, tsuya_reconstruction_path(r, "database.db"))) {
        return how ? TSUYA_OK : TSUYA_ERROR_MEMORY;
    }
    const char *masks;
    tsuya_camera camera;
    TSUYA_TRY(link_masks(r, &masks));
    const bool given = r->options->camera_model && !r->options->poses; /* poses come with their own */
    TSUYA_TRY(given ? tsuya_reconstruction_camera(&camera, r) : TSUYA_OK);
    TSUYA_TRY(tsuya_colmap_features(&r->colmap, masks, given ? &camera : NULL, lens, most));
    TSUYA_TRY(tsuya_database_sort_images(tsuya_reconstruction_path(r, "database.db")));
    if (r->options->poses) {
        TSUYA_TRY(adopt_poses(r, tsuya_reconstruction_path(r, "posed")));
    }
    double moved_px = 0.0;
    TSUYA_TRY(given ? measure_conversion(&moved_px, &camera) : TSUYA_OK);
    tsuya_json *figures = tsuya_json_create_object();
    tsuya_json_set_number(figures, "most", most);
    if (given) {
        tsuya_json_set_number(figures, "lens_conversion_px", moved_px);
    }
    tsuya_status status = figures ? tsuya_reconstruction_end_step(r, figures) : TSUYA_ERROR_MEMORY;
    tsuya_json_free(figures);
    return status;
}

/* Says which photographs the kept model lacks. */
static void report_missing(const tsuya_reconstruction *r, const tsuya_sparse_model *model, const char *where)
{
    char names[512] = "";
    int missing = 0;
    for (int i = 0; i < r->photos.count; i++) {
        if (tsuya_sparse_model_find(model, r->photos.photo[i].name) < 0) {
            missing++;
            size_t used = strlen(names);
            snprintf(names + used, sizeof names - used, "%s%s", used ? ", " : "", r->photos.photo[i].name);
        }
    }
    if (missing > 0) {
        tsuya_warn("%d of %d photographs could not be registered%s: %s", missing, r->photos.count, where, names);
    }
}

enum { MODELS_MOST = 64 };

static tsuya_status load_models(tsuya_sparse_model model[MODELS_MOST], int *count, const tsuya_reconstruction *r)
{
    for (*count = 0; *count < MODELS_MOST; (*count)++) {
        const char *folder = tsuya_arena_printf(r->arena, "%s/mapped/%d", r->options->output, *count);
        if (!folder || !tsuya_path_exists(folder)) {
            break;
        }
        TSUYA_TRY(tsuya_sparse_model_load(&model[*count], folder));
    }
    return *count > 0 ? TSUYA_OK
                      : tsuya_fail(TSUYA_ERROR_INPUT, "%s: no two photographs overlap enough to begin; take more photographs with at least 60 %% overlap",
                                   r->options->photos);
}

/* What was moved by tags finds, by its features, the points of the others. */
static tsuya_status triangulate_anew(tsuya_sparse_model *model, tsuya_reconstruction *r)
{
    TSUYA_TRY(tsuya_folder_make(tsuya_reconstruction_path(r, "placed")));
    TSUYA_TRY(tsuya_sparse_model_save_binary(model, tsuya_reconstruction_path(r, "placed")));
    TSUYA_TRY(tsuya_colmap_triangulate(&r->colmap, "placed", "placed/points"));
    tsuya_sparse_model_free(model);
    TSUYA_TRY(tsuya_sparse_model_load(model, tsuya_reconstruction_path(r, "placed/points")));
    return tsuya_folder_remove(tsuya_reconstruction_path(r, "placed"));
}

/* Groups and photographs that features do not place, but tags do.  Groups that remain close up behind the kept one, which comes first. */
static tsuya_status place_by_tags(tsuya_sparse_model *model, int *count, tsuya_reconstruction *r, const tsuya_database *database, tsuya_json *figures)
{
    int joined = 0, placed = 0, left = 1;
    for (int m = 1; m < *count; m++) {
        int came;
        TSUYA_TRY(tsuya_models_join(&model[0], &came, &model[m], r->options->scale));
        joined += came;
        if (came > 0) {
            tsuya_sparse_model_free(&model[m]);
        } else {
            tsuya_sparse_model own = model[m];
            model[m] = (tsuya_sparse_model){0};
            model[left++] = own;
        }
    }
    *count = left;
    TSUYA_TRY(tsuya_tags_place(&model[0], &placed, database, r->options->scale));
    tsuya_json_set_number(figures, "joined_by_tags", joined);
    tsuya_json_set_number(figures, "placed_by_tags", placed);
    return joined + placed > 0 ? triangulate_anew(&model[0], r) : TSUYA_OK;
}

/* TIE_MOST_PX: farther off, the dense step would look for a photograph's pixels in the wrong place; fusion asks for 1.5. */
static const double TIE_MOST_PX = 1.0;

/* Leaves out photographs whose pose is known too badly to be of use, and says so; not where that is so for most. */
static tsuya_status leave_out_loose(tsuya_sparse_model *model, const tsuya_tie *tie, tsuya_json *figures)
{
    tsuya_status status = TSUYA_OK;
    bool *drop;
    int loose = 0;
    TSUYA_NEW(status, drop, (size_t)model->view_count + 1);
    for (int v = 0; v < model->view_count; v++) {
        drop[v] = tsuya_tie_px(&tie[v]) > TIE_MOST_PX;
        loose += drop[v];
    }
    const bool leave = 2 * loose < model->view_count && model->view_count - loose >= 3;
    tsuya_json *list = tsuya_json_set_array(figures, "loose");
    for (int v = 0; v < model->view_count; v++) {
        if (drop[v]) {
            tsuya_json *entry = tsuya_json_add_object(list);
            tsuya_json_set_text(entry, "photo", model->view[v].name);
            tsuya_json_set_number(entry, "observations", tie[v].observations);
            tsuya_json_set_number(entry, "tie_px", tsuya_tie_px(&tie[v]));
            tsuya_warn("%s: its %d points tie it to the others to %.1f px only%s", model->view[v].name, tie[v].observations, tsuya_tie_px(&tie[v]),
                       leave ? "; it is left out" : "");
        }
    }
    if (loose > 0 && leave) {
        status = tsuya_views_drop(model, drop);
    }
done:
    tsuya_free(drop);
    return status;
}

static void adjusted_to_json(tsuya_json *figures, const tsuya_adjust_info *adjusted)
{
    tsuya_json_set_number(figures, "observations", (double)adjusted->observations);
    tsuya_json_set_number(figures, "observations_of_tags", (double)adjusted->tag_observations);
    tsuya_json_set_number(figures, "observations_kept", (double)adjusted->kept);
    tsuya_json_set_number(figures, "feature_sigma_px", adjusted->sigma_px);
    if (adjusted->tag_observations > 0) {
        tsuya_json_set_number(figures, "tag_sigma_px", adjusted->tag_sigma_px);
    }
    tsuya_json_set_number(figures, "adjustments", adjusted->rounds);
}

/* The mapper's model with most photographs, as sparse/0; the others are named, and where they would join it. */
static tsuya_status keep_largest(tsuya_reconstruction *r, tsuya_json *figures)
{
    tsuya_sparse_model model[MODELS_MOST] = {0};
    tsuya_database database = {0};
    tsuya_adjust_info adjusted;
    tsuya_tie *tie = NULL;
    tsuya_status status;
    int count = 0, kept = 0;
    TSUYA_GOTO_DONE(status, load_models(model, &count, r));
    for (int m = 1; m < count; m++) {
        kept = model[m].view_count > model[kept].view_count ? m : kept;
    }
    tsuya_sparse_model largest = model[kept];
    model[kept] = model[0];
    model[0] = largest;
    tsuya_json_set_number(figures, "models", count);
    TSUYA_GOTO_DONE(status, tsuya_database_load(&database, tsuya_reconstruction_path(r, "database.db")));
    if (r->options->scale && model[0].view_count < r->photos.count) {
        TSUYA_GOTO_DONE(status, place_by_tags(model, &count, r, &database, figures));
    }
    if (count > 1) {
        TSUYA_GOTO_DONE(status, tsuya_groups_report(tsuya_json_set_array(figures, "groups"), model, count, 0, &database, &r->photos, r->context));
    }
    report_missing(r, &model[0], count > 1 ? " with the largest group" : "");
    TSUYA_NEW(status, tie, (size_t)model[0].view_count + 1);
    TSUYA_GOTO_DONE(status, tsuya_adjust(&model[0], &adjusted, tie, &r->colmap, r->options->camera_model != NULL, r->options->scale));
    adjusted_to_json(figures, &adjusted);
    TSUYA_GOTO_DONE(status, leave_out_loose(&model[0], tie, figures));
    status = tsuya_sparse_model_save_binary(&model[0], tsuya_scale_unscaled(r));
done:
    for (int m = 0; m < MODELS_MOST; m++) {
        tsuya_sparse_model_free(&model[m]);
    }
    tsuya_database_free(&database);
    tsuya_free(tie);
    return status;
}

/* COLMAP's mapper exits with 1 when no pair can begin; that is no fault of its own. */
static tsuya_status explain_mapper(const tsuya_reconstruction *r, tsuya_status status)
{
    if (status == TSUYA_ERROR_CHILD && !tsuya_path_exists(tsuya_reconstruction_path(r, "mapped/0")) && strstr(tsuya_reason(), "exited with 1")) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: no two photographs overlap enough to begin; take more photographs with at least 60 %% overlap",
                          r->options->photos);
    }
    return status;
}

static tsuya_status mapping(tsuya_reconstruction *r)
{
    const char *how = "adjusted, centre freed last, loose ones out, groups joined";
    if (r->options->scale && r->options->scale->tag_count > 0) {
        tsuya_hash tags;
        TSUYA_TRY(tsuya_scale_hash(&tags, r->options->scale));
        how = tsuya_arena_printf(r->arena, "%s, tags %s", how, tags.hex);
    }
    if (!how || tsuya_step_begin(&r->steps, "mapping", how, tsuya_arena_printf(r->arena, "%s/points3D.bin", tsuya_scale_unscaled(r)))) {
        return how ? TSUYA_OK : TSUYA_ERROR_MEMORY;
    }
    tsuya_json *figures = tsuya_json_create_object();
    tsuya_status status;
    TSUYA_GOTO_DONE(status, explain_mapper(r, tsuya_colmap_map(&r->colmap, "mapped", r->options->camera_model != NULL)));
    TSUYA_GOTO_DONE(status, keep_largest(r, figures));
    status = tsuya_reconstruction_end_step(r, figures);
done:
    tsuya_json_free(figures);
    return status;
}

static tsuya_status triangulation(tsuya_reconstruction *r)
{
    if (tsuya_step_begin(&r->steps, "triangulation", "", tsuya_arena_printf(r->arena, "%s/points3D.bin", tsuya_scale_unscaled(r)))) {
        return TSUYA_OK;
    }
    TSUYA_TRY(tsuya_colmap_triangulate(&r->colmap, "posed", r->options->scale ? "unscaled" : "sparse/0"));
    tsuya_sparse_model model;
    TSUYA_TRY(tsuya_sparse_model_load(&model, tsuya_scale_unscaled(r)));
    report_missing(r, &model, " (they have no pose)");
    tsuya_sparse_model_free(&model);
    return tsuya_reconstruction_end_step(r, NULL);
}

/* COLMAP does not look whether what it writes arrives: on a full disk it ends well and leaves halves behind. */
static tsuya_status check_undistorted(const tsuya_sparse_model *dense, const char *workspace)
{
    tsuya_status status = TSUYA_OK;
    for (int v = 0; status == TSUYA_OK && v < dense->view_count; v++) {
        tsuya_image image = {0};
        char path[4096];
        snprintf(path, sizeof path, "%s/images/%s", workspace, dense->view[v].name);
        TSUYA_TRY(tsuya_check_interrupt());
        if (tsuya_image_load(&image, path) != TSUYA_OK) {
            status = tsuya_fail(TSUYA_ERROR_CHILD, "%s: colmap image_undistorter left it out or unfinished; is the disk full?", path);
        }
        tsuya_image_free(&image);
    }
    return status;
}

static tsuya_status undistortion(tsuya_reconstruction *r)
{
    const char *workspace = tsuya_reconstruction_path(r, "dense"), *how = r->options->masks ? "masks" : "";
    tsuya_sparse_model sparse = {0}, dense = {0};
    tsuya_status status;
    TSUYA_GOTO_DONE(status, tsuya_sparse_model_load(&sparse, tsuya_reconstruction_path(r, "sparse/0")));
    double scale = tsuya_undistort_scale(&sparse);
    how = scale > 0.0 ? tsuya_arena_printf(r->arena, "%s, %.2f", how, scale) : how;
    TSUYA_GOTO_DONE(status, how ? TSUYA_OK : TSUYA_ERROR_MEMORY);
    if (tsuya_step_begin(&r->steps, "undistortion", how, tsuya_reconstruction_path(r, "dense/sparse/images.bin"))) {
        goto done;
    }
    TSUYA_GOTO_DONE(status, tsuya_folder_remove(workspace));
    TSUYA_GOTO_DONE(status, tsuya_folder_make(workspace));
    TSUYA_GOTO_DONE(status, tsuya_colmap_undistort(&r->colmap, "sparse/0", "dense", scale));
    TSUYA_GOTO_DONE(status, tsuya_sparse_model_load(&dense, tsuya_reconstruction_path(r, "dense/sparse")));
    TSUYA_GOTO_DONE(status, check_undistorted(&dense, workspace));
    if (r->options->masks) {
        TSUYA_GOTO_DONE(status, tsuya_undistort_masks(workspace, &dense, &sparse, &r->photos, r->context));
    }
    status = tsuya_reconstruction_end_step(r, NULL);
done:
    tsuya_sparse_model_free(&sparse);
    tsuya_sparse_model_free(&dense);
    return status;
}

tsuya_status tsuya_sparse_steps(tsuya_reconstruction *r)
{
    TSUYA_TRY(features(r));
    TSUYA_TRY(tsuya_match_step(r));
    if (r->options->poses) {
        TSUYA_TRY(triangulation(r));
    } else {
        TSUYA_TRY(mapping(r));
    }
    r->info->models = (int)tsuya_json_number_or(tsuya_json_member(tsuya_step_figures(&r->steps, "mapping"), "models"), 1);
    TSUYA_TRY(tsuya_scale_step(r));
    return undistortion(r);
}
