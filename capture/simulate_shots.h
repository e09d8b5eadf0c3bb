/* Inside the simulation: its state, and one photograph after the other into its folder. */
#ifndef TSUYA_CAPTURE_SIMULATE_SHOTS_H
#define TSUYA_CAPTURE_SIMULATE_SHOTS_H

#include "capture/simulate_parts.h"
#include "capture/studio_sensor.h"

typedef struct simulation {
    const tsuya_simulate_scene *scene;
    const tsuya_context *context;
    const char *folder;
    tsuya_camera camera;
    tsuya_studio_sensor sensor;
    tsuya_studio_exif exif;
    const tsuya_microcylinder *cloth; /* how it shines; NULL: matt */
    float swatch_dye[3];
} simulation;

/* FOLDER/NAME in the scene's arena; NULL when memory is short. */
const char *tsuya_simulate_path(const simulation *s, const char *name);
TSUYA_MUST_CHECK tsuya_status tsuya_simulate_write(const simulation *s, const char *name, const char *text /* NULL: memory was short */);
TSUYA_MUST_CHECK tsuya_status tsuya_simulate_write_grid(const simulation *s, const char *name, const tsuya_scene_tags *t);
/* KIND-001.jpg */
const char *tsuya_simulate_photo_name(const simulation *s, const char *kind, int number);
tsuya_studio_shot tsuya_simulate_shot(const simulation *s, tsuya_pose pose, double focus_m, uint64_t stream);
/* One photograph, names below the folder; mask: NULL for none. */
TSUYA_MUST_CHECK tsuya_status tsuya_simulate_take(const simulation *s, const tsuya_studio *studio, const tsuya_studio_shot *shot, const char *photo,
                                                  const char *mask, uint64_t stream);
/* A COLMAP model of views with names and poses; ids are set here. */
TSUYA_MUST_CHECK tsuya_status tsuya_simulate_write_model(const simulation *s, const char *folder_name, tsuya_view *view, int count);
/* The swatch's reflectance; user: the simulation. */
void tsuya_simulate_reflect(const void *user, tsuya_vec3 wi, tsuya_vec3 wo, double rgb[3]);

/* Photographs and spectra of the swatch on the stage, as the scene asks (capture/simulate_swatch.c). */
TSUYA_MUST_CHECK tsuya_status tsuya_simulate_swatch(simulation *s, int *photos);

#endif
