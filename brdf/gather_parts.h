/* Inside the gathering: readings, and a place under lamps. */
#ifndef TSUYA_BRDF_GATHER_PARTS_H
#define TSUYA_BRDF_GATHER_PARTS_H

#include "brdf/gather.h"
#include "core/raster.h"

enum { GATHER_LAMPS = 16 };

/* One photograph's pixels in one patch and one cell of directions. */
typedef struct gather_reading {
    uint64_t cell;
    uint32_t patch;
    int photo, pixels;
    float wi[3], wo[3];                       /* sums over the pixels until the photograph is done, then means */
    float value[3], square, other[3];         /* radiance over irradiance, green's square, irradiance of the rest over the lamp's */
} gather_reading;

typedef struct gather_shadow { /* what one emitter sees */
    tsuya_raster raster;
    tsuya_camera camera;
    tsuya_pose pose;
    double texel; /* width of a pixel at unit depth */
} gather_shadow;

struct tsuya_gather {
    const tsuya_mesh *mesh;
    tsuya_gather_options options;
    tsuya_vec3 middle;
    double radius_m, edge_m;
    uint32_t *patch; /* a vertex */
    uint32_t patches;
    gather_reading *reading;
    size_t count, room;
    int photos;
};

TSUYA_MUST_CHECK tsuya_status tsuya_gather_shadows(gather_shadow **shadow, const tsuya_gather *g, const tsuya_gather_lamps *lamps,
                                                   const tsuya_context *context);
void tsuya_gather_shadows_free(gather_shadow *shadow, int count);

/* Light at a place: of its strongest lamp, and of the rest. */
typedef struct gather_light {
    tsuya_vec3 wi;                 /* mean direction, world */
    double irradiance[3], other[3];
    bool whole;                    /* every piece of the lamp is seen */
    double share;                  /* of the strongest lamp among all light */
} gather_light;
gather_light tsuya_gather_light(const tsuya_gather *g, const tsuya_gather_lamps *lamps, const gather_shadow *shadow, tsuya_vec3 p, tsuya_vec3 n);

/* The surface's frame at a pixel of a raster. */
typedef struct gather_place { tsuya_vec3 p, n, weft; uint32_t vertex; } gather_place;
bool tsuya_gather_place(gather_place *place, const tsuya_gather *g, const tsuya_raster *raster, const tsuya_camera *camera, tsuya_pose pose, int x, int y);
/* Of a world direction. */
static inline tsuya_vec3 gather_local(const gather_place *at, tsuya_vec3 w)
{
    return (tsuya_vec3){tsuya_vec3_dot(w, at->weft), tsuya_vec3_dot(w, tsuya_vec3_cross(at->n, at->weft)), tsuya_vec3_dot(w, at->n)};
}

#endif
