/* A field of tags with known corners, and what the plain library and our refinement make of it: shared by the test and the bench. */
#ifndef TSUYA_TESTS_CALIB_TAG_FIELD_H
#define TSUYA_TESTS_CALIB_TAG_FIELD_H

#include "scene.h"
#include "support.h"

#include "calib/refine.h"
#include "core/memory.h"

#include <time.h>

enum { COLUMNS = 8, ROWS = 6, TAGS = COLUMNS * ROWS, PITCH = 150 };

typedef struct field {
    tsuya_board board[TAGS];
    tsuya_pose pose[TAGS];
    tsuya_camera camera;
    tsuya_image photo;
} field;

static double draw(int tag, int what, double low, double high) { return low + (high - low) * tsuya_random_uniform(11, (uint64_t)tag, (uint64_t)what); }

/* 48 tags of 72 … 96 px, each turned and tilted its own way; light without noise. */
static void make_field(field *f, tsuya_image *light, const scene_look *look, const char *family, int border_bits, double low_px, double high_px)
{
    f->camera = (tsuya_camera){.lens = TSUYA_LENS_PINHOLE, .width_px = COLUMNS * PITCH, .height_px = ROWS * PITCH, .fx_px = 1500, .fy_px = 1500,
                               .cx_px = 0.5 * COLUMNS * PITCH, .cy_px = 0.5 * ROWS * PITCH};
    scene_begin(light, f->camera.width_px, f->camera.height_px, look);
    for (int t = 0; t < TAGS; t++) {
        assert_ok(tsuya_board_grid(&f->board[t], family, border_bits, 1, 1, 0.1, 0.02, t % 30));
        double distance = 1500 * 0.1 / draw(t, 0, low_px, high_px), tilt = tsuya_rad_from_deg(draw(t, 1, 0, 52)), around = draw(t, 2, 0, 2 * M_PI);
        tsuya_mat3 turn = tsuya_mat3_from_rodrigues((tsuya_vec3){0, 0, draw(t, 3, 0, 2 * M_PI)});
        tsuya_mat3 lean = tsuya_mat3_from_rodrigues((tsuya_vec3){tilt * cos(around), tilt * sin(around), 0});
        tsuya_mat3 face = {{{1, 0, 0}, {0, -1, 0}, {0, 0, -1}}}; /* the plate's y is up, the camera's down */
        f->pose[t].rotation = tsuya_mat3_multiply(tsuya_mat3_multiply(lean, turn), face);
        tsuya_vec3 middle = tsuya_mat3_apply(f->pose[t].rotation, (tsuya_vec3){0.05, 0.05, 0});
        double x = (t % COLUMNS + 0.5) * PITCH + draw(t, 4, -1, 1), y = (t / COLUMNS + 0.5) * PITCH + draw(t, 5, -1, 1);
        tsuya_vec3 at = {distance * (x - f->camera.cx_px) / 1500, distance * (y - f->camera.cy_px) / 1500, distance};
        f->pose[t].translation = tsuya_vec3_sub(at, middle);
        scene_plate(light, &f->board[t], 0, &f->camera, f->pose[t], look);
    }
}

static void free_boards(field *f)
{
    for (int t = 0; t < TAGS; t++) {
        tsuya_board_free(&f->board[t]);
    }
}

typedef struct score {
    double rms, bias, outward, worst, sigma_ratio, bound, library_bias;
    int found, corners, dropped;
    double seconds;
    tsuya_edge_look look; /* as it was learnt */
} score;

static int place_of(const tsuya_vec2 c[4])
{
    double x = 0.25 * (c[0].x + c[1].x + c[2].x + c[3].x), y = 0.25 * (c[0].y + c[1].y + c[2].y + c[3].y);
    int t = (int)(y / PITCH) * COLUMNS + (int)(x / PITCH);
    return t >= 0 && t < TAGS ? t : -1;
}

/* Errors of detections against the tag whose place they are in. */
static score hold(const field *f, const tsuya_tag_sighting *seen, const tsuya_refined_tag *refined, int count)
{
    score s = {0};
    bool found[TAGS] = {false};
    double squares = 0, normalised = 0, out = 0, bias[2] = {0};
    for (int i = 0; i < count; i++) {
        const tsuya_vec2 *c = refined ? refined[i].corner_px : seen[i].corner_px;
        int t = place_of(c);
        if (t < 0 || found[t] || seen[i].id != f->board[t].tag[0].id) {
            continue;
        }
        found[t] = true;
        tsuya_vec2 p0 = scene_corner(&f->board[t], 0, 0, &f->camera, f->pose[t]), p2 = scene_corner(&f->board[t], 0, 2, &f->camera, f->pose[t]);
        for (int k = 0; k < 4; k++) {
            tsuya_vec2 truth = scene_corner(&f->board[t], 0, k, &f->camera, f->pose[t]);
            double ex = c[k].x - truth.x, ey = c[k].y - truth.y, rx = truth.x - 0.5 * (p0.x + p2.x), ry = truth.y - 0.5 * (p0.y + p2.y);
            if (refined && !isfinite(refined[i].sigma_px[k])) {
                s.dropped++;
                continue;
            }
            squares += ex * ex + ey * ey;
            out += (ex * rx + ey * ry) / hypot(rx, ry);
            bias[0] += ex, bias[1] += ey;
            s.worst = fmax(s.worst, hypot(ex, ey));
            s.corners++;
            normalised += refined ? 0.5 * (ex * ex + ey * ey) / (refined[i].sigma_px[k] * refined[i].sigma_px[k]) : 0.0;
        }
    }
    for (int t = 0; t < TAGS; t++) {
        s.found += found[t];
    }
    s.rms = sqrt(squares / s.corners);
    s.bias = hypot(bias[0], bias[1]) / s.corners;
    s.outward = out / s.corners;
    s.sigma_ratio = sqrt(normalised / s.corners);
    return s;
}

