/* A job that the virtual studio makes from a scene: what `tsuya capture simulate SCENE.yaml` writes.
 *
 * FOLDER/{photos, masks, board, board.yaml, mat.yaml, goniometer.csv, JOB.yaml}  what a job sees
 * FOLDER/{swatch, spectra.csv}  photographs of the stage's swatch and what a spectroradiometer reads of it, where the scene asks for them
 * FOLDER/truth/{swatch.ply, swatch}  the swatch and the cameras before it, in the swatch's frame
 * FOLDER/truth/{mesh.ply, sparse/, camera.cameramodel, lights.json, reflectance.csv, chart.csv}  what it is held against
 *
 * Frame: the mat's (z up, origin at the lower left corner of its first tag, the stand in its middle); without a mat the
 * stand's foot.  docs/capture.md lists the scene's keys. */
#ifndef TSUYA_CAPTURE_SIMULATE_H
#define TSUYA_CAPTURE_SIMULATE_H

#include "core/context.h"
#include "core/yaml.h"

/* Numbers are NaN and whole numbers INT_MIN where a file leaves them out, until tsuya_simulate_scene_load has put the defaults in. */
typedef struct tsuya_scene_cloth {
    const char *kind, *fabric, *reflectance; /* kind: closed, square, disc, karaori, curtain */
    double side_m, spacing_m, weft_mm, warp_mm, unevenness;
    double drop_m, fullness;                 /* of a curtain: its length, and the flat cloth's width over side_m */
    int pleats;
    int levels;                              /* coarser meshes that settle first */
    int smooth;                              /* subdivisions of the draped mesh before it is photographed */
} tsuya_scene_cloth;

typedef struct tsuya_scene_stand {
    const char *kind;                        /* disc, table, bar, form */
    double radius_m, height_m, length_m;
} tsuya_scene_stand;

typedef struct tsuya_scene_camera {
    const char *model, *format;              /* model: a .cameramodel instead of size, focal and distortion; format: jpg or tif */
    tsuya_yaml_list size, distortion, center_px;
    double focal_px, sensor_mm, f_number, vignetting, blur_px, full_well_e, read_noise_e, exposure_ev;
    bool bayer;
    int jpeg_quality, spp;
} tsuya_scene_camera;

typedef struct tsuya_scene_view {
    int count;
    double elevation_deg, distance_m, target_m, azimuth_deg, sweep_deg, jitter, px_per_thread; /* sweep_deg: below 360 an arc about azimuth_deg */
    bool turntable; /* the camera stands still, the cloth turns with all that lights it */
} tsuya_scene_view;

typedef struct tsuya_scene_lamp {
    const char *type;
    tsuya_yaml_list position_m, aim_m, size_m, rgb;
} tsuya_scene_lamp;

typedef struct tsuya_scene_tags {
    const char *family;
    int cols, rows, first_id, border_bits, photos; /* photos: of the board alone */
    double tag_mm, gap_mm;
} tsuya_scene_tags;

typedef struct tsuya_scene_goniometer {
    double azimuth_step_deg, tilt_step_deg, noise;
    double photo_step_deg, photo_scale;            /* tilts that are photographed; of the photographs' size */
    bool photos, spectra;                          /* of the swatch with tags on the stage; of a spectroradiometer */
    tsuya_yaml_list dye;                           /* of the swatch, r g b */
} tsuya_scene_goniometer;

typedef struct tsuya_simulate_scene {
    const char *path, *name;
    tsuya_scene_cloth cloth;
    tsuya_scene_stand stand;
    tsuya_scene_camera camera;
    tsuya_yaml_list views, lamps;                  /* of tsuya_scene_view, tsuya_scene_lamp */
    tsuya_scene_tags mat, board;
    tsuya_scene_goniometer goniometer;
    bool has_mat, has_board, has_goniometer, chart, lamps_measured;
    int seed, hold_out;
    tsuya_arena *arena;
} tsuya_simulate_scene;

/* Fails, naming file, key and value, on unknown keys and names and on numbers out of range. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_simulate_scene_load(tsuya_simulate_scene *scene, const char *path);
TSUYA_API void tsuya_simulate_scene_free(tsuya_simulate_scene *scene);

typedef struct tsuya_simulate_info {
    int photos, board_photos, swatch_photos, drape_steps;
    bool at_rest;
    size_t vertices;                               /* of the truth's mesh */
    double energy_j, drape_s, photos_s, board_s, swatch_s;
} tsuya_simulate_info;
/* Draws and writes.  The folder is new or of an earlier simulation, which is replaced. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_simulate(tsuya_simulate_info *info, const tsuya_simulate_scene *scene, const char *folder,
                                                       const tsuya_context *context);

#endif
