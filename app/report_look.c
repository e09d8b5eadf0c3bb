/* How the cloth looks: its material. */
#include "app/report_parts.h"

#include "brdf/material.h"

#include <math.h>
#include <string.h>

enum { LOBE_PX = 360, MAP_PX = 180 };

static tsuya_vec3 direction(double theta_deg, double phi_deg)
{
    double t = tsuya_rad_from_deg(theta_deg), p = tsuya_rad_from_deg(phi_deg);
    return (tsuya_vec3){sin(t) * cos(p), sin(t) * sin(p), cos(t)};
}

static double mean_value(const tsuya_material *material, tsuya_vec3 wi, tsuya_vec3 wo)
{
    double value[TSUYA_MATERIAL_MAX_CHANNELS], sum = 0.0;
    int n = tsuya_material_get_info(material).channel_count;
    tsuya_material_eval(material, NULL, wi, wo, value);
    for (int c = 0; c < n; c++) {
        sum += value[c];
    }
    return sum / n;
}

/* The plane of incidence at azimuth phi: radius is the cube root of the BRDF, so that lobe and body both show. */
static void draw_lobes(tsuya_report *report, const tsuya_material *material, double phi_deg, const char *title)
{
    static const double incidence_deg[] = {0.0, 30.0, 60.0};
    static const char *const color[] = {"#3f5e5a", "#a8843b", "#7a1f2b"};
    double peak = 1e-9, base_y = LOBE_PX * 0.62, reach = LOBE_PX * 0.46;
    for (int k = 0; k < 3; k++) {
        for (int t = -88; t <= 88; t++) {
            peak = fmax(peak, cbrt(mean_value(material, direction(incidence_deg[k], phi_deg + 180.0), direction(t, phi_deg))));
        }
    }
    tsuya_html_raw(&report->html, "<figure><svg viewBox=\"0 0 %d %.0f\" role=\"img\" aria-label=\"%s\">\n", LOBE_PX, base_y + 34.0, title);
    tsuya_html_raw(&report->html, "<line x1=\"10\" x2=\"%d\" y1=\"%.1f\" y2=\"%.1f\" stroke=\"#b9ae9b\"/>\n", LOBE_PX - 10, base_y, base_y);
    for (int k = 0; k < 3; k++) {
        tsuya_vec3 wi = direction(incidence_deg[k], phi_deg + 180.0);
        tsuya_html_raw(&report->html, "<polyline fill=\"none\" stroke=\"%s\" stroke-width=\"1.8\" points=\"", color[k]);
        for (int t = -89; t <= 89; t++) {
            double r = reach * cbrt(mean_value(material, wi, direction(t, phi_deg))) / peak;
            tsuya_html_raw(&report->html, "%.1f,%.1f ", 0.5 * LOBE_PX + r * sin(tsuya_rad_from_deg(t)), base_y - r * cos(tsuya_rad_from_deg(t)));
        }
        double s = sin(tsuya_rad_from_deg(-incidence_deg[k])), c = cos(tsuya_rad_from_deg(incidence_deg[k]));
        tsuya_html_raw(&report->html, "\"/><line x1=\"%.1f\" y1=\"%.1f\" x2=\"%.1f\" y2=\"%.1f\" stroke=\"%s\" stroke-dasharray=\"4 3\"/>"
                                      "<text x=\"%d\" y=\"%.1f\" font-size=\"12\" fill=\"%s\">light at %.0f°</text>\n",
                       0.5 * LOBE_PX + reach * 1.06 * s, base_y - reach * 1.06 * c, 0.5 * LOBE_PX, base_y, color[k], 14 + 115 * k, base_y + 22.0,
                       color[k], incidence_deg[k]);
    }
    tsuya_html_raw(&report->html, "</svg><figcaption>%s</figcaption></figure>\n", title);
    report->html.picture_count++;
}

/* All exit directions at once: disc of (sinθ cosφ, sinθ sinφ), logarithmic from 1e-3 of the peak. */
static tsuya_status draw_hemisphere(tsuya_report *report, const tsuya_material *material, double phi_deg, const char *caption)
{
    float value[MAP_PX * MAP_PX];
    tsuya_vec3 wi = direction(45.0, phi_deg);
    float peak = 1e-9f;
    tsuya_image picture = {0};
    for (int y = 0; y < MAP_PX; y++) {
        for (int x = 0; x < MAP_PX; x++) {
            double u = (2.0 * x + 1.0) / MAP_PX - 1.0, v = 1.0 - (2.0 * y + 1.0) / MAP_PX, rr = u * u + v * v;
            float f = rr < 0.998 ? (float)mean_value(material, wi, (tsuya_vec3){u, v, sqrt(1.0 - rr)}) : -1.0f;
            value[y * MAP_PX + x] = f;
            peak = fmaxf(peak, f);
        }
    }
    TSUYA_TRY(tsuya_image_create(&picture, MAP_PX, MAP_PX, 3, TSUYA_SAMPLE_U8, TSUYA_ENCODING_SRGB));
    for (int i = 0; i < MAP_PX * MAP_PX; i++) {
        uint8_t *rgb = tsuya_image_u8(&picture, i % MAP_PX, i / MAP_PX);
        memcpy(rgb, (uint8_t[]){255, 253, 249}, 3);
        if (value[i] >= 0.0f) {
            tsuya_color_map(rgb, 1.0 + log10(fmax((double)value[i] / (double)peak, 1e-9)) / 3.0);
        }
    }
    tsuya_html_picture(&report->html, &picture, true, "lobe", caption, caption);
    tsuya_image_free(&picture);
    return TSUYA_OK;
}

