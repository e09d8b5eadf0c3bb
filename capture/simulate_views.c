/* A scene's cameras, lamps, and the things beside the cloth. */
#include "capture/simulate_parts.h"

#include "core/file.h"
#include "core/raster.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static bool is(const char *a, const char *b) { return strcmp(a, b) == 0; }

static tsuya_status add_box(tsuya_studio_prop prop[SIMULATE_PROPS], int *count, const tsuya_drape_body *b, double inside)
{
    tsuya_vec3 low = {b->a.x + inside, b->a.y + inside, b->a.z}, high = {b->b.x - inside, b->b.y - inside, b->b.z - inside};
    const double w = high.x - low.x, d = high.y - low.y, h = high.z - low.z;
    const struct { tsuya_vec3 x, y, at; double w, h; } face[5] = {
        {{1, 0, 0}, {0, 1, 0}, {low.x, low.y, high.z}, w, d}, {{1, 0, 0}, {0, 0, 1}, {low.x, low.y, low.z}, w, h},
        {{-1, 0, 0}, {0, 0, 1}, {high.x, high.y, low.z}, w, h}, {{0, 1, 0}, {0, 0, 1}, {high.x, low.y, low.z}, d, h},
        {{0, -1, 0}, {0, 0, 1}, {low.x, high.y, low.z}, d, h},
    };
    for (int k = 0; k < 5; k++) {
        tsuya_vec3 x = face[k].x, y = face[k].y, z = tsuya_vec3_cross(x, y);
        tsuya_pose pose = {{{{x.x, y.x, z.x}, {x.y, y.y, z.y}, {x.z, y.z, z.z}}}, face[k].at};
        tsuya_studio_prop *p = &prop[*count];
        TSUYA_TRY(tsuya_studio_prop_plate(p, pose, (tsuya_vec2){0, 0}, (tsuya_vec2){face[k].w, face[k].h}, 0.02));
        ++*count;
        p->albedo[0] = p->albedo[1] = p->albedo[2] = 0.32f;
    }
    return TSUYA_OK;
}

/* A profile with round ends between two heights. */
static tsuya_status add_round(tsuya_studio_prop prop[SIMULATE_PROPS], int *count, tsuya_vec3 a, tsuya_vec3 b, double ra, double rb, double ea, double eb)
{
    enum { END = 8, LENGTH = 24, ROWS = 2 * END + LENGTH + 1 };
    double profile[ROWS][2], length = tsuya_vec3_norm(tsuya_vec3_sub(b, a));
    for (int k = 0; k < ROWS; k++) {
        double t = fmin(fmax((k - END) / (double)LENGTH, 0.0), 1.0), turn = k < END ? (END - k) / (double)END : k > END + LENGTH ? (k - END - LENGTH) / (double)END : 0.0;
        double e = k < END ? ea : eb, r = ra + t * (rb - ra), angle = 0.5 * M_PI * turn;
        profile[k][0] = t * length + (k < END ? -e : e) * sin(angle);
        profile[k][1] = r * cos(angle) + 1e-6;
    }
    TSUYA_TRY(tsuya_studio_prop_revolve(&prop[*count], a, tsuya_vec3_unit(tsuya_vec3_sub(b, a)), (const double (*)[2])profile, ROWS));
    ++*count;
    return TSUYA_OK;
}

static tsuya_status add_stand(tsuya_studio_prop prop[SIMULATE_PROPS], int *count, const tsuya_simulate_scene *s)
{
    tsuya_drape_body body[SIMULATE_BODIES];
    int bodies = tsuya_simulate_bodies(body, s);
    for (int k = 1; k < bodies; k++) {
        const tsuya_drape_body *b = &body[k];
        double inside = fmin(0.003, 0.25 * (b->shape == TSUYA_DRAPE_BOX ? b->b.z - b->a.z : b->radius_m)); /* the smooth mesh cuts corners */
        tsuya_vec3 top = {b->b.x, b->b.y, b->b.z - inside};
        tsuya_status status = b->shape == TSUYA_DRAPE_BOX   ? add_box(prop, count, b, inside)
                              : b->shape == TSUYA_DRAPE_DISC ? add_round(prop, count, b->a, top, b->radius_m - inside, b->radius_m - inside, 0.0, 1e-4)
                              : b->shape == TSUYA_DRAPE_BAR  ? add_round(prop, count, b->a, b->b, b->radius_m - inside, b->radius_m - inside, b->radius_m, b->radius_m)
                                                             : add_round(prop, count, b->a, b->b, b->radius_m - inside, b->radius_b_m - inside,
                                                                         b->radius_m - inside, b->radius_b_m - inside);
        TSUYA_TRY(status);
    }
    return TSUYA_OK;
}

