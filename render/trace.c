#include "render/trace.h"

#include "brdf/sampling.h"

#include "core/color.h"
#include "core/memory.h"

#include <assert.h>
#include <math.h>

/* Lamps whose weights are kept while one is chosen; of more, they are worked out twice. */
enum { LAMPS_AT_ONCE = 32 };

/* Dimension pairs of a bounce. */
enum { PAIR_LAMP, PAIR_DIRECTION, PAIR_CHOICE, PAIR_TURN, PAIR_SIDE, PAIRS_PER_BOUNCE };

/* The last point of a path, as the next hit of a lamp needs it. */
typedef struct vertex {
    tsuya_vec3 p, n;
    double pdf;          /* of the direction that left it */
    double lamp_weights; /* sum of tsuya_light_weight there */
} vertex;

/* A path on its way. */
typedef struct walker {
    tsuya_camera_path *path;
    tsuya_vec3 origin, direction;
    double *throughput; /* of each channel */
    vertex last;
    tsuya_ray ray, shadow;
    tsuya_ray_hit hit;
    bool met, alive, lit; /* lit: a shadow ray decides about `lamp` */
    double lamp[3];
} walker;

void tsuya_tracer_free(tsuya_tracer *t)
{
    for (int k = 0; t->response && k < t->lights->count; ++k) {
        tsuya_free(t->response[k]);
    }
    tsuya_free(t->response);
    t->response = NULL;
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
    if (status != TSUYA_OK) {
        tsuya_tracer_free(t);
    }
    return status;
}

tsuya_status tsuya_tracer_create(tsuya_tracer *t, const tsuya_scene *scene, const tsuya_light_set *lights, const tsuya_path_options *options)
{
    *t = (tsuya_tracer){.scene = scene, .lights = lights, .options = options, .bands = tsuya_scene_bands(scene)};
    for (int k = 0; k < lights->count; ++k) {
        tsuya_light_kind kind = lights->light[k].kind;
        t->lamps_in_the_way |= kind == TSUYA_LIGHT_DISK || kind == TSUYA_LIGHT_RECT || kind == TSUYA_LIGHT_ENVIRONMENT;
    }
    return t->bands ? respond(t) : TSUYA_OK;
}

static int channels_of(const tsuya_tracer *t) { return t->bands ? t->bands->count : 3; }

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

/* value[c] *= factor[c] · scale */
static void attenuate(const tsuya_tracer *t, double *value, const double *factor, double scale)
{
    if (!t->bands) {
        for (int c = 0; c < 3; ++c) {
            value[c] *= factor[c] * scale;
        }
        return;
    }
    for (int c = 0; c < t->bands->count; ++c) {
        value[c] *= factor[c] * scale;
    }
}

static tsuya_vec3 to_local(const tsuya_surface *s, tsuya_vec3 w)
{
    return (tsuya_vec3){tsuya_vec3_dot(w, s->x), tsuya_vec3_dot(w, s->y), tsuya_vec3_dot(w, s->n)};
}

static tsuya_vec3 to_world(const tsuya_surface *s, tsuya_vec3 w)
{
    return tsuya_vec3_mad(tsuya_vec3_mad(tsuya_vec3_scale(s->x, w.x), w.y, s->y), w.z, s->n);
}

/* A surface seen from one side, with what its reflectance says about that alone. */
typedef struct look {
    const tsuya_surface *s;
    tsuya_vec3 wo; /* local */
    const tsuya_material_view *view; /* where the shader is a material */
    const tsuya_bands *spread; /* NULL: the shader's values are the path's channels; else colours, to be spread over these */
    double dye[TSUYA_MATERIAL_MAX_CHANNELS]; /* of a spectral shader on a surface with a colour of its own */
} look;

/* Numbers of a bounce, for all walkers at once. */
typedef struct chances {
    double lamp[2][TSUYA_SAMPLER_LANES], direction[2][TSUYA_SAMPLER_LANES], choice[2][TSUYA_SAMPLER_LANES], turn[2][TSUYA_SAMPLER_LANES];
} chances;

