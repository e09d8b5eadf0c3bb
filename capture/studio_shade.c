/* Threads under the vertices' light.
 *
 * Macroscopic reflectance (microcylinders) is found once a pixel and lamp, over places on the lamp; each ray of the pixel then
 * takes its yarns' relief and brightness as a factor whose mean over the weave is 1, so that what a far camera sees is the
 * macroscopic reflectance itself.  A ray stands for a part of its pixel: where that is not small beside a yarn, four places in it. */
#include "capture/studio_light.h"

#include "render/frame.h"

#include <math.h>
#include <string.h>

enum { LAMP_SIDE = 2, PARTS = 4 };
static const double FINE = 0.1; /* of a yarn: one place is enough */
static const double SAME_NORMAL = 0.9986; /* cos 3° */

typedef struct place {
    const uint32_t *t;
    double w[3];
    tsuya_vec3 n, weft, warp; /* n on the side that is seen */
    bool back;
} place;

/* The yarn's own normal: tilted off the cloth's by its slopes across and along. */
static tsuya_vec3 yarn_normal(const place *at, const tsuya_studio_yarn *yarn)
{
    tsuya_vec3 along = yarn->is_weft ? at->weft : at->warp;
    tsuya_vec3 across = tsuya_vec3_tangent(yarn->is_weft ? at->warp : at->weft, along);
    return tsuya_vec3_unit(tsuya_vec3_mad(tsuya_vec3_mad(at->n, yarn->across, across), yarn->along, along));
}

static void eval(const tsuya_microcylinder *cloth, tsuya_vec3 wi, tsuya_vec3 wo, double *surface, double *volume)
{
    double one[3], other[3];
    tsuya_microcylinder_eval_ways(cloth, wi, wo, one, other);
    *surface = sqrt(fmax(one[1] * other[1], 0.0)); /* albedo 1, 0: the first channel holds both, the second the surface alone */
    *volume = sqrt(fmax((one[0] - one[1]) * (other[0] - other[1]), 0.0));
}

static tsuya_microcylinder split(const tsuya_microcylinder *cloth)
{
    tsuya_microcylinder c = *cloth;
    c.warp.albedo[0] = cloth->warp.albedo[0];
    c.weft.albedo[0] = cloth->weft.albedo[0];
    c.warp.albedo[1] = c.warp.albedo[2] = c.weft.albedo[1] = c.weft.albedo[2] = 0.0;
    return c;
}

void tsuya_studio_reflectance(const tsuya_microcylinder *cloth, const float dye[3], tsuya_vec3 wi, tsuya_vec3 wo, double rgb[3])
{
    tsuya_microcylinder both = split(cloth);
    double surface, volume;
    eval(&both, wi, wo, &surface, &volume);
    for (int c = 0; c < 3; c++) {
        rgb[c] = surface + volume * (double)dye[c];
    }
}

static const double FACING_LEAST = 0.05;

/* Even yarns of one weave, as the relief of the cloth sees them: their normals (x weft, y warp) and shades. */
enum { RELIEF_SIDE = 60 };
typedef struct relief_yarn { tsuya_vec3 n; double shade; } relief_yarn;

static void even_yarns(relief_yarn yarn[RELIEF_SIDE * RELIEF_SIDE], const tsuya_studio_weave *weave)
{
    tsuya_studio_weave even = *weave;
    even.unevenness = 0.0; /* its mean is 1, but not over a few yarns */
    for (int k = 0; k < RELIEF_SIDE * RELIEF_SIDE; k++) {
        double u = (k % RELIEF_SIDE + 0.5) / RELIEF_SIDE * 5.0 * even.warp_pitch_m, v = (k / RELIEF_SIDE + 0.5) / RELIEF_SIDE * 5.0 * even.weft_pitch_m;
        tsuya_studio_yarn y = tsuya_studio_weave_at(&even, u, v);
        double along = y.along, across = y.across;
        yarn[k] = (relief_yarn){tsuya_vec3_unit((tsuya_vec3){y.is_weft ? along : across, y.is_weft ? across : along, 1.0}), (double)y.shade};
    }
}

