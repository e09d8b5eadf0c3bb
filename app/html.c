#include "app/html.h"

#include <stdio.h>
#include <string.h>

tsuya_status tsuya_base64(char **text, const void *bytes, size_t size)
{
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    const uint8_t *in = bytes;
    char *out = tsuya_calloc((size + 2) / 3 + 1, 4);
    if (!out) {
        return TSUYA_ERROR_MEMORY;
    }
    char *end = out;
    for (size_t i = 0; i < size; i += 3) {
        size_t left = size - i;
        uint32_t word = (uint32_t)in[i] << 16 | (left > 1 ? (uint32_t)in[i + 1] << 8 : 0) | (left > 2 ? in[i + 2] : 0);
        *end++ = digits[word >> 18];
        *end++ = digits[word >> 12 & 63];
        *end++ = left > 1 ? digits[word >> 6 & 63] : '=';
        *end++ = left > 2 ? digits[word & 63] : '=';
    }
    *end = '\0';
    *text = out;
    return TSUYA_OK;
}

tsuya_status tsuya_html_begin(tsuya_html *html, const char *path, const char *folder)
{
    *html = (tsuya_html){.folder = folder};
    return tsuya_file_begin(&html->writer, path);
}

tsuya_status tsuya_html_commit(tsuya_html *html)
{
    if (html->status != TSUYA_OK) {
        tsuya_file_abort(&html->writer);
        return html->status;
    }
    return tsuya_file_commit(&html->writer);
}

void tsuya_html_abort(tsuya_html *html) { tsuya_file_abort(&html->writer); }

void tsuya_html_raw(tsuya_html *html, const char *format, ...)
{
    if (html->status != TSUYA_OK) {
        return;
    }
    va_list arguments;
    va_start(arguments, format);
    vfprintf(html->writer.stream, format, arguments);
    va_end(arguments);
}

/* Bytes of the UTF-8 sequence at `s`, 0 where it is none (RFC 3629: no surrogates, no overlong forms). */
static int utf8_length(const unsigned char *s)
{
    int length = s[0] < 0x80 ? 1 : s[0] >= 0xC2 && s[0] < 0xE0 ? 2 : (s[0] & 0xF0) == 0xE0 ? 3 : s[0] >= 0xF0 && s[0] < 0xF5 ? 4 : 0;
    for (int i = 1; i < length; i++) {
        if ((s[i] & 0xC0) != 0x80) {
            return 0;
        }
    }
    if ((s[0] == 0xE0 && s[1] < 0xA0) || (s[0] == 0xED && s[1] > 0x9F) || (s[0] == 0xF0 && s[1] < 0x90) ||
        (s[0] == 0xF4 && s[1] > 0x8F)) {
        return 0;
    }
    return length;
}

void tsuya_html_text(tsuya_html *html, const char *text)
{
    if (html->status != TSUYA_OK || !text) {
        return;
    }
    FILE *out = html->writer.stream;
    for (const unsigned char *s = (const unsigned char *)text; *s;) {
        int length = utf8_length(s);
        switch (*s) {
        case '&': fputs("&amp;", out); break;
        case '<': fputs("&lt;", out); break;
        case '>': fputs("&gt;", out); break;
        case '"': fputs("&quot;", out); break;
        case '\'': fputs("&#39;", out); break;
        default:
            if (length == 0 || *s == 0x7F || (*s < 0x20 && *s != '\n' && *s != '\t')) {
                fputc('?', out);
                length = 1;
            } else {
                fwrite(s, 1, (size_t)length, out);
            }
        }
        s += length;
    }
}

void tsuya_html_textf(tsuya_html *html, const char *format, ...)
{
    char text[2048];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    tsuya_html_text(html, text);
}

/* Encodes through a file of the report's folder, because the image writers write by name. */
static tsuya_status encode(char **base64, const tsuya_html *html, const tsuya_image *picture, bool png)
{
    char *path = tsuya_path_join(html->folder, png ? ".picture.png" : ".picture.jpg");
    if (!path) {
        return TSUYA_ERROR_MEMORY;
    }
    tsuya_image_save_options options = tsuya_image_save_options_default();
    options.jpeg_quality = 84;
    char *bytes = NULL;
    size_t size;
    tsuya_status status = tsuya_image_save(picture, path, &options);
    if (status == TSUYA_OK) {
        status = tsuya_file_load(&bytes, &size, path, (size_t)64 << 20);
    }
    if (status == TSUYA_OK) {
        status = tsuya_base64(base64, bytes, size);
    }
    remove(path);
    tsuya_free(bytes);
    tsuya_free(path);
    return status;
}

void tsuya_html_picture(tsuya_html *html, const tsuya_image *picture, bool png, const char *group, const char *alt,
                        const char *caption)
{
    if (html->status != TSUYA_OK) {
        return;
    }
    char *base64;
    html->status = encode(&base64, html, picture, png);
    if (html->status != TSUYA_OK) {
        return;
    }
    tsuya_html_raw(html, "<figure class=\"%s\"><img width=\"%d\" height=\"%d\" alt=\"", group, picture->width_px, picture->height_px);
    tsuya_html_text(html, alt);
    tsuya_html_raw(html, "\" src=\"data:image/%s;base64,%s\">", png ? "png" : "jpeg", base64);
    if (caption) {
        tsuya_html_raw(html, "<figcaption>");
        tsuya_html_text(html, caption);
        tsuya_html_raw(html, "</figcaption>");
    }
    tsuya_html_raw(html, "</figure>\n");
    html->picture_count++;
    tsuya_free(base64);
}
