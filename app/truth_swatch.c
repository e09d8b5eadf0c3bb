#include "app/truth.h"

#include "app/gather_input.h"
#include "brdf/fit.h"
#include "core/file.h"

#include <math.h>

/* Poses, plate and lamp as the stage's dials tell them; the photographs are read like any user's. */
static tsuya_status gather(tsuya_gathered *gathered, tsuya_arena *arena, const char *truth_folder, const tsuya_context *context)
{
    tsuya_gather_options options = tsuya_gather_options_default();
    tsuya_gather_session session = {0};
    tsuya_gather_paths paths = {.photos = tsuya_arena_printf(arena, "%s/../swatch", truth_folder), .poses = tsuya_arena_printf(arena, "%s/swatch", truth_folder),
                                .surface = tsuya_arena_printf(arena, "%s/swatch.ply", truth_folder),
                                .lights = tsuya_arena_printf(arena, "%s/../swatch/lights.json", truth_folder),
                                .reference = tsuya_arena_printf(arena, "%s/../swatch/reference.csv", truth_folder), .lamps_with_camera = true};
    tsuya_status status = paths.photos && paths.poses && paths.surface && paths.lights && paths.reference ? TSUYA_OK : TSUYA_ERROR_MEMORY;
    options.pattern = false; /* one dye */
    TSUYA_GOTO_DONE(status, status);
    TSUYA_GOTO_DONE(status, tsuya_gather_photos(&session, &paths, &options, context));
    status = tsuya_gather_finish(gathered, session.gather);
done:
    tsuya_gather_session_free(&session);
    return status;
}

tsuya_status tsuya_truth_reflectance(double *error, const tsuya_material *material, const char *table)
{
    tsuya_samples truth;
    double *predicted = NULL;
    tsuya_status status = TSUYA_OK;
    *error = NAN;
    TSUYA_TRY(tsuya_samples_load(&truth, table));
    if (tsuya_material_get_info(material).channel_count == truth.channel_count) {
        TSUYA_NEW(status, predicted, (size_t)truth.count * (size_t)truth.channel_count);
        tsuya_material_predict(predicted, material, &truth);
        *error = tsuya_samples_error(&truth, predicted, -1).cbrt;
    }
done:
    tsuya_free(predicted);
    tsuya_samples_free(&truth);
    return status;
}

tsuya_status tsuya_truth_swatch(double *error, const char *truth_folder, const tsuya_context *context)
{
    tsuya_arena *arena;
    tsuya_gathered gathered = {0};
    tsuya_material *material = NULL;
    tsuya_fit_info info;
    const tsuya_fit_options options = {.name = "swatch", .model = "auto", .tolerance = NAN};
    *error = NAN;
    TSUYA_TRY(tsuya_arena_create(&arena, 1 << 12));
    const char *photos = tsuya_arena_printf(arena, "%s/../swatch", truth_folder), *table = tsuya_arena_printf(arena, "%s/reflectance.csv", truth_folder);
    tsuya_status status = photos && table ? TSUYA_OK : TSUYA_ERROR_MEMORY;
    TSUYA_GOTO_DONE(status, status);
    if (!tsuya_path_exists(photos) || !tsuya_path_exists(table)) {
        goto done;
    }
    TSUYA_GOTO_DONE(status, gather(&gathered, arena, truth_folder, context));
    TSUYA_GOTO_DONE(status, tsuya_brdf_fit(&material, &info, NULL, NULL, &gathered.samples, &options, context));
    status = tsuya_truth_reflectance(error, material, table);
done:
    tsuya_material_free(material);
    tsuya_gathered_free(&gathered);
    tsuya_arena_free(arena);
    return status;
}
