/* From a fused cloud to the surface of the garment.
 *
 * Outliers out, thinned, screened Poisson (Kazhdan & Hoppe 2013, PCL), and then trimmed to the evidence, so that a garment
 * stays an open sheet with its hems: where no point of the cloud with a like normal lies within `trim_spacings` of the
 * surface, it is cut along a smooth line.  Patches without points that the surface closes all around, and none of whose
 * places is farther than `bridge_spacings` from a point, stay as they are and have evidence 0: dark creases, glints.
 * What is left is smoothed mildly and decimated to a tolerance that is then measured. */
#ifndef TSUYA_RECONSTRUCT_SURFACE_H
#define TSUYA_RECONSTRUCT_SURFACE_H

#include "core/context.h"
#include "core/json.h"
#include "core/mesh.h"

typedef struct tsuya_surface_options {
    double tolerance;       /* of the decimation, unit of the cloud; 0: half the median spacing; negative: no decimation */
    double thin;            /* cell of the thinning, unit of the cloud (the ground sample distance); 0: only duplicates */
    double min_evidence;    /* points that fewer photographs support are left out */
    double outlier_sigmas;  /* statistical outliers; 0: off */
    double trim_spacings;
    double bridge_spacings;
    double close_holes;     /* holes are closed whose places all lie within this distance of a point, unit of the cloud */
    double island_fraction; /* parts of less than this share of the largest part's area are dropped */
    double color_spacings;  /* a coloured mesh has no edge longer than so many spacings, since it carries its colours at
                             * its vertices; 0: the tolerance alone decides */
    int smoothing;          /* iterations */
    int depth;              /* of the octree, 4 to 12; 0: cells of about one spacing (or of the tolerance, if that is coarser) */
    const char *masks_workspace; /* COLMAP's dense folder: points outside the masks' visual hull are dropped; NULL: not */
} tsuya_surface_options;
TSUYA_API tsuya_surface_options tsuya_surface_options_default(void);

typedef struct tsuya_surface_info {
    size_t points_in, points_kept;
    size_t points_outside_masks, points_outlying;
    double spacing; /* median distance between neighbouring points */
    int poisson_depth;
    size_t vertices, triangles;
    double trimmed_fraction; /* of Poisson's area */
    double bridged_fraction; /* of the mesh's area: closed without a measured point */
    double tolerance;        /* asked for, unit of the cloud */
    double simplification_p95, simplification_max; /* distance of the vertices before decimation to the mesh after it */
    double residual_median, residual_p95; /* distance of the cloud's points to the mesh */
    size_t triangles_before; /* the decimation */
    size_t components, boundary_edges;
    double seconds;
} tsuya_surface_info;

/* Needs positions; normals are estimated where there are none.  Fails on fewer than 32 different points, on non-finite
 * numbers (with the point's index), and where nothing is left.  The mesh has normals, evidence, and whatever of colour and
 * sigma the cloud has.  The same bytes for any number of threads. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_surface_make(tsuya_mesh *mesh, tsuya_surface_info *info, const tsuya_mesh *cloud,
                                                           const tsuya_surface_options *options, const tsuya_context *context);

TSUYA_API void tsuya_surface_info_to_json(tsuya_json *object, const tsuya_surface_info *info);

#endif
