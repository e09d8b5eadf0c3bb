#include "reconstruct/stereo.h"

#include "core/file.h"
#include "reconstruct/prior.h"
#include "reconstruct/stereo_cache.h"
#include "reconstruct/stereo_views.h"

#include <string.h>

/* Raised whenever the maps of the same inputs change. */
static const char *const stereo_version = "tsuya stereo 3", *const prior_version = "tsuya prior 1";

enum { LEVELS = 3 };

tsuya_stereo_options tsuya_stereo_options_default(void)
{
    return (tsuya_stereo_options){.source_views = 5, .geometric = true, .prior = true, .cache_mb = 1024};
}

typedef struct run {
    const tsuya_stereo_options *options;
    const tsuya_context *context;
    tsuya_patchmatch_options patchmatch;
    tsuya_stereo_info *info;
    tsuya_sparse_model model;
    tsuya_view_plan *plan;
    tsuya_stereo_cache *cache;
    tsuya_arena *arena;
    tsuya_hash *content;     /* of each view: photograph, mask, camera, pose */
    tsuya_hash *photometric, *final; /* stamps of the first pass, and of the one whose maps the prior starts from */
    double masked_pixels, covered_pixels, open_pixels, closed_pixels;
    int done, total;
} run;

/* ---- stamps ---- */

static tsuya_status view_content(tsuya_hash *out, const run *r, int view)
{
    const tsuya_view *v = &r->model.view[view];
    tsuya_camera camera;
    TSUYA_TRY(tsuya_map_camera(&camera, &r->model, view, r->options->long_side_px, r->options->workspace));
    const double numbers[6] = {camera.width_px, camera.height_px, camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px};
    char *image = tsuya_arena_printf(r->arena, "%s/images/%s", r->options->workspace, v->name);
    char *mask = tsuya_arena_printf(r->arena, "%s/masks/%s.png", r->options->workspace, v->name);
    if (!image || !mask) {
        return TSUYA_ERROR_MEMORY;
    }
    tsuya_hasher *h;
    TSUYA_TRY(tsuya_hasher_create(&h));
    tsuya_hasher_add(h, numbers, sizeof numbers);
    tsuya_hasher_add(h, &v->camera_from_world, sizeof v->camera_from_world);
    tsuya_status status = tsuya_hasher_add_file(h, image);
    if (status == TSUYA_OK && tsuya_path_exists(mask)) {
        status = tsuya_hasher_add_file(h, mask);
    }
    *out = tsuya_hasher_end(h);
    return status;
}

/* The filter's thresholds count only where it runs. */
static void add_patchmatch_options(tsuya_hasher *h, const run *r, bool filter)
{
    const tsuya_patchmatch_options *o = &r->patchmatch;
    const double solve[] = {
        o->coarse_to_fine, o->view_selection, o->coarse_iterations, o->fine_iterations, o->geometric_iterations,
        o->sigma_color, filter, LEVELS, (double)(r->context->seed >> 32), (double)(r->context->seed & 0xFFFFFFFFu),
    };
    const double thresholds[] = {
        o->max_cost, o->min_contrast, o->min_roughness, o->max_reprojection_px, o->max_depth_error, o->min_consistent,
        o->min_component_px,
    };
    tsuya_hasher_add_text(h, stereo_version);
    tsuya_hasher_add(h, solve, sizeof solve);
    tsuya_hasher_add(h, thresholds, filter ? sizeof thresholds : 0);
}

/* Of a view's map: everything it is computed from.  The geometric one adds the first pass of the view and its sources. */
static tsuya_status map_stamp(tsuya_hash *out, const run *r, int view, bool geometric)
{
    const tsuya_view_plan *plan = &r->plan[view];
    const double range[2] = {plan->depth_min, plan->depth_max};
    tsuya_hasher *h;
    TSUYA_TRY(tsuya_hasher_create(&h));
    add_patchmatch_options(h, r, geometric || !r->options->geometric);
    tsuya_hasher_add(h, range, sizeof range);
    tsuya_hasher_add_text(h, r->content[view].hex);
    for (int k = 0; k < plan->source_count; k++) {
        tsuya_hasher_add_text(h, r->content[plan->source[k]].hex);
    }
    for (int k = -1; k < plan->source_count && geometric; k++) {
        tsuya_hasher_add_text(h, r->photometric[k < 0 ? view : plan->source[k]].hex);
    }
    *out = tsuya_hasher_end(h);
    return TSUYA_OK;
}

