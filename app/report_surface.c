/* The surface from several sides, what supports it, and the weft field on it. */
#include "app/report_parts.h"

#include "app/terminal.h"
#include "core/order.h"

#include "render/views.h"

#include <math.h>

enum { VIEW_WIDTH_PX = 330, VIEW_HEIGHT_PX = 440 };

static tsuya_status show_view(tsuya_report *report, int view, int view_count, const tsuya_shade_options *options, const char *caption)
{
    tsuya_turntable table = {.up = report->up, .elevation_rad = tsuya_rad_from_deg(12.0), .field_rad = tsuya_rad_from_deg(24.0),
                             .width_px = VIEW_WIDTH_PX, .height_px = VIEW_HEIGHT_PX};
    tsuya_camera camera;
    tsuya_pose camera_from_world;
    tsuya_image picture = {0};
    TSUYA_TRY(tsuya_turntable_fit(&table, &report->mesh));
    tsuya_turntable_view(&table, view, view_count, &camera, &camera_from_world);
    TSUYA_TRY(tsuya_shade_view(&picture, &report->mesh, &camera, camera_from_world, options, report->context));
    tsuya_html_picture(&report->html, &picture, options->shade == TSUYA_SHADE_VALUE, "surface", caption, caption);
    tsuya_image_free(&picture);
    return TSUYA_OK;
}

/* The range between two quantiles. */
static tsuya_status value_range(double *low, double *high, const float *value, size_t count, const double quantile[2])
{
    float *sorted = tsuya_calloc(count, sizeof *sorted);
    if (!sorted) {
        return TSUYA_ERROR_MEMORY;
    }
    size_t n = 0;
    for (size_t i = 0; i < count; i++) {
        if (isfinite(value[i])) {
            sorted[n++] = value[i];
        }
    }
    tsuya_sort_floats(sorted, n);
    *low = n > 0 ? sorted[(size_t)(quantile[0] * (double)(n - 1))] : 0.0;
    *high = n > 0 ? sorted[(size_t)(quantile[1] * (double)(n - 1))] : 0.0;
    if (!(*high > *low)) {
        *high = *low + 1.0;
    }
    tsuya_free(sorted);
    return TSUYA_OK;
}

/* Drawn between two quantiles of the values. */
static void show_values(tsuya_report *report, const float *value, const char *title, double low_quantile, double high_quantile)
{
    double low, high;
    tsuya_status status = value_range(&low, &high, value, report->mesh.vertex_count, (double[]){low_quantile, high_quantile});
    tsuya_report_check(report, status);
    if (status == TSUYA_OK) {
        tsuya_report_values(report, value, title, low, high);
    }
}

void tsuya_report_values(tsuya_report *report, const float *value, const char *title, double low, double high)
{
    tsuya_shade_options options = {TSUYA_SHADE_VALUE, value, low, high};
    tsuya_html_raw(&report->html, "<h3>%s</h3><div class=\"scale\">%.4g<span class=\"ramp\"></span>%.4g</div><div class=\"grid g4\">\n", title, low, high);
    for (int i = 0; i < 4; i++) {
        char caption[64];
        snprintf(caption, sizeof caption, "from %d°", 90 * i);
        tsuya_report_check(report, show_view(report, i, 4, &options, caption));
    }
    tsuya_html_raw(&report->html, "</div>\n");
}

static void surface_table(tsuya_report *report)
{
    tsuya_vec3 low, high;
    tsuya_mesh_bounds(&report->mesh, &low, &high);
    tsuya_html_raw(&report->html,
                   "<table><tr><th>Vertices</th><th>Triangles</th><th>Extent</th><th>Area</th><th>Mean edge</th></tr>"
                   "<tr><td>%zu</td><td>%zu</td><td>%.4g × %.4g × %.4g</td><td>%.4g</td><td>%.4g</td></tr></table>\n",
                   report->mesh.vertex_count, report->mesh.triangle_count, high.x - low.x, high.y - low.y, high.z - low.z,
                   tsuya_mesh_area(&report->mesh), tsuya_mesh_mean_edge(&report->mesh));
}

static void precision_row(tsuya_report *report, const char *what, const tsuya_json *step, double unit, const char *unit_name)
{
    char duration[TSUYA_DURATION_SIZE];
    tsuya_html_raw(&report->html, "<tr><td>%s</td><td>%.0f px, %.0f neighbours</td><td>%.3g %s</td><td>%s</td></tr>", what,
                   tsuya_json_number_or(tsuya_json_member(step, "dense_long_side_px"), NAN),
                   tsuya_json_number_or(tsuya_json_member(step, "source_views"), NAN),
                   unit * tsuya_json_number_or(tsuya_json_member(step, "error_units"), NAN), unit_name,
                   tsuya_format_duration(duration, tsuya_json_number_or(tsuya_json_member(step, "dense_seconds"), NAN)));
}

/* What the depth maps' size costs and gives, and what the next finer one would. */
static void precision_table(tsuya_report *report)
{
    const tsuya_json *figures = tsuya_report_figures(report, "reconstruct"), *precision = tsuya_json_member(figures, "precision");
    const tsuya_json *finer = tsuya_json_member(precision, "finer");
    bool metric = report->job->poses || isfinite(tsuya_json_number_or(tsuya_json_member(figures, "scale_m_per_unit"), NAN));
    if (!precision) {
        return;
    }
    tsuya_html_raw(&report->html, "<table><tr><th></th><th>Depth maps</th><th>Error expected (two standard deviations)</th><th>Depth to surface</th></tr>");
    precision_row(report, "this surface", tsuya_json_member(precision, "chosen"), metric ? 1e3 : 1.0, metric ? "mm" : "units");
    if (tsuya_json_is_object(finer)) {
        precision_row(report, "next finer step", finer, metric ? 1e3 : 1.0, metric ? "mm" : "units");
    }
    tsuya_html_raw(&report->html, "</table>\n");
    if (!tsuya_json_is_object(finer)) {
        tsuya_html_raw(&report->html, "<p>These photographs give nothing finer.</p>\n");
    }
}

void tsuya_report_surface(tsuya_report *report)
{
    if (report->mesh.triangle_count == 0) {
        return;
    }
    tsuya_shade_options clay = {.shade = TSUYA_SHADE_CLAY}, color = {.shade = TSUYA_SHADE_COLOR};
    char caption[64];
    tsuya_report_open(report, "surface", "Surface", "The mesh from all sides: as unpainted clay, which shows the folds alone, and in the photographs' colours.");
    surface_table(report);
    precision_table(report);
    tsuya_html_raw(&report->html, "<div class=\"grid g6\">\n");
    for (int i = 0; i < 6; i++) {
        snprintf(caption, sizeof caption, "clay, from %d°", 60 * i);
        tsuya_report_check(report, show_view(report, i, 6, &clay, caption));
    }
    for (int i = 0; report->mesh.color && i < 6; i++) {
        snprintf(caption, sizeof caption, "colours, from %d°", 60 * i);
        tsuya_report_check(report, show_view(report, i, 6, &color, caption));
    }
    tsuya_html_raw(&report->html, "</div>\n");
    if (report->mesh.evidence) {
        show_values(report, report->mesh.evidence, "Evidence: how many photographs support each place", 0.02, 0.98);
    }
    if (report->mesh.sigma) {
        show_values(report, report->mesh.sigma, "Uncertainty of the position along the normal (one standard deviation)", 0.0, 0.9);
    }
    tsuya_report_close(report);
}
