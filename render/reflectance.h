/* The cheapest reflectance model that shows the same at the size of a pixel.
 *
 * A pixel shows the mean of f cosθ over the normals and wefts that it covers; where that is a fold or more, much of what tells one model
 * from another is gone.  So pixels are drawn from the pictures, each with 16 rays; lamps are stood in 16 directions over each, half of
 * them where the material itself reflects its light to the viewer, half anywhere by the cosine; and what a pixel shows by the material and by a cheaper
 * model of it (tsuya_material_refit) is compared on cube roots, as everywhere:
 *
 *     error = sqrt( Σ (∛L′ − ∛L)² / Σ (∛L)² )    over pixels, lamps and channels
 *
 * A coming and going of the single pixel is not told, nor light that has been reflected before. */
#ifndef TSUYA_RENDER_REFLECTANCE_H
#define TSUYA_RENDER_REFLECTANCE_H

#include "core/camera.h"
#include "core/context.h"

#include "render/scene.h"

enum { TSUYA_REFLECTANCE_CANDIDATES = 5 };

typedef struct tsuya_reflectance_view {
    const tsuya_camera *camera;
    tsuya_pose camera_from_world;
} tsuya_reflectance_view;

typedef struct tsuya_reflectance_choice {
    const char *model;   /* static string; the material's own where nothing cheaper serves */
    double error;        /* of it; 0 for the material itself */
    int pixels;          /* that were compared */
    int tried;           /* cheaper models, in the order of their cost, up to the one that serves */
    const char *candidate[TSUYA_REFLECTANCE_CANDIDATES];
    double candidate_error[TSUYA_REFLECTANCE_CANDIDATES];
} tsuya_reflectance_choice;

/* simple: the chosen model (tsuya_material_free), with what belongs in its shader's `under`; NULL: the material stays.  It stays where
 * fewer than 32 of 8192 drawn pixels show it, where the shader is no material in r, g, b, and for models that nothing is cheaper than.
 * Cost: up to a second a candidate.  A function of the scene, the views and context->seed. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_reflectance_choose(tsuya_material **simple, double under[3], tsuya_reflectance_choice *choice,
                                                                 const tsuya_scene *scene, int material, const tsuya_reflectance_view *view,
                                                                 int view_count, double tolerance, const tsuya_context *context);

#endif
