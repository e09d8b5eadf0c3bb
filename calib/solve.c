#include "calib/solve.h"

#include "calib/covariance.h"
#include "calib/mrcal_adapter.h"
#include "calib/planar.h"
#include "calib/spline.h"
#include "core/order.h"

#include <string.h>

enum { MOST_ROUNDS = 8, WEIGHT_ROUNDS = 4, START_POINTS = 8 };
static const double RAYLEIGH_MEDIAN = 1.17741, GOOD_START_PX = 1.0;

typedef struct lens_entry { tsuya_lens lens; const char *name; int parameters; } lens_entry;
static const lens_entry lenses[] = {
    {TSUYA_LENS_PINHOLE, "PINHOLE", 4}, {TSUYA_LENS_OPENCV4, "OPENCV4", 8}, {TSUYA_LENS_OPENCV5, "OPENCV5", 9},
    {TSUYA_LENS_OPENCV8, "OPENCV8", 12}, {TSUYA_LENS_OPENCV12, "OPENCV12", 16}, {TSUYA_LENS_SPLINED_STEREOGRAPHIC, "SPLINED_STEREOGRAPHIC", 4},
};
enum { LENS_COUNT = sizeof lenses / sizeof lenses[0] };

/* COLMAP's smaller models are carried as OPENCV4. */
static const lens_entry *entry_of(tsuya_lens lens)
{
    for (int i = 0; i < LENS_COUNT; i++) {
        if (lenses[i].lens == lens) {
            return &lenses[i];
        }
    }
    return &lenses[1];
}

int tsuya_lens_parameters(const tsuya_camera *camera)
{
    bool splined = camera->lens == TSUYA_LENS_SPLINED_STEREOGRAPHIC;
    return entry_of(camera->lens)->parameters + (splined ? 2 * camera->spline.nx * camera->spline.ny : 0);
}

int tsuya_lens_locked(const tsuya_camera *camera) { return camera->lens == TSUYA_LENS_SPLINED_STEREOGRAPHIC ? 4 : 0; }

const char *tsuya_lens_name(tsuya_lens lens) { return entry_of(lens)->name; }

bool tsuya_lens_from_name(tsuya_lens *lens, const char *name)
{
    for (int i = 0; i < LENS_COUNT; i++) {
        if (strcmp(lenses[i].name, name) == 0) {
            *lens = lenses[i].lens;
            return true;
        }
    }
    return false;
}

/* Corners of one photograph and plate. */
static void add_view(tsuya_solve *s, const tsuya_corner_set *corners, int begin, int end, int plate, int fewest)
{
    int first = s->observation_count;
    for (int i = begin; i < end; i++) {
        const tsuya_corner *c = &corners->corner[i];
        int tag = tsuya_board_find(s->board, c->tag_id);
        if (tag < 0 || s->board->tag[tag].plate != plate) {
            continue;
        }
        s->observation[s->observation_count++] = (tsuya_solve_observation){
            .view = s->view_count, .tag = tag, .corner = c->corner, .pixel = {c->x_px, c->y_px}, .seen = {c->x_px, c->y_px}, .spread_px = {c->spread_x_px, c->spread_y_px},
            .sigma_px = c->sigma_px, .weight_sigma_px = c->sigma_px};
    }
    if (s->observation_count - first < fewest) {
        s->observation_count = first;
        return;
    }
    s->view[s->view_count++] = (tsuya_solve_view){.photo = corners->corner[begin].photo, .plate = plate, .first = first, .count = s->observation_count - first};
}

