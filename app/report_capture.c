/* What the capture check found, photograph by photograph. */
#include "app/report_parts.h"

#include <math.h>
#include <stdio.h>

/* Of a record's numbers the largest, times `factor`. */
typedef struct column {
    const char *title, *key[3], *format;
    double factor;
} column;

static const column PHOTOGRAPH[] = {
    {"edge px", {"blur_px"}, "%.2f", 1.0},
    {"clip %", {"clipped_red", "clipped_green", "clipped_blue"}, "%.2f", 100.0},
    {"EV", {"exposure_ev"}, "%.2f", 1.0},
    {"red EV", {"red_ev"}, "%.2f", 1.0},
    {"blue EV", {"blue_ev"}, "%.2f", 1.0},
    {"overlaps", {"neighbours"}, "%.0f", 1.0},
    {"tags", {"tags"}, "%.0f", 1.0},
    {"azimuth °", {"azimuth_deg"}, "%.0f", 1.0},
    {"elevation °", {"elevation_deg"}, "%.0f", 1.0},
};
static const column MISSING[] = {{"covers more, %", {"gain"}, "%.1f", 100.0}};

static void write_cell(tsuya_report *report, const tsuya_json *record, const column *c)
{
    double value = NAN;
    char text[32] = "–";
    for (int k = 0; k < 3 && c->key[k]; k++) {
        value = fmax(value, c->factor * tsuya_json_number_or(tsuya_json_member(record, c->key[k]), NAN));
    }
    if (isfinite(value)) {
        snprintf(text, sizeof text, c->format, value);
    }
    tsuya_html_raw(&report->html, "<td class=\"n\">%s</td>", text);
}

/* One row a record: what `name` says, and its numbers. */
static void write_table(tsuya_report *report, const tsuya_json *records, const char *title, const char *name, const column *c, size_t count)
{
    if (!tsuya_json_first(records)) {
        return;
    }
    tsuya_html_raw(&report->html, "<div class=\"wide\"><table><tr><th>%s</th>", title);
    for (size_t k = 0; k < count; k++) {
        tsuya_html_raw(&report->html, "<th class=\"n\">%s</th>", c[k].title);
    }
    tsuya_html_raw(&report->html, "</tr>\n");
    for (const tsuya_json *r = tsuya_json_first(records); r; r = tsuya_json_next(r)) {
        bool again = false;
        bool bad = tsuya_json_member(r, "again") && tsuya_json_get_bool(&again, r, "again") == TSUYA_OK && again;
        tsuya_html_raw(&report->html, bad ? "<tr class=\"bad\"><td>" : "<tr><td>");
        tsuya_html_text(&report->html, tsuya_json_text_or(tsuya_json_member(r, name), "–"));
        tsuya_html_raw(&report->html, "</td>");
        for (size_t k = 0; k < count; k++) {
            write_cell(report, r, &c[k]);
        }
        tsuya_html_raw(&report->html, "</tr>\n");
    }
    tsuya_html_raw(&report->html, "</table></div>\n");
}

/* What to take again, and why. */
static void write_list(tsuya_report *report, const tsuya_json *texts)
{
    if (!tsuya_json_is_text(tsuya_json_first(texts))) {
        return;
    }
    tsuya_html_raw(&report->html, "<p>Worth taking again:</p><ul>\n");
    for (const tsuya_json *t = tsuya_json_first(texts); t; t = tsuya_json_next(t)) {
        tsuya_html_raw(&report->html, "<li>");
        tsuya_html_text(&report->html, tsuya_json_text_or(t, ""));
        tsuya_html_raw(&report->html, "</li>\n");
    }
    tsuya_html_raw(&report->html, "</ul>\n");
}

void tsuya_report_capture(tsuya_report *report)
{
    const tsuya_json *figures = tsuya_report_figures(report, "capture");
    if (!figures) {
        return;
    }
    tsuya_report_open(report, "capture", "Photographs", "Sharpness, clipping and exposure of every photograph, as they came.");
    write_list(report, tsuya_json_member(figures, "again"));
    write_table(report, tsuya_json_member(figures, "missing"), "Take one", "where", MISSING, sizeof MISSING / sizeof *MISSING);
    write_table(report, tsuya_json_member(figures, "photographs"), "Photograph", "name", PHOTOGRAPH, sizeof PHOTOGRAPH / sizeof *PHOTOGRAPH);
    tsuya_report_close(report);
}
