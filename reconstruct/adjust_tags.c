#include "reconstruct/adjust_tags.h"

#include "core/dense.h"
#include "core/memory.h"
#include "reconstruct/scale_points.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_WEIGHT = 4, LEAST_CORNERS = 8, STEPS = 30 };
static const double AGREE_PX = 2.0, AGREE_SHARE = 0.75, FIRST_SPREAD_PX = 200.0, SPREAD_FALLS = 0.7;

/* ---- corners as observations ---- */

static int weight_of(const tsuya_scale_sighting *s, double feature_sigma_px)
{
    double ratio = s->sigma_px > 0.0 ? feature_sigma_px / s->sigma_px : 1.0;
    return (int)fmin(fmax(floor(ratio * ratio + 0.5), 1.0), MOST_WEIGHT);
}

/* Sightings that count, by view and by point. */
static void count_sightings(int *of_view, int *of_point, const tsuya_sparse_model *model, const tsuya_scale_points *points,
                            const tsuya_scale_input *tags, double feature_sigma_px)
{
    for (int i = 0; i < tags->sighting_count; i++) {
        const tsuya_scale_sighting *s = &tags->sighting[i];
        int v = points->point[s->point].found ? tsuya_sparse_model_find(model, s->photo) : -1;
        if (v >= 0) {
            of_view[v] += weight_of(s, feature_sigma_px);
            of_point[s->point] += weight_of(s, feature_sigma_px);
        }
    }
}

static tsuya_status make_room(tsuya_sparse_model *model, const int *of_view, const int *of_point, int count)
{
    tsuya_status status = TSUYA_OK;
    size_t more = 0;
    for (int i = 0; i < count; i++) {
        more += of_point[i] > 0;
    }
    tsuya_point *point;
    TSUYA_NEW(status, point, model->point_count + more);
    memcpy(point, model->point, model->point_count * sizeof *point);
    tsuya_free(model->point);
    model->point = point;
    for (int v = 0; v < model->view_count; v++) {
        tsuya_view *view = &model->view[v];
        tsuya_observation *observation;
        TSUYA_NEW(status, observation, (size_t)(view->observation_count + of_view[v]));
        if (view->observation_count > 0) {
            memcpy(observation, view->observation, (size_t)view->observation_count * sizeof *observation);
        }
        tsuya_free(view->observation);
        view->observation = observation;
    }
done:
    return status;
}

static void observe(tsuya_sparse_model *model, int64_t point, int v, tsuya_vec2 pixel)
{
    tsuya_view *view = &model->view[v];
    tsuya_point *p = &model->point[point];
    view->observation[view->observation_count] = (tsuya_observation){(float)pixel.x, (float)pixel.y, point};
    p->track[p->track_count++] = (tsuya_track_element){v, view->observation_count++};
}

tsuya_status tsuya_tags_append(tsuya_sparse_model *model, size_t *added, const tsuya_scale_input *tags, double feature_sigma_px)
{
    const int count = tags ? 4 * tags->tag_count : 0;
    tsuya_scale_points points = {0};
    tsuya_status status = TSUYA_OK;
    int *of_view = NULL, *of_point = NULL;
    int64_t *index = NULL;
    *added = 0;
    if (count == 0) {
        return TSUYA_OK;
    }
    TSUYA_GOTO_DONE(status, tsuya_scale_points_create(&points, count, model, tags));
    TSUYA_NEW(status, of_view, (size_t)model->view_count);
    TSUYA_NEW(status, of_point, (size_t)count);
    TSUYA_NEW(status, index, (size_t)count);
    count_sightings(of_view, of_point, model, &points, tags, feature_sigma_px);
    TSUYA_GOTO_DONE(status, make_room(model, of_view, of_point, count));
    for (int i = 0; i < count; i++) {
        if (of_point[i] > 0) {
            tsuya_point *p = &model->point[model->point_count];
            *p = (tsuya_point){.position = points.point[i].position, .point_id = model->point_count + 1};
            index[i] = (int64_t)model->point_count++;
            TSUYA_NEW(status, p->track, (size_t)of_point[i]);
        }
    }
    for (int i = 0; i < tags->sighting_count; i++) {
        const tsuya_scale_sighting *s = &tags->sighting[i];
        int v = of_point[s->point] > 0 ? tsuya_sparse_model_find(model, s->photo) : -1;
        for (int k = 0; v >= 0 && k < weight_of(s, feature_sigma_px); k++) {
            observe(model, index[s->point], v, s->pixel);
            ++*added;
        }
    }
done:
    tsuya_scale_points_free(&points);
    tsuya_free(of_view);
    tsuya_free(of_point);
    tsuya_free(index);
    return status;
}

