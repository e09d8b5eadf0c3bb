/* The schedule of PatchMatch: scales, passes, and the step from one scale to the next (patchmatch.h says what and after
 * whom). */
#include "reconstruct/patchmatch.h"

#include "core/memory.h"
#include "reconstruct/patchmatch_filter.h"
#include "reconstruct/patchmatch_sweep.h"

#include <string.h>

tsuya_patchmatch_options tsuya_patchmatch_options_default(void)
{
    return (tsuya_patchmatch_options){
        .simd = TSUYA_SIMD_AUTO,
        .coarse_to_fine = true,
        .view_selection = true,
        .coarse_iterations = 4,
        .fine_iterations = 2,
        .geometric_iterations = 2,
        .sigma_color = 0.12f,
        .max_cost = 0.85f,
        .min_contrast = 0.004f,
        .min_roughness = 0.15f,
        .max_reprojection_px = 2.0f,
        .max_depth_error = 0.01f,
        .min_consistent = 2,
        .min_component_px = 60,
    };
}

patch_row_kernel tsuya_patch_row_kernel(tsuya_simd simd)
{
#ifdef __x86_64__
    bool wide = __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
                __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl");
    if (wide && (simd == TSUYA_SIMD_AUTO || simd == TSUYA_SIMD_AVX512)) {
        return tsuya_patch_row_avx512;
    }
    if ((simd == TSUYA_SIMD_AUTO || simd >= TSUYA_SIMD_AVX2) && __builtin_cpu_supports("avx2")) {
        return tsuya_patch_row_avx2;
    }
    if (simd != TSUYA_SIMD_PORTABLE && __builtin_cpu_supports("sse4.2")) {
        return tsuya_patch_row_sse42;
    }
#else
    (void)simd;
#endif
    return tsuya_patch_row_portable;
}

/* ---- one scale ---- */

typedef struct scale {
    patch_level level;
    plane_field field;
    uint8_t *active;
    float *keep;
} scale;

static void scale_free(scale *s)
{
    void *memory[] = {s->field.w, s->field.wx, s->field.wy, s->field.cost, s->field.view,
                      s->active, s->keep};
    for (size_t i = 0; i < sizeof memory / sizeof *memory; i++) {
        tsuya_free(memory[i]);
    }
    memset(s, 0, sizeof *s);
}

static void matrix_to_float(float out[3][3], tsuya_mat3 m)
{
    for (int r = 0; r < 3; r++) {
        for (int c = 0; c < 3; c++) {
            out[r][c] = (float)m.e[r][c];
        }
    }
}

static tsuya_mat3 calibration(const tsuya_stereo_level *l)
{
    return (tsuya_mat3){{{l->fx_px, 0, l->cx_px}, {0, l->fy_px, l->cy_px}, {0, 0, 1}}};
}

static tsuya_mat3 calibration_inverse(const tsuya_stereo_level *l)
{
    return (tsuya_mat3){{{1 / l->fx_px, 0, -l->cx_px / l->fx_px}, {0, 1 / l->fy_px, -l->cy_px / l->fy_px}, {0, 0, 1}}};
}

static void source_setup(patch_source *out, double *px_per_w, const tsuya_patchmatch_source *source,
                         const tsuya_stereo_image *reference, int level, double w)
{
    const tsuya_stereo_level *r = &reference->level[level], *s = &source->image->level[level];
    tsuya_pose relative = tsuya_pose_compose(source->image->camera_from_world,
                                             tsuya_pose_inverse(reference->camera_from_world));
    tsuya_mat3 ks = calibration(s), kr = calibration(r);
    tsuya_mat3 a = tsuya_mat3_multiply(ks, tsuya_mat3_multiply(relative.rotation, calibration_inverse(r)));
    tsuya_vec3 b = tsuya_mat3_apply(ks, relative.translation);
    /* d(pixel)/dw at the middle of the reference: how far depth moves the projection. */
    tsuya_vec3 middle = {0.5 * r->width_px, 0.5 * r->height_px, 1};
    tsuya_vec3 p = tsuya_vec3_mad(tsuya_mat3_apply(a, middle), w, b);
    *px_per_w = hypot(b.x - p.x / p.z * b.z, b.y - p.y / p.z * b.z) / fabs(p.z);

    const double pad = TSUYA_STEREO_PAD;
    tsuya_mat3 fixed = {{{1, 0, pad}, {0, 1, pad}, {0, 0, 1}}};
    matrix_to_float(out->forward, tsuya_mat3_multiply(fixed, a));
    b = tsuya_mat3_apply(fixed, b);
    out->shift[0] = (float)b.x, out->shift[1] = (float)b.y, out->shift[2] = (float)b.z;

    tsuya_pose back = tsuya_pose_inverse(relative);
    matrix_to_float(out->back, tsuya_mat3_multiply(kr, tsuya_mat3_multiply(back.rotation, calibration_inverse(s))));
    tsuya_vec3 c = tsuya_mat3_apply(kr, back.translation);
    out->back_shift[0] = (float)c.x, out->back_shift[1] = (float)c.y, out->back_shift[2] = (float)c.z;
    out->quad = s->quad;
    out->stride = s->stride;
    out->width_px = s->width_px;
    out->height_px = s->height_px;
    out->depth = source->depth;
}

