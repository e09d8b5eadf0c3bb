/* The report's first page: figures, warnings, comparison with the truth, time and memory, versions. */
#include "app/report_parts.h"
#include "app/terminal.h"
#include "core/process.h"

#include <math.h>
#include <string.h>
#include <sys/utsname.h>
#include <unistd.h>

static double figure(const tsuya_json *figures, const char *key) { return tsuya_json_number_or(tsuya_json_member(figures, key), NAN); }

static void card(tsuya_report *report, const char *label, const char *note, const char *format, ...) TSUYA_PRINTF(4, 5);
static void card(tsuya_report *report, const char *label, const char *note, const char *format, ...)
{
    char value[128];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(value, sizeof value, format, arguments);
    va_end(arguments);
    tsuya_html_raw(&report->html, "<div class=\"card\"><span>");
    tsuya_html_text(&report->html, label);
    tsuya_html_raw(&report->html, "</span><b>");
    tsuya_html_text(&report->html, value);
    tsuya_html_raw(&report->html, "</b><small>");
    tsuya_html_text(&report->html, note);
    tsuya_html_raw(&report->html, "</small></div>\n");
}

static void chip(tsuya_report *report, const char *kind, const char *text)
{
    tsuya_html_raw(&report->html, "<span class=\"chip %s\">", kind);
    tsuya_html_text(&report->html, text);
    tsuya_html_raw(&report->html, "</span>");
}

static bool has_warnings(const tsuya_report *report)
{
    for (int i = 0; i < TSUYA_STAGE_COUNT; i++) {
        const tsuya_json *record = tsuya_state_record(report->state, tsuya_stages[i].name);
        if (tsuya_json_count(tsuya_json_member(record, "warnings")) > 0) {
            return true;
        }
    }
    return false;
}

/* With known poses the unit is the one they came in; otherwise it is COLMAP's own until a scale is given. */
static bool is_metric(const tsuya_report *report)
{
    return report->job->poses || isfinite(figure(tsuya_report_figures(report, "reconstruct"), "scale_m_per_unit"));
}

static void write_chips(tsuya_report *report)
{
    tsuya_html_raw(&report->html, "<div class=\"chips\">");
    if (report->job->has_camera) {
        chip(report, "good", "calibrated camera model");
    } else if (report->job->poses) {
        chip(report, "good", "cameras and poses as given");
    } else {
        chip(report, "warn", "not calibrated");
    }
    chip(report, is_metric(report) ? "good" : "warn", is_metric(report) ? "in metres" : "no scale: lengths in units of the reconstruction");
    if (report->job->materials.count == 0) {
        chip(report, "warn", "default material, not measured");
    }
    chip(report, has_warnings(report) ? "warn" : "good", has_warnings(report) ? "has warnings" : "no warnings");
    tsuya_html_raw(&report->html, "</div>\n");
}

static void reconstruct_cards(tsuya_report *report)
{
    const tsuya_json *f = tsuya_report_figures(report, "reconstruct");
    if (!f) {
        return;
    }
    card(report, "Photographs placed", "found their position around the object", "%.0f of %.0f", figure(f, "registered"), figure(f, "photos"));
    if (isfinite(figure(f, "reprojection_px"))) {
        card(report, "Reprojection error", "mean distance of a feature from its point, pixels", "%.2f px", figure(f, "reprojection_px"));
    }
    card(report, "Surface", "triangles; vertices are half of that", "%.0f k", figure(f, "mesh_triangles") / 1000.0);
    double gsd = figure(f, "gsd_m");
    if (isfinite(gsd)) {
        card(report, "Ground sample distance", "size of a photograph's pixel on the cloth", is_metric(report) ? "%.3g mm" : "%.3g units",
             is_metric(report) ? 1000.0 * gsd : gsd);
    }
}

static void write_cards(tsuya_report *report)
{
    double seconds = 0.0, peak_mb = 0.0;
    char duration[TSUYA_DURATION_SIZE];
    for (int i = 0; i < TSUYA_STAGE_COUNT; i++) {
        const tsuya_json *record = tsuya_state_record(report->state, tsuya_stages[i].name);
        if (record) {
            seconds += figure(record, "seconds");
            peak_mb = fmax(peak_mb, figure(record, "peak_mb"));
        }
    }
    tsuya_html_raw(&report->html, "<div class=\"cards\">\n");
    reconstruct_cards(report);
    const tsuya_json *weave = tsuya_report_figures(report, "weave");
    if (weave) {
        card(report, "Weft field", "share of the surface that photographs speak for", "%.0f %%", 100.0 * figure(weave, "covered_fraction"));
    }
    card(report, "Working time", "all stages on this computer", "%s", tsuya_format_duration(duration, seconds));
    card(report, "Memory", "highest at any moment", "%.2f GiB", peak_mb / 1024.0);
    tsuya_html_raw(&report->html, "</div>\n");
}

