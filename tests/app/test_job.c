/* JOB.yaml: what is read, what is filled in, what is refused and with which words. */
#include "support.h"

#include "app/job_files.h"
#include "app/stage.h"
#include "core/image.h"

static void write_photo(const char *name, int width, int height)
{
    tsuya_image image;
    assert_ok(tsuya_image_create(&image, width, height, 3, TSUYA_SAMPLE_U8, TSUYA_ENCODING_SRGB));
    assert_ok(tsuya_image_save(&image, test_path(name), NULL));
    tsuya_image_free(&image);
}

static int make_folder(void **state)
{
    (void)state;
    assert_ok(tsuya_folder_make(test_path("in/photos")));
    assert_ok(tsuya_folder_make(test_path("in/render/photos")));
    assert_ok(tsuya_folder_make(test_path("in/mixed")));
    for (int i = 0; i < 4; i++) {
        char name[64];
        snprintf(name, sizeof name, "in/photos/IMG_%02d.jpg", i);
        write_photo(name, 40, 30);
        snprintf(name, sizeof name, "in/render/photos/IMG_%02d.jpg", i);
        write_photo(name, 40, 30);
        snprintf(name, sizeof name, "in/mixed/IMG_%02d.jpg", i);
        write_photo(name, i == 2 ? 30 : 40, 30);
    }
    return 0;
}

static tsuya_status load(tsuya_job *job, const char *text, const char *folder)
{
    assert_ok(tsuya_file_write(test_path("in/JOB.yaml"), text, strlen(text)));
    return tsuya_job_load(job, test_path("in/JOB.yaml"), folder);
}

static void refuse(const char *text, const char *part)
{
    tsuya_job job;
    assert_fails(load(&job, text, NULL), part);
}

static void test_defaults(void **state)
{
    (void)state;
    tsuya_job job;
    assert_ok(load(&job, "name: robe\nphotos: photos/\n", NULL));
    assert_string_equal(job.name, "robe");
    assert_string_equal(job.photos, test_path("in/photos"));
    assert_string_equal(job.folder, test_path("in"));
    assert_int_equal(job.photo.count, 4);
    assert_false(job.has_camera);
    assert_int_equal(job.render.count, 1);
    assert_string_equal(tsuya_job_render_at(&job, 0)->name, "turntable");
    assert_int_equal(tsuya_job_render_at(&job, 0)->views, 12);
    tsuya_job_free(&job);
}

static void test_everything_that_is_supported(void **state)
{
    (void)state;
    tsuya_job job;
    assert_ok(load(&job,
                   "name: robe\nphotos: photos/\ntolerance: 0.5 mm\nhold_out: [IMG_01.jpg]\n"
                   "render:\n"
                   "  - {name: turn, views: 36, size: [1280, 960], color: \"#7a1f2b\", elevation: -20, exposure: 1.5, tolerance: 0.1}\n"
                   "  - {name: as-photographed, like: photos/, tolerance: 0}\n",
                   test_path("elsewhere")));
    assert_string_equal(job.folder, test_path("elsewhere"));
    assert_int_equal(job.hold_out.count, 1);
    assert_near(job.tolerance_units, 0.0005, 1e-12);
    assert_true(job.tolerance_in_metres);
    const tsuya_job_render *turn = tsuya_job_render_at(&job, 0);
    assert_int_equal(turn->width_px, 1280);
    assert_int_equal(turn->height_px, 960);
    assert_string_equal(turn->color, "#7a1f2b");
    assert_true(turn->elevation_deg == -20.0 && turn->exposure_ev == 1.5 && turn->tolerance == 0.1);
    assert_int_equal(tsuya_job_render_at(&job, 1)->views, 0);
    assert_true(isnan(tsuya_job_render_at(&job, 1)->elevation_deg) && tsuya_job_render_at(&job, 1)->tolerance == 0.0);
    tsuya_job_free(&job);
}

static void test_refusals(void **state)
{
    (void)state;
    refuse("name: robe\nphotos: photos\nmask: m\n", "masks");
    refuse("name: robe\n", "photos");
    refuse("name: robe\nphotos: nowhere\n", "does not exist");
    refuse("name: a/b\nphotos: photos\n", "name");
    refuse("name: robe\nphotos: photos\ntolerance: fine\n", "tolerance: 'fine' is not a length");
    refuse("name: robe\nphotos: photos\ntolerance: -1mm\n", "tolerance: '-1mm' is not a length");
    refuse("name: robe\nphotos: photos\nhold_out: [IMG_1.jpg]\n", "IMG_01.jpg");
    refuse("name: robe\nphotos: photos\nhold_out: [IMG_01.jpg, IMG_02.jpg]\n", "at least 3");
    refuse("name: robe\nphotos: mixed\n", "IMG_02.jpg");
    refuse("name: robe\nphotos: photos\nrender: [{name: t, views: 0}]\n", "views");
    refuse("name: robe\nphotos: photos\nrender: [{name: t, size: [10]}]\n", "size");
    refuse("name: robe\nphotos: photos\nrender: [{name: t, color: no-such-colour}]\n", "color");
    refuse("name: robe\nphotos: photos\nrender: [{name: t}, {name: t}]\n", "twice");
    refuse("name: robe\nphotos: photos\nrender: [{name: t, like: photos/}]\n", "hold_out");
    refuse("name: robe\nphotos: render/photos\n", "empties");
    refuse("name: robe\nphotos: photos\nhold_out: [IMG_01.jpg]\nrender: [{name: t, like: photos/, elevation: 5}]\n", "takes views, size, elevation and exposure");
    refuse("name: robe\nphotos: photos\nhold_out: [IMG_01.jpg]\nrender: [{name: t, like: photos/, exposure: 1}]\n", "takes views, size, elevation and exposure");
}

