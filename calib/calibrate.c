#include "calib/calibrate.h"

#include "calib/trials.h"

#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

tsuya_calibrate_options tsuya_calibrate_options_default(void)
{
    return (tsuya_calibrate_options){.tolerance_px = 0.5, .largest = TSUYA_LENS_SPLINED_STEREOGRAPHIC};
}

static void advise(tsuya_calibration *c, const char *format, ...) TSUYA_PRINTF(2, 3);
static void advise(tsuya_calibration *c, const char *format, ...)
{
    if (c->advice_count < TSUYA_CALIB_ADVICE) {
        va_list arguments;
        va_start(arguments, format);
        vsnprintf(c->advice[c->advice_count++], sizeof c->advice[0], format, arguments);
        va_end(arguments);
    }
}

static double covered_share(const tsuya_projection_map *map)
{
    int n = 0;
    for (int i = 0; i < map->cols * map->rows; i++) {
        n += map->covered[i];
    }
    return (double)n / (map->cols * map->rows);
}

static double largest_tilt_deg(const tsuya_solve *s)
{
    double largest = 0.0;
    for (int v = 0; v < s->view_count; v++) {
        largest = fmax(largest, tsuya_deg_from_rad(acos(fmin(1.0, fabs(s->view[v].camera_from_plate.rotation.e[2][2])))));
    }
    return largest;
}

static void give_advice(tsuya_calibration *c, const tsuya_corner_set *corners)
{
    static const char *const place[] = {"top left", "top right", "bottom left", "bottom right"};
    const tsuya_solve *s = &c->solve;
    int worst;
    double corner = tsuya_projection_corner(&worst, &c->sigma), center = tsuya_projection_center(&c->sigma), share = covered_share(&c->sigma);
    double sigma, tilt = largest_tilt_deg(s), focal = tsuya_projection_focal(&sigma, &s->camera, c->covariance.intrinsics), focal_sigma = sigma / focal;
    if (c->photos_used < TSUYA_CALIB_FEWEST_FOR_HALVES) {
        advise(c, "%d photographs used: take 15 or more, so that two halves can be held against each other", c->photos_used);
    }
    if (tilt < 25.0) {
        advise(c, "no board is tilted by more than %.0f degrees: take some at 30 to 45 degrees, to both sides and up and down", tilt);
    }
    if (focal_sigma > 0.005) {
        advise(c, "the focal length is known to %.1f %% only: tilt the board more, and come nearer", 100.0 * focal_sigma);
    }
    if (share < 0.7) {
        advise(c, "boards cover %.0f %% of the image: let them reach its edges and corners", 100.0 * share);
    }
    if (isnan(corner)) {
        advise(c, "the lens model does not reach the image's %s corner, where nothing was seen of the board: put it there", place[worst]);
    } else if (corner > 3.0 * center) {
        advise(c, "the image's %s corner is the least certain place (%.2f px, centre %.2f px): put the board there", place[worst], corner, center);
    }
    if (c->covariance.photo_factor > 1.5) {
        advise(c, "photographs disagree %.1f times more than their corners' noise: keep camera and board still, and the board flat", c->covariance.photo_factor);
    }
    if (isfinite(c->trial[c->chosen].cross.p90) && !c->cross_validates) {
        advise(c, "the two halves of the photographs disagree (p90 %.2f px): was focus or zoom moved, or is the board bent?", c->trial[c->chosen].cross.p90);
    }
    if (c->misfit > TSUYA_CALIB_MISFIT_MOST && c->photos_used >= TSUYA_CALIB_FEWEST_FOR_HALVES && s->camera.lens != TSUYA_LENS_SPLINED_STEREOGRAPHIC) {
        advise(c, "%.0f %% of what the corners are off is the same in all photographs, by place in the image: the lens is not quite what the model is, or the "
               "board not flat; with more photographs that fill the image a splined model can follow it", 100.0 * c->misfit);
    }
    if (s->outliers > s->observation_count / 20) {
        advise(c, "%.0f %% of the corners do not fit: is the board file right, and the board flat?", 100.0 * s->outliers / s->observation_count);
    }
    if (c->photos_used < corners->photo_count) {
        advise(c, "%d of %d photographs show too little of the board and were not used", corners->photo_count - c->photos_used, corners->photo_count);
    }
}

static double mean_sd(double *sd, const double *v, int n)
{
    double mean = 0.0, squares = 0.0;
    for (int i = 0; i < n; i++) {
        mean += v[i] / n;
    }
    for (int i = 0; i < n; i++) {
        squares += (v[i] - mean) * (v[i] - mean);
    }
    *sd = n > 1 ? sqrt(squares / (n - 1)) : NAN;
    return mean;
}

