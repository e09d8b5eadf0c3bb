#include "scene_weave.h"

#include "core/context.h"
#include "core/geometry.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { FINE = 3, MARGIN_PX = 4, DRAW_MOST = 600 };

const char *weave_draft_name(weave_draft draft)
{
    static const char *const name[] = {"plain", "twill 2/1", "twill 2/2", "twill 3/1", "satin 5", "satin 8"};
    return name[draft];
}

int weave_draft_repeat(weave_draft draft)
{
    static const int repeat[] = {2, 3, 4, 4, 5, 8};
    return repeat[draft];
}

static int modulo(int a, int n) { return ((a % n) + n) % n; }

bool weave_warp_over(weave_draft draft, int pick, int end)
{
    static const int over[] = {1, 2, 2, 3, 4, 7}, step[] = {1, 1, 1, 1, 2, 3};
    int n = weave_draft_repeat(draft);
    return modulo(end - step[draft] * pick, n) < over[draft];
}

weave_cloth weave_cloth_default(void)
{
    return (weave_cloth){.draft = WEAVE_PLAIN, .weft_deg = 0.0, .warp_deg = 90.0, .weft_px = 6.0, .warp_px = 6.0, .fill = 0.92,
                         .crimp = 0.6, .fibre = 0.05, .lamp_azimuth_deg = 50.0, .lamp_height_deg = 45.0, .weft_albedo = 1.0,
                         .warp_albedo = 0.9, .ground = 0.1, .seed = 1};
}

weave_camera weave_camera_default(void) { return (weave_camera){.blur_px = 0.4, .contrast = 2.0, .level = 0.5, .spread = 0.08, .seed = 1}; }

/* A random number of thread `i` of a family, standard normal but cut at 2. */
static double thread_random(const weave_cloth *c, int family, int i, int what)
{
    double r = tsuya_random_normal(c->seed, (uint64_t)(10 + 4 * family + what), (uint64_t)(uint32_t)i);
    return fmin(fmax(r, -2.0), 2.0);
}

/* Two long waves by which threads stand off their places. */
static void set_waves(weave_loom *loom, int family)
{
    const weave_cloth *c = &loom->cloth;
    for (int k = 0; k < 2 && c->rough > 0.0; k++) {
        double r[4], *wave = loom->wave[family][k];
        for (int q = 0; q < 4; q++) {
            r[q] = tsuya_random_uniform(c->seed, (uint64_t)(30 + 2 * family + k), (uint64_t)q);
        }
        wave[0] = c->rough * 0.3 * r[0];
        wave[1] = 6.283 / (5.0 + 15.0 * r[1]);
        wave[2] = 6.283 * (2.0 * r[2] - 1.0) / 60.0;
        wave[3] = 6.283 * r[3];
    }
}

void weave_loom_set(weave_loom *loom, const weave_cloth *cloth)
{
    double lamp = tsuya_rad_from_deg(cloth->lamp_azimuth_deg), elevation = tsuya_rad_from_deg(cloth->lamp_height_deg);
    loom->cloth = *cloth;
    for (int family = 0; family < 2; family++) {
        double angle = tsuya_rad_from_deg(family == 0 ? cloth->weft_deg : cloth->warp_deg);
        loom->lamp[family][0] = cos(elevation) * cos(lamp - angle);
        loom->lamp[family][1] = cos(elevation) * sin(lamp - angle);
        loom->lamp[family][2] = sin(elevation);
        for (int i = 0; i < WEAVE_THREADS; i++) {
            loom->offset[family][i] = cloth->uneven > 0.0 ? cloth->uneven * thread_random(cloth, family, i, 0) : 0.0;
            loom->width[family][i] = cloth->fill * (1.0 + (cloth->uneven > 0.0 ? cloth->uneven * thread_random(cloth, family, i, 1) : 0.0));
            loom->fibre_phase[family][i] = cloth->fibre > 0.0 ? 6.3 * thread_random(cloth, family, i, 2) : 0.0;
            loom->shade[family][i] = cloth->rough > 0.0 ? 1.0 + 0.15 * cloth->rough * thread_random(cloth, family, i, 3) : 1.0;
        }
        set_waves(loom, family);
    }
}

typedef struct thread {
    int index;
    double offset; /* from its centre, of a period */
    double width;  /* of a period */
} thread;

