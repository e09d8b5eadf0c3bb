/* COLMAP's database (SQLite; COLMAP documentation, "Database Format"). */
#ifndef TSUYA_RECONSTRUCT_DATABASE_ADAPTER_H
#define TSUYA_RECONSTRUCT_DATABASE_ADAPTER_H

#include "core/camera.h"
#include "core/matching.h"

typedef struct tsuya_database_image {
    uint32_t image_id, camera_id;
    char *name;
    int features;
} tsuya_database_image;

typedef struct tsuya_database_pair {
    int a, b;    /* indices into the images, a < b */
    int inliers; /* verified matches */
} tsuya_database_pair;

typedef struct tsuya_database {
    tsuya_database_image *image; /* by name */
    int image_count;
    tsuya_database_pair *pair;
    int pair_count;
} tsuya_database;

/* COLMAP's kinds of two-view geometry (estimators/two_view_geometry.h). */
typedef enum tsuya_two_view_kind {
    TSUYA_TWO_VIEW_CALIBRATED = 2,
    TSUYA_TWO_VIEW_UNCALIBRATED = 3,
    TSUYA_TWO_VIEW_PLANAR = 4,
    TSUYA_TWO_VIEW_PANORAMIC = 5,
    TSUYA_TWO_VIEW_PLANAR_OR_PANORAMIC = 6,
} tsuya_two_view_kind;

/* The verified matches of a pair of images, image_a < image_b. */
typedef struct tsuya_two_view {
    uint32_t image_a, image_b;
    int kind; /* 0: none */
    double fundamental[9], essential[9], homography[9]; /* row by row, b from a */
    tsuya_match *match; /* the caller's when saved; not read back */
    int match_count;
    double chance; /* that one wrong match fits the pair's geometry; not stored */
} tsuya_two_view;

/* Images, their numbers of features, and the verified pairs. */
TSUYA_MUST_CHECK tsuya_status tsuya_database_load(tsuya_database *database, const char *path);
void tsuya_database_free(tsuya_database *database);
/* Forgets every match, so that matching starts afresh. */
TSUYA_MUST_CHECK tsuya_status tsuya_database_clear_matches(const char *path);
/* A new database with the cameras, images and positions of features of another, without descriptors and matches. */
TSUYA_MUST_CHECK tsuya_status tsuya_database_branch(const char *path, const char *base);
/* The branch's matches and geometries come into the base, over those of the same pairs. */
TSUYA_MUST_CHECK tsuya_status tsuya_database_merge(const char *base, const char *branch);
/* Numbers the images in the order of their names: COLMAP numbers them in the order in which its threads end. */
TSUYA_MUST_CHECK tsuya_status tsuya_database_sort_images(const char *path);
TSUYA_MUST_CHECK tsuya_status tsuya_sift_load(tsuya_sift *features, const char *path, uint32_t image_id);
/* kind 0 where the pair is not verified. */
TSUYA_MUST_CHECK tsuya_status tsuya_two_view_load(tsuya_two_view *pair, const char *path, uint32_t image_a, uint32_t image_b);
/* Writes or overwrites the verified matches; all of them or none. */
TSUYA_MUST_CHECK tsuya_status tsuya_two_views_save(const char *path, const tsuya_two_view *pair, int count);
/* Writes a camera's model and parameters over those of `camera_id` and trusts its focal length. */
TSUYA_MUST_CHECK tsuya_status tsuya_database_set_camera(const char *path, uint32_t camera_id, const tsuya_camera *camera);
/* A further camera; its id in *camera_id. */
TSUYA_MUST_CHECK tsuya_status tsuya_database_add_camera(uint32_t *camera_id, const char *path, const tsuya_camera *camera);
TSUYA_MUST_CHECK tsuya_status tsuya_database_assign_camera(const char *path, uint32_t image_id, uint32_t camera_id);

#endif
