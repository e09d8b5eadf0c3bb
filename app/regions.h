/* Which material lies where: masks of photographs, carried to the surface. */
#ifndef TSUYA_APP_REGIONS_H
#define TSUYA_APP_REGIONS_H

#include "core/camera.h"
#include "core/context.h"
#include "core/mesh.h"

/* One photograph's word on one region. */
typedef struct tsuya_region_mask {
    uint8_t region;    /* index of the material, ≥ 0 */
    int view;          /* in the sparse model */
    const char *path;  /* white: the region; as large as the photograph */
} tsuya_region_mask;

/* Sets mesh->material (added when missing).  A vertex that a photograph sees counts for a region as its mask has it, weighted by
 * the cosine of view; a region gets the vertices where more than half of what was seen lies in it (of several, the one with
 * the largest share), `rest` gets the others.  Vertices that no masked photograph saw follow their nearest neighbours along
 * the mesh.  `masks` sorted by view.  The result does not depend on the number of threads.  Fails on unreadable masks and on
 * masks of another size than the view's camera (named). */
TSUYA_MUST_CHECK tsuya_status tsuya_regions_vote(tsuya_mesh *mesh, const tsuya_sparse_model *model, const tsuya_region_mask *masks,
                                                 int mask_count, uint8_t rest, const tsuya_context *context);

#endif
