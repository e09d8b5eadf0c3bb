#include "calib/chart.h"

#include "calib/opencv_adapter.h"
#include "calib/planar.h"
#include "core/memory.h"
#include "core/order.h"
#include "core/table.h"


enum { PITCH = 24, MARGIN = 1, WIDTH = (TSUYA_CHART_COLS + 2 * MARGIN) * PITCH, HEIGHT = (TSUYA_CHART_ROWS + 2 * MARGIN) * PITCH,
       ROUNDS = 3, LEAST_FITTED = 8, LEAST_PITCH_PX = 8 };

static const double INNER = 0.24;       /* half the side of what is read of a patch, in pitches */
static const double LEAST_AREA = 0.3, MOST_AREA = 0.97, NEAR = 0.25; /* of a grown patch, pitch²; of its middle, pitches */

void tsuya_chart_reference(tsuya_lab lab[TSUYA_CHART_PATCHES])
{
    static const tsuya_lab reference[TSUYA_CHART_PATCHES] = {
        {37.54, 14.37, 14.92}, {64.66, 19.27, 17.50}, {49.32, -3.82, -22.54}, {43.46, -12.74, 22.72}, {54.94, 9.61, -24.79}, {70.48, -32.26, -0.37},
        {62.73, 35.83, 56.50}, {39.43, 10.75, -45.17}, {50.57, 48.64, 16.67}, {30.10, 22.54, -20.87}, {71.77, -24.13, 58.19}, {71.51, 18.24, 67.37},
        {28.37, 15.42, -49.80}, {54.38, -39.72, 32.27}, {42.43, 51.05, 28.62}, {81.80, 2.67, 80.41}, {50.63, 51.28, -14.12}, {49.57, -29.71, -28.32},
        {95.19, -1.03, 2.93}, {81.29, -0.57, 0.44}, {66.89, -0.75, -0.06}, {50.76, -0.13, 0.14}, {35.63, -0.46, -0.48}, {20.64, 0.07, -0.46},
    };
    for (int i = 0; i < TSUYA_CHART_PATCHES; i++) {
        lab[i] = reference[i];
    }
}

tsuya_status tsuya_chart_reference_load(tsuya_lab lab[TSUYA_CHART_PATCHES], const char *path)
{
    static const char *const names[] = {"patch", "l", "a", "b", NULL};
    tsuya_table_options options = {.required = names, .known = names};
    tsuya_table t;
    bool seen[TSUYA_CHART_PATCHES] = {false};
    TSUYA_TRY(tsuya_table_load(&t, path, &options));
    tsuya_status status = TSUYA_OK;
    for (size_t r = 0; r < t.row_count && status == TSUYA_OK; r++) {
        double patch = tsuya_table_at(&t, r, tsuya_table_column(&t, "patch")), l = tsuya_table_at(&t, r, tsuya_table_column(&t, "l"));
        int i = (int)patch - 1;
        if (patch != (int)patch || i < 0 || i >= TSUYA_CHART_PATCHES || seen[i] || !(l > 0.0 && l <= 100.0)) {
            status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d: patch %g with l = %g; each patch 1 ... 24 once, with l from 0 to 100, is expected", path,
                                t.line[r], patch, l);
        } else {
            seen[i] = true;
            lab[i] = (tsuya_lab){l, tsuya_table_at(&t, r, tsuya_table_column(&t, "a")), tsuya_table_at(&t, r, tsuya_table_column(&t, "b"))};
        }
    }
    for (int i = 0; i < TSUYA_CHART_PATCHES && status == TSUYA_OK; i++) {
        status = seen[i] ? TSUYA_OK : tsuya_fail(TSUYA_ERROR_INPUT, "%s: patch %d is missing; 1 ... 24 are expected", path, i + 1);
    }
    tsuya_table_free(&t);
    return status;
}

tsuya_vec3 tsuya_chart_xyz_d65(tsuya_lab lab)
{
    const tsuya_vec3 d50 = {0.96422, 1.0, 0.82521};
    return tsuya_xyz_adapt(tsuya_xyz_from_lab(lab, d50), d50, tsuya_white_d65());
}