static void level_setup(patch_level *out, const tsuya_patchmatch_problem *problem,
                        const tsuya_patchmatch_options *options, int level, uint64_t seed)
{
    const tsuya_stereo_level *r = &problem->reference->level[level];
    out->grey = r->grey;
    out->stride = r->stride;
    out->width_px = r->width_px;
    out->height_px = r->height_px;
    out->fx_px = (float)r->fx_px, out->fy_px = (float)r->fy_px;
    out->cx_px = (float)r->cx_px, out->cy_px = (float)r->cy_px;
    out->w_min = (float)(1.0 / problem->depth_max);
    out->w_max = (float)(1.0 / problem->depth_min);
    out->source_count = problem->source_count;
    double sum = 0, w = sqrt(1.0 / (problem->depth_min * problem->depth_max));
    for (int s = 0; s < problem->source_count; s++) {
        double px_per_w;
        source_setup(&out->source[s], &px_per_w, &problem->source[s], problem->reference, level, w);
        sum += px_per_w;
    }
    out->w_per_px = sum > 0 ? (float)(problem->source_count / sum) : 0.0f;
    for (int k = 0; k < PATCH_SAMPLES; k++) {
        double dx = PATCH_STEP * (k % PATCH_SIDE) - PATCH_RADIUS, dy = PATCH_STEP * (k / PATCH_SIDE) - PATCH_RADIUS;
        out->spatial[k] = (float)exp(-(dx * dx + dy * dy) / (2.0 * PATCH_RADIUS * PATCH_RADIUS));
    }
    out->color_factor = -1.0f / (2.0f * options->sigma_color * options->sigma_color);
    out->geometric = problem->geometric;
    out->view_selection = options->view_selection;
    out->seed = (uint32_t)tsuya_random_u64(seed, 0x57E4E0, (uint64_t)level);
}

/* The mask at a scale: pixels more than half of which it keeps. */
static void mask_setup(scale *s, const tsuya_patchmatch_problem *problem, int level)
{
    const int width = s->level.width_px, height = s->level.height_px, block = 1 << level;
    const int full_width = problem->reference->level[0].width_px, full_height = problem->reference->level[0].height_px;
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            int kept = 0, seen = 0;
            for (int by = y * block; by < (y + 1) * block && by < full_height; by++) {
                for (int bx = x * block; bx < (x + 1) * block && bx < full_width; bx++) {
                    kept += problem->mask[(size_t)by * (size_t)full_width + (size_t)bx] != 0;
                    seen++;
                }
            }
            s->active[(size_t)y * (size_t)width + (size_t)x] = 2 * kept > seen;
        }
    }
    for (int y = -TSUYA_STEREO_PAD; y < height + TSUYA_STEREO_PAD; y++) {
        for (int x = -TSUYA_STEREO_PAD; x < width + TSUYA_STEREO_PAD; x++) {
            int cx = x < 0 ? 0 : x >= width ? width - 1 : x, cy = y < 0 ? 0 : y >= height ? height - 1 : y;
            s->keep[(size_t)(y + TSUYA_STEREO_PAD) * (size_t)s->level.stride + (size_t)(x + TSUYA_STEREO_PAD)] =
                s->active[(size_t)cy * (size_t)width + (size_t)cx];
        }
    }
}

