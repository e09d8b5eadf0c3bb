/* The simulated job put together and written. */
#include "capture/simulate_shots.h"

#include "capture/studio_goniometer.h"
#include "core/file.h"
#include "core/json.h"
#include "core/memory.h"

#include <math.h>
#include <string.h>

static const double WHITE = 1.15; /* albedo that fills the well at 0 EV */
static const float SWATCH_DYE[3] = {0.36f, 0.30f, 0.25f};

const char *tsuya_simulate_path(const simulation *s, const char *name) { return tsuya_arena_printf(s->scene->arena, "%s/%s", s->folder, name); }

tsuya_status tsuya_simulate_write(const simulation *s, const char *name, const char *text)
{
    const char *path = tsuya_simulate_path(s, name);
    return path && text ? tsuya_file_write(path, text, strlen(text)) : TSUYA_ERROR_MEMORY;
}

const char *tsuya_simulate_photo_name(const simulation *s, const char *kind, int number)
{
    return tsuya_arena_printf(s->scene->arena, "%s-%03d.%s", kind, number + 1, s->scene->camera.format);
}

static void set_camera(simulation *s)
{
    const tsuya_scene_camera *c = &s->scene->camera;
    double equivalent = s->camera.fx_px * 43.2666 / hypot(s->camera.width_px, s->camera.height_px);
    s->sensor = (tsuya_studio_sensor){.full_radiance = 1.0, .full_well_e = c->full_well_e, .read_noise_e = c->read_noise_e, .bayer = c->bayer,
                                      .deep = strcmp(c->format, "tif") == 0};
    s->exif = (tsuya_studio_exif){.make = "tsuya", .model = "virtual studio", .taken = "2026:01:01 12:00:00",
                                  .focal_mm = round(equivalent) * c->sensor_mm / 36.0, .focal_35mm = (int)lround(equivalent), .exposure_s = 1.0 / 60.0,
                                  .f_number = c->f_number > 0.0 ? c->f_number : 22.0, .iso = 200};
}

tsuya_studio_shot tsuya_simulate_shot(const simulation *s, tsuya_pose pose, double focus_m, uint64_t stream)
{
    const tsuya_scene_camera *c = &s->scene->camera;
    double focal_m = 1e-3 * s->camera.fx_px * c->sensor_mm / s->camera.width_px;
    return (tsuya_studio_shot){.camera = s->camera, .camera_from_world = pose, .aperture_m = c->f_number > 0.0 ? 0.5 * focal_m / c->f_number : 0.0,
                               .focus_m = focus_m, .vignetting = c->vignetting, .blur_px = c->blur_px, .spp = c->spp, .stream = SIMULATE_SHOTS + stream};
}

static tsuya_status save_mask(const tsuya_image *coverage, const char *path)
{
    tsuya_image mask;
    TSUYA_TRY(tsuya_image_copy(&mask, coverage));
    for (int y = 0; y < mask.height_px; y++) {
        for (int x = 0; x < mask.width_px; x++) {
            *tsuya_image_u8(&mask, x, y) = *tsuya_image_u8(coverage, x, y) > 127 ? 255 : 0;
        }
    }
    tsuya_status status = tsuya_image_save(&mask, path, NULL);
    tsuya_image_free(&mask);
    return status;
}

/* One photograph; mask: NULL for none. */
tsuya_status tsuya_simulate_take(const simulation *s, const tsuya_studio *studio, const tsuya_studio_shot *shot, const char *photo, const char *mask, uint64_t stream)
{
    tsuya_image radiance = {0}, coverage = {0}, photograph = {0};
    const char *photo_path = photo ? tsuya_simulate_path(s, photo) : NULL, *mask_path = mask ? tsuya_simulate_path(s, mask) : NULL;
    tsuya_status status = photo_path ? TSUYA_OK : TSUYA_ERROR_MEMORY;
    TSUYA_GOTO_DONE(status, status);
    TSUYA_GOTO_DONE(status, tsuya_studio_shoot(&radiance, &coverage, studio, shot, s->context));
    TSUYA_GOTO_DONE(status, tsuya_studio_develop(&photograph, &radiance, &s->sensor, SIMULATE_NOISE + stream, s->context));
    if (s->sensor.deep) {
        TSUYA_GOTO_DONE(status, tsuya_image_save(&photograph, photo_path, NULL));
    } else {
        TSUYA_GOTO_DONE(status, tsuya_studio_save_jpeg(&photograph, photo_path, s->scene->camera.jpeg_quality, &s->exif));
    }
    status = mask_path ? save_mask(&coverage, mask_path) : TSUYA_OK;
done:
    tsuya_image_free(&radiance);
    tsuya_image_free(&coverage);
    tsuya_image_free(&photograph);
    return status;
}

