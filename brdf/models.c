/* The list of models, in the order in which messages name them. */
#include "brdf/model.h"

#include <string.h>

static const tsuya_brdf_model *const models[] = {
    &tsuya_brdf_lambert, &tsuya_brdf_ggx, &tsuya_brdf_ggx_aniso, &tsuya_brdf_ward, &tsuya_brdf_ashikhmin,
    &tsuya_brdf_tanaka, &tsuya_brdf_yarn, &tsuya_brdf_ndf, &tsuya_brdf_nurbs3,
};
static const char *const names[] = {"lambert", "ggx", "ggx-aniso", "ward", "ashikhmin", "tanaka", "yarn", "ndf", "nurbs3", NULL};
_Static_assert(sizeof names / sizeof names[0] == sizeof models / sizeof models[0] + 1, "one name per model");

const tsuya_brdf_model *tsuya_brdf_model_find(const char *name)
{
    for (size_t k = 0; k < sizeof models / sizeof models[0]; ++k) {
        if (strcmp(models[k]->name, name) == 0) {
            return models[k];
        }
    }
    return NULL;
}

const char *const *tsuya_brdf_model_names(void)
{
    return names;
}
