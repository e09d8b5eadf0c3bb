/* Reflectance out of photographs: a surface with known weft, cameras and lamps in, directions with values out.
 *
 * Every pixel that sees the surface is one reading: the surface's frame there gives wi and wo, the lamp's irradiance on it divides its
 * radiance.  Left out are pixels at silhouettes and steps, clipped ones, grazing ones (10°), and those that do not see their
 * whole lamp (shadow maps).  Readings of one photograph, one patch of the surface and one cell of directions are averaged.
 *
 * A dyed pattern is told from the surface part by what changes with the place and not with the direction: reading = S(wi, wo) + δ(place) ·
 * B(wi, wo), alternating least squares, B near 1/π.  What comes out is S for the mean dye (Σ δ = 0).
 *
 * One lamp must light a place nearly alone; the rest (other lamps, even surroundings) is taken off as from a matt surface of the mean
 * reflectance, and widens sigma. */
#ifndef TSUYA_BRDF_GATHER_H
#define TSUYA_BRDF_GATHER_H

#include "brdf/samples.h"
#include "core/camera.h"
#include "core/context.h"
#include "core/image.h"
#include "core/mesh.h"

#include <stdbool.h>
#include <stdint.h>

/* A point lamp, or a piece of a larger one. */
typedef struct tsuya_gather_emitter {
    int lamp;           /* pieces of one lamp share a number */
    bool distant;
    tsuya_vec3 place;   /* m; distant: unit, towards the lamp */
    tsuya_vec3 axis;    /* unit: the intensity falls with the cosine from it; zero: even all round */
    double rgb[3];      /* W sr⁻¹ along the axis; distant: irradiance of a facing surface, W m⁻² */
} tsuya_gather_emitter;

typedef struct tsuya_gather_lamps {
    const tsuya_gather_emitter *emitter;
    int count;
    double ambient[3];  /* even radiance of the surroundings, W m⁻² sr⁻¹ */
} tsuya_gather_lamps;

typedef struct tsuya_gather_options {
    double cell;           /* of directions, in the equal-area disc of radius 1 (0.05 is about 3° near the normal) */
    double patch_m;        /* of the surface; 0: a fiftieth of its size */
    double grazing_deg;    /* lamp and camera at least so high */
    double alone;          /* least share of its lamp in the irradiance of a place */
    double clip;           /* linear value from which a channel is clipped; its neighbours are left out too */
    int fewest_px;         /* pixels in a cell */
    int shadow_px;         /* side of a shadow map */
    bool pattern;          /* separate the dye */
} tsuya_gather_options;
/* 0.05, 0, 10°, 0.8, 0.98, 12, 512, pattern */
TSUYA_API tsuya_gather_options tsuya_gather_options_default(void);

typedef struct tsuya_gather tsuya_gather;
/* Borrows the mesh, which has normals and weft; fails where it has not. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_gather_create(tsuya_gather **gather, const tsuya_mesh *mesh, const tsuya_gather_options *options);
TSUYA_API void tsuya_gather_free(tsuya_gather *gather); /* NULL is fine */

typedef struct tsuya_gather_view {
    const tsuya_camera *camera;
    tsuya_pose camera_from_world;
    const tsuya_image *image;        /* float, linear, r g b, 1 where the sensor is full */
    const tsuya_image *mask;         /* 8 bits, 0 … 127 left out; NULL: none */
    double gain[3];                  /* radiance of a value of 1, W m⁻² sr⁻¹ */
    const tsuya_gather_lamps *lamps; /* in the world */
} tsuya_gather_view;
typedef struct tsuya_gather_counts { size_t seen, used, clipped, shadowed, shared, grazing, border; } tsuya_gather_counts; /* pixels */
/* `counts` are added to. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_gather_add(tsuya_gather *gather, tsuya_gather_counts *counts, const tsuya_gather_view *view,
                                                         const tsuya_context *context);

/* A matt patch of known reflectance beside the surface, which tells how bright a value of 1 is. */
typedef struct tsuya_gather_patch { tsuya_vec3 p, n; double albedo[3], size_m; } tsuya_gather_patch; /* size_m: even that far across; 0: not known */
/* `gain` of a view from its patches that are lit by whole lamps, seen, at least 4 pixels across, and
 * neither clipped nor dark; view->gain is not used.  `used`: how many; 0
 * leaves the gain alone. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_gather_reference(double gain[3], int *used, const tsuya_gather *gather, const tsuya_gather_view *view,
                                                               const tsuya_gather_patch *patch, int count, const tsuya_context *context);

enum { TSUYA_GATHER_SECTORS = 8, TSUYA_GATHER_TILTS = 10 }; /* of half vectors: 45° about 0, 45, …; 6° a tilt */
typedef struct tsuya_gathered {
    tsuya_samples samples;    /* r g b, brdf */
    double *sigma;            /* a row: relative standard uncertainty of its green value */
    int *photos;              /* a row: photographs that had part in it */
    double pattern_spread[3]; /* standard deviation of δ B over the surface, sr⁻¹; 0 where it was not separated */
    double mean_reflectance[3];
    int covered[TSUYA_GATHER_SECTORS][TSUYA_GATHER_TILTS]; /* rows in each cell of half vectors */
} tsuya_gathered;
/* Fails when nothing was usable. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_gather_finish(tsuya_gathered *gathered, const tsuya_gather *gather);
TSUYA_API void tsuya_gathered_free(tsuya_gathered *gathered);

/* Cell of the half vector of two directions; false beyond the last tilt. */
TSUYA_API bool tsuya_gather_cell(int *sector, int *tilt, tsuya_vec3 wi, tsuya_vec3 wo);

/* A photograph that would fill cells: where the camera stands, seen from the surface's middle (azimuth from +x, elevation from the plane z = 0). */
typedef struct tsuya_gather_wish { double azimuth_deg, elevation_deg; int cells; } tsuya_gather_wish;
/* At most `room` wishes in the order of the cells that each adds, for a camera `distance_m` away under the same lamps. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_gather_wishes(tsuya_gather_wish *wish, int *count, int room, const tsuya_gather *gather,
                                                            const tsuya_gathered *gathered, const tsuya_gather_lamps *lamps, double distance_m,
                                                            const tsuya_context *context);

#endif