tsuya_status tsuya_solve_create(tsuya_solve *solve, const tsuya_board *board, const tsuya_corner_set *corners, const bool *use, int fewest, int width_px,
                                int height_px)
{
    tsuya_status status = TSUYA_OK;
    *solve = (tsuya_solve){.board = board, .photo_count = corners->photo_count};
    TSUYA_NEW(status, solve->view, (size_t)corners->photo_count * (size_t)board->plate_count);
    TSUYA_NEW(status, solve->observation, (size_t)corners->count);
    TSUYA_NEW(status, solve->shape, (size_t)board->plate_count);
    for (int p = 0; p < board->plate_count; p++) {
        solve->shape[p] = tsuya_plate_shape_flat(board, p);
    }
    TSUYA_NEW(status, solve->photo_sigma_px, (size_t)corners->photo_count);
    for (int begin = 0, end; begin < corners->count; begin = end) {
        int photo = corners->corner[begin].photo;
        for (end = begin; end < corners->count && corners->corner[end].photo == photo; end++) {
        }
        for (int p = 0; p < board->plate_count && (!use || use[photo]); p++) {
            add_view(solve, corners, begin, end, p, fewest);
        }
    }
    if (solve->view_count == 0) {
        status = tsuya_fail(TSUYA_ERROR_INPUT, "no photograph shows %d corners of the board or more", fewest);
        goto done;
    }
    solve->camera = (tsuya_camera){.lens = TSUYA_LENS_PINHOLE, .width_px = width_px, .height_px = height_px, .fx_px = width_px, .fy_px = width_px,
                                   .cx_px = 0.5 * (width_px - 1), .cy_px = 0.5 * (height_px - 1)};
done:
    if (status != TSUYA_OK) {
        tsuya_solve_free(solve);
    }
    return status;
}

void tsuya_solve_free(tsuya_solve *solve)
{
    tsuya_free(solve->view);
    tsuya_free(solve->observation);
    tsuya_free(solve->photo_sigma_px);
    tsuya_free(solve->shape);
    *solve = (tsuya_solve){0};
}

tsuya_vec3 tsuya_solve_point(const tsuya_solve *solve, int tag, int corner)
{
    return tsuya_plate_shape_corner(&solve->shape[solve->board->tag[tag].plate], solve->board, tag, corner);
}

/* Homography of every view from its observations' pixels, or from given image points. */
static bool view_homography(tsuya_mat3 *h, const tsuya_solve *s, const tsuya_solve_view *v, const tsuya_vec2 *image, tsuya_vec2 *scratch)
{
    for (int i = 0; i < v->count; i++) {
        const tsuya_solve_observation *o = &s->observation[v->first + i];
        scratch[i] = s->board->tag[o->tag].corner_m[o->corner];
        scratch[v->count + i] = image ? image[i] : o->pixel;
    }
    return tsuya_homography_fit(h, scratch, scratch + v->count, v->count);
}

/* A pose that stands for nothing yet: in front, at a distance that fits the view's size. */
static tsuya_pose fallback_pose(const tsuya_camera *c)
{
    return (tsuya_pose){{{{1, 0, 0}, {0, -1, 0}, {0, 0, -1}}}, {0, 0, c->fx_px > 0 ? 1.0 : 1.0}};
}

static void set_poses(tsuya_solve *s, const tsuya_mat3 *h, double focal_px)
{
    tsuya_camera *c = &s->camera;
    *c = (tsuya_camera){.lens = TSUYA_LENS_PINHOLE, .width_px = c->width_px, .height_px = c->height_px, .fx_px = focal_px, .fy_px = focal_px,
                        .cx_px = 0.5 * (c->width_px - 1), .cy_px = 0.5 * (c->height_px - 1)};
    for (int v = 0; v < s->view_count; v++) {
        if (!tsuya_homography_pose(&s->view[v].camera_from_plate, h[v], focal_px, c->cx_px, c->cy_px)) {
            s->view[v].camera_from_plate = fallback_pose(c);
        }
    }
}

static double median(double *v, int n)
{
    if (n == 0) {
        return NAN;
    }
    tsuya_sort_doubles(v, (size_t)n);
    return n % 2 ? v[n / 2] : 0.5 * (v[n / 2 - 1] + v[n / 2]);
}

static double residual_norm(const tsuya_solve_observation *o) { return hypot(o->residual_px.x, o->residual_px.y); }

/* Median residual, per coordinate: what a start is judged by. */
static double typical_residual(const tsuya_solve *s, double *scratch)
{
    for (int i = 0; i < s->observation_count; i++) {
        scratch[i] = residual_norm(&s->observation[i]);
    }
    return median(scratch, s->observation_count) / RAYLEIGH_MEDIAN;
}

