/* Dyes from photographs under known lamps, held against pictures that the path tracer draws of a cloth with known dyes. */
#include "support.h"

#include "brdf/material.h"

#include "core/image.h"
#include "core/mesh.h"

#include "render/dye.h"
#include "render/render.h"
#include "render/split.h"

#include "render_scenes.h"

enum { CELLS = 100, VIEWS = 8 };

static const char *keep_path(const char *name)
{
    static char text[16][TEST_PATH];
    static int next;
    char *own = text[next++ % 16];
    snprintf(own, TEST_PATH, "%s", test_path(name));
    return own;
}

/* Reflectances between 0.05 and 0.65 in patches, of another course in every channel. */
static double true_dye(const float *p, int c)
{
    double wave = sin(9.0 * (double)p[0] + c) * cos(7.0 * (double)p[1] - 2 * c);
    return 0.35 + 0.3 * wave;
}

static void paint(tsuya_mesh *mesh)
{
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        for (int c = 0; c < 3; c++) {
            mesh->color[3 * v + (size_t)c] = (uint8_t)lround(255.0 * (double)tsuya_srgb_encode((float)true_dye(mesh->position + 3 * v, c)));
        }
    }
}

typedef struct session {
    tsuya_sparse_model model;
    tsuya_camera camera;
    tsuya_view view[VIEWS];
    const char *photo[VIEWS], *material, *lights, *mesh;
    int index[VIEWS];
} session;

static void photograph(session *s, const char *lamps)
{
    const double strength[3] = {0.3, 0.3, 0.3}, dye[3] = {0.0, 0.0, 0.0};
    tsuya_context context = tsuya_context_default();
    tsuya_mesh mesh;
    tsuya_material *material;
    tsuya_render_info info;
    *s = (session){.material = NULL};
    s->material = keep_path("material.json");
    s->lights = keep_path("lights.json");
    s->mesh = keep_path("cloth.ply");
    scene_drape(&mesh, CELLS);
    paint(&mesh);
    assert_ok(tsuya_ply_save(&mesh, s->mesh, NULL));
    tsuya_mesh_free(&mesh);
    assert_ok(tsuya_material_ggx(&material, 0.25, 0.5, strength, 1.5, dye));
    assert_ok(tsuya_material_save(material, s->material));
    tsuya_material_free(material);
    assert_ok(tsuya_file_write(s->lights, lamps, strlen(lamps)));
    s->model = (tsuya_sparse_model){.camera = &s->camera, .camera_count = 1, .view = s->view, .view_count = VIEWS};
    for (int k = 0; k < VIEWS; k++) {
        double a = 2.0 * M_PI * k / VIEWS, height = k % 2 ? 1.5 : 3.0;
        static char name[VIEWS][16];
        snprintf(name[k], sizeof name[k], "p%d.exr", k);
        scene_camera(&s->camera, &s->view[k].camera_from_world, (tsuya_vec3){4.0 * cos(a), 4.0 * sin(a), height}, (tsuya_vec3){0, 0, 0}, 40.0, 200, 150);
        s->view[k].name = name[k];
        s->index[k] = k;
    }
    tsuya_render_options o = tsuya_render_options_default();
    o.mesh_path = s->mesh;
    o.material_path = &s->material;
    o.material_count = 1;
    o.lights_path = s->lights;
    o.model = &s->model;
    o.color = "photographs";
    o.vertex_dye_scale = 1.0;
    o.spp = 100;
    o.bounces = 3;
    o.output_folder = keep_path("photos");
    assert_ok(tsuya_render(&info, &o, &context));
    for (int k = 0; k < VIEWS; k++) {
        char name[32];
        snprintf(name, sizeof name, "photos/p%d.exr", k);
        s->photo[k] = keep_path(name);
    }
}

