/* Points on the cloth, a wave at a time: place, shading frame, where rays leave.
 *
 * A ray leaves the point that Phong tessellation lifts onto the smooth surface of the vertex normals (Hanika, "Hacking the
 * shadow terminator", Ray Tracing Gems II, ch. 4, 2021), so that the triangles of a smooth fold do not shade each other near
 * the terminator; what is in the way is decided by tracing alone, so nothing leaks through the cloth.  Where a shading normal
 * would turn away from the viewer it is bent back to him.
 *
 * Places are summed from the first corner: edges are short, so float keeps a point as near its triangle as a ray's origin can be
 * anyway. */
#ifndef TSUYA_RENDER_SURFACE_H
#define TSUYA_RENDER_SURFACE_H

#include "render/wave.h"

/* What a hit's corners say, before it is put together. */
typedef struct tsuya_corners {
    tsuya_planes3 position[3], normal[3], weft[3]; /* weft 0: none */
    float dye[3][3][TSUYA_LANES];                   /* [corner][r g b] */
    float u[TSUYA_LANES], v[TSUYA_LANES];            /* point = (1 − u − v) a + u b + v c */
} tsuya_corners;

typedef struct tsuya_surfaces {
    int count;             /* padded: tsuya_lanes_padded */
    tsuya_planes3 p;       /* on the triangle */
    tsuya_planes3 lift;    /* from there to the smooth surface */
    tsuya_planes3 ng;      /* triangle's normal on the viewer's side */
    tsuya_planes3 x, y, n; /* shading frame: weft, warp, normal; n·wo > 0 */
    float has_weft[TSUYA_LANES]; /* 0: x, y are any tangents */
    bool dyed;                  /* else the material's own dye */
    float dye[3 * TSUYA_LANES];  /* dye[c * count + k] */
    float bias;                 /* distance that a float ray needs to clear the surface it leaves */
} tsuya_surfaces;

/* wo: to the viewer, unit; under: added to the dye of all (tsuya_shader).  count, dyed and bias of `s` are set already. */
void tsuya_surfaces_make(tsuya_surfaces *s, const tsuya_corners *corners, const tsuya_planes3 *wo, const double under[3]);
/* Seen from the other side, and no longer lifted. */
void tsuya_surfaces_turn_over(tsuya_surfaces *s);
/* Where rays towards wi (world) start; starts[k] 0 when wi leaves through the cloth (nothing gets there). */
void tsuya_surfaces_ray_origins(const tsuya_surfaces *s, const tsuya_planes3 *wi, tsuya_planes3 *origin, float *starts);

void tsuya_surfaces_to_local(const tsuya_surfaces *s, const tsuya_planes3 *world, tsuya_planes3 *local);
/* Unit. */
void tsuya_surfaces_to_world(const tsuya_surfaces *s, const tsuya_planes3 *local, tsuya_planes3 *world);

#endif
