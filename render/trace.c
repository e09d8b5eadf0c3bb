#include "render/trace.h"

#include "render/group.h"

#include "core/clones.h"
#include "core/color.h"
#include "core/memory.h"

#include <math.h>

typedef tsuya_vec3f vec;

/* Dimension pairs of a bounce. */
enum { PAIR_LAMP, PAIR_DIRECTION, PAIR_CHOICE, PAIR_TURN, PAIR_SIDE, PAIRS_PER_BOUNCE };

static uint32_t pair_of(int depth, int which) { return (uint32_t)(TSUYA_PAIR_FIRST + PAIRS_PER_BOUNCE * depth + which); }

void tsuya_tracer_free(tsuya_tracer *t)
{
    for (int k = 0; t->response && k < t->lights->count; ++k) {
        tsuya_free(t->response[k]);
    }
    tsuya_free(t->response);
    t->response = NULL;
    tsuya_lamps_free(&t->lamps);
}

static tsuya_status respond(tsuya_tracer *t)
{
    tsuya_status status = TSUYA_OK;
    TSUYA_NEW(status, t->response, (size_t)t->lights->count + 1);
    for (int k = 0; k < t->lights->count; ++k) {
        if (t->lights->light[k].spectrum) {
            TSUYA_NEW(status, t->response[k], 3 * (size_t)t->bands->count);
            tsuya_bands_respond(t->response[k], t->bands, t->lights->light[k].spectrum);
        }
    }
done:
    return status;
}

tsuya_status tsuya_tracer_create(tsuya_tracer *t, const tsuya_scene *scene, const tsuya_light_set *lights, const tsuya_path_options *options)
{
    *t = (tsuya_tracer){.scene = scene, .lights = lights, .options = options, .bands = tsuya_scene_bands(scene)};
    tsuya_status status = tsuya_lamps_create(&t->lamps, lights);
    if (status == TSUYA_OK && t->bands) {
        status = respond(t);
    }
    if (status != TSUYA_OK) {
        tsuya_tracer_free(t);
    }
    return status;
}

static int channels_of(const tsuya_tracer *t) { return t->bands ? t->bands->count : 3; }

/* Both in one piece, at a multiple of what their planes want. */
typedef struct whole_wave { tsuya_wave wave; tsuya_wave_group group; } whole_wave;

tsuya_status tsuya_wave_create(tsuya_wave **wave, const tsuya_tracer *t)
{
    tsuya_status status = TSUYA_OK;
    char *block;
    const size_t channels = (size_t)channels_of(t), aligned = _Alignof(whole_wave);
    *wave = NULL;
    TSUYA_NEW(status, block, sizeof(whole_wave) + aligned);
    whole_wave *w = (whole_wave *)(block + (aligned - (uintptr_t)block % aligned) % aligned);
    w->wave.block = block;
    w->wave.group = &w->group;
    *wave = &w->wave;
    TSUYA_NEW(status, w->wave.throughput, channels * TSUYA_WAVE);
    TSUYA_NEW(status, w->group.f, channels * TSUYA_LANES);
    TSUYA_NEW(status, w->group.dye, channels * TSUYA_LANES);
    TSUYA_NEW(status, w->group.rest, channels * TSUYA_LANES);
    return TSUYA_OK;
done:
    tsuya_wave_free(*wave);
    *wave = NULL;
    return status;
}

void tsuya_wave_free(tsuya_wave *w)
{
    if (w) {
        tsuya_free(w->group->f);
        tsuya_free(w->group->dye);
        tsuya_free(w->group->rest);
        tsuya_free(w->throughput);
        tsuya_free(w->block);
    }
}

static double dot(const double *a, const double *b, int count)
{
    double sum = 0.0;
    for (int c = 0; c < count; ++c) {
        sum += a[c] * b[c];
    }
    return sum;
}

/* Adds what the picture gets of a lamp's light, `sent` as colour and with the lamp's own response where it has one, when `kept` of each
 * band arrives. */
static void receive_bands(const tsuya_bands *b, const double *own, const double sent[3], const double *kept, double scale, double rgb[3])
{
    double level = tsuya_rgb_luminance(sent);
    for (int c = 0; c < 3; ++c) {
        rgb[c] += scale * (own ? level * dot(own + c * b->count, kept, b->count)
                               : sent[0] * dot(b->response[0][c], kept, b->count) + sent[1] * dot(b->response[1][c], kept, b->count) +
                                     sent[2] * dot(b->response[2][c], kept, b->count));
    }
}

