/* Scenes that the tests and the bench of render/ share. */
#ifndef TSUYA_TESTS_RENDER_SCENES_H
#define TSUYA_TESTS_RENDER_SCENES_H

#include "core/mesh.h"

#include "render/path.h"

/* z = 0, [−side/2, side/2]², cells × cells quads, weft along x, normals up. */
void scene_plane(tsuya_mesh *mesh, double side, int cells);
/* The weft turns once every so many metres along x. */
void scene_turn_weft(tsuya_mesh *mesh, double every_m);
/* Longitude–latitude sphere with smooth normals and weft along the parallels; flat: no vertex normals' smoothness (exact
 * triangle normals cannot be shared, so the normals are zero there and the renderer falls back to the triangle's). */
void scene_sphere(tsuya_mesh *mesh, double radius, int rows, bool flat);
/* Cube of side 2 around the origin, triangles facing inwards. */
void scene_cube(tsuya_mesh *mesh);
/* A cloth hung over a ball: folds in all directions, about 2 · cells² triangles, weft and vertex colours. */
void scene_drape(tsuya_mesh *mesh, int cells);

/* A pinhole camera at `eye` that looks at `target`. */
void scene_camera(tsuya_camera *camera, tsuya_pose *pose, tsuya_vec3 eye, tsuya_vec3 target, double field_deg, int width, int height);

/* Renders; fails the test on an error. */
tsuya_film scene_render(const tsuya_mesh *mesh, const tsuya_shader *shader, const tsuya_light_set *lights, const tsuya_camera *camera,
                        tsuya_pose pose, const tsuya_path_options *options, int threads);
/* The same with wavelengths; NULL: r, g, b. */
tsuya_film scene_render_bands(const tsuya_mesh *mesh, const tsuya_shader *shader, const tsuya_bands *bands, const tsuya_light_set *lights,
                              const tsuya_camera *camera, tsuya_pose pose, const tsuya_path_options *options, int threads);
/* Mean of a channel over the picture, and the standard error of the luminance's mean. */
double film_mean(const tsuya_film *film, int channel);
double film_mean_error(const tsuya_film *film);

/* Defaults with these. */
tsuya_path_options options_of(int spp, int bounces);

/* A lamp added to a set; fails the test on an error. */
void add_light(tsuya_light_set *set, tsuya_light light);
/* Twenty lamps of every kind. */
void twenty_lamps(tsuya_light_set *lights);
/* A Lambert shader; its material is kept until the program ends. */
tsuya_shader lambert(double reflectance);

#endif
