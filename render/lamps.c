#include "render/lamps.h"

#include "brdf/sampling.h"

#include "core/clones.h"
#include "core/memory.h"

typedef tsuya_vec3f vec;
#define INLINE static inline __attribute__((always_inline))
static const float pi = 3.14159265f, inverse_pi = 0.318309886f;

/* Lamps whose weights are kept while one is chosen; of more, they are worked out twice. */
enum { LAMPS_AT_ONCE = 32 };

static void set3(float to[3], tsuya_vec3 v, double scale)
{
    to[0] = (float)(v.x * scale);
    to[1] = (float)(v.y * scale);
    to[2] = (float)(v.z * scale);
}

static tsuya_lamp lamp_of(const tsuya_light *l)
{
    tsuya_lamp row = {.area = (float)l->area_m2, .reach = (float)l->reach_m, .luminance = (float)l->luminance,
                      .round = l->kind == TSUYA_LIGHT_DISK, .placed = l->kind != TSUYA_LIGHT_DIRECTIONAL && l->kind != TSUYA_LIGHT_ENVIRONMENT};
    bool disk = l->kind == TSUYA_LIGHT_DISK, rect = l->kind == TSUYA_LIGHT_RECT;
    set3(row.position, l->position_m, 1.0);
    set3(row.direction, l->direction, 1.0);
    set3(row.side, l->side, disk || rect ? l->size_m[0] : 0.0);
    set3(row.up, l->up, disk ? l->size_m[0] : rect ? l->size_m[1] : 0.0);
    set3(row.rgb, (tsuya_vec3){l->rgb[0], l->rgb[1], l->rgb[2]}, 1.0);
    return row;
}

tsuya_status tsuya_lamps_create(tsuya_lamps *lamps, const tsuya_light_set *set)
{
    *lamps = (tsuya_lamps){.set = set, .lamp = tsuya_calloc((size_t)set->count + 1, sizeof *lamps->lamp)};
    if (!lamps->lamp) {
        return TSUYA_ERROR_MEMORY;
    }
    for (int k = 0; k < set->count; ++k) {
        tsuya_light_kind kind = set->light[k].kind;
        lamps->lamp[k] = lamp_of(&set->light[k]);
        lamps->in_the_way |= kind == TSUYA_LIGHT_DISK || kind == TSUYA_LIGHT_RECT || kind == TSUYA_LIGHT_ENVIRONMENT;
    }
    return TSUYA_OK;
}

void tsuya_lamps_free(tsuya_lamps *lamps)
{
    tsuya_free(lamps->lamp);
    *lamps = (tsuya_lamps){0};
}

INLINE vec vec_of(const float v[3]) { return (vec){v[0], v[1], v[2]}; }

/* --- which lamp --- */

/* tsuya_light_weight of a lamp that stands somewhere. */
TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
weights_near(const tsuya_lamp *l, int count, const tsuya_planes3 *restrict p, const tsuya_planes3 *restrict n, float *restrict weight)
{
    const vec position = vec_of(l->position), direction = vec_of(l->direction);
    const float reach = l->reach, luminance = l->luminance, area = l->area;
#pragma omp simd
    for (int k = 0; k < count; ++k) {
        vec d = tsuya_sub_f32(position, tsuya_lane(p, k));
        float r2 = tsuya_dot_f32(d, d), r = sqrtf(r2), cosine = (tsuya_dot_f32(tsuya_lane(n, k), d) + reach) / (r + reach);
        float facing = -tsuya_dot_f32(d, direction) / r, emitted = area > 0.0f ? area * (facing > 0.05f ? facing : 0.05f) : 1.0f;
        float w = luminance * cosine * emitted / (r2 + area * inverse_pi);
        weight[k] = (cosine > 0.0f) & (r > 0.0f) ? w : 0.0f;
    }
}

