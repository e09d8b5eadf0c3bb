#include "app/report.h"

#include "app/report_parts.h"
#include "core/file.h"
#include "render/views.h"

#include <math.h>
#include <sys/stat.h>
#include <time.h>

const tsuya_json *tsuya_report_figures(const tsuya_report *report, const char *stage)
{
    return tsuya_json_member(tsuya_state_record(report->state, stage), "figures");
}

void tsuya_report_check(tsuya_report *report, tsuya_status status)
{
    if (report->html.status == TSUYA_OK) {
        report->html.status = status;
    }
}

void tsuya_report_open(tsuya_report *report, const char *id, const char *title, const char *lead)
{
    tsuya_html_raw(&report->html, "<section id=\"%s\"><h2>", id);
    tsuya_html_text(&report->html, title);
    tsuya_html_raw(&report->html, "</h2>\n");
    if (lead) {
        tsuya_html_raw(&report->html, "<p class=\"lead\">");
        tsuya_html_text(&report->html, lead);
        tsuya_html_raw(&report->html, "</p>\n");
    }
}

void tsuya_report_close(tsuya_report *report) { tsuya_html_raw(&report->html, "</section>\n"); }

int tsuya_report_spread(int *index, int limit, int count)
{
    int n = count < limit ? count : limit;
    for (int i = 0; i < n; i++) {
        index[i] = (int)((long long)i * count / n);
    }
    return n;
}

tsuya_status tsuya_report_reduce(tsuya_image *out, const tsuya_image *in, int side_px)
{
    tsuya_image eight = {0};
    TSUYA_TRY(tsuya_image_convert(&eight, in, TSUYA_SAMPLE_U8,
                                  in->encoding == TSUYA_ENCODING_DATA ? TSUYA_ENCODING_DATA : TSUYA_ENCODING_SRGB));
    int longest = eight.width_px > eight.height_px ? eight.width_px : eight.height_px;
    if (longest <= side_px) {
        *out = eight;
        return TSUYA_OK;
    }
    double scale = (double)side_px / longest;
    int width = (int)fmax(1.0, eight.width_px * scale + 0.5), height = (int)fmax(1.0, eight.height_px * scale + 0.5);
    tsuya_status status = tsuya_image_resize(out, &eight, width, height);
    tsuya_image_free(&eight);
    return status;
}

static tsuya_status load_model(tsuya_sparse_model *model, const tsuya_job *job, const char *relative)
{
    const char *folder = tsuya_job_path(job, "%s", relative);
    if (!folder) {
        return TSUYA_ERROR_MEMORY;
    }
    return tsuya_path_is_folder(folder) ? tsuya_sparse_model_load(model, folder) : TSUYA_OK;
}

static tsuya_status load_mesh(tsuya_report *report)
{
    static const char *const candidates[] = {"weave/weave.ply", "reconstruct/mesh.ply"};
    for (int i = 0; i < 2; i++) {
        const char *path = tsuya_job_path(report->job, "%s", candidates[i]);
        if (!path) {
            return TSUYA_ERROR_MEMORY;
        }
        if (tsuya_path_exists(path)) {
            TSUYA_TRY(tsuya_ply_load(&report->mesh, path));
            return report->mesh.normal ? TSUYA_OK : tsuya_mesh_compute_normals(&report->mesh);
        }
    }
    return TSUYA_OK;
}

/* Where tags gave it z is up; otherwise the mean of the photographs' upward directions. */
static tsuya_status find_up(tsuya_report *report)
{
    int count = report->sparse.view_count;
    tsuya_pose *poses = tsuya_arena_alloc(report->job->arena, (size_t)count, sizeof *poses);
    if (!poses) {
        return TSUYA_ERROR_MEMORY;
    }
    for (int v = 0; v < count; v++) {
        poses[v] = report->sparse.view[v].camera_from_world;
    }
    report->up = tsuya_up_from_cameras(poses, count);
    return TSUYA_OK;
}

static void find_extent(tsuya_report *report)
{
    tsuya_vec3 low = {0, 0, 0}, high = {0, 0, 0};
    if (report->mesh.vertex_count > 0) {
        tsuya_mesh_bounds(&report->mesh, &low, &high);
    } else if (report->sparse.point_count > 0) {
        low = high = report->sparse.point[0].position;
        for (size_t p = 1; p < report->sparse.point_count; p++) {
            tsuya_vec3 x = report->sparse.point[p].position;
            low = (tsuya_vec3){fmin(low.x, x.x), fmin(low.y, x.y), fmin(low.z, x.z)};
            high = (tsuya_vec3){fmax(high.x, x.x), fmax(high.y, x.y), fmax(high.z, x.z)};
        }
    }
    report->center = tsuya_vec3_scale(tsuya_vec3_add(low, high), 0.5);
    report->radius = 0.5 * tsuya_vec3_norm(tsuya_vec3_sub(high, low));
}