/* The same, also without bands; `kept`'s channels are `stride` apart. */
static void receive(const tsuya_tracer *t, int lamp, const float sent[3], const float *kept, int stride, float scale, float rgb[3])
{
    double all[TSUYA_MATERIAL_MAX_CHANNELS], sum[3] = {0, 0, 0};
    if (!t->bands) {
        for (int c = 0; c < 3; ++c) {
            rgb[c] += kept[c * stride] * sent[c] * scale;
        }
        return;
    }
    for (int c = 0; c < t->bands->count; ++c) {
        all[c] = (double)kept[c * stride];
    }
    receive_bands(t->bands, t->response[lamp], (const double[3]){(double)sent[0], (double)sent[1], (double)sent[2]}, all, (double)scale, sum);
    for (int c = 0; c < 3; ++c) {
        rgb[c] += (float)sum[c];
    }
}

/* --- rays --- */

static tsuya_ray make_ray(tsuya_vec3f origin, tsuya_vec3f direction, float far)
{
    return (tsuya_ray){{origin.x, origin.y, origin.z}, {direction.x, direction.y, direction.z}, 0.0f, far};
}

/* How many of the list from `first` on go as one packet: a bundle's first rays; 1: a ray by itself. */
static int packet_at(const tsuya_tracer *t, const tsuya_wave *w, const int *list, int first, int count, bool bundled)
{
    int size = 1;
    while (bundled && first + size < count && w->walker[list[first + size]].bundle == w->walker[list[first]].bundle) {
        ++size;
    }
    return size > 2 && !t->options->single_rays ? size : 1;
}

static void report_rays(const tsuya_tracer *t, const tsuya_ray *ray, int count, bool shadow)
{
    if (t->options->ray_sink) {
        t->options->ray_sink(t->options->ray_user, ray, count, shadow);
    }
}

static void intersect_one(const tsuya_tracer *t, tsuya_walker *w)
{
    report_rays(t, &w->ray, 1, false);
    w->struck = tsuya_scene_intersect(t->scene, &w->ray, &w->hit);
}

static void intersect_packet(const tsuya_tracer *t, tsuya_wave *w, const int *list, int size)
{
    tsuya_ray ray[TSUYA_RAY_PACKET];
    tsuya_ray_hit hit[TSUYA_RAY_PACKET];
    bool struck[TSUYA_RAY_PACKET];
    for (int i = 0; i < TSUYA_RAY_PACKET; ++i) {
        ray[i] = w->walker[list[i < size ? i : 0]].ray;
    }
    report_rays(t, ray, size, false);
    tsuya_scene_intersect_packet(t->scene, ray, size, hit, struck);
    for (int i = 0; i < size; ++i) {
        w->walker[list[i]].struck = struck[i];
        w->walker[list[i]].hit = hit[i];
    }
}

/* Every living walker's ray: struck, hit. */
static void intersect_all(const tsuya_tracer *t, tsuya_wave *w, bool bundled)
{
    for (int k = 0, size; k < w->alive_count; k += size) {
        size = packet_at(t, w, w->alive, k, w->alive_count, bundled);
        if (size > 1) {
            intersect_packet(t, w, w->alive + k, size);
        } else {
            intersect_one(t, &w->walker[w->alive[k]]);
        }
        for (int i = k; i < k + size; ++i) {
            if (w->walker[w->alive[i]].struck) {
                tsuya_scene_prefetch_triangle(t->scene, &w->walker[w->alive[i]].hit);
            }
        }
    }
}

/* Adds the lamps that are seen. Returns the number of shadow rays. */
static int occlude_all(const tsuya_tracer *t, tsuya_wave *w, bool bundled)
{
    int list[TSUYA_WAVE], count = 0;
    for (int k = 0; k < w->alive_count; ++k) {
        list[count] = w->alive[k];
        count += w->walker[w->alive[k]].lit;
    }
    for (int k = 0, size; k < count; k += size) {
        tsuya_ray ray[TSUYA_RAY_PACKET];
        bool hidden[TSUYA_RAY_PACKET];
        size = packet_at(t, w, list, k, count, bundled);
        for (int i = 0; i < size; ++i) {
            ray[i] = w->walker[list[k + i]].shadow;
        }
        report_rays(t, ray, size, true);
        if (size > 1) {
            tsuya_scene_occluded_packet(t->scene, ray, size, hidden);
        } else {
            hidden[0] = tsuya_scene_occluded(t->scene, ray);
        }
        for (int i = 0; i < size; ++i) {
            tsuya_walker *one = &w->walker[list[k + i]];
            for (int c = 0; c < 3 && !hidden[i]; ++c) {
                one->rgb[c] += one->lamp[c];
            }
        }
    }
    return count;
}