void tsuya_tags_strip(tsuya_sparse_model *model, uint64_t points, const int *observations)
{
    while (model->point_count > 0 && model->point[model->point_count - 1].point_id > points) {
        tsuya_free(model->point[--model->point_count].track);
    }
    for (int v = 0; v < model->view_count; v++) {
        model->view[v].observation_count = observations[v];
    }
}

/* ---- poses from corners ---- */

typedef struct corner {
    tsuya_vec3 position;
    double u, v, focal; /* on the plane z = 1, and pixels per unit of it */
} corner;

static bool residual(double r[2], tsuya_vec3 *in_camera, tsuya_pose pose, const corner *k)
{
    *in_camera = tsuya_pose_apply(pose, k->position);
    if (!(in_camera->z > 0.0)) {
        return false;
    }
    r[0] = k->focal * (k->u - in_camera->x / in_camera->z);
    r[1] = k->focal * (k->v - in_camera->y / in_camera->z);
    return true;
}

static void accumulate(double a[6 * 6], double b[6], const corner *k, tsuya_pose pose, double spread_px)
{
    double r[2];
    tsuya_vec3 c;
    if (!residual(r, &c, pose, k)) {
        return;
    }
    double weight = 1.0 / (1.0 + (r[0] * r[0] + r[1] * r[1]) / (spread_px * spread_px));
    tsuya_vec3 row[2] = {{k->focal / c.z, 0, -k->focal * c.x / (c.z * c.z)}, {0, k->focal / c.z, -k->focal * c.y / (c.z * c.z)}};
    for (int i = 0; i < 2; i++) {
        tsuya_vec3 turn = tsuya_vec3_cross(c, row[i]); /* of a small rotation in the camera's frame */
        double j[6] = {turn.x, turn.y, turn.z, row[i].x, row[i].y, row[i].z};
        for (int m = 0; m < 6; m++) {
            for (int n = 0; n < 6; n++) {
                a[6 * m + n] += weight * j[m] * j[n];
            }
            b[m] += weight * j[m] * r[i];
        }
    }
}

/* Gauss–Newton on the reprojection error with Cauchy's weight, whose width falls to what agreement means. */
static bool settle(tsuya_pose *pose, const corner *k, int n)
{
    double spread = FIRST_SPREAD_PX;
    for (int step = 0; step < STEPS; step++) {
        double a[6 * 6] = {0}, x[6] = {0};
        for (int i = 0; i < n; i++) {
            accumulate(a, x, &k[i], *pose, spread);
        }
        for (int i = 0; i < 6; i++) {
            a[7 * i] *= 1.0 + 1e-6;
        }
        if (!tsuya_dense_cholesky(a, 6)) {
            return false;
        }
        tsuya_dense_forward(a, x, 6, 1);
        tsuya_dense_backward(a, x, 6, 1);
        tsuya_pose moved = {tsuya_mat3_from_rodrigues((tsuya_vec3){x[0], x[1], x[2]}), {x[3], x[4], x[5]}};
        *pose = tsuya_pose_compose(moved, *pose);
        spread = fmax(AGREE_PX, SPREAD_FALLS * spread);
    }
    return true;
}

static int agreeing(double *sum, tsuya_pose pose, const corner *k, int n)
{
    int count = 0;
    double r[2];
    tsuya_vec3 c;
    *sum = 0.0;
    for (int i = 0; i < n; i++) {
        bool seen = residual(r, &c, pose, &k[i]);
        double d = seen ? hypot(r[0], r[1]) : INFINITY;
        count += d <= AGREE_PX;
        *sum += fmin(d, AGREE_PX);
    }
    return count;
}

