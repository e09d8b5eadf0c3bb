#include "render/trace.h"

#include "render/group.h"

#include "core/clones.h"
#include "core/color.h"
#include "core/memory.h"

#include <math.h>
#include <string.h>

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
    const size_t planes = (size_t)channels_of(t) * TSUYA_WAVE, aligned = _Alignof(whole_wave);
    *wave = NULL;
    TSUYA_NEW(status, block, sizeof(whole_wave) + aligned);
    whole_wave *w = (whole_wave *)(block + (aligned - (uintptr_t)block % aligned) % aligned);
    w->wave.block = block;
    w->wave.group = &w->group;
    *wave = &w->wave;
    TSUYA_NEW(status, w->wave.throughput, planes);
    TSUYA_NEW(status, w->group.f, planes);
    TSUYA_NEW(status, w->group.dye, planes);
    TSUYA_NEW(status, w->group.rest, planes);
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

/* Adds what the picture gets of a lamp's light, `sent` as colour, when `kept` of each channel arrives. */
static void receive(const tsuya_tracer *t, int lamp, const double sent[3], const double *kept, double scale, double rgb[3])
{
    const tsuya_bands *b = t->bands;
    if (!b) {
        for (int c = 0; c < 3; ++c) {
            rgb[c] += kept[c] * sent[c] * scale;
        }
        return;
    }
    const double *own = t->response[lamp], level = tsuya_rgb_luminance(sent);
    for (int c = 0; c < 3; ++c) {
        rgb[c] += scale * (own ? level * dot(own + c * b->count, kept, b->count)
                               : sent[0] * dot(b->response[0][c], kept, b->count) + sent[1] * dot(b->response[1][c], kept, b->count) +
                                     sent[2] * dot(b->response[2][c], kept, b->count));
    }
}

