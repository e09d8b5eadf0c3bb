#include "app/command.h"

const tsuya_command tsuya_commands[] = {
    {"demo", "makes photographs of a cloth it knows, runs a job on them, compares with the truth", tsuya_command_demo},
    {"run", "runs the stages of a JOB.yaml that are not done yet, and writes the report", tsuya_command_run},
    {"capture check", "which photographs to take again, and why", tsuya_command_capture_check},
    {"capture simulate", "drapes a cloth and photographs it in a virtual studio: a job with its truth", tsuya_command_capture_simulate},
    {"capture target", "a board of AprilTags to print, exact in millimetres, and its board.yaml", tsuya_command_capture_target},
    {"calib camera", "photographs of a board to a camera model with an error that can be believed", tsuya_command_calib_camera},
    {"calib compare", "projection difference of two camera models: has the camera drifted?", tsuya_command_calib_compare},
    {"calib color", "white balance, colour matrix and vignetting from a 24-patch chart and grey cards", tsuya_command_calib_color},
    {"reconstruct", "photographs to a cloud and a surface", tsuya_command_reconstruct},
    {"weave image", "thread directions, periods and confidence of a photograph, patch by patch", tsuya_command_weave_image},
    {"weave mesh", "lifts the threads of all photographs to one weft field on the surface", tsuya_command_weave_mesh},
    {"brdf eval", "reads directions on stdin, writes a material's reflectance", tsuya_command_brdf_eval},
    {"brdf fit", "fits a material to measured reflectance", tsuya_command_brdf_fit},
    {"brdf compare", "fits every model to the same samples: error beside time and size", tsuya_command_brdf_compare},
    {"brdf plan", "the stage angles whose readings tell most, from names, a material or the readings so far", tsuya_command_brdf_plan},
    {"brdf export", "a material as other renderers read it: RGL tensors or MERL, with its loss", tsuya_command_brdf_export},
    {"brdf plot", "a material and its samples as curves, as a surface and as polar diagrams", tsuya_command_brdf_plot},
    {"brdf predict", "reflectance from the fibre's cross-section and the weave", tsuya_command_brdf_predict},
    {"render", "shades a mesh with its weft field and materials", tsuya_command_render},
    {"bench", "speed against error, stage by stage, with peers in the same run", tsuya_command_bench},
    {NULL, NULL, NULL},
};

/* Commands of the interface that later versions bring. */
const char *const tsuya_later_commands[] = {
    "calib light", NULL,
};
