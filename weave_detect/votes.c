#include "weave_detect/votes.h"

#include "core/camera.h"
#include "core/file.h"
#include "core/image.h"
#include "core/memory.h"
#include "core/order.h"
#include "core/raster.h"
#include "weave_detect/detector.h"

#include <string.h>

enum { LOOKS = 9, WINDOW_MAX = 512 }; /* LOOKS a side: where the surface under a patch is looked up */
static const double COS_MIN = 0.3, HIT_SHARE = 0.9;
static const double FLATNESS = 0.06; /* rms distance from the fitted plane over the patch's side */
static const double NORMALS_AGREE = 0.85;

/* A patch of one photograph on the surface. */
typedef struct patch_node {
    bool valid;
    tsuya_vec3 position, normal;   /* world; the normal faces the camera */
    tsuya_vec3 a, b, flow;         /* world, unit */
    double period_a, period_b, sigma_rad, confidence, flow_weight, facing;
} patch_node;

typedef struct view_job {
    const tsuya_mesh *mesh;
    const tsuya_view *view;
    const tsuya_camera *camera;
    tsuya_raster raster;
    tsuya_image grey;
    int patch_px, step_px, columns, rows;
    patch_node *node;
} view_job;

void tsuya_tangent_basis(tsuya_vec3 *first, tsuya_vec3 *second, tsuya_vec3 normal)
{
    tsuya_vec3 n = tsuya_vec3_dot(normal, normal) > 0.0 ? normal : (tsuya_vec3){0, 0, 1};
    double sign = copysign(1.0, n.z), a = -1.0 / (sign + n.z), b = n.x * n.y * a;
    *first = (tsuya_vec3){1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x};
    *second = (tsuya_vec3){b, sign + n.y * n.y * a, -n.y};
}

/* Plane through the surface under a patch, camera frame: z = p0 + p1·x + p2·y by least squares over the looks that hit. */
typedef struct plane {
    tsuya_vec3 centre, normal;
    double rms;
} plane;

static tsuya_vec3 point_at(const view_job *job, int x, int y)
{
    double z = (double)job->raster.depth[(size_t)y * (size_t)job->raster.width_px + (size_t)x];
    return (tsuya_vec3){(x - job->camera->cx_px) / job->camera->fx_px * z, (y - job->camera->cy_px) / job->camera->fy_px * z, z};
}

static bool fit_plane(plane *fit, const view_job *job, int x0, int y0)
{
    tsuya_vec3 p[LOOKS * LOOKS], sum = {0, 0, 0};
    int n = 0;
    for (int k = 0; k < LOOKS * LOOKS; k++) {
        int x = x0 + (k % LOOKS) * (job->patch_px - 1) / (LOOKS - 1), y = y0 + (k / LOOKS) * (job->patch_px - 1) / (LOOKS - 1);
        if (job->raster.depth[(size_t)y * (size_t)job->raster.width_px + (size_t)x] > 0.0f) {
            p[n] = point_at(job, x, y);
            sum = tsuya_vec3_add(sum, p[n++]);
        }
    }
    if (n < HIT_SHARE * LOOKS * LOOKS) {
        return false;
    }
    tsuya_vec3 mean = tsuya_vec3_scale(sum, 1.0 / n);
    tsuya_mat3 scatter = {{{0}}}, vectors;
    double values[3];
    for (int i = 0; i < n; i++) {
        tsuya_vec3 d = tsuya_vec3_sub(p[i], mean);
        const double e[3] = {d.x, d.y, d.z};
        for (int r = 0; r < 3; r++) {
            for (int c = 0; c < 3; c++) {
                scatter.e[r][c] += e[r] * e[c] / n;
            }
        }
    }
    tsuya_mat3_eigen_symmetric(scatter, values, &vectors);
    fit->normal = tsuya_vec3_unit((tsuya_vec3){vectors.e[0][0], vectors.e[1][0], vectors.e[2][0]});
    if (tsuya_vec3_dot(fit->normal, mean) > 0.0) {
        fit->normal = tsuya_vec3_scale(fit->normal, -1.0);
    }
    fit->centre = mean;
    fit->rms = sqrt(fmax(values[0], 0.0));
    return true;
}

