/* Corners: error beside time, ours and the plain library's.  Then photographs of 12 Mpix to a camera: time by stage, memory.
 *
 *     bench_calib [PHOTOS [FOLDER]]     60 photographs unless told otherwise
 *
 * Photographs are drawn (tests/calib/scene.h), eight of them, each under several names.  Drawing takes minutes: in FOLDER they stay
 * for the next time. */
#include "bench.h"
#include "tag_field.h"

#include "calib/calibrate.h"
#include "calib/detect.h"

enum { DRAWN = 8, WIDE = 4000, HIGH = 3000, MOST = 240 };

static void corners(double noise, bool srgb, const char *part)
{
    field f;
    tsuya_image light;
    score library;
    scene_look look = scene_look_default();
    double mpix = 1e-6 * COLUMNS * PITCH * ROWS * PITCH;
    look.noise = noise;
    look.srgb = srgb;
    make_field(&f, &light, &look, "tag36h11", 1, 72, 96);
    score ours = compare(&library, part, &f, &light, &look, "tag36h11", 1);
    bench_point(part, "AprilTag library", library.rms, "px", 1e3 * library.seconds / mpix, "ms/Mpix");
    bench_point(part, "ours", ours.rms, "px", 1e3 * ours.seconds / mpix, "ms/Mpix");
    tsuya_image_free(&light);
    free_boards(&f);
}

static tsuya_camera truth(void)
{
    return (tsuya_camera){.lens = TSUYA_LENS_OPENCV4, .width_px = WIDE, .height_px = HIGH, .fx_px = 4100, .fy_px = 4100, .cx_px = 2011, .cy_px = 1489, .distortion = {-0.08, 0.05}};
}

static const char *drawn(const char *folder, int k)
{
    static char path[TEST_PATH];
    char name[32];
    snprintf(name, sizeof name, "drawn_%d.jpg", k);
    snprintf(path, sizeof path, "%s/%s", folder ? folder : test_folder(), name);
    return path;
}

static void draw_photos(const tsuya_board *board, const char *folder)
{
    tsuya_camera camera = truth();
    static const tsuya_mat3 face = {{{1, 0, 0}, {0, -1, 0}, {0, 0, -1}}};
    for (int k = 0; k < DRAWN; k++) {
        if (tsuya_path_exists(drawn(folder, k))) {
            continue;
        }
        tsuya_image image, photo;
        scene_look look = scene_look_default();
        look.srgb = true;
        look.blur_px = 1.0;
        look.seed = (uint64_t)k + 1;
        double a = 2.4 * k, tilt = 0.25 + 0.06 * k;
        tsuya_pose pose = {.rotation = tsuya_mat3_multiply(tsuya_mat3_from_rodrigues((tsuya_vec3){tilt * cos(a), tilt * sin(a), 0.7 * k}), face)};
        tsuya_vec3 at = {0.05 * cos(1.9 * a), 0.03 * sin(1.3 * a), 0.52 + 0.02 * k};
        pose.translation = tsuya_vec3_sub(at, tsuya_mat3_apply(pose.rotation, (tsuya_vec3){0.1515, 0.0930, 0}));
        scene_begin(&image, WIDE, HIGH, &look);
        scene_plate(&image, board, 0, &camera, pose, &look);
        scene_end(&photo, &image, &look);
        assert_ok(tsuya_image_save(&photo, drawn(folder, k), NULL));
        tsuya_image_free(&photo);
    }
}

typedef struct run { double wall_s, cpu_s, read_s, detect_s, solve_s, peak_mb, error_px; } run;

static run calibrate(const tsuya_board *board, const char *folder, int photos)
{
    run r = {0};
    char *path[MOST];
    tsuya_corner_set set;
    tsuya_detect_info info;
    tsuya_calibration c;
    tsuya_camera camera = truth();
    tsuya_projection_map map;
    tsuya_projection_stats stats;
    tsuya_context context = tsuya_context_default();
    tsuya_calibrate_options options = tsuya_calibrate_options_default();
    for (int k = 0; k < photos; k++) {
        char name[32];
        snprintf(name, sizeof name, "IMG_%03d.jpg", k);
        path[k] = tsuya_strdup(test_path(name));
        (void)unlink(path[k]);
        char *target = realpath(drawn(folder, (k + k / DRAWN) % DRAWN), NULL);
        assert_non_null(target);
        assert_int_equal(symlink(target, path[k]), 0);
        free(target);
    }
    tsuya_peak_memory_reset();
    double wall = tsuya_clock_s(), cpu = cpu_s();
    assert_ok(tsuya_detect_photos(&set, &info, board, (const char *const *)path, photos, &context));
    assert_ok(tsuya_calibrate(&c, board, &set, WIDE, HIGH, &options, &context));
    r = (run){tsuya_clock_s() - wall, cpu_s() - cpu, info.seconds_read, info.seconds_detect, c.seconds, tsuya_peak_memory_mb(), 0};
    assert_ok(tsuya_projection_map_create(&map, 41, 31));
    tsuya_projection_cover(&map, &c.solve);
    assert_ok(tsuya_projection_difference(&map, NULL, &c.solve.camera, &camera, c.distance_m));
    assert_ok(tsuya_projection_summary(&stats, &map));
    r.error_px = stats.mean;
    printf("%d photographs of 12 Mpix, %d threads: %.1f s (processor %.1f s): reading %.1f, tags %.1f (both summed over threads), solve %.1f; peak %.0f MiB; projection within %.3f px "
           "(mean where covered)\n", photos, context.threads, r.wall_s, r.cpu_s, r.read_s, r.detect_s, r.solve_s, r.peak_mb, r.error_px);
    tsuya_projection_map_free(&map);
    tsuya_calibration_free(&c);
    tsuya_detect_info_free(&info);
    tsuya_corner_set_free(&set);
    for (int k = 0; k < photos; k++) {
        tsuya_free(path[k]);
    }
    return r;
}

int main(int argc, char **argv)
{
    long photos_given = argc > 1 ? strtol(argv[1], NULL, 10) : 60;
    const char *folder = argc > 2 ? argv[2] : NULL;
    int photos = photos_given >= 16 && photos_given <= MOST ? (int)photos_given : 0;
    tsuya_board board;
    if (photos == 0) {
        fprintf(stderr, "bench_calib [PHOTOS [FOLDER]]: 16 to %d\n", MOST);
        return 2;
    }
    corners(2.0 / 255.0, false, "corners noise 2");
    corners(8.0 / 255.0, false, "corners noise 8");
    corners(2.0 / 255.0, true, "corners sRGB noise 2");
    assert_ok(tsuya_board_grid(&board, "tag36h11", 1, 8, 5, 0.030, 0.009, 0));
    draw_photos(&board, folder);
    run few = calibrate(&board, folder, 16), all = calibrate(&board, folder, photos);
    bench_point("photographs to a camera", "16 of 12 Mpix", few.error_px, "px", few.cpu_s, "s");
    bench_point("photographs to a camera", "all of 12 Mpix", all.error_px, "px", all.cpu_s, "s");
    printf("memory: %.0f MiB for 16 photographs, %.0f for %d\n", few.peak_mb, all.peak_mb, photos);
    tsuya_board_free(&board);
    test_folder_remove();
    return 0;
}
