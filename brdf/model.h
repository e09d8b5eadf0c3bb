/* What a reflectance model implements, one file per model; and the material around it.  For brdf/ alone.
 *
 * A model describes the surface part.  The directions that it is given are above the surface (z > 0); the material has
 * answered for the others.  Models are listed in brdf/models.c. */
#ifndef TSUYA_BRDF_MODEL_H
#define TSUYA_BRDF_MODEL_H

#include "brdf/material.h"

typedef struct tsuya_brdf_model {
    const char *name;
    /* `channels` values, sr⁻¹ */
    void (*eval)(const void *state, int channels, tsuya_vec3 wi, tsuya_vec3 wo, double *value);
    /* As eval, in float; value[c * count + k]; directions under the surface may give anything (the material clears them)
     * unless the model `clears`. */
    void (*eval_batch)(const void *state, int channels, const tsuya_direction_batch *batch, float *value);
    double (*pdf)(const void *state, tsuya_vec3 wi, tsuya_vec3 wo);
    /* false when the draw ended under the surface */
    bool (*sample)(const void *state, tsuya_vec3 wo, const double u[2], tsuya_vec3 *wi);
    /* The two for many pairs at once, in float, planes of batch->count numbers; both NULL: one by one.  Draws for given numbers may be others
     * than those of `sample` as long as they have the same density; wi_z = 0 where the draw ended under the surface. */
    void (*pdf_batch)(const void *state, const tsuya_direction_batch *batch, float *pdf);
    void (*sample_batch)(const void *state, int count, const float *const wo[3], const float *const u[2], float *const wi[3]);
    /* The same draws for many viewers at once, for quadratures; both NULL: by `sample` and `pdf`.  shared_draws: what all viewers
     * have in common of `total` draws, three planes.  take_draws: `count` of them from number `from` on (`shared` + from are
     * their planes, `total` apart), as wi and weight = cosθi / (pdf total), 0 where the draw ended under the surface. */
    void (*shared_draws)(const void *state, int total, float *shared);
    void (*take_draws)(const void *state, tsuya_vec3 wo, const float *shared, int total, int from, int count, float *const wi[3], float *weight);
    /* Directional albedo of the surface part for the table of brdf/dye.h; NULL: the material integrates by `sample`. */
    void (*albedo)(const void *state, int channels, tsuya_vec3 wo, double *value);
    /* `parameters` is the JSON object of that name; its errors name the file. */
    tsuya_status (*from_json)(void **state, int channels, const tsuya_json *parameters);
    void (*to_json)(const void *state, int channels, tsuya_json *parameters);
    void (*free_state)(void *state); /* NULL where the model has no state */
    size_t (*bytes)(const void *state);
    bool mirrored;  /* f stays when x of both directions changes its sign, and when y does */
    bool clears;    /* eval_batch leaves 0 where a direction is not finite or not above the surface: the material need not */
    bool unbounded; /* may reflect more than it receives: the material holds it at 1 (brdf/dye.h) */
} tsuya_brdf_model;

extern const tsuya_brdf_model tsuya_brdf_lambert, tsuya_brdf_ggx, tsuya_brdf_ggx_aniso, tsuya_brdf_ward, tsuya_brdf_ashikhmin;
extern const tsuya_brdf_model tsuya_brdf_tanaka, tsuya_brdf_yarn, tsuya_brdf_ndf, tsuya_brdf_nurbs3;

/* State of ggx and ggx-aniso; values in the ranges of brdf/ggx.c. */
TSUYA_MUST_CHECK tsuya_status tsuya_ggx_create(void **state, int channels, double alpha_weft, double alpha_warp, double eta,
                                               const double *strength);

/* NULL where there is none; `names` (NULL-terminated) for messages. */
const tsuya_brdf_model *tsuya_brdf_model_find(const char *name);
const char *const *tsuya_brdf_model_names(void);

typedef enum tsuya_dye_coupling {
    TSUYA_DYE_LAMBERT,       /* base = 1/π: as a fit of kd/π beside the surface part measured it */
    TSUYA_DYE_UNDER_SURFACE, /* base takes only what the surface part left over */
} tsuya_dye_coupling;

enum { TSUYA_CHANNEL_NAME_SIZE = 16 };

struct tsuya_material {
    char *name, *note;
    bool is_default, relative;
    int channel_count;
    char (*channel_name)[TSUYA_CHANNEL_NAME_SIZE];
    const char **channel; /* pointers into channel_name */
    tsuya_material_support support;
    double heldout_cbrt, heldout_log;
    const tsuya_brdf_model *model;
    void *state;
    double *dye;
    tsuya_dye_coupling coupling;
    struct tsuya_albedo_table *albedo;
    struct tsuya_albedo_table *limit; /* NULL: the surface part nowhere reflects more than it receives */
};

/* A material around a model's state, whose ownership it takes (also on failure).  `channels` NULL: r, g, b. Dye 0, coupling
 * under_surface, no support, no errors; the albedo table is made here (about 0.1 s). */
TSUYA_MUST_CHECK tsuya_status tsuya_material_create(tsuya_material **material, const tsuya_brdf_model *model, void *state,
                                                    const char *name, int channel_count, const char *const *channels);
TSUYA_MUST_CHECK tsuya_status tsuya_material_set_note(tsuya_material *material, const char *note);

/* Checked parameter readers: finite and within [low, high], else the file, the key, the value and the range are named. */
TSUYA_MUST_CHECK tsuya_status tsuya_model_read_number(double *number, const tsuya_json *object, const char *key, double low,
                                                      double high);
TSUYA_MUST_CHECK tsuya_status tsuya_model_read_numbers(double *numbers, int count, const tsuya_json *object, const char *key,
                                                       double low, double high);

#endif
