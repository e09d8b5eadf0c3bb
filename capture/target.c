#include "capture/target.h"

#include "calib/apriltag_adapter.h"
#include "core/file.h"
#include "core/memory.h"

#include <cairo/cairo-pdf.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

enum { RULER_MM = 100 };
static const double POINTS = 72.0 / 25.4, RULER_BELOW_MM = 14.0, DEGREES_MM = 5.0, QUIET = 0.2; /* of a tag's edge, white between tags and degrees */

tsuya_target_options tsuya_target_options_default(void)
{
    return (tsuya_target_options){.family = "tag36h11", .border_bits = 1, .cols = 8, .rows = 5, .tag_mm = 30, .gap_mm = 9, .margin_mm = 15};
}

tsuya_target_options tsuya_target_options_of(tsuya_target_kind kind)
{
    tsuya_target_options o = tsuya_target_options_default();
    o.kind = kind;
    if (kind == TSUYA_TARGET_MAT) {
        o.size_mm = 190, o.tag_mm = 18, o.gap_mm = 6, o.margin_mm = 8;
    } else if (kind == TSUYA_TARGET_BAR) {
        o.size_mm = 240, o.tag_mm = 20, o.gap_mm = 6;
    }
    return o;
}

/* Ring of the mat's tags: their outer corners stay inside the degrees. */
static double ring_mm(const tsuya_target_options *o) { return 0.5 * o->size_mm - DEGREES_MM - (0.5 * M_SQRT2 + QUIET) * o->tag_mm; }

static tsuya_target_tag on_ring(const tsuya_target_options *o, int i, int count)
{
    double a = 2.0 * M_PI * i / count;
    return (tsuya_target_tag){ring_mm(o) * cos(a), ring_mm(o) * sin(a)};
}

/* As many upright tags as stand in the ring with the gap between them. */
static int ring_count(const tsuya_target_options *o)
{
    if (!(ring_mm(o) > o->tag_mm + o->gap_mm)) {
        return 0;
    }
    for (int count = (int)(2.0 * M_PI * ring_mm(o) / (o->tag_mm + o->gap_mm)); count >= 4; count--) {
        bool apart = true;
        for (int i = 0; i < count && apart; i++) {
            tsuya_target_tag a = on_ring(o, i, count), b = on_ring(o, i + 1, count);
            apart = fmax(fabs(a.x_mm - b.x_mm), fabs(a.y_mm - b.y_mm)) >= o->tag_mm + o->gap_mm;
        }
        if (apart) {
            return count;
        }
    }
    return 0;
}

int tsuya_target_tags(tsuya_target_tag *tag, int most, const tsuya_target_options *o)
{
    double pitch = o->tag_mm + o->gap_mm, half = 0.5 * o->tag_mm;
    int count = o->kind == TSUYA_TARGET_MAT ? ring_count(o) : o->kind == TSUYA_TARGET_BAR ? (o->size_mm >= 3.0 * pitch ? 4 : 0) : o->cols * o->rows;
    for (int i = 0; i < count && i < most; i++) {
        switch (o->kind) {
        case TSUYA_TARGET_MAT: tag[i] = on_ring(o, i, count); break;
        case TSUYA_TARGET_BAR: tag[i] = (tsuya_target_tag){i < 2 ? i * pitch : o->size_mm - (3 - i) * pitch, 0.0}; break;
        case TSUYA_TARGET_GRID: tag[i] = (tsuya_target_tag){half + i % o->cols * pitch, half + i / o->cols * pitch}; break;
        }
    }
    return count;
}

tsuya_target_page tsuya_target_page_of(const tsuya_target_options *o)
{
    double width = o->cols * o->tag_mm + (o->cols - 1) * o->gap_mm, height = o->rows * o->tag_mm + (o->rows - 1) * o->gap_mm, half = 0.5 * o->size_mm, m = o->margin_mm;
    switch (o->kind) {
    case TSUYA_TARGET_MAT: return (tsuya_target_page){fmax(o->size_mm, RULER_MM) + 2 * m, o->size_mm + 2 * m + RULER_BELOW_MM, m + half, m + RULER_BELOW_MM + half};
    case TSUYA_TARGET_BAR:
        return (tsuya_target_page){o->size_mm + o->tag_mm + 2 * m, o->tag_mm + 2 * m + RULER_BELOW_MM, m + 0.5 * o->tag_mm, m + RULER_BELOW_MM + 0.5 * o->tag_mm};
    case TSUYA_TARGET_GRID: break;
    }
    return (tsuya_target_page){fmax(width, RULER_MM) + 2 * m, height + 2 * m + RULER_BELOW_MM, m, m + RULER_BELOW_MM};
}

