/* The weft field on the surface: from several sides as streaks, its confidence, and the threads on the photographs. */
#include "app/report_parts.h"

#include "app/weave_maps.h"
#include "app/weave_picture.h"
#include "core/memory.h"
#include "render/views.h"

#include <math.h>

enum { VIEW_WIDTH_PX = 380, VIEW_HEIGHT_PX = 520, SIDES = 4, OVERLAY_PX = 700, SINGULARITIES = 40 };

static tsuya_status show_side(tsuya_report *report, int side, const float *value)
{
    tsuya_turntable table = {.up = report->up, .elevation_rad = tsuya_rad_from_deg(12.0), .field_rad = tsuya_rad_from_deg(24.0),
                             .width_px = VIEW_WIDTH_PX, .height_px = VIEW_HEIGHT_PX};
    tsuya_camera camera;
    tsuya_pose camera_from_world;
    tsuya_image picture = {0};
    char caption[64];
    snprintf(caption, sizeof caption, "from %d°", 360 / SIDES * side);
    TSUYA_TRY(tsuya_turntable_fit(&table, &report->mesh));
    tsuya_turntable_view(&table, side, SIDES, &camera, &camera_from_world);
    TSUYA_TRY(tsuya_weave_picture(&picture, &report->mesh, &camera, camera_from_world, value, report->context));
    tsuya_html_picture(&report->html, &picture, false, "weave", caption, caption);
    tsuya_image_free(&picture);
    return TSUYA_OK;
}

static double figure(const tsuya_json *figures, const char *key) { return tsuya_json_number_or(tsuya_json_member(figures, key), NAN); }

static void cell(tsuya_report *report, double value, const char *format)
{
    char text[64] = "–";
    if (isfinite(value)) {
        snprintf(text, sizeof text, format, value);
    }
    tsuya_html_raw(&report->html, "<td>%s</td>", text);
}

static void write_table(tsuya_report *report, const tsuya_json *figures)
{
    tsuya_html_raw(&report->html, "<table><tr><th>Photographs</th><th>Patches</th><th>of them sure</th><th>Surface covered</th>"
                                  "<th>Weft threads / unit</th><th>Warp threads / unit</th><th>Shear, median</th><th>Shear, 90 %%</th>"
                                  "<th>Singularities</th><th>Weft told by</th></tr><tr>");
    cell(report, figure(figures, "photos"), "%.0f");
    cell(report, figure(figures, "patches"), "%.0f");
    cell(report, 100.0 * figure(figures, "patches_sure"), "%.1f %%");
    cell(report, 100.0 * figure(figures, "covered_fraction"), "%.1f %%");
    cell(report, figure(figures, "threads_per_m_weft"), "%.4g");
    cell(report, figure(figures, "threads_per_m_warp"), "%.4g");
    cell(report, figure(figures, "shear_deg_median"), "%.2f°");
    cell(report, figure(figures, "shear_deg_p90"), "%.2f°");
    cell(report, figure(figures, "singularities"), "%.0f");
    tsuya_html_raw(&report->html, "<td>");
    tsuya_html_text(&report->html, tsuya_json_text_or(tsuya_json_member(figures, "weft_told_by"), "–"));
    tsuya_html_raw(&report->html, "</td>");
    tsuya_html_raw(&report->html, "</tr></table>\n");
}

/* A number per vertex where threads were seen, on clay. */
static tsuya_status show_map(tsuya_report *report, const float *value, int stride, const char *title)
{
    tsuya_weave_map map;
    tsuya_status status = tsuya_weave_map_create(&map, &report->mesh, value, stride);
    if (status == TSUYA_OK && map.seen > 0) {
        tsuya_report_values(report, map.value, title, map.low, map.high);
    }
    tsuya_free(map.value);
    return status;
}

static void show_maps(tsuya_report *report)
{
    const tsuya_mesh *mesh = &report->mesh;
    if (mesh->shear_deg) {
        tsuya_report_check(report, show_map(report, mesh->shear_deg, 1, "Shear: angle from weft to warp less 90°, in degrees"));
    }
    if (mesh->threads_per_m) {
        tsuya_report_check(report, show_map(report, mesh->threads_per_m, 2, "Weft threads a unit of length"));
        tsuya_report_check(report, show_map(report, mesh->threads_per_m + 1, 2, "Warp threads a unit of length"));
    }
}

