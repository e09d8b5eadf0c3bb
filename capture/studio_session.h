/* A whole session in the studio: a folder of photographs and masks, JOB.yaml, and truth/ beside them.
 *
 * DIR/photos, DIR/masks, DIR/JOB.yaml                          what a job sees
 * DIR/truth/{mesh.ply, sparse/, camera.cameramodel, lights.json} what it is held against */
#ifndef TSUYA_CAPTURE_STUDIO_SESSION_H
#define TSUYA_CAPTURE_STUDIO_SESSION_H

#include "capture/studio.h"
#include "capture/studio_sensor.h"
#include "core/memory.h"

enum { TSUYA_STUDIO_RINGS = 3 };

typedef struct tsuya_studio_session {
    tsuya_studio_drape drape;
    tsuya_studio_weave weave;
    tsuya_studio_sensor sensor; /* full_radiance is set so that the brightest cloth does not clip */
    int width_px, height_px;
    double focal_px;            /* true; EXIF tells it as a whole number of 35 mm equivalents */
    double k1;                  /* radial distortion of the lens */
    int ring_views[TSUYA_STUDIO_RINGS];
    double ring_elevation_deg[TSUYA_STUDIO_RINGS], ring_distance_m[TSUYA_STUDIO_RINGS];
    int spp, light_samples, jpeg_quality;
} tsuya_studio_session;

/* 24 photographs of 800 × 600. */
TSUYA_API tsuya_studio_session tsuya_studio_session_default(void);
/* Draws and writes.  A folder that holds the same session whole is left as it is. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_studio_session_write(const tsuya_studio_session *session, const char *folder,
                                                                   const tsuya_context *context);
/* The poses, in the order of the photographs; `count` of them in the arena. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_studio_session_poses(tsuya_pose **poses, int *count, const tsuya_studio_session *session,
                                                                   uint64_t seed, tsuya_arena *arena);
TSUYA_API tsuya_camera tsuya_studio_session_camera(const tsuya_studio_session *session);

#endif
