/* The record of a checked session: one page of HTML. */
#ifndef TSUYA_APP_CAPTURE_PAGE_H
#define TSUYA_APP_CAPTURE_PAGE_H

#include "capture/check.h"

/* `photos`: the folder's name as the user gave it.  Reads the accused photographs again for small pictures.  Atomic. */
TSUYA_MUST_CHECK tsuya_status tsuya_capture_page(const tsuya_check *check, const char *photos, const char *path);

#endif