/* --- lamps that rays run into --- */

/* What the lamps' loops need of some walkers, side by side. */
static void line_up(const tsuya_wave *w, const int *list, int count, tsuya_lamp_rays *r)
{
    for (int k = 0; k < tsuya_lanes_padded(count); ++k) {
        const tsuya_walker *one = &w->walker[list[k < count ? k : 0]];
        const vec origin = {one->ray.origin[0], one->ray.origin[1], one->ray.origin[2]};
        const vec direction = {one->ray.direction[0], one->ray.direction[1], one->ray.direction[2]};
        r->reach[k] = one->struck ? one->hit.distance : INFINITY;
        r->pdf[k] = one->last_pdf;
        r->weights[k] = one->lamp_weights;
        tsuya_set_lane(&r->direction, k, direction);
        tsuya_set_lane(&r->from, k, r->first ? origin : one->last_p);
        tsuya_set_lane(&r->n, k, r->first ? direction : one->last_n);
    }
}

/* One lamp on the ways of those that are lined up. */
static void add_lamp_met(const tsuya_tracer *t, tsuya_wave *w, const int *list, int count, int lamp, const tsuya_lamp_rays *r)
{
    const tsuya_light *light = &t->lights->light[lamp];
    float share[TSUYA_LANES];
    if (!tsuya_lamps_meet(&t->lamps, lamp, tsuya_lanes_padded(count), r, share)) {
        return;
    }
    for (int k = 0; k < count; ++k) {
        if (!(share[k] > 0.0f)) {
            continue;
        }
        double emitted[3] = {light->rgb[0], light->rgb[1], light->rgb[2]};
        if (light->map) {
            tsuya_light_radiance(light, tsuya_planes3_at(&r->direction, k), emitted);
        }
        const float sent[3] = {(float)emitted[0], (float)emitted[1], (float)emitted[2]};
        receive(t, lamp, sent, w->throughput + list[k] * channels_of(t), 1, share[k], w->walker[list[k]].rgb);
    }
}

/* Lamps that the living walkers' rays run into before they meet the cloth; first: seen by the camera itself. */
static void add_lamps_met(const tsuya_tracer *t, tsuya_wave *w, bool first)
{
    tsuya_lamp_rays *r = &w->group->rays;
    r->first = first;
    r->shared = t->options->strategy == TSUYA_STRATEGY_MIS;
    for (int k = 0; k < w->alive_count && (first || t->options->strategy != TSUYA_STRATEGY_LAMPS); k += TSUYA_LANES) {
        int count = w->alive_count - k < TSUYA_LANES ? w->alive_count - k : TSUYA_LANES;
        line_up(w, w->alive + k, count, r);
        for (int i = 0; i < t->lights->count; ++i) {
            bool sky = t->lights->light[i].kind == TSUYA_LIGHT_ENVIRONMENT;
            if (sky || (t->lights->light[i].area_m2 > 0.0 && (!first || t->options->lamps_visible))) {
                add_lamp_met(t, w, w->alive + k, count, i, r);
            }
        }
    }
}

/* --- a group of lanes --- */

static void take_chances(tsuya_wave_group *g, const tsuya_wave *w)
{
    for (int k = 0; k < g->padded; ++k) {
        const tsuya_walker *one = &w->walker[g->path[k < g->count ? k : 0]];
        g->key[k] = one->key;
        g->sample[k] = one->sample;
    }
    tsuya_sampler_pairs(g->key, g->sample, g->padded, pair_of(g->depth, PAIR_CHOICE), g->chance[0], g->chance[1]);
}

