#include "reconstruct/color.h"

#include "core/camera.h"
#include "core/color.h"
#include "core/file.h"
#include "core/image.h"
#include "core/memory.h"
#include "core/order.h"
#include "core/raster.h"
#include "reconstruct/view_mask.h"

#include <string.h>

enum { SAMPLES = 8, GAIN_ROUNDS = 6, BORDER_PX = 8, EDGE_JUMP_PX = 8, SHRINK_MAX = 8 };
static const double COS_MIN = 0.15;        /* more grazing than that is not looked at */
static const double BORDER_WEIGHT = 1e-3;  /* beside a border: only where nothing better is there */
static const double BODY_QUANTILE = 0.4;
static const double NEAR_BODY = 0.12;      /* relative luminance difference that still belongs to the surface's colour */
static const double GAIN_MAX = 2.0;

typedef struct sample {
    float rgb[3]; /* linear */
    float weight; /* 0: free */
    int view;
} sample;

/* What one photograph shows, while it is being looked at. */
typedef struct look {
    const tsuya_mesh *mesh;
    const tsuya_view *view;
    const tsuya_camera *camera;
    int index;
    tsuya_raster raster;
    uint16_t *border;   /* distance to mask borders and depth edges */
    tsuya_image photo;  /* linear float, reduced to the mesh's resolution */
    sample *sample;     /* SAMPLES a vertex, heaviest first */
} look;

tsuya_color_options tsuya_color_options_default(void)
{
    return (tsuya_color_options){.equalise = true};
}

static bool is_held_out(const tsuya_color_options *options, const char *name)
{
    for (int k = 0; k < options->hold_out_count; k++) {
        if (strcmp(options->hold_out[k], name) == 0) {
            return true;
        }
    }
    return false;
}

/* Depth jumps by more than a steep surface's would over one pixel. */
static bool is_edge(const look *l, size_t p, size_t q)
{
    float a = l->raster.depth[p], b = l->raster.depth[q];
    return b == 0.0f || fabs((double)(a - b)) * l->camera->fx_px > EDGE_JUMP_PX * (double)fminf(a, b);
}

static void mark_borders(look *l, const tsuya_image *mask)
{
    int w = l->camera->width_px, h = l->camera->height_px;
    for (int y = 0; y < h; y++) {
        for (int x = 0; x < w; x++) {
            size_t p = (size_t)y * (size_t)w + (size_t)x;
            bool rim = x == 0 || y == 0 || x == w - 1 || y == h - 1;
            bool black = mask->data && *tsuya_image_u8(mask, x, y) < 128;
            l->border[p] = rim || black || l->raster.depth[p] == 0.0f || is_edge(l, p, p + 1) ||
                           is_edge(l, p, p + (size_t)w) || is_edge(l, p, p - 1) || is_edge(l, p, p - (size_t)w);
        }
    }
    tsuya_distance_to_marked(l->border, w, h);
}

/* Median length in pixels of the edges of the triangles that are seen, from a sample of pixels. */
static double edge_px(const look *l)
{
    enum { GRID = 64 };
    double length[GRID * GRID];
    size_t count = 0;
    for (int k = 0; k < GRID * GRID; k++) {
        size_t x = (size_t)(k % GRID) * (size_t)l->camera->width_px / GRID;
        size_t y = (size_t)(k / GRID) * (size_t)l->camera->height_px / GRID, p = y * (size_t)l->camera->width_px + x;
        if (l->raster.triangle[p] != UINT32_MAX) {
            const uint32_t *i = l->mesh->triangle + 3 * (size_t)l->raster.triangle[p];
            double edge = tsuya_vec3_norm(tsuya_vec3_sub(tsuya_mesh_position(l->mesh, i[0]), tsuya_mesh_position(l->mesh, i[1])));
            length[count++] = edge * l->camera->fx_px / (double)l->raster.depth[p];
        }
    }
    tsuya_sort_doubles(length, count);
    return count ? length[count / 2] : 1.0;
}

