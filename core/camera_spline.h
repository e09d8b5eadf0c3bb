/* The splined lens behind tsuya_camera_project and tsuya_camera_unproject. */
#ifndef TSUYA_CORE_CAMERA_SPLINE_H
#define TSUYA_CORE_CAMERA_SPLINE_H

#include "core/camera.h"

bool tsuya_camera_spline_project(const tsuya_camera *camera, tsuya_vec3 p_camera, tsuya_vec2 *pixel);
bool tsuya_camera_spline_unproject(const tsuya_camera *camera, tsuya_vec2 pixel, tsuya_vec3 *ray);

#endif
