/* A small writer of one self-contained HTML file: escaped text, pictures as data URIs, inline SVG. */
#ifndef TSUYA_APP_HTML_H
#define TSUYA_APP_HTML_H

#include "core/file.h"
#include "core/image.h"

typedef struct tsuya_html {
    tsuya_file_writer writer;
    const char *folder;   /* where pictures are encoded on their way in; borrowed */
    int picture_count;
    tsuya_status status;  /* first failure; later calls do nothing, and commit reports it */
} tsuya_html;

TSUYA_MUST_CHECK tsuya_status tsuya_html_begin(tsuya_html *html, const char *path, const char *folder);
TSUYA_MUST_CHECK tsuya_status tsuya_html_commit(tsuya_html *html);
void tsuya_html_abort(tsuya_html *html);

/* As it stands: markup, numbers.  Texts from outside go through tsuya_html_text. */
void tsuya_html_raw(tsuya_html *html, const char *format, ...) TSUYA_PRINTF(2, 3);
/* Escaped for content and for quoted attributes; bytes that are not UTF-8 and control characters become "?". */
void tsuya_html_text(tsuya_html *html, const char *text);
void tsuya_html_textf(tsuya_html *html, const char *format, ...) TSUYA_PRINTF(2, 3);

/* <figure> with a picture of 8-bit samples.  `png` for drawings and maps, JPEG for what looks like a photograph.
 * `group` names a CSS class, caption may be NULL. */
void tsuya_html_picture(tsuya_html *html, const tsuya_image *picture, bool png, const char *group, const char *alt,
                        const char *caption);

/* RFC 4648, padded, in a fresh string (tsuya_free). */
TSUYA_MUST_CHECK tsuya_status tsuya_base64(char **text, const void *bytes, size_t size);

#endif
