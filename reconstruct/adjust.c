#include "reconstruct/adjust.h"

#include "core/file.h"
#include "core/memory.h"
#include "core/order.h"
#include "reconstruct/adjust_tags.h"

#include <math.h>

/* FLOOR_PX: below it a residual is no error of a match, whatever the scatter.  FEW observations tell no scatter of their own. */
static const double CUT_SIGMAS = 4.0, FLOOR_PX = 0.1, MAPPER_PX = 4.0, SETTLED = 0.002;
/* A principal point is freed last, for so many photographs, and taken back when it goes farther than lenses are off centre. */
static const double CENTER_MOST = 0.03; /* of the longer side */
enum { MOST_ROUNDS = 8, FEW = 30, ENOUGH_FOR_CENTER = 10 };

typedef struct adjustment {
    tsuya_sparse_model *model; /* every observation of the mapper; poses and positions as adjusted last */
    tsuya_colmap *colmap;
    bool fixed_intrinsics, center;
    double *sigma_px;          /* per view */
    bool **keep;               /* per view and observation */
    int *kept;                 /* observations per point; a point that is dropped once has 0 for good */
    double *scratch;
} adjustment;

static double median(double *value, size_t count)
{
    tsuya_sort_doubles(value, count);
    return count > 0 ? value[count / 2] : 0.0;
}

static bool residual(double *dx, double *dy, const tsuya_sparse_model *model, const tsuya_view *view, const tsuya_observation *o)
{
    tsuya_vec2 pixel;
    tsuya_vec3 p = tsuya_pose_apply(view->camera_from_world, model->point[o->point].position);
    if (!tsuya_camera_project(&model->camera[view->camera], p, &pixel)) {
        return false;
    }
    *dx = pixel.x - (double)o->x_px;
    *dy = pixel.y - (double)o->y_px;
    return true;
}

/* |residual| along x and y of a view's observations, of points that are still there (`kept` NULL: all). */
static size_t residuals_of(double *value, const tsuya_sparse_model *model, const tsuya_view *view, const int *kept)
{
    size_t count = 0;
    double dx, dy;
    for (int k = 0; k < view->observation_count; k++) {
        const tsuya_observation *o = &view->observation[k];
        if (o->point >= 0 && (!kept || kept[o->point] > 0) && residual(&dx, &dy, model, view, o)) {
            value[count++] = fabs(dx);
            value[count++] = fabs(dy);
        }
    }
    return count;
}

/* Each view's scatter over the observations of points that are still there; views with few take the set's. */
static void measure(adjustment *a)
{
    const tsuya_sparse_model *m = a->model;
    double *spread = a->scratch;
    size_t views = 0;
    for (int v = 0; v < m->view_count; v++) {
        double *value = a->scratch + m->view_count;
        size_t count = residuals_of(value, m, &m->view[v], a->kept);
        a->sigma_px[v] = count >= 2 * FEW ? 1.4826 * median(value, count) : NAN;
        if (count >= 2 * FEW) {
            spread[views++] = a->sigma_px[v];
        }
    }
    double common = views > 0 ? median(spread, views) : MAPPER_PX / CUT_SIGMAS;
    for (int v = 0; v < m->view_count; v++) {
        a->sigma_px[v] = fmax(isnan(a->sigma_px[v]) ? common : a->sigma_px[v], FLOOR_PX / CUT_SIGMAS);
    }
}

/* Decides anew; returns how many observations changed sides. */
static size_t choose(adjustment *a, tsuya_adjust_info *info)
{
    tsuya_sparse_model *m = a->model;
    size_t changed = 0;
    info->kept = 0;
    for (size_t i = 0; i < m->point_count; i++) {
        a->kept[i] = a->kept[i] > 0 ? -1 : 0; /* −1: alive, counted below */
    }
    for (int pass = 0; pass < 2; pass++) {
        for (int v = 0; v < m->view_count; v++) {
            double limit = fmin(CUT_SIGMAS * a->sigma_px[v], MAPPER_PX), dx, dy;
            for (int k = 0; k < m->view[v].observation_count; k++) {
                const tsuya_observation *o = &m->view[v].observation[k];
                if (o->point < 0) {
                    continue;
                }
                int *count = &a->kept[o->point];
                bool fits = *count != 0 && residual(&dx, &dy, m, &m->view[v], o) && hypot(dx, dy) <= limit;
                if (pass == 0 && fits) {
                    *count = *count < 0 ? 1 : *count + 1;
                } else if (pass == 1) {
                    fits = fits && *count >= 2;
                    changed += fits != a->keep[v][k];
                    a->keep[v][k] = fits;
                    info->kept += fits;
                }
            }
        }
    }
    for (size_t i = 0; i < m->point_count; i++) {
        a->kept[i] = a->kept[i] >= 2 ? a->kept[i] : 0;
    }
    return changed;
}

