/* calib.html: may this camera be used, and why not. */
#include "app/calib_run.h"
#include "app/html.h"
#include "app/report_parts.h"
#include "app/shade.h"

#include <math.h>
#include <stdlib.h>

enum { PICTURE_PX = 640, OVERLAYS = 4, ARROWS = 6000 };

typedef struct page {
    tsuya_html html;
    const tsuya_calibration *c;
    const tsuya_corner_set *corners;
    const tsuya_detect_info *detected;
} page;

tsuya_status tsuya_calib_map_picture(tsuya_image *picture, const tsuya_projection_map *map, const tsuya_camera *camera, double high)
{
    int width = 480, height = (int)(480.0 * camera->height_px / camera->width_px + 0.5);
    TSUYA_TRY(tsuya_image_create(picture, width, height, 3, TSUYA_SAMPLE_U8, TSUYA_ENCODING_SRGB));
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            double u = (double)x * (map->cols - 1) / (width - 1), v = (double)y * (map->rows - 1) / (height - 1);
            int i = (int)fmin(u, map->cols - 2), j = (int)fmin(v, map->rows - 2), cell = (int)(v + 0.5) * map->cols + (int)(u + 0.5);
            const double *a = &map->value[j * map->cols + i], *b = a + map->cols;
            double value = (1 - (v - j)) * ((1 - (u - i)) * a[0] + (u - i) * a[1]) + (v - j) * ((1 - (u - i)) * b[0] + (u - i) * b[1]);
            uint8_t *out = tsuya_image_u8(picture, x, y);
            if (!isfinite(value)) {
                out[0] = out[1] = out[2] = 190;
                continue;
            }
            tsuya_color_map(out, value / high);
            if (!map->covered[cell] && (x + y) % 8 < 2) { /* hatched: no board was seen here */
                for (int k = 0; k < 3; k++) {
                    out[k] = (uint8_t)(out[k] / 2 + 127);
                }
            }
        }
    }
    return TSUYA_OK;
}

/* A round number above the map's 95 % of the covered cells and its corners, so that colours compare. */
static double top_of(const tsuya_projection_map *map)
{
    tsuya_projection_stats s;
    int which;
    double top = tsuya_projection_summary(&s, map) == TSUYA_OK && isfinite(s.max) ? s.max : 1.0, corner = tsuya_projection_corner(&which, map);
    top = isfinite(corner) ? fmin(fmax(top, corner), 3.0 * top) : top;
    double step = pow(10.0, floor(log10(fmax(top, 1e-6))));
    return ceil(top / step) * step;
}

static void map_figure(page *p, const tsuya_projection_map *map, const char *title, const char *lead)
{
    if (map->cols == 0) {
        return;
    }
    tsuya_image picture = {0};
    char caption[512];
    double high = top_of(map);
    snprintf(caption, sizeof caption, "%s: dark 0, yellow %.3g px. %s", title, high, lead);
    tsuya_status status = tsuya_calib_map_picture(&picture, map, &p->c->solve.camera, high);
    if (status == TSUYA_OK) {
        tsuya_html_picture(&p->html, &picture, true, "map", title, caption);
    } else if (p->html.status == TSUYA_OK) {
        p->html.status = status;
    }
    tsuya_image_free(&picture);
}

static void header(page *p)
{
    const tsuya_calibration *c = p->c;
    tsuya_html_raw(&p->html, "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" "
                   "content=\"width=device-width,initial-scale=1\"><title>Calibration</title><style>%s</style></head><body>"
                   "<header class=\"top\"><div><h1>Camera calibration</h1><p>", tsuya_report_style);
    tsuya_html_textf(&p->html, "%s, %d × %d px, %d of %d photographs, %d corners", tsuya_lens_name(c->solve.camera.lens), c->solve.camera.width_px,
                     c->solve.camera.height_px, c->photos_used, p->corners->photo_count, c->solve.observation_count - c->solve.outliers);
    tsuya_html_raw(&p->html, "</p></div></header><main>\n");
}