/* Where the weft is unknown: the frame turned by a uniform angle, which averages the reflectance over the azimuth. */
static void turn_frames(tsuya_wave_group *g)
{
    for (int k = 0; k < g->count; ++k) {
        if (g->s.has_weft[k] > 0.0f) {
            continue;
        }
        double u[2];
        tsuya_sampler_pair((tsuya_sampler){g->key[k], g->sample[k]}, pair_of(g->depth, PAIR_TURN), u);
        double angle = 2.0 * M_PI * u[0], c = cos(angle), s = sin(angle);
        tsuya_vec3 x = tsuya_planes3_at(&g->s.x, k), y = tsuya_planes3_at(&g->s.y, k);
        tsuya_planes3_set(&g->s.x, k, tsuya_vec3_mad(tsuya_vec3_scale(x, c), s, y));
        tsuya_planes3_set(&g->s.y, k, tsuya_vec3_mad(tsuya_vec3_scale(y, c), -s, x));
    }
}

/* Weight of each lamp's sample: cosine over density, times its share against a sample of the direction under the strategy; 0 where it
 * does not count. */
TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
weigh_lamps(tsuya_wave_group *restrict g, bool shared)
{
#pragma omp simd
    for (int k = 0; k < g->padded; ++k) {
        float pdf = g->lamp.pdf[k] * g->choice.probability[k], safe = pdf > 0.0f ? pdf : 1.0f, r = g->pdf[k] / safe;
        float share = shared & !(g->lamp.delta[k] > 0.0f) ? 1.0f / (1.0f + r * r) : 1.0f;
        g->scale[k] = (pdf > 0.0f) & (g->wi.z[k] > 0.0f) ? share * g->wi.z[k] / safe : 0.0f;
    }
}

/* Rays that decide whether the lamps' samples are seen: from g->origin along g->world as far as g->lamp.distance. */
TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
aim_shadows(tsuya_wave_group *restrict g)
{
#pragma omp simd
    for (int k = 0; k < g->padded; ++k) {
        vec direction = tsuya_lane(&g->world, k);
        float far = g->lamp.distance[k];
        bool near = far < INFINITY; /* the way from the surface is that from the ray's origin and a little */
        vec d = tsuya_mad_f32(tsuya_sub_f32(tsuya_lane(&g->s.p, k), tsuya_lane(&g->origin, k)), near ? far : 1.0f, direction);
        float length = sqrtf(tsuya_dot_f32(d, d)), scale = 1.0f / (length > 0.0f ? length : 1.0f);
        tsuya_set_lane(&g->world, k, tsuya_choose_f32(near, tsuya_scale_f32(d, scale), direction));
        g->lamp.distance[k] = near ? length * (1.0f - 1e-5f) : INFINITY;
    }
}

/* Light from one lamp a lane, chosen and sampled: w->lamp, w->shadow, w->lit. */
static void prepare_lamps(const tsuya_tracer *t, tsuya_wave *w, tsuya_wave_group *g)
{
    const int n = g->padded;
    tsuya_lamps_choose(&t->lamps, n, &g->s.p, &g->s.n, g->chance[0], &g->choice);
    for (int k = 0; k < g->count; ++k) {
        w->walker[g->path[k]].lamp_weights = g->choice.sum[k];
    }
    if (t->options->strategy == TSUYA_STRATEGY_BSDF) {
        return;
    }
    if (t->lamps.in_the_way) { /* else every lamp is a point */
        tsuya_sampler_pairs(g->key, g->sample, n, pair_of(g->depth, PAIR_LAMP), g->u[0], g->u[1]);
    }
    tsuya_lamps_sample(&t->lamps, n, &g->s.p, &g->s.n, &g->choice, (const float *const[2]){g->u[0], g->u[1]}, &g->lamp);
    g->world = g->lamp.wi;
    tsuya_surfaces_to_local(&g->s, &g->world, &g->wi);
    tsuya_group_eval_pdf(g);
    weigh_lamps(g, t->options->strategy == TSUYA_STRATEGY_MIS);
    tsuya_surfaces_ray_origins(&g->s, &g->world, &g->origin, g->starts);
    aim_shadows(g);
    for (int k = 0; k < g->count; ++k) {
        tsuya_walker *one = &w->walker[g->path[k]];
        const float *kept = w->throughput + g->path[k] * channels_of(t), sent[3] = {g->lamp.rgb[0][k], g->lamp.rgb[1][k], g->lamp.rgb[2][k]};
        if (!(g->scale[k] > 0.0f && g->starts[k] > 0.0f)) {
            continue;
        }
        for (int c = 0; c < channels_of(t); ++c) {
            g->f[c * n + k] *= kept[c];
        }
        one->lamp[0] = one->lamp[1] = one->lamp[2] = 0.0f;
        receive(t, g->choice.lamp[k], sent, g->f + k, n, g->scale[k], one->lamp);
        one->lit = one->lamp[0] > 0.0f || one->lamp[1] > 0.0f || one->lamp[2] > 0.0f;
        one->shadow = make_ray(tsuya_lane(&g->origin, k), tsuya_lane(&g->world, k), g->lamp.distance[k]);
    }
}