static float sample(const tsuya_image *grey, double x, double y)
{
    int i = (int)x, j = (int)y;
    float u = (float)(x - i), v = (float)(y - j);
    const float *p = tsuya_image_f32(grey, i, j), *q = tsuya_image_f32(grey, i, j + 1);
    float top = p[0] + u * (p[1] - p[0]), bottom = q[0] + u * (q[1] - q[0]);
    return top + v * (bottom - top);
}

/* The cloth as seen from straight above: n × n samples at `spacing` along `right` and `down` about the plane's centre. */
static bool rectify(float *values, int n, const view_job *job, tsuya_vec3 centre, tsuya_vec3 right, tsuya_vec3 down, double spacing)
{
    int w = job->grey.width_px, h = job->grey.height_px;
    for (int j = 0; j < n; j++) {
        for (int i = 0; i < n; i++) {
            double u = (i - 0.5 * (n - 1)) * spacing, v = (j - 0.5 * (n - 1)) * spacing;
            tsuya_vec3 p = tsuya_vec3_mad(tsuya_vec3_mad(centre, u, right), v, down);
            double x = job->camera->fx_px * p.x / p.z + job->camera->cx_px, y = job->camera->fy_px * p.y / p.z + job->camera->cy_px;
            if (!(x >= 0.0 && y >= 0.0 && x < w - 1 && y < h - 1)) {
                return false;
            }
            values[j * n + i] = sample(&job->grey, x, y);
        }
    }
    return true;
}

static tsuya_vec3 in_world(const view_job *job, tsuya_vec3 camera_direction)
{
    return tsuya_mat3_apply_transposed(job->view->camera_from_world.rotation, camera_direction);
}

static void set_directions(patch_node *node, const view_job *job, const tsuya_threads *t, tsuya_vec3 right, tsuya_vec3 down, double spacing)
{
    const double angle[3] = {t->a.angle_rad, t->b.angle_rad, t->flow_rad};
    tsuya_vec3 *direction[3] = {&node->a, &node->b, &node->flow};
    for (int k = 0; k < 3; k++) {
        tsuya_vec3 d = tsuya_vec3_mad(tsuya_vec3_scale(right, cos(angle[k])), -sin(angle[k]), down);
        *direction[k] = in_world(job, d);
    }
    node->period_a = t->a.period_px * spacing;
    node->period_b = t->b.period_px * spacing;
    node->sigma_rad = fmax(t->a.sigma_rad, t->b.sigma_rad);
    node->confidence = t->a.seen && t->b.seen ? t->confidence : 0.0;
    node->flow_weight = t->flow_coherence;
}

/* What one thread of execution looks with.  A window of twice the patch's side about it tells which peaks are threads. */
typedef struct viewer {
    tsuya_detector *patch, *window; /* window: NULL where it would be too large */
    float *values, *window_values;
} viewer;

static tsuya_status viewer_create(viewer *v, int patch_px)
{
    tsuya_status status = TSUYA_OK;
    size_t n = (size_t)patch_px;
    *v = (viewer){0};
    TSUYA_NEW(status, v->values, n * n);
    TSUYA_NEW(status, v->window_values, 4 * n * n);
    status = tsuya_detector_create(&v->patch, patch_px, NULL);
    if (status == TSUYA_OK && 2 * patch_px <= WINDOW_MAX) {
        status = tsuya_detector_create(&v->window, 2 * patch_px, NULL);
    }
done:
    return status;
}

static void viewer_free(viewer *v)
{
    tsuya_detector_free(v->patch);
    tsuya_detector_free(v->window);
    tsuya_free(v->values);
    tsuya_free(v->window_values);
}