static void parameter_rows(tsuya_report *report, const tsuya_json *object, const char *prefix)
{
    for (const tsuya_json *m = tsuya_json_first(object); m; m = tsuya_json_next(m)) {
        char name[160], text[512] = "";
        snprintf(name, sizeof name, "%s%s%s", prefix, prefix[0] ? ", " : "", tsuya_json_key(m));
        if (tsuya_json_is_object(m)) {
            parameter_rows(report, m, name);
            continue;
        }
        if (tsuya_json_is_number(m)) {
            snprintf(text, sizeof text, "%.6g", tsuya_json_number_or(m, 0.0));
        } else if (tsuya_json_is_array(m)) {
            for (const tsuya_json *e = tsuya_json_first(m); e && strlen(text) < 200; e = tsuya_json_next(e)) {
                size_t used = strlen(text);
                snprintf(text + used, sizeof text - used, "%s%.4g", used ? ", " : "", tsuya_json_number_or(e, NAN));
            }
        } else {
            snprintf(text, sizeof text, "%s", tsuya_json_text_or(m, "–"));
        }
        tsuya_html_raw(&report->html, "<tr><td>");
        tsuya_html_text(&report->html, name);
        tsuya_html_raw(&report->html, "</td><td>");
        tsuya_html_text(&report->html, text);
        tsuya_html_raw(&report->html, "</td></tr>\n");
    }
}

static void material_table(tsuya_report *report, const tsuya_material *material, const tsuya_material_info *info)
{
    tsuya_json *root;
    tsuya_status status = tsuya_material_to_json(&root, material);
    tsuya_report_check(report, status);
    if (status != TSUYA_OK) {
        return;
    }
    tsuya_html_raw(&report->html, "<table><tr><th>Property</th><th>Value</th></tr>\n<tr><td>model</td><td>");
    tsuya_html_text(&report->html, info->model);
    tsuya_html_raw(&report->html, "</td></tr>\n<tr><td>measured</td><td>%s</td></tr>\n",
                   info->is_default ? "no: a built-in default" : isfinite(info->heldout_cbrt) ? "yes" : "not stated");
    if (isfinite(info->heldout_cbrt)) {
        tsuya_html_raw(&report->html, "<tr><td>error on held-out samples (cube roots)</td><td>%.4g</td></tr>\n", info->heldout_cbrt);
    }
    parameter_rows(report, tsuya_json_member(root, "dye"), "dye");
    parameter_rows(report, tsuya_json_member(root, "parameters"), "");
    tsuya_html_raw(&report->html, "</table>\n");
    tsuya_json_free(root);
}

static void show_material(tsuya_report *report, const char *path)
{
    tsuya_material *material = NULL;
    tsuya_status status = tsuya_material_load(&material, path);
    tsuya_report_check(report, status);
    if (status != TSUYA_OK) {
        return;
    }
    tsuya_material_info info = tsuya_material_get_info(material);
    tsuya_html_raw(&report->html, "<h3>");
    tsuya_html_text(&report->html, info.name);
    tsuya_html_raw(&report->html, "</h3>");
    if (info.is_default) {
        tsuya_html_raw(&report->html, "<p><span class=\"chip warn\">default: measured on nothing, chosen to look like silk</span></p>");
    }
    tsuya_html_raw(&report->html, "<p class=\"lead\">");
    tsuya_html_text(&report->html, info.note);
    tsuya_html_raw(&report->html, "</p>\n<div class=\"grid g2\">\n");
    draw_lobes(report, material, 0.0, "Reflection in the plane along the weft (radius: cube root of the BRDF)");
    draw_lobes(report, material, 90.0, "Reflection in the plane along the warp");
    tsuya_html_raw(&report->html, "</div>\n<div class=\"grid g6\">\n");
    tsuya_report_check(report, draw_hemisphere(report, material, 0.0, "All directions, light 45° along the weft"));
    tsuya_report_check(report, draw_hemisphere(report, material, 45.0, "Light 45°, between weft and warp"));
    tsuya_report_check(report, draw_hemisphere(report, material, 90.0, "Light 45° along the warp"));
    tsuya_html_raw(&report->html, "</div>\n");
    material_table(report, material, &info);
    tsuya_material_free(material);
}

void tsuya_report_material(tsuya_report *report)
{
    const char *folder = tsuya_job_path(report->job, "brdf");
    char **names;
    int count;
    if (!tsuya_state_record(report->state, "brdf") || !folder || !tsuya_path_is_folder(folder)) {
        return;
    }
    tsuya_status status = tsuya_folder_list(&names, &count, folder, report->job->arena);
    tsuya_report_check(report, status);
    if (status != TSUYA_OK) {
        return;
    }
    tsuya_report_open(report, "material", "Material", "How the cloth reflects: light comes along the dashed lines, the curves show how much leaves in each direction.");
    for (int i = 0; i < count; i++) {
        if (strcmp(tsuya_path_extension(names[i]), ".json") == 0 && strcmp(names[i], "fit.json") != 0) {
            show_material(report, tsuya_job_path(report->job, "brdf/%s", names[i]));
        }
    }
    tsuya_report_close(report);
}