static tsuya_status scale_create(scale *s, const tsuya_patchmatch_problem *problem,
                                 const tsuya_patchmatch_options *options, int level, uint64_t seed)
{
    memset(s, 0, sizeof *s);
    level_setup(&s->level, problem, options, level, seed);
    const size_t pixels = (size_t)s->level.width_px * (size_t)s->level.height_px;
    tsuya_status status = TSUYA_OK;
    s->field.width_px = s->level.width_px;
    s->field.height_px = s->level.height_px;
    TSUYA_NEW(status, s->field.w, pixels);
    TSUYA_NEW(status, s->field.wx, pixels);
    TSUYA_NEW(status, s->field.wy, pixels);
    TSUYA_NEW(status, s->field.cost, pixels);
    TSUYA_NEW(status, s->field.view, pixels);
    TSUYA_NEW(status, s->active, pixels);
    if (problem->mask) {
        TSUYA_NEW(status, s->keep, (size_t)s->level.stride * (size_t)(s->level.height_px + 2 * TSUYA_STEREO_PAD));
        mask_setup(s, problem, level);
    } else {
        memset(s->active, 1, pixels);
    }
    s->field.active = s->active;
    s->level.keep = s->keep;
done:
    if (status != TSUYA_OK) {
        scale_free(s);
    }
    return status;
}

/* Planes of a finer scale from the coarser one: that of the pixel that covers it, or of the nearest active one around.
 * They come with their cost there, which ranks them well enough until the first sweep measures it here. */
static void scale_refine(scale *fine, const scale *coarse)
{
    const plane_field *c = &coarse->field;
    for (int y = 0; y < fine->level.height_px; y++) {
        for (int x = 0; x < fine->level.width_px; x++) {
            size_t at = (size_t)y * (size_t)fine->level.width_px + (size_t)x;
            fine->field.cost[at] = PATCH_COST_IMPOSSIBLE;
            double px = (x + 0.5) / 2 - 0.5, py = (y + 0.5) / 2 - 0.5, least = HUGE_VAL;
            for (int k = 0; k < 9 && fine->active[at]; k++) {
                int nx = x / 2 + k % 3 - 1, ny = y / 2 + k / 3 - 1;
                if (nx < 0 || ny < 0 || nx >= c->width_px || ny >= c->height_px) {
                    continue;
                }
                size_t from = (size_t)ny * (size_t)c->width_px + (size_t)nx;
                double distance = (nx - px) * (nx - px) + (ny - py) * (ny - py);
                if (c->active[from] && distance < least) {
                    least = distance;
                    fine->field.w[at] = c->w[from] + c->wx[from] * (float)(px - nx) + c->wy[from] * (float)(py - ny);
                    fine->field.wx[at] = 0.5f * c->wx[from];
                    fine->field.wy[at] = 0.5f * c->wy[from];
                    fine->field.cost[at] = c->cost[from];
                    fine->field.view[at] = c->view[from];
                }
            }
        }
    }
}

/* ---- passes ---- */

static tsuya_status run_pass(scale *s, const patch_pass *pass, patch_row_kernel kernel, const tsuya_context *context)
{
#pragma omp parallel for schedule(dynamic, 2) num_threads(context->threads)
    for (int y = 0; y < s->level.height_px; y++) {
        if (!tsuya_interrupted()) {
            kernel(&s->level, &s->field, pass, y);
        }
    }
    return tsuya_check_interrupt();
}

typedef struct sweep_plan {
    int iterations;
    float reach_px, tilt; /* of the first iteration; halved by each next one, down to a quarter pixel and 0.06 */
    int anywhere;         /* iterations that may jump over the whole range */
    bool polish;          /* in the last iteration */
} sweep_plan;

static tsuya_status run_sweeps(scale *s, const sweep_plan *plan, patch_mode first, uint32_t *turn,
                               patch_row_kernel kernel, const tsuya_context *context)
{
    patch_pass pass = {.mode = first, .color = -1, .turn = (*turn)++, .good_limit = 0.8f};
    if (first != PATCH_SWEEP) {
        TSUYA_TRY(run_pass(s, &pass, kernel, context));
    }
    for (int i = 0; i < plan->iterations; i++) {
        float shrink = ldexpf(1.0f, -i);
        pass = (patch_pass){
            .mode = PATCH_SWEEP,
            .turn = (*turn)++,
            .good_limit = 0.8f * (float)exp(-i * i / 90.0),
            .reach_px = fmaxf(plan->reach_px * shrink, 0.25f),
            .tilt = fmaxf(plan->tilt * shrink, 0.06f),
            .anywhere = i < plan->anywhere,
            .refinements = i < plan->anywhere || plan->iterations == 1 ? 5 : 3,
            .strips = 4,
            .polish = plan->polish && i == plan->iterations - 1,
        };
        for (pass.color = 0; pass.color < 2; pass.color++) {
            if (i >= plan->anywhere) {
                pass.strips = (i + pass.color) & 1 ? -2 : 2;
            }
            TSUYA_TRY(run_pass(s, &pass, kernel, context));
        }
    }
    return TSUYA_OK;
}

