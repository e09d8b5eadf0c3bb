/* meshoptimizer behind plain types. */
#ifndef TSUYA_RECONSTRUCT_MESHOPT_ADAPTER_H
#define TSUYA_RECONSTRUCT_MESHOPT_ADAPTER_H

#include "core/mesh.h"

/* Edge collapses by quadric error (Garland & Heckbert 1997) until none stays within `error` (unit of the positions).
 * Vertices keep their places; those that no triangle needs any more are dropped, the others keep their order and
 * attributes. */
TSUYA_MUST_CHECK TSUYA_INTERNAL tsuya_status tsuya_meshopt_simplify(tsuya_mesh *mesh, double error);

#endif
