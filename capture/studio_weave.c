/* Dye and threads of the studio's cloth.
 *
 * The dye follows a karaori: blocks of two grounds in steps (dan-gawari), chrysanthemums of several colours scattered over
 * them, a fine lattice of gold on the darker ground, a border along the hem.  The yarns lie above each other as a five-shaft
 * weft-faced satin: weft j is under warp i where (i + 2 j) mod 5 = 0, over it elsewhere. */
#include "capture/studio.h"

#include <math.h>
#include <string.h>

static const float GROUND[2][3] = {{0.36f, 0.035f, 0.045f}, {0.62f, 0.50f, 0.30f}};
static const float GOLD[3] = {0.52f, 0.34f, 0.09f};
static const float BORDER[3] = {0.045f, 0.075f, 0.13f};
static const float PETAL[5][3] = {
    {0.70f, 0.66f, 0.58f}, {0.62f, 0.22f, 0.05f}, {0.09f, 0.26f, 0.11f}, {0.12f, 0.10f, 0.36f}, {0.60f, 0.28f, 0.34f},
};

tsuya_studio_weave tsuya_studio_weave_default(void)
{
    return (tsuya_studio_weave){.weft_pitch_m = 0.0026, .warp_pitch_m = 0.0020, .unevenness = 0.10, .seed = 1, .half_side_m = 0.165};
}

static double hash(const tsuya_studio_weave *w, uint64_t stream, long long a, long long b)
{
    return tsuya_random_uniform(w->seed, stream, (uint64_t)((a + 100000) * 200003 + (b + 100000)));
}

static double smooth(double edge, double width, double x)
{
    double t = (x - edge) / width + 0.5;
    return t <= 0.0 ? 0.0 : t >= 1.0 ? 1.0 : t * t * (3.0 - 2.0 * t);
}

static void mix(float rgb[3], const float other[3], double share)
{
    for (int k = 0; k < 3; k++) {
        rgb[k] += (float)share * (other[k] - rgb[k]);
    }
}

/* Value noise of a line: hashed heights, cubic between them. */
static double line_noise(const tsuya_studio_weave *w, uint64_t stream, long long yarn, double x)
{
    double cell = floor(x), t = smooth(0.5, 1.0, x - cell);
    return (1.0 - t) * hash(w, stream, yarn, (long long)cell) + t * hash(w, stream, yarn, (long long)cell + 1);
}

/* A flower's middle lies in the inner three fifths of its cell; it reaches 1.05 of its size, which is at most 0.46 cells. */
static const double MIDDLE_FIRST = 0.2, MIDDLE_RANGE = 0.6, LARGEST = 0.46, REACH = 1.05;

/* Most places lie outside: the hashes are drawn one by one until that is known. */
static void flower(const tsuya_studio_weave *w, float rgb[3], long long i, long long j, double u, double v, double cell)
{
    const double farthest = REACH * LARGEST * cell;
    double x = u - ((double)i + MIDDLE_FIRST + MIDDLE_RANGE * hash(w, 11, i, j)) * cell;
    if (fabs(x) > farthest) {
        return;
    }
    double y = v - ((double)j + MIDDLE_FIRST + MIDDLE_RANGE * hash(w, 12, i, j)) * cell, square = x * x + y * y;
    if (square > farthest * farthest) {
        return;
    }
    double size = cell * (0.26 + 0.2 * hash(w, 13, i, j)), r = sqrt(square) / size;
    if (r > REACH) {
        return;
    }
    double angle = atan2(y, x) + 6.3 * hash(w, 14, i, j);
    int petals = 7 + (int)(6.0 * hash(w, 15, i, j)), color = (int)(5.0 * hash(w, 16, i, j));
    double lobe = fabs(cos(0.5 * petals * angle)), outline = 0.62 + 0.38 * sqrt(lobe);
    double inside = 1.0 - smooth(outline, 0.06, r), vein = smooth(0.22, 0.2, lobe) * smooth(0.3, 0.1, r);
    float petal[3] = {PETAL[color][0], PETAL[color][1], PETAL[color][2]};
    mix(petal, BORDER, 0.75 * (1.0 - vein) * smooth(0.3, 0.1, r));
    mix(petal, PETAL[(color + 2) % 5], 1.0 - smooth(0.45, 0.08, r));
    mix(petal, GOLD, 1.0 - smooth(0.22, 0.06, r));
    mix(rgb, petal, inside);
}

/* Which neighbours' flowers can reach a place of its cell, in [0, 1) from side to side. */
static int before(double place) { return place < REACH * LARGEST - MIDDLE_FIRST ? -1 : 0; }
static int after(double place) { return place > MIDDLE_FIRST + 1.0 - REACH * LARGEST ? 1 : 0; }

