/* What files say about how a photograph was taken: libexif and LibRaw behind core/photo.h. */
#ifndef TSUYA_CORE_EXIF_ADAPTER_H
#define TSUYA_CORE_EXIF_ADAPTER_H

#include "core/photo.h"

/* Fills what the file's EXIF says; leaves the rest as it is.  Never fails: damaged EXIF is no EXIF. */
void tsuya_exif_read(tsuya_photo *photo, const char *path);
/* The same from camera raw. */
void tsuya_raw_exif_read(tsuya_photo *photo, const char *path);

#endif