/* The same of light from afar. */
TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
weights_far(const tsuya_lamp *l, bool everywhere, int count, const tsuya_planes3 *restrict n, float *restrict weight)
{
    const vec direction = vec_of(l->direction);
    const float luminance = l->luminance;
#pragma omp simd
    for (int k = 0; k < count; ++k) {
        float cosine = everywhere ? pi : -tsuya_dot_f32(tsuya_lane(n, k), direction);
        weight[k] = cosine > 0.0f ? cosine * luminance : 0.0f;
    }
}

static void weigh(const tsuya_lamps *lamps, int lamp, int count, const tsuya_planes3 *p, const tsuya_planes3 *n, float *weight)
{
    const tsuya_lamp *l = &lamps->lamp[lamp];
    if (l->placed > 0.0f) {
        weights_near(l, count, p, n, weight);
    } else {
        weights_far(l, lamps->set->light[lamp].kind == TSUYA_LIGHT_ENVIRONMENT, count, n, weight);
    }
}

TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
add(float *restrict sum, const float *restrict weight, int count)
{
    for (int k = 0; k < count; ++k) {
        sum[k] += weight[k];
    }
}

/* The last lamp that shines here and begins at or before u of the sum. */
TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
offer(tsuya_lamp_choice *restrict c, int lamp, const float *restrict weight, const float *restrict u, float *restrict before, int count)
{
#pragma omp simd
    for (int k = 0; k < count; ++k) {
        bool taken = (weight[k] > 0.0f) & (before[k] <= u[k] * c->sum[k]);
        c->lamp[k] = taken ? lamp : c->lamp[k];
        c->probability[k] = taken ? weight[k] / c->sum[k] : c->probability[k];
        before[k] += weight[k];
    }
}

void tsuya_lamps_choose(const tsuya_lamps *lamps, int count, const tsuya_planes3 *p, const tsuya_planes3 *n, const float *u, tsuya_lamp_choice *choice)
{
    _Alignas(64) float weight[LAMPS_AT_ONCE + 1][TSUYA_LANES], before[TSUYA_LANES] = {0};
    const int lamps_count = lamps->set->count;
    for (int k = 0; k < count; ++k) {
        choice->lamp[k] = -1;
        choice->probability[k] = choice->sum[k] = 0.0f;
    }
    for (int k = 0; k < lamps_count; ++k) {
        float *w = weight[k < LAMPS_AT_ONCE ? k : LAMPS_AT_ONCE];
        weigh(lamps, k, count, p, n, w);
        add(choice->sum, w, count);
    }
    for (int k = 0; k < lamps_count; ++k) {
        float *w = weight[k < LAMPS_AT_ONCE ? k : LAMPS_AT_ONCE];
        if (k >= LAMPS_AT_ONCE) {
            weigh(lamps, k, count, p, n, w);
        }
        offer(choice, k, w, u, before, count);
    }
}

/* --- what arrives --- */

static void put3(tsuya_planes3 *to, int k, const float from[3])
{
    to->x[k] = from[0];
    to->y[k] = from[1];
    to->z[k] = from[2];
}

static void pick_up(tsuya_lamp_samples *s, const tsuya_lamps *lamps, int count, const tsuya_lamp_choice *choice)
{
    static const tsuya_lamp nothing;
    tsuya_picked_lamps *at = &s->picked;
    for (int k = 0; k < count; ++k) {
        const tsuya_lamp *l = choice->lamp[k] >= 0 ? &lamps->lamp[choice->lamp[k]] : &nothing;
        put3(&at->position, k, l->position);
        put3(&at->direction, k, l->direction);
        put3(&at->side, k, l->side);
        put3(&at->up, k, l->up);
        at->area[k] = l->area;
        at->round[k] = l->round;
        at->placed[k] = l->placed;
        for (int c = 0; c < 3; ++c) {
            s->rgb[c][k] = l->rgb[c];
        }
    }
}

