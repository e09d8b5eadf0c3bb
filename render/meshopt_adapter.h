/* meshoptimizer behind plain types. */
#ifndef TSUYA_RENDER_MESHOPT_ADAPTER_H
#define TSUYA_RENDER_MESHOPT_ADAPTER_H

#include <stddef.h>
#include <stdint.h>

/* Edge collapses by quadric error (Garland & Heckbert 1997) until none stays within `error` (unit of the positions).  Vertices keep their
 * places, and those of edges with one triangle stay.  coarse: room for index_count; returns how many were written. */
size_t tsuya_simplify_patch(uint32_t *coarse, const uint32_t *index, size_t index_count, const float *position, size_t vertex_count, double error);

#endif
