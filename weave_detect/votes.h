/* What the photographs say about every vertex: thread directions in its tangent plane. */
#ifndef TSUYA_WEAVE_DETECT_VOTES_H
#define TSUYA_WEAVE_DETECT_VOTES_H

#include "core/context.h"
#include "core/mesh.h"
#include "weave_detect/mesh_field.h"
#include "weave_detect/threads.h"

enum { TSUYA_VOTES = 8 };

/* Angles from the vertex's first tangent towards its second (tsuya_tangent_basis). */
typedef struct tsuya_vote {
    float a_rad, b_rad;          /* the families as lines, in no order; meaningful where confidence > 0 */
    float period_a, period_b;    /* unit of the mesh */
    float sigma_rad;             /* of the worse angle */
    float confidence;            /* probability of the patches */
    float flow_rad, flow_weight; /* the texture's direction; [0, 1] */
    float weight;                /* how frontally and centrally the photograph saw the place, (0, 1] */
} tsuya_vote;

typedef struct tsuya_votes {
    size_t vertex_count;
    tsuya_vote *vote; /* TSUYA_VOTES a vertex, best first */
    uint8_t *count;
    double spacing;   /* between patches on the surface, median, unit of the mesh */
    size_t patches, sure; /* that were looked at; of them with confidence ≥ 0.8 */
    int photos;
    tsuya_vec3 up;    /* mean of the cameras' upward directions, world frame */
} tsuya_votes;

/* An orthonormal basis of the plane at right angles to `normal`; a function of the normal alone (Duff et al., "Building an
 * orthonormal basis, revisited", JCGT 6(1), 2017).  A zero normal counts as +z. */
void tsuya_tangent_basis(tsuya_vec3 *first, tsuya_vec3 *second, tsuya_vec3 normal);

/* Looks through every photograph of the workspace (COLMAP's undistorted images and pinhole cameras).  Patches are rectified: they are
 * sampled on the plane that fits the surface under them, at the photograph's finest spacing there. */
TSUYA_MUST_CHECK tsuya_status tsuya_votes_gather(tsuya_votes *votes, const tsuya_mesh *mesh, const tsuya_weave_mesh_options *options,
                                                 const tsuya_context *context);
void tsuya_votes_free(tsuya_votes *votes);

#endif
