#include "core/spectrum.h"

#include "core/color.h"

enum { FIRST_NM = 380, LAST_NM = 780, STEP_NM = 5, TABLE_NM = 10, TABLE = (LAST_NM - FIRST_NM) / TABLE_NM + 1 };

static double lobe(double nm, double peak, double below, double above)
{
    double t = (nm - peak) / (nm < peak ? below : above);
    return exp(-0.5 * t * t);
}

tsuya_vec3 tsuya_observer(double nm)
{
    return (tsuya_vec3){1.056 * lobe(nm, 599.8, 37.9, 31.0) + 0.362 * lobe(nm, 442.0, 16.0, 26.7) - 0.065 * lobe(nm, 501.1, 20.4, 26.2),
                        0.821 * lobe(nm, 568.8, 46.9, 40.5) + 0.286 * lobe(nm, 530.9, 16.3, 31.1),
                        1.217 * lobe(nm, 437.0, 11.8, 36.0) + 0.681 * lobe(nm, 459.0, 26.0, 13.8)};
}

/* Mean and the first two characteristic vectors of daylight, 380 … 780 nm every 10 (CIE 15:2004, table T.2). */
static const double daylight[TABLE][3] = {
    {63.4, 38.5, 3.0},    {65.8, 35.0, 1.2},    {94.8, 43.4, -1.1},   {104.8, 46.3, -0.5},  {105.9, 43.9, -0.7},  {96.8, 37.1, -1.2},
    {113.9, 36.7, -2.6},  {125.6, 35.9, -2.9},  {125.5, 32.6, -2.8},  {121.3, 27.9, -2.6},  {121.3, 24.3, -2.6},  {113.5, 20.1, -1.8},
    {113.1, 16.2, -1.5},  {110.8, 13.2, -1.3},  {106.5, 8.6, -1.2},   {108.8, 6.1, -1.0},   {105.3, 4.2, -0.5},   {104.4, 1.9, -0.3},
    {100.0, 0.0, 0.0},    {96.0, -1.6, 0.2},    {95.1, -3.5, 0.5},    {89.1, -3.5, 2.1},    {90.5, -5.8, 3.2},    {90.3, -7.2, 4.1},
    {88.4, -8.6, 4.7},    {84.0, -9.5, 5.1},    {85.1, -10.9, 6.7},   {81.9, -10.7, 7.3},   {82.6, -12.0, 8.6},   {84.9, -14.0, 9.8},
    {81.3, -13.6, 10.2},  {71.9, -12.0, 8.3},   {74.3, -13.3, 9.6},   {76.4, -12.9, 8.5},   {63.3, -10.6, 7.0},   {71.7, -11.6, 7.6},
    {77.0, -12.2, 8.0},   {65.2, -10.2, 6.7},   {47.7, -7.8, 5.2},    {68.6, -11.2, 7.4},   {65.0, -10.4, 6.8},
};

static void daylight_chromaticity(double temperature_k, double xy[2])
{
    double t = fmin(25000.0, fmax(4000.0, temperature_k));
    const double low[4] = {-4.6070e9, 2.9678e6, 0.09911e3, 0.244063}, high[4] = {-2.0064e9, 1.9018e6, 0.24748e3, 0.237040};
    const double *k = t <= 7000.0 ? low : high;
    xy[0] = ((k[0] / t + k[1]) / t + k[2]) / t + k[3];
    xy[1] = (-3.0 * xy[0] + 2.87) * xy[0] - 0.275;
}

double tsuya_daylight_power(double nm, double temperature_k)
{
    double xy[2];
    daylight_chromaticity(temperature_k, xy);
    double m = 0.0241 + 0.2562 * xy[0] - 0.7341 * xy[1];
    double m1 = (-1.3515 - 1.7703 * xy[0] + 5.9114 * xy[1]) / m, m2 = (0.0300 - 31.4424 * xy[0] + 30.0717 * xy[1]) / m;
    double at = fmin(TABLE - 1, fmax(0.0, (nm - FIRST_NM) / TABLE_NM)), value[2];
    int k = (int)fmin(at, TABLE - 2);
    for (int i = 0; i < 2; ++i) {
        value[i] = daylight[k + i][0] + m1 * daylight[k + i][1] + m2 * daylight[k + i][2];
    }
    return (value[0] + (at - k) * (value[1] - value[0])) / 100.0;
}

double tsuya_blackbody_power(double nm, double temperature_k)
{
    const double c2_nm_k = 1.438777e7;
    double ratio = 560.0 / nm, r5 = ratio * ratio * ratio * ratio * ratio;
    return r5 * expm1(c2_nm_k / (560.0 * temperature_k)) / expm1(c2_nm_k / (nm * temperature_k));
}

tsuya_vec3 tsuya_rgb_of_lamp(tsuya_vec3 xyz)
{
    tsuya_vec3 rgb = tsuya_rgb_from_xyz(xyz);
    rgb = (tsuya_vec3){fmax(0.0, rgb.x), fmax(0.0, rgb.y), fmax(0.0, rgb.z)};
    return tsuya_vec3_scale(rgb, 1.0 / tsuya_xyz_from_rgb(rgb).y);
}

tsuya_vec3 tsuya_rgb_of_daylight(double temperature_k)
{
    double xy[2];
    daylight_chromaticity(temperature_k, xy);
    return tsuya_rgb_of_lamp((tsuya_vec3){xy[0] / xy[1], 1.0, (1.0 - xy[0] - xy[1]) / xy[1]});
}

tsuya_vec3 tsuya_xyz_of_reflectance(const double *nm, const double *reflectance, int count)
{
    tsuya_vec3 sum = {0, 0, 0}, white = {0, 0, 0}, d65 = tsuya_white_d65();
    int k = 0;
    for (int w = FIRST_NM; w <= LAST_NM; w += STEP_NM) {
        while (k + 2 < count && nm[k + 1] < w) {
            k++;
        }
        double t = count > 1 ? fmin(1.0, fmax(0.0, (w - nm[k]) / (nm[k + 1] - nm[k]))) : 0.0;
        double r = count > 1 ? reflectance[k] + t * (reflectance[k + 1] - reflectance[k]) : reflectance[0];
        tsuya_vec3 seen = tsuya_vec3_scale(tsuya_observer(w), tsuya_daylight_power(w, 6504.0));
        sum = tsuya_vec3_mad(sum, r, seen);
        white = tsuya_vec3_add(white, seen);
    }
    return (tsuya_vec3){d65.x * sum.x / white.x, d65.y * sum.y / white.y, d65.z * sum.z / white.z};
}

tsuya_vec3 tsuya_rgb_of_reflectance(const double *nm, const double *reflectance, int count)
{
    return tsuya_rgb_from_xyz(tsuya_xyz_of_reflectance(nm, reflectance, count));
}
