#include "app/capture_page.h"

#include "app/html.h"
#include "app/report_parts.h"

#include <math.h>

enum { PICTURE_PX = 420, MOST_PICTURES = 24 };

static void write_again(tsuya_html *html, const tsuya_check *check)
{
    if (check->again == 0) {
        tsuya_html_raw(html, "<p>Nothing to take again%s%s.</p>\n", tsuya_check_blindness(check) ? "; but " : "",
                       tsuya_check_blindness(check) ? tsuya_check_blindness(check) : "");
        return;
    }
    tsuya_html_raw(html, "<ul class=\"warnings\">\n");
    for (int i = 0; i < check->count; i++) {
        for (int k = 0; k < check->photo[i].fault_count; k++) {
            tsuya_html_raw(html, "<li><b>");
            tsuya_html_text(html, check->photo[i].photo.name);
            tsuya_html_raw(html, "</b> ");
            tsuya_html_text(html, check->photo[i].fault[k]);
            tsuya_html_raw(html, "</li>\n");
        }
    }
    tsuya_html_raw(html, "</ul>\n");
}

static tsuya_status write_picture(tsuya_html *html, const tsuya_checked_photo *p)
{
    tsuya_image loaded = {0}, small = {0};
    if (!p->readable || tsuya_image_load(&loaded, p->photo.path) != TSUYA_OK) {
        return TSUYA_OK; /* it is in the list */
    }
    tsuya_status status = tsuya_report_reduce(&small, &loaded, PICTURE_PX);
    if (status == TSUYA_OK) {
        tsuya_html_picture(html, &small, false, "photo", p->photo.name, p->photo.name);
    }
    tsuya_image_free(&loaded);
    tsuya_image_free(&small);
    return status;
}

static tsuya_status write_pictures(tsuya_html *html, const tsuya_check *check)
{
    int shown = 0;
    tsuya_html_raw(html, "<div class=\"grid g4\">\n");
    for (int i = 0; i < check->count && shown < MOST_PICTURES; i++) {
        if (check->photo[i].fault_count > 0) {
            TSUYA_TRY(write_picture(html, &check->photo[i]));
            shown++;
        }
    }
    tsuya_html_raw(html, "</div>\n");
    return TSUYA_OK;
}

/* Seen from above: the middle is the zenith, the ring the horizon; what lies under it is drawn outside. */
static void polar(double *x, double *y, double azimuth_deg, double elevation_deg)
{
    double r = 150.0 * (90.0 - elevation_deg) / 90.0, a = tsuya_rad_from_deg(azimuth_deg);
    *x = 200.0 + r * cos(a);
    *y = 200.0 - r * sin(a);
}

static void draw_directions(tsuya_html *html, const tsuya_check *check)
{
    double x, y;
    tsuya_html_raw(html, "<svg width=\"400\" height=\"400\" viewBox=\"0 0 400 400\" role=\"img\"><title>Directions from above</title>\n");
    for (int e = 0; e <= 60; e += 30) {
        tsuya_html_raw(html, "<circle cx=\"200\" cy=\"200\" r=\"%.1f\" fill=\"none\" stroke=\"#ddd5c7\"/><text x=\"203\" y=\"%.1f\" font-size=\"10\" "
                       "fill=\"#6d655a\">%d°</text>\n", 150.0 * (90 - e) / 90.0, 197.0 - 150.0 * (90 - e) / 90.0, e);
    }
    for (int i = 0; i < check->count; i++) {
        const tsuya_checked_photo *p = &check->photo[i];
        if (isfinite(p->azimuth_deg)) {
            polar(&x, &y, p->azimuth_deg, p->elevation_deg);
            tsuya_html_raw(html, "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"4.5\" fill=\"%s\"><title>", x, y, p->fault_count ? "#b3342c" : "#3b518b");
            tsuya_html_text(html, p->photo.name);
            tsuya_html_raw(html, "</title></circle>\n");
        }
    }
    for (int k = 0; k < check->missing_count; k++) {
        polar(&x, &y, check->missing[k].azimuth_deg, check->missing[k].elevation_deg);
        tsuya_html_raw(html, "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"8\" fill=\"none\" stroke=\"#a8843b\" stroke-width=\"2\"/><text x=\"%.1f\" y=\"%.1f\" "
                       "font-size=\"9\" text-anchor=\"middle\">%d</text>\n", x, y, x, y + 3.0, k + 1);
    }
    tsuya_html_raw(html, "</svg>\n");
}