/* What lies under the surface part, in the shader's channels. */
static const double *dye_of(look *l, const tsuya_tracer *t)
{
    if (!l->s->shader->spectral || !l->s->dye) {
        return l->s->dye;
    }
    const double *one = tsuya_scene_dye_of_bands(t->scene);
    if (!one) {
        tsuya_bands_spread(l->dye, t->bands, l->s->dye);
    }
    return one ? one : l->dye;
}

static void look_at(look *l, const tsuya_tracer *t, const tsuya_surface *s, tsuya_vec3 wo)
{
    l->s = s;
    l->wo = wo;
    l->view = NULL;
    l->spread = s->shader->spectral ? NULL : t->bands;
}

/* f: as many values as a path has channels. */
static double eval_pdf(const look *l, tsuya_vec3 wi, double *f)
{
    const tsuya_shader *shader = l->s->shader;
    double pdf = shader->material ? tsuya_material_view_eval_pdf(l->view, wi, f) : shader->eval_pdf(shader->user, l->s->dye, wi, l->wo, f);
    if (l->spread) {
        const double rgb[3] = {f[0], f[1], f[2]};
        tsuya_bands_spread(f, l->spread, rgb);
    }
    return pdf;
}

static bool sample_direction(const look *l, const double u[3], tsuya_vec3 *wi)
{
    const tsuya_shader *shader = l->s->shader;
    return shader->material ? tsuya_material_view_sample(l->view, u, wi) : shader->sample(shader->user, l->s->dye, l->wo, u, wi);
}

static tsuya_ray make_ray(tsuya_vec3 origin, tsuya_vec3 direction, double far)
{
    return (tsuya_ray){{(float)origin.x, (float)origin.y, (float)origin.z},
                       {(float)direction.x, (float)direction.y, (float)direction.z},
                       0.0f,
                       far < 3e38 ? (float)far : INFINITY};
}

static void report_ray(const tsuya_tracer *t, const tsuya_ray *ray, bool shadow)
{
    if (t->options->ray_sink) {
        t->options->ray_sink(t->options->ray_user, ray, shadow);
    }
}

static double larger(double a, double b) { return a > b ? a : b; }

static double largest(const double rgb[3]) { return larger(rgb[0], larger(rgb[1], rgb[2])); }

static double largest_kept(const tsuya_tracer *t, const double *throughput)
{
    double most = 0.0;
    for (int c = 0; c < channels_of(t); ++c) {
        most = larger(most, throughput[c]);
    }
    return most;
}

static double power_heuristic(double a, double b)
{
    double r = b / a;
    return 1.0 / (1.0 + r * r);
}

/* Weight of a lamp sample against a direction sample, and the other way round, under the strategy. */
static double lamp_share(const tsuya_tracer *t, double pdf_lamp, double pdf_direction)
{
    return t->options->strategy == TSUYA_STRATEGY_MIS ? power_heuristic(pdf_lamp, pdf_direction) : 1.0;
}

static double direction_share(const tsuya_tracer *t, double pdf_direction, double pdf_lamp)
{
    return t->options->strategy == TSUYA_STRATEGY_MIS     ? power_heuristic(pdf_direction, pdf_lamp)
           : t->options->strategy == TSUYA_STRATEGY_LAMPS ? 0.0
                                                          : 1.0;
}