static tsuya_status photograph_cloth(simulation *s, const tsuya_studio *studio, const simulate_view *view, int count)
{
    s->sensor.full_radiance = tsuya_studio_white(studio, WHITE) / exp2(s->scene->camera.exposure_ev);
    for (int i = 0; i < count; i++) {
        const char *name = tsuya_simulate_photo_name(s, view[i].close_up ? "close" : "shot", i);
        tsuya_studio_shot shot = tsuya_simulate_shot(s, view[i].camera_from_world, view[i].focus_m, (uint64_t)i);
        tsuya_progress_update(s->context, "photographs", i, count, NULL);
        if (!name) {
            return TSUYA_ERROR_MEMORY;
        }
        const char *photo = tsuya_arena_printf(s->scene->arena, "photos/%s", name);
        const char *mask = tsuya_arena_printf(s->scene->arena, "masks/%.*s.png", (int)(strlen(name) - 4), name);
        TSUYA_TRY(tsuya_simulate_take(s, studio, &shot, photo, mask, (uint64_t)i));
    }
    return TSUYA_OK;
}

/* The board alone, under a lamp that stands with the camera. */
static tsuya_status photograph_board(simulation *s, int i)
{
    const tsuya_scene_tags *b = &s->scene->board;
    tsuya_studio_grid grid = {b->family, b->border_bits, b->cols, b->rows, b->first_id, b->tag_mm, b->gap_mm};
    tsuya_studio_prop prop = {0};
    tsuya_light_set lights = {0};
    tsuya_studio *studio = NULL;
    double distance;
    tsuya_pose pose = tsuya_simulate_board_pose(&distance, s->scene, &s->camera, i, s->context->seed);
    tsuya_studio_options options = {.samples = 16, .prop = &prop, .prop_count = 1};
    tsuya_light lamp = {.kind = TSUYA_LIGHT_RECT, .position_m = {-distance, -distance, -0.5 * distance}, .direction = {1, 1, 1.5}, .up = {0, -1, 0},
                        .size_m = {distance, distance}, .rgb = {6, 6, 6}};
    tsuya_light room = {.kind = TSUYA_LIGHT_ENVIRONMENT, .rgb = {0.4, 0.4, 0.4}};
    const char *name = tsuya_simulate_photo_name(s, "board", i);
    uint64_t stream = 2000 + (uint64_t)i;
    tsuya_status status = name ? TSUYA_OK : TSUYA_ERROR_MEMORY;
    TSUYA_GOTO_DONE(status, status);
    TSUYA_GOTO_DONE(status, tsuya_studio_prop_tags(&prop, pose, &grid));
    TSUYA_GOTO_DONE(status, tsuya_light_set_add(&lights, &lamp, "board"));
    TSUYA_GOTO_DONE(status, tsuya_light_set_add(&lights, &room, "board"));
    TSUYA_GOTO_DONE(status, tsuya_studio_create(&studio, NULL, NULL, &lights, &options, s->context));
    s->sensor.full_radiance = tsuya_studio_white(studio, 0.95);
    tsuya_studio_shot shot = tsuya_simulate_shot(s, tsuya_pose_identity(), distance, stream);
    status = tsuya_simulate_take(s, studio, &shot, tsuya_arena_printf(s->scene->arena, "board/%s", name), NULL, stream);
done:
    tsuya_studio_free(studio);
    tsuya_light_set_free(&lights);
    tsuya_studio_prop_free(&prop);
    return status;
}

tsuya_status tsuya_simulate_write_grid(const simulation *s, const char *name, const tsuya_scene_tags *t)
{
    return tsuya_simulate_write(s, name, tsuya_arena_printf(s->scene->arena, "{family: %s, border_bits: %d, cols: %d, rows: %d, tag_mm: %.10g, gap_mm: %.10g, "
                                                  "first_id: %d}\n", t->family, t->border_bits, t->cols, t->rows, t->tag_mm, t->gap_mm, t->first_id));
}

