#include "support.h"

#include "core/memory.h"
#include "core/shapes.h"
#include "reconstruct/color.h"
#include "workspace.h"

static tsuya_status color_of(tsuya_mesh *mesh, const char *workspace, const char *const *hold_out, int hold_out_count,
                             bool equalise, int threads)
{
    tsuya_context context = tsuya_context_default();
    tsuya_color_options options = {workspace, hold_out, hold_out_count, equalise};
    context.threads = threads;
    TSUYA_TRY(shape_sphere(mesh, (tsuya_vec3){0, 0, 0}, 1.0, 60, 120));
    return tsuya_mesh_color(mesh, &options, &context);
}

/* 95th percentile of the largest channel's difference in 8-bit sRGB from the reflectance times `scale`, where cameras see. */
static int color_error(const tsuya_mesh *mesh, double scale)
{
    int histogram[256] = {0}, total = 0, above = 0, at = 255;
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        tsuya_vec3 p = tsuya_mesh_position(mesh, v), r = workspace_reflectance(p);
        const double c[3] = {r.x, r.y, r.z};
        int worst = 0;
        for (size_t k = 0; k < 3; k++) {
            int truth = (int)lrintf(255.0f * tsuya_srgb_encode((float)(c[k] * scale)));
            int off = abs(truth - mesh->color[3 * v + k]);
            worst = off > worst ? off : worst;
        }
        if (fabs(p.z) < 0.9) {
            histogram[worst]++;
            total++;
        }
    }
    while (at > 0 && 20 * (above + histogram[at]) <= total) {
        above += histogram[at--];
    }
    return at;
}

static void colours_are_the_surface_s_own(void **state)
{
    (void)state;
    const char *folder = test_path("dense");
    workspace_options options = {.spoiled = -1};
    tsuya_mesh mesh;
    workspace_make(folder, &options);
    assert_ok(color_of(&mesh, folder, NULL, 0, false, 2));
    int error = color_error(&mesh, 1.0);
    print_message("plain: 95 %% within %d of 255\n", error);
    assert_true(error <= 3);
    tsuya_mesh_free(&mesh);
    options.masks = true; /* a mask changes little */
    workspace_make(folder, &options);
    assert_ok(color_of(&mesh, folder, NULL, 0, true, 2));
    assert_true(color_error(&mesh, 1.0) <= 4);
    tsuya_mesh_free(&mesh);
}

static void highlights_that_move_are_left_out(void **state)
{
    (void)state;
    const char *folder = test_path("dense");
    workspace_options options = {.spoiled = -1, .highlight = true};
    tsuya_mesh mesh;
    workspace_make(folder, &options);
    assert_ok(color_of(&mesh, folder, NULL, 0, false, 2));
    int error = color_error(&mesh, 1.0);
    print_message("highlights: 95 %% within %d of 255\n", error);
    assert_true(error <= 5); /* inside a highlight a single photograph is off by more than 100 */
    tsuya_mesh_free(&mesh);
}

static void exposures_are_brought_together(void **state)
{
    (void)state;
    const char *folder = test_path("dense");
    workspace_options options = {.spoiled = -1, .gain = {0.7, 1.3, 1, 1.2, 0.8, 1, 1.25, 0.75, 1.1, 0.9}};
    tsuya_mesh mesh;
    workspace_make(folder, &options);
    int error[2];
    for (int equalise = 0; equalise < 2; equalise++) {
        assert_ok(color_of(&mesh, folder, NULL, 0, equalise, 2));
        error[equalise] = 255;
        for (double scale = 0.85; scale < 1.16; scale += 0.01) { /* the common gain is free */
            int here = color_error(&mesh, scale);
            error[equalise] = here < error[equalise] ? here : error[equalise];
        }
        tsuya_mesh_free(&mesh);
    }
    print_message("exposures differ by up to 1.9: 95 %% within %d, equalised %d\n", error[0], error[1]);
    assert_true(error[1] <= 5 && error[0] > error[1]);
}

