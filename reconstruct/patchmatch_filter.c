#include "reconstruct/patchmatch_filter.h"

#include "core/memory.h"

#include <string.h>

/* ---- texture ---- */

/* Orthonormal polynomials of degree 0, 1, 2 on the six abscissae −5, −3 … 5. */
static const float polynomial[3][PATCH_SIDE] = {
    {0.40824829f, 0.40824829f, 0.40824829f, 0.40824829f, 0.40824829f, 0.40824829f},
    {-0.59761430f, -0.35856858f, -0.11952286f, 0.11952286f, 0.35856858f, 0.59761430f},
    {0.54554473f, -0.10910895f, -0.43643578f, -0.43643578f, -0.10910895f, 0.54554473f},
};

/* Share of the window's energy in the product of two polynomials. */
static float energy(const float value[PATCH_SAMPLES], int column, int row)
{
    float sum = 0.0f;
    for (int k = 0; k < PATCH_SAMPLES; k++) {
        sum += value[k] * polynomial[column][k % PATCH_SIDE] * polynomial[row][k / PATCH_SIDE];
    }
    return sum * sum;
}

/* A highlight on bare satin moves with the view like a surface at the depth of the lamp's reflection; what tells it from
 * cloth is that nothing in it is fine. */
static bool textured(const patch_level *level, int x, int y, const tsuya_patchmatch_options *options)
{
    float value[PATCH_SAMPLES], total = 0.0f;
    for (int k = 0; k < PATCH_SAMPLES; k++) {
        int dx = PATCH_STEP * (k % PATCH_SIDE) - PATCH_RADIUS, dy = PATCH_STEP * (k / PATCH_SIDE) - PATCH_RADIUS;
        value[k] = level->grey[(ptrdiff_t)(y + dy + TSUYA_STEREO_PAD) * level->stride + x + dx + TSUYA_STEREO_PAD] - 0.5f;
        total += value[k] * value[k];
    }
    float planar = total - energy(value, 0, 0) - energy(value, 1, 0) - energy(value, 0, 1);
    float rough = planar - energy(value, 2, 0) - energy(value, 1, 1) - energy(value, 0, 2);
    return rough >= options->min_contrast * options->min_contrast * PATCH_SAMPLES &&
           rough >= options->min_roughness * planar;
}

/* ---- agreement with the sources ---- */

/* The source's depth at its pixel nearest to the plane's point, carried back: within `max_reprojection_px` of the
 * reference's pixel and within `max_depth_error` of its depth. */
static bool agrees(const patch_source *s, float x, float y, float w, const tsuya_patchmatch_options *options)
{
    const float pad = (float)TSUYA_STEREO_PAD;
    float h[3];
    for (int r = 0; r < 3; r++) {
        h[r] = s->forward[r][0] * x + s->forward[r][1] * y + s->forward[r][2] + s->shift[r] * w;
    }
    float u = h[0] / h[2] - pad, v = h[1] / h[2] - pad;
    if (!(h[2] > 0.0f && u >= 0.0f && v >= 0.0f && u <= (float)(s->width_px - 1) && v <= (float)(s->height_px - 1))) {
        return false;
    }
    float z = s->depth[(size_t)(v + 0.5f) * (size_t)s->width_px + (size_t)(u + 0.5f)];
    if (!(z > 0.0f)) {
        return false;
    }
    float b[3];
    for (int r = 0; r < 3; r++) {
        b[r] = (s->back[r][0] * u + s->back[r][1] * v + s->back[r][2]) * z + s->back_shift[r];
    }
    float ex = b[0] / b[2] - x, ey = b[1] / b[2] - y;
    return b[2] > 0.0f && ex * ex + ey * ey <= options->max_reprojection_px * options->max_reprojection_px &&
           fabsf(b[2] * w - 1.0f) <= options->max_depth_error;
}

static bool trusted(const plane_field *field, const patch_level *level, size_t at,
                    const tsuya_patchmatch_options *options)
{
    const int x = (int)(at % (size_t)field->width_px), y = (int)(at / (size_t)field->width_px);
    if (!field->active[at] || !(field->w[at] > 0.0f) || !(field->cost[at] <= options->max_cost) ||
        !textured(level, x, y, options)) {
        return false;
    }
    if (!level->geometric) {
        return true;
    }
    int count = 0;
    for (int s = 0; s < level->source_count; s++) {
        count += agrees(&level->source[s], (float)x, (float)y, field->w[at], options);
    }
    return count >= options->min_consistent;
}

/* ---- islands ---- */

/* Neighbours belong together when each one's plane passes within 2 % of the other's depth. */
static bool joined(const plane_field *field, size_t a, size_t b)
{
    float wa = field->w[a], wb = field->w[b];
    return wa > 0.0f && wb > 0.0f && fabsf(wa - wb) <= 0.02f * fminf(wa, wb);
}

