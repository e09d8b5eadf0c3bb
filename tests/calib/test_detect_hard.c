/* Photographs that mislead: exposed row by row in changing light, a board in a mirror, a board that the image cuts, a bent board, tags with
 * ids that are not the board's or not there, a hand on the board, 16 bits of a dark linear file, blur by motion. */
#include "scene.h"
#include "support.h"

#include "calib/detect.h"
#include "core/memory.h"

enum { W = 1280, H = 960, COLS = 5, ROWS = 4 };

static tsuya_camera camera(void)
{
    return (tsuya_camera){.lens = TSUYA_LENS_PINHOLE, .width_px = W, .height_px = H, .fx_px = 1400, .fy_px = 1400, .cx_px = 0.5 * (W - 1), .cy_px = 0.5 * (H - 1)};
}

/* 5 × 4 tags of 30 mm before the camera, tilted. */
static tsuya_pose plate_pose(double x_m, double y_m, double z_m)
{
    static const tsuya_mat3 face = {{{1, 0, 0}, {0, -1, 0}, {0, 0, -1}}};
    tsuya_pose pose = {.rotation = tsuya_mat3_multiply(tsuya_mat3_from_rodrigues((tsuya_vec3){0.3, -0.25, 0.1}), face)};
    pose.translation = tsuya_vec3_sub((tsuya_vec3){x_m, y_m, z_m}, tsuya_mat3_apply(pose.rotation, (tsuya_vec3){0.0945, 0.075, 0}));
    return pose;
}

typedef struct outcome { int tags, corners; double rms_px, worst_px, sigma_ratio; tsuya_detect_report report; } outcome;

/* Detection in a photograph against where the corners truly are. */
static outcome detect(const tsuya_image *photo, const tsuya_board *board, tsuya_pose pose, const char *what)
{
    const char *name = "a.png";
    tsuya_corner_set set;
    outcome o = {0};
    tsuya_camera cam = camera();
    assert_ok(tsuya_corner_set_create(&set, &name, 1));
    assert_ok(tsuya_detect_image(&set, &o.report, board, photo, 0, &(tsuya_edge_look){1.0, 0.0}));
    double sum = 0.0, scaled = 0.0;
    for (int i = 0; i < set.count; i++) {
        const tsuya_corner *c = &set.corner[i];
        tsuya_vec2 q = scene_corner(board, tsuya_board_find(board, c->tag_id), c->corner, &cam, pose);
        double e2 = (c->x_px - q.x) * (c->x_px - q.x) + (c->y_px - q.y) * (c->y_px - q.y);
        sum += e2;
        scaled += e2 / (2.0 * c->sigma_px * c->sigma_px);
        o.worst_px = fmax(o.worst_px, sqrt(e2));
    }
    o.tags = o.report.tags;
    o.corners = set.count;
    o.rms_px = set.count ? sqrt(sum / set.count) : NAN;
    o.sigma_ratio = set.count ? sqrt(scaled / set.count) : NAN;
    printf("%s: %d tags, %d corners, error %.4f px (worst %.3f, over sigma %.2f); foreign %d, twice %d, misplaced %d, edges %d\n", what, o.tags, o.corners, o.rms_px,
           o.worst_px, o.sigma_ratio, o.report.rejected.foreign, o.report.rejected.twice, o.report.rejected.misplaced, o.report.rejected.edges);
    tsuya_corner_set_free(&set);
    return o;
}

static void draw(tsuya_image *photo, const tsuya_board *board, tsuya_pose pose, const scene_look *look)
{
    tsuya_image image;
    tsuya_camera cam = camera();
    scene_begin(&image, W, H, look);
    scene_plate(&image, board, 0, &cam, pose, look);
    scene_end(photo, &image, look);
}

static void board_of(tsuya_board *board) { assert_ok(tsuya_board_grid(board, "tag36h11", 1, COLS, ROWS, 0.030, 0.009, 0)); }