void tsuya_report_summary(tsuya_report *report)
{
    tsuya_report_open(report, "summary", "Summary", NULL);
    write_chips(report);
    write_cards(report);
    if (!report->job->has_camera && !report->job->poses) {
        tsuya_html_raw(&report->html, "<p class=\"lead\">The camera is <b>not calibrated</b>: its focal length starts from the photographs' EXIF "
                                      "and is refined together with the positions. Shapes are right up to a slight bend; sizes are not known.</p>\n");
    }
    tsuya_report_close(report);
}

void tsuya_report_warnings(tsuya_report *report)
{
    if (!has_warnings(report)) {
        return;
    }
    tsuya_report_open(report, "warnings", "Warnings", NULL);
    tsuya_html_raw(&report->html, "<ul class=\"warnings\">\n");
    for (int i = 0; i < TSUYA_STAGE_COUNT; i++) {
        const tsuya_json *record = tsuya_state_record(report->state, tsuya_stages[i].name);
        const tsuya_json *warnings = tsuya_json_member(record, "warnings");
        for (const tsuya_json *w = tsuya_json_first(warnings); w; w = tsuya_json_next(w)) {
            tsuya_html_raw(&report->html, "<li><b>%s</b> ", tsuya_stages[i].name);
            tsuya_html_text(&report->html, tsuya_json_text_or(w, ""));
            tsuya_html_raw(&report->html, "</li>\n");
        }
    }
    tsuya_html_raw(&report->html, "</ul>\n");
    tsuya_report_close(report);
}

/* stage: "" after the first row of one. */
static void truth_row(tsuya_report *report, const tsuya_json *value, const char *name, const char *stage, double seconds)
{
    if (tsuya_json_is_object(value)) {
        for (const tsuya_json *m = tsuya_json_first(value); m; m = tsuya_json_next(m)) {
            char nested[128];
            snprintf(nested, sizeof nested, "%s, %s", name, tsuya_json_key(m));
            truth_row(report, m, nested, m == tsuya_json_first(value) ? stage : "", seconds);
        }
        return;
    }
    char duration[TSUYA_DURATION_SIZE] = "";
    if (stage[0]) {
        tsuya_format_duration(duration, seconds);
    }
    tsuya_html_raw(&report->html, "<tr><td>%s</td><td class=\"n\">%s</td><td>", stage, duration);
    tsuya_html_text(&report->html, name);
    if (tsuya_json_is_number(value)) {
        tsuya_html_raw(&report->html, "</td><td class=\"n\">%.4g</td></tr>\n", tsuya_json_number_or(value, 0.0));
    } else {
        tsuya_html_raw(&report->html, "</td><td class=\"n\">not measured</td></tr>\n");
    }
}

void tsuya_report_truth(tsuya_report *report)
{
    static const char *const rows[][3] = {
        {"calib", "focal_rel", "Focal length, relative error"},
        {"reconstruct", "scale_rel", "Scale, relative error"},
        {"reconstruct", "camera_center_gsd", "Camera positions, rms, ground sample distances"},
        {"reconstruct", "surface_gsd", "Distance from the true surface, ground sample distances"},
        {"reconstruct", "completeness", "Share of the true surface that is there (within 2 GSD)"},
        {"weave", "weft_deg", "Weft direction where threads were seen, error in degrees"},
        {"weave", "covered_fraction", "Share of the surface where threads were seen"},
        {"weave", "weft_all_deg", "Weft direction on the whole surface, error in degrees"},
        {"brdf", "brdf_cbrt", "Reflectance, error of cube roots"},
        {"render", "rerender_de00", "Photographs held out, rendered again: colour difference ΔE00"},
    };
    const char *last = "";
    if (!report->demo) {
        return;
    }
    tsuya_report_open(report, "truth", "Against the truth",
                      "The photographs of this job were drawn by the program from a cloth that it knows exactly. The job saw the "
                      "photographs alone; this table holds its result against that cloth.");
    tsuya_html_raw(&report->html, "<table><tr><th>Stage</th><th class=\"n\">Time</th><th>Figure</th><th class=\"n\">Value</th></tr>\n");
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const tsuya_json *value = tsuya_json_member(report->demo, rows[i][1]);
        if (value) {
            double seconds = figure(tsuya_json_member(report->demo, "stages"), rows[i][0]);
            truth_row(report, value, rows[i][2], strcmp(last, rows[i][0]) != 0 ? rows[i][0] : "", seconds);
            last = rows[i][0];
        }
    }
    tsuya_html_raw(&report->html, "</table>\n");
    tsuya_report_close(report);
}

