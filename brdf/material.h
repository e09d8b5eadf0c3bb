/* Materials: how a cloth reflects, whatever model was fitted to it.
 *
 * Frame: x weft, y warp, z normal; wi (to the light) and wo (to the viewer) are unit and leave the surface.  Values are the
 * BRDF in sr⁻¹, without the cosine, one per channel, and 0 where either direction lies on or under the surface or is not finite.
 *
 * Every material is a surface part, which the model describes, with a dye under it (paper fig. 15: black satin measured, any
 * colour shown):
 *
 *     f = f_surface + dye · base(wi, wo)
 *
 * so the value is linear in the dye, and a caller may give another dye with every call (`dye`: channel_count numbers, or
 * NULL for the material's own).  See brdf/dye.h for `base`.  Functions that only evaluate cannot fail. */
#ifndef TSUYA_BRDF_MATERIAL_H
#define TSUYA_BRDF_MATERIAL_H

#include "core/geometry.h"
#include "core/json.h"

enum { TSUYA_MATERIAL_VERSION_MAJOR = 1, TSUYA_MATERIAL_VERSION_MINOR = 0, TSUYA_MATERIAL_MAX_CHANNELS = 256 };

typedef struct tsuya_material tsuya_material;

/* Angles that measured data supports, degrees, [low, high]; NaN where nothing is known. */
typedef struct tsuya_material_support {
    double theta_i_deg[2], theta_o_deg[2], theta_h_deg[2], theta_d_deg[2];
} tsuya_material_support;

typedef struct tsuya_material_info {
    const char *name, *note; /* note: "" where there is none */
    const char *model;
    bool is_default;         /* built in, measured on nothing */
    bool relative;           /* values known up to one common factor (radiance without irradiance) */
    int channel_count;
    const char *const *channel; /* "r" "g" "b", or "nm390" … */
    tsuya_material_support support;
    double heldout_cbrt, heldout_log; /* e_cbrt and e_log on held-out samples; NaN where nothing was measured */
    size_t bytes;            /* memory of everything that evaluation touches */
} tsuya_material_info;

/* JSON: {"format": "tsuya material", "version": "1.0", "name", "note", "default", "relative", "model", "channels",
 * "support": {"theta_i_deg": [..], …}, "error_heldout": {"cbrt", "log"}, "dye": {"reflectance": [..], "coupling":
 * "under_surface"|"lambert"}, "parameters": {…}}.  Fails, naming file and key, on a newer major version, an unknown model,
 * wrong or missing values. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_material_load(tsuya_material **material, const char *path);
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_material_parse(tsuya_material **material, const char *text,
                                                             const char *name_for_messages);
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_material_save(const tsuya_material *material, const char *path);
/* The document that save writes; fails when memory is short. tsuya_json_free. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_material_to_json(tsuya_json **root, const tsuya_material *material);
TSUYA_API void tsuya_material_free(tsuya_material *material); /* NULL is fine */

/* Strings are borrowed and live as long as the material. */
TSUYA_API tsuya_material_info tsuya_material_get_info(const tsuya_material *material);

/* A silk satin from the optical constants of silk and a plausible weave: anisotropic GGX, named and flagged as a default
 * that nobody measured. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_material_default_silk(tsuya_material **material);
/* Perfectly diffuse, `reflectance` in [0, 1] for r, g, b. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_material_lambert(tsuya_material **material, const double reflectance[3]);
/* Anisotropic GGX with plain parameters; see brdf/ggx.c. alpha in [1e-3, 1], strength in [0, 1], eta in [1.01, 4]. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_material_ggx(tsuya_material **material, double alpha_weft, double alpha_warp,
                                                           const double strength[3], double eta, const double dye[3]);

/* Replaces the dye by a diffuse reflectance in linear Rec.709, and lets it lie under the surface part.  Fails on values
 * outside [0, 1] and on materials whose channels are not r, g, b. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_material_set_dye(tsuya_material *material, const double rgb[3]);
/* The same for any channels: channel_count reflectances in [0, 1], or above 1 by rounding (1e-12). */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_material_set_channel_dye(tsuya_material *material, const double *dye);
/* The material's own dye, channel_count numbers, borrowed. */
TSUYA_API const double *tsuya_material_dye(const tsuya_material *material);