/* One lamp with a probability in proportion to its weight; −1 when none can shine here. */
static int choose_lamp(const tsuya_light_set *lights, const tsuya_surface *s, double u, double *probability, double *sum)
{
    double weight[LAMPS_AT_ONCE], total = 0.0, before = 0.0;
    const bool kept = lights->count <= LAMPS_AT_ONCE;
    for (int k = 0; k < lights->count; ++k) {
        double w = tsuya_light_weight(&lights->light[k], s->p, s->n);
        total += w;
        if (kept) {
            weight[k] = w;
        }
    }
    int chosen = -1;
    double chosen_weight = 0.0;
    for (int k = 0; k < lights->count && before <= u * total; ++k) {
        double w = kept ? weight[k] : tsuya_light_weight(&lights->light[k], s->p, s->n);
        if (w > 0.0) {
            chosen = k;
            chosen_weight = w;
        }
        before += w;
    }
    *sum = total;
    *probability = total > 0.0 ? chosen_weight / total : 0.0;
    return chosen;
}

/* The ray that decides whether a lamp's sample is seen; false when it is not without one. */
static bool shadow_ray(const tsuya_tracer *t, const tsuya_surface *s, const tsuya_light_sample *sample, tsuya_ray *ray)
{
    tsuya_vec3 origin, direction = sample->wi;
    if (!tsuya_surface_ray_origin(t->scene, s, sample->wi, &origin)) {
        return false;
    }
    double far = INFINITY;
    if (isfinite(sample->distance_m)) {
        tsuya_vec3 d = tsuya_vec3_sub(tsuya_vec3_mad(s->p, sample->distance_m, sample->wi), origin);
        far = tsuya_vec3_norm(d) * (1.0 - 1e-5);
        direction = tsuya_vec3_unit(d);
    }
    *ray = make_ray(origin, direction, far);
    return true;
}

/* Light from one lamp, chosen and sampled: w->lamp, if w->shadow is free. */
static void prepare_lamp(const tsuya_tracer *t, walker *w, const look *l, const double u[2], double choice)
{
    const tsuya_surface *s = l->s;
    double probability, f[TSUYA_MATERIAL_MAX_CHANNELS];
    int k = choose_lamp(t->lights, s, choice, &probability, &w->last.lamp_weights);
    tsuya_light_sample sample;
    if (k < 0 || t->options->strategy == TSUYA_STRATEGY_BSDF) {
        return;
    }
    const tsuya_light *light = &t->lights->light[k];
    if (!tsuya_light_sample_at(light, s->p, s->n, u, &sample)) {
        return;
    }
    tsuya_vec3 wi = to_local(s, sample.wi);
    if (!(wi.z > 0.0)) {
        return;
    }
    double pdf_direction = eval_pdf(l, wi, f);
    double pdf_lamp = sample.pdf * probability;
    double scale = wi.z / pdf_lamp * (sample.delta ? 1.0 : lamp_share(t, pdf_lamp, pdf_direction));
    attenuate(t, f, w->throughput, 1.0);
    w->lamp[0] = w->lamp[1] = w->lamp[2] = 0.0;
    receive(t, k, sample.rgb, f, scale, w->lamp);
    w->lit = largest(w->lamp) > 0.0 && shadow_ray(t, s, &sample, &w->shadow);
}

/* Lamps that the ray runs into before it meets the cloth; first: seen by the camera itself. */
static void add_lamps_hit(const tsuya_tracer *t, walker *w, bool first)
{
    double distance = w->met ? w->hit.distance : INFINITY;
    tsuya_vec3 from = first ? w->origin : w->last.p, n = first ? w->direction : w->last.n;
    for (int k = 0; k < t->lights->count; ++k) {
        const tsuya_light *light = &t->lights->light[k];
        double lamp_distance, emitted[3], pdf, share = 1.0;
        bool skipped = light->kind == TSUYA_LIGHT_ENVIRONMENT ? w->met : first && !t->options->lamps_visible;
        if (skipped || !tsuya_light_hit(light, from, n, w->direction, &lamp_distance, emitted, &pdf)) {
            continue;
        }
        if (lamp_distance > distance) {
            continue;
        }
        if (!first) {
            double weight = tsuya_light_weight(light, w->last.p, w->last.n), sum = w->last.lamp_weights;
            share = direction_share(t, w->last.pdf, sum > 0.0 ? pdf * weight / sum : 0.0);
        }
        receive(t, k, emitted, w->throughput, share, w->path->rgb);
    }
}

