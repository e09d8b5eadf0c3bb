/* Fits to woven cloth after Irawan and Marschner: highlights cut off along a curve of the yarn's surface, twisted fibres that lean to one side –
 * nothing that the models or the microcylinder cloth contain.  They must not break on it. */
#include "brdf/fit.h"
#include "brdf/truth.h"
#include "core/context.h"
#include "support.h"

enum { MODELS = 7, LOBES = 3, NDF = 5, PARTS = 3 };
static const char *const names[MODELS] = {"ggx", "ggx-aniso", "ward", "tanaka", "yarn", "ndf", "nurbs3"};

static void measure(double error[MODELS][PARTS], const truth_set *set)
{
    tsuya_context context = tsuya_context_default();
    for (int m = 0; m < MODELS; ++m) {
        const tsuya_fit_options options = {names[m], names[m], NAN};
        tsuya_fit_info info;
        tsuya_material *material;
        assert_ok(tsuya_brdf_fit(&material, &info, NULL, NULL, &set->fit, &options, &context));
        error[m][0] = truth_error(material, &set->tilts, -1);
        error[m][1] = truth_error(material, &set->azimuths, -1);
        error[m][2] = truth_error(material, &set->geometry, -1);
        print_message("  %-10s %.4f %.4f %.4f (%.1f s)\n", names[m], error[m][0], error[m][1], error[m][2], info.seconds);
        assert_true(isfinite(error[m][0]) && isfinite(error[m][1]) && isfinite(error[m][2]));
        tsuya_material_free(material);
    }
}

/* Measured over the six weaves, as shares of the best fitted lobe's error: ndf 0.04 to 0.15 on tilts, 0.09 to 0.85 on azimuths between the
 * measured ones, 0.14 to 0.77 in another geometry; denim, whose twisted yarns a Ward lobe describes nearly as well, is the last of each.  Ashikhmin and
 * Shirley's lobe is never the best here, tanaka's azimuths are its known weakness. */
static void check_weave(const char *name, const tsuya_irawan *cloth)
{
    static const double share[PARTS] = {0.25, 0.95, 0.85};
    const truth_cloth truth = truth_of_irawan(cloth);
    truth_set set;
    double error[MODELS][PARTS];
    print_message("%s: tilts, azimuths, geometry\n", name);
    truth_set_read_cloth(&set, &truth, 0.01, 7);
    measure(error, &set);
    for (int p = 0; p < PARTS; ++p) {
        double best = INFINITY;
        for (int m = 0; m < LOBES; ++m) {
            best = fmin(best, error[m][p]);
        }
        for (int m = LOBES + 1; m < MODELS; ++m) {
            assert_true(error[m][p] <= best);
        }
        assert_true(error[NDF][p] <= share[p] * best);
    }
    truth_set_free(&set);
}

static void test_published_weaves(void **state)
{
    (void)state;
    for (int w = 0; truth_weaves[w]; ++w) {
        tsuya_irawan cloth;
        if (!truth_weave_load(&cloth, truth_weaves[w])) {
            skip();
        }
        check_weave(truth_weaves[w], &cloth);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_published_weaves)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