/* Drops connected components smaller than `least`; depth-first with the caller's stack of one entry a pixel. */
static void drop_islands(plane_field *field, int least, size_t *stack, uint8_t *seen)
{
    const size_t width = (size_t)field->width_px, pixels = width * (size_t)field->height_px;
    for (size_t start = 0; start < pixels; start++) {
        if (seen[start] || !(field->w[start] > 0.0f)) {
            continue;
        }
        size_t count = 0, done = 0;
        stack[count++] = start;
        seen[start] = 1;
        while (done < count) {
            size_t at = stack[done++], x = at % width;
            const size_t next[4] = {x > 0 ? at - 1 : at, x + 1 < width ? at + 1 : at, at >= width ? at - width : at,
                                    at + width < pixels ? at + width : at};
            for (int k = 0; k < 4; k++) {
                if (!seen[next[k]] && joined(field, at, next[k])) {
                    seen[next[k]] = 1;
                    stack[count++] = next[k];
                }
            }
        }
        for (size_t i = 0; i < count && count < (size_t)least; i++) {
            field->w[stack[i]] = 0.0f;
        }
    }
}

/* ---- median ---- */

static float median(float *value, int count)
{
    for (int i = 1; i < count; i++) {
        float v = value[i];
        int j = i;
        for (; j > 0 && value[j - 1] > v; j--) {
            value[j] = value[j - 1];
        }
        value[j] = v;
    }
    return count & 1 ? value[count / 2] : 0.5f * (value[count / 2 - 1] + value[count / 2]);
}

/* Planes keep slanted surfaces slanted: each neighbour votes with its plane continued to this pixel. */
static float median_of_planes(const plane_field *field, int x, int y)
{
    float value[9];
    int count = 0;
    for (int dy = -1; dy <= 1; dy++) {
        for (int dx = -1; dx <= 1; dx++) {
            int nx = x + dx, ny = y + dy;
            if (nx < 0 || ny < 0 || nx >= field->width_px || ny >= field->height_px) {
                continue;
            }
            size_t at = (size_t)ny * (size_t)field->width_px + (size_t)nx;
            if (field->w[at] > 0.0f) {
                value[count++] = field->w[at] - field->wx[at] * (float)dx - field->wy[at] * (float)dy;
            }
        }
    }
    return median(value, count);
}

static void smooth(float *out, const plane_field *field, const tsuya_context *context)
{
#pragma omp parallel for schedule(static) num_threads(context->threads)
    for (int y = 0; y < field->height_px; y++) {
        for (int x = 0; x < field->width_px; x++) {
            size_t at = (size_t)y * (size_t)field->width_px + (size_t)x;
            out[at] = field->w[at] > 0.0f ? fmaxf(median_of_planes(field, x, y), 0.0f) : 0.0f;
        }
    }
}

tsuya_status tsuya_patchmatch_filter(plane_field *field, const patch_level *level,
                                     const tsuya_patchmatch_options *options, const tsuya_context *context)
{
    const size_t pixels = (size_t)field->width_px * (size_t)field->height_px;
    tsuya_status status = TSUYA_OK;
    uint8_t *seen = NULL;
    size_t *stack = NULL;
    float *w = NULL;
    TSUYA_NEW(status, seen, pixels);
    TSUYA_NEW(status, stack, pixels);
    TSUYA_NEW(status, w, pixels);
#pragma omp parallel for schedule(static) num_threads(context->threads)
    for (size_t at = 0; at < pixels; at++) {
        seen[at] = !trusted(field, level, at, options);
    }
    for (size_t at = 0; at < pixels; at++) {
        field->w[at] = seen[at] ? 0.0f : field->w[at];
    }
    if (!level->keep) {
        tsuya_patchmatch_drop_backdrop(field, level, seen, stack, context);
    }
    memset(seen, 0, pixels);
    drop_islands(field, options->min_component_px, stack, seen);
    smooth(w, field, context);
    memcpy(field->w, w, pixels * sizeof *w);
done:
    tsuya_free(seen);
    tsuya_free(stack);
    tsuya_free(w);
    return status;
}

void tsuya_patchmatch_store(tsuya_depth_map *map, const plane_field *field, const patch_level *level)
{
    const size_t pixels = (size_t)field->width_px * (size_t)field->height_px;
    for (size_t at = 0; at < pixels; at++) {
        float w = field->w[at];
        if (!(w > 0.0f) || !field->active[at]) {
            map->depth[at] = 0.0f;
            map->normal[at] = map->normal[pixels + at] = map->normal[2 * pixels + at] = 0.0f;
            map->cost[at] = PATCH_COST_UNSEEN;
            continue;
        }
        float x = (float)(at % (size_t)field->width_px) - level->cx_px;
        float y = (float)(at / (size_t)field->width_px) - level->cy_px;
        float nx = field->wx[at] * level->fx_px, ny = field->wy[at] * level->fy_px;
        float nz = w - field->wx[at] * x - field->wy[at] * y;
        float scale = -1.0f / sqrtf(nx * nx + ny * ny + nz * nz);
        map->depth[at] = 1.0f / w;
        map->normal[at] = nx * scale;
        map->normal[pixels + at] = ny * scale;
        map->normal[2 * pixels + at] = nz * scale;
        map->cost[at] = field->cost[at];
    }
}
