#include "calib/calibrate.h"

#include "calib/mrcal_adapter.h"

#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

enum { MAP_COLS = 41, MAP_ROWS = 31, FEWEST_CORNERS = 8, FEWEST_FOR_HALVES = 6 };
/* A larger lens must lower the held-out error by this share to be taken. */
static const double WORTH = 0.02;

static const tsuya_lens lens_order[TSUYA_CALIB_LENSES] = {TSUYA_LENS_PINHOLE, TSUYA_LENS_OPENCV4, TSUYA_LENS_OPENCV5, TSUYA_LENS_OPENCV8,
                                                          TSUYA_LENS_OPENCV12};

tsuya_calibrate_options tsuya_calibrate_options_default(void) { return (tsuya_calibrate_options){.tolerance_px = 0.5}; }

static int compare_numbers(const void *pa, const void *pb)
{
    const double *a = pa, *b = pb;
    return (*a > *b) - (*a < *b);
}

static tsuya_status median_distance(double *distance_m, const tsuya_solve *s)
{
    double *d = tsuya_calloc((size_t)s->view_count, sizeof *d);
    if (!d) {
        return TSUYA_ERROR_MEMORY;
    }
    for (int v = 0; v < s->view_count; v++) {
        tsuya_vec3 middle = {0, 0, 0};
        for (int i = 0; i < s->view[v].count; i++) {
            const tsuya_solve_observation *o = &s->observation[s->view[v].first + i];
            middle = tsuya_vec3_mad(middle, 1.0 / s->view[v].count, tsuya_board_corner(s->board, o->tag, o->corner));
        }
        d[v] = tsuya_vec3_norm(tsuya_pose_apply(s->view[v].camera_from_plate, middle));
    }
    qsort(d, (size_t)s->view_count, sizeof *d, compare_numbers);
    *distance_m = d[s->view_count / 2];
    tsuya_free(d);
    return TSUYA_OK;
}

/* The two halves of the photographs and where their solves stand. */
typedef struct halves {
    bool there;
    bool *use[2];
    tsuya_solve solve[2], other[2]; /* other[k]: the photographs of the half that k does not have */
} halves;

static void halves_free(halves *h)
{
    for (int k = 0; k < 2; k++) {
        tsuya_free(h->use[k]);
        tsuya_solve_free(&h->solve[k]);
        tsuya_solve_free(&h->other[k]);
    }
}

static void take_poses(tsuya_solve *to, const tsuya_solve *from)
{
    for (int v = 0; v < to->view_count; v++) {
        for (int k = 0; k < from->view_count; k++) {
            if (from->view[k].photo == to->view[v].photo && from->view[k].plate == to->view[v].plate) {
                to->view[v].camera_from_plate = from->view[k].camera_from_plate;
            }
        }
    }
    to->camera = from->camera;
}

/* Every second photograph that has a view. */
static tsuya_status halves_create(halves *h, const tsuya_solve *all, const tsuya_corner_set *corners)
{
    tsuya_status status = TSUYA_OK;
    int photos = 0;
    for (int k = 0; k < 2; k++) {
        TSUYA_NEW(status, h->use[k], (size_t)corners->photo_count);
    }
    for (int v = 0; v < all->view_count; v++) {
        if (v == 0 || all->view[v].photo != all->view[v - 1].photo) {
            h->use[photos++ % 2][all->view[v].photo] = true;
        }
    }
    h->there = photos >= FEWEST_FOR_HALVES;
    for (int k = 0; k < 2 && h->there; k++) {
        TSUYA_GOTO_DONE(status, tsuya_solve_create(&h->solve[k], all->board, corners, h->use[k], FEWEST_CORNERS, all->camera.width_px, all->camera.height_px));
        TSUYA_GOTO_DONE(status, tsuya_solve_create(&h->other[k], all->board, corners, h->use[!k], FEWEST_CORNERS, all->camera.width_px, all->camera.height_px));
        take_poses(&h->solve[k], all);
    }
done:
    return status;
}

/* Weights, outliers and corrected pixels of the whole solve for a part of its photographs (both in the set's order). */
static void copy_marks(tsuya_solve *part, const tsuya_solve *all)
{
    int k = 0;
    for (int i = 0; i < part->observation_count; i++) {
        tsuya_solve_observation *o = &part->observation[i];
        const tsuya_solve_observation *a;
        int photo = part->view[o->view].photo;
        do {
            a = &all->observation[k];
        } while ((all->view[a->view].photo != photo || a->tag != o->tag || a->corner != o->corner) && ++k < all->observation_count);
        o->outlier = a->outlier;
        o->weight_sigma_px = a->weight_sigma_px;
        o->pixel = a->pixel;
    }
    part->edge_bias = all->edge_bias;
    part->bent = all->bent;
    memcpy(part->shape, all->shape, (size_t)all->board->plate_count * sizeof *all->shape);
}