/* The thread of a family nearest to a coordinate. */
static thread nearest_thread(const weave_loom *l, int family, double at, double along)
{
    thread best = {0, 1e9, 1.0};
    double rough = l->cloth.rough;
    for (int k = 0; k < 2 && rough > 0.0; k++) {
        const double *wave = l->wave[family][k];
        at += wave[0] * sin(wave[1] * at + wave[2] * along + wave[3]);
    }
    int middle = (int)floor(at + 0.5), reach = l->cloth.uneven > 0.0 ? 1 : 0;
    for (int i = middle - reach; i <= middle + reach; i++) {
        double offset = at - i - l->offset[family][i & (WEAVE_THREADS - 1)];
        if (fabs(offset) < fabs(best.offset)) {
            best = (thread){i, offset, l->width[family][i & (WEAVE_THREADS - 1)]};
        }
    }
    if (rough > 0.0) { /* slubs */
        best.width *= 1.0 + 0.2 * rough * sin(0.35 * along + 3.0 * l->fibre_phase[family][best.index & (WEAVE_THREADS - 1)]);
    }
    return best;
}

/* Height of a thread's centre line at a coordinate along it: up where it lies over, down where it lies under. */
static double centre_line(double *slope, const weave_cloth *c, int family, int index, double along)
{
    int before = (int)floor(along);
    double t = along - before, h[2], crimp = c->crimp * (1.0 + (family == 0 ? -c->balance : c->balance));
    for (int k = 0; k < 2; k++) {
        bool warp_over = family == 0 ? weave_warp_over(c->draft, index, before + k) : weave_warp_over(c->draft, before + k, index);
        h[k] = (family == 0) == warp_over ? -crimp : crimp;
    }
    if (h[0] == h[1]) {
        *slope = 0.0;
        return h[0];
    }
    *slope = 0.5 * M_PI * sin(M_PI * t) * (h[1] - h[0]);
    return h[0] + 0.5 * (1.0 - cos(M_PI * t)) * (h[1] - h[0]);
}

/* Streaks along the thread that run at a slant, as twisted fibres do. */
static double fibres(const weave_loom *l, int family, int index, double across, double along)
{
    double phase = l->fibre_phase[family][index & (WEAVE_THREADS - 1)];
    return l->cloth.fibre * (sin(9.0 * across + 2.5 * along + phase) + 0.5 * sin(17.0 * across - 1.3 * along + 2.0 * phase));
}

typedef struct ridge {
    thread thread;
    double x, round, height, slope; /* x: across, −1 … 1 from rim to rim */
} ridge;

/* The thread's surface at a point; false beside it. */
static bool set_ridge(ridge *r, const weave_loom *l, int family, double across, double along)
{
    r->thread = nearest_thread(l, family, across, along);
    r->x = 2.0 * r->thread.offset / r->thread.width;
    if (fabs(r->x) >= 1.0) {
        return false;
    }
    r->round = sqrt(1.0 - r->x * r->x);
    r->height = centre_line(&r->slope, &l->cloth, family, r->thread.index, along) + r->round;
    return true;
}

static double ridge_light(const ridge *r, const weave_loom *l, int family, double along)
{
    const weave_cloth *c = &l->cloth;
    /* normal of the ridge: along it, across it, up; less steep than a full circle: yarns are flattened */
    double n_across = 0.8 * r->x, n_along = -0.35 * r->slope, n_up = r->round + 0.25;
    double length = sqrt(n_across * n_across + n_along * n_along + n_up * n_up);
    const double *lamp = l->lamp[family];
    double lambert = fmax((n_along * lamp[0] + n_across * lamp[1] + n_up * lamp[2]) / length, 0.0);
    double albedo = (family == 0 ? c->weft_albedo : c->warp_albedo) * l->shade[family][r->thread.index & (WEAVE_THREADS - 1)];
    if (c->fibre > 0.0) {
        albedo *= 1.0 + fibres(l, family, r->thread.index, r->thread.offset, along);
    }
    return albedo * (0.3 + 0.7 * lambert) * (0.75 + 0.25 * fmin(fmax(r->height / c->crimp, -1.0), 1.0)); /* deeper parts are darker */
}