/* Of a view's prior: its map, and those of its sources, which may contradict. */
static tsuya_status prior_stamp(tsuya_hash *out, const run *r, int view)
{
    const tsuya_view_plan *plan = &r->plan[view];
    const tsuya_prior_options o = tsuya_prior_options_default();
    const double options[] = {o.min_gap_px, o.least_rim, o.max_parting, (double)o.max_edge};
    tsuya_hasher *h;
    TSUYA_TRY(tsuya_hasher_create(&h));
    tsuya_hasher_add_text(h, prior_version);
    tsuya_hasher_add(h, options, sizeof options);
    for (int k = -1; k < plan->source_count; k++) {
        tsuya_hasher_add_text(h, r->final[k < 0 ? view : plan->source[k]].hex);
    }
    *out = tsuya_hasher_end(h);
    return TSUYA_OK;
}

static const char *kind_name(bool geometric) { return geometric ? "geometric" : "photometric"; }

static char *stamp_path(const run *r, int view, const char *kind)
{
    char suffix[32];
    snprintf(suffix, sizeof suffix, ".%s.txt", kind);
    return tsuya_map_path(r->options->workspace, "stamps", r->model.view[view].name, suffix);
}

static bool is_finished(const run *r, int view, const char *kind, const tsuya_hash *stamp)
{
    char *path = stamp_path(r, view, kind), *text = NULL;
    size_t size = 0;
    bool same = path && tsuya_path_exists(path) && tsuya_file_load(&text, &size, path, 256) == TSUYA_OK &&
                strncmp(text, stamp->hex, 32) == 0 &&
                tsuya_map_exists(r->options->workspace, r->model.view[view].name, kind);
    tsuya_free(text);
    tsuya_free(path);
    return same;
}

static tsuya_status finish(const run *r, int view, const char *kind, const tsuya_depth_map *map, const tsuya_hash *stamp)
{
    TSUYA_TRY(tsuya_map_save(map, r->options->workspace, r->model.view[view].name, kind));
    char *path = stamp_path(r, view, kind);
    char *folder = path ? tsuya_path_folder(path) : NULL;
    tsuya_status status = folder ? tsuya_folder_make(folder) : TSUYA_ERROR_MEMORY;
    if (status == TSUYA_OK) {
        status = tsuya_file_write(path, stamp->hex, 32);
    }
    tsuya_free(folder);
    tsuya_free(path);
    return status;
}

/* ---- one map ---- */

static void count_pixels(run *r, const tsuya_depth_map *map, const uint8_t *mask, bool geometric)
{
    const size_t pixels = (size_t)map->width_px * (size_t)map->height_px;
    double inside = 0, covered = 0;
    for (size_t i = 0; i < pixels; i++) {
        inside += !mask || mask[i];
        covered += map->depth[i] > 0.0f;
    }
    r->info->width_px = map->width_px > r->info->width_px ? map->width_px : r->info->width_px;
    r->info->height_px = map->height_px > r->info->height_px ? map->height_px : r->info->height_px;
    if (geometric == r->options->geometric) {
        r->masked_pixels += inside;
        r->covered_pixels += covered;
    }
}