/* The photograph, averaged to about two pixels an edge, since a vertex stands for the surface around it. */
static tsuya_status load_photo(look *l, const char *workspace)
{
    tsuya_status status = TSUYA_OK;
    tsuya_arena *arena = NULL;
    tsuya_image stored = {0}, linear = {0};
    TSUYA_GOTO_DONE(status, tsuya_arena_create(&arena, 4096));
    const char *path = tsuya_arena_printf(arena, "%s/images/%s", workspace, l->view->name);
    if (!path) {
        status = TSUYA_ERROR_MEMORY;
        goto done;
    }
    TSUYA_GOTO_DONE(status, tsuya_image_load(&stored, path));
    if (stored.channels > 4) {
        status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: %d channels; 1 to 4 are accepted", path, stored.channels);
        goto done;
    }
    if (stored.width_px != l->camera->width_px || stored.height_px != l->camera->height_px) {
        status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: %d × %d pixels; its camera in %s/sparse has %d × %d", path, stored.width_px,
                            stored.height_px, workspace, l->camera->width_px, l->camera->height_px);
        goto done;
    }
    TSUYA_GOTO_DONE(status, tsuya_image_convert(&linear, &stored, TSUYA_SAMPLE_F32, TSUYA_ENCODING_LINEAR));
    tsuya_image_free(&stored);
    int shrink = (int)fmin(fmax(floor(0.5 * edge_px(l)), 1.0), SHRINK_MAX);
    if (shrink == 1) {
        l->photo = linear;
        linear = (tsuya_image){0};
    } else {
        status = tsuya_image_resize(&l->photo, &linear, (linear.width_px + shrink - 1) / shrink,
                                    (linear.height_px + shrink - 1) / shrink);
    }
done:
    tsuya_arena_free(arena);
    tsuya_image_free(&stored);
    tsuya_image_free(&linear);
    return status;
}

/* Keeps the heaviest; of equal ones the first. */
static void keep_sample(sample *list, const sample *s)
{
    int at = SAMPLES;
    while (at > 0 && s->weight > list[at - 1].weight) {
        at--;
    }
    if (at < SAMPLES) {
        memmove(list + at + 1, list + at, (size_t)(SAMPLES - 1 - at) * sizeof *list);
        list[at] = *s;
    }
}

static void look_at_vertex(const look *l, size_t v)
{
    const tsuya_camera *camera = l->camera;
    tsuya_vec2 pixel;
    tsuya_vec3 p = tsuya_pose_apply(l->view->camera_from_world, tsuya_mesh_position(l->mesh, v));
    if (!tsuya_camera_project(camera, p, &pixel) || !(pixel.x > -0.5 && pixel.x < camera->width_px - 0.5) ||
        !(pixel.y > -0.5 && pixel.y < camera->height_px - 0.5)) {
        return;
    }
    const float *n = l->mesh->normal + 3 * v;
    tsuya_vec3 normal = tsuya_mat3_apply(l->view->camera_from_world.rotation, (tsuya_vec3){n[0], n[1], n[2]});
    double cosine = -tsuya_vec3_dot(normal, tsuya_vec3_unit(p)), footprint = p.z / camera->fx_px;
    size_t at = (size_t)lrint(pixel.y) * (size_t)camera->width_px + (size_t)lrint(pixel.x);
    double drawn = (double)l->raster.depth[at];
    if (cosine < COS_MIN || drawn == 0.0 || p.z > drawn + footprint * (2.0 + 1.0 / cosine)) {
        return;
    }
    double margin = fmin(l->border[at] / (double)BORDER_PX, 1.0);
    float value[4];
    tsuya_image_sample_bilinear(&l->photo, (pixel.x + 0.5) * l->photo.width_px / camera->width_px - 0.5,
                                (pixel.y + 0.5) * l->photo.height_px / camera->height_px - 0.5, value);
    bool grey = l->photo.channels < 3;
    sample s = {.rgb = {value[0], value[grey ? 0 : 1], value[grey ? 0 : 2]}, .view = l->index};
    s.weight = (float)((BORDER_WEIGHT + margin) * cosine * cosine / (footprint * footprint));
    keep_sample(l->sample + v * SAMPLES, &s);
}

static tsuya_status look_through(sample *samples, const tsuya_mesh *mesh, const tsuya_sparse_model *model, int index,
                                 const char *workspace, const tsuya_context *context)
{
    tsuya_status status = TSUYA_OK;
    tsuya_image mask = {0};
    look l = {.mesh = mesh, .view = &model->view[index], .index = index, .sample = samples};
    l.camera = &model->camera[l.view->camera];
    TSUYA_GOTO_DONE(status, tsuya_raster_create(&l.raster, l.camera->width_px, l.camera->height_px));
    TSUYA_GOTO_DONE(status, tsuya_raster_draw(&l.raster, mesh, l.camera, l.view->camera_from_world, context));
    TSUYA_GOTO_DONE(status, load_photo(&l, workspace));
    TSUYA_GOTO_DONE(status, tsuya_view_mask_load(&mask, workspace, l.view->name, l.camera));
    TSUYA_NEW(status, l.border, (size_t)l.camera->width_px * (size_t)l.camera->height_px);
    mark_borders(&l, &mask);
#pragma omp parallel for num_threads(context->threads)
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        look_at_vertex(&l, v);
    }