tsuya_pose tsuya_simulate_chart_pose(const tsuya_simulate_scene *s)
{
    tsuya_vec3 foot = tsuya_simulate_foot(s);
    tsuya_pose pose = tsuya_pose_identity();
    pose.translation = s->has_mat ? (tsuya_vec3){2.0 * foot.x + 1e-3 * s->mat.gap_mm + 0.03, 0.0, 1e-4}
                                  : (tsuya_vec3){foot.x + 0.6 * fmax(s->cloth.side_m, s->stand.length_m), foot.y - 0.07, 1e-4};
    return pose;
}

tsuya_status tsuya_simulate_props(tsuya_studio_prop prop[SIMULATE_PROPS], int *count, const tsuya_simulate_scene *s)
{
    tsuya_vec3 floor = tsuya_simulate_foot(s);
    floor.z -= 5e-4;
    *count = 0;
    TSUYA_TRY(tsuya_studio_prop_floor(&prop[0], floor));
    *count = 1;
    TSUYA_TRY(add_stand(prop, count, s));
    if (s->has_mat) {
        tsuya_studio_grid grid = {s->mat.family, s->mat.border_bits, s->mat.cols, s->mat.rows, s->mat.first_id, s->mat.tag_mm, s->mat.gap_mm};
        TSUYA_TRY(tsuya_studio_prop_tags(&prop[*count], tsuya_pose_identity(), &grid));
        ++*count;
    }
    if (s->chart) {
        TSUYA_TRY(tsuya_studio_prop_chart(&prop[*count], tsuya_simulate_chart_pose(s)));
        ++*count;
    }
    return TSUYA_OK;
}

tsuya_status tsuya_simulate_camera(tsuya_camera *camera, const tsuya_simulate_scene *s)
{
    const tsuya_scene_camera *c = &s->camera;
    const double *size = c->size.item, *center = c->center_px.item;
    if (c->model) {
        tsuya_pose pose;
        char *folder = tsuya_path_folder(s->path), *path = folder ? tsuya_path_join(folder, c->model) : NULL;
        tsuya_status status = path ? tsuya_cameramodel_load(camera, &pose, path) : TSUYA_ERROR_MEMORY;
        tsuya_free(folder);
        tsuya_free(path);
        return status;
    }
    *camera = (tsuya_camera){.width_px = size ? (int)size[0] : 800, .height_px = size ? (int)size[1] : 600, .fx_px = c->focal_px, .fy_px = c->focal_px};
    camera->cx_px = center ? center[0] : 0.5 * (camera->width_px - 1);
    camera->cy_px = center ? center[1] : 0.5 * (camera->height_px - 1);
    int n = c->distortion.count;
    camera->lens = n == 0 ? TSUYA_LENS_PINHOLE : n == 4 ? TSUYA_LENS_OPENCV4 : n == 5 ? TSUYA_LENS_OPENCV5 : n == 8 ? TSUYA_LENS_OPENCV8 : TSUYA_LENS_OPENCV12;
    for (int k = 0; k < n; k++) {
        camera->distortion[k] = ((const double *)c->distortion.item)[k];
    }
    return TSUYA_OK;
}

/* Of a whole ring, which starts at azimuth_deg, or of an arc with azimuth_deg in its middle. */
static double ring_azimuth(const tsuya_scene_view *v, double i)
{
    double sweep = tsuya_rad_from_deg(v->sweep_deg), start = v->sweep_deg < 360.0 ? 0.5 / v->count - 0.5 : 0.0;
    return tsuya_rad_from_deg(v->azimuth_deg) + sweep * (start + i / v->count);
}