static tsuya_status short_solve(tsuya_solve *s)
{
    TSUYA_TRY(tsuya_mrcal_optimize(s, TSUYA_MRCAL_POSES));
    TSUYA_TRY(tsuya_mrcal_optimize(s, TSUYA_MRCAL_CORE));
    s->camera.lens = TSUYA_LENS_OPENCV4;
    return tsuya_mrcal_optimize(s, TSUYA_MRCAL_ALL);
}

/* While starting, all corners count alike. */
static void even_weights(tsuya_solve *s)
{
    for (int i = 0; i < s->observation_count; i++) {
        s->observation[i].weight_sigma_px = 1.0;
        s->observation[i].outlier = false;
    }
}

typedef struct start_memory {
    tsuya_mat3 *h;
    double *weight, *scratch;
    tsuya_vec2 *points;
    tsuya_pose *pose;
} start_memory;

/* The best start so far, by its median residual. */
typedef struct best_start {
    tsuya_camera camera;
    double residual_px;
} best_start;

static void take_start(best_start *best, start_memory *m, const tsuya_solve *s, double residual_px)
{
    *best = (best_start){s->camera, residual_px};
    for (int v = 0; v < s->view_count; v++) {
        m->pose[v] = s->view[v].camera_from_plate;
    }
}

static void try_focals(best_start *best, tsuya_solve *s, start_memory *m, const double *focal, int count)
{
    for (int k = 0; k < count; k++) {
        if (!(focal[k] > 0.0) || best->residual_px < GOOD_START_PX) {
            continue;
        }
        set_poses(s, m->h, focal[k]);
        if (short_solve(s) == TSUYA_OK && typical_residual(s, m->scratch) < best->residual_px) {
            take_start(best, m, s, typical_residual(s, m->scratch));
        }
    }
}

/* Wide lenses are nearer to a stereographic projection than to a pinhole.  A spline has more freedom than what it is held against. */
static void try_stereographic(best_start *best, tsuya_solve *s, start_memory *m, const double *focal, int count)
{
    double lead = 0.5;
    for (int k = 0; k < count && !(best->residual_px < GOOD_START_PX); k++) {
        tsuya_camera plain;
        if (!(focal[k] > 0.0) || tsuya_spline_plain(&plain, s->camera.width_px, s->camera.height_px, focal[k], START_POINTS) != TSUYA_OK
            || tsuya_solve_poses(s, &plain) != TSUYA_OK || tsuya_mrcal_optimize(s, TSUYA_MRCAL_CORE) != TSUYA_OK
            || tsuya_mrcal_optimize(s, TSUYA_MRCAL_ALL) != TSUYA_OK) {
            continue;
        }
        double residual = typical_residual(s, m->scratch);
        if (residual < lead * best->residual_px) {
            take_start(best, m, s, residual);
            lead = 1.0;
        }
    }
}

static void free_memory(start_memory *m)
{
    tsuya_free(m->h);
    tsuya_free(m->weight);
    tsuya_free(m->scratch);
    tsuya_free(m->points);
    tsuya_free(m->pose);
}

static tsuya_status allocate(start_memory *m, const tsuya_solve *s)
{
    tsuya_status status = TSUYA_OK;
    *m = (start_memory){0};
    TSUYA_NEW(status, m->h, (size_t)s->view_count);
    TSUYA_NEW(status, m->weight, (size_t)s->view_count);
    TSUYA_NEW(status, m->pose, (size_t)s->view_count);
    TSUYA_NEW(status, m->scratch, (size_t)s->observation_count);
    TSUYA_NEW(status, m->points, 2 * (size_t)s->observation_count);
done:
    return status;
}

