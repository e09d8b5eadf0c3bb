/* The pictures that were rendered, and what they share with the photographs. */
#include "app/report_parts.h"

#include <math.h>
#include <string.h>

enum { RENDER_SIDE_PX = 460, COMPARE_SIDE_PX = 1100, RENDERS_SHOWN = 36, COMPARED_SHOWN = 12 };

static tsuya_status show_picture(tsuya_report *report, const char *path, int side_px, const char *group, const char *caption)
{
    tsuya_image full = {0}, small = {0};
    tsuya_status status = path ? tsuya_image_load(&full, path) : TSUYA_ERROR_MEMORY;
    if (status == TSUYA_OK) {
        status = tsuya_report_reduce(&small, &full, side_px);
    }
    if (status == TSUYA_OK) {
        tsuya_html_picture(&report->html, &small, false, group, caption, caption);
    }
    tsuya_image_free(&full);
    tsuya_image_free(&small);
    return status;
}

static double number(const tsuya_json *object, const char *key)
{
    return tsuya_json_number_or(tsuya_json_member(object, key), NAN);
}

static void figure_cells(tsuya_report *report, const tsuya_json *like)
{
    const tsuya_json *de00 = tsuya_json_member(like, "de00");
    tsuya_html_raw(&report->html,
                   "<td class=\"n\">%.1f</td><td class=\"n\">%.3f</td><td class=\"n\">%.2f</td><td class=\"n\">%.2f</td>"
                   "<td class=\"n\">%.2f</td><td class=\"n\">%.1f %%</td></tr>\n",
                   number(like, "psnr_db"), number(like, "ssim"), number(de00, "mean"), number(de00, "median"), number(de00, "p95"),
                   100.0 * number(like, "compared"));
}

static void group_row(tsuya_report *report, const tsuya_json *group, const char *title)
{
    if (group) {
        tsuya_html_raw(&report->html, "<tr><th>%s (%.0f)</th><td></td>", title, number(group, "photos"));
        figure_cells(report, group);
    }
}

static bool held_out(const tsuya_json *like)
{
    bool flag = false;
    return tsuya_json_get_bool(&flag, like, "held_out") == TSUYA_OK && flag;
}

static void compare_table(tsuya_report *report, const tsuya_json *document)
{
    const tsuya_json *figures = tsuya_json_member(document, "like");
    tsuya_html_raw(&report->html, "<div class=\"wide\"><table><tr><th>Photograph</th><th class=\"n\">Gain r, g, b</th>"
                                  "<th class=\"n\">PSNR, dB</th><th class=\"n\">SSIM</th><th class=\"n\">ΔE00 mean</th>"
                                  "<th class=\"n\">median</th><th class=\"n\">95 %%</th><th class=\"n\">of the mask</th></tr>\n");
    const tsuya_json *pictures = tsuya_json_member(document, "pictures");
    for (const tsuya_json *p = tsuya_json_first(pictures); p; p = tsuya_json_next(p)) {
        const tsuya_json *like = tsuya_json_member(p, "like"), *gain = tsuya_json_member(like, "gain");
        if (like) {
            tsuya_html_raw(&report->html, "<tr><td>");
            tsuya_html_text(&report->html, tsuya_json_text_or(tsuya_json_member(p, "camera"), ""));
            tsuya_html_raw(&report->html, "%s</td><td class=\"n\">%.3g, %.3g, %.3g</td>", held_out(like) ? " <b>held out</b>" : "",
                           tsuya_json_number_or(tsuya_json_element(gain, 0), NAN), tsuya_json_number_or(tsuya_json_element(gain, 1), NAN),
                           tsuya_json_number_or(tsuya_json_element(gain, 2), NAN));
            figure_cells(report, like);
        }
    }
    group_row(report, tsuya_json_member(figures, "hold_out"), "Held out");
    group_row(report, tsuya_json_member(figures, "others"), "Others");
    tsuya_html_raw(&report->html, "</table></div>\n");
}