/* By hand: evenly spaced, each place off by a few per cent and aimed a little beside. */
static simulate_view ring_view(const tsuya_scene_view *v, tsuya_vec3 target, int i, int number, uint64_t seed)
{
    double jitter[5];
    for (int k = 0; k < 5; k++) {
        jitter[k] = v->jitter * 2.0 * (tsuya_random_uniform(seed, SIMULATE_POSES, (uint64_t)(5 * number + k)) - 0.5);
    }
    double azimuth = ring_azimuth(v, i + 3.0 * jitter[0]);
    double elevation = tsuya_rad_from_deg(v->elevation_deg) + jitter[1], distance = v->distance_m * (1.0 + 0.5 * jitter[2]);
    tsuya_vec3 aim = {target.x + 0.5 * jitter[3] * distance, target.y + 0.5 * jitter[4] * distance, target.z};
    tsuya_vec3 eye = {aim.x + distance * cos(elevation) * cos(azimuth), aim.y + distance * cos(elevation) * sin(azimuth), aim.z + distance * sin(elevation)};
    return (simulate_view){tsuya_pose_look_at(eye, aim, (tsuya_vec3){0, 0, 1}), distance, false};
}

static tsuya_vec3 turned(tsuya_vec3 p, double angle_rad)
{
    return (tsuya_vec3){p.x * cos(angle_rad) - p.y * sin(angle_rad), p.x * sin(angle_rad) + p.y * cos(angle_rad), p.z};
}

/* On a turntable: one camera, off by a few per cent and aimed a little beside the axis, the same for the whole round; the table stops a
 * part of its step beside where it should. */
static simulate_view turntable_view(const tsuya_scene_view *v, tsuya_vec3 axis, int i, int first, uint64_t seed)
{
    double jitter[5];
    for (int k = 0; k < 5; k++) {
        int number = k == 0 ? first + i : first;
        jitter[k] = v->jitter * 2.0 * (tsuya_random_uniform(seed, SIMULATE_POSES, (uint64_t)(5 * number + k)) - 0.5);
    }
    double angle = ring_azimuth(v, i + jitter[0]);
    double elevation = tsuya_rad_from_deg(v->elevation_deg) + jitter[1], distance = v->distance_m * (1.0 + 0.5 * jitter[2]);
    tsuya_vec3 aim = {0.5 * jitter[3] * distance, 0.5 * jitter[4] * distance, 0.0};
    tsuya_vec3 eye = tsuya_vec3_add(aim, (tsuya_vec3){distance * cos(elevation), 0.0, distance * sin(elevation)});
    aim = tsuya_vec3_add(axis, turned(aim, angle));
    eye = tsuya_vec3_add(axis, turned(eye, angle));
    return (simulate_view){tsuya_pose_look_at(eye, aim, (tsuya_vec3){0, 0, 1}), distance, false};
}

