#include "reconstruct/join.h"

#include "core/context.h"
#include "core/memory.h"
#include "core/order.h"
#include "reconstruct/scale_points.h"

#include <math.h>
#include <string.h>

enum { LEAST_CORNERS = 8, LEAST_TAGS = 2, TRIALS = 300, STREAM_JOIN = 7300 };
static const double AGREE_PX = 2.0, AGREE_SHARE = 0.75, SIGMAS = 4.0, NORMAL_QUARTILE = 2.03; /* of a distance in space: chi of three, in sigmas, at 0.75 */

/* ---- the similarity ---- */

/* Corners that both know, in both frames. */
typedef struct common {
    tsuya_vec3 *here, *there;
    double *off, *sorted;
    int count, tags;
} common;

static void free_common(common *c)
{
    tsuya_free(c->here);
    tsuya_free(c->there);
    tsuya_free(c->off);
    tsuya_free(c->sorted);
}

static tsuya_status gather(common *c, const tsuya_scale_points *here, const tsuya_scale_points *there, int most)
{
    tsuya_status status = TSUYA_OK;
    int last = -1;
    TSUYA_NEW(status, c->here, (size_t)most);
    TSUYA_NEW(status, c->there, (size_t)most);
    TSUYA_NEW(status, c->off, (size_t)most);
    TSUYA_NEW(status, c->sorted, (size_t)most);
    for (int i = 0; i < most; i++) {
        if (here->point[i].found && there->point[i].found) {
            c->here[c->count] = here->point[i].position;
            c->there[c->count++] = there->point[i].position;
            c->tags += i / 4 != last;
            last = i / 4;
        }
    }
done:
    return status;
}

/* Fills `off`; the distance that three quarters of the corners keep within. */
static double spread(common *c, tsuya_similarity s)
{
    for (int i = 0; i < c->count; i++) {
        c->off[i] = c->sorted[i] = tsuya_vec3_norm(tsuya_vec3_sub(tsuya_similarity_apply(s, c->there[i]), c->here[i]));
    }
    tsuya_sort_doubles(c->sorted, (size_t)c->count);
    return c->sorted[(int)(AGREE_SHARE * (c->count - 1))];
}

/* Least quantile of squares over similarities through three corners (Rousseeuw 1984). */
static bool start(tsuya_similarity *best, common *c)
{
    double least = INFINITY, rms;
    for (int trial = 0; trial < TRIALS; trial++) {
        tsuya_vec3 a[3], b[3];
        for (int k = 0; k < 3; k++) {
            int i = (int)(tsuya_random_uniform(1, STREAM_JOIN, (uint64_t)(3 * trial + k)) * c->count);
            a[k] = c->here[i];
            b[k] = c->there[i];
        }
        tsuya_similarity own;
        if (tsuya_similarity_align(&own, &rms, a, b, 3)) {
            double far = spread(c, own);
            *best = far < least ? own : *best;
            least = fmin(far, least);
        }
    }
    return isfinite(least);
}

/* Then all corners within four sigmas of that. */
static bool align(tsuya_similarity *here_from_there, common *c)
{
    if (!start(here_from_there, c)) {
        return false;
    }
    double most = SIGMAS * spread(c, *here_from_there) / NORMAL_QUARTILE, rms;
    int kept = 0;
    for (int i = 0; i < c->count; i++) {
        if (c->off[i] <= most) {
            c->here[kept] = c->here[i];
            c->there[kept++] = c->there[i];
        }
    }
    c->count = kept;
    return tsuya_similarity_align(here_from_there, &rms, c->here, c->there, kept);
}

/* The other's photographs see the corners where `model` has them. */
static bool agree(const tsuya_sparse_model *model, const tsuya_sparse_model *moved, const tsuya_scale_points *here, const tsuya_scale_input *tags)
{
    int seen = 0, right = 0;
    for (int i = 0; i < tags->sighting_count; i++) {
        const tsuya_scale_sighting *s = &tags->sighting[i];
        int v = here->point[s->point].found ? tsuya_sparse_model_find(moved, s->photo) : -1;
        tsuya_vec2 pixel;
        if (v >= 0) {
            tsuya_vec3 p = tsuya_pose_apply(moved->view[v].camera_from_world, here->point[s->point].position);
            seen++;
            right += tsuya_camera_project(&model->camera[0], p, &pixel) && hypot(pixel.x - s->pixel.x, pixel.y - s->pixel.y) <= AGREE_PX;
        }
    }
    return seen >= LEAST_CORNERS && right >= AGREE_SHARE * seen;
}

static tsuya_similarity inverse(tsuya_similarity s)
{
    tsuya_similarity back = {.scale = 1.0 / s.scale, .rotation = tsuya_mat3_transpose(s.rotation)};
    back.translation = tsuya_vec3_scale(tsuya_mat3_apply(back.rotation, s.translation), -back.scale);
    return back;
}

