/* Photographs as stereo wants them: grey, padded, packed for bilinear loads, at several scales. */
#include "reconstruct/patchmatch.h"

#include "core/memory.h"

#include <string.h>

enum { LEAST_SIDE_PX = 24 };

static size_t padded_size(const tsuya_stereo_level *level)
{
    return (size_t)level->stride * (size_t)(level->height_px + 2 * TSUYA_STEREO_PAD);
}

static int clamp_int(int a, int low, int high) { return a < low ? low : a > high ? high : a; }

static void level_pad(tsuya_stereo_level *level, const float *grey)
{
    for (int y = 0; y < level->height_px + 2 * TSUYA_STEREO_PAD; y++) {
        const float *row = grey + (size_t)clamp_int(y - TSUYA_STEREO_PAD, 0, level->height_px - 1) * (size_t)level->width_px;
        float *out = level->grey + (size_t)y * (size_t)level->stride;
        for (int x = 0; x < level->stride; x++) {
            out[x] = row[clamp_int(x - TSUYA_STEREO_PAD, 0, level->width_px - 1)];
        }
    }
}

static uint64_t quad_sample(float grey)
{
    float value = (grey - 0.5f) * 32768.0f;
    value = value < -32768.0f ? -32768.0f : value > 32767.0f ? 32767.0f : value;
    return (uint64_t)(uint16_t)(int16_t)lrintf(value);
}

static tsuya_status level_quads(tsuya_stereo_level *level)
{
    const int rows = level->height_px + 2 * TSUYA_STEREO_PAD;
    level->quad = tsuya_calloc(padded_size(level), sizeof *level->quad);
    if (!level->quad) {
        return TSUYA_ERROR_MEMORY;
    }
    for (int y = 0; y < rows; y++) {
        const float *top = level->grey + (size_t)y * (size_t)level->stride;
        const float *bottom = y + 1 < rows ? top + level->stride : top;
        uint64_t *out = level->quad + (size_t)y * (size_t)level->stride;
        for (int x = 0; x < level->stride; x++) {
            int right = x + 1 < level->stride ? x + 1 : x;
            out[x] = quad_sample(top[x]) | quad_sample(top[right]) << 16 | quad_sample(bottom[x]) << 32 |
                     quad_sample(bottom[right]) << 48;
        }
    }
    return TSUYA_OK;
}

/* The next coarser scale, unpadded: means of 2 × 2 pixels, the last row and column repeated where a side is odd. */
static tsuya_status halve(float **half, const tsuya_stereo_level *level)
{
    int width = (level->width_px + 1) / 2, height = (level->height_px + 1) / 2;
    *half = tsuya_calloc((size_t)width * (size_t)height, sizeof **half);
    if (!*half) {
        return TSUYA_ERROR_MEMORY;
    }
    for (int y = 0; y < height; y++) {
        const float *top = level->grey + (size_t)(2 * y + TSUYA_STEREO_PAD) * (size_t)level->stride + TSUYA_STEREO_PAD;
        const float *bottom = top + level->stride; /* the padding repeats the last row */
        for (int x = 0; x < width; x++) {
            (*half)[(size_t)y * (size_t)width + (size_t)x] =
                0.25f * (top[2 * x] + top[2 * x + 1] + bottom[2 * x] + bottom[2 * x + 1]);
        }
    }
    return TSUYA_OK;
}

static tsuya_status level_create(tsuya_stereo_level *level, const float *grey, int width_px, int height_px)
{
    level->width_px = width_px;
    level->height_px = height_px;
    level->stride = width_px + 2 * TSUYA_STEREO_PAD;
    level->grey = tsuya_calloc(padded_size(level), sizeof *level->grey);
    if (!level->grey) {
        return TSUYA_ERROR_MEMORY;
    }
    level_pad(level, grey);
    return level_quads(level);
}

tsuya_status tsuya_stereo_image_create(tsuya_stereo_image *image, const float *grey, const tsuya_camera *camera,
                                       tsuya_pose camera_from_world, int levels)
{
    memset(image, 0, sizeof *image);
    image->camera_from_world = camera_from_world;
    tsuya_status status = TSUYA_OK;
    float *half = NULL;
    int width = camera->width_px, height = camera->height_px;
    double fx = camera->fx_px, fy = camera->fy_px, cx = camera->cx_px, cy = camera->cy_px;
    for (int l = 0; l < levels && l < TSUYA_STEREO_MAX_LEVELS; l++) {
        tsuya_stereo_level *level = &image->level[l];
        image->level_count = l + 1;
        TSUYA_GOTO_DONE(status, level_create(level, l ? half : grey, width, height));
        level->fx_px = fx, level->fy_px = fy, level->cx_px = cx, level->cy_px = cy;
        tsuya_free(half);
        half = NULL;
        if ((width < height ? width : height) < 2 * LEAST_SIDE_PX) {
            break;
        }
        TSUYA_GOTO_DONE(status, halve(&half, level));
        width = (width + 1) / 2, height = (height + 1) / 2;
        fx *= 0.5, fy *= 0.5, cx = (cx + 0.5) * 0.5 - 0.5, cy = (cy + 0.5) * 0.5 - 0.5;
    }
done:
    tsuya_free(half);
    if (status != TSUYA_OK) {
        tsuya_stereo_image_free(image);
    }
    return status;
}

void tsuya_stereo_image_free(tsuya_stereo_image *image)
{
    for (int l = 0; l < TSUYA_STEREO_MAX_LEVELS; l++) {
        tsuya_free(image->level[l].grey);
        tsuya_free(image->level[l].quad);
    }
    memset(image, 0, sizeof *image);
}

size_t tsuya_stereo_image_bytes(const tsuya_stereo_image *image)
{
    size_t bytes = sizeof *image;
    for (int l = 0; l < image->level_count; l++) {
        bytes += padded_size(&image->level[l]) * (sizeof(float) + sizeof(uint64_t));
    }
    return bytes;
}

tsuya_status tsuya_depth_map_create(tsuya_depth_map *map, int width_px, int height_px)
{
    size_t pixels = (size_t)width_px * (size_t)height_px;
    *map = (tsuya_depth_map){.width_px = width_px, .height_px = height_px};
    map->depth = tsuya_calloc(pixels, sizeof(float));
    map->normal = tsuya_calloc(pixels, 3 * sizeof(float));
    map->cost = tsuya_calloc(pixels, sizeof(float));
    if (!map->depth || !map->normal || !map->cost) {
        tsuya_depth_map_free(map);
        return TSUYA_ERROR_MEMORY;
    }
    return TSUYA_OK;
}

void tsuya_depth_map_free(tsuya_depth_map *map)
{
    tsuya_free(map->depth);
    tsuya_free(map->normal);
    tsuya_free(map->cost);
    *map = (tsuya_depth_map){0};
}