/* Straight before a vertex; the share of the picture that the cloth fills.  0 where something stands between, or under the floor, or below a half. */
static double close_view(simulate_view *view, tsuya_vec3 *at, const tsuya_scene_view *v, const tsuya_simulate_scene *s, const tsuya_camera *camera,
                       const tsuya_mesh *mesh, size_t vertex, uint64_t seed)
{
    const float *nf = mesh->normal + 3 * vertex;
    tsuya_vec3 n = {nf[0], nf[1], nf[2]}, foot = tsuya_simulate_foot(s);
    double distance = camera->fx_px * 1e-3 * s->cloth.weft_mm / v->px_per_thread;
    *at = tsuya_mesh_position(mesh, vertex);
    tsuya_vec3 out = tsuya_vec3_sub(*at, foot);
    double side = n.z * 0.3 + n.x * out.x + n.y * out.y < 0.0 ? -1.0 : 1.0;
    n.z = side * n.z + 0.25; /* from a little above */
    n = tsuya_vec3_unit((tsuya_vec3){side * n.x, side * n.y, n.z});
    tsuya_vec3 eye = tsuya_vec3_mad(*at, distance * (1.0 + v->jitter * (tsuya_random_uniform(seed, SIMULATE_CLOSE, 7 * vertex) - 0.5)), n);
    *view = (simulate_view){tsuya_pose_look_at(eye, *at, (tsuya_vec3){0.1, 0, 1}), distance, true};
    if (eye.z < foot.z + 0.05 || fabs(n.z) > 0.98) {
        return 0.0;
    }
    tsuya_camera small = tsuya_camera_scaled(camera, 100, (int)fmax(1.0, 100.0 * camera->height_px / camera->width_px));
    tsuya_context alone = {.threads = 1, .seed = 1};
    tsuya_raster raster;
    tsuya_vec2 pixel;
    tsuya_vec3 p = tsuya_pose_apply(view->camera_from_world, *at);
    double share = 0.0;
    if (!tsuya_camera_project(&small, p, &pixel) || tsuya_raster_create(&raster, small.width_px, small.height_px) != TSUYA_OK) {
        return 0.0;
    }
    if (tsuya_raster_draw(&raster, mesh, &small, view->camera_from_world, &alone) == TSUYA_OK) {
        int x = (int)fmin(fmax(round(pixel.x), 0), small.width_px - 1), y = (int)fmin(fmax(round(pixel.y), 0), small.height_px - 1);
        size_t covered = 0;
        for (size_t k = 0; k < (size_t)small.width_px * (size_t)small.height_px; k++) {
            covered += raster.depth[k] > 0.0f;
        }
        share = fabs((double)raster.depth[y * small.width_px + x] / p.z - 1.0) < 0.03 ? (double)covered / (small.width_px * small.height_px) : 0.0;
    }
    tsuya_raster_free(&raster);
    return share > 0.5 ? share : 0.0;
}

/* Close-ups spread over the cloth: of some candidates that can be seen, one far from those before and full of cloth. */
static tsuya_status close_views(simulate_view *view, const tsuya_scene_view *v, const tsuya_simulate_scene *s, const tsuya_camera *camera,
                                const tsuya_studio_cloth *cloth, uint64_t seed)
{
    enum { CANDIDATES = 40 };
    tsuya_vec3 *taken = tsuya_arena_alloc(s->arena, (size_t)v->count, sizeof *taken);
    for (int i = 0; taken && i < v->count; i++) {
        double best = -1.0;
        for (int k = 0; k < CANDIDATES; k++) {
            simulate_view own;
            tsuya_vec3 at;
            size_t vertex = (size_t)(tsuya_random_uniform(seed, SIMULATE_CLOSE, (uint64_t)(i * CANDIDATES + k)) * (double)cloth->mesh.vertex_count);
            double nearest = 1e9;
            double share = close_view(&own, &at, v, s, camera, &cloth->mesh, vertex, seed);
            if (share == 0.0) {
                continue;
            }
            for (int j = 0; j < i; j++) {
                nearest = fmin(nearest, tsuya_vec3_norm(tsuya_vec3_sub(at, taken[j])));
            }
            if (nearest * share * share > best) {
                best = nearest * share * share;
                view[i] = own;
                taken[i] = at;
            }
        }
        if (best < 0.0) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: views: px_per_thread: %g leaves no place for a close-up; a smaller number is accepted", s->path,
                              v->px_per_thread);
        }
    }
    return taken ? TSUYA_OK : TSUYA_ERROR_MEMORY;
}

tsuya_status tsuya_simulate_views(simulate_view **view, int *count, const tsuya_simulate_scene *s, const tsuya_camera *camera, const tsuya_studio_cloth *cloth,
                                  uint64_t seed)
{
    tsuya_vec3 low, high;
    int total = 0, at = 0;
    for (int r = 0; r < s->views.count; r++) {
        total += ((const tsuya_scene_view *)s->views.item)[r].count;
    }
    *view = tsuya_arena_alloc(s->arena, (size_t)total, sizeof **view);
    if (!*view) {
        return TSUYA_ERROR_MEMORY;
    }
    tsuya_mesh_bounds(&cloth->mesh, &low, &high);
    for (int r = 0; r < s->views.count; r++) {
        const tsuya_scene_view *v = (const tsuya_scene_view *)s->views.item + r;
        tsuya_vec3 target = {0.5 * (low.x + high.x), 0.5 * (low.y + high.y), isnan(v->target_m) ? 0.5 * (low.z + high.z) : v->target_m};
        if (!isnan(v->px_per_thread)) {
            TSUYA_TRY(close_views(*view + at, v, s, camera, cloth, seed));
        }
        for (int i = 0; i < v->count && isnan(v->px_per_thread); i++) {
            (*view)[at + i] = v->turntable ? turntable_view(v, target, i, at, seed) : ring_view(v, target, i, at + i, seed);
        }
        at += v->count;
    }
    *count = total;
    return TSUYA_OK;
}

