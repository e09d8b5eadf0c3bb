#include "capture/target.h"

#include "calib/apriltag_adapter.h"
#include "core/file.h"
#include "core/memory.h"

#include <cairo/cairo-pdf.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

enum { RULER_MM = 100 };
static const double POINTS = 72.0 / 25.4, RULER_BELOW_MM = 14.0;

tsuya_target_options tsuya_target_options_default(void)
{
    return (tsuya_target_options){.family = "tag36h11", .border_bits = 1, .cols = 8, .rows = 5, .tag_mm = 30, .gap_mm = 9, .margin_mm = 15};
}

tsuya_target_page tsuya_target_page_of(const tsuya_target_options *o)
{
    double width = o->cols * o->tag_mm + (o->cols - 1) * o->gap_mm, height = o->rows * o->tag_mm + (o->rows - 1) * o->gap_mm;
    return (tsuya_target_page){fmax(width, RULER_MM) + 2 * o->margin_mm, height + 2 * o->margin_mm + RULER_BELOW_MM, o->margin_mm,
                               o->margin_mm + RULER_BELOW_MM};
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

/* A ruler of 100 mm and what the board is. */
static void draw_ruler(cairo_t *cr, const tsuya_target_options *o, const tsuya_target_page *page)
{
    char text[160];
    double y = page->height_mm - 10.0;
    cairo_set_line_width(cr, 0.1);
    for (int i = 0; i <= RULER_MM; i++) {
        cairo_move_to(cr, page->left_mm + i, y);
        cairo_line_to(cr, page->left_mm + i, y - (i % 10 == 0 ? 5.0 : i % 5 == 0 ? 3.5 : 2.0));
    }
    cairo_move_to(cr, page->left_mm, y);
    cairo_line_to(cr, page->left_mm + RULER_MM, y);
    cairo_stroke(cr);
    snprintf(text, sizeof text, "%d mm: measure it; %s, border %d, tags of %g mm, %g mm apart, ids %d to %d", RULER_MM, o->family, o->border_bits,
             o->tag_mm, o->gap_mm, o->first_id, o->first_id + o->cols * o->rows - 1);
    cairo_set_font_size(cr, 2.4);
    cairo_move_to(cr, page->left_mm, y + 4.0);
    cairo_show_text(cr, text);
}

static tsuya_status draw_tags(cairo_t *cr, const tsuya_target_options *o, const tsuya_target_page *page)
{
    for (int i = 0; i < o->cols * o->rows; i++) {
        tsuya_tag_pattern pattern;
        TSUYA_TRY(tsuya_tag_pattern_create(&pattern, o->family, o->border_bits, o->first_id + i));
        double pitch = o->tag_mm + o->gap_mm, outside = (pattern.width - pattern.border_width) * o->tag_mm / pattern.border_width;
        if (outside > o->gap_mm * (1 + 1e-9) + (o->cols * o->rows == 1 ? INFINITY : 0.0)) {
            tsuya_tag_pattern_free(&pattern);
            return tsuya_fail(TSUYA_ERROR_INPUT, "gap of %g mm: cells of %s outside the tag's edge need %g mm or more between tags of %g mm", o->gap_mm,
                              o->family, outside, o->tag_mm);
        }
        add_tag(cr, &pattern, page->left_mm + i % o->cols * pitch, page->height_mm - page->bottom_mm - i / o->cols * pitch, o->tag_mm);
        tsuya_tag_pattern_free(&pattern);
    }
    cairo_fill(cr);
    return TSUYA_OK;
}

static tsuya_status save_pdf(const char *path, const tsuya_target_options *o)
{
    tsuya_target_page page = tsuya_target_page_of(o);
    cairo_surface_t *surface = cairo_pdf_surface_create(path, page.width_mm * POINTS, page.height_mm * POINTS);
    cairo_t *cr = cairo_create(surface);
    cairo_scale(cr, POINTS, POINTS);
    cairo_set_source_rgb(cr, 0, 0, 0);
    tsuya_status status = draw_tags(cr, o, &page);
    draw_ruler(cr, o, &page);
    cairo_destroy(cr);
    cairo_surface_finish(surface);
    if (status == TSUYA_OK && cairo_surface_status(surface) != CAIRO_STATUS_SUCCESS) {
        status = tsuya_fail(TSUYA_ERROR_IO, "%s: cannot write: %s", path, cairo_status_to_string(cairo_surface_status(surface)));
    }
    cairo_surface_destroy(surface);
    return status;
}

static tsuya_status save_yaml(const char *path, const tsuya_target_options *o)
{
    char text[512];
    int n = snprintf(text, sizeof text, "{family: %s, border_bits: %d, cols: %d, rows: %d, tag_mm: %.10g, gap_mm: %.10g, first_id: %d}\n", o->family,
                     o->border_bits, o->cols, o->rows, o->tag_mm, o->gap_mm, o->first_id);
    return tsuya_file_write(path, text, (size_t)n);
}

tsuya_status tsuya_target_save(const char *pdf, const char *yaml, const tsuya_target_options *options)
{
    char *temporary;
    TSUYA_TRY(tsuya_file_temporary_name(&temporary, pdf));
    tsuya_status status = save_pdf(temporary, options);
    if (status == TSUYA_OK) {
        status = tsuya_file_rename_into_place(temporary, pdf);
    } else {
        (void)remove(temporary);
    }
    tsuya_free(temporary);
    return status == TSUYA_OK ? save_yaml(yaml, options) : status;
}
