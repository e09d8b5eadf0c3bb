/* Cameras and their views: one lens struct for COLMAP's and mrcal's models, and COLMAP's model files.
 *
 * Pixels: (0,0) is the centre of the first pixel.  COLMAP puts it at (0.5, 0.5); only the readers and writers of COLMAP's
 * files (core/colmap_model.c) shift.
 *
 * Distortion is OpenCV's rational model with thin prism (calib3d: k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4), of which every
 * model in the enum but the last is a part.  Poses are camera_from_world. */
#ifndef TSUYA_CORE_CAMERA_H
#define TSUYA_CORE_CAMERA_H

#include "core/geometry.h"
#include "core/status.h"

#include <stdint.h>

typedef enum tsuya_lens {
    TSUYA_LENS_PINHOLE,       /* fx fy cx cy                      COLMAP PINHOLE, mrcal LENSMODEL_PINHOLE */
    TSUYA_LENS_SIMPLE_PINHOLE,/* fx = fy                          COLMAP SIMPLE_PINHOLE */
    TSUYA_LENS_SIMPLE_RADIAL, /* fx = fy, k1                      COLMAP */
    TSUYA_LENS_RADIAL,        /* fx = fy, k1 k2                   COLMAP */
    TSUYA_LENS_OPENCV4,       /* k1 k2 p1 p2                      COLMAP OPENCV, mrcal LENSMODEL_OPENCV4 */
    TSUYA_LENS_OPENCV5,       /* … k3                             mrcal */
    TSUYA_LENS_OPENCV8,       /* … k4 k5 k6                       COLMAP FULL_OPENCV, mrcal LENSMODEL_OPENCV8 */
    TSUYA_LENS_OPENCV12,      /* … s1 s2 s3 s4                    mrcal */
    TSUYA_LENS_SPLINED_STEREOGRAPHIC, /* control points           mrcal LENSMODEL_SPLINED_STEREOGRAPHIC, cubic */
} tsuya_lens;

enum { TSUYA_SPLINE_LEAST_SIDE = 4, TSUYA_SPLINE_MOST = 640 };

/* mrcal's splined lens of order 3.  With the stereographic projection u = 2 tan(θ/2) (cos φ, sin φ) of a direction (θ from the axis),
 * a pixel is f (u + Δ(u)) + c; Δ is a cubic B-spline whose control points stand on an even grid around u = 0.  It reaches from
 * −u(½ fov_x) to u(½ fov_x) along x, one cell short of the outermost control points, and as many cells short of them along y. */
typedef struct tsuya_lens_spline {
    int nx, ny;            /* at least 4 each, at most 640 together */
    int fov_x_deg;
    double point[2 * TSUYA_SPLINE_MOST]; /* Δ, x and y, row by row */
} tsuya_lens_spline;

typedef struct tsuya_camera {
    tsuya_lens lens;
    int width_px, height_px;
    double fx_px, fy_px, cx_px, cy_px;
    double distortion[12]; /* OpenCV's order; what the lens lacks is 0 */
    tsuya_lens_spline spline; /* of a splined lens; else empty */
} tsuya_camera;

/* Pixel of a point in the camera frame; false behind the camera (z ≤ 0), beyond the reach of a spline or at non-finite results. */
TSUYA_API bool tsuya_camera_project(const tsuya_camera *camera, tsuya_vec3 p_camera, tsuya_vec2 *pixel);
/* Unit ray in the camera frame through a pixel (Newton on the distortion); false where the model does not invert.  Rays of a splined
 * lens may point backwards (z ≤ 0). */
TSUYA_API bool tsuya_camera_unproject(const tsuya_camera *camera, tsuya_vec2 pixel, tsuya_vec3 *ray);
/* Control points for a unit of u, and the largest |u| that the spline reaches (x, y). */
TSUYA_API double tsuya_lens_spline_density(const tsuya_lens_spline *spline);
TSUYA_API tsuya_vec2 tsuya_lens_spline_reach(const tsuya_lens_spline *spline);
/* u of a direction that does not point straight back, and a unit direction of u. */
TSUYA_API tsuya_vec2 tsuya_stereographic_from_ray(tsuya_vec3 ray);
TSUYA_API tsuya_vec3 tsuya_stereographic_ray(tsuya_vec2 u);
/* Weights of the 4 × 4 control points that Δ(u) is made of, from `first` (index of a control point) row by row. */
TSUYA_API void tsuya_lens_spline_weights(double weight[16], int *first, const tsuya_lens_spline *spline, tsuya_vec2 u);
/* Scaled to another image size, pixel centres kept in place (x' + ½ = s (x + ½)). */
TSUYA_API tsuya_camera tsuya_camera_scaled(const tsuya_camera *camera, int width_px, int height_px);

typedef struct tsuya_view {
    uint32_t image_id, camera_id; /* as in COLMAP's database */
    char *name;                   /* photograph's file name */
    tsuya_pose camera_from_world;
    int camera;                   /* index into the model's cameras */
    int observation_count;
    struct tsuya_observation *observation;
} tsuya_view;

typedef struct tsuya_observation {
    float x_px, y_px;
    int64_t point; /* index into the model's points, −1 where the feature has none */
} tsuya_observation;

typedef struct tsuya_track_element { int view, observation; } tsuya_track_element;

typedef struct tsuya_point {
    tsuya_vec3 position;
    uint8_t color[3];
    double error_px;  /* mean reprojection error */
    int track_count;
    tsuya_track_element *track;
    uint64_t point_id;
} tsuya_point;

/* COLMAP's sparse model. Views sorted by name. */
typedef struct tsuya_sparse_model {
    tsuya_camera *camera;
    uint32_t *camera_id;
    int camera_count;
    tsuya_view *view;
    int view_count;
    tsuya_point *point;
    size_t point_count;
} tsuya_sparse_model;

/* FOLDER/{cameras,images,points3D}.{bin,txt}, binary first.  points3D may be missing or empty.  Hostile files are refused
 * (counts against the file's size, ids that do not exist, non-finite numbers, unknown lens models by name). */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_sparse_model_load(tsuya_sparse_model *model, const char *folder);
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_sparse_model_save_text(const tsuya_sparse_model *model, const char *folder);
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_sparse_model_save_binary(const tsuya_sparse_model *model, const char *folder);
TSUYA_API void tsuya_sparse_model_free(tsuya_sparse_model *model);
TSUYA_API int tsuya_sparse_model_find(const tsuya_sparse_model *model, const char *name); /* view index or −1 */
/* The whole model moved and scaled: x_new = s(x_old). */
TSUYA_API void tsuya_sparse_model_transform(tsuya_sparse_model *model, tsuya_similarity new_from_old);

/* COLMAP's dense maps: "width&height&channels&" and float32, channel planes row-major.  `values`: channels × h × w. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_colmap_map_save(const char *path, int width_px, int height_px, int channels,
                                                              const float *values);
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_colmap_map_load(float **values, int *width_px, int *height_px, int *channels,
                                                              const char *path);

/* mrcal .cameramodel files: lens models of the enum and extrinsics (mrcal: rt_cam_ref).  Others are refused by name, splines of
 * another order or of more control points than fit, too. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_cameramodel_load(tsuya_camera *camera, tsuya_pose *camera_from_world,
                                                               const char *path);
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_cameramodel_save(const tsuya_camera *camera, tsuya_pose camera_from_world,
                                                               const char *path);
/* The lens as such a file names it. */
enum { TSUYA_LENS_NAME = 96 };
TSUYA_API void tsuya_cameramodel_lens(char name[TSUYA_LENS_NAME], const tsuya_camera *camera);

#endif