void tsuya_simulate_reflect(const void *user, tsuya_vec3 wi, tsuya_vec3 wo, double rgb[3])
{
    const simulation *s = user;
    if (s->cloth) {
        tsuya_studio_reflectance(s->cloth, s->swatch_dye, wi, wo, rgb);
        return;
    }
    for (int c = 0; c < 3; c++) {
        rgb[c] = (double)s->swatch_dye[c] / M_PI;
    }
}

static tsuya_status write_goniometer(const simulation *s)
{
    tsuya_goniometer bench = tsuya_goniometer_default();
    const char *path = tsuya_simulate_path(s, "goniometer.csv");
    bench.azimuth_step_deg = s->scene->goniometer.azimuth_step_deg;
    bench.tilt_step_deg = s->scene->goniometer.tilt_step_deg;
    bench.gain_noise = s->scene->goniometer.noise;
    return path ? tsuya_goniometer_write(path, &bench, tsuya_simulate_reflect, s, s->context) : TSUYA_ERROR_MEMORY;
}

static void write_directions(FILE *stream, const simulation *s, const double angle_deg[4])
{
    double rgb[3], r[4];
    for (int k = 0; k < 4; k++) {
        r[k] = tsuya_rad_from_deg(angle_deg[k]);
    }
    tsuya_simulate_reflect(s, (tsuya_vec3){sin(r[0]) * cos(r[1]), sin(r[0]) * sin(r[1]), cos(r[0])},
                           (tsuya_vec3){sin(r[2]) * cos(r[3]), sin(r[2]) * sin(r[3]), cos(r[2])}, rgb);
    fprintf(stream, "%.2f,%.2f,%.2f,%.2f,%.7g,%.7g,%.7g\n", angle_deg[0], angle_deg[1], angle_deg[2], angle_deg[3], rgb[0], rgb[1], rgb[2]);
}

static double hundredths(double degrees) { return round(100.0 * degrees) / 100.0; }

/* Where the bench was not: half a step beside its azimuths and tilts, without noise. */
static tsuya_status write_held_out(const simulation *s)
{
    tsuya_goniometer b = tsuya_goniometer_default();
    const tsuya_scene_goniometer *asked = &s->scene->goniometer;
    const char *path = tsuya_simulate_path(s, "truth/held_out.csv");
    const double lamp[2] = {tsuya_rad_from_deg(b.light_theta_deg), tsuya_rad_from_deg(b.light_phi_deg)};
    const double view[2] = {tsuya_rad_from_deg(b.view_theta_deg), tsuya_rad_from_deg(b.view_phi_deg)};
    tsuya_file_writer w;
    if (!path) {
        return TSUYA_ERROR_MEMORY;
    }
    TSUYA_TRY(tsuya_file_begin(&w, path));
    fprintf(w.stream, "# quantity=brdf\ntheta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,r,g,b\n");
    for (double azimuth = 0.5 * asked->azimuth_step_deg; azimuth < 180.0; azimuth += asked->azimuth_step_deg) {
        for (double tilt = 0.5 * asked->tilt_step_deg - b.tilt_most_deg; tilt < b.tilt_most_deg; tilt += asked->tilt_step_deg) {
            tsuya_vec3 wi = tsuya_goniometer_on_stage((tsuya_vec3){sin(lamp[0]) * cos(lamp[1]), sin(lamp[0]) * sin(lamp[1]), cos(lamp[0])}, azimuth, tilt);
            tsuya_vec3 wo = tsuya_goniometer_on_stage((tsuya_vec3){sin(view[0]) * cos(view[1]), sin(view[0]) * sin(view[1]), cos(view[0])}, azimuth, tilt);
            const double angle[4] = {hundredths(tsuya_deg_from_rad(acos(wi.z))), hundredths(tsuya_deg_from_rad(atan2(wi.y, wi.x))),
                                     hundredths(tsuya_deg_from_rad(acos(wo.z))), hundredths(tsuya_deg_from_rad(atan2(wo.y, wo.x)))};
            if (angle[0] < 88.0 && angle[2] < 88.0) {
                write_directions(w.stream, s, angle);
            }
        }
    }
    return tsuya_file_commit(&w);
}