/* Points, disks and rectangles; of the others, a constant environment, drawn by the cosine. */
TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
sample_all(tsuya_lamp_samples *restrict s, int count, const tsuya_planes3 *restrict p, const tsuya_planes3 *restrict n,
           const float *restrict u, const float *restrict v)
{
    const tsuya_picked_lamps *at = &s->picked;
#pragma omp simd
    for (int k = 0; k < count; ++k) {
        float disk_x, disk_y;
        tsuya_sample_disk_f32(u[k], v[k], &disk_x, &disk_y);
        bool round = at->round[k] > 0.0f, near = at->placed[k] > 0.0f, point = !(at->area[k] > 0.0f);
        float a = round ? 0.5f * disk_x : u[k] - 0.5f, b = round ? 0.5f * disk_y : v[k] - 0.5f;
        vec q = tsuya_mad_f32(tsuya_mad_f32(tsuya_lane(&at->position, k), a, tsuya_lane(&at->side, k)), b, tsuya_lane(&at->up, k));
        vec d = tsuya_sub_f32(q, tsuya_lane(p, k));
        float r2 = tsuya_dot_f32(d, d), r = sqrtf(r2), per_r = r > 0.0f ? 1.0f / r : 0.0f;
        float cosine = -tsuya_dot_f32(d, tsuya_lane(&at->direction, k)) * per_r;
        float area_pdf = cosine > 0.0f ? r2 / (cosine * at->area[k]) : 0.0f, near_pdf = point ? (r > 0.0f ? 1.0f : 0.0f) : area_pdf;
        float flat = 1.0f - disk_x * disk_x - disk_y * disk_y, up = sqrtf(flat > 0.0f ? flat : 0.0f);
        vec normal = tsuya_lane(n, k), x = tsuya_tangent_f32(normal), y = tsuya_cross_f32(normal, x);
        vec sky = tsuya_mad_f32(tsuya_mad_f32(tsuya_scale_f32(x, disk_x), disk_y, y), up, normal);
        float fall = near & point ? per_r * per_r : 1.0f;
        tsuya_set_lane(&s->wi, k, tsuya_choose_f32(near, tsuya_scale_f32(d, per_r), sky));
        s->distance[k] = near ? r : INFINITY;
        s->pdf[k] = near ? near_pdf : up * inverse_pi;
        s->delta[k] = near & point ? 1.0f : 0.0f;
        s->rgb[0][k] *= fall;
        s->rgb[1][k] *= fall;
        s->rgb[2][k] *= fall;
    }
}

/* What loops of all lamps do not know: spots, directional lamps, maps. */
static void sample_one(tsuya_lamp_samples *s, int k, const tsuya_light *light, const tsuya_planes3 *p, const tsuya_planes3 *n, const double u[2])
{
    tsuya_light_sample one;
    s->pdf[k] = 0.0f;
    if (tsuya_light_sample_at(light, tsuya_planes3_at(p, k), tsuya_planes3_at(n, k), u, &one)) {
        tsuya_planes3_set(&s->wi, k, one.wi);
        s->distance[k] = (float)one.distance_m;
        s->pdf[k] = (float)one.pdf;
        s->delta[k] = one.delta;
        for (int c = 0; c < 3; ++c) {
            s->rgb[c][k] = (float)one.rgb[c];
        }
    }
}

void tsuya_lamps_sample(const tsuya_lamps *lamps, int count, const tsuya_planes3 *p, const tsuya_planes3 *n, const tsuya_lamp_choice *choice,
                        const float *const u[2], tsuya_lamp_samples *s)
{
    pick_up(s, lamps, count, choice);
    sample_all(s, count, p, n, u[0], u[1]);
    for (int k = 0; k < count; ++k) {
        const tsuya_light *light = choice->lamp[k] >= 0 ? &lamps->set->light[choice->lamp[k]] : NULL;
        if (!light) {
            s->pdf[k] = 0.0f;
        } else if (light->kind == TSUYA_LIGHT_SPOT || light->kind == TSUYA_LIGHT_DIRECTIONAL || light->map) {
            sample_one(s, k, light, p, n, (const double[2]){u[0][k], u[1][k]});
        }
    }
}

/* --- what a ray runs into --- */