/* The chart seen from the front, gamma encoded as far as the photograph is: PITCH pixels from patch to patch. */
typedef struct front {
    float rgb[HEIGHT][WIDTH][3];
    bool grown[HEIGHT][WIDTH];
    int stack[HEIGHT * WIDTH];
} front;

static tsuya_vec2 chart_of(int x, int y) { return (tsuya_vec2){(x + 0.5) / PITCH - MARGIN - 0.5, (y + 0.5) / PITCH - MARGIN - 0.5}; }

static void view_front(front *f, const tsuya_image *photo, tsuya_mat3 h)
{
    for (int y = 0; y < HEIGHT; y++) {
        for (int x = 0; x < WIDTH; x++) {
            float sum[3] = {0}, value[4];
            for (int k = 0; k < 9; k++) {
                tsuya_vec2 c = chart_of(x, y), q = tsuya_homography_apply(h, (tsuya_vec2){c.x + (k % 3 - 1) / (3.0 * PITCH), c.y + (k / 3 - 1) / (3.0 * PITCH)});
                tsuya_image_sample_bilinear(photo, q.x, q.y, value);
                for (int i = 0; i < 3; i++) {
                    sum[i] += value[i] / 9.0f;
                }
            }
            for (int i = 0; i < 3; i++) {
                f->rgb[y][x][i] = photo->encoding == TSUYA_ENCODING_LINEAR ? tsuya_srgb_encode(sum[i]) : sum[i];
            }
        }
    }
}

/* Grows a patch from its expected middle; its true middle in chart coordinates, false where it is not whole or runs out. */
static bool grow(tsuya_vec2 *middle, front *f, int column, int row)
{
    int x0 = (column + MARGIN) * PITCH + PITCH / 2, y0 = (row + MARGIN) * PITCH + PITCH / 2, top = 0, area = 0;
    float seed[3] = {0};
    double sx = 0.0, sy = 0.0;
    for (int y = y0 - 2; y <= y0 + 2; y++) {
        for (int x = x0 - 2; x <= x0 + 2; x++) {
            for (int i = 0; i < 3; i++) {
                seed[i] += f->rgb[y][x][i] / 25.0f;
            }
        }
    }
    int left = x0 - PITCH, right = x0 + PITCH - 1, up = y0 - PITCH, down = y0 + PITCH - 1;
    for (int y = up; y <= down; y++) {
        for (int x = left; x <= right; x++) {
            f->grown[y][x] = false;
        }
    }
    f->stack[top++] = y0 * WIDTH + x0;
    f->grown[y0][x0] = true;
    while (top > 0) {
        int at = f->stack[--top], ax = at % WIDTH, ay = at / WIDTH;
        static const int step[4][2] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}};
        area++;
        sx += chart_of(ax, ay).x;
        sy += chart_of(ax, ay).y;
        for (int k = 0; k < 4; k++) {
            int x = ax + step[k][0], y = ay + step[k][1];
            if (x < left || x > right || y < up || y > down || f->grown[y][x]) {
                continue;
            }
            float most = 0.0f;
            for (int i = 0; i < 3; i++) {
                most = fmaxf(most, fabsf(f->rgb[y][x][i] - seed[i]) / (0.04f + 0.06f * seed[i]));
            }
            if (most < 1.0f) {
                f->grown[y][x] = true;
                f->stack[top++] = y * WIDTH + x;
            }
        }
    }
    *middle = (tsuya_vec2){sx / area, sy / area};
    return area > LEAST_AREA * PITCH * PITCH && area < MOST_AREA * PITCH * PITCH && hypot(middle->x - column, middle->y - row) < 2 * NEAR;
}

