#include "calib/trials.h"

#include "calib/misfit.h"
#include "calib/mrcal_adapter.h"
#include "core/order.h"

#include <string.h>

enum { OPENCV_LENSES = 5, SPLINES = 3, CORNERS_A_POINT = 8, START = TSUYA_CALIB_TRIALS };
/* A larger lens must lower the held-out error by this share to be taken. */
static const double WORTH = 0.02;

static const tsuya_lens lens_order[OPENCV_LENSES] = {TSUYA_LENS_PINHOLE, TSUYA_LENS_OPENCV4, TSUYA_LENS_OPENCV5, TSUYA_LENS_OPENCV8,
                                                     TSUYA_LENS_OPENCV12};
static const int spline_order[SPLINES] = {12, 17, 24}; /* control points along x: cells of two thirds each time */

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
    tsuya_sort_doubles(d, (size_t)s->view_count);
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
    to->prior = from->prior;
    to->camera_from_prior = from->camera_from_prior;
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
    h->there = photos >= TSUYA_CALIB_FEWEST_FOR_HALVES;
    for (int k = 0; k < 2 && h->there; k++) {
        TSUYA_GOTO_DONE(status, tsuya_solve_create(&h->solve[k], all->board, corners, h->use[k], TSUYA_CALIB_FEWEST_CORNERS, all->camera.width_px, all->camera.height_px));
        TSUYA_GOTO_DONE(status, tsuya_solve_create(&h->other[k], all->board, corners, h->use[!k], TSUYA_CALIB_FEWEST_CORNERS, all->camera.width_px, all->camera.height_px));
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

typedef struct squares { double sum; int count; } squares;

/* Squares of the half that is not in the fit.  `near`: of its corners where the fit saw the board, poses from these alone, and of what the
 * solve left out as well, as far as it counts at all: a lens must not gain by what it does not follow. */
static tsuya_status held_out(squares *sum, tsuya_solve *other, const tsuya_solve *fit, const tsuya_solve *all, const tsuya_projection_map *near)
{
    take_poses(other, all);
    other->camera = fit->camera;
    copy_marks(other, all);
    memcpy(other->shape, fit->shape, (size_t)all->board->plate_count * sizeof *fit->shape);
    for (int i = 0; near && i < other->observation_count; i++) {
        tsuya_solve_observation *o = &other->observation[i];
        o->outlier |= !near->covered[tsuya_projection_cell(near, &other->camera, o->pixel)];
    }
    TSUYA_TRY(tsuya_mrcal_optimize(other, TSUYA_MRCAL_POSES));
    for (int i = 0; i < other->observation_count; i++) {
        const tsuya_solve_observation *o = &other->observation[i];
        double r = hypot(o->residual_px.x, o->residual_px.y), most = TSUYA_OUTLIER_SIGMAS * o->weight_sigma_px;
        if (near ? near->covered[tsuya_projection_cell(near, &other->camera, o->pixel)] : !o->outlier) {
            sum->sum += near && r > most ? most * most : r * r;
            sum->count += 2;
        }
    }
    return TSUYA_OK;
}

/* Held-out errors of a trial, everywhere and where both halves saw boards: `both` is covered there. */
static tsuya_status hold_out(tsuya_calibrate_trial *trial, tsuya_projection_map *both, halves *h, const tsuya_solve *all)
{
    tsuya_projection_map near;
    squares far = {0}, close = {0};
    TSUYA_TRY(tsuya_projection_map_create(&near, both->cols, both->rows));
    tsuya_status status = TSUYA_OK;
    for (int k = 0; k < 2 && status == TSUYA_OK; k++) {
        tsuya_projection_cover(&near, &h->solve[k]);
        for (int i = 0; i < near.cols * near.rows; i++) {
            both->covered[i] = near.covered[i] && (k == 0 || both->covered[i]);
        }
        status = held_out(&far, &h->other[k], &h->solve[k], all, NULL);
        if (status == TSUYA_OK) {
            status = held_out(&close, &h->other[k], &h->solve[k], all, &near);
        }
    }
    trial->heldout_px = sqrt(far.sum / far.count);
    trial->heldout_near_px = sqrt(close.sum / close.count);
    tsuya_projection_map_free(&near);
    return status;
}

/* Cross-validation of one lens; maps stay in `cross`, `cross_infinity`.  Lenses of OPENCV's family are held to account wherever boards were
 * seen, splined ones where both halves saw them: control points that a half has not seen are its prior's. */
static tsuya_status cross_validate(tsuya_calibrate_trial *trial, tsuya_projection_map *cross, tsuya_projection_map *cross_infinity, halves *h,
                                   const tsuya_solve *all, double distance_m)
{
    for (int k = 0; k < 2; k++) {
        take_poses(&h->solve[k], all);
        copy_marks(&h->solve[k], all);
        TSUYA_TRY(tsuya_solve_again(&h->solve[k]));
    }
    TSUYA_TRY(hold_out(trial, cross, h, all));
    if (!trial->nx) {
        tsuya_projection_cover(cross, all);
    }
    memcpy(cross_infinity->covered, cross->covered, (size_t)cross->cols * (size_t)cross->rows * sizeof *cross->covered);
    TSUYA_TRY(tsuya_projection_difference(cross, NULL, &h->solve[0].camera, &h->solve[1].camera, distance_m));
    TSUYA_TRY(tsuya_projection_difference(cross_infinity, NULL, &h->solve[0].camera, &h->solve[1].camera, INFINITY));
    TSUYA_TRY(tsuya_projection_summary(&trial->cross, cross));
    return tsuya_projection_summary(&trial->cross_infinity, cross_infinity);
}

/* Solutions of the trials are kept, so that the chosen one need not be solved again; the last is the start. */
typedef struct solution {
    tsuya_solve solve; /* owns its arrays; the board is borrowed */
    tsuya_projection_map cross, cross_infinity;
} solution;

typedef struct trials {
    tsuya_calibration *c;
    const tsuya_calibrate_options *options;
    const tsuya_context *context;
    halves half;
    bool splined_only; /* asked for */
    bool near;         /* splined lenses are among the trials */
    solution kept[TSUYA_CALIB_TRIALS + 1];
} trials;

static void trials_free(trials *t)
{
    halves_free(&t->half);
    for (int i = 0; i <= TSUYA_CALIB_TRIALS; i++) {
        tsuya_solve_free(&t->kept[i].solve);
        tsuya_projection_map_free(&t->kept[i].cross);
        tsuya_projection_map_free(&t->kept[i].cross_infinity);
    }
}

/* What a solve has found, into one of the same photographs. */
static void take_solution(tsuya_solve *to, const tsuya_solve *from)
{
    tsuya_solve arrays = *to;
    memcpy(to->view, from->view, (size_t)from->view_count * sizeof *from->view);
    memcpy(to->observation, from->observation, (size_t)from->observation_count * sizeof *from->observation);
    memcpy(to->photo_sigma_px, from->photo_sigma_px, (size_t)from->photo_count * sizeof *from->photo_sigma_px);
    memcpy(to->shape, from->shape, (size_t)from->board->plate_count * sizeof *from->shape);
    *to = *from;
    to->view = arrays.view;
    to->observation = arrays.observation;
    to->photo_sigma_px = arrays.photo_sigma_px;
    to->shape = arrays.shape;
}

static tsuya_status keep(solution *k, const tsuya_solve *s)
{
    tsuya_status status = TSUYA_OK;
    k->solve = (tsuya_solve){0};
    TSUYA_NEW(status, k->solve.view, (size_t)s->view_count);
    TSUYA_NEW(status, k->solve.observation, (size_t)s->observation_count);
    TSUYA_NEW(status, k->solve.photo_sigma_px, (size_t)s->photo_count);
    TSUYA_NEW(status, k->solve.shape, (size_t)s->board->plate_count);
    take_solution(&k->solve, s);
done:
    return status;
}

/* Photographs that do not determine a lens give it any error that they like. */
static tsuya_status check_determined(const tsuya_solve *s)
{
    size_t n = (size_t)tsuya_lens_parameters(&s->camera);
    double *covariance = tsuya_calloc(n * n, sizeof *covariance);
    tsuya_status status = covariance ? tsuya_mrcal_covariance(covariance, NULL, s, 0) : TSUYA_ERROR_MEMORY;
    tsuya_free(covariance);
    return status;
}

static tsuya_status solve_and_hold_out(trials *t, int i, int nx)
{
    tsuya_calibration *c = t->c;
    tsuya_calibrate_trial *trial = &c->trial[i];
    TSUYA_TRY(nx ? tsuya_solve_splined(&c->solve, nx) : tsuya_solve_lens(&c->solve, trial->lens));
    TSUYA_TRY(check_determined(&c->solve));
    trial->nx = c->solve.camera.spline.nx;
    trial->ny = c->solve.camera.spline.ny;
    trial->rms_px = c->solve.rms_px;
    TSUYA_TRY(keep(&t->kept[i], &c->solve));
    if (!t->half.there) {
        return TSUYA_OK;
    }
    TSUYA_TRY(median_distance(&c->distance_m, &c->solve));
    TSUYA_TRY(tsuya_projection_map_create(&t->kept[i].cross, TSUYA_CALIB_MAP_COLS, TSUYA_CALIB_MAP_ROWS));
    TSUYA_TRY(tsuya_projection_map_create(&t->kept[i].cross_infinity, TSUYA_CALIB_MAP_COLS, TSUYA_CALIB_MAP_ROWS));
    return cross_validate(trial, &t->kept[i].cross, &t->kept[i].cross_infinity, &t->half, &c->solve, c->distance_m);
}

/* One trial, from an earlier one's solution.  A lens that cannot be solved, or is not determined, is no reason to stop: its errors are
 * infinite. */
static tsuya_status try_lens(trials *t, int from, tsuya_lens lens, int nx, bool bent)
{
    tsuya_calibration *c = t->c;
    int i = c->trials;
    char what[64];
    if (i == TSUYA_CALIB_TRIALS) {
        return TSUYA_OK;
    }
    TSUYA_TRY(tsuya_check_interrupt());
    c->trials++;
    c->trial[i] = (tsuya_calibrate_trial){.lens = lens, .bent = bent, .heldout_px = NAN, .heldout_near_px = NAN, .cross = {NAN, NAN, NAN}, .cross_infinity = {NAN, NAN, NAN}};
    snprintf(what, sizeof what, "%s%s", tsuya_lens_name(lens), bent ? ", bent plates" : "");
    tsuya_progress_update(t->context, "calibrate", i, i + 1, what);
    take_solution(&c->solve, &t->kept[from].solve);
    c->solve.bent = bent;
    tsuya_status status = solve_and_hold_out(t, i, nx);
    if (status == TSUYA_ERROR_NUMERIC) {
        c->trial[i].rms_px = c->trial[i].heldout_px = c->trial[i].heldout_near_px = INFINITY;
        return TSUYA_OK;
    }
    return status;
}

/* What a lens is judged by: the held-out error, once splined ones are among them that where the fits saw boards; without halves the residual,
 * which larger lenses always lower. */
static double merit(const trials *t, const tsuya_calibrate_trial *one)
{
    return isnan(one->heldout_px) ? one->rms_px : t->near ? one->heldout_near_px : one->heldout_px;
}

static bool agrees(const trials *t, int i) { return !(t->c->trial[i].cross.p90 > t->options->tolerance_px); }

/* Smaller lenses before larger ones. */
static int size_of(const tsuya_calibrate_trial *t) { return t->nx ? 1000 + t->nx : (int)t->lens; }

static double best_merit(const trials *t, bool bent)
{
    double best = INFINITY;
    for (int i = 0; i < t->c->trials; i++) {
        best = t->c->trial[i].bent == bent && (!t->splined_only || t->c->trial[i].nx) ? fmin(best, merit(t, &t->c->trial[i])) : best;
    }
    return best;
}

/* Of the trials with flat plates, or those with bent ones: the smallest lens that is worth it; first among those whose halves agree.
 * −1 where all failed. */
static int smallest(const trials *t, bool bent)
{
    double best = best_merit(t, bent);
    int chosen[2] = {-1, -1};
    for (int i = 0; i < t->c->trials; i++) {
        const tsuya_calibrate_trial *one = &t->c->trial[i];
        if (one->bent != bent || (t->splined_only && !one->nx) || !isfinite(one->rms_px) || !(merit(t, one) <= (1.0 + WORTH) * best)) {
            continue;
        }
        for (int k = agrees(t, i) ? 0 : 1; k < 2; k++) {
            if (chosen[k] < 0 || size_of(one) < size_of(&t->c->trial[chosen[k]])) {
                chosen[k] = i;
            }
        }
    }
    return chosen[0] >= 0 ? chosen[0] : chosen[1];
}

static bool cross_validates(const trials *t, int i) { return i >= 0 && isfinite(t->c->trial[i].cross.p90) && agrees(t, i); }

/* The lenses of OPENCV's family, until a larger one gains nothing. */
static tsuya_status try_flat(trials *t)
{
    tsuya_calibration *c = t->c;
    for (int i = 0; i < OPENCV_LENSES && lens_order[i] <= t->options->largest; i++) {
        int from = i;
        while (from > 0 && !isfinite(c->trial[from - 1].rms_px)) {
            from--;
        }
        TSUYA_TRY(try_lens(t, from > 0 ? from - 1 : START, lens_order[i], 0, false));
        c->chosen = smallest(t, false);
        bool settled = cross_validates(t, c->chosen) && c->chosen < i;
        if (settled || (!t->half.there && i == 2)) {
            break;
        }
    }
    return TSUYA_OK;
}

/* Whether what is larger (a lens, plates that may bend) lowers the held-out error enough, and does not spoil the halves' agreement. */
static bool is_worth(const trials *t, int small, int large)
{
    const tsuya_calibrate_trial *s = &t->c->trial[small], *l = &t->c->trial[large];
    return isfinite(l->rms_px) && merit(t, l) < (1.0 - WORTH) * merit(t, s) && (agrees(t, large) || !cross_validates(t, small));
}

/* The next larger lenses on bent plates while they are worth it; where the first is not, the next smaller ones while the larger was not. */
static tsuya_status try_neighbours(trials *t, int at)
{
    tsuya_calibration *c = t->c;
    bool larger = false;
    for (int k = at + 1; k < OPENCV_LENSES && lens_order[k] <= t->options->largest; k++) {
        int i = c->trials;
        TSUYA_TRY(try_lens(t, c->chosen, lens_order[k], 0, true));
        if (i == c->trials || !is_worth(t, c->chosen, i)) {
            break;
        }
        c->chosen = i;
        larger = true;
    }
    for (int k = at - 1; k >= 0 && !larger; k--) {
        int i = c->trials;
        TSUYA_TRY(try_lens(t, c->chosen, lens_order[k], 0, true));
        if (i == c->trials || !cross_validates(t, i) || is_worth(t, i, c->chosen)) {
            break;
        }
        c->chosen = i;
    }
    return TSUYA_OK;
}

/* The chosen lens with plates that may be bent; where that is taken, its neighbours on them, as a lens may have had to make up for the
 * plates. */
static tsuya_status try_bent(trials *t)
{
    tsuya_calibration *c = t->c;
    int flat = c->chosen, bent = c->trials, at = 0;
    while (at < OPENCV_LENSES && lens_order[at] != c->trial[flat].lens) {
        at++;
    }
    TSUYA_TRY(try_lens(t, flat, c->trial[flat].lens, 0, true));
    if (!is_worth(t, flat, bent)) {
        return TSUYA_OK;
    }
    c->chosen = bent;
    return t->options->lens_given ? TSUYA_OK : try_neighbours(t, at);
}

/* Splines from the coarsest on, until a finer one gains nothing; then once more with the plates the other way. */
static tsuya_status try_splines(trials *t)
{
    tsuya_calibration *c = t->c;
    int before = c->chosen;
    bool bent = c->trial[before].bent;
    t->splined_only = t->options->lens_given;
    t->near = true;
    for (int k = 0; k < SPLINES; k++) {
        int i = c->trials, nx = spline_order[k];
        if (k > 0 && nx * nx * c->solve.camera.height_px / c->solve.camera.width_px > c->solve.observation_count / CORNERS_A_POINT) {
            break;
        }
        TSUYA_TRY(try_lens(t, before, TSUYA_LENS_SPLINED_STEREOGRAPHIC, nx, bent));
        if (i == c->trials || (k > 0 && !(merit(t, &c->trial[i]) < (1.0 - WORTH) * merit(t, &c->trial[i - 1])))) {
            break;
        }
    }
    c->chosen = smallest(t, bent);
    if (c->chosen < 0) {
        return TSUYA_ERROR_NUMERIC;
    }
    const tsuya_calibrate_trial *one = &c->trial[c->chosen];
    int other = c->trials, this = c->chosen;
    if (!one->nx) {
        return TSUYA_OK;
    }
    TSUYA_TRY(try_lens(t, this, one->lens, one->nx, !bent));
    int flat = bent ? other : this, curved = bent ? this : other;
    c->chosen = other < c->trials && isfinite(c->trial[other].rms_px) && is_worth(t, flat, curved) == !bent ? other : this;
    return TSUYA_OK;
}

static void name_of(char name[64], const tsuya_calibrate_trial *t)
{
    snprintf(name, 64, t->nx ? "%s (%d × %d)" : "%s", tsuya_lens_name(t->lens), t->nx, t->ny);
}

static void explain(trials *t)
{
    tsuya_calibration *c = t->c;
    const tsuya_calibrate_trial *one = &c->trial[c->chosen];
    double best = best_merit(t, one->bent);
    char name[64], *at = c->reason;
    size_t room = sizeof c->reason;
    name_of(name, one);
    if (t->options->lens_given) {
        snprintf(at, room, "%s: asked for", name);
    } else if (c->cross_validates) {
        snprintf(at, room, "%s: the smallest lens whose held-out error (%.3f px) is within 2 %% of the best (%.3f px) and whose halves agree within %.2g px "
                 "(p90 %.3f px)", name, merit(t, one), best, t->options->tolerance_px, one->cross.p90);
    } else if (isnan(one->cross.p90)) {
        snprintf(at, room, "%s: the smallest lens within 2 %% of the best residual; too few photographs to hold two halves against each other", name);
    } else {
        snprintf(at, room, "%s: no lens cross-validates within %.2g px; this one has the smallest held-out error (p90 %.3f px)", name,
                 t->options->tolerance_px, one->cross.p90);
    }
    for (int i = 0; i < c->trials; i++) {
        const tsuya_calibrate_trial *flat = &c->trial[i];
        if (one->bent && !flat->bent && flat->lens == one->lens && flat->nx == one->nx) {
            size_t used = strlen(at);
            snprintf(at + used, room - used, "; the plates are not flat: without their bends the held-out error is %.3f px (p90 %.3f px)", merit(t, flat),
                     flat->cross.p90);
        }
    }
}

static tsuya_status choose(trials *t)
{
    tsuya_calibration *c = t->c;
    bool splined = t->options->lens_given && t->options->lens == TSUYA_LENS_SPLINED_STEREOGRAPHIC;
    TSUYA_TRY(keep(&t->kept[START], &c->solve));
    if (t->options->lens_given && !splined) {
        TSUYA_TRY(try_lens(t, START, t->options->lens, 0, false));
        c->chosen = smallest(t, false);
    } else {
        TSUYA_TRY(try_flat(t));
    }
    if (c->chosen < 0) {
        return TSUYA_ERROR_NUMERIC; /* the last lens' reason stands */
    }
    if (t->half.there) {
        TSUYA_TRY(try_bent(t));
    }
    TSUYA_TRY(tsuya_misfit(&c->misfit, &t->kept[c->chosen].solve));
    bool may = t->half.there && !t->options->lens_given && t->options->largest == TSUYA_LENS_SPLINED_STEREOGRAPHIC;
    if (splined || (may && c->misfit > TSUYA_CALIB_MISFIT_MOST)) {
        TSUYA_TRY(try_splines(t));
    }
    c->cross_validates = cross_validates(t, c->chosen);
    explain(t);
    return TSUYA_OK;
}

tsuya_status tsuya_trials_run(tsuya_calibration *c, const tsuya_corner_set *corners, const tsuya_calibrate_options *options, const tsuya_context *context)
{
    tsuya_status status = TSUYA_OK;
    trials *t = NULL;
    TSUYA_NEW(status, t, 1);
    *t = (trials){.c = c, .options = options, .context = context};
    TSUYA_GOTO_DONE(status, halves_create(&t->half, &c->solve, corners));
    TSUYA_GOTO_DONE(status, choose(t));
    solution *best = &t->kept[c->chosen];
    take_solution(&c->solve, &best->solve);
    c->cross = best->cross;
    c->cross_infinity = best->cross_infinity;
    best->cross = best->cross_infinity = (tsuya_projection_map){0};
    TSUYA_GOTO_DONE(status, tsuya_misfit(&c->misfit, &c->solve));
    TSUYA_GOTO_DONE(status, median_distance(&c->distance_m, &c->solve));
    tsuya_progress_update(context, "calibrate", c->trials, c->trials, NULL);
done:
    if (t) {
        trials_free(t);
    }
    tsuya_free(t);
    return status;
}