/* Draws the next directions; says which paths go on. */
static void scatter(const tsuya_tracer *t, tsuya_wave *w, tsuya_wave_group *g)
{
    const int n = g->padded;
    tsuya_sampler_pairs(g->key, g->sample, n, pair_of(g->depth, PAIR_DIRECTION), g->u[0], g->u[1]);
    tsuya_group_sample(g);
    tsuya_group_eval_pdf(g);
    tsuya_surfaces_to_world(&g->s, &g->wi, &g->world);
    tsuya_surfaces_ray_origins(&g->s, &g->world, &g->origin, g->starts);
    for (int k = 0; k < g->count; ++k) {
        tsuya_walker *one = &w->walker[g->path[k]];
        float *kept = w->throughput + g->path[k] * channels_of(t), most = 0.0f, scale = g->wi.z[k] / g->pdf[k];
        if (!(g->pdf[k] > 0.0f && g->wi.z[k] > 0.0f && g->starts[k] > 0.0f)) {
            continue;
        }
        for (int c = 0; c < channels_of(t); ++c) {
            kept[c] *= g->f[c * n + k] * scale;
            most = kept[c] > most ? kept[c] : most;
        }
        one->ray = make_ray(tsuya_lane(&g->origin, k), tsuya_lane(&g->world, k), INFINITY);
        one->last_p = tsuya_lane(&g->s.p, k);
        one->last_n = tsuya_lane(&g->s.n, k);
        one->last_pdf = g->pdf[k];
        one->goes_on = most > 0.0f;
    }
}

/* One side of a cloth that lets light through is looked at, by chance, and counts for both; true: the other side. */
static bool choose_side(const tsuya_tracer *t, const tsuya_walker *w, float *kept, const tsuya_shader *shader, int depth)
{
    const double *share = shader->transmittance;
    if (!(share[0] > 0.0 || share[1] > 0.0 || share[2] > 0.0)) {
        return false;
    }
    double u[2], most = fmax(share[0], fmax(share[1], share[2])), q = most / (most + 0.5);
    tsuya_sampler_pair((tsuya_sampler){w->key, w->sample}, pair_of(depth, PAIR_SIDE), u);
    for (int c = 0; c < channels_of(t); ++c) {
        kept[c] /= (float)(u[0] < q ? q : 1.0 - q);
    }
    return u[0] < q;
}

/* Paths that carry little go on rarely, and then for more.  By the root: where a dark body sends light into a narrow lobe that sees a
 * lamp, the few that go on carry most of the noise, and rays are cheap beside it. */
static bool survives(const tsuya_tracer *t, const tsuya_walker *w, float *kept, int depth)
{
    double u[2];
    float most = 0.0f;
    for (int c = 0; c < channels_of(t); ++c) {
        most = kept[c] > most ? kept[c] : most;
    }
    float keep = most < 0.0025f ? 0.05f : most < 1.0f ? sqrtf(most) : 1.0f;
    for (int c = 0; c < channels_of(t); ++c) {
        kept[c] /= keep;
    }
    tsuya_sampler_pair((tsuya_sampler){w->key, w->sample}, pair_of(depth, PAIR_TURN), u);
    return u[1] < (double)keep;
}