/* Held-out photographs first. */
static void compare_pictures(tsuya_report *report, const tsuya_json *document, const char *render)
{
    int shown = 0;
    for (int pass = 0; pass < 2; pass++) {
        const tsuya_json *pictures = tsuya_json_member(document, "pictures");
        for (const tsuya_json *p = tsuya_json_first(pictures); p && shown < COMPARED_SHOWN; p = tsuya_json_next(p)) {
            const tsuya_json *like = tsuya_json_member(p, "like");
            if (!like || held_out(like) != (pass == 0)) {
                continue;
            }
            char caption[256];
            const char *name = tsuya_json_text_or(tsuya_json_member(p, "name"), "");
            snprintf(caption, sizeof caption, "%.100s%s: photograph, render, ΔE00 (black 0, white 20 and more); mean %.2f", name,
                     pass == 0 ? ", held out" : "", number(tsuya_json_member(like, "de00"), "mean"));
            tsuya_report_check(report, show_picture(report, tsuya_job_path(report->job, "render/%s/%s.compare.png", render, name),
                                                    COMPARE_SIDE_PX, "compare", caption));
            shown++;
        }
    }
}

static void show_compared(tsuya_report *report, const char *render)
{
    const char *path = tsuya_job_path(report->job, "render/%s/render.json", render);
    tsuya_json *document = NULL;
    tsuya_status status = path ? tsuya_json_load(&document, path) : TSUYA_ERROR_MEMORY;
    tsuya_report_check(report, status);
    if (status == TSUYA_OK) {
        tsuya_html_raw(&report->html, "<p class=\"lead\">Rendered through the photographs' own cameras, lens included, and compared inside "
                                      "the mask where the render shows cloth. Exposure and white balance are %s.%s</p>\n",
                       "one gain per channel, fitted to each photograph",
                       report->job->lights ? "" : " The lamps of the photographs were not given, so a studio that stands with the camera "
                                                  "stands in for them: the differences are mostly those of the light.");
        compare_table(report, document);
        compare_pictures(report, document, render);
    }
    tsuya_json_free(document);
}

static bool is_picture(const char *name)
{
    return strcmp(tsuya_path_extension(name), ".png") == 0 && !strstr(name, ".compare.png");
}

static void show_sequence(tsuya_report *report, const char *render, const char *folder)
{
    char **names;
    int count, shown = 0;
    tsuya_status status = tsuya_folder_list(&names, &count, folder, report->job->arena);
    tsuya_report_check(report, status);
    tsuya_html_raw(&report->html, "<div class=\"grid g4\">\n");
    for (int i = 0; status == TSUYA_OK && i < count && shown < RENDERS_SHOWN; i++) {
        if (is_picture(names[i])) {
            tsuya_report_check(report, show_picture(report, tsuya_job_path(report->job, "render/%s/%s", render, names[i]),
                                                    RENDER_SIDE_PX, "render", names[i]));
            shown++;
        }
    }
    tsuya_html_raw(&report->html, "</div>\n");
}

static void show_renders(tsuya_report *report, const tsuya_job_render *render)
{
    const char *folder = tsuya_job_path(report->job, "render/%s", render->name);
    if (!folder || !tsuya_path_is_folder(folder)) {
        return;
    }
    tsuya_html_raw(&report->html, "<h3>");
    tsuya_html_text(&report->html, render->name);
    tsuya_html_raw(&report->html, "</h3>\n");
    if (render->like) {
        show_compared(report, render->name);
    } else {
        show_sequence(report, render->name, folder);
    }
}

void tsuya_report_renders(tsuya_report *report)
{
    if (!tsuya_state_record(report->state, "render")) {
        return;
    }
    tsuya_report_open(report, "renders", "Renders", "The surface with its weft field and material under computed light. The same pictures lie "
                                                    "in the folder render/, also as EXR in linear light.");
    for (int i = 0; i < report->job->render.count; i++) {
        show_renders(report, tsuya_job_render_at(report->job, i));
    }
    tsuya_report_close(report);
}