tsuya_status tsuya_solve_start(tsuya_solve *s, double focal_px)
{
    start_memory m;
    tsuya_status status = allocate(&m, s);
    if (status == TSUYA_OK) {
        double certainty, side = fmax(s->camera.width_px, s->camera.height_px);
        for (int v = 0; v < s->view_count; v++) {
            m.weight[v] = view_homography(&m.h[v], s, &s->view[v], NULL, m.points) ? s->view[v].count : 0.0;
        }
        double zhang = tsuya_homography_focal(&certainty, m.h, m.weight, s->view_count, 0.5 * s->camera.width_px, 0.5 * s->camera.height_px);
        double focal[] = {focal_px, zhang > 0.2 * side && zhang < 20 * side ? zhang : 0.0, 1.0 * side, 0.6 * side, 1.7 * side, 3.0 * side, 0.4 * side};
        best_start best = {.residual_px = INFINITY};
        even_weights(s);
        try_focals(&best, s, &m, focal, sizeof focal / sizeof focal[0]);
        try_stereographic(&best, s, &m, focal, sizeof focal / sizeof focal[0]);
        status = isfinite(best.residual_px) ? TSUYA_OK
               : tsuya_fail(TSUYA_ERROR_NUMERIC, "no focal length explains the corners: is the board file the board that was photographed?");
        s->camera = isfinite(best.residual_px) ? best.camera : s->camera;
        for (int v = 0; v < s->view_count && status == TSUYA_OK; v++) {
            s->view[v].camera_from_plate = m.pose[v];
        }
    }
    free_memory(&m);
    return status;
}

tsuya_status tsuya_solve_poses(tsuya_solve *s, const tsuya_camera *camera)
{
    start_memory m;
    tsuya_status status = allocate(&m, s);
    for (int v = 0; v < s->view_count && status == TSUYA_OK; v++) {
        const tsuya_solve_view *view = &s->view[v];
        tsuya_vec2 *ideal = m.points + 2 * view->first;
        tsuya_vec2 *scratch = tsuya_calloc(3 * (size_t)view->count, sizeof *scratch);
        if (!scratch) {
            status = TSUYA_ERROR_MEMORY;
            break;
        }
        for (int i = 0; i < view->count; i++) {
            tsuya_vec3 ray = {0, 0, 1};
            (void)tsuya_camera_unproject(camera, s->observation[view->first + i].pixel, &ray);
            ideal[i] = (tsuya_vec2){ray.x / ray.z, ray.y / ray.z};
        }
        if (!view_homography(&m.h[v], s, view, ideal, scratch) || !tsuya_homography_pose(&s->view[v].camera_from_plate, m.h[v], 1.0, 0.0, 0.0)) {
            s->view[v].camera_from_plate = fallback_pose(camera);
        }
        tsuya_free(scratch);
    }
    free_memory(&m);
    s->camera = *camera;
    return status == TSUYA_OK ? tsuya_mrcal_optimize(s, TSUYA_MRCAL_POSES) : status;
}

/* Robust residual of each photograph, and from it what its corners get on top of their own sigma. */
static tsuya_status reweigh(tsuya_solve *s)
{
    double *scratch = tsuya_calloc((size_t)s->observation_count, sizeof *scratch);
    if (!scratch) {
        return TSUYA_ERROR_MEMORY;
    }
    double all = typical_residual(s, scratch);
    for (int i = 0; i < s->observation_count; i++) {
        scratch[i] = s->observation[i].sigma_px;
    }
    double own = median(scratch, s->observation_count), common2 = fmax(all * all - own * own, 0.0);
    for (int p = 0; p < s->photo_count; p++) {
        s->photo_sigma_px[p] = NAN;
    }
    for (int begin = 0, end; begin < s->view_count; begin = end) {
        int photo = s->view[begin].photo, n = 0;
        for (end = begin; end < s->view_count && s->view[end].photo == photo; end++) {
        }
        int first = s->view[begin].first, last = s->view[end - 1].first + s->view[end - 1].count;
        for (int i = first; i < last; i++) {
            scratch[n++] = residual_norm(&s->observation[i]);
        }
        /* Poses take six numbers a view out of the residuals. */
        double freedom = 1.0 - fmin(0.75, 6.0 * (end - begin) / (2.0 * n));
        double sigma = median(scratch, n) / RAYLEIGH_MEDIAN / sqrt(freedom);
        s->photo_sigma_px[photo] = sigma;
        for (int i = 0; i < n; i++) {
            scratch[i] = s->observation[first + i].sigma_px;
        }
        double mine = median(scratch, n), share = n / (n + 40.0);
        double extra2 = share * fmax(sigma * sigma - mine * mine, 0.0) + (1.0 - share) * common2;
        for (int i = first; i < last; i++) {
            s->observation[i].weight_sigma_px = sqrt(s->observation[i].sigma_px * s->observation[i].sigma_px + extra2);
        }
    }
    tsuya_free(scratch);
    return TSUYA_OK;
}