static void print_score(const char *name, const score *s, double mpix)
{
    printf("  %-20s rms %.4f  bias %.4f  outward %+.4f  worst %.3f  found %d/%d  dropped %d  error/sigma %.2f  %.0f ms/Mpix\n", name, s->rms, s->bias,
           s->outward, s->worst, s->found, TAGS, s->dropped, s->sigma_ratio, 1e3 * s->seconds / mpix);
}

/* Cramér–Rao bound of the 2-D corner error: straight edges, blur and levels known, every pixel along them read once.  An
 * edge of length L gives its normal offset at its end a variance of 4 σ² / (L ∫g²), with g the profile's slope. */
static double bound(const field *f, const scene_look *look, double blur_px)
{
    double sum = 0, contrast = look->white - look->black;
    for (int t = 0; t < TAGS; t++) {
        tsuya_vec2 p[4];
        double variance[4], nx[4], ny[4];
        for (int k = 0; k < 4; k++) {
            p[k] = scene_corner(&f->board[t], 0, k, &f->camera, f->pose[t]);
        }
        for (int k = 0; k < 4; k++) {
            double dx = p[(k + 1) % 4].x - p[k].x, dy = p[(k + 1) % 4].y - p[k].y, length = hypot(dx, dy);
            nx[k] = dy / length, ny[k] = -dx / length;
            variance[k] = 4.0 * look->noise * look->noise / (length * contrast * contrast / (2.0 * sqrt(M_PI) * blur_px));
        }
        for (int k = 0; k < 4; k++) {
            double sine = nx[k] * ny[(k + 3) % 4] - ny[k] * nx[(k + 3) % 4];
            sum += (variance[k] + variance[(k + 3) % 4]) / (sine * sine);
        }
    }
    return sqrt(sum / (4 * TAGS));
}

/* Processor time of this process: other work on the machine does not count. */
static double cpu_s(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static score run_library(const field *f, const char *family, int border_bits)
{
    tsuya_tag_detector *d;
    tsuya_tag_sighting *seen;
    int count;
    assert_ok(tsuya_tag_detector_create(&d, &(tsuya_tag_detector_options){family, border_bits, 1.0}));
    double start = cpu_s();
    assert_ok(tsuya_tag_detect(&seen, &count, d, &f->photo));
    double seconds = cpu_s() - start;
    score s = hold(f, seen, NULL, count);
    s.seconds = seconds;
    tsuya_free(seen);
    tsuya_tag_detector_free(d);
    return s;
}

static score run_ours(const field *f, const char *family, int border_bits, tsuya_edge_look *look)
{
    tsuya_tag_detector *d;
    tsuya_tag_sighting *seen;
    tsuya_image grey;
    tsuya_refine_info info;
    int count;
    assert_ok(tsuya_tag_detector_create(&d, &(tsuya_tag_detector_options){family, border_bits, 2.0}));
    double start = cpu_s();
    assert_ok(tsuya_tag_detect(&seen, &count, d, &f->photo));
    assert_ok(tsuya_image_grey(&grey, &f->photo, TSUYA_SAMPLE_F32));
    tsuya_refined_tag *refined = calloc((size_t)count, sizeof *refined);
    int cells = tsuya_tag_detector_cells(d);
    tsuya_refine_tone tone = tsuya_refine_estimate_tone(&grey, seen, count, cells, border_bits);
    *look = tsuya_refine_common_look(&tone, 1);
    assert_ok(tsuya_refine_tags(refined, &info, &grey, seen, count, &(tsuya_refine_options){cells, border_bits, *look, 0.8}));
    double seconds = cpu_s() - start;
    score s = hold(f, seen, refined, count);
    s.seconds = seconds;
    free(refined);
    tsuya_image_free(&grey);
    tsuya_free(seen);
    tsuya_tag_detector_free(d);
    return s;
}

/* `peer`: the library's score; may be NULL. */
static score compare(score *peer, const char *title, field *f, const tsuya_image *light, const scene_look *look, const char *family, int border_bits)
{
    tsuya_image copy;
    tsuya_edge_look own;
    double mpix = 1e-6 * light->width_px * light->height_px;
    assert_ok(tsuya_image_copy(&copy, light));
    scene_end(&f->photo, &copy, look);
    score library = run_library(f, family, border_bits), ours = run_ours(f, family, border_bits, &own);
    ours.library_bias = library.bias;
    ours.look = own;
    if (peer) {
        *peer = library;
    }
    ours.bound = bound(f, look, look->blur_px);
    printf("%s: Cramér–Rao bound %.4f, tone gamma %.2f, sharpening %.2f\n", title, ours.bound, own.gamma, own.sharpening);
    print_score("library, decimate 1", &library, mpix);
    print_score("ours", &ours, mpix);
    tsuya_image_free(&f->photo);
    return ours;
}

#endif