static void held_out_photographs_are_not_looked_at(void **state)
{
    (void)state;
    const char *folder = test_path("dense");
    workspace_options options = {.spoiled = 4};
    static const char *const hold_out[WORKSPACE_VIEWS] = {"view04.png", "view00.png", "view01.png", "view02.png", "view03.png",
                                                          "view05.png", "view06.png", "view07.png", "view08.png", "view09.png"};
    tsuya_mesh mesh;
    workspace_make(folder, &options);
    assert_int_equal(unlink(test_path("dense/images/view04.png")), 0); /* not even opened */
    assert_ok(color_of(&mesh, folder, hold_out, 1, false, 2));
    assert_true(color_error(&mesh, 1.0) <= 4);
    tsuya_mesh_free(&mesh);
    assert_fails(color_of(&mesh, folder, NULL, 0, false, 1), "view04.png");
    tsuya_mesh_free(&mesh);
    assert_fails(color_of(&mesh, folder, hold_out, WORKSPACE_VIEWS, false, 1), "none of its 10 photographs");
    tsuya_mesh_free(&mesh);
}

static void wrong_photographs_are_named(void **state)
{
    (void)state;
    const char *folder = test_path("dense");
    workspace_options options = {.spoiled = -1};
    tsuya_mesh mesh;
    tsuya_image small;
    workspace_make(folder, &options);
    assert_ok(tsuya_image_create(&small, 40, 30, 3, TSUYA_SAMPLE_U8, TSUYA_ENCODING_SRGB));
    assert_ok(tsuya_image_save(&small, test_path("dense/images/view02.png"), NULL));
    tsuya_image_free(&small);
    assert_fails(color_of(&mesh, folder, NULL, 0, false, 1), "view02.png: 40 × 30");
    tsuya_mesh_free(&mesh);
    assert_ok(tsuya_file_write(test_path("dense/images/view02.png"), "no image", 8));
    assert_fails(color_of(&mesh, folder, NULL, 0, false, 1), "view02.png");
    tsuya_mesh_free(&mesh);
}

static void the_number_of_threads_changes_no_byte(void **state)
{
    (void)state;
    const char *folder = test_path("dense");
    workspace_options options = {.spoiled = -1, .highlight = true, .masks = true};
    tsuya_mesh one, many;
    workspace_make(folder, &options);
    assert_ok(color_of(&one, folder, NULL, 0, true, 1));
    assert_ok(color_of(&many, folder, NULL, 0, true, 5));
    assert_memory_equal(one.color, many.color, 3 * one.vertex_count);
    tsuya_mesh_free(&one);
    tsuya_mesh_free(&many);
}

static void every_allocation_may_fail(void **state)
{
    (void)state;
    const char *folder = test_path("dense");
    workspace_options options = {.spoiled = -1, .masks = true};
    tsuya_mesh mesh;
    workspace_make(folder, &options);
    tsuya_memory_fail_at(0);
    assert_ok(color_of(&mesh, folder, NULL, 0, true, 1));
    uint64_t count = tsuya_memory_fail_at(0);
    tsuya_mesh_free(&mesh);
    for (uint64_t n = 1; n <= count; n++) {
        tsuya_memory_fail_at(n);
        assert_int_equal(color_of(&mesh, folder, NULL, 0, true, 1), TSUYA_ERROR_MEMORY);
        tsuya_mesh_free(&mesh);
    }
    tsuya_memory_fail_at(0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(colours_are_the_surface_s_own),
        cmocka_unit_test(highlights_that_move_are_left_out),
        cmocka_unit_test(exposures_are_brought_together),
        cmocka_unit_test(held_out_photographs_are_not_looked_at),
        cmocka_unit_test(wrong_photographs_are_named),
        cmocka_unit_test(the_number_of_threads_changes_no_byte),
        cmocka_unit_test(every_allocation_may_fail),
    };
    return cmocka_run_group_tests(tests, NULL, test_folder_tear_down);
}
