/* What a render needs before its first ray: mesh, materials, scene, the list of pictures. For render/render.c. */
#ifndef TSUYA_RENDER_SETUP_H
#define TSUYA_RENDER_SETUP_H

#include "core/memory.h"

#include "render/detail.h"
#include "render/preset.h"
#include "render/reflectance.h"
#include "render/render.h"
#include "render/scene.h"

typedef struct tsuya_render_frame {
    const char *name;   /* of the files, without extension */
    const char *source; /* "turntable 3 of 12", the .cameramodel or the photograph */
    tsuya_camera camera;
    tsuya_pose camera_from_world;
    const char *photo, *mask; /* to compare with; NULL: none */
    bool held_out;
    int index;                /* in the sequence */
} tsuya_render_frame;

typedef struct tsuya_render_setup {
    tsuya_mesh mesh;
    tsuya_mesh coarse; /* what the scene is made of; no vertices: the mesh itself */
    tsuya_detail_info detail;
    tsuya_material **material;
    int material_count;
    tsuya_material **simple;   /* by material: what stands for it; NULL entries: itself */
    tsuya_reflectance_choice *choice; /* by material */
    bool default_material;
    tsuya_scene *scene;
    tsuya_dye_source dye;
    double dye_rgb[3];
    double vertex_dye_scale;
    tsuya_bands *bands;        /* NULL: no material is spectral */
    double *dye_of_bands;      /* with bands and one colour: its spectrum */
    tsuya_light_set lights; /* of the file; empty with the studio */
    bool studio;
    tsuya_light_preset preset; /* stands for the file */
    uint64_t seed;             /* of a preset that flickers */
    tsuya_vec3 up, center;
    double radius;
    tsuya_render_frame *frame;
    int frame_count;
    tsuya_arena *arena;
} tsuya_render_setup;

/* A table of nm,reflectance at other wavelengths, linear between its rows, held beyond them (render/dye_color.c). */
TSUYA_MUST_CHECK tsuya_status tsuya_render_load_reflectance(double *at, const double *nm, int count, const char *path);

/* Leaves an empty setup on failure. */
TSUYA_MUST_CHECK tsuya_status tsuya_render_setup_create(tsuya_render_setup *setup, const tsuya_render_options *options, const tsuya_context *context);
void tsuya_render_setup_free(tsuya_render_setup *setup);
/* The lamps of one picture: the file's (borrowed) or the studio around its camera; tsuya_render_setup_lights_free. */
TSUYA_MUST_CHECK tsuya_status tsuya_render_setup_lights(tsuya_light_set *lights, const tsuya_render_setup *setup,
                                                        const tsuya_render_frame *frame);
void tsuya_render_setup_lights_free(tsuya_light_set *lights, const tsuya_render_setup *setup);

#endif