static void fill_relief(tsuya_studio *s, const relief_yarn *yarn)
{
    for (int k = 0; k < STUDIO_RELIEF_Z * STUDIO_RELIEF_PHI; k++) {
        double z = (k / STUDIO_RELIEF_PHI + 0.5) / STUDIO_RELIEF_Z, r = sqrt(1.0 - z * z), phi = 2.0 * M_PI * (k % STUDIO_RELIEF_PHI) / STUDIO_RELIEF_PHI, sum = 0.0;
        tsuya_vec3 wi = {r * cos(phi), r * sin(phi), z};
        for (int j = 0; j < RELIEF_SIDE * RELIEF_SIDE; j++) {
            sum += yarn[j].shade * fmax(0.0, tsuya_vec3_dot(yarn[j].n, wi));
        }
        s->relief[k / STUDIO_RELIEF_PHI][k % STUDIO_RELIEF_PHI] = (float)(sum / (RELIEF_SIDE * RELIEF_SIDE) / fmax(z, FACING_LEAST));
    }
}

/* Bilinear; wi in the cloth's frame. */
static double relief_at(const tsuya_studio *s, tsuya_vec3 wi)
{
    double a = fmin(fmax(wi.z * STUDIO_RELIEF_Z - 0.5, 0.0), STUDIO_RELIEF_Z - 1.001), b = atan2(wi.y, wi.x) / (2.0 * M_PI) * STUDIO_RELIEF_PHI;
    b += b < 0.0 ? STUDIO_RELIEF_PHI : 0.0;
    int i = (int)a, j = (int)b, next = (j + 1) % STUDIO_RELIEF_PHI;
    double u = a - i, v = b - j;
    j %= STUDIO_RELIEF_PHI;
    const float *low = s->relief[i], *high = s->relief[i + 1];
    return (1.0 - u) * ((1.0 - v) * (double)low[j] + v * (double)low[next]) + u * ((1.0 - v) * (double)high[j] + v * (double)high[next]);
}

void tsuya_studio_measure_gloss(tsuya_studio *s)
{
    enum { THETA = 8, PHI = 12 };
    s->split = split(s->gloss);
    relief_yarn yarn[RELIEF_SIDE * RELIEF_SIDE];
    double sum = 0.0, a, b;
    even_yarns(yarn, s->weave);
    for (int k = 0; k < RELIEF_SIDE * RELIEF_SIDE; k++) {
        sum += yarn[k].shade * yarn[k].n.z / (RELIEF_SIDE * RELIEF_SIDE);
    }
    s->weave_shade = sum;
    fill_relief(s, yarn);
    tsuya_vec3 wo = {0.0, 0.0, 1.0};
    for (int k = 0; k < THETA * PHI; k++) { /* density cosθ/π */
        double r = sqrt((k / PHI + 0.5) / THETA), phi = 2.0 * M_PI * (k % PHI + 0.5) / PHI;
        eval(&s->split, (tsuya_vec3){r * cos(phi), r * sin(phi), sqrt(1.0 - r * r)}, wo, &a, &b);
        s->reflected[0] += M_PI * a / (THETA * PHI);
        s->reflected[1] += M_PI * b / (THETA * PHI);
    }
}

/* Surface and volume radiance under each whole lamp, and its mean direction. */
static void fill_cache(studio_cache *cache, const tsuya_studio *s, const place *at, tsuya_vec3 p, tsuya_vec3 direction)
{
    tsuya_vec3 x = at->weft, y = tsuya_vec3_cross(at->n, x);
    tsuya_vec3 wo = {-tsuya_vec3_dot(direction, x), -tsuya_vec3_dot(direction, y), -tsuya_vec3_dot(direction, at->n)};
    *cache = (studio_cache){.filled = true, .n = at->n};
    for (int lamp = 0; lamp < s->lamp_count; lamp++) {
        int drawn = 0;
        tsuya_vec3 mean = {0, 0, 0};
        for (int k = 0; k < LAMP_SIDE * LAMP_SIDE; k++) {
            const double u[2] = {(k % LAMP_SIDE + 0.5) / LAMP_SIDE, (k / LAMP_SIDE + 0.5) / LAMP_SIDE};
            tsuya_light_sample sample;
            double surface, volume;
            drawn++;
            if (tsuya_light_sample_at(&s->lights->light[s->lamp[lamp]], p, at->n, u, &sample)) {
                tsuya_vec3 wi = {tsuya_vec3_dot(sample.wi, x), tsuya_vec3_dot(sample.wi, y), tsuya_vec3_dot(sample.wi, at->n)};
                double strength = fmax(wi.z, 0.0) / sample.pdf;
                mean = tsuya_vec3_mad(mean, strength, sample.wi);
                eval(&s->split, wi, wo, &surface, &volume);
                for (int j = 0; j < 3; j++) {
                    cache->surface[lamp][j] += surface * strength * sample.rgb[j];
                    cache->volume[lamp][j] += volume * strength * sample.rgb[j];
                }
                if (sample.delta) {
                    break;
                }
            }
        }
        cache->wi[lamp] = tsuya_vec3_unit(mean);
        for (int j = 0; j < 3; j++) {
            cache->surface[lamp][j] /= drawn;
            cache->volume[lamp][j] /= drawn;
        }
    }
}