/* Directions over both hemispheres, without noise. */
static tsuya_status write_reflectance(const simulation *s)
{
    enum { DIRECTIONS = 2000 };
    tsuya_file_writer w;
    const char *path = tsuya_simulate_path(s, "truth/reflectance.csv");
    if (!path) {
        return TSUYA_ERROR_MEMORY;
    }
    TSUYA_TRY(tsuya_file_begin(&w, path));
    fprintf(w.stream, "# quantity=brdf\ntheta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,r,g,b\n");
    for (uint64_t i = 0; i < DIRECTIONS; i++) {
        double u[4];
        for (uint64_t k = 0; k < 4; k++) {
            u[k] = tsuya_random_uniform(77, 1, 4 * i + k);
        }
        write_directions(w.stream, s, (const double[4]){hundredths(tsuya_deg_from_rad(asin(0.98 * sqrt(u[0])))), hundredths(360.0 * u[2]),
                                                        hundredths(tsuya_deg_from_rad(asin(0.98 * sqrt(u[1])))), hundredths(360.0 * u[3])});
    }
    return tsuya_file_commit(&w);
}

static tsuya_status write_chart(const simulation *s, const tsuya_studio_prop *prop, int count)
{
    const char *text = "x_m,y_m,z_m,r,g,b\n";
    for (int k = 0; k < count; k++) {
        const tsuya_studio_print *p = prop[k].print;
        for (int i = 0; p && p->patch && i < p->cols * p->rows; i++) {
            tsuya_vec3 middle = {(i % p->cols) * (p->size_m + p->gap_m) + 0.5 * p->size_m, (i / p->cols) * (p->size_m + p->gap_m) + 0.5 * p->size_m, 0.0};
            middle = tsuya_pose_apply(tsuya_pose_inverse(p->print_from_world), middle);
            text = tsuya_arena_printf(s->scene->arena, "%s%.6f,%.6f,%.6f,%.5f,%.5f,%.5f\n", text ? text : "", middle.x, middle.y, middle.z,
                                      (double)p->patch[i][0], (double)p->patch[i][1], (double)p->patch[i][2]);
        }
    }
    return s->scene->chart ? tsuya_simulate_write(s, "truth/chart.csv", text) : TSUYA_OK;
}

tsuya_status tsuya_simulate_write_model(const simulation *s, const char *folder_name, tsuya_view *view, int count)
{
    tsuya_camera camera = s->camera;
    uint32_t camera_id = 1;
    const char *folder = tsuya_simulate_path(s, folder_name);
    if (!folder) {
        return TSUYA_ERROR_MEMORY;
    }
    if (camera.lens == TSUYA_LENS_OPENCV5 || camera.lens == TSUYA_LENS_OPENCV8) {
        camera.lens = TSUYA_LENS_OPENCV8; /* COLMAP's FULL_OPENCV */
    }
    for (int i = 0; i < count; i++) {
        view[i].image_id = (uint32_t)i + 1;
        view[i].camera_id = camera_id;
    }
    tsuya_sparse_model model = {.camera = &camera, .camera_id = &camera_id, .camera_count = 1, .view = view, .view_count = count};
    TSUYA_TRY(tsuya_folder_make(folder));
    return tsuya_sparse_model_save_text(&model, folder);
}

static tsuya_status write_sparse(const simulation *s, const simulate_view *taken, int count)
{
    tsuya_view *view = tsuya_arena_alloc(s->scene->arena, (size_t)count, sizeof *view);
    for (int i = 0; view && i < count; i++) {
        view[i] = (tsuya_view){.camera_from_world = taken[i].camera_from_world};
        view[i].name = tsuya_arena_printf(s->scene->arena, "%s-%03d.%s", taken[i].close_up ? "close" : "shot", i + 1, s->scene->camera.format);
        if (!view[i].name) {
            return TSUYA_ERROR_MEMORY;
        }
    }
    return view ? tsuya_simulate_write_model(s, "truth/sparse", view, count) : TSUYA_ERROR_MEMORY;
}

