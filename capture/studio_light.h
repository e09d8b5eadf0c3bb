/* Inside the studio: its surfaces (cloth and floor in one mesh) and the light that falls on them. */
#ifndef TSUYA_CAPTURE_STUDIO_LIGHT_H
#define TSUYA_CAPTURE_STUDIO_LIGHT_H

#include "capture/studio.h"
#include "render/embree_adapter.h"

enum { STUDIO_SIDES = 2 }; /* 0: the side of the normal */
enum { STUDIO_RELIEF_Z = 16, STUDIO_RELIEF_PHI = 16 }; /* cosines (i + ½) / 16, azimuths 22.5° k from the weft */

struct tsuya_studio {
    const tsuya_studio_cloth *cloth; /* borrowed, as are weave and lights */
    const tsuya_studio_weave *weave;
    const tsuya_light_set *lights;
    const tsuya_studio_prop *prop;
    int prop_count;
    const tsuya_microcylinder *gloss; /* NULL: matt yarns */
    tsuya_microcylinder split;        /* gloss with an albedo in its first channel alone: surface and volume come apart */
    double weave_shade;      /* of the yarns' mean: shade times cosine to the cloth's normal */
    float relief[STUDIO_RELIEF_Z][STUDIO_RELIEF_PHI]; /* mean over the weave of shade times cosine to a lamp, over the cloth's own cosine */
    double reflected[2];     /* of microcylinders: what surface and volume (of white dye) send back of even light */
    tsuya_mesh mesh;         /* the cloth's vertices first, then the props' */
    size_t cloth_vertices, cloth_triangles;
    tsuya_ray_scene *rays;
    int lamp_count;          /* lamps that are no environment */
    int lamp[TSUYA_STUDIO_LAMPS];
    /* By side and vertex: for every lamp the direction-weighted sum of what arrives, so that the irradiance of a surface
     * turned to n is max(0, n·v) times the lamp's rgb; and the irradiance from the rest. */
    tsuya_vec3f *arriving;   /* (side · vertices + vertex) · lamp_count + lamp */
    float *visible;          /* like arriving: share of the lamp that is not covered */
    float *ambient, *direct; /* 3 each; direct: of all lamps, on the vertex' own normal */
};

/* Fills arriving, direct, ambient. */
TSUYA_MUST_CHECK tsuya_status tsuya_studio_light(tsuya_studio *studio, int samples, const tsuya_context *context);

/* What a camera ray stands for: a square of the sensor about `axis`, seen from the whole pupil about `eye`. */
typedef struct studio_beam {
    tsuya_vec3 eye, axis;       /* unit */
    double width;               /* of the square, at a distance of one */
    double depth;               /* along the camera's axis, at a distance of one */
    double aperture_m, focus_m; /* radius of the pupil; depth of the sharp plane */
} studio_beam;

/* Linear light that a camera ray finds where it meets something; `cache` serves the rays of one pixel (zero it first). */
typedef struct studio_cache {
    bool filled;
    tsuya_vec3 n, wi[TSUYA_STUDIO_LAMPS];
    double surface[TSUYA_STUDIO_LAMPS][3], volume[TSUYA_STUDIO_LAMPS][3]; /* radiance under the whole lamp, of white dye */
} studio_cache;
void tsuya_studio_shade(const tsuya_studio *studio, const tsuya_ray_hit *hit, tsuya_vec3 p, tsuya_vec3 direction, const studio_beam *beam,
                        studio_cache *cache, double rgb[3]);
/* weave_shade and reflected. */
void tsuya_studio_measure_gloss(tsuya_studio *studio);

/* What the cloth's dye or a prop reflects at a triangle's point, linear.  With a beam, print over what the beam stands for. */
void tsuya_studio_albedo(const tsuya_studio *studio, const tsuya_ray_hit *hit, const studio_beam *beam, float rgb[3]);
static inline void tsuya_studio_weights(const tsuya_ray_hit *hit, double weight[3])
{
    weight[0] = 1.0 - (double)hit->u - (double)hit->v;
    weight[1] = (double)hit->u;
    weight[2] = (double)hit->v;
}
/* Interpolated, not unit. */
tsuya_vec3 tsuya_studio_interpolate(const float *vectors, const uint32_t *triangle, const double weight[3]);

#endif
