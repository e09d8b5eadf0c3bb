/* An analytic scene as a COLMAP dense workspace on disk. */
#ifndef TSUYA_TESTS_RECONSTRUCT_SCENE_WORKSPACE_H
#define TSUYA_TESTS_RECONSTRUCT_SCENE_WORKSPACE_H

#include "scene.h"

/* FOLDER/images/viewNN.png, FOLDER/masks/viewNN.png.png (with `masks`: where the surface is) and FOLDER/sparse with points
 * of the true surface in the views that see them. */
TSUYA_MUST_CHECK tsuya_status scene_workspace_write(const scene_pictures *s, const char *folder, bool masks);

#endif
