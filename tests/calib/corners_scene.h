/* Corners of a board in many photographs, with known camera, poses and noise.  The truth is projected here, by a lens written
 * out in this file; neither mrcal nor core's camera takes part. */
#ifndef TSUYA_TESTS_CALIB_CORNERS_SCENE_H
#define TSUYA_TESTS_CALIB_CORNERS_SCENE_H

#include "support.h"

#include "calib/calibrate.h"


enum { SCENE_WIDTH = 1600, SCENE_HEIGHT = 1200, SCENE_MOST = 64 };
static const double SCENE_FOCAL = 1500.0, SCENE_CX = 812.0, SCENE_CY = 589.0, SCENE_K1 = -0.12, SCENE_K2 = 0.05;

typedef struct corners_scene {
    int photos;
    double tilt_deg;      /* largest */
    double side_px;       /* the board's place: this far to the right of the centre */
    double spread_px;     /* and anywhere within this of it */
    double distance_m;
    double noise_px;      /* of a corner; every third photograph three times that */
    double common_px;     /* a smooth distortion of each photograph of its own (rolling shutter, waves in paper) */
    double bulge_m;       /* the board is bent */
    double ripple_m;      /* and wavy */
    uint64_t seed, noise_seed; /* of the poses; of the errors */
} corners_scene;

static inline corners_scene corners_scene_default(void)
{
    return (corners_scene){.photos = 20, .tilt_deg = 40, .spread_px = 420, .distance_m = 0.75, .noise_px = 0.1, .seed = 1, .noise_seed = 1};
}

static inline double scene_draw(const corners_scene *s, int photo, int what, double low, double high)
{
    return low + (high - low) * tsuya_random_uniform(s->seed + 7919, (uint64_t)photo, (uint64_t)what);
}

static inline tsuya_vec2 scene_pixel(tsuya_vec3 p)
{
    double x = p.x / p.z, y = p.y / p.z, r2 = x * x + y * y, k = 1.0 + SCENE_K1 * r2 + SCENE_K2 * r2 * r2;
    return (tsuya_vec2){SCENE_FOCAL * k * x + SCENE_CX, SCENE_FOCAL * k * y + SCENE_CY};
}

static inline tsuya_pose scene_pose(const corners_scene *s, int photo)
{
    double tilt = tsuya_rad_from_deg(scene_draw(s, photo, 0, 0.25, 1.0) * s->tilt_deg), around = scene_draw(s, photo, 1, 0, 2 * M_PI);
    tsuya_mat3 turn = tsuya_mat3_from_rodrigues((tsuya_vec3){0, 0, scene_draw(s, photo, 2, 0, 2 * M_PI)});
    tsuya_mat3 lean = tsuya_mat3_from_rodrigues((tsuya_vec3){tilt * cos(around), tilt * sin(around), 0});
    tsuya_mat3 face = {{{1, 0, 0}, {0, -1, 0}, {0, 0, -1}}};
    tsuya_pose pose = {.rotation = tsuya_mat3_multiply(tsuya_mat3_multiply(lean, turn), face)};
    double z = s->distance_m * scene_draw(s, photo, 3, 0.75, 1.3);
    tsuya_vec3 at = {z * (s->side_px + scene_draw(s, photo, 4, -1, 1) * s->spread_px) / SCENE_FOCAL,
                     z * scene_draw(s, photo, 5, -0.7, 0.7) * s->spread_px / SCENE_FOCAL, z};
    pose.translation = tsuya_vec3_sub(at, tsuya_mat3_apply(pose.rotation, (tsuya_vec3){0.12, 0.12, 0}));
    return pose;
}

static inline tsuya_vec2 scene_noise(const corners_scene *s, int photo, int k, tsuya_vec2 q, double sigma)
{
    double u = (q.x - SCENE_CX) / 800.0, v = (q.y - SCENE_CY) / 800.0, n[6];
    for (int i = 0; i < 6; i++) {
        n[i] = s->common_px * tsuya_random_normal(s->noise_seed, 31 + (uint64_t)photo, (uint64_t)i);
    }
    q.x += n[0] * u * u + n[1] * u * v + n[2] * v * v + sigma * tsuya_random_normal(s->noise_seed, 1000 + (uint64_t)photo, 2 * (uint64_t)k);
    q.y += n[3] * u * u + n[4] * u * v + n[5] * v * v + sigma * tsuya_random_normal(s->noise_seed, 1000 + (uint64_t)photo, 2 * (uint64_t)k + 1);
    return q;
}

static inline void scene_corners(tsuya_corner_set *set, const corners_scene *s, const tsuya_board *board)
{
    char name[SCENE_MOST][16];
    const char *names[SCENE_MOST];
    for (int p = 0; p < s->photos; p++) {
        snprintf(name[p], sizeof name[p], "p%02d.png", p);
        names[p] = name[p];
    }
    assert_ok(tsuya_corner_set_create(set, names, s->photos));
    for (int p = 0; p < s->photos; p++) {
        tsuya_pose pose = scene_pose(s, p);
        double sigma = s->noise_px * (p % 3 == 2 ? 3.0 : 1.0);
        for (int k = 0; k < 4 * board->tag_count; k++) {
            tsuya_vec3 on = tsuya_board_corner(board, k / 4, k % 4);
            double u = (on.x - 0.12) / 0.12, v = (on.y - 0.12) / 0.12;
            on.z = s->bulge_m * (1.0 - 0.5 * (u * u + v * v)) + s->ripple_m * sin(5.0 * u) * cos(4.0 * v);
            tsuya_vec2 q = scene_noise(s, p, k, scene_pixel(tsuya_pose_apply(pose, on)), sigma);
            if (q.x > 0 && q.y > 0 && q.x < SCENE_WIDTH - 1 && q.y < SCENE_HEIGHT - 1) {
                assert_ok(tsuya_corner_set_add(set, (tsuya_corner){.photo = p, .tag_id = board->tag[k / 4].id, .corner = k % 4, .x_px = q.x,
                                                                   .y_px = q.y, .sigma_px = sigma}));
            }
        }
    }
    tsuya_corner_set_sort(set);
}

/* 6 × 6 tags, 24 cm. */
static inline void scene_board(tsuya_board *board) { assert_ok(tsuya_board_grid(board, "tag36h11", 1, 6, 6, 0.030, 0.012, 0)); }

#endif
