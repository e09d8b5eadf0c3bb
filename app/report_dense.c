/* Photographs beside depth and normal maps, and the surface's outline in the photographs' masks. */
#include "app/report_parts.h"

#include "core/color.h"
#include "core/order.h"

#include <math.h>
#include <string.h>

enum { MAP_SIDE_PX = 400, OUTLINE_SIDE_PX = 420, SHOWN = 8 };

static const uint8_t nothing[3] = {232, 226, 215};

/* 2nd and 98th percentile of what is not 0; false where nothing is. */
static bool depth_range(float *low, float *high, const float *depth, size_t count)
{
    float *sorted = tsuya_calloc(count, sizeof *sorted);
    size_t n = 0;
    for (size_t i = 0; sorted && i < count; i++) {
        if (depth[i] > 0.0f && isfinite(depth[i])) {
            sorted[n++] = depth[i];
        }
    }
    if (n > 0) {
        tsuya_sort_floats(sorted, n);
        *low = sorted[n / 50];
        *high = sorted[n - 1 - n / 50];
    }
    tsuya_free(sorted);
    return n > 0;
}

static tsuya_status paint_depth(tsuya_image *out, const float *depth, int width, int height, char *caption, size_t caption_size)
{
    float low = 0.0f, high = 0.0f;
    size_t filled = 0;
    bool any = depth_range(&low, &high, depth, (size_t)width * (size_t)height);
    TSUYA_TRY(tsuya_image_create(out, width, height, 3, TSUYA_SAMPLE_U8, TSUYA_ENCODING_SRGB));
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            float d = depth[(size_t)y * (size_t)width + (size_t)x];
            uint8_t *rgb = tsuya_image_u8(out, x, y);
            memcpy(rgb, nothing, 3);
            if (any && d > 0.0f && isfinite(d)) {
                tsuya_color_map(rgb, high > low ? (high - d) / (high - low) : 0.5);
                filled++;
            }
        }
    }
    snprintf(caption, caption_size, "depth %.4g to %.4g, near is yellow; %.0f %% filled", (double)low, (double)high,
             100.0 * (double)filled / ((double)width * height));
    return TSUYA_OK;
}

static tsuya_status paint_normals(tsuya_image *out, const float *planes, int width, int height)
{
    size_t count = (size_t)width * (size_t)height;
    TSUYA_TRY(tsuya_image_create(out, width, height, 3, TSUYA_SAMPLE_U8, TSUYA_ENCODING_SRGB));
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            size_t i = (size_t)y * (size_t)width + (size_t)x;
            float nx = planes[i], ny = planes[count + i], nz = planes[2 * count + i];
            uint8_t *rgb = tsuya_image_u8(out, x, y);
            memcpy(rgb, nothing, 3);
            if (fabsf(nx * nx + ny * ny + nz * nz - 1.0f) < 0.1f) {
                rgb[0] = (uint8_t)(127.5f + 120.0f * nx);
                rgb[1] = (uint8_t)(127.5f - 120.0f * ny);
                rgb[2] = (uint8_t)(127.5f - 120.0f * nz);
            }
        }
    }
    return TSUYA_OK;
}

/* COLMAP's name of a map, the geometrically consistent one first; NULL where there is none. */
static const char *map_path(const tsuya_report *report, const char *kind, const char *name)
{
    static const char *const types[] = {"geometric", "photometric"};
    for (int i = 0; i < 2; i++) {
        const char *path = tsuya_job_path(report->job, "reconstruct/dense/stereo/%s/%s.%s.bin", kind, name, types[i]);
        if (path && tsuya_path_exists(path)) {
            return path;
        }
    }
    return NULL;
}

static tsuya_status show_map(tsuya_report *report, const char *path, bool normals, const char *name)
{
    float *values = NULL;
    int width, height, channels;
    char caption[160] = "normals, seen from the camera";
    tsuya_image full = {0}, small = {0};
    TSUYA_TRY(tsuya_colmap_map_load(&values, &width, &height, &channels, path));
    tsuya_status status;
    if (channels != (normals ? 3 : 1)) {
        status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: %d channels, expected %d", path, channels, normals ? 3 : 1);
    } else {
        status = normals ? paint_normals(&full, values, width, height) : paint_depth(&full, values, width, height, caption, sizeof caption);
    }
    if (status == TSUYA_OK) {
        status = tsuya_report_reduce(&small, &full, MAP_SIDE_PX);
    }
    if (status == TSUYA_OK) {
        tsuya_html_picture(&report->html, &small, true, normals ? "normal" : "depth", name, caption);
    }
    tsuya_image_free(&full);
    tsuya_image_free(&small);
    tsuya_free(values);
    return status;
}

