/* Photographs through a lens that COLMAP has no model for (OPENCV12, splined), drawn anew as a pinhole sees them.
 *
 * The pinhole stands where the camera stood and looks along its axis.  Its focal length is the lens' own scale on the axis, the larger of
 * both directions, so that the middle loses nothing; its image is the largest upright rectangle that holds only what the lens saw, at most
 * 60 degrees off the axis (a pixel there is spread over four).  Geometry is exact: a pinhole's pixel is looked up where the lens images
 * its ray.  What is lost is what lies outside (`kept`), and what resampling costs: Lanczos' kernel of six pixels, in the samples' own
 * encoding (C. E. Duchon, "Lanczos filtering in one and two dimensions", 1979). */
#ifndef TSUYA_RECONSTRUCT_PINHOLE_H
#define TSUYA_RECONSTRUCT_PINHOLE_H

#include "core/camera.h"
#include "core/context.h"
#include "core/memory.h"
#include "core/photo.h"
#include "reconstruct/scale.h"

typedef struct tsuya_pinhole_info {
    double kept;       /* share of the photograph's pixels that the pinhole sees */
    double stretch;    /* pixels of the pinhole for one of the photograph, the most anywhere, as an area */
    double closure_px; /* pinhole to lens and back, the largest distance */
} tsuya_pinhole_info;

/* True for the lenses that this is for. */
bool tsuya_pinhole_needed(const tsuya_camera *lens);
/* `name`: of the lens' file, for messages.  Fails where the lens sees less than 64 pixels around its axis. */
TSUYA_MUST_CHECK tsuya_status tsuya_pinhole_of(tsuya_camera *pinhole, tsuya_pinhole_info *info, const tsuya_camera *lens, const char *name);
/* A photograph's pixel in the pinhole's, and (NULL: not wanted) by how much lengths grow there.  False behind the pinhole. */
bool tsuya_pinhole_pixel(tsuya_vec2 *pixel, double *growth, const tsuya_camera *pinhole, const tsuya_camera *lens, tsuya_vec2 seen);

/* FOLDER/photos/NAME and, where there are masks, FOLDER/masks/NAME.png: as many bits as the photograph has; JPEG with quality 98.  Fails on
 * photographs of a format that cannot be written under its name. */
TSUYA_MUST_CHECK tsuya_status tsuya_pinhole_photos(const char *folder, const tsuya_camera *pinhole, const tsuya_camera *lens, const tsuya_photo_set *photos,
                                                   const tsuya_context *context);
/* The sightings, in the arena, as the pinhole sees them; `out` is otherwise `in`. */
TSUYA_MUST_CHECK tsuya_status tsuya_pinhole_sightings(tsuya_scale_input *out, const tsuya_scale_input *in, const tsuya_camera *pinhole,
                                                      const tsuya_camera *lens, tsuya_arena *arena);

#endif
