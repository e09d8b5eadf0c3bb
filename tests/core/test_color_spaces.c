/* Colour spaces against their definitions, CIEDE2000 against the published test pairs. */
#include "support.h"

#include "core/color.h"

/* Sharma, Wu, Dalal 2005, table 1. */
static const double pairs[][7] = {
    {50, 2.6772, -79.7751, 50, 0, -82.7485, 2.0425},       {50, 3.1571, -77.2803, 50, 0, -82.7485, 2.8615},
    {50, 2.8361, -74.0200, 50, 0, -82.7485, 3.4412},       {50, -1.3802, -84.2814, 50, 0, -82.7485, 1.0000},
    {50, -1.1848, -84.8006, 50, 0, -82.7485, 1.0000},      {50, -0.9009, -85.5211, 50, 0, -82.7485, 1.0000},
    {50, 0, 0, 50, -1, 2, 2.3669},                         {50, -1, 2, 50, 0, 0, 2.3669},
    {50, 2.49, -0.001, 50, -2.49, 0.0009, 7.1792},         {50, 2.49, -0.001, 50, -2.49, 0.0010, 7.1792},
    {50, 2.49, -0.001, 50, -2.49, 0.0011, 7.2195},         {50, 2.49, -0.001, 50, -2.49, 0.0012, 7.2195},
    {50, -0.001, 2.49, 50, 0.0009, -2.49, 4.8045},         {50, -0.001, 2.49, 50, 0.0010, -2.49, 4.8045},
    {50, -0.001, 2.49, 50, 0.0011, -2.49, 4.7461},         {50, 2.5, 0, 50, 0, -2.5, 4.3065},
    {50, 2.5, 0, 73, 25, -18, 27.1492},                    {50, 2.5, 0, 61, -5, 29, 22.8977},
    {50, 2.5, 0, 56, -27, -3, 31.9030},                    {50, 2.5, 0, 58, 24, 15, 19.4535},
    {50, 2.5, 0, 50, 3.1736, 0.5854, 1.0000},              {50, 2.5, 0, 50, 3.2972, 0, 1.0000},
    {50, 2.5, 0, 50, 1.8634, 0.5757, 1.0000},              {50, 2.5, 0, 50, 3.2592, 0.3350, 1.0000},
    {60.2574, -34.0099, 36.2677, 60.4626, -34.1751, 39.4387, 1.2644},
    {63.0109, -31.0961, -5.8663, 62.8187, -29.7946, -4.0864, 1.2630},
    {61.2901, 3.7196, -5.3901, 61.4292, 2.2480, -4.9620, 1.8731},
    {35.0831, -44.1164, 3.7933, 35.0232, -40.0716, 1.5901, 1.8645},
    {22.7233, 20.0904, -46.6940, 23.0331, 14.9730, -42.5619, 2.0373},
    {36.4612, 47.8580, 18.3852, 36.2715, 50.5065, 21.2231, 1.4146},
    {90.8027, -2.0831, 1.4410, 91.1528, -1.6435, 0.0447, 1.4441},
    {90.9257, -0.5406, -0.9208, 88.6381, -0.8985, -0.7239, 1.5381},
    {6.7747, -0.2908, -2.4247, 5.8714, -0.0985, -2.2286, 0.6377},
    {2.0776, 0.0795, -1.1350, 0.9033, -0.0636, -0.5514, 0.9082},
};

static void test_difference(void **state)
{
    (void)state;
    for (size_t k = 0; k < sizeof pairs / sizeof pairs[0]; ++k) {
        const double *v = pairs[k];
        tsuya_lab a = {v[0], v[1], v[2]}, b = {v[3], v[4], v[5]};
        double there = tsuya_color_difference(a, b), back = tsuya_color_difference(b, a);
        if (!(fabs(there - v[6]) < 6e-5 && fabs(back - v[6]) < 6e-5)) {
            fail_msg("pair %zu: %.5f and %.5f, published %.4f", k + 1, there, back, v[6]);
        }
        assert_true(tsuya_color_difference(a, a) == 0.0);
    }
}

static void test_spaces(void **state)
{
    (void)state;
    tsuya_vec3 white = tsuya_white_d65(), one = tsuya_xyz_from_rgb((tsuya_vec3){1, 1, 1});
    assert_true(tsuya_vec3_norm(tsuya_vec3_sub(white, one)) < 1e-12 && fabs(white.y - 1.0) < 1e-15);
    /* luminance weights of BT.709 */
    assert_true(fabs(tsuya_xyz_from_rgb((tsuya_vec3){1, 0, 0}).y - 0.2126) < 1e-4);
    assert_true(fabs(tsuya_xyz_from_rgb((tsuya_vec3){0, 1, 0}).y - 0.7152) < 1e-4);
    assert_true(fabs(tsuya_xyz_from_rgb((tsuya_vec3){0, 0, 1}).y - 0.0722) < 1e-4);
    tsuya_lab paper = tsuya_lab_from_rgb((tsuya_vec3){1, 1, 1}), grey = tsuya_lab_from_rgb((tsuya_vec3){0.18, 0.18, 0.18});
    assert_true(fabs(paper.l - 100.0) < 1e-9 && fabs(paper.a) < 1e-9 && fabs(paper.b) < 1e-9);
    assert_true(fabs(grey.l - 49.496) < 1e-3 && fabs(grey.a) < 1e-9);
    for (int k = 0; k < 200; ++k) { /* there and back, dark colours and colours outside the gamut too */
        tsuya_vec3 rgb = {fmod(0.37 * k, 1.3) - 0.1, fmod(0.61 * k, 1.1), 1e-4 * k};
        tsuya_vec3 back = tsuya_rgb_from_lab(tsuya_lab_from_rgb(rgb));
        assert_true(tsuya_vec3_norm(tsuya_vec3_sub(rgb, back)) < 1e-12);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_difference), cmocka_unit_test(test_spaces)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