static tsuya_status solve_view(run *r, int view, bool geometric, const tsuya_hash *stamp)
{
    const tsuya_view_plan *plan = &r->plan[view];
    const char *workspace = r->options->workspace;
    const tsuya_stereo_image *image[1 + TSUYA_STEREO_MAX_SOURCES];
    tsuya_patchmatch_source source[TSUYA_STEREO_MAX_SOURCES];
    tsuya_depth_map neighbour[TSUYA_STEREO_MAX_SOURCES] = {{0}}, start = {0}, map = {0};
    int views[1 + TSUYA_STEREO_MAX_SOURCES] = {view};
    uint8_t *mask = NULL;
    tsuya_camera camera;
    tsuya_status status = TSUYA_OK;
    memcpy(views + 1, plan->source, (size_t)plan->source_count * sizeof *views);
    TSUYA_GOTO_DONE(status, tsuya_map_camera(&camera, &r->model, view, r->options->long_side_px, workspace));
    TSUYA_GOTO_DONE(status, tsuya_map_mask_load(&mask, workspace, r->model.view[view].name, &camera));
    TSUYA_GOTO_DONE(status, tsuya_stereo_cache_get(image, r->cache, views, 1 + plan->source_count));
    for (int k = 0; k < plan->source_count; k++) {
        if (geometric) {
            const char *name = r->model.view[plan->source[k]].name;
            TSUYA_GOTO_DONE(status, tsuya_map_load(&neighbour[k], workspace, name, "photometric", false));
        }
        source[k] = (tsuya_patchmatch_source){image[1 + k], neighbour[k].depth};
    }
    if (geometric) {
        TSUYA_GOTO_DONE(status, tsuya_map_load(&start, workspace, r->model.view[view].name, "photometric", true));
    }
    tsuya_patchmatch_problem problem = {
        .reference = image[0], .mask = mask, .source = source, .source_count = plan->source_count,
        .depth_min = plan->depth_min, .depth_max = plan->depth_max, .start = geometric ? &start : NULL,
        .geometric = geometric, .filter = geometric || !r->options->geometric,
    };
    TSUYA_GOTO_DONE(status, tsuya_patchmatch(&map, &problem, &r->patchmatch, r->context));
    TSUYA_GOTO_DONE(status, finish(r, view, kind_name(geometric), &map, stamp));
    count_pixels(r, &map, mask, geometric);
done:
    for (int k = 0; k < TSUYA_STEREO_MAX_SOURCES; k++) {
        tsuya_depth_map_free(&neighbour[k]);
    }
    tsuya_depth_map_free(&start);
    tsuya_depth_map_free(&map);
    tsuya_free(mask);
    return status;
}

static tsuya_status run_pass(run *r, bool geometric)
{
    double began = tsuya_clock_s();
    for (int v = 0; v < r->model.view_count; v++) {
        tsuya_hash stamp;
        if (!r->plan[v].used) {
            continue;
        }
        TSUYA_TRY(tsuya_check_interrupt());
        tsuya_progress_update(r->context, geometric ? "stereo, geometric" : "stereo", r->done++, r->total,
                              r->model.view[v].name);
        TSUYA_TRY(map_stamp(&stamp, r, v, geometric));
        if (!geometric) {
            r->photometric[v] = stamp;
        }
        if (geometric == r->options->geometric) {
            r->final[v] = stamp;
        }
        if (is_finished(r, v, kind_name(geometric), &stamp)) {
            r->info->maps_resumed++;
        } else {
            TSUYA_TRY(solve_view(r, v, geometric, &stamp));
        }
    }
    *(geometric ? &r->info->seconds_geometric : &r->info->seconds_photometric) = tsuya_clock_s() - began;
    return TSUYA_OK;
}

/* ---- the prior ---- */

static void count_closed(run *r, const tsuya_depth_map *map, const tsuya_depth_map *prior, const uint8_t *mask)
{
    const size_t pixels = (size_t)map->width_px * (size_t)map->height_px;
    for (size_t i = 0; i < pixels; i++) {
        r->open_pixels += (!mask || mask[i]) && !(map->depth[i] > 0.0f);
        r->closed_pixels += prior->depth[i] > 0.0f;
    }
}