static void card(page *p, const char *value, const char *name, const char *note)
{
    tsuya_html_raw(&p->html, "<div class=\"card\"><b>%s</b><span>%s</span><small>%s</small></div>", value, name, note);
}

static void verdict(page *p)
{
    const tsuya_calibration *c = p->c;
    const tsuya_calibrate_trial *t = &c->trial[c->chosen];
    char value[96], note[96];
    int which;
    bool good = c->cross_validates && c->advice_count == 0;
    tsuya_html_raw(&p->html, "<section><h2>%s</h2><p class=\"lead\">", good ? "The camera may be used" : c->cross_validates ? "The camera may be used; it could be better"
                                                                                                             : "Use the camera with care");
    tsuya_html_text(&p->html, c->reason);
    tsuya_html_raw(&p->html, ".</p><div class=\"cards\">");
    snprintf(value, sizeof value, "%.3f px", c->solve.rms_px);
    snprintf(note, sizeof note, "per coordinate; %d corners left out", c->solve.outliers);
    card(p, value, "residual", note);
    if (isfinite(t->cross.p90)) {
        snprintf(value, sizeof value, "%.3f px", t->cross.p90);
        snprintf(note, sizeof note, "p90 between two halves, at %.3g m", c->distance_m);
        card(p, value, "cross-validation", note);
    }
    snprintf(value, sizeof value, "%.3f px", tsuya_projection_center(&c->sigma));
    double corner = tsuya_projection_corner(&which, &c->sigma);
    snprintf(note, sizeof note, isfinite(corner) ? "worst corner %.3g px" : "the lens does not reach a corner", corner);
    card(p, value, "uncertainty, centre", note);
    double sigma, focal = tsuya_projection_focal(&sigma, &c->solve.camera, c->covariance.intrinsics);
    bool splined = c->solve.camera.lens == TSUYA_LENS_SPLINED_STEREOGRAPHIC;
    snprintf(value, sizeof value, "%.1f px", focal);
    snprintf(note, sizeof note, splined ? "± %.2g px; in the middle, along x" : "± %.2g px; fy %.1f", sigma, c->solve.camera.fy_px);
    card(p, value, "focal length", note);
    tsuya_html_raw(&p->html, "</div>");
    if (c->advice_count) {
        tsuya_html_raw(&p->html, "<ul class=\"warnings\">");
        for (int i = 0; i < c->advice_count; i++) {
            tsuya_html_raw(&p->html, "<li>");
            tsuya_html_text(&p->html, c->advice[i]);
            tsuya_html_raw(&p->html, "</li>");
        }
        tsuya_html_raw(&p->html, "</ul>");
    }
    tsuya_html_raw(&p->html, "</section>\n");
}

/* Residual arrows where the corners are, drawn larger. */
static void residuals(page *p)
{
    const tsuya_solve *s = &p->c->solve;
    double k = 560.0 / s->camera.width_px, magnify = 12.0 / fmax(s->rms_px, 1e-6);
    int step = s->observation_count / ARROWS + 1;
    tsuya_html_raw(&p->html, "<figure><svg viewBox=\"0 0 560 %.0f\" role=\"img\" aria-label=\"Residuals\">", k * s->camera.height_px);
    for (int i = 0; i < s->observation_count; i += step) {
        const tsuya_solve_observation *o = &s->observation[i];
        double x = k * (o->pixel.x + 0.5), y = k * (o->pixel.y + 0.5), dx = magnify * o->residual_px.x, dy = magnify * o->residual_px.y;
        double length = hypot(dx, dy), cut = length > 60.0 ? 60.0 / length : 1.0;
        tsuya_html_raw(&p->html, "<path d=\"M%.1f %.1fl%.1f %.1f\" stroke=\"%s\" stroke-width=\".7\"/>", x, y, cut * dx, cut * dy,
                       o->outlier ? "#d02020" : "#3b518b");
    }
    tsuya_html_raw(&p->html, "</svg><figcaption>Residuals: observed minus projected, %.0f times as long as they are; red: left out. Arrows that agree "
                   "with their neighbours mean that the lens model is too small.</figcaption></figure>\n", magnify / k);
    p->html.picture_count++;
}

