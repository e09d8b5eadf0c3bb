/* Splits long edges of a mesh at their middle. */
#ifndef TSUYA_RECONSTRUCT_MESH_REFINE_H
#define TSUYA_RECONSTRUCT_MESH_REFINE_H

#include "core/mesh.h"

/* Until no edge is longer than `longest` (> 0, unit of the positions).  The surface stays where it is and closed where it was;
 * new vertices get the mean of an edge's ends (normals of unit length), of their evidence the smaller.  Old vertices keep
 * their places and numbers.  Fails where more than 2^32 − 1 vertices would be needed. */
TSUYA_MUST_CHECK tsuya_status tsuya_mesh_refine(tsuya_mesh *mesh, double longest);

#endif