/* The part that is kept, as a model of its own; point ids are the indices in the whole one, plus one. */
static tsuya_status extract(tsuya_sparse_model *part, const adjustment *a)
{
    const tsuya_sparse_model *m = a->model;
    tsuya_status status = TSUYA_OK;
    int64_t *index = NULL;
    *part = (tsuya_sparse_model){0};
    TSUYA_NEW(status, index, m->point_count);
    TSUYA_NEW(status, part->camera, (size_t)m->camera_count);
    TSUYA_NEW(status, part->camera_id, (size_t)m->camera_count);
    TSUYA_NEW(status, part->view, (size_t)m->view_count);
    TSUYA_NEW(status, part->point, m->point_count);
    part->camera_count = m->camera_count;
    for (int c = 0; c < m->camera_count; c++) {
        part->camera[c] = m->camera[c];
        part->camera_id[c] = m->camera_id[c];
    }
    for (size_t i = 0; i < m->point_count; i++) {
        index[i] = -1;
        if (a->kept[i] > 0) {
            tsuya_point *p = &part->point[part->point_count];
            *p = m->point[i];
            p->track = NULL;
            p->point_id = i + 1;
            index[i] = (int64_t)part->point_count++;
            TSUYA_NEW(status, p->track, (size_t)a->kept[i]);
            p->track_count = 0;
        }
    }
    for (int v = 0; v < m->view_count; v++) {
        tsuya_view *view = &part->view[v];
        *view = m->view[v];
        view->observation = NULL;
        view->name = tsuya_strdup(m->view[v].name);
        part->view_count++;
        TSUYA_NEW(status, view->observation, (size_t)view->observation_count);
        for (int k = 0; view->observation && k < view->observation_count; k++) {
            tsuya_observation *o = &view->observation[k];
            *o = m->view[v].observation[k];
            o->point = a->keep[v][k] ? index[o->point] : -1;
            if (o->point >= 0) {
                tsuya_point *p = &part->point[o->point];
                p->track[p->track_count++] = (tsuya_track_element){v, k};
            }
        }
        status = view->name ? status : TSUYA_ERROR_MEMORY;
    }
done:
    tsuya_free(index);
    return status;
}

/* Poses, lenses and positions of the part back into the whole. */
static tsuya_status adopt(adjustment *a, const tsuya_sparse_model *part, const char *folder)
{
    tsuya_sparse_model *m = a->model;
    if (part->view_count != m->view_count || part->camera_count != m->camera_count) {
        return tsuya_fail(TSUYA_ERROR_CHILD, "%s: colmap bundle_adjuster gave %d photographs back instead of %d", folder, part->view_count, m->view_count);
    }
    for (int v = 0; v < m->view_count; v++) {
        m->view[v].camera_from_world = part->view[v].camera_from_world;
    }
    for (int c = 0; c < m->camera_count; c++) {
        for (int k = 0; k < part->camera_count; k++) {
            if (part->camera_id[k] == m->camera_id[c]) {
                m->camera[c] = part->camera[k];
            }
        }
    }
    for (size_t i = 0; i < part->point_count; i++) {
        if (part->point[i].point_id >= 1 && part->point[i].point_id <= m->point_count) {
            m->point[part->point[i].point_id - 1].position = part->point[i].position;
        }
    }
    return TSUYA_OK;
}

static bool is_far(const tsuya_sparse_model *part)
{
    for (int c = 0; c < part->camera_count; c++) {
        const tsuya_camera *k = &part->camera[c];
        double limit = CENTER_MOST * fmax(k->width_px, k->height_px);
        if (!(hypot(k->cx_px - 0.5 * (k->width_px - 1), k->cy_px - 0.5 * (k->height_px - 1)) <= limit)) {
            return true;
        }
    }
    return false;
}