/* The group's paths at the points that their rays met: a lamp's sample, and the next ray. */
static void shade_group(const tsuya_tracer *t, tsuya_wave *w, tsuya_wave_group *g, bool turned)
{
    g->padded = tsuya_lanes_padded(g->count);
    for (int k = 0; k < g->padded; ++k) {
        const tsuya_walker *one = &w->walker[g->path[k < g->count ? k : 0]];
        g->hit[k] = one->hit;
        tsuya_set_lane(&g->back, k, (vec){-one->ray.direction[0], -one->ray.direction[1], -one->ray.direction[2]});
    }
    tsuya_scene_surfaces(t->scene, g->hit, g->count, &g->back, g->shader, &g->corners, &g->s);
    take_chances(g, w);
    if (t->options->card) {
        g->shader = t->options->card;
        g->s.dyed = false;
    }
    g->through = NULL;
    if (turned) {
        tsuya_group_turn_over(g);
    }
    turn_frames(g);
    tsuya_surfaces_to_local(&g->s, &g->back, &g->wo); /* under the surface for light that comes through, which does not ask for it */
    tsuya_group_look(g, t->scene);
    prepare_lamps(t, w, g);
    /* behind the last reflection only a lamp in the way can add something */
    if (g->depth + 1 < t->options->bounces || t->lamps.in_the_way) {
        scatter(t, w, g);
    }
}

/* The paths in `list` that have the shader and the side of the first one are shaded; returns how many are left in it. */
static int shade_alike(const tsuya_tracer *t, tsuya_wave *w, int *list, const tsuya_shader **shader, bool *turned, int count)
{
    tsuya_wave_group *g = w->group;
    int left = 0;
    const bool side = turned[0];
    const tsuya_shader *own = g->shader = shader[0];
    g->count = 0;
    for (int k = 0; k < count; ++k) {
        if (g->count < TSUYA_LANES && shader[k] == own && turned[k] == side) {
            g->path[g->count++] = list[k];
        } else {
            list[left] = list[k];
            shader[left] = shader[k];
            turned[left++] = turned[k];
        }
    }
    shade_group(t, w, g, side);
    return left;
}

/* Shades every living path that met the cloth. */
static void shade_all(const tsuya_tracer *t, tsuya_wave *w, int depth)
{
    const tsuya_shader *shader[TSUYA_WAVE];
    bool turned[TSUYA_WAVE];
    int list[TSUYA_WAVE], count = 0;
    for (int k = 0; k < w->alive_count; ++k) {
        tsuya_walker *one = &w->walker[w->alive[k]];
        float *kept = w->throughput + w->alive[k] * channels_of(t);
        one->lit = one->goes_on = false;
        /* at the hit, so that lamps met on the way have been counted; the first reflection always goes on */
        if (one->struck && (depth < 2 || survives(t, one, kept, depth))) {
            tsuya_scene_prefetch_vertices(t->scene, &one->hit);
            shader[count] = tsuya_scene_shader_at(t->scene, &one->hit);
            turned[count] = choose_side(t, one, kept, t->options->card ? t->options->card : shader[count], depth);
            list[count++] = w->alive[k];
        }
    }
    w->group->depth = depth;
    while (count > 0) {
        count = shade_alike(t, w, list, shader, turned, count);
    }
}

static void start_all(const tsuya_tracer *t, tsuya_wave *w)
{
    w->alive_count = 0;
    for (int k = 0; k < w->count; ++k) {
        tsuya_walker *one = &w->walker[k];
        one->rgb[0] = one->rgb[1] = one->rgb[2] = 0.0f;
        one->struck = false;
        w->alive[w->alive_count] = k;
        w->alive_count += !one->blank;
        for (int c = 0; c < channels_of(t); ++c) {
            w->throughput[k * channels_of(t) + c] = 1.0f;
        }
    }
}

/* Walkers without a next ray leave. */
static void go_on(tsuya_wave *w)
{
    int left = 0;
    for (int k = 0; k < w->alive_count; ++k) {
        w->alive[left] = w->alive[k];
        left += w->walker[w->alive[k]].goes_on;
    }
    w->alive_count = left;
}

uint64_t tsuya_trace(const tsuya_tracer *t, tsuya_wave *w)
{
    uint64_t rays = 0;
    start_all(t, w);
    for (int depth = 0; w->alive_count > 0; ++depth) {
        rays += (uint64_t)w->alive_count;
        intersect_all(t, w, depth == 0);
        for (int k = 0; k < w->count && depth == 0; ++k) {
            w->walker[k].met = w->walker[k].struck;
        }
        if (t->lamps.in_the_way) {
            add_lamps_met(t, w, depth == 0);
        }
        if (depth == t->options->bounces) {
            break;
        }
        shade_all(t, w, depth);
        rays += (uint64_t)occlude_all(t, w, depth == 0);
        go_on(w);
    }
    return rays;
}
