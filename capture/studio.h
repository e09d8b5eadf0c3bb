/* The virtual studio: a cloth whose shape, threads and dye are known, lamps, and photographs of it.
 *
 * Everything that a job is later held against is known here exactly: the surface and its weft field, the cameras, the lamps.
 * The photographs share nothing with the reconstruction, the weave detection or the reflectance models beyond core's
 * cameras and render's rays against a mesh. */
#ifndef TSUYA_CAPTURE_STUDIO_H
#define TSUYA_CAPTURE_STUDIO_H

#include "capture/microcylinder.h"
#include "capture/studio_prop.h"
#include "core/camera.h"
#include "core/context.h"
#include "core/image.h"
#include "core/mesh.h"
#include "render/light.h"

/* A cloth in space.  u runs along the weft and v along the warp in the flat cloth, metres. */
typedef struct tsuya_studio_cloth {
    tsuya_mesh mesh;  /* position, normal, weft (unit tangents along u) */
    float *warp;      /* 3 × vertex_count, unit tangents along v; with shear they are not perpendicular to the weft */
    float *uv;        /* 2 × vertex_count */
} tsuya_studio_cloth;
TSUYA_API void tsuya_studio_cloth_free(tsuya_studio_cloth *cloth);

/* A square cloth (a fukusa) that lies on a round stand and hangs over its edge in folds; a closed form, no simulation:
 * lengths around the stand are kept roughly (the hanging part has 0.8 of the flat cloth's area).  Frame: z up, the floor at 0, the stand's axis at x = y = 0. */
typedef struct tsuya_studio_drape {
    double side_m, stand_radius_m, stand_height_m;
    double edge_radius_m;  /* of the bend over the stand's edge */
    int folds;
    double spacing_m;      /* between vertices, in the flat cloth */
} tsuya_studio_drape;
TSUYA_API tsuya_studio_drape tsuya_studio_drape_default(void);
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_studio_drape_create(tsuya_studio_cloth *cloth, const tsuya_studio_drape *options);
/* The closed form itself. */
TSUYA_API tsuya_vec3 tsuya_studio_drape_at(const tsuya_studio_drape *options, double u_m, double v_m);

/* Dye and threads.  The weave is a weft-faced satin: every weft passes over four warps and under one. */
typedef struct tsuya_studio_weave {
    double weft_pitch_m, warp_pitch_m; /* from one yarn to the next of its kind */
    double unevenness;                 /* of the yarns' brightness, standard deviation */
    uint64_t seed;
    double half_side_m;                /* where the border of the pattern runs */
    const float *plain;                /* one dye (linear Rec.709) instead of the pattern; borrowed, NULL: the pattern */
} tsuya_studio_weave;
TSUYA_API tsuya_studio_weave tsuya_studio_weave_default(void);

typedef struct tsuya_studio_yarn {
    float albedo[3];      /* linear Rec.709: dye times shade */
    float dye[3], shade;  /* shade: by the yarn's own brightness and the hollows beside it */
    double across, along; /* slope of the yarn's surface: tangent of the normal's tilt across the yarn and along it */
    bool is_weft;
} tsuya_studio_yarn;
/* What lies on top at a point of the flat cloth. */
TSUYA_API tsuya_studio_yarn tsuya_studio_weave_at(const tsuya_studio_weave *weave, double u_m, double v_m);
/* Mean albedo around a point, without threads. */
TSUYA_API void tsuya_studio_dye_at(const tsuya_studio_weave *weave, double u_m, double v_m, float rgb[3]);

/* The cloth and the things around it, lit. */
typedef struct tsuya_studio tsuya_studio;
enum { TSUYA_STUDIO_LAMPS = 8 };
typedef struct tsuya_studio_options {
    int samples;                       /* rays for each lamp and for the rest at each vertex; 25 give about 5 % in the soft parts */
    const tsuya_studio_prop *prop;     /* borrowed */
    int prop_count;
    const tsuya_microcylinder *cloth;  /* how the cloth scatters (its volume part takes the dye's colour); NULL: yarns are matt */
} tsuya_studio_options;
/* Borrows cloth (NULL: none), weave, lights and what the options point to.  Shadows and one reflection between surfaces are found
 * at the vertices.  Props and yarns without microcylinders scatter as matt (Lambert) surfaces.  Fails on more than
 * TSUYA_STUDIO_LAMPS lamps beside the environment. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_studio_create(tsuya_studio **studio, const tsuya_studio_cloth *cloth,
                                                            const tsuya_studio_weave *weave, const tsuya_light_set *lights,
                                                            const tsuya_studio_options *options, const tsuya_context *context);
TSUYA_API void tsuya_studio_free(tsuya_studio *studio);
/* Radiance of a facing matt surface of albedo `albedo` where the cloth (without one: everything) is lit best (95th percentile of
 * the vertices). */
TSUYA_API double tsuya_studio_white(const tsuya_studio *studio, double albedo);
/* The macroscopic reflectance of cloth of one dye as the studio shades it: BRDF in sr⁻¹, frame x weft, y warp, z normal; reciprocal.
 * Surface and volume scattering are each the geometric mean of both orders, so that the dye acts on the volume part linearly. */
TSUYA_API void tsuya_studio_reflectance(const tsuya_microcylinder *cloth, const float dye[3], tsuya_vec3 wi, tsuya_vec3 wo, double rgb[3]);

typedef struct tsuya_studio_shot {
    tsuya_camera camera;
    tsuya_pose camera_from_world;
    double aperture_m, focus_m;  /* radius of the entrance pupil (0: a pinhole), distance of the sharp plane along z */
    double vignetting;           /* light lost in the image's corners; ∝ r⁴ about the middle */
    double blur_px;              /* standard deviation of what lens and low-pass filter spread */
    int spp;                     /* rays a pixel, one through each cell of a grid; rounded down to a square number */
    uint64_t stream;
} tsuya_studio_shot;
/* Linear radiance (float RGB) through a lens, and the share of each pixel that the cloth covers (0 … 255). */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_studio_shoot(tsuya_image *radiance, tsuya_image *coverage, const tsuya_studio *studio,
                                                           const tsuya_studio_shot *shot, const tsuya_context *context);

#endif