static void border(const tsuya_studio_weave *w, float rgb[3], double u, double v)
{
    double side = fmax(fabs(u), fabs(v)), along = fabs(u) > fabs(v) ? v : u, inward = w->half_side_m - side;
    if (inward > 0.02) {
        return;
    }
    mix(rgb, BORDER, 1.0 - smooth(0.016, 0.001, inward));
    double zigzag = 0.008 + 0.003 * (fabs(fmod(fabs(along) / 0.006, 2.0) - 1.0) - 0.5) * 2.0;
    mix(rgb, GOLD, (1.0 - smooth(0.0016, 0.0008, fabs(inward - zigzag))) * smooth(0.0, 0.001, inward));
    mix(rgb, PETAL[1], 1.0 - smooth(0.0009, 0.0006, fabs(inward - 0.016)));
}

void tsuya_studio_dye_at(const tsuya_studio_weave *w, double u, double v, float rgb[3])
{
    const double block = 0.06, cell = 0.034;
    if (w->plain) {
        memcpy(rgb, w->plain, 3 * sizeof *rgb);
        return;
    }
    double step = floor(v / block), shift = (long long)step % 2 ? 0.5 * block : 0.0;
    long long column = (long long)floor((u + shift) / block);
    int ground = (int)(((column + (long long)step) % 2 + 2) % 2);
    for (int k = 0; k < 3; k++) {
        rgb[k] = GROUND[ground][k];
    }
    double a = (u + v) / 0.009, b = (u - v) / 0.009;
    double line = fmin(fabs(a - floor(a) - 0.5), fabs(b - floor(b) - 0.5));
    mix(rgb, GOLD, (ground == 0 ? 0.7 : 0.25) * (1.0 - smooth(0.10, 0.06, line)));
    double x = u / cell, y = v / cell, i = floor(x), j = floor(y);
    for (int dj = before(y - j); dj <= after(y - j); dj++) {
        for (int di = before(x - i); di <= after(x - i); di++) {
            flower(w, rgb, (long long)i + di, (long long)j + dj, u, v, cell);
        }
    }
    border(w, rgb, u, v);
}

static void tint(const tsuya_studio_weave *w, tsuya_studio_yarn *yarn, long long number, double along_m, double gap)
{
    uint64_t stream = yarn->is_weft ? 21 : 31;
    double own = 3.46 * (hash(w, stream, number, 0) - 0.5), slub = 3.46 * (line_noise(w, stream + 1, number, along_m / 0.004) - 0.5);
    double factor = fmax(1.0 + w->unevenness * (0.7 * own + 0.9 * slub), 0.1) * gap * (yarn->is_weft ? 1.0 : 0.75);
    yarn->shade = (float)factor;
    for (int k = 0; k < 3; k++) {
        yarn->albedo[k] = fminf((float)(yarn->dye[k] * factor), 0.9f);
    }
}

/* A yarn's round back, and the hollow beside it where light does not get. */
static double hollow(double f)
{
    double square = 4.0 * f * f;
    return 1.0 - 0.6 * square * square;
}

/* Where a yarn dives under the next. */
static double end(double along, int fours)
{
    double square = 4.0 * along * along, fourth = square * square;
    return 1.0 - 0.5 * (fours == 3 ? fourth * fourth * fourth : fourth * fourth);
}

tsuya_studio_yarn tsuya_studio_weave_at(const tsuya_studio_weave *w, double u, double v)
{
    tsuya_studio_yarn yarn;
    double x = u / w->warp_pitch_m, y = v / w->weft_pitch_m, i = floor(x), j = floor(y);
    double fx = x - i - 0.5, fy = y - j - 0.5; /* from the yarns' axes, in [−½, ½] */
    int phase = (int)((((long long)i + 2 * (long long)j) % 5 + 5) % 5);
    tsuya_studio_dye_at(w, u, v, yarn.dye);
    yarn.is_weft = phase != 0;
    if (yarn.is_weft) {
        double along = ((double)(phase - 1) + fx + 0.5) / 4.0 - 0.5; /* of the float, in [−½, ½] */
        yarn.across = 2.2 * fy;
        yarn.along = 6.0 * along * along * along;
        tint(w, &yarn, (long long)j, u, hollow(fy) * end(along, 3));
    } else {
        yarn.across = 2.2 * fx;
        yarn.along = 1.5 * fy;
        tint(w, &yarn, (long long)i, v, hollow(fx) * end(fy, 2));
    }
    return yarn;
}
