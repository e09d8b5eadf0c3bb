#include "capture/studio_session.h"

#include "core/file.h"
#include "core/json.h"

#include <math.h>
#include <string.h>

enum { FORMAT = 2, STREAM_POSES = 50, STREAM_SHOTS = 100, STREAM_NOISE = 10000, VIEWS_MOST = 999 };

static const char LIGHTS[] =
    "{\"lights\": [\n"
    " {\"type\": \"rect\", \"position_m\": [0.9, -0.7, 1.3], \"direction\": [-0.55, 0.42, -0.72], \"up\": [0, 0, 1], \"size_m\": [0.6, 0.6], "
    "\"rgb\": [9.2, 9.0, 8.6]},\n"
    " {\"type\": \"rect\", \"position_m\": [-1.0, 0.5, 0.9], \"direction\": [0.72, -0.36, -0.6], \"up\": [0, 0, 1], \"size_m\": [0.8, 0.8], "
    "\"rgb\": [3.0, 3.1, 3.3]},\n"
    " {\"type\": \"environment\", \"rgb\": [0.55, 0.55, 0.56]}\n"
    "]}\n";

static const char JOB[] =
    "# Photographs that `tsuya demo` made of a cloth that it knows; truth/ holds what it knows, and no stage reads it.\n"
    "name: demo\n"
    "photos: photos/\n"
    "masks: masks/\n"
    "hold_out: [shot-05.jpg, shot-17.jpg]\n"
    "render:\n"
    "  - {name: turntable, views: 8, size: [640, 480]}\n"
    "  - {name: recoloured, views: 2, size: [640, 480], color: \"#24406b\"}\n"
    "  - {name: as-photographed, like: photos/}\n";

tsuya_studio_session tsuya_studio_session_default(void)
{
    return (tsuya_studio_session){
        .drape = tsuya_studio_drape_default(), .weave = tsuya_studio_weave_default(), .sensor = tsuya_studio_sensor_default(),
        .width_px = 800, .height_px = 600, .focal_px = 1006.0, .k1 = -0.04,
        .ring_views = {14, 8, 2}, .ring_elevation_deg = {17.0, 40.0, 70.0}, .ring_distance_m = {0.47, 0.49, 0.49},
        .spp = 9, .light_samples = 25, .jpeg_quality = 95,
    };
}

tsuya_camera tsuya_studio_session_camera(const tsuya_studio_session *s)
{
    tsuya_camera camera = {.lens = TSUYA_LENS_OPENCV4, .width_px = s->width_px, .height_px = s->height_px,
                           .fx_px = s->focal_px, .fy_px = s->focal_px};
    camera.cx_px = 0.5 * (s->width_px - 1) + 0.002 * s->width_px;
    camera.cy_px = 0.5 * (s->height_px - 1) - 0.0015 * s->width_px;
    camera.distortion[0] = s->k1;
    return camera;
}

/* A hand-held walk around the cloth: evenly spaced, each place off by a few centimetres and aimed a little beside. */
static tsuya_pose pose_of(const tsuya_studio_session *s, int ring, int view, int number, uint64_t seed)
{
    double jitter[5];
    for (int k = 0; k < 5; k++) {
        jitter[k] = tsuya_random_uniform(seed, STREAM_POSES, (uint64_t)(5 * number + k)) - 0.5;
    }
    double azimuth = 2.0 * M_PI * (view + 0.5 * ring + 0.25 * jitter[0]) / s->ring_views[ring];
    double elevation = tsuya_rad_from_deg(s->ring_elevation_deg[ring] + 5.0 * jitter[1]);
    double distance = s->ring_distance_m[ring] * (1.0 + 0.04 * jitter[2]);
    tsuya_vec3 target = {0.02 * jitter[3], 0.02 * jitter[4], 0.45 * s->drape.stand_height_m};
    tsuya_vec3 eye = {target.x + distance * cos(elevation) * cos(azimuth), target.y + distance * cos(elevation) * sin(azimuth),
                      target.z + distance * sin(elevation)};
    return tsuya_pose_look_at(eye, target, (tsuya_vec3){0, 0, 1});
}

tsuya_status tsuya_studio_session_poses(tsuya_pose **poses, int *count, const tsuya_studio_session *s, uint64_t seed, tsuya_arena *arena)
{
    int total = 0, number = 0;
    for (int ring = 0; ring < TSUYA_STUDIO_RINGS; ring++) {
        total += s->ring_views[ring];
    }
    if (total < 3 || total > VIEWS_MOST) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "studio: %d photographs; from 3 to %d can be made", total, VIEWS_MOST);
    }
    *poses = tsuya_arena_alloc(arena, (size_t)total, sizeof **poses);
    if (!*poses) {
        return TSUYA_ERROR_MEMORY;
    }
    for (int ring = 0; ring < TSUYA_STUDIO_RINGS; ring++) {
        for (int view = 0; view < s->ring_views[ring]; view++, number++) {
            (*poses)[number] = pose_of(s, ring, view, number, seed);
        }
    }
    *count = total;
    return TSUYA_OK;
}