done:
    tsuya_raster_free(&l.raster);
    tsuya_image_free(&l.photo);
    tsuya_image_free(&mask);
    tsuya_free(l.border);
    return status;
}

static double luminance(const sample *s) { return tsuya_rgb_luminance_f32(s->rgb); }

/* Alternates between each vertex's mean logarithm of luminance and each photograph's mean difference from it. */
static tsuya_status find_gains(double *gain, const sample *samples, size_t vertex_count, int views)
{
    tsuya_status status = TSUYA_OK;
    double *log_gain = NULL, *sum = NULL, *weight = NULL;
    TSUYA_NEW(status, log_gain, (size_t)views);
    TSUYA_NEW(status, sum, (size_t)views);
    TSUYA_NEW(status, weight, (size_t)views);
    for (int round = 0; round < GAIN_ROUNDS; round++) {
        memset(sum, 0, (size_t)views * sizeof *sum);
        memset(weight, 0, (size_t)views * sizeof *weight);
        for (size_t v = 0; v < vertex_count; v++) {
            double mean = 0.0, value[SAMPLES];
            int count = 0;
            const sample *s = samples + v * SAMPLES;
            for (; count < SAMPLES && s[count].weight > 0.0f; count++) {
                value[count] = log(fmax(luminance(&s[count]), 1e-3)) + log_gain[s[count].view];
                mean += value[count];
            }
            for (int k = 0; k < count && count > 1; k++) {
                double difference = mean / count - value[k], w = 1.0 / (1.0 + 25.0 * difference * difference);
                sum[s[k].view] += w * difference;
                weight[s[k].view] += w;
            }
        }
        double total = 0.0, seen = 0.0;
        for (int i = 0; i < views; i++) {
            log_gain[i] += weight[i] > 0.0 ? sum[i] / weight[i] : 0.0;
            total += weight[i] * log_gain[i];
            seen += weight[i];
        }
        for (int i = 0; i < views; i++) {
            log_gain[i] -= seen > 0.0 ? total / seen : 0.0;
        }
    }
    for (int i = 0; i < views; i++) {
        gain[i] = fmin(fmax(exp(log_gain[i]), 1.0 / GAIN_MAX), GAIN_MAX);
    }
done:
    tsuya_free(log_gain);
    tsuya_free(sum);
    tsuya_free(weight);
    return status;
}

/* Luminance of a vertex's body: highlights only add light, and show where a photograph looks most squarely, so weights are
 * flattened by a fourth root and the quantile lies below the median. */
static double body_luminance(const sample *s, int count, const double *gain)
{
    int order[SAMPLES];
    double value[SAMPLES], total = 0.0, sum = 0.0;
    for (int k = 0; k < count; k++) {
        value[k] = luminance(&s[k]) * gain[s[k].view];
        total += sqrt(sqrt((double)s[k].weight));
        int at = k;
        for (; at > 0 && value[order[at - 1]] > value[k]; at--) {
            order[at] = order[at - 1];
        }
        order[at] = k;
    }
    int at = 0;
    for (; at < count - 1; at++) {
        sum += sqrt(sqrt((double)s[order[at]].weight));
        if (sum >= BODY_QUANTILE * total) {
            break;
        }
    }
    return value[order[at]];
}

/* false where no photograph saw the vertex. */
static bool blend(uint8_t color[3], const sample *s, const double *gain)
{
    int count = 0;
    while (count < SAMPLES && s[count].weight > 0.0f) {
        count++;
    }
    if (count == 0) {
        return false;
    }
    double body = body_luminance(s, count, gain), total = 0.0, sum[3] = {0.0, 0.0, 0.0};
    for (int k = 0; k < count; k++) {
        double g = gain[s[k].view];
        if (fabs(luminance(&s[k]) * g - body) <= NEAR_BODY * body) {
            total += (double)s[k].weight;
            for (int c = 0; c < 3; c++) {
                sum[c] += (double)s[k].weight * g * (double)s[k].rgb[c];
            }
        }
    }
    for (int c = 0; c < 3; c++) {
        color[c] = (uint8_t)lrintf(255.0f * tsuya_srgb_encode((float)(sum[c] / total)));
    }
    return true;
}

