#include "render/group.h"

#include "brdf/sampling.h"

/* What lies under the surface part, as planes; NULL: the material's own. */
static const float *dye_of(tsuya_wave_group *g, const tsuya_scene *scene)
{
    const int n = g->padded;
    const tsuya_bands *bands = tsuya_scene_bands(scene);
    if (!g->s.dyed || !g->shader->spectral) {
        return g->s.dyed ? g->s.dye : NULL;
    }
    const double *one = tsuya_scene_dye_of_bands(scene);
    double spread[TSUYA_MATERIAL_MAX_CHANNELS];
    for (int k = 0; k < n; ++k) {
        if (!one) {
            tsuya_bands_spread(spread, bands, (const double[3]){g->s.dye[k], g->s.dye[n + k], g->s.dye[2 * n + k]});
        }
        for (int c = 0; c < bands->count; ++c) {
            g->dye[c * n + k] = (float)(one ? one : spread)[c];
        }
    }
    return g->dye;
}

void tsuya_group_look(tsuya_wave_group *g, const tsuya_scene *scene)
{
    g->spread = g->shader->spectral ? NULL : tsuya_scene_bands(scene);
    if (g->shader->material) {
        g->looks = (tsuya_material_looks){g->shader->material, g->padded, dye_of(g, scene), {g->wo.x, g->wo.y, g->wo.z}, g->share, g->rest};
        tsuya_material_look(&g->looks);
    }
}

static const double *lane_dye(const tsuya_wave_group *g, int k, double dye[3])
{
    for (int c = 0; c < 3 && g->s.dyed; ++c) {
        dye[c] = g->s.dye[c * g->padded + k];
    }
    return g->through ? g->through : g->s.dyed ? dye : NULL;
}

void tsuya_group_eval_pdf(tsuya_wave_group *g)
{
    const int n = g->padded;
    if (g->shader->material) {
        tsuya_material_looks_eval_pdf(&g->looks, (const float *const[3]){g->wi.x, g->wi.y, g->wi.z}, g->f, g->pdf);
    }
    for (int k = 0; k < n && !g->shader->material; ++k) {
        double dye[3], f[3];
        g->pdf[k] = (float)g->shader->eval_pdf(g->shader->user, lane_dye(g, k, dye), tsuya_planes3_at(&g->wi, k), tsuya_planes3_at(&g->wo, k), f);
        for (int c = 0; c < 3; ++c) {
            g->f[c * n + k] = (float)f[c];
        }
    }
    for (int k = 0; k < n && g->spread; ++k) {
        double all[TSUYA_MATERIAL_MAX_CHANNELS];
        tsuya_bands_spread(all, g->spread, (const double[3]){g->f[k], g->f[n + k], g->f[2 * n + k]});
        for (int c = 0; c < g->spread->count; ++c) {
            g->f[c * n + k] = (float)all[c];
        }
    }
}

void tsuya_group_sample(tsuya_wave_group *g)
{
    if (g->shader->material) {
        tsuya_material_looks_sample(&g->looks, (const float *const[3]){g->u[0], g->u[1], g->chance[1]}, (float *const[3]){g->wi.x, g->wi.y, g->wi.z});
        return;
    }
    for (int k = 0; k < g->padded; ++k) {
        double dye[3];
        const double u[3] = {g->u[0][k], g->u[1][k], g->chance[1][k]};
        tsuya_vec3 wi = {0, 0, 0};
        bool drawn = g->shader->sample(g->shader->user, lane_dye(g, k, dye), tsuya_planes3_at(&g->wo, k), u, &wi);
        tsuya_planes3_set(&g->wi, k, drawn ? wi : (tsuya_vec3){0, 0, 0});
    }
}

/* --- thin cloth --- */

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

void tsuya_group_turn_over(tsuya_wave_group *g)
{
    g->through = g->shader->transmittance;
    g->shader = &through;
    tsuya_surfaces_turn_over(&g->s);
}