static size_t slot_of(const tsuya_studio *s, const place *at, int k) { return at->t[k] + (at->back ? s->mesh.vertex_count : 0); }

/* Irradiance from everything but the lamps. */
static void around(const tsuya_studio *s, const place *at, double rgb[3])
{
    for (int c = 0; c < 3; c++) {
        rgb[c] = 0.0;
        for (int k = 0; k < 3; k++) {
            rgb[c] += at->w[k] * (double)s->ambient[3 * slot_of(s, at, k) + (size_t)c];
        }
    }
}

static void shade_matt(const tsuya_studio *s, const place *at, tsuya_vec3 n, const float albedo[3], double weight, double rgb[3])
{
    double share = 0.5 + 0.5 * tsuya_vec3_dot(n, at->n), irradiance[3];
    around(s, at, irradiance);
    for (int c = 0; c < 3; c++) {
        irradiance[c] *= share;
    }
    for (int lamp = 0; lamp < s->lamp_count; lamp++) {
        tsuya_vec3 arriving = {0, 0, 0};
        for (int k = 0; k < 3; k++) {
            tsuya_vec3f a = s->arriving[slot_of(s, at, k) * (size_t)s->lamp_count + (size_t)lamp];
            arriving = tsuya_vec3_mad(arriving, at->w[k], (tsuya_vec3){(double)a.x, (double)a.y, (double)a.z});
        }
        double facing = fmax(0.0, tsuya_vec3_dot(arriving, n));
        for (int c = 0; c < 3; c++) {
            irradiance[c] += facing * s->lights->light[s->lamp[lamp]].rgb[c];
        }
    }
    for (int c = 0; c < 3; c++) {
        rgb[c] += weight * (double)albedo[c] * irradiance[c] / M_PI;
    }
}

/* What all yarns under one ray share. */
typedef struct light_here {
    double around[3];                 /* irradiance from everything but the lamps */
    double lamp[TSUYA_STUDIO_LAMPS];  /* share that is seen, over the cloth's own cosine and the weave's mean relief */
} light_here;

static void light_at(light_here *here, const tsuya_studio *s, const place *at, const studio_cache *cache)
{
    tsuya_vec3 warp = tsuya_vec3_cross(at->n, at->weft);
    around(s, at, here->around);
    for (int lamp = 0; lamp < s->lamp_count; lamp++) {
        tsuya_vec3 to = cache->wi[lamp], wi = {tsuya_vec3_dot(to, at->weft), tsuya_vec3_dot(to, warp), tsuya_vec3_dot(to, at->n)};
        double visible = 0.0;
        for (int k = 0; k < 3; k++) {
            visible += at->w[k] * (double)s->visible[slot_of(s, at, k) * (size_t)s->lamp_count + (size_t)lamp];
        }
        here->lamp[lamp] = visible > 0.0 ? visible / (fmax(wi.z, FACING_LEAST) * relief_at(s, wi)) : 0.0;
    }
}

static void shade_gloss(const tsuya_studio *s, const place *at, const tsuya_studio_yarn *yarn, const studio_cache *cache, const light_here *here,
                        double weight, double rgb[3])
{
    tsuya_vec3 n = yarn_normal(at, yarn);
    double shade = weight * (double)yarn->shade, even = shade / s->weave_shade * tsuya_vec3_dot(n, at->n) / M_PI;
    for (int c = 0; c < 3; c++) {
        rgb[c] += even * here->around[c] * (s->reflected[0] + s->reflected[1] * (double)yarn->dye[c]);
    }
    for (int lamp = 0; lamp < s->lamp_count; lamp++) {
        double facing = tsuya_vec3_dot(n, cache->wi[lamp]), relief = shade * here->lamp[lamp] * (facing > 0.0 ? facing : 0.0);
        for (int c = 0; c < 3; c++) {
            rgb[c] += relief * (cache->surface[lamp][c] + cache->volume[lamp][c] * (double)yarn->dye[c]);
        }
    }
}