/* Draws the next direction; false when the path ends. */
static bool scatter(const tsuya_tracer *t, walker *w, const look *l, const double u[3])
{
    const tsuya_surface *s = l->s;
    tsuya_vec3 wi;
    double f[TSUYA_MATERIAL_MAX_CHANNELS];
    if (!sample_direction(l, u, &wi)) {
        return false;
    }
    double pdf = eval_pdf(l, wi, f);
    if (!(pdf > 0.0)) {
        return false;
    }
    attenuate(t, w->throughput, f, wi.z / pdf);
    w->direction = tsuya_vec3_unit(to_world(s, wi));
    w->last.p = s->p;
    w->last.n = s->n;
    w->last.pdf = pdf;
    return largest_kept(t, w->throughput) > 0.0 && tsuya_surface_ray_origin(t->scene, s, w->direction, &w->origin);
}

/* Where the weft is unknown: the frame turned by a uniform angle, which averages the reflectance over the azimuth. */
static void turn_frame(tsuya_surface *s, double u)
{
    double angle = 2.0 * M_PI * u, c = cos(angle), k = sin(angle);
    tsuya_vec3 x = s->x, y = s->y;
    s->x = tsuya_vec3_mad(tsuya_vec3_scale(x, c), k, y);
    s->y = tsuya_vec3_mad(tsuya_vec3_scale(y, c), -k, x);
}

/* Paths that carry little go on rarely, and then for more.  By the root: where a dark body sends light into a narrow lobe that sees a
 * lamp, the few that go on carry most of the noise, and rays are cheap beside it. */
static bool survives(const tsuya_tracer *t, double *throughput, double u)
{
    double most = largest_kept(t, throughput), keep = most < 0.0025 ? 0.05 : most < 1.0 ? sqrt(most) : 1.0;
    for (int c = 0; c < channels_of(t); ++c) {
        throughput[c] /= keep;
    }
    return u < keep;
}

/* --- thin cloth: what falls on its other side comes through as from a Lambert surface --- */

static double through_eval_pdf(const void *user, const double *dye, tsuya_vec3 wi, tsuya_vec3 wo, double value[3])
{
    (void)user, (void)wo;
    for (int c = 0; c < 3; ++c) {
        value[c] = wi.z > 0.0 ? dye[c] / M_PI : 0.0;
    }
    return wi.z > 0.0 ? wi.z / M_PI : 0.0;
}

static bool through_sample(const void *user, const double *dye, tsuya_vec3 wo, const double u[3], tsuya_vec3 *wi)
{
    (void)user, (void)dye, (void)wo;
    *wi = tsuya_sample_cosine(u[0], u[1]);
    return wi->z > 0.0;
}

static const tsuya_shader through = {.eval_pdf = through_eval_pdf, .sample = through_sample};

/* One side of a cloth that lets light through is looked at, by chance, and counts for both. */
static void choose_side(const tsuya_tracer *t, walker *w, tsuya_surface *s, double most, uint32_t pair)
{
    double u[2], q = most / (most + 0.5);
    tsuya_sampler_pair(w->path->sampler, pair + PAIR_SIDE, u);
    for (int c = 0; c < channels_of(t); ++c) {
        w->throughput[c] /= u[0] < q ? q : 1.0 - q;
    }
    if (u[0] >= q) {
        return;
    }
    s->n = tsuya_vec3_scale(s->n, -1.0);
    s->ng = tsuya_vec3_scale(s->ng, -1.0);
    s->y = tsuya_vec3_scale(s->y, -1.0);
    s->flat = true;
    s->dye = s->shader->transmittance;
    s->shader = &through;
}

