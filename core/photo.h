/* Photographs on disk: what their EXIF says, and folders of them. */
#ifndef TSUYA_CORE_PHOTO_H
#define TSUYA_CORE_PHOTO_H

#include "core/status.h"

#include <stdbool.h>

typedef struct tsuya_photo {
    char *path, *name;         /* name: the file's name inside its folder */
    char *mask_path;           /* NULL where there is none */
    int width_px, height_px;
    int orientation;           /* EXIF 1 … 8, 1 where absent; never applied to pixels */
    double focal_mm, focal_35mm; /* 0 where absent */
    double exposure_s, f_number, iso;
    char make[64], model[64], taken[32]; /* EXIF date and time as written; "" where absent */
} tsuya_photo;

typedef struct tsuya_photo_set {
    tsuya_photo *photo; /* sorted by name (byte order) */
    int count;
    char *folder;
} tsuya_photo_set;

/* EXIF (libexif for JPEG, LibRaw for camera raw; none is read of other formats) and the pixel size.  A file without EXIF is
 * fine. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_photo_load(tsuya_photo *photo, const char *path);
TSUYA_API void tsuya_photo_free(tsuya_photo *photo);

/* Every image file of a folder (hidden files and non-images are passed over, the latter with a note).  `mask_folder` may be
 * NULL; masks are NAME.png (stem) or COLMAP's NAME.jpg.png; a mask of another size than its photograph is an error.
 * Fails on an empty folder, on an unreadable photograph (named) and on photographs of mixed size (both sizes and one file
 * of each named). */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_photo_set_load(tsuya_photo_set *set, const char *folder, const char *mask_folder);
TSUYA_API void tsuya_photo_set_free(tsuya_photo_set *set);

/* Focal length in pixels from EXIF: 35 mm equivalent (over the diagonal, 43.27 mm), else 0. */
TSUYA_API double tsuya_photo_focal_px(const tsuya_photo *photo);

#endif