static void coverage(page *p)
{
    const tsuya_solve *s = &p->c->solve;
    double k = 560.0 / s->camera.width_px;
    int step = s->observation_count / ARROWS + 1;
    tsuya_html_raw(&p->html, "<figure><svg viewBox=\"0 0 560 %.0f\" role=\"img\" aria-label=\"Coverage\">", k * s->camera.height_px);
    for (int i = 0; i < s->observation_count; i += step) {
        const tsuya_solve_observation *o = &s->observation[i];
        tsuya_html_raw(&p->html, "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"1.6\" fill=\"hsl(%d 55%% 45%%)\" opacity=\".6\"/>", k * (o->pixel.x + 0.5),
                       k * (o->pixel.y + 0.5), s->view[o->view].photo * 47 % 360);
    }
    tsuya_html_raw(&p->html, "</svg><figcaption>Coverage: every corner, one colour a photograph.</figcaption></figure>\n");
    p->html.picture_count++;
}

static void maps(page *p)
{
    tsuya_html_raw(&p->html, "<section><h2>Where it is known, and where not</h2><p class=\"lead\">Hatched: no board was seen there. Grey: the lens does not reach there.</p>"
                             "<div class=\"grid g2\">\n");
    residuals(p);
    coverage(p);
    map_figure(p, &p->c->sigma, "Uncertainty at the boards' distance", "One sigma of the projection in its worst direction, from the solve's covariance.");
    map_figure(p, &p->c->sigma_infinity, "Uncertainty at infinity", "The same for far points.");
    map_figure(p, &p->c->cross, "Cross-validation at the boards' distance", "Projection difference of two cameras, each from half of the photographs.");
    map_figure(p, &p->c->cross_infinity, "Cross-validation at infinity", "The same for far points.");
    tsuya_html_raw(&p->html, "</div></section>\n");
}

/* A dash where there is no value: without halves nothing is held out. */
static void number_cell(page *p, int digits, double value)
{
    tsuya_html_raw(&p->html, isfinite(value) ? "<td class=\"n\">%.*f</td>" : "<td class=\"n\">–</td>", digits, value);
}

static void lenses(page *p)
{
    const tsuya_calibration *c = p->c;
    tsuya_html_raw(&p->html, "<section><h2>Choice of the lens</h2><table><tr><th>Model</th><th class=\"n\">Residual, px</th><th class=\"n\">Held out, px</th>"
                             "<th class=\"n\">where both halves saw boards, px</th>"
                             "<th class=\"n\">Cross-validation p90, px</th><th class=\"n\">at infinity, px</th></tr>\n");
    for (int i = 0; i < c->trials; i++) {
        const tsuya_calibrate_trial *t = &c->trial[i];
        bool chosen = i == c->chosen;
        char points[32] = "";
        if (t->nx) {
            snprintf(points, sizeof points, ", %d × %d points", t->nx, t->ny);
        }
        tsuya_html_raw(&p->html, "<tr><td>%s%s%s%s%s</td>", chosen ? "<b>" : "", tsuya_lens_name(t->lens), points, t->bent ? ", bent plates" : "",
                       chosen ? "</b>, chosen" : "");
        number_cell(p, 4, t->rms_px);
        number_cell(p, 4, t->heldout_px);
        number_cell(p, 4, t->heldout_near_px);
        number_cell(p, 3, t->cross.p90);
        number_cell(p, 3, t->cross_infinity.p90);
        tsuya_html_raw(&p->html, "</tr>\n");
    }
    tsuya_html_raw(&p->html, "</table></section>\n");
}

static const char *about_bends(const tsuya_calibration *c)
{
    if (c->solve.bent) {
        return "Height of the middle over the edges, and of the corners over the middle by the twist.";
    }
    return c->trial[c->trials - 1].bent ? "Taken as flat: bends do not lower the held-out error by enough (above)." : "Taken as flat: too few photographs to tell bends.";
}

