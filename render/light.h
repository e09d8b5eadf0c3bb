/* Lamps: point, spot, directional, disk, rectangle, environment; and the default studio.
 *
 * rgb is radiant intensity (W sr⁻¹) for point and spot, irradiance on a facing surface (W m⁻²) for directional, radiance
 * (W m⁻² sr⁻¹) for disk, rect and environment; linear Rec.709.  `direction` is where the lamp shines to (for an environment
 * map: what its centre column shows).  Disks and rectangles shine from the side of `direction` alone, evenly (Lambert). */
#ifndef TSUYA_RENDER_LIGHT_H
#define TSUYA_RENDER_LIGHT_H

#include "core/geometry.h"
#include "core/json.h"

#include "render/environment.h"
#include "render/lamp_spectrum.h"

typedef enum tsuya_light_kind {
    TSUYA_LIGHT_POINT,
    TSUYA_LIGHT_SPOT,
    TSUYA_LIGHT_DIRECTIONAL,
    TSUYA_LIGHT_DISK,
    TSUYA_LIGHT_RECT,
    TSUYA_LIGHT_ENVIRONMENT,
} tsuya_light_kind;

typedef struct tsuya_light {
    tsuya_light_kind kind;
    tsuya_vec3 position_m, direction; /* direction unit after tsuya_light_set_add */
    tsuya_vec3 up;          /* rect: along size_m[1]; environment: the top row */
    double size_m[2];       /* rect: width (along direction × up) and height; disk: diameter in [0] */
    double cone_rad[2];     /* spot: full intensity within [0], none beyond [1], angles from the axis, smooth between */
    double rgb[3];          /* environment with a map: factor on the map */
    /* NULL: the colour alone is known.  Else rgb is its colour, and its luminance the level; a spectral picture uses the spectrum
     * itself.  Not with a map. */
    tsuya_lamp_spectrum *spectrum; /* owned by the set */
    /* Set by tsuya_light_set_add: */
    tsuya_vec3 side;        /* unit, direction × up */
    double area_m2, reach_m; /* reach: half the lamp's diagonal */
    double luminance;       /* of rgb, of the map's mean for maps */
    tsuya_environment *map; /* owned by the set; NULL for a constant environment */
} tsuya_light;

typedef struct tsuya_light_set {
    tsuya_light *light;
    int count;
} tsuya_light_set;

/* Copies the lamp into the set and takes the map's and the spectrum's ownership (also on failure).  Fails on zero or non-finite directions,
 * sizes, cones and negative rgb; `name` is for messages.  An environment without direction and up looks along +x with +z up. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_light_set_add(tsuya_light_set *set, const tsuya_light *light, const char *name);
TSUYA_API void tsuya_light_set_free(tsuya_light_set *set);

/* {"lights": [{"type": "point|spot|directional|disk|rect|environment", "position_m", "direction", "up", "size_m",
 * "cone_deg": [inner, outer], "rgb", "spectrum", "file"}]}.  With "spectrum" (render/lamp_spectrum.h) the luminance of "rgb" is the level and the colour is the spectrum's.
 * "file" and a table of "spectrum" are relative to the document's folder.  disk: size_m [diameter] or
 * [diameter, diameter].  Unknown keys are refused with the nearest known one. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_light_set_load(tsuya_light_set *set, const char *path);
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_light_set_parse(tsuya_light_set *set, const char *text, const char *name_for_messages,
                                                              const char *folder);

/* A soft studio around a subject, standing with the camera: a key rectangle high on the camera's left, a fill on its right,
 * a dim constant environment.  A white surface at `center` that faces the key has radiance near 1. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_light_set_studio(tsuya_light_set *set, tsuya_vec3 center, double radius_m,
                                                               tsuya_vec3 eye, tsuya_vec3 up);

/* The lamp's colour becomes the spectrum's, its luminance stays.  `folder`: of a table. */
TSUYA_MUST_CHECK tsuya_status tsuya_light_take_spectrum(tsuya_light *light, const char *name, const char *folder);
/* Gives every lamp of the set this spectrum, at its level. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_light_set_give_spectrum(tsuya_light_set *set, const char *name);

/* Light that arrives at a point from one lamp. */
typedef struct tsuya_light_sample {
    tsuya_vec3 wi;     /* unit, to the lamp */
    double distance_m; /* INFINITY for directional and environment */
    double rgb[3];     /* with `delta`: irradiance on a facing surface; else radiance along wi */
    double pdf;        /* sr⁻¹; 1 with `delta` */
    bool delta;
} tsuya_light_sample;

/* false when nothing arrives (behind the lamp, outside the cone).  n: the receiving normal (a constant environment is drawn
 * by its cosine). */
bool tsuya_light_sample_at(const tsuya_light *light, tsuya_vec3 p, tsuya_vec3 n, const double u[2], tsuya_light_sample *sample);
/* Radiance of a disk, rectangle or environment along a ray, its distance, and the density of tsuya_light_sample_at from this
 * origin; false where the ray misses it (always for the others). */
bool tsuya_light_hit(const tsuya_light *light, tsuya_vec3 origin, tsuya_vec3 n, tsuya_vec3 direction, double *distance_m,
                     double rgb[3], double *pdf);
/* That radiance alone. */
void tsuya_light_radiance(const tsuya_light *light, tsuya_vec3 direction, double rgb[3]);
/* A guess of the light's irradiance at p with normal n, for the choice between lamps; > 0 wherever light can arrive. */
double tsuya_light_weight(const tsuya_light *light, tsuya_vec3 p, tsuya_vec3 n);

#endif
