/* What the weave field says about the cloth, as colours of the mesh: shear, and threads of either family. */
#ifndef TSUYA_APP_WEAVE_MAPS_H
#define TSUYA_APP_WEAVE_MAPS_H

#include "core/json.h"
#include "core/mesh.h"

typedef struct tsuya_weave_map {
    float *value; /* one a vertex; NaN where the confidence is below ½; the caller's, tsuya_free */
    double low, high; /* the 2 % and 98 % quantiles of the values, low < high */
    size_t seen;      /* vertices with a value */
} tsuya_weave_map;

/* `number`: of vertex v at v·stride. */
TSUYA_MUST_CHECK tsuya_status tsuya_weave_map_create(tsuya_weave_map *map, const tsuya_mesh *mesh, const float *number, int stride);

/* Writes shear.ply, weft_threads.ply and warp_threads.ply into a folder: the mesh, coloured from low (dark blue) to high (yellow), grey where no
 * thread was seen.  `figures` gets maps {shear_deg, weft_threads_per_m, warp_threads_per_m}: file, low, high. */
TSUYA_MUST_CHECK tsuya_status tsuya_weave_maps_save(tsuya_json *figures, const tsuya_mesh *mesh, const char *folder);

#endif