/* Numbers of a render entry that cannot be meant: each is named, with what would do. */
static void test_render_numbers(void **state)
{
    (void)state;
    static const struct { const char *written, *said; } bad[] = {
        {"elevation: 89.5", "elevation of: 't' must be from -89 to 89 degrees"},
        {"elevation: -90", "elevation of: 't' must be from -89 to 89 degrees"},
        {"elevation: high", "elevation"},
        {"elevation: .nan", "elevation"},
        {"exposure: 31", "exposure of: 't' must be from -30 to 30 EV"},
        {"exposure: -1e9", "exposure of: 't' must be from -30 to 30 EV"},
        {"exposure: bright", "exposure"},
        {"exposure: .inf", "exposure"},
        {"tolerance: -0.1", "tolerance of: 't' must be from 0 to 1"},
        {"tolerance: 1.5", "tolerance of: 't' must be from 0 to 1"},
        {"tolerance: 0.5mm", "tolerance"},
        {"tolerance: .nan", "tolerance"},
        {"elevatoin: 3", "elevation"},
    };
    for (size_t k = 0; k < sizeof bad / sizeof bad[0]; ++k) {
        char text[256];
        snprintf(text, sizeof text, "name: robe\nphotos: photos\nrender: [{name: t, views: 2, %s}]\n", bad[k].written);
        refuse(text, bad[k].said);
        assert_null(strchr(tsuya_reason(), '\n')); /* one line */
    }
    static const char *const edge[] = {"elevation: 89", "elevation: -89", "exposure: 30", "exposure: -30", "tolerance: 1", "tolerance: 0"};
    for (size_t k = 0; k < sizeof edge / sizeof edge[0]; ++k) {
        char text[256];
        tsuya_job job;
        snprintf(text, sizeof text, "name: robe\nphotos: photos\nrender: [{name: t, views: 2, %s}]\n", edge[k]);
        assert_ok(load(&job, text, NULL));
        tsuya_job_free(&job);
    }
}

static void test_what_this_version_lacks_is_said(void **state)
{
    (void)state;
    assert_ok(tsuya_file_write(test_path("in/b.yaml"), "x: 1\n", 5));
    refuse("name: robe\nphotos: photos\nscale: {board: none.yaml}\n", "does not exist");
    refuse("name: robe\nphotos: photos\nscale: {board: b.yaml, distances: [[0.5]]}\n", "either board: or distances:");
    refuse("name: robe\nphotos: photos\nmaterials: [{name: a}]\n", "samples: or model:");
}

static void test_regions(void **state)
{
    (void)state;
    tsuya_job job;
    const char *mask;
    assert_ok(tsuya_file_write(test_path("in/a.json"), "{}", 2));
    assert_ok(tsuya_folder_make(test_path("in/gold")));
    assert_ok(tsuya_file_write(test_path("in/gold/IMG_02.jpg.png"), "x", 1));
    assert_ok(tsuya_file_write(test_path("in/IMG_01.png"), "x", 1));
    assert_ok(tsuya_file_write(test_path("in/gold.png"), "x", 1));
    assert_ok(load(&job, "name: robe\nphotos: photos\nmaterials: [{name: a, model: a.json, where: gold/}, {name: b, model: a.json}, "
                         "{name: c, model: a.json, where: IMG_01.png}]\n", NULL));
    for (int k = 0; k < 3 * 4; k++) {
        assert_ok(tsuya_job_region_mask(&mask, &job, k / 4, k % 4));
        assert_int_equal(mask != NULL, k == 2 || k == 9);
    }
    tsuya_job_free(&job);
    assert_ok(load(&job, "name: robe\nphotos: photos\nrender: [{name: r, views: 1, lights: a.json, model: a.json}]\n", NULL));
    assert_string_equal(tsuya_job_render_at(&job, 0)->lights, test_path("in/a.json"));
    assert_string_equal(tsuya_job_render_at(&job, 0)->model, test_path("in/a.json"));
    tsuya_job_free(&job);
    refuse("name: robe\nphotos: photos\nrender: [{name: r, lights: no.json}]\n", "render: lights");
    refuse("name: robe\nphotos: photos\nmaterials: [{name: a, model: a.json, where: gold/}]\n", "without where:");
    refuse("name: robe\nphotos: photos\nmaterials: [{name: a, model: a.json}, {name: b, model: a.json}]\n", "without where:");
    refuse("name: robe\nphotos: photos\nmaterials: [{name: a, model: a.json, where: gold.png}, {name: b, model: a.json}]\n",
           "names no photograph");
    refuse("name: robe\nphotos: photos\nmaterials: [{name: a, model: a.json, where: no/}, {name: b, model: a.json}]\n", "does not exist");
}

