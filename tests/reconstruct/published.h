/* Real photographs with published cameras, as a folder of photographs and a COLMAP text model (tests only). */
#ifndef TSUYA_TESTS_RECONSTRUCT_PUBLISHED_H
#define TSUYA_TESTS_RECONSTRUCT_PUBLISHED_H

#include "core/camera.h"

/* Middlebury's NAME_par.txt: how many, then on each line a name, K, R and t with x = K [R t] X; all of one size. */
TSUYA_MUST_CHECK tsuya_status published_middlebury(tsuya_sparse_model *model, const char *parameters, int width_px, int height_px);

/* FOLDER/NAME.jpg.camera: K, a row of zeros, R from camera to world, the centre, width and height; the photographs are
 * `reduced` times smaller than the cameras say. */
TSUYA_MUST_CHECK tsuya_status published_strecha(tsuya_sparse_model *model, const char *folder, int reduced);

/* Links to the model's photographs FROM/NAME in FOLDER/photos, and FOLDER/poses with cameras.txt and images.txt. */
TSUYA_MUST_CHECK tsuya_status published_lay_out(const tsuya_sparse_model *model, const char *from, const char *folder);

#endif