static void write_missing(tsuya_html *html, const tsuya_check *check)
{
    tsuya_html_raw(html, "<table><tr><th class=\"n\">#</th><th>take one</th><th class=\"n\">covers more, %%</th></tr>\n");
    for (int k = 0; k < check->missing_count; k++) {
        char where[320];
        tsuya_check_missing_text(where, sizeof where, check, &check->missing[k]);
        tsuya_html_raw(html, "<tr><td class=\"n\">%d</td><td>", k + 1);
        tsuya_html_text(html, where);
        tsuya_html_raw(html, "</td><td class=\"n\">%.1f</td></tr>\n", 100.0 * check->missing[k].gain);
    }
    tsuya_html_raw(html, "</table>\n");
}

static void write_cover(tsuya_html *html, const tsuya_check *check)
{
    tsuya_html_raw(html, "<section><h2>Directions</h2>\n");
    if (check->placed == 0) {
        tsuya_html_raw(html, "<p>The photographs share too little to say how they lie to each other.</p></section>\n");
        return;
    }
    tsuya_html_raw(html, "<p class=\"lead\">%d of %d photographs are placed by what they share%s. Good ones among them see %.0f %% of the directions that a surface "
                   "may face, each from three places within 45°.</p>\n<div class=\"grid g2\"><div>", check->placed, check->count,
                   check->focal_assumed > 0.0 ? ", with an assumed focal length where EXIF tells none" : "", 100.0 * check->covered);
    draw_directions(html, check);
    tsuya_html_raw(html, "<p><span class=\"key\" style=\"background:#3b518b\"></span>good <span class=\"key\" style=\"background:#b3342c\"></span>to take again "
                   "<span class=\"key\" style=\"border:2px solid #a8843b\"></span>missing</p></div><div>");
    if (check->missing_count > 0) {
        write_missing(html, check);
    } else {
        tsuya_html_raw(html, "<p>No view is missing.</p>");
    }
    tsuya_html_raw(html, "</div></div></section>\n");
}

static double drift_of(const tsuya_checked_photo *p, int which) { return which == 0 ? p->exposure_ev : which == 1 ? p->red_ev : p->blue_ev; }

/* Brightness and colour in the order of the names. */
static void write_drift(tsuya_html *html, const tsuya_check *check)
{
    static const char *const colors[3] = {"#26221d", "#b3342c", "#3b518b"}, *const names[3] = {"brightness", "red against green", "blue against green"};
    double most = 0.5, step = 880.0 / (check->count > 1 ? check->count - 1 : 1);
    for (int i = 0; i < check->count; i++) {
        for (int c = 0; c < 3; c++) {
            double v = fabs(drift_of(&check->photo[i], c));
            most = isfinite(v) ? fmax(most, v) : most;
        }
    }
    tsuya_html_raw(html, "<section><h2>Exposure and white balance</h2><p class=\"lead\">EV against the session, in the order of the names");
    if (isfinite(check->wander_ev)) {
        tsuya_html_raw(html, "; the exposure wanders by %.2f EV (10th to 90th percentile)", check->wander_ev);
    }
    tsuya_html_raw(html, ".</p>\n"
                   "<svg width=\"960\" height=\"220\" viewBox=\"0 0 960 220\" role=\"img\"><title>Drift</title>\n");
    for (int k = -1; k <= 1; k++) {
        double y = 110.0 - 95.0 * k;
        tsuya_html_raw(html, "<line x1=\"60\" x2=\"940\" y1=\"%.1f\" y2=\"%.1f\" stroke=\"#ddd5c7\"/><text x=\"52\" y=\"%.1f\" font-size=\"11\" "
                       "text-anchor=\"end\">%+.1f</text>\n", y, y, y + 4.0, k * most);
    }
    for (int c = 2; c >= 0; c--) {
        for (int i = 0; i < check->count; i++) {
            double v = drift_of(&check->photo[i], c);
            if (isfinite(v)) {
                tsuya_html_raw(html, "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"3\" fill=\"%s\"><title>", 60.0 + step * i, 110.0 - 95.0 * v / most, colors[c]);
                tsuya_html_textf(html, "%s: %s %+.2f EV", check->photo[i].photo.name, names[c], v);
                tsuya_html_raw(html, "</title></circle>\n");
            }
        }
    }
    tsuya_html_raw(html, "</svg><p>");
    for (int c = 0; c < 3; c++) {
        tsuya_html_raw(html, "<span class=\"key\" style=\"background:%s\"></span>%s ", colors[c], names[c]);
    }
    tsuya_html_raw(html, "</p></section>\n");
}