static tsuya_studio_exif exif_of(const tsuya_studio_session *s)
{
    double equivalent = s->focal_px * 43.2666 / hypot(s->width_px, s->height_px);
    return (tsuya_studio_exif){.make = "tsuya", .model = "virtual studio", .taken = "2026:01:01 12:00:00", .focal_mm = round(equivalent) / 1.5,
                               .focal_35mm = (int)lround(equivalent), .exposure_s = 1.0 / 60.0, .f_number = 8.0, .iso = 200};
}

static tsuya_status mask_of(tsuya_image *mask, const tsuya_image *coverage)
{
    TSUYA_TRY(tsuya_image_create(mask, coverage->width_px, coverage->height_px, 1, TSUYA_SAMPLE_U8, TSUYA_ENCODING_DATA));
    for (int y = 0; y < mask->height_px; y++) {
        for (int x = 0; x < mask->width_px; x++) {
            *tsuya_image_u8(mask, x, y) = *tsuya_image_u8(coverage, x, y) > 127 ? 255 : 0;
        }
    }
    return TSUYA_OK;
}

typedef struct photographer {
    const tsuya_studio_session *session;
    const tsuya_context *context;
    const tsuya_studio *studio;
    tsuya_studio_sensor sensor;
    tsuya_camera camera;
    const char *folder;
    tsuya_arena *arena;
} photographer;

static tsuya_status take(const photographer *p, tsuya_pose pose, int number)
{
    tsuya_image radiance = {0}, coverage = {0}, photograph = {0}, mask = {0};
    const char *photo_path = tsuya_arena_printf(p->arena, "%s/photos/shot-%02d.jpg", p->folder, number + 1);
    const char *mask_path = tsuya_arena_printf(p->arena, "%s/masks/shot-%02d.png", p->folder, number + 1);
    tsuya_studio_exif exif = exif_of(p->session);
    tsuya_status status = photo_path && mask_path ? TSUYA_OK : TSUYA_ERROR_MEMORY;
    TSUYA_GOTO_DONE(status, status);
    tsuya_studio_shot shot = {.camera = p->camera, .camera_from_world = pose, .spp = p->session->spp, .stream = (uint64_t)(STREAM_SHOTS + number)};
    TSUYA_GOTO_DONE(status, tsuya_studio_shoot(&radiance, &coverage, p->studio, &shot, p->context));
    TSUYA_GOTO_DONE(status, tsuya_studio_develop(&photograph, &radiance, &p->sensor, (uint64_t)(STREAM_NOISE + number), p->context));
    TSUYA_GOTO_DONE(status, mask_of(&mask, &coverage));
    TSUYA_GOTO_DONE(status, tsuya_studio_save_jpeg(&photograph, photo_path, p->session->jpeg_quality, &exif));
    TSUYA_GOTO_DONE(status, tsuya_image_save(&mask, mask_path, NULL));
done:
    tsuya_image_free(&radiance);
    tsuya_image_free(&coverage);
    tsuya_image_free(&photograph);
    tsuya_image_free(&mask);
    return status;
}

static tsuya_status take_all(const photographer *p, const tsuya_pose *pose, int count)
{
    for (int i = 0; i < count; i++) {
        tsuya_progress_update(p->context, "photographs", i, count, NULL);
        TSUYA_TRY(take(p, pose[i], i));
    }
    tsuya_progress_update(p->context, "photographs", count, count, NULL);
    return TSUYA_OK;
}

static tsuya_status write_text(const photographer *p, const char *name, const char *text)
{
    const char *path = tsuya_arena_printf(p->arena, "%s/%s", p->folder, name);
    return path ? tsuya_file_write(path, text, strlen(text)) : TSUYA_ERROR_MEMORY;
}