static double total_seconds(const tsuya_report *report)
{
    double sum = 0.0;
    for (int i = 0; i < TSUYA_STAGE_COUNT; i++) {
        const tsuya_json *record = tsuya_state_record(report->state, tsuya_stages[i].name);
        sum += record ? fmax(figure(record, "seconds"), 0.0) : 0.0;
    }
    return sum;
}

static void time_rows(tsuya_report *report, const char *stage)
{
    const tsuya_json *record = tsuya_state_record(report->state, stage);
    char duration[TSUYA_DURATION_SIZE];
    tsuya_html_raw(&report->html, "<tr><td>%s</td><td class=\"n\">%s</td><td class=\"n\">%.0f</td><td>", stage,
                   tsuya_format_duration(duration, figure(record, "seconds")), figure(record, "peak_mb"));
    tsuya_html_text(&report->html, tsuya_json_text_or(tsuya_json_member(record, "finished"), ""));
    tsuya_html_raw(&report->html, "</td><td>%s, stage %.0f</td></tr>\n",
                   tsuya_json_text_or(tsuya_json_member(record, "program"), ""), figure(record, "version"));
    const tsuya_json *steps = tsuya_json_member(tsuya_json_member(record, "figures"), "stages");
    for (const tsuya_json *s = tsuya_json_first(steps); s; s = tsuya_json_next(s)) {
        double seconds = tsuya_json_number_or(tsuya_json_is_object(s) ? tsuya_json_member(s, "seconds") : s, NAN);
        double peak_mb = figure(s, "peak_mb");
        tsuya_html_raw(&report->html, "<tr class=\"step\"><td>");
        tsuya_html_text(&report->html, tsuya_json_key(s));
        tsuya_html_raw(&report->html, "</td><td class=\"n\">%s</td><td class=\"n\">", tsuya_format_duration(duration, seconds));
        if (isfinite(peak_mb)) {
            tsuya_html_raw(&report->html, "%.0f", peak_mb);
        }
        tsuya_html_raw(&report->html, "</td><td></td><td></td></tr>\n");
    }
}

typedef struct bar_cursor {
    double x, total_s;
    int color;
} bar_cursor;

static void bar_piece(tsuya_report *report, bar_cursor *at, const char *stage, const char *step, double seconds)
{
    static const char *const colors[] = {"#7a1f2b", "#a8843b", "#3f5e5a", "#9a6a57", "#5b4a6b", "#7d8b5a", "#b08d8d", "#42617f"};
    double width = at->total_s > 0.0 ? 1100.0 * seconds / at->total_s : 0.0;
    char duration[TSUYA_DURATION_SIZE];
    if (!(seconds > 0.0)) {
        return;
    }
    tsuya_html_raw(&report->html, "<g><title>");
    tsuya_html_textf(&report->html, "%s%s%s: %s", stage, step ? ", " : "", step ? step : "", tsuya_format_duration(duration, seconds));
    tsuya_html_raw(&report->html, "</title><rect x=\"%.1f\" y=\"12\" width=\"%.1f\" height=\"34\" fill=\"%s\"/>", 20.0 + at->x,
                   fmax(width - 0.6, 0.4), colors[at->color % 8]);
    const char *name = step ? step : stage;
    if (width > 9.0 * (double)strlen(name)) {
        tsuya_html_raw(&report->html, "<text x=\"%.1f\" y=\"33\" font-size=\"13\" fill=\"#fff\" text-anchor=\"middle\">", 20.0 + at->x + 0.5 * width);
        tsuya_html_text(&report->html, name);
        tsuya_html_raw(&report->html, "</text>");
    }
    tsuya_html_raw(&report->html, "</g>\n");
    at->x += width;
    at->color++;
}

