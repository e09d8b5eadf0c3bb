#include "calib/mrcal_adapter.h"

#include "calib/mrcal_inputs.h"
#include "calib/spline.h"
#include "core/memory.h"

#include <mrcal/mrcal.h>
#include <suitesparse/cholmod.h>

#include <string.h>

static mrcal_lensmodel_t model_of(const tsuya_camera *camera)
{
    mrcal_lensmodel_t model = {.type = MRCAL_LENSMODEL_PINHOLE};
    switch (camera->lens) {
    case TSUYA_LENS_OPENCV4: model.type = MRCAL_LENSMODEL_OPENCV4; break;
    case TSUYA_LENS_OPENCV5: model.type = MRCAL_LENSMODEL_OPENCV5; break;
    case TSUYA_LENS_OPENCV8: model.type = MRCAL_LENSMODEL_OPENCV8; break;
    case TSUYA_LENS_OPENCV12: model.type = MRCAL_LENSMODEL_OPENCV12; break;
    case TSUYA_LENS_SPLINED_STEREOGRAPHIC:
        model.type = MRCAL_LENSMODEL_SPLINED_STEREOGRAPHIC;
        model.LENSMODEL_SPLINED_STEREOGRAPHIC__config =
            (mrcal_LENSMODEL_SPLINED_STEREOGRAPHIC__config_t){.order = 3, .Nx = (uint16_t)camera->spline.nx, .Ny = (uint16_t)camera->spline.ny,
                                                              .fov_x_deg = (uint16_t)camera->spline.fov_x_deg};
        break;
    default: break;
    }
    return model;
}

static void vector_from_camera(double v[TSUYA_INTRINSICS_MOST], const tsuya_camera *c)
{
    v[0] = c->fx_px;
    v[1] = c->fy_px;
    v[2] = c->cx_px;
    v[3] = c->cy_px;
    memcpy(v + 4, c->lens == TSUYA_LENS_SPLINED_STEREOGRAPHIC ? c->spline.point : c->distortion, (size_t)(tsuya_lens_parameters(c) - 4) * sizeof *v);
}

static void camera_from_vector(tsuya_camera *c, const double *v)
{
    c->fx_px = v[0];
    c->fy_px = v[1];
    c->cx_px = v[2];
    c->cy_px = v[3];
    memcpy(c->lens == TSUYA_LENS_SPLINED_STEREOGRAPHIC ? c->spline.point : c->distortion, v + 4, (size_t)(tsuya_lens_parameters(c) - 4) * sizeof *v);
}

/* mrcal's advice for splined lenses: control points move alone, the core stays where it is; and what no corner holds is kept from
 * running away. */
static void select_intrinsics(mrcal_problem_selections_t *select, const tsuya_camera *c, tsuya_mrcal_free what)
{
    bool splined = c->lens == TSUYA_LENS_SPLINED_STEREOGRAPHIC;
    select->do_optimize_intrinsics_core = what == TSUYA_MRCAL_CORE || (what == TSUYA_MRCAL_ALL && !splined);
    select->do_optimize_intrinsics_distortions = what == TSUYA_MRCAL_ALL;
    select->do_apply_regularization = what == TSUYA_MRCAL_ALL && splined;
}

/* The problem as mrcal sees it. */
typedef struct layout {
    mrcal_lensmodel_t model;
    mrcal_problem_selections_t select;
    mrcal_problem_constants_t constants;
    double intrinsics[TSUYA_INTRINSICS_MOST];
    int size[2];
    mrcal_pose_t *pose;
    mrcal_point3_t *point;
    mrcal_observation_point_t *seen;
    tsuya_spline_hold *hold; /* the last pose, and the last points and observations, are those of a splined lens' prior */
    int holds;
    double hold_sigma_px;
    int poses, points, observations, states, measurements;
} layout;

static void layout_free(layout *l)
{
    tsuya_free(l->pose);
    tsuya_free(l->point);
    tsuya_free(l->seen);
    tsuya_free(l->hold);
}

static mrcal_pose_t pose_to_mrcal(tsuya_pose pose)
{
    tsuya_vec3 r = tsuya_rodrigues_from_mat3(pose.rotation), t = pose.translation;
    return (mrcal_pose_t){.r = {.xyz = {r.x, r.y, r.z}}, .t = {.xyz = {t.x, t.y, t.z}}};
}