/* Photographs of the rings, evenly spread. */
static const char *held_out(const simulation *s, const simulate_view *view, int count)
{
    int rings = 0;
    const char *text = "";
    while (rings < count && !view[rings].close_up) {
        rings++;
    }
    for (int k = 0; k < s->scene->hold_out && text && rings > 0; k++) {
        int i = (int)((k + 0.4) * rings / s->scene->hold_out);
        text = tsuya_arena_printf(s->scene->arena, "%s%sshot-%03d.%s", text, k ? ", " : "", i + 1, s->scene->camera.format);
    }
    return text;
}

static tsuya_status write_job(const simulation *s, const simulate_view *view, int count)
{
    const tsuya_simulate_scene *scene = s->scene;
    const char *hold_out = held_out(s, view, count);
    bool calibrated = scene->has_board && scene->board.photos > 0;
    return tsuya_simulate_write(s, "JOB.yaml", tsuya_arena_printf(scene->arena,
        "# Photographs that `tsuya capture simulate` made; truth/ holds what they were made of, and no stage reads it.\n"
        "name: %s\nphotos: photos/\nmasks: masks/\n%s%s%s%shold_out: [%s]\nrender:\n"
        "  - {name: turntable, views: 8, size: [640, 480]}\n%s", scene->name,
        calibrated ? "camera: {board: board.yaml, photos: board/}\n" : "",
        scene->has_mat ? "scale: {board: mat.yaml}\n" : "", scene->has_goniometer ? "materials:\n  - {name: cloth, samples: goniometer.csv}\n" : "", scene->lamps_measured ? "lights: lights.json\n" : "", hold_out ? hold_out : "",
        scene->hold_out > 0 ? "  - {name: as-photographed, like: photos/}\n" : ""));
}

static tsuya_status write_truth(const simulation *s, const tsuya_studio_cloth *cloth, const simulate_view *view, int count, const char *lights,
                                const tsuya_studio_prop *prop, int props)
{
    const char *mesh = tsuya_simulate_path(s, "truth/mesh.ply"), *camera = tsuya_simulate_path(s, "truth/camera.cameramodel");
    if (!mesh || !camera) {
        return TSUYA_ERROR_MEMORY;
    }
    TSUYA_TRY(write_sparse(s, view, count));
    TSUYA_TRY(tsuya_ply_save(&cloth->mesh, mesh, NULL));
    TSUYA_TRY(tsuya_cameramodel_save(&s->camera, tsuya_pose_identity(), camera));
    TSUYA_TRY(tsuya_simulate_write(s, "truth/lights.json", lights));
    TSUYA_TRY(write_reflectance(s));
    TSUYA_TRY(s->scene->has_goniometer ? write_held_out(s) : TSUYA_OK);
    TSUYA_TRY(write_chart(s, prop, props));
    TSUYA_TRY(s->scene->has_mat ? tsuya_simulate_write_grid(s, "mat.yaml", &s->scene->mat) : TSUYA_OK);
    TSUYA_TRY(s->scene->has_board ? tsuya_simulate_write_grid(s, "board.yaml", &s->scene->board) : TSUYA_OK);
    TSUYA_TRY(s->scene->has_goniometer ? write_goniometer(s) : TSUYA_OK);
    return write_job(s, view, count);
}

/* Empties the folders that it fills, but only where an earlier session stood: truth/.studio says so from the first moment. */
static tsuya_status make_folders(const simulation *s)
{
    static const char *const names[] = {"truth", "photos", "masks", "board", "swatch"};
    enum { FOLDERS = sizeof names / sizeof names[0] };
    const char *mark = tsuya_simulate_path(s, "truth/.studio");
    bool own = mark && tsuya_path_exists(mark);
    for (int i = 0; i < 2 * FOLDERS; i++) {
        const char *path = tsuya_simulate_path(s, names[i % FOLDERS]);
        if (!path || !mark) {
            return TSUYA_ERROR_MEMORY;
        }
        if (i < FOLDERS && !own && tsuya_path_exists(path)) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: is there, and no simulation made it; choose a folder that is new or of an earlier simulation", path);
        }
        if (i >= FOLDERS) {
            TSUYA_TRY(tsuya_folder_remove(path));
            bool wanted = i % FOLDERS < 3 || (i % FOLDERS == 3 ? s->scene->has_board : s->scene->has_goniometer && s->scene->goniometer.photos);
            TSUYA_TRY(wanted ? tsuya_folder_make(path) : TSUYA_OK);
        }
        TSUYA_TRY(i == FOLDERS ? tsuya_file_write(mark, "", 0) : TSUYA_OK);
    }
    return TSUYA_OK;
}