tsuya_pose tsuya_simulate_board_pose(double *distance_m, const tsuya_simulate_scene *s, const tsuya_camera *camera, int i, uint64_t seed)
{
    const tsuya_scene_tags *b = &s->board;
    double u[6], width = 1e-3 * (b->cols * b->tag_mm + (b->cols - 1) * b->gap_mm), height = 1e-3 * (b->rows * b->tag_mm + (b->rows - 1) * b->gap_mm);
    for (int k = 0; k < 6; k++) {
        u[k] = tsuya_random_uniform(seed, SIMULATE_BOARD, (uint64_t)(6 * i + k));
    }
    double fill = 0.6 + 0.35 * u[0], tilt = tsuya_rad_from_deg(i % 5 == 0 ? 5.0 : 20.0 + 20.0 * u[1]), turn = 2.0 * M_PI * u[2];
    double distance = fmax(camera->fx_px * width / (fill * camera->width_px), camera->fy_px * height / (fill * camera->height_px));
    double reach = 0.6 - 0.45 * fill; /* of the board's middle from the image's middle, to reach its corners and not leave it */
    tsuya_vec2 pixel = {(0.5 + reach * (i % 3 - 1)) * (camera->width_px - 1), (0.5 + reach * (i / 3 % 3 - 1)) * (camera->height_px - 1)};
    tsuya_vec3 ray = {0, 0, 1};
    (void)tsuya_camera_unproject(camera, pixel, &ray);
    tsuya_vec3 middle = tsuya_vec3_scale(ray, distance / ray.z);
    const tsuya_mat3 facing = {{{1, 0, 0}, {0, -1, 0}, {0, 0, -1}}};
    tsuya_mat3 roll = tsuya_mat3_from_rodrigues((tsuya_vec3){0, 0, 0.5 * (u[3] - 0.5)});
    tsuya_mat3 rotation = tsuya_mat3_multiply(tsuya_mat3_multiply(tsuya_mat3_from_rodrigues((tsuya_vec3){tilt * cos(turn), tilt * sin(turn), 0}), facing), roll);
    *distance_m = distance;
    return (tsuya_pose){rotation, tsuya_vec3_sub(middle, tsuya_mat3_apply(rotation, (tsuya_vec3){0.5 * width, 0.5 * height, 0}))};
}

typedef struct lamp { const char *type; tsuya_vec3 position, aim; double size[2], rgb[3]; } lamp;

static const char *lamp_json(const tsuya_simulate_scene *s, const lamp *l, bool last)
{
    const char *rgb = tsuya_arena_printf(s->arena, "\"rgb\": [%.9g, %.9g, %.9g]}%s\n", l->rgb[0], l->rgb[1], l->rgb[2], last ? "" : ",");
    tsuya_vec3 d = tsuya_vec3_unit(tsuya_vec3_sub(l->aim, l->position)), up = fabs(d.z) > 0.99 ? (tsuya_vec3){0, 1, 0} : (tsuya_vec3){0, 0, 1};
    if (is(l->type, "environment")) {
        return tsuya_arena_printf(s->arena, " {\"type\": \"environment\", %s", rgb ? rgb : "");
    }
    const char *place = tsuya_arena_printf(s->arena, "\"position_m\": [%.9g, %.9g, %.9g]", l->position.x, l->position.y, l->position.z);
    const char *shape = is(l->type, "point") ? ""
                        : tsuya_arena_printf(s->arena, ", \"direction\": [%.9g, %.9g, %.9g], \"up\": [%g, %g, %g], \"size_m\": [%.9g, %.9g]", d.x, d.y, d.z,
                                             up.x, up.y, up.z, l->size[0], l->size[1]);
    return tsuya_arena_printf(s->arena, " {\"type\": \"%s\", %s%s, %s", l->type, place ? place : "", shape ? shape : "", rgb ? rgb : "");
}