static tsuya_status load(tsuya_report *report)
{
    TSUYA_TRY(load_model(&report->sparse, report->job, "reconstruct/sparse/0"));
    TSUYA_TRY(load_model(&report->dense, report->job, "reconstruct/dense/sparse"));
    TSUYA_TRY(load_mesh(report));
    const char *demo = tsuya_job_path(report->job, "demo.json");
    if (!demo) {
        return TSUYA_ERROR_MEMORY;
    }
    if (tsuya_path_exists(demo)) {
        TSUYA_TRY(tsuya_json_load(&report->demo, demo));
    }
    find_extent(report);
    return find_up(report);
}

static void write_head(tsuya_report *report)
{
    static const char *const links[][2] = {
        {"summary", "Summary"}, {"times", "Time and memory"}, {"capture", "Photographs"}, {"cameras", "Cameras"},
        {"depth", "Depth"},     {"silhouettes", "Outlines"},   {"surface", "Surface"},     {"weave", "Weft field"},
        {"material", "Material"}, {"renders", "Renders"},      {"versions", "Versions"},
    };
    tsuya_html *html = &report->html;
    char date[64];
    time_t now = time(NULL);
    struct tm utc;
    strftime(date, sizeof date, "%d %B %Y, %H:%M UTC", gmtime_r(&now, &utc));
    tsuya_html_raw(html, "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">"
                         "<meta name=\"viewport\" content=\"width=device-width,initial-scale=1\"><title>");
    tsuya_html_textf(html, "%s – tsuya report", report->job->name);
    tsuya_html_raw(html, "</title><style>%s</style></head><body>\n<header class=\"top\"><div><h1>", tsuya_report_style);
    tsuya_html_text(html, report->job->name);
    tsuya_html_raw(html, "</h1><p>");
    tsuya_html_textf(html, "%d photographs from %s, %d × %d pixels. Written by tsuya %s on %s.", report->job->photo.count,
                     report->job->photos, report->job->photo.photo[0].width_px, report->job->photo.photo[0].height_px, TSUYA_VERSION, date);
    tsuya_html_raw(html, "</p></div></header>\n<nav><div>");
    for (size_t i = 0; i < sizeof links / sizeof links[0]; i++) {
        tsuya_html_raw(html, "<a href=\"#%s\">%s</a>", links[i][0], links[i][1]);
    }
    tsuya_html_raw(html, "</div></nav>\n<main>\n");
}

static tsuya_status write_sections(tsuya_report *report)
{
    static void (*const section[])(tsuya_report *) = {
        tsuya_report_summary,     tsuya_report_warnings, tsuya_report_truth, tsuya_report_times,    tsuya_report_capture,
        tsuya_report_cameras,     tsuya_report_depth,    tsuya_report_silhouettes, tsuya_report_surface, tsuya_report_weave,
        tsuya_report_material,    tsuya_report_renders,  tsuya_report_versions,
    };
    enum { COUNT = sizeof section / sizeof section[0] };
    write_head(report);
    for (int i = 0; i < COUNT; i++) {
        TSUYA_TRY(tsuya_check_interrupt());
        tsuya_progress_update(report->context, "report", i, COUNT, NULL);
        section[i](report);
    }
    tsuya_html_raw(&report->html, "</main></body></html>\n");
    return report->html.status;
}

tsuya_status tsuya_report_write(tsuya_json *figures, const tsuya_job *job, const tsuya_state *state, const tsuya_context *context)
{
    tsuya_report report = {.job = job, .state = state, .context = context};
    const char *folder = tsuya_job_path(job, "report"), *path = tsuya_job_path(job, "report/index.html");
    if (!folder || !path) {
        return TSUYA_ERROR_MEMORY;
    }
    TSUYA_TRY(tsuya_folder_make(folder));
    tsuya_status status = load(&report);
    if (status == TSUYA_OK) {
        status = tsuya_html_begin(&report.html, path, folder);
    }
    if (status == TSUYA_OK) {
        status = write_sections(&report);
        if (status == TSUYA_OK) {
            status = tsuya_html_commit(&report.html);
        } else {
            tsuya_html_abort(&report.html);
        }
    }
    struct stat info;
    if (status == TSUYA_OK && stat(path, &info) == 0) {
        tsuya_json_set_number(figures, "pictures", report.html.picture_count);
        tsuya_json_set_number(figures, "bytes", (double)info.st_size);
    }
    tsuya_sparse_model_free(&report.sparse);
    tsuya_sparse_model_free(&report.dense);
    tsuya_mesh_free(&report.mesh);
    tsuya_json_free(report.demo);
    return status;
}
