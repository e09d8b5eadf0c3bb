/* What a cloth is dyed with, from photographs under known lamps: the pattern without its shading and its shine.
 *
 * A photograph shows at a place x of the cloth, in one channel,
 *
 *     value = gain (S(x, wo) + dye(x) B(x, wo))
 *
 * S and B are the radiance of the surface part and of a white dye under it (brdf/material.h: the value is linear in the dye), under
 * the lamps, their shadows and what the rest of the cloth sends, by the measured material and the mesh's weft.  The dye of each
 * place is found from all photographs that see it, robustly; the gain (exposure and white balance, one a channel for the session, near one
 * another, for the lamps' colours are those that the camera records) is
 * the one under which the photographs agree best about dyes in [0, 1].  It is sharp where the shine changes between views.
 * Linear in the dye and separable like the albedo in J. Lombardi & K. Nishino, "Reflectance and Illumination Recovery in the Wild",
 * PAMI 38(1), 2016, with the lamps and the reflectance known. */
#ifndef TSUYA_RENDER_DYE_H
#define TSUYA_RENDER_DYE_H

#include "core/camera.h"
#include "core/context.h"
#include "core/json.h"
#include "core/mesh.h"

typedef struct tsuya_dye_options {
    const char *const *material_path; /* as in tsuya_render_options */
    int material_count;               /* ≥ 1 */
    const char *lights_path;          /* of the photographs; no preset */
    const tsuya_sparse_model *model;
    const int *view;                  /* of the model, view_count */
    const char *const *photo, *const *mask; /* by view; mask: NULL, or NULL entries for none */
    int view_count;
} tsuya_dye_options;

typedef struct tsuya_dye_info {
    int photos;
    int split;           /* every edge of the mesh was cut into so many */
    size_t vertices;
    double seen;         /* share of the vertices that two photographs or more tell about */
    double gain[3];
    double residual;     /* median over places of |value / (gain (S + dye B)) − 1|, all channels */
    double seconds;
} tsuya_dye_info;

/* dyed: the mesh, cut until its edges are about as long as a photograph's pixel is wide on it, with the dyes as its colours (sRGB of a
 * reflectance in [0, 1]; TSUYA_DYE_OF_VERTICES with scale 1).  Places that fewer than two photographs see keep the mesh's own colour, times
 * what dyes have of colours elsewhere.  The mesh needs colours.  Fails where no photograph shows the cloth, on presets and on
 * materials whose channels are not r, g, b. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_dye_from_photographs(tsuya_mesh *dyed, tsuya_dye_info *info, const tsuya_mesh *mesh,
                                                                   const tsuya_dye_options *options, const tsuya_context *context);
TSUYA_API void tsuya_dye_info_to_json(tsuya_json *object, const tsuya_dye_info *info);

#endif