static void plates(page *p)
{
    const tsuya_solve *s = &p->c->solve;
    tsuya_html_raw(&p->html, "<section><h2>Plates as they are</h2><p class=\"lead\">%s</p><table><tr><th>Plate</th><th class=\"n\">Tags larger by</th><th class=\"n\">Bend along x</th>"
                             "<th class=\"n\">along y</th><th class=\"n\">Twist</th></tr>\n",
                   about_bends(p->c));
    for (int i = 0; i < s->board->plate_count; i++) {
        const tsuya_plate_shape *q = &s->shape[i];
        tsuya_html_raw(&p->html, "<tr><td>");
        tsuya_html_text(&p->html, s->board->plate[i].name);
        tsuya_html_raw(&p->html, "</td><td class=\"n\">%.2f %%</td><td class=\"n\">%.2f mm</td><td class=\"n\">%.2f mm</td><td class=\"n\">%.2f mm</td></tr>\n", 100.0 * q->growth,
                       1e3 * q->bend_m[0], 1e3 * q->bend_m[1], 1e3 * q->bend_m[2]);
    }
    tsuya_html_raw(&p->html, "</table></section>\n");
    if (p->c->plates == 0) {
        return;
    }
    tsuya_html_raw(&p->html, "<section><h2>Plates against each other</h2><table><tr><th>Plate</th><th>against</th><th class=\"n\">Photographs</th><th class=\"n\">Angle</th>"
                             "<th class=\"n\">Distance of the origins</th><th></th></tr>\n");
    for (int i = 0; i < p->c->plates; i++) {
        const tsuya_calibrate_plate *q = &p->c->plate[i];
        tsuya_html_raw(&p->html, "<tr><td>");
        tsuya_html_text(&p->html, q->name);
        tsuya_html_raw(&p->html, "</td><td>");
        tsuya_html_text(&p->html, q->reference);
        tsuya_html_raw(&p->html, "</td><td class=\"n\">%d</td><td class=\"n\">%.2f° ± %.2f°</td><td class=\"n\">%.1f ± %.1f mm</td><td>%s</td></tr>\n", q->photos,
                       q->angle_deg, q->angle_sd_deg, 1e3 * q->distance_m, 1e3 * q->distance_sd_m, q->rigid ? "rigid" : "not rigid to each other");
    }
    tsuya_html_raw(&p->html, "</table></section>\n");
}

static void photographs(page *p)
{
    const tsuya_solve *s = &p->c->solve;
    tsuya_html_raw(&p->html, "<section><h2>Photographs</h2><div class=\"wide\"><table><tr><th>Name</th><th class=\"n\">Corners</th><th class=\"n\">Left out</th>"
                             "<th class=\"n\">Residual, px</th><th class=\"n\">Blur, px</th><th class=\"n\">Tags left out</th></tr>\n");
    for (int i = 0; i < p->corners->photo_count; i++) {
        int corners = 0, outliers = 0;
        for (int k = 0; k < s->observation_count; k++) {
            corners += s->view[s->observation[k].view].photo == i;
            outliers += s->view[s->observation[k].view].photo == i && s->observation[k].outlier;
        }
        tsuya_html_raw(&p->html, corners ? "<tr><td>" : "<tr class=\"bad\"><td>");
        tsuya_html_text(&p->html, p->corners->photo[i]);
        tsuya_html_raw(&p->html, "</td><td class=\"n\">%d</td><td class=\"n\">%d</td><td class=\"n\">", corners, outliers);
        tsuya_html_raw(&p->html, corners ? "%.3f" : "–", corners ? s->photo_sigma_px[i] : 0.0);
        if (p->detected) {
            const tsuya_detect_report *d = &p->detected->report[i];
            tsuya_html_raw(&p->html, isfinite(d->blur_px) ? "</td><td class=\"n\">%.2f (p90 %.2f)</td><td class=\"n\">" : "</td><td class=\"n\">–</td><td class=\"n\">",
                           d->blur_px, d->blur_high_px);
            tsuya_html_raw(&p->html, "%d unknown, %d twice, %d misplaced</td></tr>\n", d->rejected.foreign, d->rejected.twice, d->rejected.misplaced);
        } else {
            tsuya_html_raw(&p->html, "</td><td class=\"n\">–</td><td class=\"n\">–</td></tr>\n");
        }
    }
    tsuya_html_raw(&p->html, "</table></div></section>\n");
}

