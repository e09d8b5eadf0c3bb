#include "reconstruct/meshopt_adapter.h"

#include "core/memory.h"

#include <meshoptimizer.h>
#include <string.h>

tsuya_status tsuya_meshopt_simplify(tsuya_mesh *mesh, double error)
{
    if (mesh->triangle_count == 0) {
        return TSUYA_OK;
    }
    tsuya_status status = TSUYA_OK;
    uint32_t *simple = NULL;
    uint8_t *keep = NULL;
    size_t count = 3 * mesh->triangle_count;
    TSUYA_NEW(status, simple, count);
    TSUYA_NEW(status, keep, mesh->vertex_count);
    float scale = meshopt_simplifyScale(mesh->position, mesh->vertex_count, 3 * sizeof(float));
    if (!(scale > 0.0f)) {
        goto done; /* all vertices in one place */
    }
    count = meshopt_simplify(simple, mesh->triangle, count, mesh->position, mesh->vertex_count, 3 * sizeof(float), 0,
                             (float)(error / (double)scale), 0, NULL);
    memcpy(mesh->triangle, simple, count * sizeof *simple);
    mesh->triangle_count = count / 3;
    memset(keep, 1, mesh->vertex_count);
    status = tsuya_mesh_filter(mesh, keep, true);
done:
    tsuya_free(simple);
    tsuya_free(keep);
    return status;
}