static tsuya_status write_sparse(const photographer *p, const tsuya_pose *pose, int count)
{
    const char *folder = tsuya_arena_printf(p->arena, "%s/truth/sparse", p->folder);
    tsuya_camera camera = p->camera;
    uint32_t camera_id = 1;
    tsuya_view *view = tsuya_arena_alloc(p->arena, (size_t)count, sizeof *view);
    if (!folder || !view) {
        return TSUYA_ERROR_MEMORY;
    }
    for (int i = 0; i < count; i++) {
        char *name = tsuya_arena_printf(p->arena, "shot-%02d.jpg", i + 1);
        if (!name) {
            return TSUYA_ERROR_MEMORY;
        }
        view[i] = (tsuya_view){.image_id = (uint32_t)i + 1, .camera_id = camera_id, .name = name, .camera_from_world = pose[i]};
    }
    tsuya_sparse_model model = {.camera = &camera, .camera_id = &camera_id, .camera_count = 1, .view = view, .view_count = count};
    TSUYA_TRY(tsuya_folder_make(folder));
    return tsuya_sparse_model_save_text(&model, folder);
}

static tsuya_status write_truth(const photographer *p, const tsuya_studio_cloth *cloth, const tsuya_pose *pose, int count)
{
    const char *mesh = tsuya_arena_printf(p->arena, "%s/truth/mesh.ply", p->folder);
    const char *camera = tsuya_arena_printf(p->arena, "%s/truth/camera.cameramodel", p->folder);
    if (!mesh || !camera) {
        return TSUYA_ERROR_MEMORY;
    }
    TSUYA_TRY(write_sparse(p, pose, count));
    TSUYA_TRY(tsuya_ply_save(&cloth->mesh, mesh, NULL));
    TSUYA_TRY(tsuya_cameramodel_save(&p->camera, tsuya_pose_identity(), camera));
    TSUYA_TRY(write_text(p, "truth/lights.json", LIGHTS));
    return write_text(p, "JOB.yaml", JOB);
}

static tsuya_status colour_vertices(tsuya_studio_cloth *cloth, const tsuya_studio_weave *weave)
{
    TSUYA_TRY(tsuya_mesh_add_arrays(&cloth->mesh, TSUYA_MESH_COLOR));
    for (size_t v = 0; v < cloth->mesh.vertex_count; v++) {
        float rgb[3];
        tsuya_studio_dye_at(weave, (double)cloth->uv[2 * v], (double)cloth->uv[2 * v + 1], rgb);
        for (int c = 0; c < 3; c++) {
            cloth->mesh.color[3 * v + (size_t)c] = (uint8_t)lroundf(255.0f * tsuya_srgb_encode(rgb[c]));
        }
    }
    return TSUYA_OK;
}

/* A little inside the cloth. */
static tsuya_status stand_of(tsuya_studio_prop *prop, const tsuya_studio_drape *d)
{
    enum { ROWS = 24 };
    double profile[ROWS + 1][2];
    for (int row = 0; row <= ROWS; row++) {
        profile[row][0] = (d->stand_height_m - 0.001) * row / ROWS;
        profile[row][1] = d->stand_radius_m - 0.001;
    }
    return tsuya_studio_prop_revolve(prop, (tsuya_vec3){0, 0, 0}, (tsuya_vec3){0, 0, 1}, profile, ROWS + 1);
}

static tsuya_status draw(const tsuya_studio_session *s, const char *folder, tsuya_arena *arena, const tsuya_context *context)
{
    photographer p = {.session = s, .context = context, .sensor = s->sensor, .camera = tsuya_studio_session_camera(s), .folder = folder,
                      .arena = arena};
    tsuya_studio_cloth cloth = {0};
    tsuya_light_set lights = {0};
    tsuya_studio *studio = NULL;
    tsuya_pose *pose;
    int count;
    tsuya_studio_prop prop[2] = {0};
    tsuya_studio_options options = {.samples = s->light_samples, .prop = prop, .prop_count = 2};
    tsuya_status status;
    TSUYA_GOTO_DONE(status, tsuya_studio_prop_floor(&prop[0], (tsuya_vec3){0, 0, 0}));
    TSUYA_GOTO_DONE(status, stand_of(&prop[1], &s->drape));
    TSUYA_GOTO_DONE(status, tsuya_studio_session_poses(&pose, &count, s, context->seed, arena));
    TSUYA_GOTO_DONE(status, tsuya_light_set_parse(&lights, LIGHTS, "lights.json", folder));
    TSUYA_GOTO_DONE(status, tsuya_studio_drape_create(&cloth, &s->drape));
    TSUYA_GOTO_DONE(status, colour_vertices(&cloth, &s->weave));
    TSUYA_GOTO_DONE(status, tsuya_studio_create(&studio, &cloth, &s->weave, &lights, &options, context));
    p.studio = studio;
    p.sensor.full_radiance = tsuya_studio_white(studio, 0.75);
    TSUYA_GOTO_DONE(status, take_all(&p, pose, count));
    TSUYA_GOTO_DONE(status, write_truth(&p, &cloth, pose, count));
done:
    tsuya_studio_free(studio);
    tsuya_studio_prop_free(&prop[0]);
    tsuya_studio_prop_free(&prop[1]);
    tsuya_light_set_free(&lights);
    tsuya_studio_cloth_free(&cloth);
    return status;
}

