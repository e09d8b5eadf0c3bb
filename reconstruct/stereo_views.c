#include "reconstruct/stereo_views.h"

#include "core/order.h"

#include <stdlib.h>
#include <string.h>

enum {
    LEAST_POINTS = 8,  /* that a reference sees, and that it shares with a source */
    LEAST_SOURCES = 2, /* fewer are filled up by the poses alone */
};

static bool is_named(const char *name, const char *const *names, int count)
{
    for (int i = 0; i < count; i++) {
        if (strcmp(name, names[i]) == 0) {
            return true;
        }
    }
    return false;
}

static double point_depth(const tsuya_view *view, tsuya_vec3 position)
{
    return tsuya_pose_apply(view->camera_from_world, position).z;
}

static bool in_picture(const tsuya_sparse_model *model, int view, tsuya_vec3 position)
{
    const tsuya_camera *camera = &model->camera[model->view[view].camera];
    tsuya_vec2 pixel;
    return tsuya_camera_project(camera, tsuya_pose_apply(model->view[view].camera_from_world, position), &pixel) && pixel.x >= -0.5 &&
           pixel.y >= -0.5 && pixel.x <= camera->width_px - 0.5 && pixel.y <= camera->height_px - 0.5;
}

/* From the depths of the view's own points, or, where it has too few, of all points that fall into its picture: 1 % and
 * 99 % quantiles, widened by a quarter.  False with too few points. */
static bool depth_range(tsuya_view_plan *plan, const tsuya_sparse_model *model, int index, double *depth)
{
    const tsuya_view *view = &model->view[index];
    int count = 0;
    for (int i = 0; i < view->observation_count; i++) {
        if (view->observation[i].point >= 0) {
            double z = point_depth(view, model->point[view->observation[i].point].position);
            if (z > 0.0) {
                depth[count++] = z;
            }
        }
    }
    if (count < LEAST_POINTS) {
        count = 0;
        for (size_t i = 0; i < model->point_count; i++) {
            if (in_picture(model, index, model->point[i].position)) {
                depth[count++] = point_depth(view, model->point[i].position);
            }
        }
    }
    if (count < LEAST_POINTS) {
        return false;
    }
    tsuya_sort_doubles(depth, (size_t)count);
    plan->depth_min = 0.75 * depth[(int)(0.01 * (count - 1))];
    plan->depth_max = 1.25 * depth[(int)ceil(0.99 * (count - 1))];
    return true;
}

/* What one shared point says for a pair of views. */
static double pair_score(const tsuya_sparse_model *model, int a, int b, tsuya_vec3 position)
{
    const double best = tsuya_rad_from_deg(10.0);
    const tsuya_view *va = &model->view[a], *vb = &model->view[b];
    tsuya_vec3 ra = tsuya_vec3_sub(tsuya_pose_center(va->camera_from_world), position);
    tsuya_vec3 rb = tsuya_vec3_sub(tsuya_pose_center(vb->camera_from_world), position);
    double angle = atan2(tsuya_vec3_norm(tsuya_vec3_cross(ra, rb)), tsuya_vec3_dot(ra, rb));
    double sigma = tsuya_rad_from_deg(angle < best ? 5.0 : 12.0), off = (angle - best) / sigma;
    double za = point_depth(va, position), zb = point_depth(vb, position);
    if (!(za > 0.0 && zb > 0.0)) {
        return 0.0;
    }
    double scale = model->camera[va->camera].fx_px / za / (model->camera[vb->camera].fx_px / zb);
    scale = scale < 1.0 ? scale : 1.0 / scale;
    return exp(-0.5 * off * off) * scale * scale;
}

typedef struct candidate { double score; int shared, view; } candidate;

static int compare_candidate(const void *a, const void *b)
{
    const candidate *x = a, *y = b;
    return x->score != y->score ? (x->score < y->score) - (x->score > y->score) : (x->view > y->view) - (x->view < y->view);
}

static void score_sources(candidate *out, const tsuya_sparse_model *model, int reference)
{
    const tsuya_view *view = &model->view[reference];
    for (int v = 0; v < model->view_count; v++) {
        out[v] = (candidate){.view = v};
    }
    for (int i = 0; i < view->observation_count; i++) {
        if (view->observation[i].point < 0) {
            continue;
        }
        const tsuya_point *p = &model->point[view->observation[i].point];
        for (int t = 0; t < p->track_count; t++) {
            int other = p->track[t].view;
            if (other != reference) {
                out[other].shared++;
                out[other].score += pair_score(model, reference, other, p->position);
            }
        }
    }
}

/* Where a view has too few points of its own, as given poses of bare objects have: the views that look at the same place
 * from nearly the same side, told by the whole model's points as if nothing stood before them.  Such a source weighs less
 * than any that shares points. */