static tsuya_pose pose_from_mrcal(const mrcal_pose_t *pose)
{
    const double *r = pose->r.xyz, *t = pose->t.xyz;
    return (tsuya_pose){tsuya_mat3_from_rodrigues((tsuya_vec3){r[0], r[1], r[2]}), {t[0], t[1], t[2]}};
}

static void fill_holds(layout *l, const tsuya_solve *solve)
{
    if (l->holds) {
        l->pose[solve->view_count] = pose_to_mrcal(solve->camera_from_prior);
    }
    for (int i = 0; i < l->holds; i++) {
        const tsuya_spline_hold *h = &l->hold[i];
        int point = l->points - l->holds + i;
        l->point[point] = (mrcal_point3_t){.xyz = {h->ray.x, h->ray.y, h->ray.z}};
        l->seen[solve->observation_count + i] = (mrcal_observation_point_t){.icam = {.intrinsics = 0, .extrinsics = solve->view_count}, .i_point = point,
                                                                            .px = {.xyz = {h->pixel.x, h->pixel.y, 1.0 / l->hold_sigma_px}}};
    }
}

static void fill(layout *l, const tsuya_solve *solve)
{
    for (int v = 0; v < solve->view_count; v++) {
        l->pose[v] = pose_to_mrcal(solve->view[v].camera_from_plate);
    }
    for (int i = 0; i < l->points - l->holds; i++) {
        tsuya_vec3 p = tsuya_solve_point(solve, i / 4, i % 4);
        l->point[i] = (mrcal_point3_t){.xyz = {p.x, p.y, p.z}};
    }
    fill_holds(l, solve);
    for (int i = 0; i < solve->observation_count; i++) {
        const tsuya_solve_observation *o = &solve->observation[i];
        l->seen[i].icam.intrinsics = 0;
        l->seen[i].icam.extrinsics = o->view;
        l->seen[i].i_point = 4 * o->tag + o->corner;
        l->seen[i].px = (mrcal_point3_t){.xyz = {o->pixel.x, o->pixel.y, o->outlier ? -1.0 : 1.0 / o->weight_sigma_px}};
    }
}

static tsuya_status layout_create(layout *l, const tsuya_solve *solve, tsuya_mrcal_free what)
{
    tsuya_status status = TSUYA_OK;
    const tsuya_camera *c = &solve->camera;
    *l = (layout){.model = model_of(c), .constants = {.point_min_range = 1e-6, .point_max_range = 1e9}, .size = {c->width_px, c->height_px}};
    l->select.do_optimize_extrinsics = true;
    select_intrinsics(&l->select, c, what);
    vector_from_camera(l->intrinsics, c);
    if (what == TSUYA_MRCAL_ALL && c->lens == TSUYA_LENS_SPLINED_STEREOGRAPHIC && solve->prior.width_px > 0) {
        TSUYA_NEW(status, l->hold, (size_t)(c->spline.nx * c->spline.ny));
        l->holds = tsuya_spline_holds(l->hold, &l->hold_sigma_px, &c->spline, &solve->prior);
    }
    l->poses = solve->view_count + (l->holds > 0);
    l->points = 4 * solve->board->tag_count + l->holds;
    l->observations = solve->observation_count + l->holds;
    TSUYA_NEW(status, l->pose, (size_t)l->poses);
    TSUYA_NEW(status, l->point, (size_t)l->points);
    TSUYA_NEW(status, l->seen, (size_t)l->observations);
    fill(l, solve);
    l->states = mrcal_num_states(1, l->poses, 0, l->points, l->points, 0, l->select, &l->model);
    l->measurements = mrcal_num_measurements(0, l->observations, 0, 0, 1, l->poses, 0, l->points, l->points, l->select, &l->model);
done:
    if (status != TSUYA_OK) {
        layout_free(l);
    }
    return status;
}