/* Density with which the lamp is sampled from where the ray starts; 0 where the ray misses it, or something is nearer. */
TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
meet_area(const tsuya_lamp *l, int count, const tsuya_lamp_rays *restrict r, float *restrict pdf)
{
    const vec position = vec_of(l->position), axis = vec_of(l->direction), side = vec_of(l->side), up = vec_of(l->up);
    const float width = 0.5f * tsuya_dot_f32(side, side), height = 0.5f * tsuya_dot_f32(up, up), per_area = 1.0f / l->area;
    const float radius = l->round > 0.0f ? width : INFINITY;
#pragma omp simd
    for (int k = 0; k < count; ++k) {
        vec w = tsuya_lane(&r->direction, k), to_lamp = tsuya_sub_f32(position, tsuya_lane(&r->from, k));
        float cosine = -tsuya_dot_f32(w, axis), per_cosine = 1.0f / cosine, t = -tsuya_dot_f32(to_lamp, axis) * per_cosine;
        vec d = tsuya_sub_f32(tsuya_scale_f32(w, t), to_lamp);
        float a = fabsf(tsuya_dot_f32(d, side)), b = fabsf(tsuya_dot_f32(d, up));
        float density = t * t * per_cosine * per_area;
        density = (a <= width) & (b <= height) & (a * a + b * b <= radius * radius) ? density : 0.0f;
        pdf[k] = (cosine > 0.0f) & (t > 0.0f) & (t <= r->reach[k]) ? density : 0.0f;
    }
}

TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
meet_sky(int count, const tsuya_lamp_rays *restrict r, float *restrict pdf)
{
#pragma omp simd
    for (int k = 0; k < count; ++k) {
        float cosine = tsuya_dot_f32(tsuya_lane(&r->n, k), tsuya_lane(&r->direction, k));
        pdf[k] = (r->reach[k] == INFINITY) & (cosine > 0.0f) ? cosine * inverse_pi : 0.0f;
    }
}

static void meet_map(const tsuya_light *light, int count, const tsuya_lamp_rays *r, float *pdf)
{
    for (int k = 0; k < count; ++k) {
        pdf[k] = r->reach[k] == INFINITY ? (float)tsuya_environment_pdf(light->map, tsuya_planes3_at(&r->direction, k)) : 0.0f;
    }
}

TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static bool
any_positive(const float *restrict pdf, int count)
{
    int any = 0;
    for (int k = 0; k < count; ++k) {
        any |= pdf[k] > 0.0f;
    }
    return any != 0;
}

/* Power heuristic of the directions' densities against the lamp's. */
TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
balance(float *restrict share, const float *restrict weight, const tsuya_lamp_rays *restrict r, int count)
{
#pragma omp simd
    for (int k = 0; k < count; ++k) {
        float sum = r->weights[k], lamp = share[k] * weight[k] / (sum > 0.0f ? sum : 1.0f), ratio = lamp / r->pdf[k];
        share[k] = share[k] > 0.0f ? 1.0f / (1.0f + (sum > 0.0f ? ratio * ratio : 0.0f)) : 0.0f;
    }
}

bool tsuya_lamps_meet(const tsuya_lamps *lamps, int lamp, int count, const tsuya_lamp_rays *r, float *share)
{
    const tsuya_light *light = &lamps->set->light[lamp];
    if (light->kind != TSUYA_LIGHT_ENVIRONMENT) {
        meet_area(&lamps->lamp[lamp], count, r, share);
    } else if (light->map) {
        meet_map(light, count, r, share);
    } else {
        meet_sky(count, r, share);
    }
    bool any = any_positive(share, count);
    if (any && !r->first && r->shared) {
        float weight[TSUYA_LANES];
        weigh(lamps, lamp, count, &r->from, &r->n, weight);
        balance(share, weight, r, count);
    } else if (any) {
        for (int k = 0; k < count; ++k) {
            share[k] = share[k] > 0.0f ? 1.0f : 0.0f;
        }
    }
    return any;
}
