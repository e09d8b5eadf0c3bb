/* Woven cloth after Irawan and Marschner: a second truth for tests and benches, which no fitted model and no microcylinder describes.
 *
 * P. Irawan, "Appearance of woven cloth", PhD thesis, Cornell 2008; P. Irawan, S. Marschner, "Specular reflection from woven cloth", ACM TOG
 * 31(1), 2012.  A yarn is a curved tube of radius a: its spine rises from −u_max to u_max along it and is a conic of shape κ; round it v runs
 * from side to side.  Fibres wind round it under the twist ψ (0: filament yarn).  A fibre reflects where it stands upright to the half
 * vector, so a segment reflects along one curve of its surface,
 *
 *     f_s = 1/(w l) ∫∫ δ(t·(wi + wo)) f_c A a (R + a cos v) du dv,
 *
 * with t the fibre's direction, R the spine's radius of curvature, f_c = α + von Mises(−wi·wo; β) and A Seeliger's attenuation.  As the
 * published programs do, f_s is taken as the BRDF itself, and scaled to a stated albedo. */
#ifndef TSUYA_CAPTURE_IRAWAN_H
#define TSUYA_CAPTURE_IRAWAN_H

#include "core/geometry.h"
#include "core/status.h"

typedef struct tsuya_irawan_yarn {
    double twist_deg, end_deg, kappa, width, length; /* ψ, u_max, κ; width and length of a visible segment */
    double uneven_deg;                               /* standard deviation of u_max over the cloth */
    double diffuse[3], specular[3];                  /* reflectance below, and of the fibres' reflection for light along the normal */
} tsuya_irawan_yarn;

typedef struct tsuya_irawan {
    tsuya_irawan_yarn warp, weft;
    double warp_share;                  /* of the face */
    double uniform, forward, smoothing; /* α, β; share of u_max over which a filament's highlight fades out */
    double scale;                       /* of f_s, so that `specular` is an albedo: tsuya_irawan_prepare */
} tsuya_irawan;

/* Reads the geometry of one cloth ("silk_charmeuse", …) of a table of published weaves, with grey colours, and prepares it; fails when file
 * or cloth is missing. */
TSUYA_MUST_CHECK tsuya_status tsuya_irawan_load(tsuya_irawan *cloth, const char *path, const char *name);
/* Fails where a number is out of the model's range: w sin u_max must stay below l, |ψ| below 80°, u_max within 1 … 85°. */
TSUYA_MUST_CHECK tsuya_status tsuya_irawan_prepare(tsuya_irawan *cloth, const char *name_for_messages);

/* BRDF in sr⁻¹, r g b; reciprocal; 0 under the surface. */
void tsuya_irawan_eval(const tsuya_irawan *cloth, tsuya_vec3 wi, tsuya_vec3 wo, double value[3]);

#endif
