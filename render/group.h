/* Lanes of a wave that are shaded together: of one shader and side, side by side; and how they reflect. */
#ifndef TSUYA_RENDER_GROUP_H
#define TSUYA_RENDER_GROUP_H

#include "render/lamps.h"
#include "render/scene.h"
#include "render/surface.h"

typedef struct tsuya_wave_group {
    int path[TSUYA_LANES], count, padded; /* path: which of the wave's */
    int depth;
    tsuya_ray_hit hit[TSUYA_LANES];
    const tsuya_shader *shader;
    const double *through; /* NULL; seen through the cloth: its transmittance */
    tsuya_corners corners;
    tsuya_surfaces s;
    tsuya_planes3 back, wo, world, wi, origin; /* back: wo in the world; world: wi in the world */
    tsuya_lamp_choice choice;
    tsuya_lamp_samples lamp;
    tsuya_lamp_rays rays;
    uint32_t key[TSUYA_LANES], sample[TSUYA_LANES];
    _Alignas(64) float u[2][TSUYA_LANES];
    _Alignas(64) float chance[2][TSUYA_LANES]; /* which lamp, which lobe */
    _Alignas(64) float pdf[TSUYA_LANES], starts[TSUYA_LANES], scale[TSUYA_LANES], share[TSUYA_LANES];
    float *f, *dye, *rest; /* a plane of `padded` numbers a channel */
    tsuya_material_looks looks;
    const tsuya_bands *spread; /* NULL: the shader's values are the path's channels; else colours, to be spread over these */
} tsuya_wave_group;

/* For the group's surfaces (g->s, g->wo, g->shader): what depends on the viewer alone.  bands NULL: r, g, b */
void tsuya_group_look(tsuya_wave_group *group, const tsuya_scene *scene);
/* f (as many planes as a path has channels) and pdf at group->wi. */
void tsuya_group_eval_pdf(tsuya_wave_group *group);
/* group->wi, from u and the second of chance; wi.z 0 where the draw ended under the surface. */
void tsuya_group_sample(tsuya_wave_group *group);
/* The group's light comes through thin cloth: what falls on its other side, as from a Lambert surface. */
void tsuya_group_turn_over(tsuya_wave_group *group);

#endif
