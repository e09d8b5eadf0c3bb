#include "render/meshopt_adapter.h"

#include <meshoptimizer.h>
#include <string.h>

size_t tsuya_simplify_patch(uint32_t *coarse, const uint32_t *index, size_t index_count, const float *position, size_t vertex_count, double error)
{
    float scale = vertex_count > 0 ? meshopt_simplifyScale(position, vertex_count, 3 * sizeof(float)) : 0.0f;
    if (!(scale > 0.0f)) { /* all vertices in one place */
        memcpy(coarse, index, index_count * sizeof *coarse);
        return index_count;
    }
    return meshopt_simplify(coarse, index, index_count, position, vertex_count, 3 * sizeof(float), 0, (float)(error / (double)scale),
                            meshopt_SimplifyLockBorder, NULL);
}