static void time_bar(tsuya_report *report)
{
    bar_cursor at = {.total_s = total_seconds(report)};
    tsuya_html_raw(&report->html, "<svg viewBox=\"0 0 1140 58\" role=\"img\" aria-label=\"Time of every stage\">\n");
    for (int i = 0; i < TSUYA_STAGE_COUNT; i++) {
        const char *stage = tsuya_stages[i].name;
        const tsuya_json *record = tsuya_state_record(report->state, stage);
        double left_s = record ? figure(record, "seconds") : 0.0;
        const tsuya_json *steps = tsuya_json_member(tsuya_json_member(record, "figures"), "stages");
        for (const tsuya_json *s = tsuya_json_first(steps); s; s = tsuya_json_next(s)) {
            double seconds = tsuya_json_number_or(tsuya_json_is_object(s) ? tsuya_json_member(s, "seconds") : s, 0.0);
            bar_piece(report, &at, stage, tsuya_json_key(s), seconds);
            left_s -= seconds;
        }
        bar_piece(report, &at, stage, NULL, left_s);
    }
    tsuya_html_raw(&report->html, "</svg>\n");
}

void tsuya_report_times(tsuya_report *report)
{
    char duration[TSUYA_DURATION_SIZE];
    tsuya_report_open(report, "times", "Time and memory", "Stages in order; below a stage the steps it reports. This report's own time is not in it.");
    time_bar(report);
    tsuya_html_raw(&report->html, "<div class=\"wide\"><table><tr><th>Stage</th><th class=\"n\">Time</th><th class=\"n\">Peak memory, MiB</th>"
                                  "<th>Finished</th><th>Version</th></tr>\n");
    for (int i = 0; i < TSUYA_STAGE_COUNT; i++) {
        if (tsuya_state_record(report->state, tsuya_stages[i].name)) {
            time_rows(report, tsuya_stages[i].name);
        }
    }
    tsuya_html_raw(&report->html, "<tr><th>All</th><th class=\"n\">%s</th><th></th><th></th><th></th></tr></table></div>\n",
                   tsuya_format_duration(duration, total_seconds(report)));
    tsuya_report_close(report);
}

static void version_row(tsuya_report *report, const char *name, const char *value)
{
    tsuya_html_raw(&report->html, "<tr><td>%s</td><td>", name);
    tsuya_html_text(&report->html, value);
    tsuya_html_raw(&report->html, "</td></tr>\n");
}

static void colmap_version(tsuya_report *report)
{
    static const char *const argv[] = {"colmap", "help", NULL};
    static const char *const environment[] = {"QT_QPA_PLATFORM=offscreen", NULL};
    char *output = NULL;
    if (tsuya_process_capture(&output, NULL, argv, environment) != TSUYA_OK) {
        version_row(report, "COLMAP", "not found");
        return;
    }
    output[strcspn(output, "\n")] = '\0';
    version_row(report, "COLMAP", output);
    tsuya_free(output);
}

void tsuya_report_versions(tsuya_report *report)
{
    struct utsname system;
    char text[512];
    tsuya_report_open(report, "versions", "Versions and settings", NULL);
    tsuya_html_raw(&report->html, "<table><tr><th>What</th><th>Version</th></tr>\n");
    version_row(report, "tsuya", TSUYA_VERSION);
    colmap_version(report);
    version_row(report, "Compiler", __VERSION__);
    if (uname(&system) == 0) {
        snprintf(text, sizeof text, "%s %s %s", system.sysname, system.release, system.machine);
        version_row(report, "System", text);
    }
    snprintf(text, sizeof text, "%d of %ld", report->context->threads, sysconf(_SC_NPROCESSORS_ONLN));
    version_row(report, "Threads", text);
    snprintf(text, sizeof text, "%llu", (unsigned long long)report->context->seed);
    version_row(report, "Seed", text);
    version_row(report, "Job file", report->job->path);
    tsuya_html_raw(&report->html, "</table>\n<h3>Options of every stage</h3><table><tr><th>Stage</th><th>Options</th></tr>\n");
    for (int i = 0; i < TSUYA_STAGE_COUNT; i++) {
        char *options = NULL;
        const tsuya_json *record = tsuya_json_member(tsuya_state_record(report->state, tsuya_stages[i].name), "options");
        if (record && tsuya_json_print(&options, record) == TSUYA_OK) {
            tsuya_html_raw(&report->html, "<tr><td>%s</td><td><code>", tsuya_stages[i].name);
            tsuya_html_text(&report->html, options);
            tsuya_html_raw(&report->html, "</code></td></tr>\n");
            tsuya_free(options);
        }
    }
    tsuya_html_raw(&report->html, "</table>\n");
    tsuya_report_close(report);
}
