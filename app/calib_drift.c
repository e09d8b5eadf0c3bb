#include "app/calib_drift.h"

#include "core/file.h"
#include "core/memory.h"
#include "core/table.h"

#include <math.h>

/* Errors of one calibration hang together over the image, so that the whole map counts as few numbers, not as many. */
static const double MOST_SIGMAS = 3.0;

static const char *const names[] = {"x_px", "y_px", "sigma_px", "sigma_infinity_px", NULL};

tsuya_status tsuya_calib_uncertainty_save(const tsuya_calibration *c, const char *path)
{
    tsuya_file_writer writer;
    TSUYA_TRY(tsuya_file_begin(&writer, path));
    fprintf(writer.stream, "# %s %s %s %s\n", names[0], names[1], names[2], names[3]);
    for (int i = 0; i < c->sigma.cols * c->sigma.rows; i++) {
        if (c->sigma.covered[i] && isfinite(c->sigma.value[i]) && isfinite(c->sigma_infinity.value[i])) {
            tsuya_vec2 p = tsuya_projection_pixel(&c->sigma, &c->solve.camera, i);
            fprintf(writer.stream, "%.2f %.2f %.5g %.5g\n", p.x, p.y, c->sigma.value[i], c->sigma_infinity.value[i]);
        }
    }
    return tsuya_file_commit(&writer);
}

/* Adds the squares of a model's sigmas to the places; NaN where it has none. */
static tsuya_status add_sigmas(double *squares, bool *there, const tsuya_projection_map *map, const char *model, const tsuya_camera *camera, bool infinity)
{
    const tsuya_table_options options = {.required = names, .known = names, .vnlog = true};
    char *folder = tsuya_path_folder(model), *path = folder ? tsuya_path_join(folder, "uncertainty.vnl") : NULL;
    const int count = map->cols * map->rows;
    double *own = NULL;
    tsuya_table t = {0};
    tsuya_status status = path ? TSUYA_OK : TSUYA_ERROR_MEMORY;
    TSUYA_GOTO_DONE(status, status);
    *there = tsuya_path_exists(path);
    if (!*there) {
        goto done;
    }
    TSUYA_NEW(status, own, (size_t)count);
    TSUYA_GOTO_DONE(status, tsuya_table_load(&t, path, &options));
    const int x = tsuya_table_column(&t, names[0]), y = tsuya_table_column(&t, names[1]), sigma = tsuya_table_column(&t, names[infinity ? 3 : 2]);
    for (int i = 0; i < count; i++) {
        own[i] = NAN;
    }
    for (size_t row = 0; row < t.row_count; row++) {
        double s = tsuya_table_at(&t, row, sigma);
        if (!(s > 0.0)) {
            status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d: %s: %g; an uncertainty is positive", path, t.line[row], names[infinity ? 3 : 2], s);
            goto done;
        }
        own[tsuya_projection_cell(map, camera, (tsuya_vec2){tsuya_table_at(&t, row, x), tsuya_table_at(&t, row, y)})] = s;
    }
    for (int i = 0; i < count; i++) {
        squares[i] += own[i] * own[i];
    }
done:
    tsuya_table_free(&t);
    tsuya_free(own);
    tsuya_free(path);
    tsuya_free(folder);
    return status;
}

tsuya_status tsuya_calib_drift(tsuya_json *figures, const tsuya_projection_map *map, const char *const model[2], const tsuya_camera camera[2], double distance_m)
{
    double *squares, expected = 0.0, ratio = 0.0;
    bool there[2] = {false, false};
    int places = 0;
    tsuya_status status = TSUYA_OK;
    TSUYA_NEW(status, squares, (size_t)(map->cols * map->rows));
    for (int k = 0; k < 2; k++) {
        TSUYA_GOTO_DONE(status, add_sigmas(squares, &there[k], map, model[k], &camera[k], !isfinite(distance_m)));
    }
    for (int i = 0; there[0] && there[1] && i < map->cols * map->rows; i++) {
        if (map->covered[i] && isfinite(map->value[i]) && isfinite(squares[i])) {
            expected += squares[i];
            ratio += map->value[i] * map->value[i] / squares[i];
            places++;
        }
    }
    if (places == 0) {
        tsuya_json_set_text(figures, "drift", there[0] && there[1] ? "unknown: the boards have no place in common" : "unknown: no uncertainty.vnl beside both models");
        goto done;
    }
    tsuya_json_set_number(figures, "uncertainty_px", sqrt(expected / places));
    tsuya_json_set_number(figures, "difference_over_uncertainty", sqrt(ratio / places));
    tsuya_json_set_text(figures, "drift", sqrt(ratio / places) > MOST_SIGMAS ? "yes" : "no");
done:
    tsuya_free(squares);
    return status;
}