/* Colour creeps from coloured vertices into the others, ring by ring. */
static tsuya_status fill(tsuya_mesh *mesh, uint8_t *seen)
{
    tsuya_status status = TSUYA_OK;
    uint32_t (*sum)[4] = NULL;
    TSUYA_NEW(status, sum, mesh->vertex_count);
    for (bool changed = true; changed;) {
        changed = false;
        memset(sum, 0, mesh->vertex_count * sizeof *sum);
        for (size_t k = 0; k < 3 * mesh->triangle_count; k++) {
            uint32_t v = mesh->triangle[k], from = mesh->triangle[k - k % 3 + (k + 1) % 3];
            for (int turn = 0; turn < 2; turn++) {
                if (!seen[v] && seen[from]) {
                    for (size_t c = 0; c < 3; c++) {
                        sum[v][c] += mesh->color[3 * (size_t)from + c];
                    }
                    sum[v][3]++;
                }
                uint32_t swap = v;
                v = from;
                from = swap;
            }
        }
        for (size_t v = 0; v < mesh->vertex_count; v++) {
            if (sum[v][3] > 0) {
                for (size_t c = 0; c < 3; c++) {
                    mesh->color[3 * v + c] = (uint8_t)((sum[v][c] + sum[v][3] / 2) / sum[v][3]);
                }
                seen[v] = 1;
                changed = true;
            }
        }
    }
done:
    tsuya_free(sum);
    return status;
}

static tsuya_status blend_all(tsuya_mesh *mesh, const sample *samples, const double *gain, bool had_color,
                              const tsuya_context *context)
{
    uint8_t *seen = tsuya_calloc(mesh->vertex_count, 1);
    if (!seen) {
        return TSUYA_ERROR_MEMORY;
    }
#pragma omp parallel for num_threads(context->threads)
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        seen[v] = blend(mesh->color + 3 * v, samples + v * SAMPLES, gain);
    }
    tsuya_status status = had_color ? TSUYA_OK : fill(mesh, seen);
    tsuya_free(seen);
    return status;
}

static tsuya_status look_through_all(sample *samples, const tsuya_mesh *mesh, const tsuya_sparse_model *model,
                                     const tsuya_color_options *options, const tsuya_context *context)
{
    int used = 0;
    for (int i = 0; i < model->view_count; i++) {
        if (!is_held_out(options, model->view[i].name)) {
            TSUYA_TRY(look_through(samples, mesh, model, i, options->workspace, context));
            tsuya_progress_update(context, "colours", i + 1.0, model->view_count, model->view[i].name);
            used++;
        }
    }
    return used > 0 ? TSUYA_OK
                    : tsuya_fail(TSUYA_ERROR_INPUT, "%s/sparse: none of its %d photographs may be used for colour",
                                 options->workspace, model->view_count);
}

tsuya_status tsuya_mesh_color(tsuya_mesh *mesh, const tsuya_color_options *options, const tsuya_context *context)
{
    tsuya_status status = TSUYA_OK;
    tsuya_sparse_model model = {0};
    sample *samples = NULL;
    double *gain = NULL;
    bool had_color = mesh->color != NULL;
    char *sparse = tsuya_path_join(options->workspace, "sparse");
    if (!sparse) {
        return TSUYA_ERROR_MEMORY;
    }
    TSUYA_GOTO_DONE(status, tsuya_sparse_model_load(&model, sparse));
    if (!mesh->normal) {
        TSUYA_GOTO_DONE(status, tsuya_mesh_compute_normals(mesh));
    }
    TSUYA_NEW(status, samples, mesh->vertex_count * SAMPLES);
    TSUYA_NEW(status, gain, (size_t)model.view_count);
    TSUYA_GOTO_DONE(status, look_through_all(samples, mesh, &model, options, context));
    for (int i = 0; i < model.view_count; i++) {
        gain[i] = 1.0;
    }
    if (options->equalise) {
        TSUYA_GOTO_DONE(status, find_gains(gain, samples, mesh->vertex_count, model.view_count));
    }
    TSUYA_GOTO_DONE(status, tsuya_mesh_add_arrays(mesh, TSUYA_MESH_COLOR));
    status = blend_all(mesh, samples, gain, had_color, context);
done:
    tsuya_free(sparse);
    tsuya_sparse_model_free(&model);
    tsuya_free(samples);
    tsuya_free(gain);
    return status;
}