static void start_from_map(scale *s, const tsuya_depth_map *map)
{
    const patch_level *l = &s->level;
    size_t pixels = (size_t)l->width_px * (size_t)l->height_px;
    for (size_t at = 0; at < pixels; at++) {
        float depth = map->depth[at];
        if (!s->active[at] || !(depth > 0.0f)) {
            continue;
        }
        float rx = ((float)(at % (size_t)l->width_px) - l->cx_px) / l->fx_px;
        float ry = ((float)(at / (size_t)l->width_px) - l->cy_px) / l->fy_px;
        float nx = map->normal[at], ny = map->normal[pixels + at], nz = map->normal[2 * pixels + at];
        float facing = nx * rx + ny * ry + nz;
        float k = fabsf(facing) > 1e-6f ? 1.0f / (depth * facing) : 0.0f;
        s->field.w[at] = 1.0f / depth;
        s->field.wx[at] = k * nx / l->fx_px;
        s->field.wy[at] = k * ny / l->fy_px;
    }
}

static tsuya_status solve_geometric(scale *s, const tsuya_patchmatch_problem *problem,
                                    const tsuya_patchmatch_options *options, const tsuya_context *context)
{
    uint32_t turn = 0x100;
    TSUYA_TRY(scale_create(s, problem, options, 0, context->seed));
    start_from_map(s, problem->start);
    sweep_plan plan = {options->geometric_iterations, 1.0f, 0.25f, 0, true};
    return run_sweeps(s, &plan, PATCH_SCORE, &turn, tsuya_patch_row_kernel(options->simd), context);
}

/* Scales that the reference and every source have. */
static int common_levels(const tsuya_patchmatch_problem *problem)
{
    int levels = problem->reference->level_count;
    for (int s = 0; s < problem->source_count; s++) {
        levels = problem->source[s].image->level_count < levels ? problem->source[s].image->level_count : levels;
    }
    return levels;
}

static tsuya_status solve_photometric(scale *s, const tsuya_patchmatch_problem *problem,
                                      const tsuya_patchmatch_options *options, const tsuya_context *context)
{
    patch_row_kernel kernel = tsuya_patch_row_kernel(options->simd);
    uint32_t turn = 0;
    scale coarse = {0};
    tsuya_status status = TSUYA_OK;
    int levels = options->coarse_to_fine ? common_levels(problem) : 1;
    for (int l = levels - 1; l >= 0; l--) {
        bool first = l == levels - 1;
        /* One full-size sweep is enough where a geometric pass adds another. */
        bool followed = l == 0 && !problem->filter;
        sweep_plan plan = {followed ? 1 : options->fine_iterations, 2.0f, 0.5f, 0, l == 0};
        if (first) {
            plan.iterations = options->coarse_iterations;
            plan.reach_px = 8.0f;
            plan.tilt = 1.0f;
            plan.anywhere = options->coarse_iterations - 1;
        }
        TSUYA_GOTO_DONE(status, scale_create(s, problem, options, l, context->seed));
        if (first && problem->start && problem->start->width_px == s->level.width_px) {
            start_from_map(s, problem->start);
        }
        if (!first) {
            scale_refine(s, &coarse);
        }
        scale_free(&coarse);
        TSUYA_GOTO_DONE(status, run_sweeps(s, &plan, first ? PATCH_START : PATCH_SWEEP, &turn, kernel, context));
        if (l > 0) {
            coarse = *s;
            memset(s, 0, sizeof *s);
        }
    }
done:
    scale_free(&coarse);
    return status;
}

tsuya_status tsuya_patchmatch(tsuya_depth_map *map, const tsuya_patchmatch_problem *problem,
                              const tsuya_patchmatch_options *options, const tsuya_context *context)
{
    scale s = {0};
    memset(map, 0, sizeof *map);
    tsuya_status status = problem->geometric ? solve_geometric(&s, problem, options, context)
                                             : solve_photometric(&s, problem, options, context);
    if (status == TSUYA_OK && problem->filter) {
        status = tsuya_patchmatch_filter(&s.field, &s.level, options, context);
    }
    if (status == TSUYA_OK) {
        status = tsuya_depth_map_create(map, s.level.width_px, s.level.height_px);
    }
    if (status == TSUYA_OK) {
        tsuya_patchmatch_store(map, &s.field, &s.level);
    }
    scale_free(&s);
    return status;
}