/* One round: patches to homography.  False where too few came out whole. */
static bool lay_on_patches(tsuya_chart *chart, front *f, const tsuya_image *photo)
{
    tsuya_vec2 nominal[TSUYA_CHART_PATCHES], seen[TSUYA_CHART_PATCHES];
    double sum = 0.0;
    int n = 0, kept = 0;
    tsuya_mat3 h;
    view_front(f, photo, chart->photo_from_chart);
    for (int i = 0; i < TSUYA_CHART_PATCHES; i++) {
        tsuya_vec2 middle;
        if (grow(&middle, f, i % TSUYA_CHART_COLS, i / TSUYA_CHART_COLS)) {
            nominal[n] = (tsuya_vec2){i % TSUYA_CHART_COLS, i / TSUYA_CHART_COLS};
            seen[n++] = tsuya_homography_apply(chart->photo_from_chart, middle);
        }
    }
    double pitch_px = hypot(chart->patch[1].center_px.x - chart->patch[0].center_px.x, chart->patch[1].center_px.y - chart->patch[0].center_px.y);
    for (int pass = 0; pass < 2; pass++, n = pass ? kept : n) {
        if (n < LEAST_FITTED || !tsuya_homography_fit(&h, nominal, seen, n)) {
            return false;
        }
        kept = 0;
        sum = 0.0;
        for (int i = 0; i < n; i++) {
            tsuya_vec2 q = tsuya_homography_apply(h, nominal[i]);
            double d = hypot(q.x - seen[i].x, q.y - seen[i].y);
            if (d < NEAR * pitch_px) {
                nominal[kept] = nominal[i];
                seen[kept++] = seen[i];
                sum += d * d;
            }
        }
    }
    chart->photo_from_chart = h;
    chart->fitted = kept;
    chart->fit_px = kept ? sqrt(sum / kept) : NAN;
    return kept >= LEAST_FITTED;
}

static void place_patches(tsuya_chart *chart)
{
    for (int i = 0; i < TSUYA_CHART_PATCHES; i++) {
        chart->patch[i].center_px = tsuya_homography_apply(chart->photo_from_chart, (tsuya_vec2){i % TSUYA_CHART_COLS, i / TSUYA_CHART_COLS});
    }
}

/* Trimmed mean: a tenth of the pixels at each end are dust, scratches and glints. */
static double trimmed(float *value, int n)
{
    double sum = 0.0;
    int cut = n / 10;
    tsuya_sort_floats(value, (size_t)n);
    for (int i = cut; i < n - cut; i++) {
        sum += (double)value[i];
    }
    return sum / (n - 2 * cut);
}

/* Pixels whose place on the chart lies in the patch's inner part. */
static tsuya_status read_patch(tsuya_chart_patch *patch, const tsuya_image *photo, tsuya_mat3 h, int column, int row)
{
    double low_x = INFINITY, low_y = INFINITY, high_x = -INFINITY, high_y = -INFINITY;
    for (int k = 0; k < 4; k++) {
        tsuya_vec2 q = tsuya_homography_apply(h, (tsuya_vec2){column + (k % 2 ? INNER : -INNER), row + (k / 2 ? INNER : -INNER)});
        low_x = fmin(low_x, q.x), high_x = fmax(high_x, q.x), low_y = fmin(low_y, q.y), high_y = fmax(high_y, q.y);
    }
    int x0 = (int)fmax(0, ceil(low_x)), x1 = (int)fmin(photo->width_px - 1, floor(high_x));
    int y0 = (int)fmax(0, ceil(low_y)), y1 = (int)fmin(photo->height_px - 1, floor(high_y)), n = 0, clipped = 0;
    size_t room = (size_t)(x1 >= x0 ? x1 - x0 + 1 : 0) * (size_t)(y1 >= y0 ? y1 - y0 + 1 : 0);
    float *value = tsuya_calloc(3 * room, sizeof *value);
    if (!value) {
        return TSUYA_ERROR_MEMORY;
    }
    double across = 2.0 * INNER / fmax(high_x - low_x, 1e-9); /* chart units a pixel, near enough for the inside test below */
    for (int y = y0; y <= y1; y++) {
        for (int x = x0; x <= x1; x++) {
            /* inverse of the homography by one Newton step from the patch's middle: it is nearly affine across a patch */
            tsuya_vec2 m = tsuya_homography_apply(h, (tsuya_vec2){column, row});
            tsuya_vec2 du = tsuya_homography_apply(h, (tsuya_vec2){column + across, row}), dv = tsuya_homography_apply(h, (tsuya_vec2){column, row + across});
            double a = (du.x - m.x) / across, b = (dv.x - m.x) / across, c = (du.y - m.y) / across, d = (dv.y - m.y) / across, det = a * d - b * c;
            double u = (d * (x - m.x) - b * (y - m.y)) / det, v = (a * (y - m.y) - c * (x - m.x)) / det;
            if (!(fabs(u) <= INNER && fabs(v) <= INNER)) {
                continue;
            }
            bool top = false;
            for (int i = 0; i < 3; i++) {
                float e = tsuya_image_get(photo, x, y, i);
                top |= e >= 0.998f;
                value[(size_t)i * room + (size_t)n] = photo->encoding == TSUYA_ENCODING_SRGB ? tsuya_srgb_decode(e) : e;
            }
            clipped += top;
            n++;
        }
    }
    patch->pixels = n;
    patch->clipped = n ? (double)clipped / n : 0.0;
    for (int i = 0; i < 3 && n > 0; i++) {
        patch->rgb[i] = trimmed(value + (size_t)i * room, n);
        patch->sigma[i] = (double)(value[(size_t)i * room + (size_t)(84 * (n - 1) / 100)] - value[(size_t)i * room + (size_t)(16 * (n - 1) / 100)]) / 2.0;
    }
    tsuya_free(value);
    return TSUYA_OK;
}