/* Residuals as mrcal weighs them, back in pixels; what is an outlier is projected here. */
static void keep_residuals(tsuya_solve *solve)
{
    double squares = 0.0;
    int count = 0;
    solve->outliers = 0;
    for (int i = 0; i < solve->observation_count; i++) {
        tsuya_solve_observation *o = &solve->observation[i];
        tsuya_vec2 q;
        double by_point[6];
        tsuya_vec3 p = tsuya_pose_apply(solve->view[o->view].camera_from_plate, tsuya_solve_point(solve, o->tag, o->corner));
        if (!tsuya_mrcal_project(&q, by_point, NULL, &solve->camera, p)) {
            q = (tsuya_vec2){1e6, 1e6};
        }
        o->residual_px = (tsuya_vec2){o->pixel.x - q.x, o->pixel.y - q.y};
        solve->outliers += o->outlier;
        if (!o->outlier) {
            squares += o->residual_px.x * o->residual_px.x + o->residual_px.y * o->residual_px.y;
            count += 2;
        }
    }
    solve->rms_px = count ? sqrt(squares / count) : NAN;
}

static void keep_solution(tsuya_solve *solve, const layout *l, double squares)
{
    camera_from_vector(&solve->camera, l->intrinsics);
    for (int v = 0; v < solve->view_count; v++) {
        solve->view[v].camera_from_plate = pose_from_mrcal(&l->pose[v]);
    }
    if (l->holds) {
        solve->camera_from_prior = pose_from_mrcal(&l->pose[solve->view_count]);
    }
    keep_residuals(solve);
    int freedom = 2 * (l->observations - solve->outliers) - l->states;
    solve->variance = freedom > 0 ? squares / freedom : NAN;
}

tsuya_status tsuya_mrcal_optimize(tsuya_solve *solve, tsuya_mrcal_free what)
{
    layout l;
    double *b = NULL, *x = NULL, squares = 0.0;
    tsuya_status status = TSUYA_OK;
    TSUYA_TRY(layout_create(&l, solve, what));
    TSUYA_NEW(status, b, (size_t)l.states);
    TSUYA_NEW(status, x, (size_t)l.measurements);
    mrcal_stats_t stats = mrcal_optimize(b, l.states * (int)sizeof *b, x, l.measurements * (int)sizeof *x, l.intrinsics, l.pose, NULL, l.point, NULL,
                                         1, l.poses, 0, l.points, l.points, NULL, l.seen, 0, l.observations, NULL, &l.model, l.size, l.select,
                                         &l.constants, 0.0, 0, 0, false, false);
    bool finite = stats.rms_reproj_error__pixels >= 0.0 && isfinite(stats.rms_reproj_error__pixels);
    for (int i = 0; i < l.measurements; i++) {
        squares += x[i] * x[i];
    }
    if (!finite || !isfinite(squares) || !(l.intrinsics[0] > 0.0) || !(l.intrinsics[1] > 0.0)) {
        status = tsuya_fail(TSUYA_ERROR_NUMERIC, "the calibration did not converge (%s, %d views)", tsuya_lens_name(solve->camera.lens), l.poses);
        goto done;
    }
    keep_solution(solve, &l, squares);
done:
    tsuya_free(b);
    tsuya_free(x);
    layout_free(&l);
    return status;
}

/* Jᵀ at the solution, in mrcal's packed units. */
static tsuya_status jacobian(cholmod_sparse **jt, double *b, double *x, const layout *l, cholmod_common *common)
{
    int nonzeros = _mrcal_num_j_nonzero(0, l->observations, 0, 0, 1, l->poses, 0, l->points, l->points, NULL, l->seen, l->select, &l->model);
    *jt = cholmod_allocate_sparse((size_t)l->states, (size_t)l->measurements, (size_t)nonzeros, true, true, 0, CHOLMOD_REAL, common);
    if (!*jt) {
        return tsuya_fail(TSUYA_ERROR_MEMORY, "out of memory (%d nonzero derivatives)", nonzeros);
    }
    bool fine = mrcal_optimizer_callback(b, l->states * (int)sizeof *b, x, l->measurements * (int)sizeof *x, *jt, l->intrinsics, l->pose, NULL, l->point,
                                         NULL, 1, l->poses, 0, l->points, l->points, NULL, l->seen, 0, l->observations, NULL, &l->model, l->size,
                                         l->select, &l->constants, 0.0, 0, 0, false);
    return fine ? TSUYA_OK : tsuya_fail(TSUYA_ERROR_NUMERIC, "mrcal's derivatives could not be computed");
}