/* Writes channel_count values, sr⁻¹. */
TSUYA_API void tsuya_material_eval(const tsuya_material *material, const double *dye, tsuya_vec3 wi, tsuya_vec3 wo, double *value);
/* Density (sr⁻¹) with which tsuya_material_sample draws wi for this wo. Its integral over the hemisphere is below 1 by the
 * share of draws that end under the surface. */
TSUYA_API double tsuya_material_pdf(const tsuya_material *material, const double *dye, tsuya_vec3 wi, tsuya_vec3 wo);
/* Both at once, cheaper than apart. */
TSUYA_API double tsuya_material_eval_pdf(const tsuya_material *material, const double *dye, tsuya_vec3 wi, tsuya_vec3 wo,
                                         double *value);
/* Draws wi from three uniform numbers in [0, 1); false when the draw ended under the surface (it counts as a zero). */
TSUYA_API bool tsuya_material_sample(const tsuya_material *material, const double *dye, tsuya_vec3 wo, const double u[3],
                                     tsuya_vec3 *wi);
/* One viewer, many lights: what depends on wo alone, looked up once.  A value; `material` and `dye` must outlive it. */
typedef struct tsuya_material_view {
    const tsuya_material *material;
    const double *dye; /* never NULL */
    tsuya_vec3 wo;     /* under the surface: everything is 0 */
    double limit, dye_share;
    bool coloured;
    double rest[TSUYA_MATERIAL_MAX_CHANNELS]; /* what the surface part leaves to the dye; only channel_count of them are set */
} tsuya_material_view;
/* The functions above with (wi, wo) are these with a view that is thrown away, to the bit. */
TSUYA_API tsuya_material_view tsuya_material_view_of(const tsuya_material *material, const double *dye, tsuya_vec3 wo);
TSUYA_API void tsuya_material_view_eval(const tsuya_material_view *view, tsuya_vec3 wi, double *value);
TSUYA_API double tsuya_material_view_pdf(const tsuya_material_view *view, tsuya_vec3 wi);
TSUYA_API double tsuya_material_view_eval_pdf(const tsuya_material_view *view, tsuya_vec3 wi, double *value);
TSUYA_API bool tsuya_material_view_sample(const tsuya_material_view *view, const double u[3], tsuya_vec3 *wi);

/* Directional albedo ∫ f cosθi dwi for light seen from wo, channel_count values, tabulated (to a few 1e-3). */
TSUYA_API void tsuya_material_albedo(const tsuya_material *material, const double *dye, tsuya_vec3 wo, double *value);

/* Many directions at once in float: component planes of `count` numbers each; value[c * count + k].  Within 1e-4 of the
 * double evaluation, relative to it or to the peak's 1e-3. */
typedef struct tsuya_direction_batch {
    int count;
    const float *wi_x, *wi_y, *wi_z, *wo_x, *wo_y, *wo_z;
} tsuya_direction_batch;
TSUYA_API void tsuya_material_eval_batch(const tsuya_material *material, const double *dye, const tsuya_direction_batch *batch,
                                         float *value);

/* Many viewers at once in float: what tsuya_material_view is for one.  Planes of `count` numbers each, one a channel for dye and rest.
 * Values, densities and the dye's share are within 1e-4 of the double ones as above. */
enum { TSUYA_MATERIAL_LOOKS = 64 };
typedef struct tsuya_material_looks {
    const tsuya_material *material;
    int count;          /* at most TSUYA_MATERIAL_LOOKS */
    const float *dye;   /* of each viewer; NULL: the material's own for all */
    const float *wo[3]; /* unit; under the surface: everything is 0 */
    float *share, *rest; /* the caller's room, filled by tsuya_material_look */
} tsuya_material_looks;
TSUYA_API void tsuya_material_look(const tsuya_material_looks *looks);
/* value[c * count + k], and the density with which tsuya_material_looks_sample draws wi. */
TSUYA_API void tsuya_material_looks_eval_pdf(const tsuya_material_looks *looks, const float *const wi[3], float *value, float *pdf);
/* wi from three planes of numbers in [0, 1); wi_z = 0 where the draw ended under the surface. */
TSUYA_API void tsuya_material_looks_sample(const tsuya_material_looks *looks, const float *const u[3], float *const wi[3]);

#endif
