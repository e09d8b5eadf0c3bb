/* COLMAP's database (SQLite; COLMAP documentation, "Database Format"). */
#ifndef TSUYA_RECONSTRUCT_DATABASE_ADAPTER_H
#define TSUYA_RECONSTRUCT_DATABASE_ADAPTER_H

#include "core/camera.h"

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

/* Images, their numbers of features, and the verified pairs. */
TSUYA_MUST_CHECK tsuya_status tsuya_database_load(tsuya_database *database, const char *path);
void tsuya_database_free(tsuya_database *database);
/* Forgets every match, so that matching starts afresh. */
TSUYA_MUST_CHECK tsuya_status tsuya_database_clear_matches(const char *path);
/* Writes a camera's model and parameters over those of `camera_id` and trusts its focal length. */
TSUYA_MUST_CHECK tsuya_status tsuya_database_set_camera(const char *path, uint32_t camera_id, const tsuya_camera *camera);
/* A further camera; its id in *camera_id. */
TSUYA_MUST_CHECK tsuya_status tsuya_database_add_camera(uint32_t *camera_id, const char *path, const tsuya_camera *camera);
TSUYA_MUST_CHECK tsuya_status tsuya_database_assign_camera(const char *path, uint32_t image_id, uint32_t camera_id);

#endif