/* `block` (n × n) of (J Jᵀ)⁻¹ at `first`, in plain units. */
static tsuya_status inverse_block(double *block, int first, int n, const layout *l, cholmod_factor *factor, const double *scale, cholmod_common *common)
{
    cholmod_dense *unit = cholmod_zeros((size_t)l->states, (size_t)n, CHOLMOD_REAL, common);
    if (!unit) {
        return tsuya_fail(TSUYA_ERROR_MEMORY, "out of memory");
    }
    for (int k = 0; k < n; k++) {
        ((double *)unit->x)[k * l->states + first + k] = 1.0;
    }
    cholmod_dense *column = cholmod_solve(CHOLMOD_A, factor, unit, common);
    bool fine = column != NULL;
    for (int i = 0; fine && i < n; i++) {
        for (int k = 0; k < n; k++) {
            block[i * n + k] = ((double *)column->x)[k * l->states + first + i] * scale[first + i] * scale[first + k];
            fine &= isfinite(block[i * n + k]) && (i != k || block[i * n + k] > 0.0);
        }
    }
    cholmod_free_dense(&unit, common);
    cholmod_free_dense(&column, common);
    return fine ? TSUYA_OK : tsuya_fail(TSUYA_ERROR_NUMERIC, "the photographs do not determine the camera: turn and tilt the board more");
}

/* mrcal's pivots span many orders; what is left of a state after the others must not be rounding alone. */
static bool well_determined(const cholmod_factor *factor, cholmod_common *common)
{
    return common->status == CHOLMOD_OK && factor->minor == factor->n && cholmod_rcond((cholmod_factor *)factor, common) > 1e-13;
}

/* Of each state: how much one of mrcal's packed units is. */
static void unit_scale(double *scale, const layout *l)
{
    for (int i = 0; i < l->states; i++) {
        scale[i] = 1.0;
    }
    mrcal_unpack_solver_state_vector(scale, 1, l->poses, 0, l->points, l->points, l->select, &l->model);
}

tsuya_status tsuya_mrcal_covariance(double *intrinsics, double *pose, const tsuya_solve *solve, int view)
{
    layout l;
    cholmod_common common;
    cholmod_sparse *jt = NULL;
    cholmod_factor *factor = NULL;
    double *b = NULL, *x = NULL, *scale = NULL;
    tsuya_status status = TSUYA_OK;
    TSUYA_TRY(layout_create(&l, solve, TSUYA_MRCAL_ALL));
    cholmod_start(&common);
    common.print = 0;
    TSUYA_NEW(status, b, (size_t)l.states);
    TSUYA_NEW(status, scale, (size_t)l.states);
    TSUYA_NEW(status, x, (size_t)l.measurements);
    TSUYA_GOTO_DONE(status, jacobian(&jt, b, x, &l, &common));
    unit_scale(scale, &l);
    factor = cholmod_analyze(jt, &common);
    if (!factor || !cholmod_factorize(jt, factor, &common) || !well_determined(factor, &common)) {
        status = tsuya_fail(TSUYA_ERROR_NUMERIC, "the photographs do not determine the camera: turn and tilt the board more");
        goto done;
    }
    TSUYA_GOTO_DONE(status, inverse_block(intrinsics, 0, tsuya_lens_parameters(&solve->camera) - tsuya_lens_locked(&solve->camera), &l, factor, scale, &common));
    if (pose) {
        int first = mrcal_state_index_extrinsics(view, 1, l.poses, 0, l.points, l.points, 0, l.select, &l.model);
        TSUYA_GOTO_DONE(status, inverse_block(pose, first, 6, &l, factor, scale, &common));
    }
done:
    cholmod_free_factor(&factor, &common);
    cholmod_free_sparse(&jt, &common);
    cholmod_finish(&common);
    tsuya_free(b);
    tsuya_free(scale);
    tsuya_free(x);
    layout_free(&l);
    return status;
}