/* `done` where a freed principal point ran away: the model stays as it was. */
static tsuya_status round_trip(adjustment *a, bool *done)
{
    tsuya_sparse_model part = {0};
    tsuya_status status;
    char *input = tsuya_path_join(a->colmap->folder, "adjusting/from"), *output = tsuya_path_join(a->colmap->folder, "adjusting/to");
    TSUYA_GOTO_DONE(status, input && output ? TSUYA_OK : TSUYA_ERROR_MEMORY);
    TSUYA_GOTO_DONE(status, extract(&part, a));
    TSUYA_GOTO_DONE(status, tsuya_folder_make(input));
    TSUYA_GOTO_DONE(status, tsuya_sparse_model_save_binary(&part, input));
    tsuya_sparse_model_free(&part);
    TSUYA_GOTO_DONE(status, tsuya_colmap_adjust(a->colmap, "adjusting/from", "adjusting/to", a->fixed_intrinsics ? TSUYA_ADJUST_POSES : a->center ? TSUYA_ADJUST_CENTER : TSUYA_ADJUST_LENS));
    TSUYA_GOTO_DONE(status, tsuya_sparse_model_load(&part, output));
    *done = a->center && is_far(&part);
    status = *done ? TSUYA_OK : adopt(a, &part, output);
done:
    tsuya_sparse_model_free(&part);
    tsuya_free(input);
    tsuya_free(output);
    return status;
}

static void set_errors(tsuya_sparse_model *model)
{
    for (size_t i = 0; i < model->point_count; i++) {
        tsuya_point *p = &model->point[i];
        double sum = 0.0, dx, dy;
        for (int k = 0; k < p->track_count; k++) {
            const tsuya_view *view = &model->view[p->track[k].view];
            sum += residual(&dx, &dy, model, view, &view->observation[p->track[k].observation]) ? hypot(dx, dy) : 0.0;
        }
        p->error_px = p->track_count > 0 ? sum / p->track_count : 0.0;
    }
}

/* Median over the views of the scatter of their observations, of points up to `features` (point_id, which goes on with the corners
 * of tags) or of those above; views with few tell none, and NAN where none does. */
static double typical(double *scratch, const tsuya_sparse_model *m, size_t features, bool corners)
{
    double *value = scratch + m->view_count, dx, dy;
    size_t views = 0;
    for (int v = 0; v < m->view_count; v++) {
        size_t count = 0;
        for (int k = 0; k < m->view[v].observation_count; k++) {
            const tsuya_observation *o = &m->view[v].observation[k];
            if (o->point >= 0 && (m->point[o->point].point_id > features) == corners && residual(&dx, &dy, m, &m->view[v], o)) {
                value[count++] = fabs(dx);
                value[count++] = fabs(dy);
            }
        }
        if (count >= 2 * FEW) {
            scratch[views++] = 1.4826 * median(value, count);
        }
    }
    return views > 0 ? median(scratch, views) : NAN;
}

/* No view is taken to be sharper than most: few observations follow the pose that they hold. */
static void raise_to_median(adjustment *a)
{
    const size_t count = (size_t)a->model->view_count;
    for (size_t v = 0; v < count; v++) {
        a->scratch[v] = a->sigma_px[v];
    }
    double least = median(a->scratch, count);
    for (size_t v = 0; v < count; v++) {
        a->sigma_px[v] = fmax(a->sigma_px[v], least);
    }
}

static tsuya_status begin(adjustment *a, tsuya_adjust_info *info)
{
    const tsuya_sparse_model *m = a->model;
    tsuya_status status = TSUYA_OK;
    size_t most = 0;
    TSUYA_NEW(status, a->sigma_px, (size_t)m->view_count);
    TSUYA_NEW(status, a->keep, (size_t)m->view_count);
    TSUYA_NEW(status, a->kept, m->point_count);
    for (int v = 0; v < m->view_count; v++) {
        const tsuya_view *view = &m->view[v];
        TSUYA_NEW(status, a->keep[v], (size_t)view->observation_count);
        most = (size_t)view->observation_count > most ? (size_t)view->observation_count : most;
        for (int k = 0; k < view->observation_count; k++) {
            info->observations += view->observation[k].point >= 0;
        }
    }
    TSUYA_NEW(status, a->scratch, (size_t)m->view_count + 2 * most);
    for (size_t i = 0; i < m->point_count; i++) {
        a->kept[i] = m->point[i].track_count;
    }
done:
    return status;
}

