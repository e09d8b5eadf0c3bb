/* What the capture check found, photograph by photograph. */
#include "app/report_parts.h"

#include <math.h>
#include <string.h>

static void write_cell(tsuya_report *report, const tsuya_json *object, const char *key)
{
    const tsuya_json *value = tsuya_json_member(object, key);
    bool flag;
    if (tsuya_json_is_number(value)) {
        tsuya_html_raw(&report->html, "<td class=\"n\">%.3g</td>", tsuya_json_number_or(value, 0.0));
        return;
    }
    tsuya_html_raw(&report->html, "<td>");
    if (tsuya_json_is_text(value)) {
        tsuya_html_text(&report->html, tsuya_json_text_or(value, ""));
    } else if (value && !tsuya_json_is_null(value) && tsuya_json_get_bool(&flag, object, key) == TSUYA_OK) {
        tsuya_html_text(&report->html, flag ? "yes" : "no");
    } else {
        tsuya_html_text(&report->html, "–");
    }
    tsuya_html_raw(&report->html, "</td>");
}

/* One row a record, one column a key of the first that holds one value; underscores read as spaces. */
static void write_table(tsuya_report *report, const tsuya_json *records)
{
    const tsuya_json *first = tsuya_json_first(records);
    tsuya_html_raw(&report->html, "<div class=\"wide\"><table><tr>");
    for (const tsuya_json *k = tsuya_json_first(first); k; k = tsuya_json_next(k)) {
        char title[96];
        if (tsuya_json_is_array(k)) {
            continue;
        }
        snprintf(title, sizeof title, "%s", tsuya_json_key(k));
        for (char *c = strchr(title, '_'); c; c = strchr(c, '_')) {
            *c = ' ';
        }
        tsuya_html_raw(&report->html, tsuya_json_is_number(k) ? "<th class=\"n\">" : "<th>");
        tsuya_html_text(&report->html, title);
        tsuya_html_raw(&report->html, "</th>");
    }
    tsuya_html_raw(&report->html, "</tr>\n");
    for (const tsuya_json *r = tsuya_json_first(records); r; r = tsuya_json_next(r)) {
        bool again = false;
        bool bad = tsuya_json_member(r, "again") && tsuya_json_get_bool(&again, r, "again") == TSUYA_OK && again;
        tsuya_html_raw(&report->html, bad ? "<tr class=\"bad\">" : "<tr>");
        for (const tsuya_json *k = tsuya_json_first(first); k; k = tsuya_json_next(k)) {
            if (!tsuya_json_is_array(k)) {
                write_cell(report, r, tsuya_json_key(k));
            }
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
    for (const tsuya_json *m = tsuya_json_first(figures); m; m = tsuya_json_next(m)) {
        if (tsuya_json_is_array(m) && tsuya_json_is_object(tsuya_json_first(m))) {
            write_table(report, m);
        }
    }
    tsuya_report_close(report);
}