static tsuya_status close_view(run *r, int view, const tsuya_hash *stamp)
{
    const tsuya_view_plan *plan = &r->plan[view];
    const char *workspace = r->options->workspace, *kind = kind_name(r->options->geometric), *name = r->model.view[view].name;
    const tsuya_stereo_image *image[1 + TSUYA_STEREO_MAX_SOURCES];
    const tsuya_prior_options options = tsuya_prior_options_default();
    tsuya_depth_map map = {0}, prior = {0}, other = {0};
    int views[1 + TSUYA_STEREO_MAX_SOURCES] = {view};
    uint8_t *mask = NULL;
    tsuya_camera camera;
    tsuya_status status = TSUYA_OK;
    memcpy(views + 1, plan->source, (size_t)plan->source_count * sizeof *views);
    TSUYA_GOTO_DONE(status, tsuya_map_camera(&camera, &r->model, view, r->options->long_side_px, workspace));
    TSUYA_GOTO_DONE(status, tsuya_map_mask_load(&mask, workspace, name, &camera));
    TSUYA_GOTO_DONE(status, tsuya_map_load(&map, workspace, name, kind, true));
    TSUYA_GOTO_DONE(status, tsuya_stereo_cache_get(image, r->cache, views, 1 + plan->source_count));
    tsuya_prior_problem problem = {.reference = image[0], .mask = mask, .map = &map, .depth_min = plan->depth_min, .depth_max = plan->depth_max};
    TSUYA_GOTO_DONE(status, tsuya_prior(&prior, &problem, &options, r->context));
    for (int k = 0; k < plan->source_count; k++) {
        TSUYA_GOTO_DONE(status, tsuya_map_load(&other, workspace, r->model.view[plan->source[k]].name, kind, false));
        tsuya_prior_drop_contradicted(&prior, image[0], image[1 + k], other.depth, r->context);
        tsuya_depth_map_free(&other);
    }
    TSUYA_GOTO_DONE(status, finish(r, view, "prior", &prior, stamp));
    count_closed(r, &map, &prior, mask);
done:
    tsuya_depth_map_free(&map);
    tsuya_depth_map_free(&prior);
    tsuya_depth_map_free(&other);
    tsuya_free(mask);
    return status;
}

static tsuya_status run_prior(run *r)
{
    double began = tsuya_clock_s();
    for (int v = 0; v < r->model.view_count; v++) {
        tsuya_hash stamp;
        if (!r->plan[v].used) {
            continue;
        }
        TSUYA_TRY(tsuya_check_interrupt());
        tsuya_progress_update(r->context, "stereo, gaps", r->done++, r->total, r->model.view[v].name);
        TSUYA_TRY(prior_stamp(&stamp, r, v));
        if (is_finished(r, v, "prior", &stamp)) {
            r->info->maps_resumed++;
        } else {
            TSUYA_TRY(close_view(r, v, &stamp));
        }
    }
    r->info->seconds_prior = tsuya_clock_s() - began;
    return TSUYA_OK;
}

/* ---- COLMAP's lists ---- */

static tsuya_status write_lists(const run *r)
{
    char *folder = tsuya_arena_printf(r->arena, "%s/stereo", r->options->workspace);
    char *match = tsuya_arena_printf(r->arena, "%s/stereo/patch-match.cfg", r->options->workspace);
    char *fusion = tsuya_arena_printf(r->arena, "%s/stereo/fusion.cfg", r->options->workspace);
    tsuya_file_writer match_writer = {0}, fusion_writer = {0};
    tsuya_status status = folder && match && fusion ? tsuya_folder_make(folder) : TSUYA_ERROR_MEMORY;
    if (status != TSUYA_OK) {
        return status;
    }
    TSUYA_GOTO_DONE(status, tsuya_file_begin(&match_writer, match));
    TSUYA_GOTO_DONE(status, tsuya_file_begin(&fusion_writer, fusion));
    for (int v = 0; v < r->model.view_count; v++) {
        if (!r->plan[v].used) {
            continue;
        }
        fprintf(fusion_writer.stream, "%s\n", r->model.view[v].name);
        fprintf(match_writer.stream, "%s\n", r->model.view[v].name);
        for (int k = 0; k < r->plan[v].source_count; k++) {
            fprintf(match_writer.stream, "%s%s", k ? ", " : "", r->model.view[r->plan[v].source[k]].name);
        }
        fprintf(match_writer.stream, "\n");
    }
    TSUYA_GOTO_DONE(status, tsuya_file_commit(&match_writer));
    TSUYA_GOTO_DONE(status, tsuya_file_commit(&fusion_writer));
done:
    tsuya_file_abort(&match_writer);
    tsuya_file_abort(&fusion_writer);
    return status;
}

/* ---- the stage ---- */