static void relate(tsuya_calibrate_plate *out, const tsuya_solve *s, int plate, double *angle, double *distance)
{
    int n = 0;
    for (int a = 0; a < s->view_count; a++) {
        for (int b = 0; b < s->view_count; b++) {
            if (s->view[a].photo == s->view[b].photo && s->view[a].plate == 0 && s->view[b].plate == plate) {
                tsuya_pose p = tsuya_pose_compose(tsuya_pose_inverse(s->view[a].camera_from_plate), s->view[b].camera_from_plate);
                angle[n] = tsuya_deg_from_rad(tsuya_mat3_rotation_angle_rad(p.rotation));
                distance[n++] = tsuya_vec3_norm(p.translation);
            }
        }
    }
    *out = (tsuya_calibrate_plate){.name = s->board->plate[plate].name, .reference = s->board->plate[0].name, .photos = n, .angle_deg = NAN,
                                   .angle_sd_deg = NAN, .distance_m = NAN, .distance_sd_m = NAN};
    if (n) {
        out->angle_deg = mean_sd(&out->angle_sd_deg, angle, n);
        out->distance_m = mean_sd(&out->distance_sd_m, distance, n);
        out->rigid = n > 1 && out->angle_sd_deg < 1.0 && out->distance_sd_m < 0.01 * fmax(out->distance_m, 0.1);
    }
}

static tsuya_status relate_plates(tsuya_calibration *c)
{
    const tsuya_solve *s = &c->solve;
    tsuya_status status = TSUYA_OK;
    double *angle = NULL, *distance = NULL;
    TSUYA_NEW(status, angle, (size_t)s->view_count);
    TSUYA_NEW(status, distance, (size_t)s->view_count);
    TSUYA_NEW(status, c->plate, (size_t)s->board->plate_count);
    for (int p = 1; p < s->board->plate_count; p++) {
        relate(&c->plate[c->plates++], s, p, angle, distance);
    }
done:
    tsuya_free(angle);
    tsuya_free(distance);
    return status;
}

static tsuya_status state_uncertainty(tsuya_calibration *c)
{
    double sigma;
    TSUYA_TRY(tsuya_covariance_estimate(&c->covariance, &c->solve, true));
    double focal = tsuya_projection_focal(&sigma, &c->solve.camera, c->covariance.intrinsics), focal_sigma = sigma / focal;
    if (!(focal_sigma < 0.05)) {
        return tsuya_fail(TSUYA_ERROR_NUMERIC, "the photographs do not determine the camera (focal length to %.0f %% only, largest tilt of a board %.0f "
                          "degrees): take more, with the board tilted by 30 to 45 degrees", 100.0 * focal_sigma, largest_tilt_deg(&c->solve));
    }
    TSUYA_TRY(tsuya_projection_map_create(&c->sigma, TSUYA_CALIB_MAP_COLS, TSUYA_CALIB_MAP_ROWS));
    TSUYA_TRY(tsuya_projection_map_create(&c->sigma_infinity, TSUYA_CALIB_MAP_COLS, TSUYA_CALIB_MAP_ROWS));
    tsuya_projection_cover(&c->sigma, &c->solve);
    tsuya_projection_cover(&c->sigma_infinity, &c->solve);
    TSUYA_TRY(tsuya_projection_uncertainty(&c->sigma, &c->solve.camera, c->covariance.intrinsics, c->distance_m));
    return tsuya_projection_uncertainty(&c->sigma_infinity, &c->solve.camera, c->covariance.intrinsics, INFINITY);
}

static tsuya_status calibrate(tsuya_calibration *c, const tsuya_corner_set *corners, const tsuya_calibrate_options *options, const tsuya_context *context)
{
    TSUYA_TRY(tsuya_solve_start(&c->solve, options->focal_px));
    for (int v = 0; v < c->solve.view_count; v++) {
        c->photos_used += v == 0 || c->solve.view[v].photo != c->solve.view[v - 1].photo;
    }
    TSUYA_TRY(tsuya_trials_run(c, corners, options, context));
    TSUYA_TRY(state_uncertainty(c));
    TSUYA_TRY(relate_plates(c));
    give_advice(c, corners);
    return TSUYA_OK;
}

tsuya_status tsuya_calibrate(tsuya_calibration *calibration, const tsuya_board *board, const tsuya_corner_set *corners, int width_px, int height_px,
                             const tsuya_calibrate_options *options, const tsuya_context *context)
{
    double start_s = tsuya_clock_s();
    *calibration = (tsuya_calibration){0};
    tsuya_status status = tsuya_solve_create(&calibration->solve, board, corners, NULL, TSUYA_CALIB_FEWEST_CORNERS, width_px, height_px);
    if (status == TSUYA_OK) {
        status = calibrate(calibration, corners, options, context);
    }
    calibration->seconds = tsuya_clock_s() - start_s;
    if (status != TSUYA_OK) {
        tsuya_calibration_free(calibration);
    }
    return status;
}

void tsuya_calibration_free(tsuya_calibration *c)
{
    tsuya_solve_free(&c->solve);
    tsuya_covariance_free(&c->covariance);
    tsuya_projection_map_free(&c->sigma);
    tsuya_projection_map_free(&c->sigma_infinity);
    tsuya_projection_map_free(&c->cross);
    tsuya_projection_map_free(&c->cross_infinity);
    tsuya_free(c->plate);
    *c = (tsuya_calibration){0};
}