static void score_by_poses(candidate *out, const tsuya_sparse_model *model, int reference)
{
    enum { MOST = 2000 };
    const size_t step = model->point_count / MOST + 1;
    const double least_facing = cos(tsuya_rad_from_deg(40.0));
    tsuya_vec3 axis = tsuya_mat3_apply_transposed(model->view[reference].camera_from_world.rotation, tsuya_vec3_make(0, 0, 1));
    for (int v = 0; v < model->view_count; v++) {
        tsuya_vec3 other = tsuya_mat3_apply_transposed(model->view[v].camera_from_world.rotation, tsuya_vec3_make(0, 0, 1));
        if (v == reference || out[v].shared >= LEAST_POINTS || tsuya_vec3_dot(axis, other) < least_facing) {
            continue;
        }
        int both = 0;
        double sum = 0.0;
        for (size_t i = 0; i < model->point_count; i += step) {
            tsuya_vec3 position = model->point[i].position;
            if (in_picture(model, reference, position) && in_picture(model, v, position)) {
                sum += pair_score(model, reference, v, position);
                both++;
            }
        }
        if (both >= LEAST_POINTS) {
            out[v].shared = both;
            out[v].score = 1e-3 * sum / both;
        }
    }
}

static int sharing(const candidate *candidates, const tsuya_view_plan *all, int count)
{
    int enough = 0;
    for (int v = 0; v < count; v++) {
        enough += candidates[v].shared >= LEAST_POINTS && candidates[v].score > 0.0 && !all[candidates[v].view].held_out;
    }
    return enough;
}

static bool choose_sources(tsuya_view_plan *plan, const tsuya_view_plan *all, const tsuya_sparse_model *model,
                           candidate *candidates, int reference, int source_views)
{
    score_sources(candidates, model, reference);
    if (sharing(candidates, all, model->view_count) < LEAST_SOURCES) {
        score_by_poses(candidates, model, reference);
    }
    qsort(candidates, (size_t)model->view_count, sizeof *candidates, compare_candidate);
    plan->source_count = 0;
    for (int k = 0; k < model->view_count && plan->source_count < source_views; k++) {
        if (candidates[k].shared >= LEAST_POINTS && candidates[k].score > 0.0 && !all[candidates[k].view].held_out) {
            plan->source[plan->source_count++] = candidates[k].view;
        }
    }
    return plan->source_count > 0;
}

/* A source must be a reference too, for the second pass reads its map.  Dropping one may starve another. */
static int drop_mapless_sources(tsuya_view_plan *plan, int count)
{
    int used = 0;
    for (bool changed = true; changed;) {
        changed = false;
        used = 0;
        for (int v = 0; v < count; v++) {
            int kept = 0;
            for (int k = 0; k < plan[v].source_count; k++) {
                if (plan[plan[v].source[k]].used) {
                    plan[v].source[kept++] = plan[v].source[k];
                }
            }
            plan[v].source_count = kept;
            changed |= plan[v].used && kept == 0;
            plan[v].used &= kept > 0;
            used += plan[v].used;
        }
    }
    return used;
}

tsuya_status tsuya_view_plans_make(tsuya_view_plan **plans, const tsuya_sparse_model *model, const char *const *hold_out,
                                   int hold_out_count, int source_views, const char *workspace, tsuya_arena *arena)
{
    if (model->point_count == 0) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s/sparse: the model has no points; stereo needs them for the range of "
                          "depth and the choice of neighbours (triangulate them first)", workspace);
    }
    int most = (int)model->point_count;
    for (int v = 0; v < model->view_count; v++) {
        most = model->view[v].observation_count > most ? model->view[v].observation_count : most;
    }
    tsuya_view_plan *plan = tsuya_arena_alloc(arena, (size_t)model->view_count, sizeof *plan);
    double *depth = tsuya_arena_alloc(arena, (size_t)most, sizeof *depth);
    candidate *candidates = tsuya_arena_alloc(arena, (size_t)model->view_count, sizeof *candidates);
    if (!plan || !depth || !candidates) {
        return TSUYA_ERROR_MEMORY;
    }
    for (int v = 0; v < model->view_count; v++) {
        plan[v].held_out = is_named(model->view[v].name, hold_out, hold_out_count);
        plan[v].source = tsuya_arena_alloc(arena, (size_t)source_views, sizeof *plan[v].source);
        if (!plan[v].source) {
            return TSUYA_ERROR_MEMORY;
        }
    }
    for (int v = 0; v < model->view_count; v++) {
        plan[v].used = !plan[v].held_out && depth_range(&plan[v], model, v, depth) &&
                       choose_sources(&plan[v], plan, model, candidates, v, source_views);
    }
    int used = drop_mapless_sources(plan, model->view_count);
    if (used == 0) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s/sparse: none of the %d photographs shares %d points with another",
                          workspace, model->view_count, LEAST_POINTS);
    }
    *plans = plan;
    return TSUYA_OK;
}

void tsuya_view_plans_warn(const tsuya_view_plan *plan, const tsuya_sparse_model *model)
{
    for (int v = 0; v < model->view_count; v++) {
        if (!plan[v].used && !plan[v].held_out) {
            tsuya_warn("%s: sees too few points or shares too few with any other photograph (%d are needed); "
                       "it gets no depth map", model->view[v].name, LEAST_POINTS);
        }
    }
}
