#include "support.h"

#include "render_scenes.h"

#include "core/memory.h"

static void grid_triangles(tsuya_mesh *mesh, int columns, int rows)
{
    uint32_t *t = mesh->triangle;
    for (int j = 0; j < rows; ++j) {
        for (int i = 0; i < columns; ++i, t += 6) {
            uint32_t a = (uint32_t)(j * (columns + 1) + i), b = a + 1, c = a + (uint32_t)columns + 1, d = c + 1;
            const uint32_t corners[6] = {a, b, d, a, d, c};
            memcpy(t, corners, sizeof corners);
        }
    }
}

static void set3(float *out, double x, double y, double z)
{
    out[0] = (float)x;
    out[1] = (float)y;
    out[2] = (float)z;
}

void scene_plane(tsuya_mesh *mesh, double side, int cells)
{
    size_t n = (size_t)cells + 1;
    assert_ok(tsuya_mesh_create(mesh, n * n, 2 * (size_t)cells * (size_t)cells, TSUYA_MESH_NORMAL | TSUYA_MESH_WEFT));
    for (size_t v = 0; v < n * n; ++v) {
        set3(mesh->position + 3 * v, side * ((double)(v % n) / cells - 0.5), side * ((double)(v / n) / cells - 0.5), 0.0);
        set3(mesh->normal + 3 * v, 0, 0, 1);
        set3(mesh->weft + 3 * v, 1, 0, 0);
    }
    grid_triangles(mesh, cells, cells);
}

void scene_turn_weft(tsuya_mesh *mesh, double every_m)
{
    for (size_t v = 0; v < mesh->vertex_count; ++v) {
        double a = 2.0 * M_PI * (double)mesh->position[3 * v] / every_m;
        mesh->weft[3 * v] = (float)cos(a);
        mesh->weft[3 * v + 1] = (float)sin(a);
    }
}

void scene_sphere(tsuya_mesh *mesh, double radius, int rows, bool flat)
{
    int columns = 2 * rows;
    size_t n = (size_t)columns + 1;
    assert_ok(tsuya_mesh_create(mesh, n * ((size_t)rows + 1), 2 * (size_t)rows * (size_t)columns, TSUYA_MESH_NORMAL | TSUYA_MESH_WEFT));
    for (size_t v = 0; v < mesh->vertex_count; ++v) {
        double phi = 2.0 * M_PI * (double)(v % n % (size_t)columns) / columns, theta = M_PI - M_PI * (double)(v / n) / rows;
        double x = sin(theta) * cos(phi), y = sin(theta) * sin(phi), z = cos(theta);
        set3(mesh->position + 3 * v, radius * x, radius * y, radius * z);
        set3(mesh->normal + 3 * v, flat ? 0 : x, flat ? 0 : y, flat ? 0 : z);
        set3(mesh->weft + 3 * v, -sin(phi), cos(phi), 0);
    }
    grid_triangles(mesh, columns, rows);
}

void scene_cube(tsuya_mesh *mesh)
{
    assert_ok(tsuya_mesh_create(mesh, 24, 12, TSUYA_MESH_NORMAL | TSUYA_MESH_WEFT));
    for (int face = 0; face < 6; ++face) {
        double side = face % 2 ? 1.0 : -1.0;
        int axis = face / 2;
        for (int k = 0; k < 4; ++k) {
            double p[3], n[3] = {0, 0, 0}, w[3] = {0, 0, 0};
            p[axis] = side;
            p[(axis + 1) % 3] = k % 2 ? 1.0 : -1.0;
            p[(axis + 2) % 3] = k / 2 ? 1.0 : -1.0;
            n[axis] = -side;
            w[(axis + 1) % 3] = 1.0;
            set3(mesh->position + 3 * (4 * face + k), p[0], p[1], p[2]);
            set3(mesh->normal + 3 * (4 * face + k), n[0], n[1], n[2]);
            set3(mesh->weft + 3 * (4 * face + k), w[0], w[1], w[2]);
        }
        uint32_t a = (uint32_t)(4 * face);
        const uint32_t inward[2][6] = {{a, a + 1, a + 3, a, a + 3, a + 2}, {a, a + 3, a + 1, a, a + 2, a + 3}};
        memcpy(mesh->triangle + 6 * face, inward[face % 2], sizeof inward[0]);
    }
}

void scene_drape(tsuya_mesh *mesh, int cells)
{
    size_t n = (size_t)cells + 1;
    assert_ok(tsuya_mesh_create(mesh, n * n, 2 * (size_t)cells * (size_t)cells,
                                TSUYA_MESH_NORMAL | TSUYA_MESH_WEFT | TSUYA_MESH_COLOR | TSUYA_MESH_CONFIDENCE));
    for (size_t v = 0; v < n * n; ++v) {
        double u = 2.0 * (double)(v % n) / cells - 1.0, w = 2.0 * (double)(v / n) / cells - 1.0;
        double r = hypot(u, w), phi = atan2(w, u), fall = fmax(0.0, r - 0.35);
        double spread = 0.35 < r ? 0.35 + 0.45 * fall : r, fold = 1.0 + 0.28 * fall * sin(9.0 * phi + 2.0 * r);
        double height = 0.9 - 0.35 * r * r - 1.05 * fall * fall / (0.25 + fall) * 1.4 + 0.02 * sin(23.0 * u) * sin(17.0 * w) * fall;
        set3(mesh->position + 3 * v, spread * fold * cos(phi), spread * fold * sin(phi), height);
        mesh->weave_confidence[v] = 1.0f;
        for (int c = 0; c < 3; ++c) {
            mesh->color[3 * v + (size_t)c] = (uint8_t)(c == 0 ? 150 : c == 1 ? 40 : 55);
        }
    }
    grid_triangles(mesh, cells, cells);
    assert_ok(tsuya_mesh_compute_normals(mesh));
    for (size_t v = 0; v < n * n; ++v) { /* weft along the grid's rows */
        size_t a = v % n == 0 ? v : v - 1, b = v % n == n - 1 ? v : v + 1;
        tsuya_vec3 along = tsuya_vec3_sub(tsuya_mesh_position(mesh, b), tsuya_mesh_position(mesh, a));
        tsuya_vec3 weft = tsuya_vec3_unit(along);
        set3(mesh->weft + 3 * v, weft.x, weft.y, weft.z);
    }
}