static void look(patch_node *node, const view_job *job, viewer *v, int x0, int y0)
{
    int n = job->patch_px;
    plane fit;
    *node = (patch_node){0};
    if (!fit_plane(&fit, job, x0, y0)) {
        return;
    }
    double distance = tsuya_vec3_norm(fit.centre), facing = -tsuya_vec3_dot(fit.normal, fit.centre) / distance;
    double spacing = fit.centre.z / job->camera->fx_px;
    if (facing < COS_MIN || fit.rms > FLATNESS * job->patch_px * spacing) {
        return;
    }
    tsuya_vec3 right = tsuya_vec3_tangent((tsuya_vec3){1, 0, 0}, fit.normal), down = tsuya_vec3_cross(right, fit.normal);
    down = down.y < 0.0 ? tsuya_vec3_scale(down, -1.0) : down;
    if (!rectify(v->values, n, job, fit.centre, right, down, spacing)) {
        return;
    }
    tsuya_threads threads;
    if (v->window && rectify(v->window_values, 2 * n, job, fit.centre, right, down, spacing)) {
        tsuya_finding finding;
        const tsuya_finding *around = &finding;
        tsuya_detector_find(v->window, &finding, v->window_values);
        tsuya_detector_follow(v->patch, &threads, &around, 1, v->values);
    } else {
        tsuya_detector_run(v->patch, &threads, v->values);
    }
    set_directions(node, job, &threads, right, down, spacing);
    node->position = tsuya_pose_apply(tsuya_pose_inverse(job->view->camera_from_world), fit.centre);
    node->normal = in_world(job, fit.normal);
    node->facing = facing;
    node->valid = true;
}

static tsuya_status look_everywhere(const view_job *job, const tsuya_context *context)
{
    tsuya_failure failure = {0};
#pragma omp parallel num_threads(context->threads)
    {
        viewer v;
        tsuya_status status = viewer_create(&v, job->patch_px);
#pragma omp for schedule(dynamic, 1)
        for (int row = 0; row < job->rows; row++) {
            tsuya_status own = status;
            for (int column = 0; own == TSUYA_OK && column < job->columns; column++) {
                patch_node *n = &job->node[(size_t)row * (size_t)job->columns + (size_t)column];
                look(n, job, &v, column * job->step_px, row * job->step_px);
            }
            if (own != TSUYA_OK) {
#pragma omp critical(tsuya_weave_votes)
                tsuya_failure_keep(&failure, (size_t)row, own);
            }
        }
        viewer_free(&v);
    }
    return tsuya_failure_raise(&failure);
}

/* Keeps the best by weight × (confidence + a little); of equal ones the first. */
static double rank(const tsuya_vote *v)
{
    return (double)v->weight * (0.02 + (double)v->confidence + 0.02 * (double)v->flow_weight);
}

static void keep_vote(tsuya_votes *votes, size_t vertex, const tsuya_vote *vote)
{
    tsuya_vote *list = votes->vote + vertex * TSUYA_VOTES;
    int at = votes->count[vertex];
    while (at > 0 && rank(vote) > rank(&list[at - 1])) {
        at--;
    }
    if (at < TSUYA_VOTES) {
        int count = votes->count[vertex] < TSUYA_VOTES ? votes->count[vertex] + 1 : TSUYA_VOTES;
        memmove(list + at + 1, list + at, (size_t)(count - 1 - at) * sizeof *list);
        list[at] = *vote;
        votes->count[vertex] = (uint8_t)count;
    }
}

static float angle_in(tsuya_vec3 direction, tsuya_vec3 first, tsuya_vec3 second)
{
    return (float)tsuya_line_wrap(atan2(tsuya_vec3_dot(direction, second), tsuya_vec3_dot(direction, first)));
}

static bool is_seen(const view_job *job, tsuya_vec3 p_camera, tsuya_vec2 pixel)
{
    int x = (int)lround(pixel.x), y = (int)lround(pixel.y);
    if (x < 0 || y < 0 || x >= job->raster.width_px || y >= job->raster.height_px) {
        return false;
    }
    double depth = (double)job->raster.depth[(size_t)y * (size_t)job->raster.width_px + (size_t)x];
    return depth > 0.0 && p_camera.z < depth * (1.0 + 8.0 / job->camera->fx_px); /* eight pixels' worth of depth */
}

static tsuya_vote vote_of(const patch_node *n, const tsuya_vec3 normal, double weight)
{
    tsuya_vec3 first, second;
    tsuya_tangent_basis(&first, &second, normal);
    return (tsuya_vote){
        .a_rad = angle_in(n->a, first, second), .b_rad = angle_in(n->b, first, second), .flow_rad = angle_in(n->flow, first, second),
        .period_a = (float)n->period_a, .period_b = (float)n->period_b, .sigma_rad = (float)n->sigma_rad,
        .confidence = (float)n->confidence, .flow_weight = (float)n->flow_weight, .weight = (float)weight,
    };
}

