/* The paper's stage, photographed: lamp and camera stand still, a swatch on a plate of tags turns and tilts before them.
 *
 * Everything is drawn in the swatch's frame (x weft, y warp, z normal, its middle at 0), in which lamp and camera move together: in the
 * camera's frame the lamp is always at the same place.  The plate's paper between the tags is of known reflectance. */
#include "capture/simulate_shots.h"

#include "capture/studio_goniometer.h"
#include "core/file.h"
#include "core/memory.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { TAGS = 5, FIRST_ID = 400, CELLS = 12, NM_FIRST = 390, NM_LAST = 730, NM_STEP = 10, STREAM_SPECTRA = 80 };
static const double TAG_M = 0.014, GAP_M = 0.008, SWATCH_HALF_M = 0.0275, ABOVE_M = 3e-4;
static const double LAMP_M = 0.6, LAMP_DIAMETER_M = 0.03, FILL = 0.92, LOWEST = 0.15, SPARE = 1.25;
static const double PAPER = 0.78; /* of studio_prop.c's plates */

static double plate_half(void) { return 0.5 * (TAGS * TAG_M + (TAGS - 1) * GAP_M); }

/* Flat, its threads along the axes. */
static tsuya_status lay_swatch(tsuya_studio_cloth *cloth)
{
    tsuya_status status = TSUYA_OK;
    const size_t stride = CELLS + 1;
    TSUYA_TRY(tsuya_mesh_create(&cloth->mesh, stride * stride, 2 * CELLS * CELLS, TSUYA_MESH_NORMAL | TSUYA_MESH_WEFT));
    TSUYA_NEW(status, cloth->warp, 3 * stride * stride);
    TSUYA_NEW(status, cloth->uv, 2 * stride * stride);
    for (size_t v = 0; v < stride * stride; v++) {
        double x = SWATCH_HALF_M * (2.0 * (double)(v % stride) / CELLS - 1.0), y = SWATCH_HALF_M * (2.0 * (double)(v / stride) / CELLS - 1.0);
        cloth->mesh.position[3 * v] = cloth->uv[2 * v] = (float)x;
        cloth->mesh.position[3 * v + 1] = cloth->uv[2 * v + 1] = (float)y;
        cloth->mesh.normal[3 * v + 2] = cloth->mesh.weft[3 * v] = cloth->warp[3 * v + 1] = 1.0f;
    }
    uint32_t *t = cloth->mesh.triangle;
    for (uint32_t k = 0; k < CELLS * CELLS; k++, t += 6) {
        uint32_t a = k / CELLS * (uint32_t)stride + k % CELLS, b = a + (uint32_t)stride;
        memcpy(t, (uint32_t[]){a, a + 1, b + 1, a, b + 1, b}, 6 * sizeof *t);
    }
done:
    return status;
}

typedef struct position {
    double azimuth_deg, tilt_deg;
    tsuya_pose camera_from_swatch;
    tsuya_vec3 lamp_m;
} position;

static tsuya_vec3 in_lab(double theta_deg, double phi_deg)
{
    double t = tsuya_rad_from_deg(theta_deg), p = tsuya_rad_from_deg(phi_deg);
    return (tsuya_vec3){sin(t) * cos(p), sin(t) * sin(p), cos(t)};
}

/* How far the camera stands for the plate to fill its picture. */
static double camera_distance(const tsuya_camera *c)
{
    double size = 2.0 * (plate_half() + GAP_M);
    return fmax(c->fx_px * size / (FILL * c->width_px), c->fy_px * size / (FILL * c->height_px));
}

/* false: lamp or camera stand too low. */
static bool place(position *at, const tsuya_goniometer *bench, double distance_m, double azimuth_deg, double tilt_deg)
{
    tsuya_vec3 wi = tsuya_goniometer_on_stage(in_lab(bench->light_theta_deg, bench->light_phi_deg), azimuth_deg, tilt_deg);
    tsuya_vec3 wo = tsuya_goniometer_on_stage(in_lab(bench->view_theta_deg, bench->view_phi_deg), azimuth_deg, tilt_deg);
    *at = (position){.azimuth_deg = azimuth_deg, .tilt_deg = tilt_deg, .lamp_m = tsuya_vec3_scale(wi, LAMP_M)};
    at->camera_from_swatch = tsuya_pose_look_at(tsuya_vec3_scale(wo, distance_m), (tsuya_vec3){0, 0, 0}, tsuya_goniometer_on_stage((tsuya_vec3){0, 1, 0}, azimuth_deg, tilt_deg));
    return wi.z > LOWEST && wo.z > LOWEST;
}

