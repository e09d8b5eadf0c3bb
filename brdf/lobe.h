/* One lobe of a few shape parameters with a strength per channel: what the baselines share. */
#ifndef TSUYA_BRDF_LOBE_H
#define TSUYA_BRDF_LOBE_H

#include "brdf/model.h"

typedef struct tsuya_lobe {
    double shape[2]; /* widths, or exponents, along weft and warp */
    int channels;
    double strength[]; /* per channel */
} tsuya_lobe;

/* JSON: KEY_WEFT, KEY_WARP in [low, high], "strength" in [0, 1]. */
TSUYA_MUST_CHECK tsuya_status tsuya_lobe_from_json(void **state, int channels, const tsuya_json *parameters, const char *key_weft,
                                                   const char *key_warp, double low, double high);
void tsuya_lobe_to_json(const void *state, int channels, tsuya_json *parameters, const char *key_weft, const char *key_warp);
size_t tsuya_lobe_bytes(const void *state);
TSUYA_MUST_CHECK tsuya_status tsuya_lobe_create(void **state, int channels, double weft, double warp, const double *strength);
/* value[c * count + k] = strength[c] · plane 0 */
void tsuya_lobe_scale_planes(const tsuya_lobe *lobe, int channels, int count, float *value);

/* wi that wo is reflected into by the facet h; false when it ends under the surface. */
static inline bool tsuya_lobe_reflect(tsuya_vec3 *wi, tsuya_vec3 wo, tsuya_vec3 h)
{
    double cosine = tsuya_vec3_dot(wo, h);
    *wi = tsuya_vec3_unit(tsuya_vec3_mad(tsuya_vec3_scale(wo, -1.0), 2.0 * cosine, h));
    return cosine > 0.0 && wi->z > 0.0;
}

#endif
