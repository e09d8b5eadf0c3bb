/* Exported files through readers that know nothing of the writer: the program's reader of RGL tensors, which inverts the warp of any file,
 * and the index arithmetic of MERL's paper. */
#include "brdf/export.h"
#include "brdf/fit.h"
#include "brdf/samples.h"
#include "core/memory.h"
#include "support.h"

static tsuya_material *cloth(double weft, double warp)
{
    static const double strength[3] = {0.3, 0.2, 0.1}, dye[3] = {0.1, 0.2, 0.3};
    tsuya_material *m;
    assert_ok(tsuya_material_ggx(&m, weft, warp, strength, 1.5, dye));
    return m;
}

static void test_rgl(void **state)
{
    (void)state;
    tsuya_material *m = cloth(0.5, 0.25);
    tsuya_export_loss loss;
    tsuya_samples s;
    assert_ok(tsuya_export_rgl(&loss, test_path("a.bsdf"), m));
    assert_ok(tsuya_samples_load(&s, test_path("a.bsdf")));
    assert_true(s.count > 100000 && s.channel_count == 3);
    double *g = tsuya_calloc((size_t)s.count * 3, sizeof *g);
    assert_non_null(g);
    tsuya_material_predict(g, m, &s);
    double nodes = tsuya_samples_error(&s, g, -1).cbrt;
    print_message("RGL: nodes %.2e, between them %.4f, CIEDE2000 %.3f / %.3f\n", nodes, loss.cbrt, loss.de00_median, loss.de00_p95);
    assert_true(nodes < 1e-4);      /* every node is the material's value */
    assert_true(loss.cbrt < 0.02 && loss.de00_p95 < 2.0);
    tsuya_free(g);
    tsuya_samples_free(&s);
    tsuya_material_free(m);
}

static double merl_at(const char *bytes, double th, double td, double pd)
{
    double value;
    int i = (int)sqrt(th * 90.0 * 90.0), j = (int)(td), k = (int)pd; /* th in quarter turns, td and pd in degrees */
    memcpy(&value, bytes + 12 + 8 * (size_t)(((i * 90) + j) * 180 + k), 8);
    return value / 1500.0;
}

static void test_merl(void **state)
{
    (void)state;
    tsuya_material *round = cloth(0.4, 0.4), *long_one = cloth(0.6, 0.15);
    tsuya_export_loss loss;
    char *bytes;
    size_t size;
    assert_ok(tsuya_export_merl(&loss, test_path("a.binary"), round));
    assert_true(loss.cbrt < 0.03);
    assert_ok(tsuya_file_load(&bytes, &size, test_path("a.binary"), (size_t)1 << 30));
    assert_int_equal(size, 12 + 8 * 3 * 90 * 90 * 180);
    static const int32_t sides[3] = {90, 90, 180};
    assert_memory_equal(bytes, sides, 12);
    /* light at 40° on the weft, viewer opposite at 20°: the half vector leans by 10°, both lie 30° from it, in one plane */
    tsuya_vec3 wi = tsuya_goniometer_direction(40, 0, 0, 0), wo = tsuya_goniometer_direction(20, 180, 0, 0);
    double value[3];
    tsuya_material_eval(round, NULL, wi, wo, value);
    assert_near(merl_at(bytes, 10.0 / 90.0, 30.4, 0.4), value[0], 0.05 * value[0]);
    tsuya_free(bytes);
    assert_ok(tsuya_export_merl(&loss, test_path("a.binary"), long_one));
    assert_true(loss.cbrt > 0.05); /* anisotropy is lost, and the loss says so */
    tsuya_material_free(round);
    tsuya_material_free(long_one);
}

static int teardown(void **state)
{
    (void)state;
    test_folder_remove();
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_rgl), cmocka_unit_test(test_merl)};
    return cmocka_run_group_tests(tests, NULL, teardown);
}