/* The light falls to a fifth from the first row to the last: edges along the rows lie on a slope of light. */
static void test_rolling_exposure(void **state)
{
    (void)state;
    tsuya_board board;
    tsuya_image photo;
    scene_look look = scene_look_default();
    look.row_gain = 0.2;
    board_of(&board);
    draw(&photo, &board, plate_pose(0, 0, 0.45), &look);
    outcome o = detect(&photo, &board, plate_pose(0, 0, 0.45), "rolling exposure");
    assert_int_equal(o.tags, COLS * ROWS);
    assert_int_equal(o.corners, 4 * COLS * ROWS);
    assert_true(o.rms_px <= 0.04);
    tsuya_image_free(&photo);
    tsuya_board_free(&board);
}

/* The board and its image in a mirror beside it: no corner of the mirrored one is taken. */
static void test_mirror(void **state)
{
    (void)state;
    tsuya_board board;
    tsuya_image photo, light, mirrored;
    tsuya_camera cam = camera();
    tsuya_pose pose = plate_pose(-0.12, 0, 0.6);
    scene_look look = scene_look_default();
    board_of(&board);
    scene_begin(&light, W, H, &look);
    scene_plate(&light, &board, 0, &cam, pose, &look);
    assert_ok(tsuya_image_copy(&mirrored, &light));
    for (int y = 0; y < H; y++) {
        for (int x = W / 2 + 1; x < W; x++) {
            *tsuya_image_f32(&light, x, y) = 0.9f * *tsuya_image_f32(&mirrored, W - 1 - x, y);
        }
    }
    tsuya_image_free(&mirrored);
    scene_end(&photo, &light, &look);
    outcome o = detect(&photo, &board, pose, "mirror");
    assert_int_equal(o.tags, COLS * ROWS);
    assert_true(o.worst_px < 0.3);
    tsuya_image_free(&photo);
    tsuya_board_free(&board);
}

/* A mirror that shows tags the right way round (two mirrors, or a screen): the same ids twice. */
static void test_seen_twice(void **state)
{
    (void)state;
    tsuya_board board;
    tsuya_image photo, light;
    tsuya_camera cam = camera();
    tsuya_pose pose = plate_pose(-0.12, 0, 0.6), ghost = plate_pose(0.16, 0.0, 0.75);
    scene_look look = scene_look_default();
    board_of(&board);
    scene_begin(&light, W, H, &look);
    scene_plate(&light, &board, 0, &cam, pose, &look);
    scene_plate(&light, &board, 0, &cam, ghost, &look);
    scene_end(&photo, &light, &look);
    outcome o = detect(&photo, &board, pose, "the same board twice");
    assert_true(o.tags == 0 || o.worst_px < 0.3); /* one of them, or neither, but never a mixture */
    assert_true(o.report.rejected.twice + o.report.rejected.misplaced > 0);
    tsuya_image_free(&photo);
    tsuya_board_free(&board);
}

/* The image's edge cuts the board: whole tags are found, the cut ones are not invented. */
static void test_image_edge(void **state)
{
    (void)state;
    tsuya_board board;
    tsuya_image photo;
    scene_look look = scene_look_default();
    tsuya_pose pose = plate_pose(0.215, 0.10, 0.45);
    board_of(&board);
    draw(&photo, &board, pose, &look);
    outcome o = detect(&photo, &board, pose, "at the image's edge");
    assert_true(o.tags >= 4 && o.tags < COLS * ROWS);
    assert_true(o.rms_px <= 0.05 && o.worst_px < 0.3);
    tsuya_image_free(&photo);
    tsuya_board_free(&board);
}

/* Paper that stands 3 mm off in its middle: tags are where the bent paper is, each a plane as far as its edges tell. */
static void test_bent_board(void **state)
{
    (void)state;
    tsuya_board board;
    tsuya_image photo;
    scene_look look = scene_look_default();
    look.bulge_m = 0.003;
    board_of(&board);
    draw(&photo, &board, plate_pose(0, 0, 0.45), &look);
    outcome o = detect(&photo, &board, plate_pose(0, 0, 0.45), "bent board, against the flat one");
    assert_int_equal(o.tags, COLS * ROWS);
    assert_true(o.rms_px > 0.5); /* the bend is in the corners, and none is taken for misplaced */
    assert_int_equal(o.report.rejected.misplaced, 0);
    tsuya_image_free(&photo);
    tsuya_board_free(&board);
}