/* Of all features together: 1.4826 × median |residual| per coordinate. */
static tsuya_status scatter(double *sigma_px, const tsuya_sparse_model *model)
{
    size_t most = 0, count = 0;
    for (int v = 0; v < model->view_count; v++) {
        most += 2 * (size_t)model->view[v].observation_count;
    }
    double *value = tsuya_calloc(most + 1, sizeof *value);
    if (!value) {
        return TSUYA_ERROR_MEMORY;
    }
    for (int v = 0; v < model->view_count; v++) {
        count += residuals_of(value + count, model, &model->view[v], NULL);
    }
    *sigma_px = 1.4826 * median(value, count);
    tsuya_free(value);
    return TSUYA_OK;
}

static tsuya_status add_tags(tsuya_sparse_model *model, tsuya_adjust_info *info, int *observations, const tsuya_scale_input *tags)
{
    double sigma_px = 0.0;
    for (int v = 0; v < model->view_count; v++) {
        observations[v] = model->view[v].observation_count;
    }
    for (size_t i = 0; i < model->point_count; i++) {
        model->point[i].point_id = i + 1;
    }
    if (tags) {
        TSUYA_TRY(scatter(&sigma_px, model));
    }
    return tsuya_tags_append(model, &info->tag_observations, tags, sigma_px);
}

static tsuya_status adjust(adjustment *a, tsuya_adjust_info *info, tsuya_tie *tie, size_t features)
{
    tsuya_sparse_model *model = a->model, part = {0};
    tsuya_status status = TSUYA_OK;
    TSUYA_GOTO_DONE(status, begin(a, info));
    bool done = false, can_center = !a->fixed_intrinsics && model->view_count >= ENOUGH_FOR_CENTER;
    for (info->rounds = 0; info->rounds < MOST_ROUNDS && !done; info->rounds++) {
        measure(a);
        bool settled = (double)choose(a, info) < SETTLED * (double)info->observations;
        if (info->kept < 3 * (size_t)model->view_count || (settled && (a->center || !can_center))) {
            break;
        }
        a->center = a->center || (can_center && (settled || info->rounds == MOST_ROUNDS / 2));
        tsuya_progress_update(a->colmap->context, "adjustment", info->rounds, MOST_ROUNDS, NULL);
        TSUYA_GOTO_DONE(status, round_trip(a, &done));
    }
    if (info->rounds > 0) {
        TSUYA_GOTO_DONE(status, extract(&part, a));
        set_errors(&part);
        tsuya_sparse_model whole = *model;
        *model = part;
        part = whole;
    }
    info->sigma_px = typical(a->scratch, model, features, false);
    info->tag_sigma_px = info->tag_observations > 0 ? typical(a->scratch, model, features, true) : 0.0;
    if (tie) {
        raise_to_median(a);
        status = tsuya_ties_measure(tie, model, a->sigma_px);
    }
done:
    for (int v = 0; a->keep && v < model->view_count; v++) {
        tsuya_free(a->keep[v]);
    }
    tsuya_sparse_model_free(&part);
    tsuya_free(a->sigma_px);
    tsuya_free(a->keep);
    tsuya_free(a->kept);
    tsuya_free(a->scratch);
    return status;
}

tsuya_status tsuya_adjust(tsuya_sparse_model *model, tsuya_adjust_info *info, tsuya_tie *tie, tsuya_colmap *colmap, bool fixed_intrinsics,
                          const tsuya_scale_input *tags)
{
    adjustment a = {.model = model, .colmap = colmap, .fixed_intrinsics = fixed_intrinsics};
    tsuya_status status = TSUYA_OK;
    const size_t points = model->point_count;
    int *observations = NULL;
    char *folder = tsuya_path_join(colmap->folder, "adjusting");
    *info = (tsuya_adjust_info){0};
    TSUYA_GOTO_DONE(status, folder ? TSUYA_OK : TSUYA_ERROR_MEMORY);
    for (int v = 0; tie && v < model->view_count; v++) {
        tie[v] = (tsuya_tie){0, INFINITY, INFINITY};
    }
    if (points == 0 || model->view_count < 2) {
        goto done;
    }
    TSUYA_NEW(status, observations, (size_t)model->view_count);
    TSUYA_GOTO_DONE(status, add_tags(model, info, observations, tags));
    TSUYA_GOTO_DONE(status, adjust(&a, info, tie, points));
    tsuya_tags_strip(model, points, observations);
    status = tsuya_folder_remove(folder);
done:
    tsuya_free(observations);
    tsuya_free(folder);
    return status;
}
