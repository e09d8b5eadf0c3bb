/* Which part of a yarn's light its fibres' surface reflects, and so follows Fresnel's term to other difference angles.
 *
 * A bench with lamp and camera standing still has one difference angle and tells nothing of it.  Two things are known all the same.  A
 * dielectric's surface has no colour (S. A. Shafer, "Using color to separate reflection components", Color Research and Application 10(4),
 * 1985): its part of a yarn is at most what the darkest channel has.  And of light from above, the surfaces of a cloth, whatever their
 * slopes, return Fη(0) in all and not more; where the values are a reflectance, that bounds the two yarns together. */
#include "brdf/sheen_fit.h"

enum { RINGS = 60, SPOKES = 240 };

/* Averaged over directions, silk, wool, cotton, flax and nylon have 1.54 to 1.56 (W. E. Morton, J. W. S. Hearle, Physical Properties of
 * Textile Fibres, on optical properties); the default silk (brdf/ggx.c) has the same.  The term is not trusted further beyond what was measured than one interval of
 * the surface over the difference angle: at grazing light other fibres stand in the way. */
static const double fibre_index = 1.55, trusted_beyond = M_PI / 12.0;

void tsuya_sheen_set_fresnel(tsuya_sheen *sheen, const tsuya_fit_data *data)
{
    double widest = 0.0;
    for (int k = 0; k < data->count; ++k) {
        widest = fmax(widest, data->angles[k].theta_d);
    }
    sheen->eta = fibre_index;
    sheen->lowest_cosine = cos(fmin(widest + trusted_beyond, 0.5 * M_PI));
    sheen->gloss[0] = sheen->gloss[1] = 0.0;
}

/* Albedo of both yarns at strength 1 for light from above. */
static void yarn_albedo(double albedo[2], const tsuya_sheen *s)
{
    const tsuya_vec3 above = {0, 0, 1};
    albedo[0] = albedo[1] = 0.0;
    for (int i = 0; i < RINGS; ++i) {
        for (int j = 0; j < SPOKES; ++j) {
            double theta = 0.5 * M_PI * (i + 0.5) / RINGS, phi = 2.0 * M_PI * (j + 0.5) / SPOKES, yarn[2];
            tsuya_half_angles a = tsuya_half_angles_of(above, (tsuya_vec3){sin(theta) * cos(phi), sin(theta) * sin(phi), cos(theta)});
            double part = a.falloff * cos(theta) * sin(theta) * (0.5 * M_PI / RINGS) * (2.0 * M_PI / SPOKES);
            tsuya_sheen_yarns(yarn, s, &a);
            albedo[0] += part * exp(yarn[0]);
            albedo[1] += part * exp(yarn[1]);
        }
    }
}

void tsuya_sheen_find_gloss(tsuya_sheen *s, const tsuya_fit_data *data)
{
    double albedo[2], seen = 0.0, most = pow((s->eta - 1.0) / (s->eta + 1.0), 2.0);
    yarn_albedo(albedo, s);
    for (int y = 0; y < 2; ++y) {
        s->gloss[y] = s->strength[y][0];
        for (int c = 1; c < s->channels; ++c) {
            s->gloss[y] = fmin(s->gloss[y], s->strength[y][c]);
        }
        seen += data->scale * s->gloss[y] * albedo[y];
    }
    double share = data->relative || !(seen > most) ? 1.0 : most / seen;
    s->gloss[0] *= share;
    s->gloss[1] *= share;
}