static void cell(tsuya_html *html, const char *format, double value)
{
    tsuya_html_raw(html, "<td class=\"n\">");
    if (isfinite(value)) {
        char text[32];
        snprintf(text, sizeof text, format, value);
        tsuya_html_raw(html, "%s", text);
    } else {
        tsuya_html_raw(html, "–");
    }
    tsuya_html_raw(html, "</td>");
}

static void write_table(tsuya_html *html, const tsuya_check *check)
{
    static const char *const heads[] = {"edge px", "clip %", "EV", "red EV", "blue EV", "overlaps", "tags", "azimuth °", "elevation °"};
    tsuya_html_raw(html, "<section><h2>Every photograph</h2>\n<div class=\"wide\"><table><tr><th>photograph</th>");
    for (size_t k = 0; k < sizeof heads / sizeof heads[0]; k++) {
        tsuya_html_raw(html, "<th class=\"n\">%s</th>", heads[k]);
    }
    tsuya_html_raw(html, "</tr>\n");
    for (int i = 0; i < check->count; i++) {
        const tsuya_checked_photo *p = &check->photo[i];
        tsuya_html_raw(html, p->fault_count ? "<tr class=\"bad\"><td>" : "<tr><td>");
        tsuya_html_text(html, p->photo.name);
        tsuya_html_raw(html, "</td>");
        cell(html, "%.2f", p->blur.worst_px);
        cell(html, "%.2f", p->readable ? 100.0 * fmax(p->bright_clipped[0], fmax(p->bright_clipped[1], p->bright_clipped[2])) : NAN);
        cell(html, "%.2f", p->exposure_ev);
        cell(html, "%.2f", p->red_ev);
        cell(html, "%.2f", p->blue_ev);
        cell(html, "%.0f", p->neighbours);
        cell(html, "%.0f", p->tags < 0 ? NAN : (double)p->tags);
        cell(html, "%.0f", fmod(round(p->azimuth_deg), 360.0));
        cell(html, "%.0f", p->elevation_deg);
        tsuya_html_raw(html, "</tr>\n");
    }
    tsuya_html_raw(html, "</table></div></section>\n");
}

static tsuya_status write_page(tsuya_html *html, const tsuya_check *check, const char *photos)
{
    tsuya_html_raw(html, "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\"><title>");
    tsuya_html_text(html, photos);
    tsuya_html_raw(html, "</title><style>%s</style></head><body><header class=\"top\"><div><h1>Photographs</h1><p>", tsuya_report_style);
    tsuya_html_textf(html, "%s: %d photographs, %d to take again, %d views missing", photos, check->count, check->again, check->missing_count);
    tsuya_html_raw(html, "</p></div></header>\n<main><section><h2>Take again</h2>\n");
    write_again(html, check);
    TSUYA_TRY(write_pictures(html, check));
    tsuya_html_raw(html, "</section>\n");
    write_cover(html, check);
    write_drift(html, check);
    write_table(html, check);
    tsuya_html_raw(html, "</main></body></html>\n");
    return TSUYA_OK;
}

tsuya_status tsuya_capture_page(const tsuya_check *check, const char *photos, const char *path)
{
    tsuya_html html;
    char *folder = tsuya_path_folder(path);
    tsuya_status status = folder ? tsuya_html_begin(&html, path, folder) : TSUYA_ERROR_MEMORY;
    if (status == TSUYA_OK) {
        status = write_page(&html, check, photos);
        if (status == TSUYA_OK) {
            status = tsuya_html_commit(&html);
        } else {
            tsuya_html_abort(&html);
        }
    }
    tsuya_free(folder);
    return status;
}