/* A lamp's sample, and the next ray. */
static void interact(const tsuya_tracer *t, walker *w, const look *l, int depth, const chances *chance, int lane)
{
    const bool spread = t->lamps_in_the_way; /* else every lamp is a point */
    const double lamp[2] = {spread ? chance->lamp[0][lane] : 0.5, spread ? chance->lamp[1][lane] : 0.5};
    const double u[3] = {chance->direction[0][lane], chance->direction[1][lane], chance->choice[1][lane]};
    prepare_lamp(t, w, l, lamp, chance->choice[0][lane]);
    /* behind the last reflection only a lamp in the way can add something */
    w->alive = (depth + 1 < t->options->bounces || t->lamps_in_the_way) && scatter(t, w, l, u);
}

/* At the point that the ray met. */
static void shade(const tsuya_tracer *t, walker *w, int depth, const chances *chance, int lane)
{
    uint32_t pair = (uint32_t)(TSUYA_PAIR_FIRST + PAIRS_PER_BOUNCE * depth);
    double turn[2] = {depth > 0 ? chance->turn[0][lane] : 0.0, depth > 0 ? chance->turn[1][lane] : 0.0};
    tsuya_surface s;
    tsuya_vec3 back = tsuya_vec3_scale(w->direction, -1.0);
    tsuya_scene_surface(t->scene, &w->hit, back, &s);
    if (t->options->card) {
        s.shader = t->options->card;
        s.dye = NULL;
    }
    if (!s.has_weft && depth == 0) {
        tsuya_sampler_pair(w->path->sampler, pair + PAIR_TURN, turn);
    }
    /* at the hit, so that lamps met on the way have been counted; the first reflection always goes on */
    if (depth > 1 && !survives(t, w->throughput, turn[1])) {
        w->alive = false;
        return;
    }
    double most = largest(s.shader->transmittance);
    if (most > 0.0) {
        choose_side(t, w, &s, most, pair);
    }
    if (!s.has_weft) {
        turn_frame(&s, turn[0]);
    }
    look l;
    look_at(&l, t, &s, to_local(&s, back)); /* under the surface for light that comes through, which does not ask for it */
    if (!s.shader->material) {
        interact(t, w, &l, depth, chance, lane);
        return;
    }
    const tsuya_material_view view = tsuya_material_view_of(s.shader->material, dye_of(&l, t), l.wo); /* large: made in its place */
    l.view = &view;
    interact(t, w, &l, depth, chance, lane);
}

/* Every walker's ray: met, hit. */
static void intersect_all(const tsuya_tracer *t, walker *w, int count, bool bundle)
{
    tsuya_ray ray[TSUYA_RAY_PACKET];
    tsuya_ray_hit hit[TSUYA_RAY_PACKET];
    bool met[TSUYA_RAY_PACKET];
    for (int k = 0; k < count; ++k) {
        ray[k] = w[k].ray = make_ray(w[k].origin, w[k].direction, INFINITY);
        report_ray(t, &ray[k], false);
    }
    if (bundle && count > 2 && !t->options->single_rays) {
        tsuya_scene_intersect_packet(t->scene, ray, count, hit, met);
    } else {
        for (int k = 0; k < count; ++k) {
            met[k] = tsuya_scene_intersect(t->scene, &ray[k], &hit[k]);
        }
    }
    tsuya_scene_prefetch(t->scene, hit, met, count);
    for (int k = 0; k < count; ++k) {
        w[k].met = met[k];
        w[k].hit = hit[k];
    }
}

/* Adds the lamps that are seen. Returns the number of shadow rays. */
static int occlude_all(const tsuya_tracer *t, walker *w, int count, bool bundle)
{
    tsuya_ray ray[TSUYA_RAY_PACKET];
    bool hidden[TSUYA_RAY_PACKET];
    int who[TSUYA_RAY_PACKET], rays = 0;
    for (int k = 0; k < count; ++k) {
        if (w[k].lit) {
            who[rays] = k;
            ray[rays++] = w[k].shadow;
            report_ray(t, &w[k].shadow, true);
        }
    }
    if (bundle && rays > 2 && !t->options->single_rays) {
        tsuya_scene_occluded_packet(t->scene, ray, rays, hidden);
    } else {
        for (int k = 0; k < rays; ++k) {
            hidden[k] = tsuya_scene_occluded(t->scene, &ray[k]);
        }
    }
    for (int k = 0; k < rays; ++k) {
        for (int c = 0; c < 3 && !hidden[k]; ++c) {
            w[who[k]].path->rgb[c] += w[who[k]].lamp[c];
        }
    }
    return rays;
}