static tsuya_status prepare(run *r)
{
    const tsuya_stereo_options *o = r->options;
    char *sparse = tsuya_arena_printf(r->arena, "%s/sparse", o->workspace);
    if (!sparse) {
        return TSUYA_ERROR_MEMORY;
    }
    TSUYA_TRY(tsuya_sparse_model_load(&r->model, sparse));
    TSUYA_TRY(tsuya_view_plans_make(&r->plan, &r->model, o->hold_out, o->hold_out_count, o->source_views, o->workspace,
                                    r->arena));
    tsuya_view_plans_warn(r->plan, &r->model);
    TSUYA_TRY(tsuya_stereo_cache_create(&r->cache, &r->model, o->workspace, o->long_side_px, LEVELS,
                                        o->cache_mb << 20));
    r->content = tsuya_arena_alloc(r->arena, (size_t)r->model.view_count, sizeof *r->content);
    r->photometric = tsuya_arena_alloc(r->arena, (size_t)r->model.view_count, sizeof *r->photometric);
    r->final = tsuya_arena_alloc(r->arena, (size_t)r->model.view_count, sizeof *r->final);
    if (!r->content || !r->photometric || !r->final) {
        return TSUYA_ERROR_MEMORY;
    }
    int sources = 0;
    for (int v = 0; v < r->model.view_count; v++) {
        if (r->plan[v].used) {
            TSUYA_TRY(view_content(&r->content[v], r, v));
            r->info->views++;
            sources += r->plan[v].source_count;
        } else if (!r->plan[v].held_out) {
            r->info->views_skipped++;
        }
    }
    r->info->source_views = (double)sources / r->info->views;
    r->total = r->info->views * (1 + o->geometric + o->prior);
    return TSUYA_OK;
}

static void summarise(run *r)
{
    tsuya_stereo_info *info = r->info;
    info->seconds = info->seconds_photometric + info->seconds_geometric + info->seconds_prior;
    info->closed = r->open_pixels > 0 ? r->closed_pixels / r->open_pixels : NAN;
    info->megapixels = r->masked_pixels * 1e-6;
    info->coverage = r->masked_pixels > 0 ? r->covered_pixels / r->masked_pixels : NAN;
    info->seconds_per_megapixel = info->megapixels > 0 ? info->seconds / info->megapixels : NAN;
}

tsuya_status tsuya_stereo(tsuya_stereo_info *info, const tsuya_stereo_options *options, const tsuya_context *context)
{
    memset(info, 0, sizeof *info);
    if (options->source_views < 1 || options->source_views > TSUYA_STEREO_MAX_SOURCES) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "source_views: %d, 1 to %d are accepted", options->source_views,
                          TSUYA_STEREO_MAX_SOURCES);
    }
    run r = {.options = options, .context = context, .info = info, .patchmatch = tsuya_patchmatch_options_default()};
    tsuya_status status = TSUYA_OK;
    TSUYA_GOTO_DONE(status, tsuya_arena_create(&r.arena, 1 << 16));
    TSUYA_GOTO_DONE(status, prepare(&r));
    TSUYA_GOTO_DONE(status, write_lists(&r));
    TSUYA_GOTO_DONE(status, run_pass(&r, false));
    if (options->geometric) {
        TSUYA_GOTO_DONE(status, run_pass(&r, true));
    }
    if (options->prior) {
        TSUYA_GOTO_DONE(status, run_prior(&r));
    }
    tsuya_progress_update(context, "stereo", r.total, r.total, NULL);
    summarise(&r);
done:
    tsuya_stereo_cache_free(r.cache);
    tsuya_sparse_model_free(&r.model);
    tsuya_arena_free(r.arena);
    return status;
}

void tsuya_stereo_info_to_json(tsuya_json *object, const tsuya_stereo_info *info)
{
    tsuya_json_set_number(object, "views", info->views);
    tsuya_json_set_number(object, "views_skipped", info->views_skipped);
    tsuya_json_set_number(object, "maps_resumed", info->maps_resumed);
    tsuya_json_set_number(object, "width_px", info->width_px);
    tsuya_json_set_number(object, "height_px", info->height_px);
    tsuya_json_set_number(object, "source_views", info->source_views);
    tsuya_json_set_number(object, "megapixels", info->megapixels);
    tsuya_json_set_number(object, "seconds_per_megapixel", info->seconds_per_megapixel);
    tsuya_json_set_number(object, "coverage", info->coverage);
    tsuya_json_set_number(object, "closed", info->closed);
    tsuya_json_set_number(object, "seconds_photometric", info->seconds_photometric);
    tsuya_json_set_number(object, "seconds_geometric", info->seconds_geometric);
    tsuya_json_set_number(object, "seconds_prior", info->seconds_prior);
    tsuya_json_set_number(object, "seconds", info->seconds);
}