/* Marks what lies beyond four robust sigmas; how many marks changed. */
static tsuya_status mark_outliers(int *changed, tsuya_solve *s)
{
    double *scratch = tsuya_calloc((size_t)s->observation_count, sizeof *scratch);
    if (!scratch) {
        return TSUYA_ERROR_MEMORY;
    }
    for (int i = 0; i < s->observation_count; i++) {
        scratch[i] = residual_norm(&s->observation[i]) / s->observation[i].weight_sigma_px;
    }
    double scale = median(scratch, s->observation_count) / RAYLEIGH_MEDIAN;
    *changed = 0;
    for (int i = 0; i < s->observation_count; i++) {
        tsuya_solve_observation *o = &s->observation[i];
        bool outlier = residual_norm(o) > TSUYA_OUTLIER_SIGMAS * scale * o->weight_sigma_px;
        *changed += outlier != o->outlier;
        o->outlier = outlier;
    }
    tsuya_free(scratch);
    return TSUYA_OK;
}

/* One step of the edges' bias and the plates' shapes, everything else moving with them.  Where the photographs do not determine
 * the camera nothing moves: that is said later. */
static tsuya_status step_shapes(tsuya_solve *s)
{
    int each = tsuya_solve_shape_parameters(s), shapes = s->board->plate_count * each;
    bool determined;
    double *step = tsuya_calloc(1 + (size_t)shapes, sizeof *step);
    if (!step) {
        return TSUYA_ERROR_MEMORY;
    }
    tsuya_status status = tsuya_covariance_step(step, &determined, s);
    if (status == TSUYA_OK && determined) {
        s->edge_bias += step[0];
        for (int i = 0; i < shapes; i++) {
            tsuya_plate_shape *shape = &s->shape[i / each];
            int k = i % each;
            *(k ? &shape->bend_m[k - 1] : &shape->growth) += step[1 + i];
        }
    }
    for (int i = 0; i < s->observation_count; i++) {
        tsuya_solve_observation *o = &s->observation[i];
        o->pixel = (tsuya_vec2){o->seen.x - s->edge_bias * o->spread_px.x, o->seen.y - s->edge_bias * o->spread_px.y};
    }
    tsuya_free(step);
    return status;
}

tsuya_status tsuya_solve_again(tsuya_solve *s)
{
    TSUYA_TRY(tsuya_mrcal_optimize(s, TSUYA_MRCAL_ALL));
    TSUYA_TRY(step_shapes(s));
    return tsuya_mrcal_optimize(s, TSUYA_MRCAL_ALL);
}

/* The rounds of a solve whose lens and start are set. */
static tsuya_status settle(tsuya_solve *s)
{
    for (int round = 0; round < MOST_ROUNDS; round++) {
        int changed;
        TSUYA_TRY(tsuya_mrcal_optimize(s, TSUYA_MRCAL_ALL));
        if (round < WEIGHT_ROUNDS) {
            TSUYA_TRY(reweigh(s));
        }
        TSUYA_TRY(mark_outliers(&changed, s));
        if (round < WEIGHT_ROUNDS) {
            TSUYA_TRY(step_shapes(s));
        }
        if (round >= WEIGHT_ROUNDS && changed == 0) {
            return TSUYA_OK;
        }
    }
    return tsuya_mrcal_optimize(s, TSUYA_MRCAL_ALL);
}

tsuya_status tsuya_solve_lens(tsuya_solve *s, tsuya_lens lens)
{
    int kept = entry_of(lens)->parameters < entry_of(s->camera.lens)->parameters ? entry_of(lens)->parameters : entry_of(s->camera.lens)->parameters;
    for (int i = kept - 4; i < 12; i++) {
        s->camera.distortion[i] = 0.0;
    }
    s->camera.spline = (tsuya_lens_spline){0};
    s->camera.lens = lens;
    s->prior = (tsuya_camera){0};
    return settle(s);
}

tsuya_status tsuya_solve_splined(tsuya_solve *s, int nx)
{
    s->prior = s->camera;
    s->camera_from_prior = tsuya_pose_identity();
    TSUYA_TRY(tsuya_spline_fit(&s->camera, &s->prior, nx));
    return settle(s);
}