/* The same for a lane's planes, `stride` apart. */
static void receive_lane(const tsuya_tracer *t, int lane, int lamp, const double sent[3], const float *kept, int stride, double scale,
                         float to[3][TSUYA_WAVE])
{
    double all[TSUYA_MATERIAL_MAX_CHANNELS], rgb[3] = {0, 0, 0};
    for (int c = 0; c < channels_of(t); ++c) {
        all[c] = kept[c * stride];
    }
    receive(t, lamp, sent, all, scale, rgb);
    for (int c = 0; c < 3; ++c) {
        to[c][lane] += (float)rgb[c];
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
    while (bundled && first + size < count && w->bundle[list[first + size]] == w->bundle[list[first]]) {
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

/* Every living lane's ray: struck, hit. */
static void intersect_all(const tsuya_tracer *t, tsuya_wave *w, bool bundled)
{
    for (int k = 0, size; k < w->alive_count; k += size) {
        tsuya_ray ray[TSUYA_RAY_PACKET];
        tsuya_ray_hit hit[TSUYA_RAY_PACKET];
        bool struck[TSUYA_RAY_PACKET];
        size = packet_at(t, w, w->alive, k, w->alive_count, bundled);
        for (int i = 0; i < size; ++i) {
            ray[i] = make_ray(tsuya_lane(&w->origin, w->alive[k + i]), tsuya_lane(&w->direction, w->alive[k + i]), INFINITY);
        }
        report_rays(t, ray, size, false);
        if (size > 1) {
            tsuya_scene_intersect_packet(t->scene, ray, size, hit, struck);
        } else {
            struck[0] = tsuya_scene_intersect(t->scene, ray, hit);
        }
        tsuya_scene_prefetch_triangles(t->scene, hit, struck, size);
        for (int i = 0; i < size; ++i) {
            w->struck[w->alive[k + i]] = struck[i];
            w->hit[w->alive[k + i]] = hit[i];
        }
    }
}

/* Lanes that are marked, in order. */
static int list_marked(int list[TSUYA_WAVE], const bool *marked, int count)
{
    int found = 0;
    for (int k = 0; k < count; ++k) {
        list[found] = k;
        found += marked[k];
    }
    return found;
}

/* Adds the lamps that are seen. Returns the number of shadow rays. */
static int occlude_all(const tsuya_tracer *t, tsuya_wave *w, bool bundled)
{
    int list[TSUYA_WAVE], count = list_marked(list, w->lit, w->count);
    for (int k = 0, size; k < count; k += size) {
        tsuya_ray ray[TSUYA_RAY_PACKET];
        bool hidden[TSUYA_RAY_PACKET];
        size = packet_at(t, w, list, k, count, bundled);
        for (int i = 0; i < size; ++i) {
            ray[i] = w->shadow[list[k + i]];
        }
        report_rays(t, ray, size, true);
        if (size > 1) {
            tsuya_scene_occluded_packet(t->scene, ray, size, hidden);
        } else {
            hidden[0] = tsuya_scene_occluded(t->scene, ray);
        }
        for (int i = 0; i < size; ++i) {
            for (int c = 0; c < 3 && !hidden[i]; ++c) {
                w->rgb[c][list[k + i]] += w->lamp[c][list[k + i]];
            }
        }
    }
    return count;
}

/* --- strategies --- */

static float power_heuristic(float a, float b)
{
    float r = b / a;
    return 1.0f / (1.0f + r * r);
}

static float direction_share(const tsuya_tracer *t, float pdf_direction, float pdf_lamp)
{
    return t->options->strategy == TSUYA_STRATEGY_MIS     ? power_heuristic(pdf_direction, pdf_lamp)
           : t->options->strategy == TSUYA_STRATEGY_LAMPS ? 0.0f
                                                          : 1.0f;
}

/* Lamps that the living lanes' rays run into before they meet the cloth; first: seen by the camera itself. */
static void add_lamps_hit(const tsuya_tracer *t, tsuya_wave *w, bool first)
{
    tsuya_planes3 from, n, direction;
    tsuya_lamp_hits hits;
    const int count = w->alive_count, padded = tsuya_wave_padded(count);
    for (int k = 0; k < padded; ++k) {
        int lane = w->alive[k < count ? k : 0];
        tsuya_set_lane(&direction, k, tsuya_lane(&w->direction, lane));
        tsuya_set_lane(&from, k, tsuya_lane(first ? &w->origin : &w->last_p, lane));
        tsuya_set_lane(&n, k, tsuya_lane(first ? &w->direction : &w->last_n, lane));
    }
    for (int i = 0; i < t->lights->count; ++i) {
        const tsuya_light *light = &t->lights->light[i];
        bool sky = light->kind == TSUYA_LIGHT_ENVIRONMENT;
        if (!(sky || light->area_m2 > 0.0) || (first && !sky && !t->options->lamps_visible)) {
            continue;
        }
        tsuya_lamps_hit(&t->lamps, i, padded, &from, &n, &direction, &hits);
        for (int k = 0; k < count; ++k) {
            int lane = w->alive[k];
            if (!(hits.pdf[k] > 0.0f) || (w->struck[lane] && (sky || hits.distance[k] > w->hit[lane].distance))) {
                continue;
            }
            float share = 1.0f;
            double emitted[3];
            if (!first) {
                float weight = (float)tsuya_light_weight(light, tsuya_planes3_at(&from, k), tsuya_planes3_at(&n, k)), sum = w->lamp_weights[lane];
                share = direction_share(t, w->last_pdf[lane], sum > 0.0f ? hits.pdf[k] * weight / sum : 0.0f);
            }
            tsuya_light_radiance(light, tsuya_planes3_at(&direction, k), emitted);
            receive_lane(t, lane, i, emitted, w->throughput + lane, TSUYA_WAVE, share, w->rgb);
        }
    }
}

/* --- a group of lanes --- */

static void take_chances(tsuya_wave_group *g, const tsuya_wave *w)
{
    for (int k = 0; k < g->padded; ++k) {
        int lane = g->lane[k < g->count ? k : 0];
        g->key[k] = w->key[lane];
        g->sample[k] = w->sample[lane];
    }
    tsuya_sampler_pairs(g->key, g->sample, g->padded, pair_of(g->depth, PAIR_CHOICE), g->chance[0], g->chance[1]);
}

/* Where the weft is unknown: the frame turned by a uniform angle, which averages the reflectance over the azimuth. */
static void turn_frames(tsuya_wave_group *g, const tsuya_wave *w)
{
    for (int k = 0; k < g->count; ++k) {
        if (g->s.has_weft[k] > 0.0f) {
            continue;
        }
        double u[2];
        tsuya_sampler_pair((tsuya_sampler){w->key[g->lane[k]], w->sample[g->lane[k]]}, pair_of(g->depth, PAIR_TURN), u);
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

/* The ray that decides whether a lamp's sample is seen. */
static tsuya_ray shadow_ray(const tsuya_wave_group *g, int k)
{
    vec origin = tsuya_lane(&g->origin, k), direction = tsuya_lane(&g->world, k);
    float far = g->lamp.distance[k];
    if (far < INFINITY) { /* the way from the surface is that from the ray's origin and a little */
        vec d = tsuya_mad_f32(tsuya_sub_f32(tsuya_lane(&g->s.p, k), origin), far, direction);
        float length = sqrtf(tsuya_dot_f32(d, d));
        far = length * (1.0f - 1e-5f);
        direction = tsuya_scale_f32(d, length > 0.0f ? 1.0f / length : 0.0f);
    }
    return make_ray(origin, direction, far);
}

/* Light from one lamp a lane, chosen and sampled: w->lamp, w->shadow, w->lit. */
static void prepare_lamps(const tsuya_tracer *t, tsuya_wave *w, tsuya_wave_group *g)
{
    const int n = g->padded;
    tsuya_lamps_choose(&t->lamps, n, &g->s.p, &g->s.n, g->chance[0], &g->choice);
    for (int k = 0; k < g->count; ++k) {
        w->lamp_weights[g->lane[k]] = g->choice.sum[k];
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
    for (int k = 0; k < g->count; ++k) {
        int lane = g->lane[k];
        if (!(g->scale[k] > 0.0f && g->starts[k] > 0.0f)) {
            continue;
        }
        for (int c = 0; c < channels_of(t); ++c) {
            g->f[c * n + k] *= w->throughput[c * TSUYA_WAVE + lane];
        }
        const double sent[3] = {g->lamp.rgb[0][k], g->lamp.rgb[1][k], g->lamp.rgb[2][k]};
        w->lamp[0][lane] = w->lamp[1][lane] = w->lamp[2][lane] = 0.0f;
        receive_lane(t, lane, g->choice.lamp[k], sent, g->f + k, n, g->scale[k], w->lamp);
        if (w->lamp[0][lane] > 0.0f || w->lamp[1][lane] > 0.0f || w->lamp[2][lane] > 0.0f) {
            w->shadow[lane] = shadow_ray(g, k);
            w->lit[lane] = true;
        }
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
        int lane = g->lane[k];
        float most = 0.0f, scale = g->wi.z[k] / g->pdf[k];
        if (!(g->pdf[k] > 0.0f && g->wi.z[k] > 0.0f && g->starts[k] > 0.0f)) {
            continue;
        }
        for (int c = 0; c < channels_of(t); ++c) {
            float *kept = &w->throughput[c * TSUYA_WAVE + lane];
            *kept *= g->f[c * n + k] * scale;
            most = *kept > most ? *kept : most;
        }
        if (most > 0.0f) {
            tsuya_set_lane(&w->direction, lane, tsuya_lane(&g->world, k));
            tsuya_set_lane(&w->origin, lane, tsuya_lane(&g->origin, k));
            tsuya_set_lane(&w->last_p, lane, tsuya_lane(&g->s.p, k));
            tsuya_set_lane(&w->last_n, lane, tsuya_lane(&g->s.n, k));
            w->last_pdf[lane] = g->pdf[k];
            w->goes_on[lane] = true;
        }
    }
}

/* One side of a cloth that lets light through is looked at, by chance, and counts for both; true: the other side. */
static bool choose_side(const tsuya_tracer *t, tsuya_wave *w, int lane, const tsuya_shader *shader, int depth)
{
    const double *share = shader->transmittance;
    double u[2], most = fmax(share[0], fmax(share[1], share[2])), q = most / (most + 0.5);
    if (!(most > 0.0)) {
        return false;
    }
    tsuya_sampler_pair((tsuya_sampler){w->key[lane], w->sample[lane]}, pair_of(depth, PAIR_SIDE), u);
    for (int c = 0; c < channels_of(t); ++c) {
        w->throughput[c * TSUYA_WAVE + lane] /= (float)(u[0] < q ? q : 1.0 - q);
    }
    return u[0] < q;
}

/* Paths that carry little go on rarely, and then for more.  By the root: where a dark body sends light into a narrow lobe that sees a
 * lamp, the few that go on carry most of the noise, and rays are cheap beside it. */
static bool survives(const tsuya_tracer *t, tsuya_wave *w, int lane, int depth)
{
    double u[2];
    float most = 0.0f;
    for (int c = 0; c < channels_of(t); ++c) {
        most = fmaxf(most, w->throughput[c * TSUYA_WAVE + lane]);
    }
    float keep = most < 0.0025f ? 0.05f : most < 1.0f ? sqrtf(most) : 1.0f;
    for (int c = 0; c < channels_of(t); ++c) {
        w->throughput[c * TSUYA_WAVE + lane] /= keep;
    }
    tsuya_sampler_pair((tsuya_sampler){w->key[lane], w->sample[lane]}, pair_of(depth, PAIR_TURN), u);
    return u[1] < (double)keep;
}

/* The group's lanes at the points that their rays met: a lamp's sample, and the next ray. */
static void shade_group(const tsuya_tracer *t, tsuya_wave *w, tsuya_wave_group *g, bool turned)
{
    g->padded = tsuya_wave_padded(g->count);
    for (int k = 0; k < g->padded; ++k) {
        tsuya_set_lane(&g->back, k, tsuya_scale_f32(tsuya_lane(&w->direction, g->lane[k < g->count ? k : 0]), -1.0f));
    }
    tsuya_scene_surfaces(t->scene, w->hit, g->lane, g->count, &g->back, g->shader, &g->corners, &g->s);
    if (t->options->card) {
        g->shader = t->options->card;
        g->s.dyed = false;
    }
    g->through = NULL;
    if (turned) {
        tsuya_group_turn_over(g);
    }
    turn_frames(g, w);
    tsuya_surfaces_to_local(&g->s, &g->back, &g->wo); /* under the surface for light that comes through, which does not ask for it */
    take_chances(g, w);
    tsuya_group_look(g, t->scene);
    prepare_lamps(t, w, g);
    /* behind the last reflection only a lamp in the way can add something */
    if (g->depth + 1 < t->options->bounces || t->lamps.in_the_way) {
        scatter(t, w, g);
    }
}

/* Shades every living lane that met the cloth, those of one shader and side together. */
static void shade_all(const tsuya_tracer *t, tsuya_wave *w, int depth)
{
    const tsuya_shader *shader[TSUYA_WAVE];
    bool turned[TSUYA_WAVE];
    int list[TSUYA_WAVE], count = 0;
    for (int k = 0; k < w->alive_count; ++k) {
        int lane = w->alive[k];
        /* at the hit, so that lamps met on the way have been counted; the first reflection always goes on */
        if (w->struck[lane] && (depth < 2 || survives(t, w, lane, depth))) {
            const tsuya_shader *own = tsuya_scene_shader_at(t->scene, &w->hit[lane]);
            turned[count] = choose_side(t, w, lane, t->options->card ? t->options->card : own, depth);
            shader[count] = own;
            list[count++] = lane;
        }
    }
    for (int first = 0; first < count; ++first) {
        tsuya_wave_group *g = w->group;
        if (!shader[first]) {
            continue;
        }
        g->shader = shader[first];
        g->depth = depth;
        g->count = 0;
        for (int k = first; k < count; ++k) {
            if (shader[k] == g->shader && turned[k] == turned[first]) {
                g->lane[g->count++] = list[k];
                shader[k] = NULL;
            }
        }
        shade_group(t, w, g, turned[first]);
    }
}

uint64_t tsuya_trace(const tsuya_tracer *t, tsuya_wave *w)
{
    uint64_t rays = 0;
    memset(w->rgb, 0, sizeof w->rgb);
    for (int k = 0; k < w->count; ++k) {
        w->alive[k] = k;
        for (int c = 0; c < channels_of(t); ++c) {
            w->throughput[c * TSUYA_WAVE + k] = 1.0f;
        }
    }
    w->alive_count = w->count;
    for (int depth = 0; w->alive_count > 0 && depth <= t->options->bounces; ++depth) {
        rays += (uint64_t)w->alive_count;
        intersect_all(t, w, depth == 0);
        if (depth == 0) {
            memcpy(w->met, w->struck, sizeof w->met);
        }
        if (t->lamps.in_the_way) {
            add_lamps_hit(t, w, depth == 0);
        }
        if (depth == t->options->bounces) {
            break;
        }
        memset(w->lit, 0, sizeof w->lit);
        memset(w->goes_on, 0, sizeof w->goes_on);
        tsuya_scene_prefetch_vertices(t->scene, w->hit, w->struck, w->alive, w->alive_count);
        shade_all(t, w, depth);
        rays += (uint64_t)occlude_all(t, w, depth == 0);
        w->alive_count = list_marked(w->alive, w->goes_on, w->count);
    }
    return rays;
}
