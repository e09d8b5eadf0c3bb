/* Where the cameras stood: the sparse model from above and from the side, as SVG. */
#include "app/report_parts.h"

#include <math.h>
#include <stdlib.h>

enum { SIDE_PX = 560, POINTS = 3500 };

/* Plan of a projection: drawing axes in the world, and the window that is shown. */
typedef struct plan {
    tsuya_vec3 right, down, origin;
    double scale; /* px a unit */
} plan;

static void to_plan(const plan *p, tsuya_vec3 world, double *x, double *y)
{
    tsuya_vec3 d = tsuya_vec3_sub(world, p->origin);
    *x = 0.5 * SIDE_PX + p->scale * tsuya_vec3_dot(d, p->right);
    *y = 0.5 * SIDE_PX + p->scale * tsuya_vec3_dot(d, p->down);
}

/* Both plans show every camera and the object. */
static double window_radius(const tsuya_report *report)
{
    double radius = report->radius;
    for (int v = 0; v < report->sparse.view_count; v++) {
        tsuya_vec3 c = tsuya_pose_center(report->sparse.view[v].camera_from_world);
        radius = fmax(radius, tsuya_vec3_norm(tsuya_vec3_sub(c, report->center)));
    }
    return radius > 0.0 ? radius : 1.0;
}

static void draw_points(tsuya_report *report, const plan *p)
{
    size_t count = report->sparse.point_count, step = count / POINTS + 1;
    for (size_t i = 0; i < count; i += step) {
        double x, y;
        to_plan(p, report->sparse.point[i].position, &x, &y);
        if (x > 0.0 && x < SIDE_PX && y > 0.0 && y < SIDE_PX) {
            const uint8_t *c = report->sparse.point[i].color;
            tsuya_html_raw(&report->html, "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"1.1\" fill=\"#%02x%02x%02x\"/>", x, y, c[0], c[1], c[2]);
        }
    }
    tsuya_html_raw(&report->html, "\n");
}

static void draw_camera(tsuya_report *report, const plan *p, const tsuya_view *view, int number, double size)
{
    tsuya_vec3 center = tsuya_pose_center(view->camera_from_world);
    const tsuya_camera *camera = &report->sparse.camera[view->camera];
    double half_x = 0.5 * camera->width_px / camera->fx_px, half_y = 0.5 * camera->height_px / camera->fy_px, x, y;
    const double corner[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
    tsuya_html_raw(&report->html, "<g><title>");
    tsuya_html_text(&report->html, view->name);
    tsuya_html_raw(&report->html, "</title><path class=\"cam\" d=\"");
    double px[4], py[4];
    to_plan(p, center, &x, &y);
    for (int i = 0; i < 4; i++) {
        tsuya_vec3 ray = {corner[i][0] * half_x, corner[i][1] * half_y, 1.0};
        tsuya_vec3 tip = tsuya_vec3_mad(center, size, tsuya_mat3_apply_transposed(view->camera_from_world.rotation, ray));
        to_plan(p, tip, &px[i], &py[i]);
        tsuya_html_raw(&report->html, "M%.1f %.1fL%.1f %.1f", x, y, px[i], py[i]);
    }
    tsuya_html_raw(&report->html, "M%.1f %.1fL%.1f %.1fL%.1f %.1fL%.1f %.1fZ\"/>", px[0], py[0], px[1], py[1], px[2], py[2], px[3], py[3]);
    tsuya_html_raw(&report->html, "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"2.6\" fill=\"#7a1f2b\"/>", x, y);
    if (report->sparse.view_count <= 60) {
        tsuya_html_raw(&report->html, "<text x=\"%.1f\" y=\"%.1f\" font-size=\"10\" fill=\"#5a5147\">%d</text>", x + 4.0, y - 4.0, number);
    }
    tsuya_html_raw(&report->html, "</g>\n");
}

static void draw_plan(tsuya_report *report, const plan *p, const char *title, double camera_size)
{
    tsuya_html_raw(&report->html,
                   "<figure><svg viewBox=\"0 0 %d %d\" role=\"img\" aria-label=\"%s\">"
                   "<style>.cam{fill:none;stroke:#7a1f2b;stroke-width:.9;opacity:.75}</style>\n",
                   SIDE_PX, SIDE_PX, title);
    draw_points(report, p);
    for (int v = 0; v < report->sparse.view_count; v++) {
        draw_camera(report, p, &report->sparse.view[v], v + 1, camera_size);
    }
    tsuya_html_raw(&report->html, "</svg><figcaption>%s</figcaption></figure>\n", title);
    report->html.picture_count++;
}

static tsuya_vec3 any_perpendicular(tsuya_vec3 up)
{
    tsuya_vec3 axis = fabs(up.x) < 0.7 ? (tsuya_vec3){1, 0, 0} : (tsuya_vec3){0, 1, 0};
    return tsuya_vec3_tangent(axis, up);
}

static void missing_photographs(tsuya_report *report)
{
    bool first = true;
    for (int i = 0; i < report->job->photo.count; i++) {
        const char *name = report->job->photo.photo[i].name;
        if (tsuya_sparse_model_find(&report->sparse, name) < 0) {
            tsuya_html_raw(&report->html, first ? "<p class=\"lead\">Not placed: " : ", ");
            tsuya_html_text(&report->html, name);
            first = false;
        }
    }
    if (!first) {
        tsuya_html_raw(&report->html, ".</p>\n");
    }
}

static void camera_table(tsuya_report *report)
{
    tsuya_html_raw(&report->html, "<table><tr><th>Camera</th><th class=\"n\">Image</th><th class=\"n\">Focal length, px</th>"
                                  "<th class=\"n\">Principal point, px</th><th class=\"n\">Distortion k1, k2, p1, p2</th></tr>\n");
    for (int c = 0; c < report->sparse.camera_count; c++) {
        const tsuya_camera *k = &report->sparse.camera[c];
        tsuya_html_raw(&report->html,
                       "<tr><td>%d</td><td class=\"n\">%d × %d</td><td class=\"n\">%.2f, %.2f</td><td class=\"n\">%.2f, %.2f</td>"
                       "<td class=\"n\">%.5f, %.5f, %.5f, %.5f</td></tr>\n",
                       c + 1, k->width_px, k->height_px, k->fx_px, k->fy_px, k->cx_px, k->cy_px, k->distortion[0], k->distortion[1],
                       k->distortion[2], k->distortion[3]);
    }
    tsuya_html_raw(&report->html, "</table>\n");
}

void tsuya_report_cameras(tsuya_report *report)
{
    if (report->sparse.view_count == 0) {
        return;
    }
    double radius = window_radius(report), size = 0.09 * radius;
    tsuya_vec3 side = any_perpendicular(report->up), across = tsuya_vec3_cross(report->up, side);
    plan top = {side, tsuya_vec3_scale(across, -1.0), report->center, 0.44 * SIDE_PX / radius};
    plan front = {side, tsuya_vec3_scale(report->up, -1.0), report->center, 0.44 * SIDE_PX / radius};
    tsuya_report_open(report, "cameras", "Cameras around the object",
                      "Every pyramid is a photograph, its number the place in the order of names; dots are the features that several "
                      "photographs agree on, in their colours. Point at a camera to read its name.");
    missing_photographs(report);
    tsuya_html_raw(&report->html, "<div class=\"grid g2\">\n");
    draw_plan(report, &top, "From above", size);
    draw_plan(report, &front, "From the side", size);
    tsuya_html_raw(&report->html, "</div>\n");
    camera_table(report);
    tsuya_report_close(report);
}
