/* The woven cloth of Irawan and Marschner against its own definition, integrated by brute force; where its highlights lie; what is refused. */
#include "capture/irawan.h"
#include "core/context.h"
#include "support.h"

static tsuya_vec3 direction(double theta_deg, double phi_deg)
{
    double t = tsuya_rad_from_deg(theta_deg), p = tsuya_rad_from_deg(phi_deg);
    return (tsuya_vec3){sin(t) * cos(p), sin(t) * sin(p), cos(t)};
}

static tsuya_vec3 random_direction(uint64_t stream, uint64_t k)
{
    return direction(80.0 * tsuya_random_uniform(9, stream, 2 * k), 360.0 * tsuya_random_uniform(9, stream, 2 * k + 1));
}

/* Warp alone, κ = 0 (the spine an arc of a circle). */
static tsuya_irawan plain_yarn(double twist_deg)
{
    const tsuya_irawan_yarn yarn = {.twist_deg = twist_deg, .end_deg = 35.0, .width = 1.0, .length = 4.0, .specular = {1.0, 1.0, 1.0}};
    tsuya_irawan cloth = {.warp = yarn, .weft = yarn, .warp_share = 1.0, .uniform = 0.02, .forward = 3.0};
    assert_ok(tsuya_irawan_prepare(&cloth, "plain yarn"));
    return cloth;
}

/* The definition with a narrow bell for δ, and the fibre's direction wound round the tube. */
static double by_brute_force(double twist_deg, tsuya_vec3 wi, tsuya_vec3 wo)
{
    enum { U = 1600, V = 1600 };
    const double end = tsuya_rad_from_deg(35.0), a = 0.5, radius = (2.0 - a * sin(end)) / sin(end), twist = tsuya_rad_from_deg(twist_deg), width = 0.01;
    double sum = 0.0;
    for (int k = 0; k < U * V; ++k) {
        double u = end * (2.0 * (k % U + 0.5) / U - 1.0), v = M_PI * ((k / U + 0.5) / V - 0.5);
        tsuya_vec3 n = {sin(v), sin(u) * cos(v), cos(u) * cos(v)}, along = {0, cos(u), -sin(u)}, round = tsuya_vec3_cross(n, along);
        tsuya_vec3 t = tsuya_vec3_add(tsuya_vec3_scale(along, cos(twist)), tsuya_vec3_scale(round, sin(twist)));
        double x = (tsuya_vec3_dot(t, wi) + tsuya_vec3_dot(t, wo)) / width, ci = tsuya_vec3_dot(n, wi), co = tsuya_vec3_dot(n, wo);
        if (fabs(x) < 6.0 && ci > 0.0 && co > 0.0) {
            sum += exp(-0.5 * x * x) * ci * co / (ci + co) * (radius + a * cos(v));
        }
    }
    double i0 = 0.0; /* ∫ exp(β cosφ) dφ / 2π */
    for (int k = 0; k < 400; ++k) {
        i0 += exp(3.0 * cos(2.0 * M_PI * k / 400.0)) / 400.0;
    }
    return sum * (0.02 + exp(-3.0 * tsuya_vec3_dot(wi, wo)) / (2.0 * M_PI * i0));
}

static void test_follows_its_definition(void **state)
{
    (void)state;
    static const double twists[] = {0.0, -30.0, 30.0};
    for (int c = 0; c < 3; ++c) {
        tsuya_irawan cloth = plain_yarn(twists[c]);
        double factor = 0.0;
        for (uint64_t k = 0; k < 8; ++k) {
            tsuya_vec3 wi = random_direction(1, k), wo = random_direction(2, k);
            double value[3], brute = by_brute_force(twists[c], wi, wo);
            tsuya_irawan_eval(&cloth, wi, wo, value);
            if (brute > 1.0 && value[1] > 0.0) { /* the definition has one common factor for every pair */
                factor = factor > 0.0 ? factor : value[1] / brute;
                assert_near(value[1], factor * brute, 0.03 * value[1]);
            }
        }
        assert_true(factor > 0.0);
    }
}