static void dot(tsuya_image *image, double x, double y, const uint8_t color[3], int reach)
{
    for (int i = -reach; i <= reach; i++) {
        for (int k = 0; k < 2; k++) {
            int px = (int)lround(x) + (k ? i : 0), py = (int)lround(y) + (k ? 0 : i);
            if (px >= 0 && py >= 0 && px < image->width_px && py < image->height_px) {
                for (int c = 0; c < 3; c++) {
                    tsuya_image_u8(image, px, py)[c] = color[c];
                }
            }
        }
    }
}

static tsuya_status to_color(tsuya_image *out, const tsuya_image *in)
{
    TSUYA_TRY(tsuya_image_create(out, in->width_px, in->height_px, 3, TSUYA_SAMPLE_U8, in->encoding));
    for (int y = 0; y < in->height_px; y++) {
        for (int x = 0; x < in->width_px; x++) {
            for (int c = 0; c < 3; c++) {
                tsuya_image_u8(out, x, y)[c] = tsuya_image_u8(in, x, y)[in->channels >= 3 ? c : 0];
            }
        }
    }
    return TSUYA_OK;
}

/* A photograph, reduced, with crosses where corners were found. */
static tsuya_status overlay(page *p, int photo, const char *path)
{
    tsuya_image full = {0}, small = {0}, picture = {0};
    const tsuya_solve *s = &p->c->solve;
    static const uint8_t fine[3] = {40, 220, 60}, out[3] = {255, 40, 40};
    tsuya_status status;
    TSUYA_TRY(tsuya_image_load(&full, path));
    TSUYA_GOTO_DONE(status, tsuya_report_reduce(&small, &full, PICTURE_PX));
    TSUYA_GOTO_DONE(status, to_color(&picture, &small));
    double k = (double)small.width_px / full.width_px;
    for (int i = 0; i < s->observation_count; i++) {
        const tsuya_solve_observation *o = &s->observation[i];
        if (s->view[o->view].photo == photo) {
            dot(&picture, k * (o->pixel.x + 0.5) - 0.5, k * (o->pixel.y + 0.5) - 0.5, o->outlier ? out : fine, 2);
        }
    }
    tsuya_html_picture(&p->html, &picture, false, "photo", "Corners", p->corners->photo[photo]);
done:
    tsuya_image_free(&full);
    tsuya_image_free(&small);
    tsuya_image_free(&picture);
    return status;
}

static tsuya_status overlays(page *p, const char *const *paths)
{
    int chosen[OVERLAYS], count = tsuya_report_spread(chosen, OVERLAYS, p->corners->photo_count);
    tsuya_html_raw(&p->html, "<section><h2>Corners in the photographs</h2><p class=\"lead\">Green: used; red: left out.</p><div class=\"grid g2\">\n");
    for (int i = 0; i < count; i++) {
        TSUYA_TRY(overlay(p, chosen[i], paths[chosen[i]]));
    }
    tsuya_html_raw(&p->html, "</div></section>\n");
    return TSUYA_OK;
}

tsuya_status tsuya_calib_page(const char *path, const char *folder, const tsuya_calibration *calibration, const tsuya_corner_set *corners,
                              const char *const *paths, const tsuya_detect_info *detected)
{
    page p = {.c = calibration, .corners = corners, .detected = detected};
    TSUYA_TRY(tsuya_html_begin(&p.html, path, folder));
    header(&p);
    verdict(&p);
    maps(&p);
    lenses(&p);
    plates(&p);
    photographs(&p);
    tsuya_status status = paths ? overlays(&p, paths) : TSUYA_OK;
    if (status != TSUYA_OK) {
        tsuya_html_abort(&p.html);
        return status;
    }
    tsuya_html_raw(&p.html, "</main></body></html>\n");
    return tsuya_html_commit(&p.html);
}