static tsuya_light lamp_at(tsuya_vec3 p)
{
    double area = 0.25 * M_PI * LAMP_DIAMETER_M * LAMP_DIAMETER_M, radiance = LAMP_M * LAMP_M / area; /* 1 W m⁻² at the swatch */
    return (tsuya_light){.kind = TSUYA_LIGHT_DISK, .position_m = p, .direction = tsuya_vec3_scale(tsuya_vec3_unit(p), -1.0), .up = {0, 1, 0},
                         .size_m = {LAMP_DIAMETER_M, LAMP_DIAMETER_M}, .rgb = {radiance, radiance, radiance}};
}

typedef struct stage {
    simulation *s;
    tsuya_goniometer bench;
    tsuya_studio_cloth cloth;
    tsuya_studio_prop plate;
    tsuya_studio_weave weave;
    double distance_m;
    position *position;
    int count;
} stage;

static tsuya_status list_positions(stage *g)
{
    const tsuya_scene_goniometer *asked = &g->s->scene->goniometer;
    int azimuths = (int)ceil(180.0 / asked->azimuth_step_deg - 1e-9), tilts = (int)floor(g->bench.tilt_most_deg / asked->photo_step_deg + 1e-9);
    g->position = tsuya_arena_alloc(g->s->scene->arena, (size_t)(azimuths * (2 * tilts + 1)), sizeof *g->position);
    for (int k = 0; g->position && k < azimuths * (2 * tilts + 1); k++) {
        double azimuth = k / (2 * tilts + 1) * asked->azimuth_step_deg, tilt = (k % (2 * tilts + 1) - tilts) * asked->photo_step_deg;
        g->count += place(&g->position[g->count], &g->bench, g->distance_m, azimuth, tilt);
    }
    return g->position ? TSUYA_OK : TSUYA_ERROR_MEMORY;
}

/* One exposure for the whole session, that neither cloth nor paper clip. */
static double full_radiance(const stage *g)
{
    double most = PAPER / M_PI, rgb[3];
    for (int k = 0; k < g->count; k++) {
        tsuya_vec3 wi = tsuya_vec3_unit(g->position[k].lamp_m), wo = tsuya_vec3_unit(tsuya_pose_center(g->position[k].camera_from_swatch));
        tsuya_simulate_reflect(g->s, wi, wo, rgb);
        most = fmax(most, wi.z * fmax(rgb[0], fmax(rgb[1], rgb[2])));
    }
    return SPARE * most;
}

static tsuya_status shoot(stage *g, int k)
{
    simulation *s = g->s;
    tsuya_light_set lights = {0};
    tsuya_studio *studio = NULL;
    tsuya_status status;
    tsuya_light lamp = lamp_at(g->position[k].lamp_m);
    tsuya_studio_options options = {.samples = 16, .prop = &g->plate, .prop_count = 1, .cloth = g->s->cloth};
    uint64_t stream = 4000 + (uint64_t)k;
    const char *name = tsuya_simulate_photo_name(s, "swatch", k), *path = name ? tsuya_arena_printf(s->scene->arena, "swatch/%s", name) : NULL;
    tsuya_studio_shot shot = tsuya_simulate_shot(s, g->position[k].camera_from_swatch, g->distance_m, stream);
    TSUYA_GOTO_DONE(status, tsuya_light_set_add(&lights, &lamp, "stage"));
    TSUYA_GOTO_DONE(status, tsuya_studio_create(&studio, &g->cloth, &g->weave, &lights, &options, s->context));
    status = path ? tsuya_simulate_take(s, studio, &shot, path, NULL, stream) : TSUYA_ERROR_MEMORY;
done:
    tsuya_studio_free(studio);
    tsuya_light_set_free(&lights);
    return status;
}

/* The lamp as the camera has it, and the paper where gaps cross at the plate's rim: light is found at vertices 20 mm apart, and those under the
 * swatch are dark. */
