/* A mesh ready to be shaded: rays, interpolated normals and weft, dye, and how each material reflects. */
#ifndef TSUYA_RENDER_SCENE_H
#define TSUYA_RENDER_SCENE_H

#include "brdf/material.h"

#include "core/mesh.h"

#include "render/bands.h"
#include "render/embree_adapter.h"

/* How a cloth reflects, in its own frame (x weft, y warp, z normal); wi and wo unit, wo above the surface.  dye: three
 * numbers, or NULL for the material's own.  Anything can stand behind it, not only fitted materials. */
typedef struct tsuya_shader {
    const void *user;
    /* Writes the BRDF (sr⁻¹, r g b) and returns the density of `sample`; both 0 under the surface. */
    double (*eval_pdf)(const void *user, const double *dye, tsuya_vec3 wi, tsuya_vec3 wo, double value[3]);
    /* false when the draw ended under the surface */
    bool (*sample)(const void *user, const double *dye, tsuya_vec3 wo, const double u[3], tsuya_vec3 *wi);
    /* Not NULL: the same as the two functions, which then look up once what depends on wo alone (tsuya_material_view). */
    const tsuya_material *material;
    bool spectral; /* the material's channels are the scene's bands instead of r g b */
    /* Share of the light that falls on one side and leaves the other, evenly spread (thin cloth, Lambert), both ways alike.  What
     * is reflected and this together must not exceed 1. */
    double transmittance[3];
    double under[3]; /* a diffuse part that lies with any dye, which is added to the surface's (tsuya_material_refit) */
} tsuya_shader;

/* Borrows the material.  Fails unless its channels are r, g, b or wavelengths as render/bands.h wants them. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_shader_from_material(tsuya_shader *shader, const tsuya_material *material);

typedef enum tsuya_dye_source {
    TSUYA_DYE_OF_MATERIAL, /* what was measured */
    TSUYA_DYE_OF_VERTICES, /* the mesh's vertex colours, made linear, as the dye's reflectance */
    TSUYA_DYE_OF_COLOR,    /* one colour everywhere */
} tsuya_dye_source;

typedef struct tsuya_scene_options {
    const tsuya_shader *shader; /* by the mesh's material index; a single one serves every index */
    int shader_count;
    tsuya_dye_source dye;
    double dye_rgb[3]; /* linear, for TSUYA_DYE_OF_COLOR */
    /* Colours of photographs carry their shading and can reach 1; a cloth reflects less.  Factor on vertex colours. */
    double vertex_dye_scale;
    /* Wavelengths of a spectral render, borrowed; NULL: r, g, b, and no shader is spectral.  Shaders that are not spectral reflect what
     * their colours do (render/bands.h). */
    const tsuya_bands *bands;
    const double *dye_of_bands; /* borrowed; the spectrum of dye_rgb for TSUYA_DYE_OF_COLOR; NULL: made from it */
} tsuya_scene_options;
TSUYA_API tsuya_scene_options tsuya_scene_options_default(void); /* no shader, dye of the material, scale 0.8 */

typedef struct tsuya_scene tsuya_scene;

/* Copies what it needs of the mesh; borrows what stands behind the shaders.  Normals are computed where the mesh has none;
 * zero or non-finite normals fall back to the triangle's own.  Where the weft is missing, zero, non-finite or parallel to the
 * normal, the reflectance is averaged over the azimuth (a random turn per sample); a mesh with no weft at all is said once as a
 * warning.  Fails on spectral shaders of other wavelengths than `bands`, non-finite vertices (index named), indices out of range, a material index without a shader,
 * dye outside [0, 1]. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_scene_create(tsuya_scene **scene, const tsuya_mesh *mesh,
                                                           const tsuya_scene_options *options);
TSUYA_API void tsuya_scene_free(tsuya_scene *scene);

bool tsuya_scene_intersect(const tsuya_scene *scene, const tsuya_ray *ray, tsuya_ray_hit *hit);
bool tsuya_scene_occluded(const tsuya_scene *scene, const tsuya_ray *ray);
/* As in render/embree_adapter.h. */
void tsuya_scene_intersect_packet(const tsuya_scene *scene, const tsuya_ray *ray, int count, tsuya_ray_hit *hit, bool *met);
void tsuya_scene_occluded_packet(const tsuya_scene *scene, const tsuya_ray *ray, int count, bool *occluded);
/* What stands behind the mesh's material index, borrowed; and another in its place (not while the scene is rendered). */
const tsuya_shader *tsuya_scene_shader(const tsuya_scene *scene, int index);
void tsuya_scene_set_shader(tsuya_scene *scene, int index, const tsuya_shader *shader);
/* NULL: r, g, b. */
const tsuya_bands *tsuya_scene_bands(const tsuya_scene *scene);
/* The one dye's spectrum; NULL: surfaces have dyes of their own. */
const double *tsuya_scene_dye_of_bands(const tsuya_scene *scene);
/* Ask the memory for what tsuya_scene_surfaces will want at a hit: first the one, then the other. */
void tsuya_scene_prefetch_triangle(const tsuya_scene *scene, const tsuya_ray_hit *hit);
void tsuya_scene_prefetch_vertices(const tsuya_scene *scene, const tsuya_ray_hit *hit);
/* How the cloth reflects where it was hit. */
const tsuya_shader *tsuya_scene_shader_at(const tsuya_scene *scene, const tsuya_ray_hit *hit);
/* render/surface.h: count ≤ TSUYA_LANES hits of one shader; wo unit, padded as s will be. */
struct tsuya_planes3;
struct tsuya_corners;
struct tsuya_surfaces;
void tsuya_scene_surfaces(const tsuya_scene *scene, const tsuya_ray_hit *hit, int count, const struct tsuya_planes3 *wo, const tsuya_shader *shader,
                          struct tsuya_corners *room, struct tsuya_surfaces *s);
/* Lower and upper corner of what rays can hit; low > high when empty. */
void tsuya_scene_bounds(const tsuya_scene *scene, tsuya_vec3 *low, tsuya_vec3 *high);

#endif