tsuya_status tsuya_mrcal_regularization(double *h, double *slope, int stride, const tsuya_solve *solve)
{
    layout l;
    cholmod_common common;
    cholmod_sparse *jt = NULL;
    double *b = NULL, *x = NULL, *scale = NULL;
    tsuya_status status = TSUYA_OK;
    if (solve->camera.lens != TSUYA_LENS_SPLINED_STEREOGRAPHIC) {
        return TSUYA_OK;
    }
    TSUYA_TRY(layout_create(&l, solve, TSUYA_MRCAL_ALL));
    cholmod_start(&common);
    TSUYA_NEW(status, b, (size_t)l.states);
    TSUYA_NEW(status, scale, (size_t)l.states);
    TSUYA_NEW(status, x, (size_t)l.measurements);
    TSUYA_GOTO_DONE(status, jacobian(&jt, b, x, &l, &common));
    unit_scale(scale, &l);
    const int *start = jt->p, *state = jt->i;
    const double *value = jt->x;
    for (int row = mrcal_measurement_index_regularization(0, l.observations, 0, 0); row >= 0 && row < l.measurements; row++) {
        for (int i = start[row]; i < start[row + 1]; i++) {
            double v = value[i] / scale[state[i]];
            slope[state[i]] -= v * x[row];
            for (int k = start[row]; k < start[row + 1]; k++) {
                h[state[i] * stride + state[k]] += v * value[k] / scale[state[k]];
            }
        }
    }
done:
    cholmod_free_sparse(&jt, &common);
    cholmod_finish(&common);
    tsuya_free(b);
    tsuya_free(scale);
    tsuya_free(x);
    layout_free(&l);
    return status;
}

bool tsuya_mrcal_project(tsuya_vec2 *pixel, double by_point[6], double *by_intrinsics, const tsuya_camera *camera, tsuya_vec3 p)
{
    mrcal_lensmodel_t model = model_of(camera);
    mrcal_point3_t point = {.xyz = {p.x, p.y, p.z}}, gradient[2];
    mrcal_point2_t q;
    double v[TSUYA_INTRINSICS_MOST];
    vector_from_camera(v, camera);
    bool before = p.z > 0.0 || (camera->lens == TSUYA_LENS_SPLINED_STEREOGRAPHIC && tsuya_vec3_norm(p) + p.z > 0.0);
    if (!before || !mrcal_project(&q, gradient, by_intrinsics, &point, 1, &model, v)) {
        return false;
    }
    memcpy(by_point, gradient, sizeof gradient);
    *pixel = (tsuya_vec2){q.x, q.y};
    return isfinite(q.x) && isfinite(q.y);
}

/* A corner as an even grid would have it: without the tags' growth, and without the twist that mrcal's warp lacks. */
static void place_corner(tsuya_mrcal_board *b, const tsuya_solve *s, const tsuya_solve_observation *o, double typical_px)
{
    const tsuya_board_plate *plate = &s->board->plate[0];
    int x = 2 * (o->tag % plate->cols) + (o->corner == 1 || o->corner == 2), y = 2 * (o->tag / plate->cols) + (o->corner >= 2);
    double *out = b->observation + 3 * (((size_t)o->view * (size_t)b->rows + (size_t)y) * (size_t)b->cols + (size_t)x), by_point[6];
    tsuya_pose pose = s->view[o->view].camera_from_plate;
    tsuya_vec2 grown, even;
    tsuya_plate_shape bent = s->shape[0];
    bent.growth = bent.bend_m[2] = 0.0;
    if (o->outlier || !tsuya_mrcal_project(&grown, by_point, NULL, &s->camera, tsuya_pose_apply(pose, tsuya_solve_point(s, o->tag, o->corner))) ||
        !tsuya_mrcal_project(&even, by_point, NULL, &s->camera, tsuya_pose_apply(pose, tsuya_plate_shape_corner(&bent, s->board, o->tag, o->corner)))) {
        return;
    }
    out[0] = o->pixel.x - grown.x + even.x;
    out[1] = o->pixel.y - grown.y + even.y;
    out[2] = fmin(typical_px / o->weight_sigma_px, 1.0);
}