static tsuya_status show_photo(tsuya_report *report, const char *name)
{
    const char *path = tsuya_job_path(report->job, "reconstruct/dense/images/%s", name);
    tsuya_image full = {0}, small = {0};
    tsuya_status status = path ? tsuya_image_load(&full, path) : TSUYA_ERROR_MEMORY;
    if (status == TSUYA_OK) {
        status = tsuya_report_reduce(&small, &full, MAP_SIDE_PX);
    }
    if (status == TSUYA_OK) {
        tsuya_html_picture(&report->html, &small, false, "photo", name, name);
    }
    tsuya_image_free(&full);
    tsuya_image_free(&small);
    return status;
}

void tsuya_report_depth(tsuya_report *report)
{
    int with_maps[1024], count = 0, shown[SHOWN];
    for (int v = 0; v < report->dense.view_count && count < 1024; v++) {
        if (map_path(report, "depth_maps", report->dense.view[v].name)) {
            with_maps[count++] = v;
        }
    }
    if (count == 0) {
        return;
    }
    tsuya_report_open(report, "depth", "Photographs, depth and normals",
                      "How far away, and how tilted, the program finds the cloth in each pixel of a photograph, by comparing it with its "
                      "neighbours. Pale areas had too little to compare.");
    tsuya_html_raw(&report->html, "<div class=\"triples\">\n");
    int n = tsuya_report_spread(shown, SHOWN, count);
    for (int i = 0; i < n && report->html.status == TSUYA_OK; i++) {
        const char *name = report->dense.view[with_maps[shown[i]]].name;
        const char *normals = map_path(report, "normal_maps", name);
        tsuya_html_raw(&report->html, "<div class=\"triple\">");
        tsuya_report_check(report, show_photo(report, name));
        tsuya_report_check(report, show_map(report, map_path(report, "depth_maps", name), false, name));
        if (normals) {
            tsuya_report_check(report, show_map(report, normals, true, name));
        }
        tsuya_html_raw(&report->html, "</div>\n");
    }
    tsuya_html_raw(&report->html, "</div>\n");
    tsuya_report_close(report);
}

/* Both, mask alone, mesh alone, over the photograph in grey. */
static void paint_overlay(tsuya_image *photo, const tsuya_image *mask, const tsuya_raster *raster, double *iou)
{
    static const double tint[4][3] = {{0, 0, 0}, {214, 69, 51}, {58, 110, 190}, {96, 160, 96}};
    size_t both = 0, either = 0;
    for (int y = 0; y < photo->height_px; y++) {
        for (int x = 0; x < photo->width_px; x++) {
            bool in_mesh = raster->triangle[(size_t)y * (size_t)raster->width_px + (size_t)x] != UINT32_MAX;
            bool in_mask = mask->data && tsuya_image_get(mask, x, y, 0) > 0.5f;
            uint8_t *rgb = tsuya_image_u8(photo, x, y);
            int kind = (in_mesh ? 2 : 0) + (in_mask ? 1 : 0);
            double grey = tsuya_rgb_luminance((const double[3]){rgb[0], rgb[1], rgb[2]});
            double weight = kind == 0 ? 0.0 : kind == 3 ? 0.35 : 0.75;
            both += kind == 3;
            either += kind != 0;
            for (int c = 0; c < 3; c++) {
                rgb[c] = (uint8_t)((1.0 - weight) * grey + weight * tint[kind][c] + 0.5);
            }
        }
    }
    *iou = either > 0 ? (double)both / (double)either : 0.0;
}