/* Squares of the half that is not in the fit. */
static tsuya_status held_out(double *squares, int *count, tsuya_solve *other, const tsuya_solve *fit, const tsuya_solve *all)
{
    take_poses(other, all);
    other->camera = fit->camera;
    copy_marks(other, all);
    memcpy(other->shape, fit->shape, (size_t)all->board->plate_count * sizeof *fit->shape);
    TSUYA_TRY(tsuya_mrcal_optimize(other, TSUYA_MRCAL_POSES));
    for (int i = 0; i < other->observation_count; i++) {
        const tsuya_solve_observation *o = &other->observation[i];
        if (!o->outlier) {
            *squares += o->residual_px.x * o->residual_px.x + o->residual_px.y * o->residual_px.y;
            *count += 2;
        }
    }
    return TSUYA_OK;
}

/* Cross-validation of one lens; maps stay in `cross`, `cross_infinity`. */
static tsuya_status cross_validate(tsuya_calibrate_trial *trial, tsuya_projection_map *cross, tsuya_projection_map *cross_infinity, halves *h,
                                   const tsuya_solve *all, double distance_m)
{
    double squares = 0.0;
    int count = 0;
    for (int k = 0; k < 2; k++) {
        take_poses(&h->solve[k], all);
        copy_marks(&h->solve[k], all);
        TSUYA_TRY(tsuya_solve_again(&h->solve[k]));
    }
    for (int k = 0; k < 2; k++) {
        TSUYA_TRY(held_out(&squares, &count, &h->other[k], &h->solve[k], all));
    }
    trial->heldout_px = sqrt(squares / count);
    tsuya_projection_cover(cross, all);
    tsuya_projection_cover(cross_infinity, all);
    TSUYA_TRY(tsuya_projection_difference(cross, NULL, &h->solve[0].camera, &h->solve[1].camera, distance_m));
    TSUYA_TRY(tsuya_projection_difference(cross_infinity, NULL, &h->solve[0].camera, &h->solve[1].camera, INFINITY));
    TSUYA_TRY(tsuya_projection_summary(&trial->cross, cross));
    return tsuya_projection_summary(&trial->cross_infinity, cross_infinity);
}

/* Solutions of the trials are kept, so that the chosen one need not be solved again. */
typedef struct memory {
    tsuya_solve_view *view[TSUYA_CALIB_TRIALS];
    tsuya_solve_observation *observation[TSUYA_CALIB_TRIALS];
    tsuya_camera camera[TSUYA_CALIB_TRIALS];
    double variance[TSUYA_CALIB_TRIALS], rms[TSUYA_CALIB_TRIALS];
    int outliers[TSUYA_CALIB_TRIALS];
    double *photo_sigma[TSUYA_CALIB_TRIALS], bias[TSUYA_CALIB_TRIALS];
    tsuya_plate_shape *shape[TSUYA_CALIB_TRIALS];
    tsuya_projection_map cross[TSUYA_CALIB_TRIALS], cross_infinity[TSUYA_CALIB_TRIALS];
} memory;

static void memory_free(memory *m)
{
    for (int i = 0; i < TSUYA_CALIB_TRIALS; i++) {
        tsuya_free(m->view[i]);
        tsuya_free(m->observation[i]);
        tsuya_free(m->photo_sigma[i]);
        tsuya_free(m->shape[i]);
        tsuya_projection_map_free(&m->cross[i]);
        tsuya_projection_map_free(&m->cross_infinity[i]);
    }
}

static tsuya_status keep(memory *m, int i, const tsuya_solve *s)
{
    tsuya_status status = TSUYA_OK;
    TSUYA_NEW(status, m->view[i], (size_t)s->view_count);
    TSUYA_NEW(status, m->observation[i], (size_t)s->observation_count);
    TSUYA_NEW(status, m->photo_sigma[i], (size_t)s->photo_count);
    TSUYA_NEW(status, m->shape[i], (size_t)s->board->plate_count);
    memcpy(m->shape[i], s->shape, (size_t)s->board->plate_count * sizeof *s->shape);
    memcpy(m->view[i], s->view, (size_t)s->view_count * sizeof *s->view);
    memcpy(m->observation[i], s->observation, (size_t)s->observation_count * sizeof *s->observation);
    memcpy(m->photo_sigma[i], s->photo_sigma_px, (size_t)s->photo_count * sizeof *s->photo_sigma_px);
    m->bias[i] = s->edge_bias;
    m->camera[i] = s->camera;
    m->variance[i] = s->variance;
    m->rms[i] = s->rms_px;
    m->outliers[i] = s->outliers;
done:
    return status;
}