static void test_published_weaves(void **state)
{
    (void)state;
    static const char *const names[] = {"silk_charmeuse", "silk_shantung", "cotton_denim", "cotton_twill", "wool_gabardine", "polyester_lining"};
    static const double shares[] = {0.9, 1.0 / 3.0, 5.0 / 6.0, 0.75, 2.0 / 3.0, 0.5};
    const char *path = test_data("brdf/irawan_weaves.txt");
    if (!path) {
        skip();
    }
    for (int c = 0; c < 6; ++c) {
        tsuya_irawan cloth;
        assert_ok(tsuya_irawan_load(&cloth, path, names[c]));
        assert_near(cloth.warp_share, shares[c], 1e-12);
        double albedo = 0.0, white[3];
        for (uint64_t k = 0; k < 4000; ++k) { /* the specular part returns what was asked for, for light along the normal */
            double r = sqrt(tsuya_random_uniform(4, 1, 2 * k)), phi = 2.0 * M_PI * tsuya_random_uniform(4, 1, 2 * k + 1);
            tsuya_irawan_eval(&cloth, (tsuya_vec3){r * cos(phi), r * sin(phi), sqrt(1.0 - r * r)}, (tsuya_vec3){0, 0, 1}, white);
            albedo += (white[0] * M_PI - 0.1) / 4000.0;
        }
        assert_near(albedo, 0.3, 0.02);
        for (uint64_t k = 0; k < 500; ++k) {
            double a[3], b[3];
            tsuya_vec3 wi = random_direction(1, k), wo = random_direction(2, k);
            tsuya_irawan_eval(&cloth, wi, wo, a);
            tsuya_irawan_eval(&cloth, wo, wi, b);
            assert_true(isfinite(a[1]) && a[1] >= 0.1 / M_PI - 1e-12);
            assert_near(a[1], b[1], 1e-12 * a[1]);
        }
    }
}

/* Untwisted warp yarns reflect in a band that is bounded along them and runs on across them; twisted ones lean to one side. */
static void test_where_the_light_lies(void **state)
{
    (void)state;
    double along[3], across[3], one[3], other[3];
    tsuya_irawan filament = plain_yarn(0.0), staple = plain_yarn(-30.0);
    tsuya_irawan_eval(&filament, direction(45, 90), direction(45, 90), along); /* half vector 45° along the warp: beyond u_max = 35° */
    tsuya_irawan_eval(&filament, direction(45, 0), direction(45, 0), across);
    assert_true(along[1] == 0.0 && across[1] > 0.0);
    tsuya_irawan_eval(&staple, direction(40, 50), direction(40, 50), one);
    tsuya_irawan_eval(&staple, direction(40, 130), direction(40, 130), other);
    assert_true(fabs(one[1] - other[1]) > 0.1 * fmax(one[1], other[1]));
    tsuya_irawan_eval(&filament, direction(20, 0), direction(91, 0), one);
    assert_true(one[0] == 0.0);
}

static void test_refusals(void **state)
{
    (void)state;
    tsuya_irawan cloth = plain_yarn(0.0);
    cloth.warp.end_deg = 89.0;
    assert_fails(tsuya_irawan_prepare(&cloth, "evil"), "evil: warp: psi 0 umax 89");
    assert_ok(tsuya_file_write(test_path("w.txt"), "lame 1 1 x\n", 11));
    assert_fails(tsuya_irawan_load(&cloth, test_path("w.txt"), "lame"), "weave lame: expected");
    assert_fails(tsuya_irawan_load(&cloth, test_path("w.txt"), "lam"), "no weave lam");
    assert_fails(tsuya_irawan_load(&cloth, test_path("none.txt"), "lame"), "none.txt");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_follows_its_definition), cmocka_unit_test(test_published_weaves), cmocka_unit_test(test_where_the_light_lies),
        cmocka_unit_test(test_refusals),
    };
    return cmocka_run_group_tests(tests, NULL, test_folder_tear_down);
}
