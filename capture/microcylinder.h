/* Microcylinder cloth: a truth for tests and benches, independent of every fitted model.
 *
 * I. Sadeghi, O. Bisker, J. De Deken, H. W. Jensen, "A Practical Microcylinder Appearance Model for Cloth Rendering",
 * ACM TOG 32(2), 2013: two thread families, each a chain of cylinders along a tangent curve, with surface and volume
 * scattering, shadowing, masking and reweighting. */
#ifndef TSUYA_CAPTURE_MICROCYLINDER_H
#define TSUYA_CAPTURE_MICROCYLINDER_H

#include "core/geometry.h"
#include "core/status.h"

enum { TSUYA_MICROCYLINDER_KNOTS = 12 };

typedef struct tsuya_microcylinder_thread {
    double eta, albedo[3], isotropic;     /* isotropic: kd, the share of volume scattering without a lobe */
    double surface_deg, volume_deg, area; /* widths of the two lobes; share of the face that the family covers */
    int knot_count;                       /* tangent's offset from the cloth's plane at the knots, and arc lengths between */
    double offset_deg[TSUYA_MICROCYLINDER_KNOTS], length[TSUYA_MICROCYLINDER_KNOTS];
} tsuya_microcylinder_thread;

typedef struct tsuya_microcylinder {
    tsuya_microcylinder_thread warp, weft;
    double step_deg; /* of the midpoints along the tangent curves; 0: half a degree */
} tsuya_microcylinder;

/* Reads one cloth ("linen_plain", …) of a table of published fits; fails when the file or the cloth is missing. */
TSUYA_MUST_CHECK tsuya_status tsuya_microcylinder_load(tsuya_microcylinder *cloth, const char *path, const char *name);

/* BRDF in sr⁻¹, r g b; 0 under the surface.  As published it is not reciprocal. */
void tsuya_microcylinder_eval(const tsuya_microcylinder *cloth, tsuya_vec3 wi, tsuya_vec3 wo, double value[3]);
/* Both ways at once: back, with light and viewer exchanged. */
void tsuya_microcylinder_eval_ways(const tsuya_microcylinder *cloth, tsuya_vec3 wi, tsuya_vec3 wo, double value[3], double back[3]);
/* The geometric mean of both orders, which is. */
void tsuya_microcylinder_eval_reciprocal(const tsuya_microcylinder *cloth, tsuya_vec3 wi, tsuya_vec3 wo, double value[3]);

#endif