static_assert((int)TSUYA_RAY_PACKET <= (int)TSUYA_SAMPLER_LANES, "every walker of a packet has a lane");

static void take_chances(const tsuya_tracer *t, chances *chance, const walker *w, int count, int depth)
{
    uint32_t pair = (uint32_t)(TSUYA_PAIR_FIRST + PAIRS_PER_BOUNCE * depth), key[TSUYA_SAMPLER_LANES], sample[TSUYA_SAMPLER_LANES];
    for (int k = 0; k < TSUYA_SAMPLER_LANES; ++k) {
        const tsuya_sampler *s = &w[k < count ? k : 0].path->sampler;
        key[k] = s->key;
        sample[k] = s->sample;
    }
    tsuya_sampler_pairs(key, sample, pair + PAIR_CHOICE, chance->choice);
    tsuya_sampler_pairs(key, sample, pair + PAIR_DIRECTION, chance->direction);
    if (t->lamps_in_the_way) {
        tsuya_sampler_pairs(key, sample, pair + PAIR_LAMP, chance->lamp);
    }
    if (depth > 0) {
        tsuya_sampler_pairs(key, sample, pair + PAIR_TURN, chance->turn);
    }
}

static bool any_met(const walker *w, int count)
{
    bool any = false;
    for (int k = 0; k < count; ++k) {
        any |= w[k].met;
    }
    return any;
}

/* One step of every walker; how many go on (they are moved to the front). */
static int step(const tsuya_tracer *t, walker *w, int count, int depth, uint64_t *rays)
{
    int left = 0;
    chances chance;
    intersect_all(t, w, count, depth == 0);
    *rays += (uint64_t)count;
    if (depth < t->options->bounces && any_met(w, count)) {
        take_chances(t, &chance, w, count, depth);
    }
    for (int k = 0; k < count; ++k) {
        if (depth == 0) {
            w[k].path->met = w[k].met;
        }
        w[k].lit = w[k].alive = false;
        if (t->lamps_in_the_way) {
            add_lamps_hit(t, &w[k], depth == 0);
        }
        if (w[k].met && depth < t->options->bounces) {
            shade(t, &w[k], depth, &chance, k);
        }
    }
    *rays += (uint64_t)occlude_all(t, w, count, depth == 0);
    for (int k = 0; k < count; ++k) {
        if (w[k].alive && left++ < k) {
            w[left - 1] = w[k];
        }
    }
    return left;
}

uint64_t tsuya_trace(const tsuya_tracer *tracer, tsuya_camera_path *path, int count)
{
    walker w[TSUYA_RAY_PACKET];
    double throughput[TSUYA_RAY_PACKET * TSUYA_MATERIAL_MAX_CHANNELS];
    const int channels = channels_of(tracer);
    uint64_t rays = 0;
    for (int k = 0; k < count; ++k) {
        w[k].path = &path[k];
        w[k].origin = path[k].origin;
        w[k].direction = path[k].direction;
        w[k].throughput = throughput + k * channels;
        for (int c = 0; c < channels; ++c) {
            w[k].throughput[c] = 1.0;
        }
        path[k].rgb[0] = path[k].rgb[1] = path[k].rgb[2] = 0.0;
    }
    for (int depth = 0; count > 0 && depth <= tracer->options->bounces; ++depth) {
        count = step(tracer, w, count, depth, &rays);
    }
    return rays;
}