/* Black cells of one tag, whose lower left corner lies at (x, y) mm from the page's upper left, into the path. */
static void add_tag(cairo_t *cr, const tsuya_tag_pattern *p, double x, double y, double tag_mm)
{
    double cell = tag_mm / p->border_width, rim = 0.5 * (p->width - p->border_width) * cell;
    for (int row = 0; row < p->width; row++) {
        for (int begin = 0, end; begin < p->width; begin = end + 1) {
            for (end = begin; end < p->width && !p->white[row * p->width + end]; end++) {
            }
            if (end > begin) {
                cairo_rectangle(cr, x - rim + begin * cell, y - tag_mm - rim + row * cell, (end - begin) * cell, cell);
            }
        }
    }
}

/* A ruler (as long as a bar, else 100 mm) and what the board is. */
static void draw_ruler(cairo_t *cr, const tsuya_target_options *o, const tsuya_target_page *page, int tags)
{
    char text[200];
    bool bar = o->kind == TSUYA_TARGET_BAR;
    double y = page->height_mm - 10.0, left = bar ? page->left_mm : o->margin_mm;
    int length = bar ? (int)floor(o->size_mm) : RULER_MM;
    cairo_set_line_width(cr, 0.1);
    for (int i = 0; i <= length; i++) {
        cairo_move_to(cr, left + i, y);
        cairo_line_to(cr, left + i, y - (i % 10 == 0 ? 5.0 : i % 5 == 0 ? 3.5 : 2.0));
    }
    cairo_move_to(cr, left, y);
    cairo_line_to(cr, left + length, y);
    cairo_stroke(cr);
    snprintf(text, sizeof text, "%d mm: measure it; %s, border %d, tags of %g mm, %g mm apart, ids %d to %d", length, o->family, o->border_bits, o->tag_mm, o->gap_mm,
             o->first_id, o->first_id + tags - 1);
    cairo_set_font_size(cr, 2.4);
    cairo_move_to(cr, left, y + 4.0);
    cairo_show_text(cr, text);
}

/* Degrees around a mat, counter-clockwise from +x, and a cross on its axis. */
static void draw_degrees(cairo_t *cr, const tsuya_target_options *o, const tsuya_target_page *page)
{
    double x = page->left_mm, y = page->height_mm - page->bottom_mm, r = 0.5 * o->size_mm;
    cairo_set_line_width(cr, 0.15);
    cairo_new_path(cr); /* the text's end is a current point */
    cairo_arc(cr, x, y, r, 0.0, 2.0 * M_PI);
    cairo_stroke(cr);
    for (int d = 0; d < 360; d += 2) {
        double a = d * M_PI / 180.0, inner = r - (d % 10 == 0 ? 0.9 : 0.5) * DEGREES_MM;
        cairo_move_to(cr, x + r * cos(a), y - r * sin(a));
        cairo_line_to(cr, x + inner * cos(a), y - inner * sin(a));
    }
    cairo_move_to(cr, x - 5, y);
    cairo_line_to(cr, x + 5, y);
    cairo_move_to(cr, x, y - 5);
    cairo_line_to(cr, x, y + 5);
    cairo_stroke(cr);
}

static tsuya_status draw_tags(cairo_t *cr, const tsuya_target_options *o, const tsuya_target_page *page, const tsuya_target_tag *tag, int count)
{
    for (int i = 0; i < count; i++) {
        tsuya_tag_pattern pattern;
        TSUYA_TRY(tsuya_tag_pattern_create(&pattern, o->family, o->border_bits, o->first_id + i));
        double outside = (pattern.width - pattern.border_width) * o->tag_mm / pattern.border_width;
        if (outside > o->gap_mm * (1 + 1e-9) + (count == 1 ? INFINITY : 0.0)) {
            tsuya_tag_pattern_free(&pattern);
            return tsuya_fail(TSUYA_ERROR_INPUT, "gap of %g mm: cells of %s outside the tag's edge need %g mm or more between tags of %g mm", o->gap_mm,
                              o->family, outside, o->tag_mm);
        }
        add_tag(cr, &pattern, page->left_mm + tag[i].x_mm - 0.5 * o->tag_mm, page->height_mm - page->bottom_mm - tag[i].y_mm + 0.5 * o->tag_mm, o->tag_mm);
        tsuya_tag_pattern_free(&pattern);
    }
    cairo_fill(cr);
    return TSUYA_OK;
}

