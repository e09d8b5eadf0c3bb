/* Where there is no mask: a bare backdrop takes on the depth of what stands before it, as far as a window reaches over the
 * outline.  The backdrop is found as the bare region that goes out to the picture's border; of it, the pixels whose window
 * has texture only on the other side of a strong edge lose their depth. */
#include "reconstruct/patchmatch_filter.h"

static const float ALIKE = 0.05f;        /* grey: across more than this lies something else */
static const float STEP = 0.03f;         /* between neighbours of one bare region */
static const float BARE_CONTRAST = 0.01f; /* standard deviation of grey that bareness may have */
static const float LEAST_SHARE = 0.02f;  /* of the picture: less is no backdrop */
enum { LEAST_ALIKE = 12 };               /* samples; with fewer the pixel lies on something thin, which is texture */
enum { BARE = 1, BORROWED = 2, BACKDROP = 4 };

static float grey_at(const patch_level *level, int x, int y)
{
    return level->grey[(ptrdiff_t)(y + TSUYA_STEREO_PAD) * level->stride + x + TSUYA_STEREO_PAD];
}

/* What a plane over (x, y) leaves of the sum of v²; the matrix is that of 1, x, y. */
static float left_by_plane(const float n, const float s[5], const float v[3], float square)
{
    float ax = s[2] - s[0] * s[0] / n, ay = s[4] - s[1] * s[1] / n, axy = s[3] - s[0] * s[1] / n;
    float bx = v[1] - s[0] * v[0] / n, by = v[2] - s[1] * v[0] / n, flat = square - v[0] * v[0] / n;
    float det = ax * ay - axy * axy;
    return det > 1e-3f ? flat - (ay * bx * bx - 2.0f * axy * bx * by + ax * by * by) / det : flat;
}

/* BARE: the part of the window that is like its centre has no texture; BORROWED: and there is another part. */
static uint8_t classify(const patch_level *level, int x, int y)
{
    const float centre = grey_at(level, x, y);
    float s[5] = {0}, v[3] = {0}, square = 0.0f;
    int count = 0;
    for (int k = 0; k < PATCH_SAMPLES; k++) {
        int dx = PATCH_STEP * (k % PATCH_SIDE) - PATCH_RADIUS, dy = PATCH_STEP * (k / PATCH_SIDE) - PATCH_RADIUS;
        float d = grey_at(level, x + dx, y + dy) - centre, fx = (float)dx, fy = (float)dy;
        if (fabsf(d) <= ALIKE) {
            s[0] += fx, s[1] += fy, s[2] += fx * fx, s[3] += fx * fy, s[4] += fy * fy;
            v[0] += d, v[1] += d * fx, v[2] += d * fy, square += d * d;
            count++;
        }
    }
    if (count < LEAST_ALIKE || left_by_plane((float)count, s, v, square) > (float)count * BARE_CONTRAST * BARE_CONTRAST) {
        return 0;
    }
    return count < PATCH_SAMPLES ? BARE | BORROWED : BARE;
}

static size_t push(uint8_t *flag, size_t *stack, size_t count, size_t at)
{
    if ((flag[at] & (BARE | BACKDROP)) == BARE) {
        flag[at] |= BACKDROP;
        stack[count++] = at;
    }
    return count;
}

static size_t flood_from_border(uint8_t *flag, size_t *stack, const patch_level *level)
{
    const size_t width = (size_t)level->width_px, height = (size_t)level->height_px;
    size_t count = 0;
    for (size_t x = 0; x < width; x++) {
        count = push(flag, stack, count, x);
        count = push(flag, stack, count, (height - 1) * width + x);
    }
    for (size_t y = 0; y < height; y++) {
        count = push(flag, stack, count, y * width);
        count = push(flag, stack, count, y * width + width - 1);
    }
    for (size_t done = 0; done < count; done++) {
        static const int step[4][2] = {{-1, 0}, {1, 0}, {0, -1}, {0, 1}};
        int x = (int)(stack[done] % width), y = (int)(stack[done] / width);
        for (int k = 0; k < 4; k++) {
            int nx = x + step[k][0], ny = y + step[k][1];
            if (nx >= 0 && ny >= 0 && nx < level->width_px && ny < level->height_px &&
                fabsf(grey_at(level, nx, ny) - grey_at(level, x, y)) <= STEP) {
                count = push(flag, stack, count, (size_t)ny * width + (size_t)nx);
            }
        }
    }
    return count;
}

void tsuya_patchmatch_drop_backdrop(plane_field *field, const patch_level *level, uint8_t *flag, size_t *stack,
                                    const tsuya_context *context)
{
    const size_t pixels = (size_t)field->width_px * (size_t)field->height_px;
#pragma omp parallel for schedule(static) num_threads(context->threads)
    for (size_t at = 0; at < pixels; at++) {
        flag[at] = classify(level, (int)(at % (size_t)field->width_px), (int)(at / (size_t)field->width_px));
    }
    if ((float)flood_from_border(flag, stack, level) < LEAST_SHARE * (float)pixels) {
        return;
    }
    for (size_t at = 0; at < pixels; at++) {
        field->w[at] = flag[at] & BACKDROP && flag[at] & BORROWED ? 0.0f : field->w[at];
    }
}