/* Material coordinates of a hit, and how they run across the ray: of two steps at right angles to it, `width_m` long. */
static void material_at(double uv[2], double step[2][2], const tsuya_studio *s, const place *at, tsuya_vec3 direction, double width_m)
{
    tsuya_vec3 side = tsuya_vec3_unit(tsuya_vec3_cross(direction, fabs(direction.z) < 0.9 ? (tsuya_vec3){0, 0, 1} : (tsuya_vec3){1, 0, 0}));
    const tsuya_vec3 across[2] = {side, tsuya_vec3_cross(direction, side)};
    double facing = fmin(tsuya_vec3_dot(direction, at->n), -0.1);
    for (int j = 0; j < 2; j++) {
        tsuya_vec3 on = tsuya_vec3_scale(tsuya_vec3_mad(across[j], -tsuya_vec3_dot(across[j], at->n) / facing, direction), width_m);
        step[j][0] = tsuya_vec3_dot(on, at->weft);
        step[j][1] = tsuya_vec3_dot(on, at->warp);
        uv[j] = 0.0;
        for (int k = 0; k < 3; k++) {
            uv[j] += at->w[k] * (double)s->cloth->uv[2 * at->t[k] + (size_t)j];
        }
    }
}

static void shade_yarn(const tsuya_studio *s, const place *at, double u, double v, const studio_cache *cache, const light_here *here, double weight,
                       double rgb[3])
{
    tsuya_studio_yarn yarn = tsuya_studio_weave_at(s->weave, u, v);
    if (s->gloss) {
        shade_gloss(s, at, &yarn, cache, here, weight, rgb);
    } else {
        shade_matt(s, at, yarn_normal(at, &yarn), yarn.albedo, weight, rgb);
    }
}

void tsuya_studio_shade(const tsuya_studio *s, const tsuya_ray_hit *hit, tsuya_vec3 p, tsuya_vec3 direction, const studio_beam *beam,
                        studio_cache *cache, double rgb[3])
{
    place at = {.t = s->mesh.triangle + 3 * (size_t)hit->triangle};
    tsuya_studio_weights(hit, at.w);
    at.n = tsuya_vec3_unit(tsuya_studio_interpolate(s->mesh.normal, at.t, at.w));
    at.back = tsuya_vec3_dot(at.n, direction) > 0.0;
    at.n = tsuya_vec3_scale(at.n, at.back ? -1.0 : 1.0);
    if (hit->triangle >= s->cloth_triangles) {
        float albedo[3];
        tsuya_studio_albedo(s, hit, beam, albedo);
        shade_matt(s, &at, at.n, albedo, 1.0, rgb);
        return;
    }
    at.weft = tsuya_vec3_tangent(tsuya_studio_interpolate(s->cloth->mesh.weft, at.t, at.w), at.n);
    at.warp = tsuya_vec3_tangent(tsuya_studio_interpolate(s->cloth->warp, at.t, at.w), at.n);
    light_here here;
    if (s->gloss) {
        if (!cache->filled || tsuya_vec3_dot(cache->n, at.n) < SAME_NORMAL) {
            fill_cache(cache, s, &at, p, direction);
        }
        light_at(&here, s, &at, cache);
    }
    const double width_m = (double)hit->distance * beam->width;
    double uv[2], step[2][2];
    material_at(uv, step, s, &at, direction, width_m);
    if (width_m < FINE * fmin(s->weave->weft_pitch_m, s->weave->warp_pitch_m)) {
        shade_yarn(s, &at, uv[0], uv[1], cache, &here, 1.0, rgb);
        return;
    }
    for (int k = 0; k < PARTS; k++) {
        double a = k % 2 ? 0.25 : -0.25, b = k / 2 ? 0.25 : -0.25;
        shade_yarn(s, &at, uv[0] + a * step[0][0] + b * step[1][0], uv[1] + a * step[0][1] + b * step[1][1], cache, &here, 1.0 / PARTS, rgb);
    }
}