static tsuya_status cloth_session(simulation *s, tsuya_simulate_info *info)
{
    tsuya_status status;
    tsuya_studio_cloth cloth = {0};
    tsuya_studio_prop prop[SIMULATE_PROPS] = {0};
    tsuya_light_set lights = {0};
    tsuya_studio *studio = NULL;
    tsuya_studio_weave weave = tsuya_simulate_weave(s->scene, s->context->seed);
    tsuya_studio_options options = {.samples = 25, .prop = prop, .cloth = s->cloth};
    simulate_view *view;
    tsuya_vec3 low, high;
    const char *json, *measured;
    TSUYA_GOTO_DONE(status, tsuya_simulate_cloth(&cloth, info, s->scene, &weave, s->context));
    double start_s = tsuya_clock_s();
    tsuya_mesh_bounds(&cloth.mesh, &low, &high);
    TSUYA_GOTO_DONE(status, tsuya_simulate_props(prop, &options.prop_count, s->scene));
    TSUYA_GOTO_DONE(status, tsuya_simulate_lights(&json, &measured, s->scene, low, high, s->context->seed));
    TSUYA_GOTO_DONE(status, tsuya_light_set_parse(&lights, json, s->scene->path, s->folder));
    TSUYA_GOTO_DONE(status, tsuya_simulate_views(&view, &info->photos, s->scene, &s->camera, &cloth, s->context->seed));
    TSUYA_GOTO_DONE(status, tsuya_studio_create(&studio, &cloth, &weave, &lights, &options, s->context));
    TSUYA_GOTO_DONE(status, photograph_cloth(s, studio, view, info->photos));
    TSUYA_GOTO_DONE(status, s->scene->lamps_measured ? tsuya_simulate_write(s, "lights.json", measured) : TSUYA_OK);
    TSUYA_GOTO_DONE(status, write_truth(s, &cloth, view, info->photos, json, prop, options.prop_count));
    info->photos_s = tsuya_clock_s() - start_s;
done:
    tsuya_studio_free(studio);
    tsuya_light_set_free(&lights);
    tsuya_studio_cloth_free(&cloth);
    for (int k = 0; k < SIMULATE_PROPS; k++) {
        tsuya_studio_prop_free(&prop[k]);
    }
    return status;
}

tsuya_status tsuya_simulate(tsuya_simulate_info *info, const tsuya_simulate_scene *scene, const char *folder, const tsuya_context *context)
{
    tsuya_context own = *context;
    const double *dye = scene->goniometer.dye.item;
    simulation s = {.scene = scene, .context = &own, .folder = folder, .cloth = tsuya_simulate_reflectance(scene)};
    *info = (tsuya_simulate_info){0};
    own.seed = (uint64_t)scene->seed;
    for (int c = 0; c < 3; c++) {
        s.swatch_dye[c] = dye ? (float)dye[c] : SWATCH_DYE[c];
    }
    TSUYA_TRY(tsuya_simulate_camera(&s.camera, scene));
    set_camera(&s);
    TSUYA_TRY(tsuya_folder_make(folder));
    TSUYA_TRY(make_folders(&s));
    TSUYA_TRY(cloth_session(&s, info));
    double start_s = tsuya_clock_s();
    info->board_photos = scene->has_board ? scene->board.photos : 0;
    for (int i = 0; i < info->board_photos; i++) {
        tsuya_progress_update(&own, "board", i, info->board_photos, NULL);
        TSUYA_TRY(photograph_board(&s, i));
    }
    info->board_s = tsuya_clock_s() - start_s;
    start_s = tsuya_clock_s();
    TSUYA_TRY(scene->has_goniometer ? tsuya_simulate_swatch(&s, &info->swatch_photos) : TSUYA_OK);
    info->swatch_s = tsuya_clock_s() - start_s;
    return TSUYA_OK;
}
