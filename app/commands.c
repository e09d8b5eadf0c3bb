#include "app/command.h"

const tsuya_command tsuya_commands[] = {
    {"demo", "photographs a draped cloth of its own, runs the whole job on that, holds it against the truth", tsuya_command_demo},
    {"run", "runs the stages of a JOB.yaml that are not done yet, and writes the report", tsuya_command_run},
    {"capture check", "sharpness, clipping and exposure of photographs; which to take again", tsuya_command_capture_check},
    {"reconstruct", "photographs to a cloud and a surface", tsuya_command_reconstruct},
    {"weave image", "weft angle, thread period and confidence per patch of a photograph", tsuya_command_weave_image},
    {"weave mesh", "one weft field on a surface out of all photographs", tsuya_command_weave_mesh},
    {"brdf eval", "reads directions on stdin, writes a material's reflectance", tsuya_command_brdf_eval},
    {"render", "shades a mesh with its weft field and materials", tsuya_command_render},
    {NULL, NULL, NULL},
};

/* Commands of the interface that later versions bring. */
const char *const tsuya_later_commands[] = {
    "capture target", "capture simulate", "calib camera", "calib compare", "calib light", "calib color", "brdf fit",
    "brdf compare", "brdf plan", "brdf predict", "brdf plot", "brdf export", "bench", NULL,
};
