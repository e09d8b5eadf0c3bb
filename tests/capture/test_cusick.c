/* The drape test: a round swatch on a smaller disc, its shadow's share of the ring against published fabrics. */
#include "support.h"

#include "capture/swatch.h"

#include <math.h>

/* G. E. Cusick, "The dependence of fabric drape on bending and shear stiffness", J. Text. Inst. 56 (1965) T596-T606,
 * doi:10.1080/19447026508662319: the regression over
 * 130 fabrics of a 30 cm swatch on an 18 cm disc, %; c the bending length, a the angle of shear at which the fabric begins to buckle. */
static double cusick_1965(double c_cm, double a_deg)
{
    return 35.6 * c_cm - 3.61 * c_cm * c_cm - 2.59 * a_deg + 0.0461 * a_deg * a_deg + 17.0;
}

/* Strips of 6 cm side by side around the disc, each free of the others and alike. */
static double radial_strips(double c_cm)
{
    double x, drop;
    elastica(pow(6.0 / c_cm, 3.0), &x, &drop);
    return 100.0 * ((9.0 + 6.0 * x) * (9.0 + 6.0 * x) - 81.0) / (225.0 - 81.0);
}

/* Weft and warp of a hundred measured fabrics (X. Feng et al., SIGGRAPH Asia 2022; capture/drape.h): the stiffer one's bending length is 1.22
 * times the other's in the middle.  Their means run from 1.2 to 2.8 cm (5 and 95 %), to 3.1 at most; the nineteen above 2.5 cm have 1.33 in the
 * middle, and 0.61 of their stiffness on the bias: a twist of 0.23 by the one and 0.44 by the other reading. */
static const double RATIO = 1.22, RATIO_OF_STIFF = 1.33, TWIST_OF_STIFF = 0.35;

/* The shear angle is no number of the simulated cloth: the regression's own range, from its turning point at 28 degrees to cloth that buckles
 * as soon as it is sheared, is its scatter over one bending length. */
static void stiffer_cloth_drapes_less_in_fewer_folds(void **state)
{
    (void)state;
    static const double length_m[] = {0.015, 0.02, 0.03, 0.04, 0.05};
    enum { LENGTHS = 5 };
    draped found[LENGTHS];
    double spread;
    for (int k = 0; k < LENGTHS; k++) {
        swatch w = swatch_alike(length_m[k]);
        double c = 100.0 * length_m[k];
        w.ratio = RATIO;
        found[k] = settled(&w, k == 0 ? 3 : k == 1 ? 10 : 2, &spread);
        print_message("  Cusick's fabrics: %.1f (28 degrees), %.1f (5), %.1f (0); free strips %.1f %%\n", cusick_1965(c, 28.0), cusick_1965(c, 5.0),
                      cusick_1965(c, 0.0), radial_strips(c));
        assert_true(spread < 3.0);
        assert_true(found[k].coefficient > cusick_1965(c, 28.0) && found[k].coefficient < cusick_1965(c, 0.0));
        assert_true(fabs(found[k].coefficient - cusick_1965(c, 5.0)) < (k == 0 ? 13.0 : 5.5) && found[k].coefficient > radial_strips(c));
        assert_true(k == 0 || found[k].coefficient > found[k - 1].coefficient);
        assert_true(k == 0 || found[k].folds <= found[k - 1].folds);
    }
    assert_true(found[0].folds > found[LENGTHS - 1].folds);
}

/* Stiff fabrics as they were measured differ more between weft and warp and twist easily: they drape further, to within 2 points of his of 5
 * degrees where there are fabrics.  Longer bending lengths are the regression's word alone. */
static void stiff_cloth_as_measured_drapes_further(void **state)
{
    (void)state;
    static const double length_m[] = {0.03, 0.04, 0.05}, above[] = {2.5, 4.0, 5.0};
    double spread;
    for (int k = 0; k < 3; k++) {
        swatch w = swatch_alike(length_m[k]);
        double limit = cusick_1965(100.0 * length_m[k], 5.0), alike = k == 0 ? settled(&w, 1, &spread).coefficient : NAN;
        w.ratio = RATIO_OF_STIFF;
        w.twist = TWIST_OF_STIFF;
        draped stiff = settled(&w, 2, &spread);
        print_message("  %.1f points above Cusick's fabrics of 5 degrees\n", stiff.coefficient - limit);
        assert_true(stiff.coefficient < limit + above[k]);
        assert_true(k != 0 || stiff.coefficient < alike - 3.0);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(stiffer_cloth_drapes_less_in_fewer_folds),
        cmocka_unit_test(stiff_cloth_as_measured_drapes_further),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