static void take_back(tsuya_solve *s, const memory *m, int i)
{
    memcpy(s->view, m->view[i], (size_t)s->view_count * sizeof *s->view);
    memcpy(s->observation, m->observation[i], (size_t)s->observation_count * sizeof *s->observation);
    memcpy(s->photo_sigma_px, m->photo_sigma[i], (size_t)s->photo_count * sizeof *s->photo_sigma_px);
    memcpy(s->shape, m->shape[i], (size_t)s->board->plate_count * sizeof *s->shape);
    s->edge_bias = m->bias[i];
    s->camera = m->camera[i];
    s->variance = m->variance[i];
    s->rms_px = m->rms[i];
    s->outliers = m->outliers[i];
}

static tsuya_status try_lens(tsuya_calibration *c, memory *m, halves *h, tsuya_lens lens)
{
    int i = c->trials++;
    tsuya_calibrate_trial *trial = &c->trial[i];
    *trial = (tsuya_calibrate_trial){.lens = lens, .bent = c->solve.bent, .heldout_px = NAN, .cross = {NAN, NAN, NAN}, .cross_infinity = {NAN, NAN, NAN}};
    TSUYA_TRY(tsuya_solve_lens(&c->solve, lens));
    trial->rms_px = c->solve.rms_px;
    TSUYA_TRY(keep(m, i, &c->solve));
    if (!h->there) {
        return TSUYA_OK;
    }
    TSUYA_TRY(median_distance(&c->distance_m, &c->solve));
    TSUYA_TRY(tsuya_projection_map_create(&m->cross[i], MAP_COLS, MAP_ROWS));
    TSUYA_TRY(tsuya_projection_map_create(&m->cross_infinity[i], MAP_COLS, MAP_ROWS));
    return cross_validate(trial, &m->cross[i], &m->cross_infinity[i], h, &c->solve, c->distance_m);
}

/* What a lens is judged by: the held-out error; without halves the residual, which larger lenses always lower. */
static double merit(const tsuya_calibrate_trial *t) { return isnan(t->heldout_px) ? t->rms_px : t->heldout_px; }

static void choose(tsuya_calibration *c, const tsuya_calibrate_options *options)
{
    double best = INFINITY;
    for (int i = 0; i < c->trials; i++) {
        best = fmin(best, merit(&c->trial[i]));
    }
    c->chosen = -1;
    for (int i = 0; i < c->trials && c->chosen < 0; i++) {
        const tsuya_calibrate_trial *t = &c->trial[i];
        if (merit(t) <= (1.0 + WORTH) * best && !(t->cross.p90 > options->tolerance_px)) {
            c->chosen = i;
        }
    }
    c->cross_validates = c->chosen >= 0 && isfinite(c->trial[c->chosen].cross.p90);
    for (int i = 0; i < c->trials && c->chosen < 0; i++) {
        c->chosen = merit(&c->trial[i]) <= (1.0 + WORTH) * best ? i : -1;
    }
    const tsuya_calibrate_trial *t = &c->trial[c->chosen];
    const char *name = tsuya_lens_name(t->lens);
    if (options->lens_given) {
        snprintf(c->reason, sizeof c->reason, "%s: asked for", name);
    } else if (c->cross_validates) {
        snprintf(c->reason, sizeof c->reason, "%s: the smallest lens whose held-out error (%.3f px) is within 2 %% of the best (%.3f px) and whose halves "
                 "agree within %.2g px (p90 %.3f px)", name, t->heldout_px, best, options->tolerance_px, t->cross.p90);
    } else if (isnan(t->cross.p90)) {
        snprintf(c->reason, sizeof c->reason, "%s: the smallest lens within 2 %% of the best residual; too few photographs to hold two halves against each "
                 "other", name);
    } else {
        snprintf(c->reason, sizeof c->reason, "%s: no lens cross-validates within %.2g px; this one has the smallest held-out error (p90 %.3f px)", name,
                 options->tolerance_px, t->cross.p90);
    }
}

/* The chosen lens with plates that may be bent: taken where it lowers the held-out error as a larger lens would have to. */
static tsuya_status try_bent(tsuya_calibration *c, memory *m, halves *h, const tsuya_calibrate_options *options)
{
    const tsuya_calibrate_trial *flat = &c->trial[c->chosen], *bent = &c->trial[c->trials];
    take_back(&c->solve, m, c->chosen);
    c->solve.bent = true;
    TSUYA_TRY(try_lens(c, m, h, flat->lens));
    bool agrees = !(bent->cross.p90 > options->tolerance_px);
    c->solve.bent = bent->heldout_px < (1.0 - WORTH) * flat->heldout_px && (agrees || !c->cross_validates);
    if (c->solve.bent) {
        size_t used = strlen(c->reason);
        snprintf(c->reason + used, sizeof c->reason - used, "; the plates are not flat: with their bends the held-out error is %.3f px (p90 %.3f px)",
                 bent->heldout_px, bent->cross.p90);
        c->cross_validates = agrees && isfinite(bent->cross.p90);
        c->chosen = c->trials - 1;
    }
    return TSUYA_OK;
}