/* A board that is printed otherwise than its file says: two tags have changed places, one has an id that the file does not know. */
static void test_wrong_ids(void **state)
{
    (void)state;
    tsuya_board board, printed;
    tsuya_image photo;
    scene_look look = scene_look_default();
    tsuya_pose pose = plate_pose(0, 0, 0.45);
    board_of(&board);
    board_of(&printed);
    int swapped = printed.tag[3].id;
    printed.tag[3].id = printed.tag[16].id;
    printed.tag[16].id = swapped;
    printed.tag[8].id = 300;
    draw(&photo, &printed, pose, &look);
    outcome o = detect(&photo, &board, pose, "two tags swapped, one foreign");
    assert_int_equal(o.tags, COLS * ROWS - 3);
    assert_int_equal(o.report.rejected.misplaced, 2);
    assert_int_equal(o.report.rejected.foreign, 1);
    assert_true(o.worst_px < 0.3);
    tsuya_image_free(&photo);
    tsuya_board_free(&board);
    tsuya_board_free(&printed);
}

/* A hand over part of the board, its edge across tags: what is covered is not invented, and the corners beside it know what they are worth. */
static void test_covered(void **state)
{
    (void)state;
    tsuya_board board;
    tsuya_image light, photo;
    tsuya_camera cam = camera();
    scene_look look = scene_look_default();
    tsuya_pose pose = plate_pose(0, 0, 0.45);
    board_of(&board);
    scene_begin(&light, W, H, &look);
    scene_plate(&light, &board, 0, &cam, pose, &look);
    for (int y = 0; y < H; y++) {
        for (int x = 0; x < W; x++) {
            double across = 0.8 * (x - 640) + 0.6 * (y - 480), along = -0.6 * (x - 640) + 0.8 * (y - 480);
            if (fabs(across + 20.0 * sin(along / 40.0)) < 70.0 && along < 120.0) {
                *tsuya_image_f32(&light, x, y) = (float)(0.45 + 0.05 * sin(along / 17.0));
            }
        }
    }
    scene_end(&photo, &light, &look);
    outcome o = detect(&photo, &board, pose, "a hand on the board");
    assert_true(o.tags >= COLS * ROWS / 2 && o.tags < COLS * ROWS);
    assert_true(o.rms_px <= 0.10 && o.sigma_ratio < 1.5); /* corners at the hand are worse, and say so */
    tsuya_image_free(&photo);
    tsuya_board_free(&board);
}

/* 16 bits of linear light as raw files have them, white at a fifth of the range, noise below one of 8 bits' steps. */
static void test_raw(void **state)
{
    (void)state;
    tsuya_board board;
    tsuya_image photo;
    scene_look look = scene_look_default();
    look.sample = TSUYA_SAMPLE_U16;
    look.black = 0.01;
    look.white = 0.20;
    look.background = 0.05;
    look.noise = 0.0008;
    board_of(&board);
    draw(&photo, &board, plate_pose(0, 0, 0.45), &look);
    outcome o = detect(&photo, &board, plate_pose(0, 0, 0.45), "16 bits, dark");
    assert_int_equal(o.corners, 4 * COLS * ROWS);
    assert_true(o.rms_px <= 0.04);
    tsuya_image_free(&photo);
    tsuya_board_free(&board);
}

/* Six pixels of motion: the corners say how uncertain they are, the report how blurred. */
static void test_motion(void **state)
{
    (void)state;
    tsuya_board board;
    tsuya_image photo;
    scene_look look = scene_look_default();
    look.motion_px[0] = 6.0;
    board_of(&board);
    draw(&photo, &board, plate_pose(0, 0, 0.45), &look);
    outcome o = detect(&photo, &board, plate_pose(0, 0, 0.45), "motion of 6 px");
    assert_true(o.tags >= COLS * ROWS - 2);
    assert_true(o.report.blur_high_px > 1.2); /* 6 / sqrt(12) is 1.7 */
    assert_true(o.sigma_ratio > 0.5 && o.sigma_ratio < 2.0);
    tsuya_image_free(&photo);
    tsuya_board_free(&board);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_wrong_ids), cmocka_unit_test(test_covered), cmocka_unit_test(test_raw), cmocka_unit_test(test_motion),
        cmocka_unit_test(test_rolling_exposure), cmocka_unit_test(test_mirror), cmocka_unit_test(test_seen_twice),
        cmocka_unit_test(test_image_edge), cmocka_unit_test(test_bent_board),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
