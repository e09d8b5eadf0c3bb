/* Where the cameras of a render stand. */
#ifndef TSUYA_RENDER_VIEWS_H
#define TSUYA_RENDER_VIEWS_H

#include "core/camera.h"
#include "core/mesh.h"

typedef struct tsuya_turntable {
    tsuya_vec3 up;        /* axis of the table; unit after tsuya_turntable_fit */
    double elevation_rad; /* of the camera over the table's plane */
    double field_rad;     /* the picture's narrower angle of view */
    int width_px, height_px;
    /* Set by tsuya_turntable_fit: */
    tsuya_vec3 center;    /* what the camera looks at */
    double distance;      /* from the center */
    double radius;        /* of the mesh around the center */
} tsuya_turntable;

/* The nearest distance at which the mesh, turned about its axis, stays within 92 % of the picture.  Fails on an empty mesh,
 * on a zero axis, and on an elevation beyond ±89°. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_turntable_fit(tsuya_turntable *table, const tsuya_mesh *mesh);
/* View k of n: azimuth 2π k / n about the axis, counter-clockwise seen from above. */
TSUYA_API void tsuya_turntable_view(const tsuya_turntable *table, int k, int n, tsuya_camera *camera, tsuya_pose *camera_from_world);

/* The mean of the cameras' upward directions (−y of each); +z where there are none or they cancel. */
TSUYA_API tsuya_vec3 tsuya_up_from_cameras(const tsuya_pose *camera_from_world, int count);

#endif