static tsuya_status try_lenses(tsuya_calibration *c, memory *m, halves *h, const tsuya_calibrate_options *options, const tsuya_context *context)
{
    for (int i = 0; i < TSUYA_CALIB_LENSES; i++) {
        TSUYA_TRY(tsuya_check_interrupt());
        tsuya_lens lens = options->lens_given ? options->lens : lens_order[i];
        tsuya_progress_update(context, "calibrate", i, TSUYA_CALIB_LENSES, tsuya_lens_name(lens));
        TSUYA_TRY(try_lens(c, m, h, lens));
        choose(c, options);
        bool settled = c->cross_validates && c->chosen < c->trials - 1;
        if (options->lens_given || settled || (!h->there && i == 2)) {
            break;
        }
    }
    tsuya_progress_update(context, "calibrate", TSUYA_CALIB_LENSES, TSUYA_CALIB_LENSES, NULL);
    return TSUYA_OK;
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
    double tilt = largest_tilt_deg(s), focal_sigma = sqrt(c->covariance.intrinsics[0]) / s->camera.fx_px;
    if (c->photos_used < FEWEST_FOR_HALVES) {
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
    double alone[TSUYA_INTRINSICS_MOST * TSUYA_INTRINSICS_MOST];
    TSUYA_TRY(tsuya_mrcal_covariance(alone, NULL, &c->solve, 0));
    TSUYA_TRY(tsuya_covariance_estimate(&c->covariance, &c->solve, true));
    double focal_sigma = sqrt(c->covariance.intrinsics[0]) / c->solve.camera.fx_px;
    if (!(focal_sigma < 0.05)) {
        return tsuya_fail(TSUYA_ERROR_NUMERIC, "the photographs do not determine the camera (focal length to %.0f %% only, largest tilt of a board %.0f "
                          "degrees): take more, with the board tilted by 30 to 45 degrees", 100.0 * focal_sigma, largest_tilt_deg(&c->solve));
    }
    TSUYA_TRY(tsuya_projection_map_create(&c->sigma, MAP_COLS, MAP_ROWS));
    TSUYA_TRY(tsuya_projection_map_create(&c->sigma_infinity, MAP_COLS, MAP_ROWS));
    tsuya_projection_cover(&c->sigma, &c->solve);
    tsuya_projection_cover(&c->sigma_infinity, &c->solve);
    TSUYA_TRY(tsuya_projection_uncertainty(&c->sigma, &c->solve.camera, c->covariance.intrinsics, c->distance_m));
    return tsuya_projection_uncertainty(&c->sigma_infinity, &c->solve.camera, c->covariance.intrinsics, INFINITY);
}

static tsuya_status calibrate(tsuya_calibration *c, memory *m, halves *h, const tsuya_corner_set *corners, const tsuya_calibrate_options *options,
                              const tsuya_context *context)
{
    TSUYA_TRY(tsuya_solve_start(&c->solve, options->focal_px));
    TSUYA_TRY(halves_create(h, &c->solve, corners));
    for (int v = 0; v < c->solve.view_count; v++) {
        c->photos_used += v == 0 || c->solve.view[v].photo != c->solve.view[v - 1].photo;
    }
    TSUYA_TRY(try_lenses(c, m, h, options, context));
    if (h->there) {
        TSUYA_TRY(try_bent(c, m, h, options));
    }
    take_back(&c->solve, m, c->chosen);
    c->cross = m->cross[c->chosen];
    c->cross_infinity = m->cross_infinity[c->chosen];
    m->cross[c->chosen] = m->cross_infinity[c->chosen] = (tsuya_projection_map){0};
    TSUYA_TRY(median_distance(&c->distance_m, &c->solve));
    TSUYA_TRY(state_uncertainty(c));
    TSUYA_TRY(relate_plates(c));
    give_advice(c, corners);
    return TSUYA_OK;
}

tsuya_status tsuya_calibrate(tsuya_calibration *calibration, const tsuya_board *board, const tsuya_corner_set *corners, int width_px, int height_px,
                             const tsuya_calibrate_options *options, const tsuya_context *context)
{
    double start_s = tsuya_clock_s();
    memory m = {0};
    halves h = {0};
    *calibration = (tsuya_calibration){0};
    tsuya_status status = tsuya_solve_create(&calibration->solve, board, corners, NULL, FEWEST_CORNERS, width_px, height_px);
    if (status == TSUYA_OK) {
        status = calibrate(calibration, &m, &h, corners, options, context);
    }
    memory_free(&m);
    halves_free(&h);
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
