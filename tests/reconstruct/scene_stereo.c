#include "scene_stereo.h"

#include "core/memory.h"
#include "core/order.h"

#include <stdlib.h>
#include <string.h>
#include <time.h>

bool scene_stereo_create(scene_stereo *s, const scene_pictures *scene, int levels)
{
    memset(s, 0, sizeof *s);
    s->scene = scene;
    for (int v = 0; v < scene->view_count; v++) {
        const scene_view *view = &scene->view[v];
        if (tsuya_stereo_image_create(&s->image[v], view->grey, &view->camera, view->camera_from_world, levels) != TSUYA_OK) {
            scene_stereo_free(s);
            return false;
        }
    }
    return true;
}

void scene_stereo_free(scene_stereo *s)
{
    for (int v = 0; v < SCENE_MOST_VIEWS; v++) {
        tsuya_stereo_image_free(&s->image[v]);
        tsuya_depth_map_free(&s->photometric[v]);
    }
}

double scene_stereo_seconds(const scene_stereo *s, bool cpu)
{
    double sum = 0.0;
    for (int pass = 0; pass < 2; pass++) {
        sum += s->megapixels[pass] > 0.0 ? (cpu ? s->cpu_seconds : s->seconds)[pass] / s->megapixels[pass] : 0.0;
    }
    return sum;
}

static double cpu_s(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static tsuya_status solve(tsuya_depth_map *map, scene_stereo *s, int view, bool geometric, bool filter, bool masked,
                          const tsuya_patchmatch_options *options, const tsuya_context *context)
{
    const scene_pictures *scene = s->scene;
    const size_t pixels = (size_t)scene->view[view].camera.width_px * (size_t)scene->view[view].camera.height_px;
    tsuya_patchmatch_source source[SCENE_MOST_VIEWS];
    int count = 0;
    for (int v = 0; v < scene->view_count; v++) {
        if (v != view && scene_same_side(scene, v, view)) {
            source[count++] = (tsuya_patchmatch_source){&s->image[v], geometric ? s->photometric[v].depth : NULL};
        }
    }
    uint8_t *mask = tsuya_calloc(pixels, 1);
    if (!mask) {
        return TSUYA_ERROR_MEMORY;
    }
    for (size_t i = 0; i < pixels; i++) {
        mask[i] = scene->view[view].depth[i] > 0.0f;
    }
    tsuya_patchmatch_problem problem = {
        .reference = &s->image[view], .mask = masked ? mask : NULL, .source = source, .source_count = count,
        .depth_min = 0.3, .depth_max = 2.2, .start = geometric ? &s->photometric[view] : NULL,
        .geometric = geometric, .filter = filter,
    };
    double began = tsuya_clock_s(), cpu = cpu_s();
    tsuya_status status = tsuya_patchmatch(map, &problem, options, context);
    s->seconds[geometric] += tsuya_clock_s() - began;
    s->cpu_seconds[geometric] += cpu_s() - cpu;
    for (size_t i = 0; i < pixels; i++) {
        s->megapixels[geometric] += masked && !mask[i] ? 0.0 : 1e-6;
    }
    tsuya_free(mask);
    return status;
}

tsuya_status scene_stereo_solve(tsuya_depth_map *map, scene_stereo *s, int view, bool geometric, bool masked,
                                const tsuya_patchmatch_options *options, const tsuya_context *context)
{
    const scene_pictures *scene = s->scene;
    if (!geometric) {
        return solve(map, s, view, false, true, masked, options, context);
    }
    for (int v = 0; v < scene->view_count; v++) {
        if (!s->photometric[v].depth && scene_same_side(scene, v, view)) {
            TSUYA_TRY(solve(&s->photometric[v], s, v, false, false, masked, options, context));
        }
    }
    return solve(map, s, view, true, true, masked, options, context);
}

static float normal_angle_deg(const float *a, const float *b, size_t at, size_t pixels)
{
    float dot = a[at] * b[at] + a[pixels + at] * b[pixels + at] + a[2 * pixels + at] * b[2 * pixels + at];
    return acosf(fminf(fmaxf(dot, -1.0f), 1.0f)) * 57.29578f;
}

bool scene_errors_measure(scene_errors *e, const scene_pictures *scene, int view, const tsuya_depth_map *map)
{
    const scene_view *v = &scene->view[view];
    const size_t pixels = (size_t)map->width_px * (size_t)map->height_px;
    float *error = tsuya_calloc(pixels, sizeof *error), *angle = tsuya_calloc(pixels, sizeof *angle);
    size_t count = 0, textured = 0, within = 0, filled = 0, wrong = 0, bare = 0, wrong_bare = 0;
    for (size_t i = 0; error && angle && i < pixels; i++) {
        float truth = v->depth[i], found = map->depth[i];
        float off = fabsf(found - truth) / (truth / (float)v->camera.fx_px);
        bool surface = truth > 0.0f, has = found > 0.0f;
        textured += v->textured[i];
        bare += surface && !v->textured[i];
        filled += has;
        wrong += has && !(surface && off <= 4.0f);
        wrong_bare += has && surface && !v->textured[i] && off > 4.0f;
        if (has && v->textured[i]) {
            within += off <= 2.0f;
            error[count] = off;
            angle[count++] = normal_angle_deg(map->normal, v->normal, i, pixels);
        }
    }
    bool done = error && angle && count > 0;
    if (done) {
        tsuya_sort_floats(error, count);
        tsuya_sort_floats(angle, count);
        *e = (scene_errors){error[count / 2], error[count * 9 / 10], (double)within / (double)textured,
                            (double)wrong / (double)filled, bare ? (double)wrong_bare / (double)bare : 0.0,
                            angle[count / 2]};
    }
    tsuya_free(error);
    tsuya_free(angle);
    return done;
}