double weave_brightness(const weave_loom *l, double pick, double end)
{
    ridge r[2];
    bool weft = set_ridge(&r[0], l, 0, pick, end), warp = set_ridge(&r[1], l, 1, end, pick);
    if (!weft && !warp) {
        return l->cloth.ground;
    }
    int seen = weft && (!warp || r[0].height > r[1].height) ? 0 : 1;
    return ridge_light(&r[seen], l, seen, seen == 0 ? end : pick);
}

/* Thread coordinates of a point in px from the patch's centre, x right, y down.  Picks count upwards across the weft. */
static void thread_coordinates(double *pick, double *end, const weave_cloth *c, double x, double y)
{
    double a = tsuya_rad_from_deg(c->weft_deg), b = tsuya_rad_from_deg(c->warp_deg);
    *pick = (-sin(a) * x - cos(a) * y) / c->weft_px + c->weft_phase;
    *end = (sin(b) * x + cos(b) * y) / c->warp_px + c->warp_phase;
}

/* Gaussian of standard deviation s (in fine samples) and the pixel's square, along one axis. */
static int make_kernel(float *kernel, double s)
{
    int half = (int)ceil(3.0 * s) + FINE;
    double sum = 0.0;
    for (int k = -half; k <= half; k++) {
        double value = 0.0;
        for (int q = 0; q < FINE; q++) {
            double d = k - (q - 0.5 * (FINE - 1));
            value += s > 0.0 ? exp(-0.5 * d * d / (s * s)) : fabs(d) < 0.5;
        }
        kernel[k + half] = (float)value;
        sum += value;
    }
    for (int k = 0; k <= 2 * half; k++) {
        kernel[k] = (float)((double)kernel[k] / sum);
    }
    return half;
}

/* Adds `value` at a fine sample, shared among the four around. */
static void put(float *fine, int side, double x, double y, double value)
{
    int i = (int)floor(x), j = (int)floor(y);
    double u = x - i, v = y - j;
    if (i < 0 || j < 0 || i + 1 >= side || j + 1 >= side) {
        return;
    }
    float *p = fine + (size_t)j * (size_t)side + (size_t)i;
    p[0] += (float)(value * (1.0 - u) * (1.0 - v));
    p[1] += (float)(value * u * (1.0 - v));
    p[side] += (float)(value * (1.0 - u) * v);
    p[side + 1] += (float)(value * u * v);
}

/* Bent fibre ends of a few periods' length, in all directions, some bright and some in their own shadow. */
static void draw_hairs(float *fine, int side, const weave_cloth *c)
{
    double period = sqrt(c->weft_px * c->warp_px) * FINE;
    int count = (int)(0.35 * side * side / (period * period));
    for (int k = 0; k < count; k++) {
        double r[6];
        for (int q = 0; q < 6; q++) {
            r[q] = tsuya_random_uniform(c->seed, (uint64_t)(1000 + k), (uint64_t)q);
        }
        double x = r[0] * side, y = r[1] * side, angle = 6.283 * r[2], bend = (r[3] - 0.5) / period, length = period * (0.7 + 3.0 * r[4]);
        double value = c->hair * (r[5] - 0.35);
        for (double s = 0.0; s < length; s += 1.0) {
            put(fine, side, x, y, value * sin(M_PI * s / length));
            x += cos(angle);
            y += sin(angle);
            angle += bend;
        }
    }
}