static tsuya_status write_bench(const stage *g)
{
    simulation *s = g->s;
    tsuya_light lamp = lamp_at(g->position[0].lamp_m);
    tsuya_pose pose = g->position[0].camera_from_swatch;
    tsuya_vec3 p = tsuya_pose_apply(pose, lamp.position_m), d = tsuya_mat3_apply(pose.rotation, lamp.direction);
    TSUYA_TRY(tsuya_simulate_write(s, "swatch/lights.json", tsuya_arena_printf(s->scene->arena,
        "{\"lights\": [{\"type\": \"disk\", \"position_m\": [%.9g, %.9g, %.9g], \"direction\": [%.9g, %.9g, %.9g], \"size_m\": [%g], \"rgb\": [%.9g, %.9g, %.9g]}]}\n",
        p.x, p.y, p.z, d.x, d.y, d.z, LAMP_DIAMETER_M, lamp.rgb[0], lamp.rgb[1], lamp.rgb[2])));
    const char *text = "x_m,y_m,z_m,r,g,b,size_m\n";
    for (int k = 0; k < (TAGS + 1) * (TAGS + 1); k++) {
        double x = (k % (TAGS + 1)) * (TAG_M + GAP_M) - 0.5 * GAP_M - plate_half(), y = (k / (TAGS + 1)) * (TAG_M + GAP_M) - 0.5 * GAP_M - plate_half();
        if (fmax(fabs(x), fabs(y)) > SWATCH_HALF_M + 0.022) {
            text = text ? tsuya_arena_printf(s->scene->arena, "%s%.4f,%.4f,%.4f,%g,%g,%g,%g\n", text, x, y, -ABOVE_M, PAPER, PAPER, PAPER, GAP_M) : NULL;
        }
    }
    TSUYA_TRY(tsuya_simulate_write(s, "swatch/reference.csv", text));
    tsuya_scene_tags tags = {.family = "tag36h11", .cols = TAGS, .rows = TAGS, .first_id = FIRST_ID, .border_bits = 1, .tag_mm = 1e3 * TAG_M, .gap_mm = 1e3 * GAP_M};
    TSUYA_TRY(tsuya_simulate_write_grid(s, "swatch/plate.yaml", &tags));
    const char *mesh = tsuya_simulate_path(s, "truth/swatch.ply");
    return mesh ? tsuya_ply_save(&g->cloth.mesh, mesh, NULL) : TSUYA_ERROR_MEMORY;
}

static tsuya_status write_poses(const stage *g)
{
    tsuya_view *view = tsuya_arena_alloc(g->s->scene->arena, (size_t)g->count, sizeof *view);
    const char *rows = "photo,azimuth_deg,tilt_deg\n";
    for (int k = 0; view && k < g->count; k++) {
        const char *name = tsuya_simulate_photo_name(g->s, "swatch", k);
        view[k] = (tsuya_view){.name = tsuya_arena_printf(g->s->scene->arena, "%s", name ? name : ""), .camera_from_world = g->position[k].camera_from_swatch};
        rows = rows ? tsuya_arena_printf(g->s->scene->arena, "%s%s,%g,%g\n", rows, name, g->position[k].azimuth_deg, g->position[k].tilt_deg) : NULL;
        if (!name || !view[k].name) {
            return TSUYA_ERROR_MEMORY;
        }
    }
    TSUYA_TRY(tsuya_simulate_write(g->s, "truth/swatch-stage.csv", rows));
    return view ? tsuya_simulate_write_model(g->s, "truth/swatch", view, g->count) : TSUYA_ERROR_MEMORY;
}

static tsuya_status photograph(stage *g, int *photos)
{
    simulation *s = g->s;
    tsuya_pose corner = tsuya_pose_identity();
    const tsuya_studio_grid grid = {"tag36h11", 1, TAGS, TAGS, FIRST_ID, 1e3 * TAG_M, 1e3 * GAP_M};
    corner.translation = (tsuya_vec3){-plate_half(), -plate_half(), -ABOVE_M};
    TSUYA_TRY(lay_swatch(&g->cloth));
    TSUYA_TRY(tsuya_studio_prop_tags(&g->plate, corner, &grid));
    TSUYA_TRY(list_positions(g));
    s->sensor.full_radiance = full_radiance(g);
    for (int k = 0; k < g->count; k++) {
        tsuya_progress_update(s->context, "swatch", k, g->count, NULL);
        TSUYA_TRY(tsuya_check_interrupt());
        TSUYA_TRY(shoot(g, k));
    }
    *photos = g->count;
    TSUYA_TRY(write_bench(g));
    return write_poses(g);
}

