/* Photographs to a mesh: COLMAP for cameras and sparse points, then our own dense stereo, fusion and surface.
 *
 * Writes into the output folder (JOB/reconstruct): database.db, sparse/0, dense/ (COLMAP's workspace), cloud.ply, mesh.ply,
 * reconstruct.json, steps.json, log/.  Where the camera has a lens that COLMAP lacks (OPENCV12, splined), all of this is of a pinhole, and
 * pinhole/{photos,masks,camera.cameramodel} is what it sees (reconstruct/pinhole.h).  A finished step whose inputs are the same is passed over by a later run.
 *
 * The same input gives the same bits, for any number of threads: COLMAP extracts features in all of them, but verifies,
 * maps and triangulates in one. */
#ifndef TSUYA_RECONSTRUCT_RECONSTRUCT_H
#define TSUYA_RECONSTRUCT_RECONSTRUCT_H

#include "core/camera.h"
#include "core/context.h"
#include "core/json.h"
#include "reconstruct/scale.h"
#include "reconstruct/steps.h"

typedef struct tsuya_reconstruct_options {
    const char *photos, *masks;    /* folders; masks NULL where there are none */
    const char *output;            /* JOB/reconstruct */
    const char *poses;             /* folder of a COLMAP model, or of .cameramodel files, whose poses and lenses are kept; NULL */
    const char *camera_model;      /* .cameramodel whose intrinsics are kept; NULL: from EXIF, refined */
    const char *const *hold_out;   /* registered, but used by no dense step */
    int hold_out_count;
    int dense_long_side_px;        /* of the depth maps; 0: half the photographs' above 1600 px, else full */
    int source_views;              /* for each depth map; 0: the default of stereo.h */
    const tsuya_scale_input *scale; /* tags or distances that make the world metric; NULL: COLMAP's frame and unit, or the poses' own */
    double tolerance;              /* error wanted of the surface, two standard deviations, world unit: chooses size and neighbours of the depth maps
                                    * where these are 0, and the mesh; 0: the defaults */
    bool tolerance_in_metres;      /* then a world without metres is refused */
} tsuya_reconstruct_options;
TSUYA_API tsuya_reconstruct_options tsuya_reconstruct_options_default(void);

typedef struct tsuya_reconstruct_info {
    int photos, registered;
    int pairs_matched, pairs_possible, pairs_verified;
    int models;                     /* that the mapper made; the one with most photographs is kept */
    bool calibrated;                /* intrinsics given, not refined */
    double scale_m_per_unit, scale_rms_m; /* NaN: COLMAP's unit */
    double reprojection_px;
    size_t sparse_points, points, mesh_vertices, mesh_triangles;
    double gsd;                     /* of the full-size photographs at the surface, world unit */
    int dense_long_side_px;
    double tolerance, simplification_max; /* of the mesh */
    tsuya_json *precision;          /* error expected, what is finer and what that would cost; owned */
    double silhouette_median, silhouette_min; /* intersection over union against the masks; NaN without masks */
    int silhouette_views;
    char colmap_version[64];
    tsuya_step step[TSUYA_STEPS_MOST];
    int step_count;
    double seconds, peak_mb;
    tsuya_json *parts;              /* the dense steps' own figures; owned */
} tsuya_reconstruct_info;

/* Fails with one line on fewer than three photographs, photographs that are all the same file, mixed sizes, a missing or
 * failing COLMAP, or no two photographs that overlap. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_reconstruct(tsuya_reconstruct_info *info, const tsuya_reconstruct_options *options,
                                                          const tsuya_context *context);
/* sparse/0 of the output folder with the lens that the photographs themselves were taken through, where the model has a pinhole's: for all who
 * look up the surface in the photographs.  `camera_model` and `poses` as in the options.  Observations stay those of sparse/0. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_reconstruct_cameras(tsuya_sparse_model *model, const char *output, const char *camera_model, const char *poses);
TSUYA_API void tsuya_reconstruct_info_free(tsuya_reconstruct_info *info);
TSUYA_API void tsuya_reconstruct_info_to_json(tsuya_json *object, const tsuya_reconstruct_info *info);

#endif