void weave_draw_clean(float *values, int n, const weave_cloth *cloth, const weave_camera *camera)
{
    int side = (n + 2 * MARGIN_PX) * FINE;
    weave_loom loom;
    float kernel[256], *fine = malloc(sizeof *fine * (size_t)side * (size_t)side), *rows = calloc((size_t)side * (size_t)n, sizeof *rows);
    if (!fine || !rows || n > DRAW_MOST) {
        abort();
    }
    weave_loom_set(&loom, cloth);
    int half = make_kernel(kernel, fmin(camera->blur_px, 0.3 * MARGIN_PX) * FINE);
    for (int j = 0; j < side; j++) {
        double pick, end, next_pick, next_end, y = (j + 0.5 - 0.5 * side) / FINE;
        thread_coordinates(&pick, &end, cloth, (0.5 - 0.5 * side) / FINE, y);
        thread_coordinates(&next_pick, &next_end, cloth, (1.5 - 0.5 * side) / FINE, y);
        double pick_step = next_pick - pick, end_step = next_end - end;
        for (int i = 0; i < side; i++, pick += pick_step, end += end_step) {
            fine[(size_t)j * (size_t)side + (size_t)i] = (float)weave_brightness(&loom, pick, end);
        }
    }
    if (cloth->hair > 0.0) {
        draw_hairs(fine, side, cloth);
    }
    for (int j = 0; j < side; j++) {
        for (int x = 0; x < n; x++) {
            int centre = (x + MARGIN_PX) * FINE + FINE / 2;
            float sum = 0.0f;
            for (int k = -half; k <= half; k++) {
                sum += kernel[k + half] * fine[(size_t)j * (size_t)side + (size_t)(centre + k)];
            }
            rows[(size_t)j * (size_t)n + (size_t)x] = sum;
        }
    }
    double mean = 0.0, square = 0.0;
    for (int y = 0; y < n; y++) {
        int centre = (y + MARGIN_PX) * FINE + FINE / 2;
        for (int x = 0; x < n; x++) {
            float sum = 0.0f;
            for (int k = -half; k <= half; k++) {
                sum += kernel[k + half] * rows[(size_t)(centre + k) * (size_t)n + (size_t)x];
            }
            values[y * n + x] = sum;
            mean += (double)sum;
            square += (double)sum * (double)sum;
        }
    }
    mean /= (double)n * n;
    double spread = sqrt(fmax(square / ((double)n * n) - mean * mean, 1e-20));
    double a = tsuya_rad_from_deg(camera->gradient_deg);
    for (int y = 0; y < n; y++) {
        for (int x = 0; x < n; x++) {
            double d = ((x - 0.5 * (n - 1)) * cos(a) - (y - 0.5 * (n - 1)) * sin(a)) / (0.5 * n);
            double value = camera->level + ((double)values[y * n + x] - mean) / spread * camera->spread;
            values[y * n + x] = (float)(value * (1.0 + camera->gradient * d));
        }
    }
    free(fine);
    free(rows);
}

void weave_draw(float *values, int n, const weave_cloth *cloth, const weave_camera *camera)
{
    weave_draw_clean(values, n, cloth, camera);
    double sigma = camera->contrast > 0.0 ? camera->spread / camera->contrast : 0.0;
    for (int i = 0; i < n * n; i++) {
        values[i] += (float)(sigma * tsuya_random_normal(camera->seed, 77, (uint64_t)i));
    }
}

static double *parameter(weave_cloth *c, int k)
{
    double *const list[6] = {&c->weft_deg, &c->warp_deg, &c->weft_px, &c->warp_px, &c->weft_phase, &c->warp_phase};
    return list[k];
}

/* Solves the 6 × 6 symmetric system for the inverse's diagonal, by Gauss–Jordan with pivoting. */
static void invert(double a[6][12])
{
    for (int k = 0; k < 6; k++) {
        int pivot = k;
        for (int r = k + 1; r < 6; r++) {
            pivot = fabs(a[r][k]) > fabs(a[pivot][k]) ? r : pivot;
        }
        for (int c = 0; c < 12; c++) {
            double swap = a[k][c];
            a[k][c] = a[pivot][c];
            a[pivot][c] = swap;
        }
        double scale = 1.0 / a[k][k];
        for (int c = 0; c < 12; c++) {
            a[k][c] *= scale;
        }
        for (int r = 0; r < 6; r++) {
            double factor = r == k ? 0.0 : a[r][k];
            for (int c = 0; c < 12; c++) {
                a[r][c] -= factor * a[k][c];
            }
        }
    }
}

