/* Files of `tsuya brdf gather`: photographs, cameras, surface, lamps, patches. */
#ifndef TSUYA_APP_GATHER_INPUT_H
#define TSUYA_APP_GATHER_INPUT_H

#include "brdf/gather.h"

typedef struct tsuya_gather_paths {
    const char *photos, *poses, *surface, *lights;
    const char *masks, *reference; /* NULL: none */
    bool lamps_with_camera;
} tsuya_gather_paths;

typedef struct tsuya_gather_session {
    tsuya_gather *gather;
    tsuya_mesh mesh;
    tsuya_gather_counts counts;
    tsuya_gather_lamps lamps;          /* in the world; with lamps that go with the camera: as the last photograph had them */
    tsuya_gather_emitter *emitter, *placed;
    int photos;
    double distance_m;                 /* mean of the cameras from the surface's middle */
    bool relative;                     /* no patch told the scale */
} tsuya_gather_session;

/* Reads and gathers every photograph that the model knows. */
TSUYA_MUST_CHECK tsuya_status tsuya_gather_photos(tsuya_gather_session *session, const tsuya_gather_paths *paths, const tsuya_gather_options *options,
                                                  const tsuya_context *context);
void tsuya_gather_session_free(tsuya_gather_session *session);

#endif