/* Said before the first stage, not after a reconstruction. */
static void refuse_files(const char *more, bool rendered, const char *part)
{
    tsuya_job job;
    char text[512];
    snprintf(text, sizeof text, "name: robe\nphotos: photos\n%s", more);
    assert_ok(load(&job, text, NULL));
    tsuya_status status = tsuya_job_check_files(&job, rendered);
    if (part) {
        assert_fails(status, part);
    } else {
        assert_ok(status);
    }
    tsuya_job_free(&job);
}

static void test_files_of_later_stages_are_read_at_once(void **state)
{
    (void)state;
    static const char green[] =
        "# light_theta_deg=30 light_phi_deg=0\n# view_theta_deg=30 view_phi_deg=180 quantity=brdf\nazimuth_deg,tilt_deg,nm550\n0,0,0.3\n0,3,0.2\n";
    static const char colors[] =
        "# light_theta_deg=30 light_phi_deg=0\n# view_theta_deg=30 view_phi_deg=180 quantity=brdf\nazimuth_deg,tilt_deg,r,g,b\n0,0,0.3,0.2,0.1\n";
    static const char lamps[] = "{\"lights\": [{\"type\": \"point\", \"position_m\": [0, 0, 1], \"rgb\": [1, 1, 1]}]}";
    static const char sun[] = "{\"lights\": [{\"type\": \"sun\"}]}", moon[] = "{\"preset\": \"moon\"}";
    assert_ok(tsuya_file_write(test_path("in/green.csv"), green, strlen(green)));
    assert_ok(tsuya_file_write(test_path("in/colors.csv"), colors, strlen(colors)));
    assert_ok(tsuya_file_write(test_path("in/lamps.json"), lamps, strlen(lamps)));
    assert_ok(tsuya_file_write(test_path("in/sun.json"), sun, strlen(sun)));
    assert_ok(tsuya_file_write(test_path("in/moon.json"), moon, strlen(moon)));
    refuse_files("", true, NULL);
    refuse_files("lights: lamps.json\nmaterials: [{name: a, samples: colors.csv}]\n", true, NULL);
    refuse_files("materials: [{name: a, samples: green.csv}]\n", false, NULL);
    refuse_files("materials: [{name: a, samples: green.csv}]\n", true, "r, g, b");
    refuse_files("materials: [{name: a, samples: lamps.json}]\n", false, "lamps.json");
    refuse_files("materials: [{name: a, model: lamps.json}]\n", false, "lamps.json");
    refuse_files("lights: sun.json\n", true, "sun");
    refuse_files("lights: sun.json\n", false, NULL);
    refuse_files("lights: moon.json\n", true, "moon");
    refuse_files("render: [{name: r, lights: sun.json}]\n", true, "sun");
    refuse_files("render: [{name: r, model: lamps.json}]\n", true, "lamps.json");
}

static void test_unreadable_photograph_is_named(void **state)
{
    (void)state;
    assert_ok(tsuya_folder_make(test_path("in/broken")));
    for (int i = 0; i < 3; i++) {
        char name[64];
        snprintf(name, sizeof name, "in/broken/IMG_%02d.jpg", i);
        write_photo(name, 40, 30);
    }
    assert_ok(tsuya_file_write(test_path("in/broken/IMG_03.jpg"), "\xFF\xD8\xFF\xE0 no more", 12));
    refuse("name: robe\nphotos: broken\n", "IMG_03.jpg");
}

static void test_stage_names(void **state)
{
    (void)state;
    static const char *const names[] = {"capture", "calib", "reconstruct", "weave", "brdf", "render", "report"};
    for (int i = 0; i < TSUYA_STAGE_COUNT; i++) {
        assert_string_equal(tsuya_stages[i].name, names[i]);
        assert_int_equal(tsuya_stage_find(names[i]), i);
    }
    assert_int_equal(tsuya_stage_find("all"), -1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_defaults),
        cmocka_unit_test(test_everything_that_is_supported),
        cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_render_numbers),
        cmocka_unit_test(test_what_this_version_lacks_is_said),
        cmocka_unit_test(test_regions),
        cmocka_unit_test(test_files_of_later_stages_are_read_at_once),
        cmocka_unit_test(test_unreadable_photograph_is_named),
        cmocka_unit_test(test_stage_names),
    };
    int result = cmocka_run_group_tests(tests, make_folder, NULL);
    test_folder_remove();
    return result;
}
