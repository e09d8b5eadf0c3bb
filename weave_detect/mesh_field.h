/* One weft field on a surface, out of the threads that its photographs show.
 *
 * Every photograph votes where it sees the surface (weave_detect/votes.h).  Votes with a thread count that the garment hardly has are
 * doubted (weave_detect/census.h), votes of a vertex that disagree with the best supported cross are left out.  The crosses are smoothed
 * as a four-fold field with the votes' certainty as weight (Knöppel, Crane, Pinkall & Schröder, "Globally optimal direction fields",
 * SIGGRAPH 2013, with data terms), in rounds: what the patches around outvote loses its weight, and edges over which the field turns
 * abruptly (seams, borders; folds by their normals) let go.  The two families are told apart along a spanning tree of the surest
 * edges, and each is then smoothed for itself, so that sheared cloth keeps its angle.  Where no photograph shows threads, the weft
 * follows the texture and the folds, and the confidence says so. */
#ifndef TSUYA_WEAVE_DETECT_MESH_FIELD_H
#define TSUYA_WEAVE_DETECT_MESH_FIELD_H

#include "core/context.h"
#include "core/json.h"
#include "core/mesh.h"
#include "weave_detect/threads.h"

typedef struct tsuya_weave_mesh_options {
    const char *workspace; /* COLMAP's dense folder: images/, sparse/ (masks/ is used where it is there) */
    int patch_px, step_px; /* 64, 32 */
    const char *const *hold_out; /* photographs that do not vote */
    int hold_out_count;
    bool has_weft; /* `weft`: roughly where the weft runs, world frame, from the user */
    tsuya_vec3 weft;
} tsuya_weave_mesh_options;
TSUYA_API tsuya_weave_mesh_options tsuya_weave_mesh_options_default(void);

/* A triangle around which the cross of threads makes `quarters` quarter turns (counter-clockwise positive) more than the surface does. */
typedef struct tsuya_weave_singularity {
    tsuya_vec3 position; /* world frame */
    int quarters;
    double confidence;   /* of the triangle's corners, mean */
} tsuya_weave_singularity;

typedef struct tsuya_weave_mesh_info {
    int photos;
    size_t patches;          /* that the photographs were asked for */
    double patches_sure;     /* share of them with confidence ≥ 0.8 */
    double covered_fraction; /* of the area: confidence ≥ 0.5 */
    double textured_fraction;/* of the area: votes of threads or texture; the rest inherits */
    int singularities;       /* of the smoothed field; rims and seams hold none */
    tsuya_weave_singularity *singularity; /* by the triangles' order; tsuya_weave_mesh_info_free */
    tsuya_weft_told weft_told; /* of the largest connected piece */
    bool threads_seen;       /* false: the field follows texture and folds */
    double threads_per_m_weft, threads_per_m_warp; /* medians, per unit of the mesh; NaN where none were seen */
    double shear_deg_median, shear_deg_p90;        /* |angle between the families − 90°|; NaN where none were seen */
    double seconds;
} tsuya_weave_mesh_info;

/* Adds `weft`, `weave_confidence`, `shear_deg` and `threads_per_m` (and normals where the mesh has none).  weft: unit, tangent, of consistent sign
 * wherever the surface allows it.  weave_confidence: probability that it is within 2 degrees of a thread. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_weave_mesh(tsuya_mesh *mesh, tsuya_weave_mesh_info *info,
                                                         const tsuya_weave_mesh_options *options, const tsuya_context *context);
TSUYA_API void tsuya_weave_mesh_info_free(tsuya_weave_mesh_info *info);
/* The figures; `singularity_list` holds the places. */
TSUYA_API void tsuya_weave_mesh_info_to_json(tsuya_json *figures, const tsuya_weave_mesh_info *info);

#endif