/* What decides every byte of the session. */
static tsuya_status stamp_of(tsuya_hash *stamp, const tsuya_studio_session *s, uint64_t seed, tsuya_arena *arena)
{
    const tsuya_studio_drape *d = &s->drape;
    const tsuya_studio_weave *w = &s->weave;
    const char *rings = tsuya_arena_printf(arena, "%d %d %d, %a %a %a, %a %a %a", s->ring_views[0], s->ring_views[1], s->ring_views[2],
                                           s->ring_elevation_deg[0], s->ring_elevation_deg[1], s->ring_elevation_deg[2],
                                           s->ring_distance_m[0], s->ring_distance_m[1], s->ring_distance_m[2]);
    const char *text = tsuya_arena_printf(
        arena, "%d, seed %llu, drape %a %a %a %a %d %a, weave %a %a %a %llu %a, sensor %a %a, camera %d %d %a %a, rings %s, %d %d %d", FORMAT,
        (unsigned long long)seed, d->side_m, d->stand_radius_m, d->stand_height_m, d->edge_radius_m, d->folds, d->spacing_m,
        w->weft_pitch_m, w->warp_pitch_m, w->unevenness, (unsigned long long)w->seed, w->half_side_m, s->sensor.full_well_e,
        s->sensor.read_noise_e, s->width_px, s->height_px, s->focal_px, s->k1, rings ? rings : "", s->spp, s->light_samples, s->jpeg_quality);
    tsuya_hasher *hasher;
    if (!rings || !text) {
        return TSUYA_ERROR_MEMORY;
    }
    TSUYA_TRY(tsuya_hasher_create(&hasher));
    tsuya_hasher_add_text(hasher, text);
    tsuya_hasher_add_text(hasher, LIGHTS);
    tsuya_hasher_add_text(hasher, JOB);
    *stamp = tsuya_hasher_end(hasher);
    return TSUYA_OK;
}

static bool is_there(const char *path, const tsuya_hash *stamp)
{
    char *kept = NULL;
    size_t size;
    bool same = tsuya_path_exists(path) && tsuya_file_load(&kept, &size, path, 4096) == TSUYA_OK && strcmp(kept, stamp->hex) == 0;
    tsuya_free(kept);
    return same;
}

/* Empties the folders that it fills, but only where an earlier session stood: truth/.studio says so from the first moment. */
static tsuya_status make_folders(const char *folder, tsuya_arena *arena)
{
    static const char *const names[] = {"truth", "photos", "masks"};
    const char *mark = tsuya_arena_printf(arena, "%s/truth/.studio", folder);
    bool own = mark && tsuya_path_exists(mark);
    for (int i = 0; i < 3; i++) {
        const char *path = tsuya_arena_printf(arena, "%s/%s", folder, names[i]);
        if (!path || !mark) {
            return TSUYA_ERROR_MEMORY;
        }
        if (!own && tsuya_path_exists(path)) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: is there, and no demo made it; choose a folder that is new or of an earlier demo", path);
        }
    }
    for (int i = 0; i < 3; i++) {
        const char *path = tsuya_arena_printf(arena, "%s/%s", folder, names[i]);
        if (!path) {
            return TSUYA_ERROR_MEMORY;
        }
        TSUYA_TRY(tsuya_folder_remove(path));
        TSUYA_TRY(tsuya_folder_make(path));
        if (i == 0) {
            TSUYA_TRY(tsuya_file_write(mark, "", 0));
        }
    }
    return TSUYA_OK;
}

tsuya_status tsuya_studio_session_write(const tsuya_studio_session *s, const char *folder, const tsuya_context *context)
{
    tsuya_arena *arena;
    tsuya_hash stamp;
    TSUYA_TRY(tsuya_arena_create(&arena, 1 << 16));
    const char *path = tsuya_arena_printf(arena, "%s/truth/.stamp", folder);
    tsuya_status status = path ? stamp_of(&stamp, s, context->seed, arena) : TSUYA_ERROR_MEMORY;
    if (status == TSUYA_OK && !is_there(path, &stamp)) {
        TSUYA_GOTO_DONE(status, make_folders(folder, arena));
        TSUYA_GOTO_DONE(status, draw(s, folder, arena, context));
        TSUYA_GOTO_DONE(status, tsuya_file_write(path, stamp.hex, strlen(stamp.hex)));
    }
done:
    tsuya_arena_free(arena);
    return status;
}