/* One view's overlay; mask may be missing (then the outline alone is shown). */
static tsuya_status make_overlay(tsuya_image *overlay, double *iou, const tsuya_report *report, const tsuya_view *view)
{
    const tsuya_camera *camera = &report->dense.camera[view->camera];
    double scale = (double)OUTLINE_SIDE_PX / (camera->width_px > camera->height_px ? camera->width_px : camera->height_px);
    int width = (int)(camera->width_px * scale + 0.5), height = (int)(camera->height_px * scale + 0.5);
    tsuya_camera small = tsuya_camera_scaled(camera, width, height);
    const char *photo_path = tsuya_job_path(report->job, "reconstruct/dense/images/%s", view->name);
    const char *mask_path = tsuya_job_path(report->job, "reconstruct/dense/masks/%s.png", view->name);
    tsuya_image photo = {0}, mask = {0}, small_mask = {0};
    tsuya_raster raster = {0};
    tsuya_status status = photo_path && mask_path ? TSUYA_OK : TSUYA_ERROR_MEMORY;
    TSUYA_GOTO_DONE(status, status);
    TSUYA_GOTO_DONE(status, tsuya_image_load(&photo, photo_path));
    TSUYA_GOTO_DONE(status, tsuya_image_resize(overlay, &photo, width, height));
    if (tsuya_path_exists(mask_path)) {
        TSUYA_GOTO_DONE(status, tsuya_image_load(&mask, mask_path));
        TSUYA_GOTO_DONE(status, tsuya_image_resize(&small_mask, &mask, width, height));
    }
    TSUYA_GOTO_DONE(status, tsuya_raster_create(&raster, width, height));
    TSUYA_GOTO_DONE(status, tsuya_raster_draw(&raster, &report->mesh, &small, view->camera_from_world, report->context));
    if (overlay->sample != TSUYA_SAMPLE_U8 || overlay->channels != 3) {
        status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: expected an 8-bit colour image", photo_path);
        goto done;
    }
    paint_overlay(overlay, &small_mask, &raster, iou);
done:
    tsuya_image_free(&photo);
    tsuya_image_free(&mask);
    tsuya_image_free(&small_mask);
    tsuya_raster_free(&raster);
    return status;
}

static void outline_statistics(tsuya_report *report, double *iou, int count)
{
    tsuya_sort_doubles(iou, (size_t)count);
    double median = count % 2 ? iou[count / 2] : 0.5 * (iou[count / 2 - 1] + iou[count / 2]);
    tsuya_html_raw(&report->html, "<p>Intersection over union of mask and surface: median <b>%.3f</b>, lowest %.3f, over %d photographs.</p>\n",
                   median, iou[0], count);
}

void tsuya_report_silhouettes(tsuya_report *report)
{
    bool masks = report->job->masks != NULL;
    double *iou = tsuya_calloc((size_t)report->dense.view_count, sizeof *iou);
    int shown[SHOWN], n = tsuya_report_spread(shown, SHOWN, report->dense.view_count), next = 0;
    if (report->dense.view_count == 0 || report->mesh.triangle_count == 0 || !iou) {
        tsuya_free(iou);
        return;
    }
    tsuya_report_open(report, "silhouettes", masks ? "Outlines: masks and surface" : "The surface in the photographs",
                      masks ? "The finished surface drawn back into the photographs' own cameras, over the masks."
                            : "The finished surface drawn back into the photographs' own cameras.");
    tsuya_html_raw(&report->html, masks ? "<p><span class=\"key\" style=\"background:#7fae7f\"></span>both &nbsp; <span class=\"key\" "
                                          "style=\"background:#d64533\"></span>mask alone &nbsp; <span class=\"key\" "
                                          "style=\"background:#3a6ebe\"></span>surface alone</p>\n<div class=\"grid g4\">\n"
                                        : "<div class=\"grid g4\">\n");
    for (int v = 0; v < report->dense.view_count && report->html.status == TSUYA_OK; v++) {
        tsuya_image overlay = {0};
        char caption[256];
        const char *name = report->dense.view[v].name;
        tsuya_report_check(report, make_overlay(&overlay, &iou[v], report, &report->dense.view[v]));
        if (next < n && shown[next] == v && report->html.status == TSUYA_OK) {
            snprintf(caption, sizeof caption, masks ? "%.160s, %.3f" : "%.160s", name, iou[v]);
            tsuya_html_picture(&report->html, &overlay, false, "outline", name, caption);
            next++;
        }
        tsuya_image_free(&overlay);
    }
    tsuya_html_raw(&report->html, "</div>\n");
    if (masks) {
        outline_statistics(report, iou, report->dense.view_count);
    }
    tsuya_free(iou);
    tsuya_report_close(report);
}