void weave_bound(double *weft_rad, double *warp_rad, int n, const weave_cloth *cloth, const weave_camera *camera, double sigma)
{
    /* Degrees, px, threads: a quarter of a pixel at the patch's rim, so that the threads' hard edges cross about a whole fine sample. */
    static const double step[6] = {0.4, 0.4, 0.05, 0.05, 0.04, 0.04};
    size_t area = (size_t)n * (size_t)n;
    float *d = malloc(sizeof *d * area * 6), *other = malloc(sizeof *other * area);
    double a[6][12] = {{0}};
    if (!d || !other) {
        abort();
    }
    for (int k = 0; k < 6; k++) {
        weave_cloth up = *cloth, down = *cloth;
        *parameter(&up, k) += step[k];
        *parameter(&down, k) -= step[k];
        weave_draw_clean(d + (size_t)k * area, n, &up, camera);
        weave_draw_clean(other, n, &down, camera);
        for (size_t i = 0; i < area; i++) {
            d[(size_t)k * area + i] = (d[(size_t)k * area + i] - other[i]) / (float)(2.0 * step[k]);
        }
    }
    for (int r = 0; r < 6; r++) {
        for (int c = 0; c < 6; c++) {
            for (size_t i = 0; i < area; i++) {
                a[r][c] += (double)d[(size_t)r * area + i] * (double)d[(size_t)c * area + i] / (sigma * sigma);
            }
        }
        a[r][6 + r] = 1.0;
    }
    invert(a);
    *weft_rad = tsuya_rad_from_deg(sqrt(a[0][6]));
    *warp_rad = tsuya_rad_from_deg(sqrt(a[1][7]));
    free(d);
    free(other);
}

void weave_random(weave_cloth *cloth, weave_camera *camera, uint64_t seed, uint64_t index)
{
    double r[24];
    for (int k = 0; k < 24; k++) {
        r[k] = tsuya_random_uniform(seed, index, (uint64_t)k);
    }
    *cloth = weave_cloth_default();
    *camera = weave_camera_default();
    cloth->draft = (weave_draft)(index % WEAVE_DRAFT_COUNT);
    cloth->weft_deg = 180.0 * r[0];
    cloth->warp_deg = cloth->weft_deg + 90.0 + 15.0 * (2.0 * r[1] - 1.0);
    cloth->weft_px = 3.0 * pow(4.0, r[2]);
    double ratio = pow(1.5, 2.0 * r[3] - 1.0);
    cloth->warp_px = fmin(fmax(cloth->weft_px * ratio, 3.0), 12.0);
    cloth->weft_phase = r[4];
    cloth->warp_phase = r[5];
    cloth->fill = r[6] < 0.3 ? 0.6 + 0.3 * r[7] : 0.85 + 0.15 * r[7];
    cloth->uneven = r[8] < 0.3 ? 0.06 * r[9] : 0.0;
    cloth->crimp = 0.35 + 0.5 * r[10];
    cloth->fibre = 0.1 * r[11];
    cloth->lamp_azimuth_deg = 360.0 * r[12];
    cloth->lamp_height_deg = 25.0 + 55.0 * r[13];
    cloth->warp_albedo = r[14] < 0.5 ? 1.0 : 0.5 + 0.5 * r[15];
    cloth->ground = 0.3 * r[16];
    cloth->seed = seed * 1000003u + index;
    camera->blur_px = 0.3 + 0.6 * r[17];
    camera->contrast = 0.25 * pow(16.0, r[18]);
    camera->gradient = 0.3 * r[19];
    camera->gradient_deg = 360.0 * r[20];
    camera->seed = cloth->seed + 1;
}

void weave_random_rough(weave_cloth *cloth, weave_camera *camera, uint64_t seed, uint64_t index)
{
    weave_random(cloth, camera, seed, index);
    cloth->rough = tsuya_random_uniform(seed, index, 30);
    cloth->uneven = 0.15 * cloth->rough;
    cloth->fibre = 0.25 * tsuya_random_uniform(seed, index, 31);
    camera->contrast = fmax(camera->contrast, 1.0);
}

void weave_random_spun(weave_cloth *cloth, weave_camera *camera, uint64_t seed, uint64_t index)
{
    double r[8];
    weave_random_rough(cloth, camera, seed, index);
    for (int k = 0; k < 8; k++) {
        r[k] = tsuya_random_uniform(seed, index, (uint64_t)(40 + k));
    }
    cloth->rough *= 0.7;
    cloth->uneven = 0.1 * cloth->rough;
    cloth->hair = r[0] * r[0];
    cloth->balance = 1.8 * r[1] - 0.9;
    cloth->weft_px = 3.2 * pow(4.0, r[2]);
    cloth->warp_px = fmin(fmax(cloth->weft_px * pow(2.2, 2.0 * r[3] - 1.0), 3.0), 14.0);
    cloth->fill = 0.8 + 0.25 * r[4];
    cloth->crimp = 0.3 + 0.6 * r[5];
    camera->blur_px = fmin(0.3 + 0.15 * r[6] * fmin(cloth->weft_px, cloth->warp_px), 1.2);
}