static int compare(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Median and p90 of the dyes' relative error, all channels. */
static void errors(double *median, double *p90, const tsuya_mesh *dyed)
{
    size_t count = 3 * dyed->vertex_count;
    double *error = tsuya_calloc(count, sizeof *error);
    assert_non_null(error);
    for (size_t k = 0; k < count; k++) {
        double truth = true_dye(dyed->position + 3 * (k / 3), (int)(k % 3));
        error[k] = fabs((double)tsuya_srgb_decode(dyed->color[k] / 255.0f) / truth - 1.0);
    }
    qsort(error, count, sizeof *error, compare);
    *median = error[count / 2];
    *p90 = error[(size_t)(0.9 * (double)count)];
    tsuya_free(error);
}

static void solve(tsuya_mesh *dyed, tsuya_dye_info *info, const session *s, int threads)
{
    tsuya_context context = tsuya_context_default();
    tsuya_mesh mesh;
    context.threads = threads;
    assert_ok(tsuya_ply_load(&mesh, s->mesh));
    memset(mesh.color, 128, 3 * mesh.vertex_count); /* nothing told */
    tsuya_dye_options o = {.material_path = &s->material, .material_count = 1, .lights_path = s->lights, .model = &s->model, .view = s->index,
                           .photo = s->photo, .view_count = VIEWS};
    assert_ok(tsuya_dye_from_photographs(dyed, info, &mesh, &o, &context));
    tsuya_mesh_free(&mesh);
}

/* An area lamp that casts shadows, a dim room, light from fold to fold; the gain is 1. */
static void test_dyes_come_back(void **state)
{
    (void)state;
    session s;
    tsuya_mesh dyed, again;
    tsuya_dye_info info, other;
    double median, p90;
    photograph(&s, "{\"lights\": [{\"type\": \"rect\", \"position_m\": [3, -2, 4], \"direction\": [-3, 2, -4], \"up\": [0, 0, 1], \"size_m\": [1, 1], \"rgb\": [30, 28, 24]},"
                   " {\"type\": \"environment\", \"rgb\": [0.2, 0.2, 0.25]}]}");
    solve(&dyed, &info, &s, 2);
    errors(&median, &p90, &dyed);
    print_message("dyes: median %.4f p90 %.4f, gain %.3f %.3f %.3f, residual %.4f, seen %.3f, split %d, %.1f s\n", median, p90, info.gain[0], info.gain[1],
                  info.gain[2], info.residual, info.seen, info.split, info.seconds);
    assert_true(median < 0.05 && p90 < 0.25);
    for (int c = 0; c < 3; c++) {
        assert_true(fabs(info.gain[c] - 1.0) < 0.03);
    }
    assert_true(info.residual < 0.03 && info.seen > 0.8);
    solve(&again, &other, &s, 1); /* the same bytes with one thread */
    assert_int_equal(again.vertex_count, dyed.vertex_count);
    assert_memory_equal(again.color, dyed.color, 3 * dyed.vertex_count);
    tsuya_mesh_free(&dyed);
    tsuya_mesh_free(&again);
}

/* Lamps without blue: the other two channels say what they would have said. */
static void test_a_dark_channel(void **state)
{
    (void)state;
    session s;
    tsuya_mesh dyed;
    tsuya_dye_info info;
    photograph(&s, "{\"lights\": [{\"type\": \"rect\", \"position_m\": [3, -2, 4], \"direction\": [-3, 2, -4], \"up\": [0, 0, 1], \"size_m\": [1, 1], \"rgb\": [30, 28, 0]},"
                   " {\"type\": \"environment\", \"rgb\": [0.2, 0.2, 0]}]}");
    solve(&dyed, &info, &s, 2);
    print_message("gain %.3f %.3f %.3f\n", info.gain[0], info.gain[1], info.gain[2]);
    for (int c = 0; c < 3; c++) {
        assert_true(fabs(info.gain[c] - 1.0) < 0.03);
    }
    tsuya_mesh_free(&dyed);
}

static void test_bad_inputs(void **state)
{
    (void)state;
    session s;
    tsuya_context context = tsuya_context_default();
    tsuya_mesh mesh, dyed;
    tsuya_dye_info info;
    photograph(&s, "{\"lights\": [{\"type\": \"point\", \"position_m\": [3, -2, 4], \"rgb\": [20, 20, 20]}]}");
    assert_ok(tsuya_ply_load(&mesh, s.mesh));
    tsuya_dye_options o = {.material_path = &s.material, .material_count = 1, .lights_path = s.lights, .model = &s.model, .view = s.index,
                           .photo = s.photo, .view_count = VIEWS};
    const char *first = s.photo[0];
    s.photo[0] = s.lights; /* no picture */
    assert_int_not_equal(tsuya_dye_from_photographs(&dyed, &info, &mesh, &o, &context), TSUYA_OK);
    assert_null(dyed.position);
    s.photo[0] = first;
    for (int k = 0; k < VIEWS; k++) { /* all look away */
        s.view[k].camera_from_world.translation.z += 100.0;
        s.view[k].camera_from_world.translation.x += 1000.0;
    }
    assert_int_not_equal(tsuya_dye_from_photographs(&dyed, &info, &mesh, &o, &context), TSUYA_OK);
    assert_non_null(strstr(tsuya_reason(), "none of the 8 photographs"));
    tsuya_mesh_free(&mesh);
}

static double boundary_length(const tsuya_mesh *mesh)
{
    double length = 0.0;
    for (size_t s = 0; s < 3 * mesh->triangle_count; s++) {
        uint32_t a = mesh->triangle[s], b = mesh->triangle[s - s % 3 + (s + 1) % 3];
        bool shared = false;
        for (size_t o = 0; o < 3 * mesh->triangle_count && !shared; o++) {
            shared = mesh->triangle[o] == b && mesh->triangle[o - o % 3 + (o + 1) % 3] == a;
        }
        length += shared ? 0.0 : tsuya_vec3_norm(tsuya_vec3_sub(tsuya_mesh_position(mesh, a), tsuya_mesh_position(mesh, b)));
    }
    return length;
}

/* Area and boundary stay, so no crack opens and no triangle turns; arrays are interpolated. */
static void test_split(void **state)
{
    (void)state;
    tsuya_mesh mesh, fine;
    tsuya_split_place *place;
    scene_plane(&mesh, 2.0, 3);
    double area = tsuya_mesh_area(&mesh), boundary = boundary_length(&mesh);
    for (int n = 1; n <= 5; n++) {
        assert_ok(tsuya_mesh_split(&fine, &place, &mesh, n));
        assert_int_equal(fine.triangle_count, mesh.triangle_count * (size_t)(n * n));
        assert_int_equal(fine.vertex_count, (size_t)((3 * n + 1) * (3 * n + 1)));
        assert_true(fabs(tsuya_mesh_area(&fine) / area - 1.0) < 1e-6 && fabs(boundary_length(&fine) / boundary - 1.0) < 1e-6);
        for (size_t v = 0; v < fine.vertex_count; v++) {
            tsuya_vec3 p = {0, 0, 0};
            for (int k = 0; k < 3; k++) {
                p = tsuya_vec3_mad(p, (double)place[v].weight[k], tsuya_mesh_position(&mesh, place[v].corner[k]));
            }
            assert_true(tsuya_vec3_norm(tsuya_vec3_sub(p, tsuya_mesh_position(&fine, v))) < 1e-6);
            assert_true(fabs((double)fine.weft[3 * v] - 1.0) < 1e-6);
        }
        tsuya_mesh_free(&fine);
        tsuya_free(place);
    }
    assert_int_not_equal(tsuya_mesh_split(&fine, &place, &mesh, 65), TSUYA_OK);
    tsuya_mesh_free(&mesh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_dyes_come_back),
        cmocka_unit_test(test_a_dark_channel),
        cmocka_unit_test(test_bad_inputs),
        cmocka_unit_test(test_split),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