/* ---- one model of two ---- */

/* Both models' views by name; where a view of the other went, −1: `model` has it already. */
static tsuya_status merge_views(tsuya_sparse_model *model, int *to_here, int *to_other, tsuya_sparse_model *other)
{
    tsuya_status status = TSUYA_OK;
    tsuya_view *view;
    int a = 0, b = 0, n = 0;
    TSUYA_NEW(status, view, (size_t)(model->view_count + other->view_count));
    while (a < model->view_count || b < other->view_count) {
        int order = a == model->view_count ? 1 : b == other->view_count ? -1 : strcmp(model->view[a].name, other->view[b].name);
        if (order <= 0) {
            to_here[a] = n;
            view[n++] = model->view[a++];
        }
        if (order == 0) {
            to_other[b++] = -1;
        } else if (order > 0) {
            to_other[b] = n;
            view[n] = other->view[b];
            view[n++].camera = 0;
            other->view[b++] = (tsuya_view){0};
        }
    }
    tsuya_free(model->view);
    model->view = view;
    model->view_count = n;
done:
    return status;
}

/* The other's points that at least two of the views that came still see. */
static tsuya_status merge_points(tsuya_sparse_model *model, const int *to_here, const int *to_other, tsuya_sparse_model *other)
{
    tsuya_status status = TSUYA_OK;
    tsuya_point *point;
    TSUYA_NEW(status, point, model->point_count + other->point_count + 1);
    if (model->point_count > 0) {
        memcpy(point, model->point, model->point_count * sizeof *point);
    }
    tsuya_free(model->point);
    model->point = point;
    for (size_t i = 0; i < model->point_count; i++) {
        for (int k = 0; k < point[i].track_count; k++) {
            point[i].track[k].view = to_here[point[i].track[k].view];
        }
    }
    for (size_t i = 0; i < other->point_count; i++) {
        tsuya_point *p = &other->point[i];
        int kept = 0;
        for (int k = 0; k < p->track_count; k++) {
            int v = to_other[p->track[k].view];
            if (v >= 0) {
                p->track[kept++] = (tsuya_track_element){v, p->track[k].observation};
            }
        }
        for (int k = 0; k < kept; k++) {
            model->view[p->track[k].view].observation[p->track[k].observation].point = kept >= 2 ? (int64_t)model->point_count : -1;
        }
        p->track_count = kept;
        if (kept >= 2) {
            model->point[model->point_count++] = *p;
            p->track = NULL;
        }
    }
    for (size_t i = 0; i < model->point_count; i++) {
        model->point[i].point_id = i + 1;
    }
done:
    return status;
}

static tsuya_status merge(tsuya_sparse_model *model, int *joined, tsuya_sparse_model *other)
{
    tsuya_status status = TSUYA_OK;
    int *to_here = NULL, *to_other = NULL, before = model->view_count;
    TSUYA_NEW(status, to_here, (size_t)model->view_count + 1);
    TSUYA_NEW(status, to_other, (size_t)other->view_count + 1);
    TSUYA_GOTO_DONE(status, merge_views(model, to_here, to_other, other));
    TSUYA_GOTO_DONE(status, merge_points(model, to_here, to_other, other));
    *joined = model->view_count - before;
done:
    tsuya_free(to_here);
    tsuya_free(to_other);
    return status;
}

tsuya_status tsuya_models_join(tsuya_sparse_model *model, int *joined, tsuya_sparse_model *other, const tsuya_scale_input *tags)
{
    const int most = tags ? 4 * tags->tag_count : 0;
    tsuya_scale_points here = {0}, there = {0};
    tsuya_status status = TSUYA_OK;
    common corners = {0};
    tsuya_similarity here_from_there;
    *joined = 0;
    if (most == 0 || model->camera_count != 1 || other->camera_count != 1) {
        return TSUYA_OK;
    }
    TSUYA_GOTO_DONE(status, tsuya_scale_points_create(&here, most, model, tags));
    TSUYA_GOTO_DONE(status, tsuya_scale_points_create(&there, most, other, tags));
    TSUYA_GOTO_DONE(status, gather(&corners, &here, &there, most));
    if (corners.count < LEAST_CORNERS || corners.tags < LEAST_TAGS || !align(&here_from_there, &corners)) {
        goto done;
    }
    tsuya_sparse_model_transform(other, here_from_there);
    if (!agree(model, other, &here, tags)) {
        tsuya_sparse_model_transform(other, inverse(here_from_there));
        goto done;
    }
    status = merge(model, joined, other);
done:
    tsuya_scale_points_free(&here);
    tsuya_scale_points_free(&there);
    free_common(&corners);
    return status;
}
