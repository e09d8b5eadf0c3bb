/* The paper's surface, literally (H. Tanaka, "3-D object modelling: anisotropic reflection modelling of cloth", section 4).
 *
 *   f = S(α + γu, γv) / cosθi
 *
 * with L the light, V the viewer, N the normal; α the azimuth of L from the weft; R the mirror direction of L; V′ the projection of
 * V into the incidence plane; γv the signed angle in that plane from R to V′, positive towards the surface; γu = asin(V·(L×N)/|L×N|)
 * the angle out of the plane.  S is a bicubic NURBS surface in polar form, S(u, −v) = S(u + π, v), that runs through the measured curves
 * (their intensity f·cosθi), one height per channel, all weights 1.  At L ∥ N, where α says nothing, the mean over u.
 *
 * S is neither reciprocal nor bounded in energy, and jumps where L passes N; nothing here hides it: tsuya_material_physics measures
 * both.  Below cosθi = 1e-6 the division stops. */
#ifndef TSUYA_BRDF_TANAKA_H
#define TSUYA_BRDF_TANAKA_H

#include "brdf/samples.h"
#include "brdf/sheen.h"

typedef struct tsuya_tanaka {
    int channels, line, nu, nv; /* v in [0, π] has nv intervals; the net as S of brdf/sheen.h with θ = v/2 */
    float *net;
    struct tsuya_half_table *half;
} tsuya_tanaka;

/* Place on S as angles of the net (φh = u, θh = |v|/2); false where α is undefined (then θh alone holds). */
bool tsuya_tanaka_place(tsuya_half_angles *place, tsuya_vec3 wi, tsuya_vec3 wo);
TSUYA_MUST_CHECK tsuya_status tsuya_tanaka_create(tsuya_tanaka **state, int channels, int nu, int nv);
void tsuya_tanaka_free(void *state);
TSUYA_MUST_CHECK tsuya_status tsuya_tanaka_prepare(tsuya_tanaka *state); /* after the net is filled */

/* Least squares of the intensities with the weights of cube roots, as little smoothing as holds S down where nothing was measured;
 * control values at least 0. */
TSUYA_MUST_CHECK tsuya_status tsuya_fit_tanaka(void **state, double *reciprocal_condition, const tsuya_samples *samples);

#endif