/* The vote of a photograph for a vertex: of the four patches around it, the best by nearness and confidence. */
static void vote(tsuya_votes *votes, const view_job *job, size_t vertex)
{
    const float *nf = job->mesh->normal + 3 * vertex;
    tsuya_vec3 normal = {(double)nf[0], (double)nf[1], (double)nf[2]};
    tsuya_vec3 p = tsuya_pose_apply(job->view->camera_from_world, tsuya_mesh_position(job->mesh, vertex));
    tsuya_vec2 pixel;
    if (!tsuya_camera_project(job->camera, p, &pixel) || !is_seen(job, p, pixel)) {
        return;
    }
    double gx = (pixel.x - 0.5 * (job->patch_px - 1)) / job->step_px, gy = (pixel.y - 0.5 * (job->patch_px - 1)) / job->step_px;
    int column = (int)floor(gx), row = (int)floor(gy);
    tsuya_vote best = {0};
    for (int k = 0; k < 4; k++) {
        int c = column + k % 2, r = row + k / 2;
        if (c < 0 || r < 0 || c >= job->columns || r >= job->rows) {
            continue;
        }
        const patch_node *n = &job->node[(size_t)r * (size_t)job->columns + (size_t)c];
        if (!n->valid || fabs(tsuya_vec3_dot(n->normal, normal)) < NORMALS_AGREE) {
            continue;
        }
        double near = (1.05 - fabs(gx - c)) * (1.05 - fabs(gy - r));
        tsuya_vote candidate = vote_of(n, normal, near * n->facing * n->facing);
        if (rank(&candidate) > rank(&best)) {
            best = candidate;
        }
    }
    if (best.weight > 0.0f) {
        keep_vote(votes, vertex, &best);
    }
}

static tsuya_status load_grey(view_job *job, const char *workspace, tsuya_arena *arena)
{
    tsuya_image stored = {0};
    const char *path = tsuya_arena_printf(arena, "%s/images/%s", workspace, job->view->name);
    if (!path) {
        return TSUYA_ERROR_MEMORY;
    }
    TSUYA_TRY(tsuya_image_load(&stored, path));
    tsuya_status status;
    if (stored.width_px != job->camera->width_px || stored.height_px != job->camera->height_px) {
        status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: %d × %d pixels; its camera in %s/sparse has %d × %d", path, stored.width_px,
                            stored.height_px, workspace, job->camera->width_px, job->camera->height_px);
    } else {
        status = tsuya_image_grey(&job->grey, &stored, TSUYA_SAMPLE_F32);
    }
    tsuya_image_free(&stored);
    return status;
}

static tsuya_status gather_view(tsuya_votes *votes, view_job *job, const char *workspace, const tsuya_context *context)
{
    tsuya_arena *arena = NULL;
    tsuya_status status;
    TSUYA_GOTO_DONE(status, tsuya_arena_create(&arena, 4096));
    TSUYA_GOTO_DONE(status, load_grey(job, workspace, arena));
    TSUYA_GOTO_DONE(status, tsuya_raster_create(&job->raster, job->camera->width_px, job->camera->height_px));
    TSUYA_GOTO_DONE(status, tsuya_raster_draw(&job->raster, job->mesh, job->camera, job->view->camera_from_world, context));
    job->columns = job->camera->width_px >= job->patch_px ? (job->camera->width_px - job->patch_px) / job->step_px + 1 : 0;
    job->rows = job->camera->height_px >= job->patch_px ? (job->camera->height_px - job->patch_px) / job->step_px + 1 : 0;
    TSUYA_NEW(status, job->node, (size_t)job->columns * (size_t)job->rows);
    TSUYA_GOTO_DONE(status, look_everywhere(job, context));
#pragma omp parallel for schedule(static) num_threads(context->threads)
    for (long long v = 0; v < (long long)job->mesh->vertex_count; v++) {
        vote(votes, job, (size_t)v);
    }
done:
    tsuya_raster_free(&job->raster);
    tsuya_image_free(&job->grey);
    tsuya_arena_free(arena);
    return status;
}