/* The best of what comes out of every registered photograph's pose as a start. */
static bool find_pose(tsuya_pose *best, const tsuya_sparse_model *model, const corner *k, int n)
{
    double least = INFINITY, sum;
    int most = 0;
    for (int v = 0; v < model->view_count; v++) {
        tsuya_pose pose = model->view[v].camera_from_world;
        if (settle(&pose, k, n)) {
            int count = agreeing(&sum, pose, k, n);
            if (sum < least) {
                least = sum;
                most = count;
                *best = pose;
            }
        }
    }
    return most >= LEAST_CORNERS && most >= AGREE_SHARE * n;
}

static int gather(corner *out, int *tag_count, const char *photo, const tsuya_camera *camera, const tsuya_scale_points *points, const tsuya_scale_input *tags)
{
    int n = 0, last = -1;
    *tag_count = 0;
    for (int i = 0; i < tags->sighting_count; i++) { /* by point */
        const tsuya_scale_sighting *s = &tags->sighting[i];
        tsuya_vec3 d;
        if (points->point[s->point].found && strcmp(s->photo, photo) == 0 && tsuya_camera_unproject(camera, s->pixel, &d) && d.z > 1e-3) {
            out[n++] = (corner){points->point[s->point].position, d.x / d.z, d.y / d.z, sqrt(camera->fx_px * camera->fy_px)};
            *tag_count += s->point / 4 != last;
            last = s->point / 4;
        }
    }
    return n;
}

/* Into its place by name; tracks name views by index. */
static tsuya_status insert_view(tsuya_sparse_model *model, const tsuya_database_image *image, tsuya_pose pose)
{
    tsuya_status status = TSUYA_OK;
    tsuya_view *view;
    char *name = tsuya_strdup(image->name);
    int at = 0;
    TSUYA_GOTO_DONE(status, name ? TSUYA_OK : TSUYA_ERROR_MEMORY);
    TSUYA_NEW(status, view, (size_t)model->view_count + 1);
    while (at < model->view_count && strcmp(model->view[at].name, name) < 0) {
        at++;
    }
    memcpy(view, model->view, (size_t)at * sizeof *view);
    memcpy(view + at + 1, model->view + at, (size_t)(model->view_count - at) * sizeof *view);
    view[at] = (tsuya_view){.image_id = image->image_id, .camera_id = model->camera_id[0], .name = name, .camera_from_world = pose};
    tsuya_free(model->view);
    model->view = view;
    model->view_count++;
    for (size_t i = 0; i < model->point_count; i++) {
        for (int k = 0; k < model->point[i].track_count; k++) {
            model->point[i].track[k].view += model->point[i].track[k].view >= at;
        }
    }
    name = NULL;
done:
    tsuya_free(name);
    return status;
}

tsuya_status tsuya_tags_place(tsuya_sparse_model *model, int *placed, const tsuya_database *database, const tsuya_scale_input *tags)
{
    tsuya_scale_points points = {0};
    tsuya_status status = TSUYA_OK;
    corner *corners = NULL;
    *placed = 0;
    if (!tags || tags->tag_count == 0 || model->camera_count != 1) {
        return TSUYA_OK;
    }
    TSUYA_GOTO_DONE(status, tsuya_scale_points_create(&points, 4 * tags->tag_count, model, tags));
    TSUYA_NEW(status, corners, (size_t)tags->sighting_count);
    for (int i = 0; i < database->image_count; i++) {
        const tsuya_database_image *image = &database->image[i];
        tsuya_pose pose = tsuya_pose_identity();
        int seen;
        if (tsuya_sparse_model_find(model, image->name) >= 0) {
            continue;
        }
        int n = gather(corners, &seen, image->name, &model->camera[0], &points, tags);
        if (seen >= 2 && n >= LEAST_CORNERS && find_pose(&pose, model, corners, n)) {
            TSUYA_GOTO_DONE(status, insert_view(model, image, pose));
            ++*placed;
        }
    }
done:
    tsuya_scale_points_free(&points);
    tsuya_free(corners);
    return status;
}
