/* Inside the simulation: a scene's cloth, its things, its cameras. */
#ifndef TSUYA_CAPTURE_SIMULATE_PARTS_H
#define TSUYA_CAPTURE_SIMULATE_PARTS_H

#include "capture/drape.h"
#include "capture/simulate.h"
#include "capture/studio.h"

enum { SIMULATE_BODIES = 4, SIMULATE_PROPS = 8 };
/* Streams of random numbers; photographs take theirs in steps from the last two. */
enum { SIMULATE_START = 40, SIMULATE_POSES = 50, SIMULATE_CLOSE = 51, SIMULATE_BOARD = 52, SIMULATE_LAMPS = 53, SIMULATE_SHOTS = 100000, SIMULATE_NOISE = 200000 };

/* Where the stand's foot is in the job's frame. */
tsuya_vec3 tsuya_simulate_foot(const tsuya_simulate_scene *scene);
/* The stand and the floor; how many. */
int tsuya_simulate_bodies(tsuya_drape_body body[SIMULATE_BODIES], const tsuya_simulate_scene *scene);
/* Draped and smooth, with colours; vertices on seams are there once for each piece. */
TSUYA_MUST_CHECK tsuya_status tsuya_simulate_cloth(tsuya_studio_cloth *cloth, tsuya_simulate_info *info, const tsuya_simulate_scene *scene,
                                                   const tsuya_studio_weave *weave, const tsuya_context *context);
tsuya_studio_weave tsuya_simulate_weave(const tsuya_simulate_scene *scene, uint64_t seed);
/* NULL: matt. */
const tsuya_microcylinder *tsuya_simulate_reflectance(const tsuya_simulate_scene *scene);
/* Floor, stand, mat, chart. */
TSUYA_MUST_CHECK tsuya_status tsuya_simulate_props(tsuya_studio_prop prop[SIMULATE_PROPS], int *count, const tsuya_simulate_scene *scene);
/* The mat's lower left corner of the chart beside it. */
tsuya_pose tsuya_simulate_chart_pose(const tsuya_simulate_scene *scene);

TSUYA_MUST_CHECK tsuya_status tsuya_simulate_camera(tsuya_camera *camera, const tsuya_simulate_scene *scene);
/* One a photograph, and how far its sharp plane lies; in the scene's arena. */
typedef struct simulate_view { tsuya_pose camera_from_world; double focus_m; bool close_up; } simulate_view;
TSUYA_MUST_CHECK tsuya_status tsuya_simulate_views(simulate_view **view, int *count, const tsuya_simulate_scene *scene, const tsuya_camera *camera,
                                                   const tsuya_studio_cloth *cloth, uint64_t seed);
/* The board before the camera, number `i`: world_from_board with the camera at the origin. */
tsuya_pose tsuya_simulate_board_pose(double *distance_m, const tsuya_simulate_scene *scene, const tsuya_camera *camera, int i, uint64_t seed);
/* Lamps as the JSON that render reads, in the job's frame; in the scene's arena. */
TSUYA_MUST_CHECK tsuya_status tsuya_simulate_lights(const char **json, const char **measured, const tsuya_simulate_scene *scene, tsuya_vec3 low,
                                                    tsuya_vec3 high, uint64_t seed);

#endif