/* Spacings of the patches that were looked at, gathered over the photographs. */
typedef struct spacings {
    float *value;
    size_t count, capacity;
} spacings;

static tsuya_status count_patches(tsuya_votes *votes, spacings *list, const view_job *job)
{
    size_t nodes = (size_t)job->columns * (size_t)job->rows;
    if (list->count + nodes > list->capacity) {
        size_t capacity = 2 * (list->count + nodes);
        float *grown = tsuya_realloc(list->value, capacity, sizeof *grown);
        if (!grown) {
            return TSUYA_ERROR_MEMORY;
        }
        list->value = grown;
        list->capacity = capacity;
    }
    for (size_t i = 0; i < nodes; i++) {
        if (job->node[i].valid) {
            double z = tsuya_pose_apply(job->view->camera_from_world, job->node[i].position).z;
            list->value[list->count++] = (float)(z / job->camera->fx_px * job->step_px);
            votes->patches++;
            votes->sure += job->node[i].confidence >= 0.8;
        }
    }
    return TSUYA_OK;
}

static bool is_held_out(const tsuya_weave_mesh_options *options, const char *name)
{
    for (int k = 0; k < options->hold_out_count; k++) {
        if (strcmp(options->hold_out[k], name) == 0) {
            return true;
        }
    }
    return false;
}

static tsuya_status gather_views(tsuya_votes *votes, spacings *list, const tsuya_sparse_model *model, const tsuya_mesh *mesh,
                                 const tsuya_weave_mesh_options *options, const tsuya_context *context)
{
    for (int v = 0; v < model->view_count; v++) {
        tsuya_progress_update(context, "threads", v, model->view_count, model->view[v].name);
        if (is_held_out(options, model->view[v].name)) {
            continue;
        }
        view_job job = {.mesh = mesh, .view = &model->view[v], .camera = &model->camera[model->view[v].camera],
                        .patch_px = options->patch_px, .step_px = options->step_px};
        tsuya_status status = gather_view(votes, &job, options->workspace, context);
        if (status == TSUYA_OK) {
            status = count_patches(votes, list, &job);
        }
        tsuya_free(job.node);
        TSUYA_TRY(status);
        TSUYA_TRY(tsuya_check_interrupt());
        votes->photos++;
        const double *down = model->view[v].camera_from_world.rotation.e[1]; /* the camera's y, world frame */
        votes->up = tsuya_vec3_sub(votes->up, (tsuya_vec3){down[0], down[1], down[2]});
    }
    votes->up = tsuya_vec3_unit(votes->up);
    return TSUYA_OK;
}

tsuya_status tsuya_votes_gather(tsuya_votes *votes, const tsuya_mesh *mesh, const tsuya_weave_mesh_options *options,
                                const tsuya_context *context)
{
    tsuya_sparse_model model = {0};
    spacings list = {0};
    tsuya_status status = TSUYA_OK;
    char *sparse = tsuya_path_join(options->workspace, "sparse");
    *votes = (tsuya_votes){.vertex_count = mesh->vertex_count};
    if (!sparse) {
        return TSUYA_ERROR_MEMORY;
    }
    TSUYA_NEW(status, votes->vote, mesh->vertex_count * TSUYA_VOTES);
    TSUYA_NEW(status, votes->count, mesh->vertex_count);
    TSUYA_GOTO_DONE(status, tsuya_sparse_model_load(&model, sparse));
    TSUYA_GOTO_DONE(status, gather_views(votes, &list, &model, mesh, options, context));
    if (list.count > 0) {
        tsuya_sort_floats(list.value, list.count);
        votes->spacing = (double)list.value[list.count / 2];
    } else {
        votes->spacing = tsuya_mesh_mean_edge(mesh);
    }
done:
    tsuya_free(sparse);
    tsuya_free(list.value);
    tsuya_sparse_model_free(&model);
    if (status != TSUYA_OK) {
        tsuya_votes_free(votes);
    }
    return status;
}

void tsuya_votes_free(tsuya_votes *votes)
{
    tsuya_free(votes->vote);
    tsuya_free(votes->count);
    *votes = (tsuya_votes){0};
}