void scene_camera(tsuya_camera *camera, tsuya_pose *pose, tsuya_vec3 eye, tsuya_vec3 target, double field_deg, int width, int height)
{
    double f = 0.5 * (width < height ? width : height) / tan(0.5 * tsuya_rad_from_deg(field_deg));
    tsuya_vec3 forward = tsuya_vec3_unit(tsuya_vec3_sub(target, eye));
    *camera = (tsuya_camera){.lens = TSUYA_LENS_PINHOLE, .width_px = width, .height_px = height, .fx_px = f, .fy_px = f,
                             .cx_px = 0.5 * (width - 1), .cy_px = 0.5 * (height - 1)};
    *pose = tsuya_pose_look_at(eye, target, fabs(forward.z) < 0.99 ? (tsuya_vec3){0, 0, 1} : (tsuya_vec3){0, 1, 0});
}

tsuya_film scene_render_bands(const tsuya_mesh *mesh, const tsuya_shader *shader, const tsuya_bands *bands, const tsuya_light_set *lights,
                              const tsuya_camera *camera, tsuya_pose pose, const tsuya_path_options *options, int threads)
{
    tsuya_scene_options scene_options = tsuya_scene_options_default();
    tsuya_context context = tsuya_context_default();
    tsuya_scene *scene;
    tsuya_film film;
    tsuya_path_info info;
    context.threads = threads;
    scene_options.shader = shader;
    scene_options.shader_count = 1;
    scene_options.bands = bands;
    assert_ok(tsuya_scene_create(&scene, mesh, &scene_options));
    assert_ok(tsuya_path_render(&film, &info, scene, lights, camera, pose, options, &context));
    tsuya_scene_free(scene);
    return film;
}

tsuya_film scene_render(const tsuya_mesh *mesh, const tsuya_shader *shader, const tsuya_light_set *lights, const tsuya_camera *camera,
                        tsuya_pose pose, const tsuya_path_options *options, int threads)
{
    return scene_render_bands(mesh, shader, NULL, lights, camera, pose, options, threads);
}

double film_mean(const tsuya_film *film, int channel)
{
    size_t pixels = (size_t)film->width_px * (size_t)film->height_px;
    double sum = 0.0;
    for (size_t k = 0; k < pixels; ++k) {
        sum += film->rgb[3 * k + (size_t)channel];
    }
    return sum / (double)pixels;
}

double film_mean_error(const tsuya_film *film)
{
    size_t pixels = (size_t)film->width_px * (size_t)film->height_px;
    double sum = 0.0;
    for (size_t k = 0; k < pixels; ++k) {
        sum += (double)film->error[k] * film->error[k];
    }
    return sqrt(sum) / (double)pixels;
}

void add_light(tsuya_light_set *set, tsuya_light light)
{
    assert_ok(tsuya_light_set_add(set, &light, "test"));
}

tsuya_shader lambert(double reflectance)
{
    static tsuya_material *kept[64];
    static int count;
    const double rgb[3] = {reflectance, reflectance, reflectance};
    tsuya_shader shader;
    assert_true(count < 64);
    assert_ok(tsuya_material_lambert(&kept[count], rgb));
    assert_ok(tsuya_shader_from_material(&shader, kept[count++]));
    return shader;
}

tsuya_path_options options_of(int spp, int bounces)
{
    tsuya_path_options o = tsuya_path_options_default();
    o.spp = spp;
    o.bounces = bounces;
    return o;
}

void twenty_lamps(tsuya_light_set *lights)
{
    for (int k = 0; k < 20; ++k) {
        double a = 2.0 * M_PI * k / 20, h = 0.6 + 0.5 * (k % 4), s = 0.3 + 0.1 * (k % 3);
        tsuya_vec3 p = {1.6 * cos(a), 1.6 * sin(a), h};
        tsuya_light light = {.kind = k % 2 ? TSUYA_LIGHT_DISK : TSUYA_LIGHT_RECT, .position_m = p, .direction = tsuya_vec3_scale(p, -1.0),
                             .size_m = {s, s}, .rgb = {1.0 + k % 5, 2.0, 3.0 - k % 3}};
        add_light(lights, light);
    }
    add_light(lights, (tsuya_light){.kind = TSUYA_LIGHT_ENVIRONMENT, .rgb = {0.2, 0.3, 0.4}});
}
