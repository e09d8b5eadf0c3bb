/* Perfectly diffuse cloth: the surface part is nothing, the dye is everything. */
#include "brdf/model.h"
#include "brdf/sampling.h"

#include "core/memory.h"

#include <string.h>

static void eval(const void *state, int channels, tsuya_vec3 wi, tsuya_vec3 wo, double *value)
{
    (void)state, (void)wi, (void)wo;
    memset(value, 0, (size_t)channels * sizeof *value);
}

static void eval_batch(const void *state, int channels, const tsuya_direction_batch *batch, float *value)
{
    (void)state;
    memset(value, 0, (size_t)channels * (size_t)batch->count * sizeof *value);
}

static double pdf(const void *state, tsuya_vec3 wi, tsuya_vec3 wo)
{
    (void)state, (void)wo;
    return wi.z / M_PI;
}

static bool sample(const void *state, tsuya_vec3 wo, const double u[2], tsuya_vec3 *wi)
{
    (void)state, (void)wo;
    *wi = tsuya_sample_cosine(u[0], u[1]);
    return wi->z > 0.0;
}

static void albedo(const void *state, int channels, tsuya_vec3 wo, double *value)
{
    (void)state, (void)wo;
    memset(value, 0, (size_t)channels * sizeof *value);
}

static tsuya_status from_json(void **state, int channels, const tsuya_json *parameters)
{
    (void)channels, (void)parameters;
    *state = NULL;
    return TSUYA_OK;
}

static void to_json(const void *state, int channels, tsuya_json *parameters)
{
    (void)state, (void)channels, (void)parameters;
}

static size_t bytes(const void *state)
{
    (void)state;
    return 0;
}

const tsuya_brdf_model tsuya_brdf_lambert = {
    .name = "lambert",
    .eval = eval,
    .eval_batch = eval_batch,
    .pdf = pdf,
    .sample = sample,
    .albedo = albedo,
    .from_json = from_json,
    .to_json = to_json,
    .free_state = NULL,
    .bytes = bytes,
};

tsuya_status tsuya_material_lambert(tsuya_material **material, const double reflectance[3])
{
    TSUYA_TRY(tsuya_material_create(material, &tsuya_brdf_lambert, NULL, "lambert", 3, NULL));
    tsuya_status status = tsuya_material_set_dye(*material, reflectance);
    if (status != TSUYA_OK) {
        tsuya_material_free(*material);
        *material = NULL;
    }
    return status;
}