static tsuya_status start(tsuya_chart *chart, const tsuya_image *photo, const char *name, const tsuya_vec2 *corners, int threads)
{
    tsuya_vec2 box[4];
    static const tsuya_vec2 middles[4] = {{0, 0}, {5, 0}, {5, 3}, {0, 3}}, edges[4] = {{-0.55, -0.55}, {5.55, -0.55}, {5.55, 3.55}, {-0.55, 3.55}};
    bool found = corners != NULL;
    if (!corners) {
        tsuya_image small;
        TSUYA_TRY(tsuya_image_convert(&small, photo, TSUYA_SAMPLE_U8, TSUYA_ENCODING_SRGB));
        tsuya_status status = tsuya_chart_box(&found, box, &small, threads);
        tsuya_image_free(&small);
        TSUYA_TRY(status);
    }
    if (!found || !tsuya_homography_fit(&chart->photo_from_chart, corners ? middles : edges, corners ? corners : box, 4)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: no 24-patch chart is found; let it fill a quarter of the picture, flat and without shadows, or give "
                          "--corners (middles of the patches dark skin, bluish green, black, white)", name);
    }
    return TSUYA_OK;
}

tsuya_status tsuya_chart_find(tsuya_chart *chart, const tsuya_image *photo, const char *name, const tsuya_vec2 *corners, int threads)
{
    front *f;
    *chart = (tsuya_chart){.fit_px = NAN};
    if (photo->channels < 3) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: has one channel; a colour photograph is expected", name);
    }
    TSUYA_TRY(start(chart, photo, name, corners, threads));
    f = tsuya_calloc(1, sizeof *f);
    if (!f) {
        return TSUYA_ERROR_MEMORY;
    }
    bool fine = true;
    for (int round = 0; round < ROUNDS && fine; round++) {
        place_patches(chart);
        fine = lay_on_patches(chart, f, photo);
    }
    tsuya_free(f);
    if (!fine) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: the 24-patch chart is not clear (fewer than %d patches came out whole); flat, even light and a sharp "
                          "photograph are needed", name, LEAST_FITTED);
    }
    place_patches(chart);
    for (int i = 0; i < TSUYA_CHART_PATCHES; i++) {
        TSUYA_TRY(read_patch(&chart->patch[i], photo, chart->photo_from_chart, i % TSUYA_CHART_COLS, i / TSUYA_CHART_COLS));
        if (chart->patch[i].pixels < LEAST_PITCH_PX) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: patch %d of the chart covers %d pixels; a chart of 300 pixels and more is needed, whole in the picture",
                              name, i + 1, chart->patch[i].pixels);
        }
    }
    return TSUYA_OK;
}
