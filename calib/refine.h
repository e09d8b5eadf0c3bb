/* Corners of a tag to a few hundredths of a pixel, each with its own sigma.
 *
 * Along each of the tag's four edges the grey values of the raw pixels (nothing is resampled) follow
 *
 *     I(u, d) = (K(u) + (W(u) − K(u)) · (Φ + (1 − Φ) r(u, d)))^(1/γ),  Φ = Φ((f(u) − d) / s)
 *
 * with d the depth inside the tag, u ∈ [−1, 1] along the edge, W and K the light of white and black (linear in u: uneven light; where
 * the photograph tells it from noise, both with one parabola along u: soft shadows), s the blur (one per edge, as motion blurs one
 * direction), f a parabola (the lens' local curvature), r the white that the blur brings into the border from the neighbouring edges and
 * from the code's white cells (where cells are small beside the blur), and γ the camera's tone curve: 1 for linear files, about 2.2 for
 * sRGB.  A wrong γ moves every edge the same way, out of the tag or into it, by a third of a pixel at sRGB.  γ belongs to the camera and
 * is estimated over some of its photographs first.
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
    double blur_px[4];             /* of each edge, across it; NaN where it failed */
} tsuya_refined_tag;

/* The tone curve as some tags of a photograph show it.  Only its sharper edges count, since a blur that is no Gaussian
 * (motion) looks like a tone curve. */
typedef struct tsuya_refine_tone {
    double gamma, sigma; /* sigma infinite: nothing learnt */
    double blur_px;      /* of the sharper edges */
} tsuya_refine_tone;
TSUYA_API tsuya_refine_tone tsuya_refine_estimate_tone(const tsuya_image *grey, const tsuya_tag_sighting *sighting, int count, int cells,
                                                       int border_bits);
/* One γ for a camera: the weighted median of its photographs' (which are sorted on the way).  Where that is not told from 1, where
 * photographs disagree, or where it is above 2.8, as sharpening makes it: 1 or sRGB's about 2.2, which is nearer (the solve then finds
 * what is left: tsuya_solve.edge_bias). */
TSUYA_API double tsuya_refine_common_tone(tsuya_refine_tone *tone, int count);

typedef struct tsuya_refine_options {
    int cells, border_bits; /* the tag's edge in code cells; the border of them */
    double gamma, blur_px;  /* γ, and the blur to start from */
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