static void list_singularities(tsuya_report *report, const tsuya_json *figures)
{
    const tsuya_json *list = tsuya_json_member(figures, "singularity_list");
    int count = list ? tsuya_json_count(list) : 0;
    if (count == 0) {
        return;
    }
    tsuya_html_raw(&report->html, "<h3>Singularities</h3><table><tr><th>x</th><th>y</th><th>z</th><th>Quarter turns</th><th>Confidence</th></tr>\n");
    for (int i = 0; i < count && i < SINGULARITIES; i++) {
        const tsuya_json *one = tsuya_json_element(list, i);
        tsuya_html_raw(&report->html, "<tr>");
        cell(report, figure(one, "x"), "%.4g");
        cell(report, figure(one, "y"), "%.4g");
        cell(report, figure(one, "z"), "%.4g");
        cell(report, figure(one, "quarter_turns"), "%+.0f");
        cell(report, figure(one, "confidence"), "%.2f");
        tsuya_html_raw(&report->html, "</tr>\n");
    }
    tsuya_html_raw(&report->html, "</table>\n");
}

static tsuya_status show_overlay(tsuya_report *report, const char *name)
{
    tsuya_image photo = {0}, small = {0};
    const char *path = tsuya_job_path(report->job, "weave/overlay/%s", name);
    if (!path) {
        return TSUYA_ERROR_MEMORY;
    }
    tsuya_status status = tsuya_image_load(&photo, path);
    if (status == TSUYA_OK) {
        status = tsuya_report_reduce(&small, &photo, OVERLAY_PX);
    }
    if (status == TSUYA_OK) {
        tsuya_html_picture(&report->html, &small, false, "weave", name, name);
    }
    tsuya_image_free(&photo);
    tsuya_image_free(&small);
    return status;
}

static tsuya_status show_overlays(tsuya_report *report)
{
    char **names;
    int count;
    const char *folder = tsuya_job_path(report->job, "weave/overlay");
    if (!folder) {
        return TSUYA_ERROR_MEMORY;
    }
    if (!tsuya_path_is_folder(folder)) {
        return TSUYA_OK;
    }
    TSUYA_TRY(tsuya_folder_list(&names, &count, folder, report->job->arena));
    if (count == 0) {
        return TSUYA_OK;
    }
    tsuya_html_raw(&report->html, "<h3>Threads in the photographs: weft long, warp short, violet unsure, yellow sure</h3><div class=\"grid g4\">\n");
    for (int i = 0; i < count; i++) {
        TSUYA_TRY(show_overlay(report, names[i]));
    }
    tsuya_html_raw(&report->html, "</div>\n");
    return TSUYA_OK;
}

void tsuya_report_weave(tsuya_report *report)
{
    const tsuya_json *figures = tsuya_report_figures(report, "weave");
    bool seen = false;
    if (!figures || !report->mesh.weft || !report->mesh.weave_confidence || report->mesh.triangle_count == 0) {
        return;
    }
    if (tsuya_json_get_bool(&seen, figures, "threads_seen") != TSUYA_OK) {
        seen = false;
    }
    tsuya_report_open(report, "weave", "Weft field",
                      seen ? "Streaks run along the weft. Colour is the probability that the direction is right within 2 degrees, from 0 (dark) to 1 (yellow)."
                           : "The photographs show no threads: the field follows texture and folds, and its confidence is low everywhere.");
    write_table(report, figures);
    tsuya_html_raw(&report->html, "<h3>Along the weft</h3><div class=\"grid g4\">\n");
    for (int i = 0; i < SIDES; i++) {
        tsuya_report_check(report, show_side(report, i, NULL));
    }
    tsuya_html_raw(&report->html, "</div>\n<h3>The same, coloured by confidence</h3><div class=\"scale\">0<span class=\"ramp\"></span>1</div><div class=\"grid g4\">\n");
    for (int i = 0; i < SIDES; i++) {
        tsuya_report_check(report, show_side(report, i, report->mesh.weave_confidence));
    }
    tsuya_html_raw(&report->html, "</div>\n");
    if (seen) {
        show_maps(report);
        list_singularities(report, figures);
    }
    tsuya_report_check(report, show_overlays(report));
    tsuya_report_close(report);
}
