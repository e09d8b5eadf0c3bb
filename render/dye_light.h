/* Radiance of a cloth's vertices under lamps, apart for the surface part and for a white dye under it.  For render/dye.c. */
#ifndef TSUYA_RENDER_DYE_LIGHT_H
#define TSUYA_RENDER_DYE_LIGHT_H

#include "brdf/material.h"

#include "core/context.h"
#include "core/mesh.h"

#include "render/embree_adapter.h"
#include "render/light.h"

/* One vertex in one photograph. */
typedef struct tsuya_dye_look {
    uint32_t view;
    float surface[3], white[3]; /* S, B */
} tsuya_dye_look;

/* Looks of all vertices: vertex v's are look[first[v]] … look[first[v + 1] − 1], views ascending; `view` is set by the caller. */
typedef struct tsuya_dye_looks {
    size_t *first; /* vertex_count + 1 */
    tsuya_dye_look *look;
} tsuya_dye_looks;

typedef struct tsuya_dye_room {
    const tsuya_mesh *mesh; /* with normals; weft may be NULL */
    const tsuya_ray_scene *rays;
    const tsuya_light_set *lights;
    tsuya_material *const *material; /* by the mesh's index; a single one serves every index */
    int material_count;
    const tsuya_vec3 *eye;  /* by view */
    double bias;            /* shadow rays start so far above the cloth */
    int shine;              /* rays for what the surface part mirrors of the surroundings, by look */
} tsuya_dye_room;

/* irradiance: 3 × vertex_count, of the lamps and of `sent` (3 × vertex_count, radiance that each vertex sends all round; NULL: nothing).
 * looks: filled where not NULL.  Chance is a function of context->seed and the vertex. */
TSUYA_MUST_CHECK tsuya_status tsuya_dye_light(float *irradiance, tsuya_dye_looks *looks, const tsuya_dye_room *room, const float *sent,
                                              const tsuya_context *context);

#endif