/* --- what a spectroradiometer reads: the dye's spectrum under the colourless surface part ------------------------------ */

static double ramp(double nm, double from, double to)
{
    double t = fmin(fmax((nm - from) / (to - from), 0.0), 1.0);
    return t * t * (3.0 - 2.0 * t);
}

/* Smooth, and even for a grey dye: the three shares sum to 1. */
static double dye_at(const float d[3], double nm)
{
    double red = ramp(nm, 560.0, 620.0), blue = 1.0 - ramp(nm, 470.0, 520.0);
    return red * (double)d[0] + (1.0 - red - blue) * (double)d[1] + blue * (double)d[2];
}

static void write_spectrum(FILE *stream, const stage *g, double azimuth_deg, double tilt_deg, uint64_t row)
{
    tsuya_vec3 wi = tsuya_goniometer_on_stage(in_lab(g->bench.light_theta_deg, g->bench.light_phi_deg), azimuth_deg, tilt_deg);
    tsuya_vec3 wo = tsuya_goniometer_on_stage(in_lab(g->bench.view_theta_deg, g->bench.view_phi_deg), azimuth_deg, tilt_deg);
    const float dyes[3] = {0.0f, 1.0f, 0.0f};
    double ends[3] = {0.0, 1.0 / M_PI, 0.0}; /* without dye, with white dye */
    if (g->s->cloth) {
        tsuya_studio_reflectance(g->s->cloth, dyes, wi, wo, ends);
    }
    fprintf(stream, "%g,%g", azimuth_deg, tilt_deg);
    for (int nm = NM_FIRST; nm <= NM_LAST; nm += NM_STEP) {
        double f = ends[0] + dye_at(g->s->swatch_dye, nm) * (ends[1] - ends[0]);
        double noise = 1.0 + 0.5 * g->s->scene->goniometer.noise * tsuya_random_normal(g->s->context->seed, STREAM_SPECTRA, 1000 * row + (uint64_t)nm);
        fprintf(stream, ",%.7g", f * wi.z * noise);
    }
    fprintf(stream, "\n");
}

static tsuya_status write_spectra(const stage *g)
{
    enum { AZIMUTHS = 4, TILTS = 9 };
    const tsuya_goniometer *b = &g->bench;
    const char *path = tsuya_simulate_path(g->s, "spectra.csv");
    tsuya_file_writer w;
    if (!path) {
        return TSUYA_ERROR_MEMORY;
    }
    TSUYA_TRY(tsuya_file_begin(&w, path));
    fprintf(w.stream, "# quantity=radiance\n# irradiance=1\n# light_theta_deg=%g\n# light_phi_deg=%g\n# view_theta_deg=%g\n# view_phi_deg=%g\nazimuth_deg,tilt_deg",
            b->light_theta_deg, b->light_phi_deg, b->view_theta_deg, b->view_phi_deg);
    for (int nm = NM_FIRST; nm <= NM_LAST; nm += NM_STEP) {
        fprintf(w.stream, ",nm%d", nm);
    }
    fprintf(w.stream, "\n");
    for (int k = 0; k < AZIMUTHS * TILTS; k++) {
        write_spectrum(w.stream, g, 45.0 * (k / TILTS), 9.0 * (k % TILTS - TILTS / 2), (uint64_t)k);
    }
    return tsuya_file_commit(&w);
}

tsuya_status tsuya_simulate_swatch(simulation *s, int *photos)
{
    double scale = s->scene->goniometer.photo_scale;
    simulation own = *s; /* its camera read out coarsely */
    own.camera = tsuya_camera_scaled(&s->camera, (int)lround(scale * s->camera.width_px), (int)lround(scale * s->camera.height_px));
    stage g = {.s = &own, .bench = tsuya_goniometer_default(), .weave = tsuya_simulate_weave(s->scene, s->context->seed)};
    tsuya_status status = TSUYA_OK;
    g.weave.plain = s->swatch_dye;
    g.distance_m = camera_distance(&own.camera);
    if (s->scene->goniometer.spectra) {
        status = write_spectra(&g);
    }
    if (status == TSUYA_OK && s->scene->goniometer.photos) {
        status = photograph(&g, photos);
    }
    tsuya_studio_cloth_free(&g.cloth);
    tsuya_studio_prop_free(&g.plate);
    return status;
}
