/* Corners of a tag to a few hundredths of a pixel, each with its own sigma.
 *
 * Along each of the tag's four edges the grey values of the raw pixels (nothing is resampled) follow
 *
 *     I(u, d) = T(K(u) + (W(u) − K(u)) · ((1 + c) E(s) − c E(√(s² + 1 px²)))),  E(s) = Φ((f(u) − d) / s) (1 − r) + r
 *
 * with d the depth inside the tag, u ∈ [−1, 1] along the edge, W and K the light of white and black (linear in u: uneven light; where
 * the photograph tells it from noise, both with one parabola along u: soft shadows), s the blur (one per edge, as motion blurs one
 * direction), f a parabola (the lens' local curvature), r the white that the blur brings into the border from the neighbouring edges and
 * from the code's white cells (where cells are small beside the blur).
 *
 * Two numbers belong to the camera and are estimated over some of its photographs first.  The tone curve is
 * T(L) = (1 + a) L^(1/γ) − a with a = 0.055 (γ − 1) / 1.4: 1 for linear files, and at γ = 2.4 sRGB's own (IEC 61966-2-1, above its
 * straight foot).  A wrong γ moves every edge the same way, out of the tag or into it, by a third of a pixel at sRGB.  c is the amount of an
 * unsharp mask of 1 px, which is what cameras do to their photographs and, to a thousandth of the contrast, what the interpolation of a
 * colour filter's mosaic does (gradient-corrected: c = 0.5).  Without it, sharpening reads as a steeper tone curve, and edges of small tags
 * move farther than those of large ones.
 *
 * Least squares by Gauss–Newton.  Corners are the meeting points of neighbouring curves; their sigma follows from the fits'
 * covariances, scaled by the residuals.  Cost: some 40 µs a tag of 80 px on one core. */
#ifndef TSUYA_CALIB_REFINE_H
#define TSUYA_CALIB_REFINE_H

#include "calib/apriltag_adapter.h"
#include "core/geometry.h"
#include "core/image.h"

typedef enum tsuya_refine_reason {
    TSUYA_REFINE_FINE,
    TSUYA_REFINE_OUTSIDE,  /* too few pixels: the image's edge, or a tag that is too small */
    TSUYA_REFINE_CONTRAST, /* black and white hardly differ */
    TSUYA_REFINE_ASTRAY,   /* the edge is not where the tag was seen */
    TSUYA_REFINE_UNLIKE,   /* the pixels do not look like an edge: covered, shadowed, a reflection */
} tsuya_refine_reason;

typedef struct tsuya_refined_tag {
    tsuya_vec2 corner_px[4];
    tsuya_vec2 spread_px[4];       /* the corner's motion when its edges move outwards by one blur width each */
    double sigma_px[4];            /* of each coordinate; infinite where an edge of the corner failed */
    tsuya_refine_reason edge[4];   /* edge i runs from corner i to the next */
    double blur_px[4];             /* of each edge, across it, as steep as it is after sharpening; NaN where it failed */
} tsuya_refined_tag;

/* What a camera makes of an edge. */
typedef struct tsuya_edge_look {
    double gamma;          /* of the tone curve, 1: linear */
    double sharpening;     /* c, 0: none */
} tsuya_edge_look;

/* The same as some tags of a photograph show it.  Only its sharper edges count, since a blur that is no Gaussian (motion) looks like a
 * tone curve. */
typedef struct tsuya_refine_tone {
    double gamma, sigma; /* without sharpening; sigma infinite: nothing learnt */
    double blur_px;      /* of the sharper edges */
    double usual;        /* with it: γ is near 1 or near sRGB's 2.4 */
    double sharpening, sharpening_sigma; /* at that γ; infinite likewise */
} tsuya_refine_tone;
#define TSUYA_REFINE_TONE_UNKNOWN ((tsuya_refine_tone){.gamma = 1.0, .usual = 1.0, .sigma = INFINITY, .sharpening_sigma = INFINITY, .blur_px = 0.8})
TSUYA_API tsuya_refine_tone tsuya_refine_estimate_tone(const tsuya_image *grey, const tsuya_tag_sighting *sighting, int count, int cells,
                                                       int border_bits);
/* One look for a camera, of its photographs' (one or more, which are put in order on the way).  Where they agree on a sharpening: that,
 * 0.4 at most, and the usual γ beside it.  Else none, and γ their weighted median; where that is not told from 1, where photographs
 * disagree, or where it is above 3.1, as is no camera's curve: 1 or 2.4, which is nearer.  What is left the solve finds
 * (tsuya_solve.edge_bias). */
TSUYA_API tsuya_edge_look tsuya_refine_common_look(tsuya_refine_tone *tone, int count);

typedef struct tsuya_refine_options {
    int cells, border_bits; /* the tag's edge in code cells; the border of them */
    tsuya_edge_look look;
    double blur_px;         /* to start from */
} tsuya_refine_options;

typedef struct tsuya_refine_info {
    int edges, failed[TSUYA_REFINE_UNLIKE + 1];
} tsuya_refine_info;

/* grey: one channel, float. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_refine_tags(tsuya_refined_tag *refined, tsuya_refine_info *info, const tsuya_image *grey,
                                                          const tsuya_tag_sighting *sighting, int count,
                                                          const tsuya_refine_options *options);
TSUYA_API const char *tsuya_refine_reason_text(tsuya_refine_reason reason);

#endif