static tsuya_status save_pdf(const char *path, const tsuya_target_options *o, const tsuya_target_tag *tag, int count)
{
    tsuya_target_page page = tsuya_target_page_of(o);
    cairo_surface_t *surface = cairo_pdf_surface_create(path, page.width_mm * POINTS, page.height_mm * POINTS);
    cairo_t *cr = cairo_create(surface);
    cairo_scale(cr, POINTS, POINTS);
    cairo_set_source_rgb(cr, 0, 0, 0);
    tsuya_status status = draw_tags(cr, o, &page, tag, count);
    draw_ruler(cr, o, &page, count);
    if (o->kind == TSUYA_TARGET_MAT) {
        draw_degrees(cr, o, &page);
    }
    cairo_destroy(cr);
    cairo_surface_finish(surface);
    if (status == TSUYA_OK && cairo_surface_status(surface) != CAIRO_STATUS_SUCCESS) {
        status = tsuya_fail(TSUYA_ERROR_IO, "%s: cannot write: %s", path, cairo_status_to_string(cairo_surface_status(surface)));
    }
    cairo_surface_destroy(surface);
    return status;
}

static tsuya_status save_grid(const char *path, const tsuya_target_options *o)
{
    char text[512];
    int n = snprintf(text, sizeof text, "{family: %s, border_bits: %d, cols: %d, rows: %d, tag_mm: %.10g, gap_mm: %.10g, first_id: %d}\n", o->family,
                     o->border_bits, o->cols, o->rows, o->tag_mm, o->gap_mm, o->first_id);
    return tsuya_file_write(path, text, (size_t)n);
}

/* Tags one by one. */
static tsuya_status save_list(const char *path, const tsuya_target_options *o, const tsuya_target_tag *tag, int count)
{
    size_t size = 256 + 128 * (size_t)count, used;
    char *text = tsuya_calloc(size, 1);
    if (!text) {
        return TSUYA_ERROR_MEMORY;
    }
    used = (size_t)snprintf(text, size, "family: %s\nborder_bits: %d\nboards:\n  - name: %s\n    tags:\n", o->family, o->border_bits,
                            o->kind == TSUYA_TARGET_MAT ? "mat" : "bar");
    for (int i = 0; i < count; i++) {
        used += (size_t)snprintf(text + used, size - used, "      - {id: %d, x_mm: %.6f, y_mm: %.6f, size_mm: %.10g}\n", o->first_id + i, tag[i].x_mm, tag[i].y_mm, o->tag_mm);
    }
    tsuya_status status = tsuya_file_write(path, text, used);
    tsuya_free(text);
    return status;
}

static tsuya_status save_both(const char *pdf, const char *yaml, const tsuya_target_options *o, const tsuya_target_tag *tag, int count)
{
    char *temporary;
    TSUYA_TRY(tsuya_file_temporary_name(&temporary, pdf));
    tsuya_status status = save_pdf(temporary, o, tag, count);
    if (status == TSUYA_OK) {
        status = tsuya_file_rename_into_place(temporary, pdf);
    } else {
        (void)remove(temporary);
    }
    tsuya_free(temporary);
    TSUYA_TRY(status);
    return o->kind == TSUYA_TARGET_GRID ? save_grid(yaml, o) : save_list(yaml, o, tag, count);
}

tsuya_status tsuya_target_save(const char *pdf, const char *yaml, const tsuya_target_options *o)
{
    int count = tsuya_target_tags(NULL, 0, o);
    if (count < 1 || count > TSUYA_TARGET_MOST) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%g mm are too small for tags of %g mm, %g mm apart: %s", o->size_mm, o->tag_mm, o->gap_mm,
                          o->kind == TSUYA_TARGET_MAT ? "a mat has four or more in a ring" : "a bar has two at either end");
    }
    tsuya_target_tag *tag = tsuya_calloc((size_t)count, sizeof *tag);
    if (!tag) {
        return TSUYA_ERROR_MEMORY;
    }
    (void)tsuya_target_tags(tag, count, o);
    tsuya_status status = save_both(pdf, yaml, o, tag, count);
    tsuya_free(tag);
    return status;
}
