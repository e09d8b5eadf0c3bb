/* A mesh with every triangle cut into n² alike: room for colours that change within a triangle. */
#ifndef TSUYA_RENDER_SPLIT_H
#define TSUYA_RENDER_SPLIT_H

#include "core/mesh.h"

/* Where a vertex of the finer mesh lies on the coarser one: corners of a triangle that holds it, and their weights (sum 1).  A
 * corner of weight 0 repeats the first. */
typedef struct tsuya_split_place {
    uint32_t corner[3];
    float weight[3];
} tsuya_split_place;

/* The coarser mesh's vertices come first; edges are cut once, so that neighbours still share them.  Every array is interpolated
 * (directions stay unit, the weft whatever its sign; the material is the nearest corner's).  place (tsuya_free): one a vertex.
 * n in 1 … 64; fails when a mesh of 2³² vertices or more would come out. */
TSUYA_MUST_CHECK tsuya_status tsuya_mesh_split(tsuya_mesh *fine, tsuya_split_place **place, const tsuya_mesh *mesh, int n);

#endif
