/* Cloth on surfaces, photographed: pictures and cameras as COLMAP lays them out, a mesh, and the true weft on it. */
#ifndef TSUYA_TESTS_WEAVE_DETECT_SCENE_SURFACE_H
#define TSUYA_TESTS_WEAVE_DETECT_SCENE_SURFACE_H

#include "core/mesh.h"

typedef enum surface_kind {
    SURFACE_CYLINDER, /* a sheared sheet, rolled */
    SURFACE_CONE,     /* a flat sheet, rolled to a cone: the weft turns along the rim */
    SURFACE_DRAPE,    /* a sheet hung over waves */
    SURFACE_SEAM,     /* the same of two cuts, sewn together along u = SEAM_M: the second one's weft is turned by SEAM_DEG */
    SURFACE_KIND_COUNT
} surface_kind;

#define SURFACE_SEAM_M 0.03
#define SURFACE_SEAM_DEG 35.0

const char *surface_name(surface_kind kind);

/* PNG files in FOLDER/images and a model in FOLDER/sparse, of `view_count` photographs, 640 × 480.  `mesh` (about 3,000 vertices, with normals) carries
 * the true weft. */
void surface_photograph(tsuya_mesh *mesh, surface_kind kind, int view_count, const char *folder);

#endif
