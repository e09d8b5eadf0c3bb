/* Vertex colours blended from the photographs that see the surface best.
 *
 * A photograph sees a vertex where the drawn mesh is not in front of it.  It counts by how squarely it looks (cos²), by its
 * pixels per unit of surface, and by the distance to mask borders and depth edges, where misregistration would bleed.  Of
 * the best eight, those near a quantile of luminance below the median are averaged in linear light, so that highlights
 * that move with the camera drop out.  One gain a photograph takes exposure differences away.  Vertices that no
 * photograph sees take their colour from the neighbours, where the mesh had none before. */
#ifndef TSUYA_RECONSTRUCT_COLOR_H
#define TSUYA_RECONSTRUCT_COLOR_H

#include "core/context.h"
#include "core/mesh.h"

typedef struct tsuya_color_options {
    const char *workspace;        /* COLMAP's dense folder: images/, sparse/ and, if there are, masks/ */
    const char *const *hold_out;  /* names of photographs that are not looked at */
    int hold_out_count;
    bool equalise;                /* one gain a photograph */
} tsuya_color_options;
TSUYA_API tsuya_color_options tsuya_color_options_default(void);

/* Writes mesh->color.  Needs triangles; normals are computed where there are none.  Fails where no photograph is left, on an
 * unreadable one, and on one of another size than its camera.  Memory: 160 bytes a vertex and one photograph. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_mesh_color(tsuya_mesh *mesh, const tsuya_color_options *options,
                                                         const tsuya_context *context);

#endif