static tsuya_status fill_board(tsuya_mrcal_board *b, const tsuya_solve *s)
{
    const tsuya_board_plate *plate = &s->board->plate[0];
    tsuya_status status = TSUYA_OK;
    *b = (tsuya_mrcal_board){.camera = s->camera, .cols = 2 * plate->cols, .rows = 2 * plate->rows, .frames = s->view_count, .spacing_m = plate->tag_m,
                             .intrinsics_count = tsuya_lens_parameters(&s->camera)};
    size_t corners = (size_t)b->frames * (size_t)b->cols * (size_t)b->rows;
    double typical = INFINITY;
    vector_from_camera(b->intrinsics, &s->camera);
    TSUYA_NEW(status, b->frame, 6 * (size_t)b->frames);
    TSUYA_NEW(status, b->observation, 3 * corners);
    for (size_t i = 0; i < 3 * corners; i++) {
        b->observation[i] = -1.0;
    }
    for (int v = 0; v < s->view_count; v++) {
        tsuya_vec3 r = tsuya_rodrigues_from_mat3(s->view[v].camera_from_plate.rotation), t = s->view[v].camera_from_plate.translation;
        const double rt[6] = {r.x, r.y, r.z, t.x, t.y, t.z};
        memcpy(b->frame + 6 * v, rt, sizeof rt);
    }
    for (int i = 0; i < s->observation_count; i++) {
        typical = fmin(typical, s->observation[i].weight_sigma_px);
    }
    for (int i = 0; i < s->observation_count; i++) {
        place_corner(b, s, &s->observation[i], typical);
    }
done:
    return status;
}

static tsuya_status optimize_board(double *rms_px, tsuya_mrcal_board *b, const mrcal_observation_board_t *seen, bool warp)
{
    mrcal_lensmodel_t model = model_of(&b->camera);
    mrcal_problem_selections_t select = {.do_optimize_extrinsics = true, .do_optimize_frames = true, .do_optimize_calobject_warp = warp};
    select_intrinsics(&select, &b->camera, TSUYA_MRCAL_ALL);
    mrcal_problem_constants_t constants = {.point_min_range = 1e-6, .point_max_range = 1e9};
    mrcal_calobject_warp_t bend = {.values = {b->warp_m[0], b->warp_m[1]}};
    int size[2] = {b->camera.width_px, b->camera.height_px}, states = mrcal_num_states(1, 0, b->frames, 0, 0, b->frames, select, &model);
    int rows = mrcal_num_measurements(b->frames, 0, b->cols, b->rows, 1, 0, b->frames, 0, 0, select, &model);
    double *packed = NULL, *x = NULL, squares = 0.0;
    tsuya_status status = TSUYA_OK;
    TSUYA_NEW(status, packed, (size_t)states);
    TSUYA_NEW(status, x, (size_t)rows);
    mrcal_stats_t stats = mrcal_optimize(packed, states * (int)sizeof *packed, x, rows * (int)sizeof *x, b->intrinsics, NULL, (mrcal_pose_t *)b->frame, NULL, &bend,
                                         1, 0, b->frames, 0, 0, seen, NULL, b->frames, 0, (mrcal_point3_t *)b->observation, &model, size, select, &constants,
                                         b->spacing_m, b->cols, b->rows, false, false);
    int count = 0;
    for (int i = 0; i < b->frames * b->cols * b->rows; i++) {
        count += b->observation[3 * i + 2] > 0.0 ? 2 : 0;
    }
    for (int i = 0; i < rows; i++) {
        squares += x[i] * x[i];
    }
    *rms_px = sqrt(squares / fmax(count, 1));
    b->warp_m[0] = bend.values[0];
    b->warp_m[1] = bend.values[1];
    if (!(stats.rms_reproj_error__pixels >= 0.0) || !isfinite(*rms_px)) {
        status = tsuya_fail(TSUYA_ERROR_NUMERIC, "the board's warp did not converge (%d photographs)", b->frames);
    }
done:
    tsuya_free(packed);
    tsuya_free(x);
    return status;
}

tsuya_status tsuya_mrcal_board_solve(tsuya_mrcal_board *b, const tsuya_solve *solve)
{
    mrcal_observation_board_t *seen = NULL;
    tsuya_status status = TSUYA_OK;
    TSUYA_GOTO_DONE(status, fill_board(b, solve));
    TSUYA_NEW(status, seen, (size_t)b->frames);
    for (int i = 0; i < b->frames; i++) {
        seen[i] = (mrcal_observation_board_t){.icam = {.intrinsics = 0, .extrinsics = -1}, .iframe = i};
    }
    TSUYA_GOTO_DONE(status, optimize_board(&b->rms_flat_px, b, seen, false));
    TSUYA_GOTO_DONE(status, optimize_board(&b->rms_px, b, seen, true));
done:
    tsuya_free(seen);
    if (status != TSUYA_OK) {
        tsuya_mrcal_board_free(b);
    }
    return status;
}