static lamp given(const tsuya_scene_lamp *l, tsuya_vec3 foot, tsuya_vec3 middle)
{
    const double *p = l->position_m.item, *a = l->aim_m.item, *size = l->size_m.item, *rgb = l->rgb.item;
    lamp own = {.type = l->type, .aim = middle, .rgb = {rgb[0], rgb[1], rgb[2]}};
    own.position = p ? tsuya_vec3_add(foot, (tsuya_vec3){p[0], p[1], p[2]}) : own.position;
    own.aim = a ? tsuya_vec3_add(foot, (tsuya_vec3){a[0], a[1], a[2]}) : own.aim;
    for (int k = 0; size && k < 2; k++) {
        own.size[k] = size[k < l->size_m.count ? k : 0];
    }
    return own;
}

/* As a tape measure, an angle finder and a light meter give it. */
static lamp measure(lamp l, int i, uint64_t seed)
{
    const double place_m = 0.005, angle = 0.01, level = 0.02;
    double off[7], distance = tsuya_vec3_norm(tsuya_vec3_sub(l.aim, l.position));
    for (int k = 0; k < 7; k++) {
        off[k] = tsuya_random_normal(seed, SIMULATE_LAMPS, (uint64_t)(7 * i + k));
    }
    l.position = tsuya_vec3_mad(l.position, place_m, (tsuya_vec3){off[0], off[1], off[2]});
    l.aim = tsuya_vec3_mad(l.aim, angle * distance, (tsuya_vec3){off[3], off[4], off[5]});
    for (int c = 0; c < 3; c++) {
        l.rgb[c] *= 1.0 + level * off[6];
    }
    return l;
}

static const char *lamps_json(const tsuya_simulate_scene *s, const lamp *l, int count)
{
    const char *text = "{\"lights\": [\n";
    for (int i = 0; i < count && text; i++) {
        const char *line = lamp_json(s, &l[i], i + 1 == count);
        text = line ? tsuya_arena_printf(s->arena, "%s%s", text, line) : NULL;
    }
    return text ? tsuya_arena_printf(s->arena, "%s]}\n", text) : NULL;
}

tsuya_status tsuya_simulate_lights(const char **json, const char **measured, const tsuya_simulate_scene *s, tsuya_vec3 low, tsuya_vec3 high, uint64_t seed)
{
    tsuya_vec3 foot = tsuya_simulate_foot(s), middle = tsuya_vec3_scale(tsuya_vec3_add(low, high), 0.5);
    double k = 0.5 * tsuya_vec3_norm(tsuya_vec3_sub(high, low)) / 0.17; /* a soft key, a fill, a dim room, as large as the subject asks */
    const lamp usual[3] = {
        {"rect", {middle.x + 0.9 * k, middle.y - 0.7 * k, middle.z + 1.2 * k}, middle, {0.6 * k, 0.6 * k}, {9.2, 9.0, 8.6}},
        {"rect", {middle.x - 1.0 * k, middle.y + 0.5 * k, middle.z + 0.8 * k}, middle, {0.8 * k, 0.8 * k}, {3.0, 3.1, 3.3}},
        {.type = "environment", .rgb = {0.55, 0.55, 0.56}},
    };
    int count = s->lamps.count > 0 ? s->lamps.count : 3;
    lamp *own = tsuya_arena_alloc(s->arena, (size_t)count, sizeof *own), *told = tsuya_arena_alloc(s->arena, (size_t)count, sizeof *told);
    for (int i = 0; i < count && own && told; i++) {
        own[i] = s->lamps.count > 0 ? given((const tsuya_scene_lamp *)s->lamps.item + i, foot, middle) : usual[i];
        told[i] = measure(own[i], i, seed);
    }
    *json = own && told ? lamps_json(s, own, count) : NULL;
    *measured = own && told ? lamps_json(s, told, count) : NULL;
    return *json && *measured ? TSUYA_OK : TSUYA_ERROR_MEMORY;
}
