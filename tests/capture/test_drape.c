/* Draped cloth against the elastica, a hanging sheet's closed form, and itself. */
#include "support.h"

#include "capture/swatch.h"
#include "core/memory.h"

#include <math.h>

/* A strip held level up to u = 0, midway between its first two columns. */
static void tip_of(double *x, double *drop, double length, int cells, const tsuya_drape_fabric *f)
{
    double h = length / (cells - 0.5);
    tsuya_drape_sheet sheet;
    tsuya_drape_options o = tsuya_drape_options_default();
    tsuya_drape_info info;
    o.self_contact = false;
    assert_ok(tsuya_drape_sheet_grid(&sheet, -0.5 * h, 0.0, h, cells, 2));
    for (size_t v = 0; v < sheet.vertex_count; v++) {
        sheet.fixed[v] = sheet.position[3 * v] < 0.6 * h;
    }
    run(&info, &sheet, f, NULL, 0, &o, 1);
    assert_true(info.at_rest && info.energy_rise_j <= 1e-9);
    size_t v = 2 * (size_t)cells + 1; /* middle row's end */
    *x = sheet.position[3 * v];
    *drop = -sheet.position[3 * v + 2];
    tsuya_drape_sheet_free(&sheet);
}

/* Peirce's cantilever: the chord's slope is what the test reads; bending length 3 cm, overhang twice that. */
static void a_cantilever_hangs_as_an_elastica(void **state)
{
    (void)state;
    const double c = 0.03, length = 0.07, mass = 0.2;
    tsuya_drape_fabric f = plain(mass, mass * GRAVITY * c * c * c);
    double x, drop, error[3];
    f.stretch_weft_n_m = f.stretch_warp_n_m = 3e4;
    elastica(pow(length / c, 3.0), &x, &drop);
    for (int k = 0; k < 3; k++) {
        double own_x, own_drop;
        tip_of(&own_x, &own_drop, length, 6 << k, &f);
        error[k] = hypot(own_x / length - x, own_drop / length - drop);
        print_message("%d cells: tip %.5f %.5f, elastica %.5f %.5f, off by %.3f %%\n", 6 << k, own_x / length, own_drop / length, x, drop, 100.0 * error[k]);
    }
    double order = log2(error[0] / error[2]) / 2.0;
    print_message("order %.2f\n", order);
    assert_true(error[2] <= 0.01);
    assert_true(order >= 1.5);
}

/* A sheet held along its top: it stretches by m g L² / (2 K) to first order, exactly so in Green's strain's own integral. */
static void a_hanging_sheet_stretches_under_its_weight(void **state)
{
    (void)state;
    const double length = 0.4, mass = 0.3, stiff = 200.0;
    double exact = 0.0, error[3];
    for (int i = 0; i < 100000; i++) { /* K (λ² − 1)/2 λ = m g (L − s), λ by Newton */
        double load = mass * GRAVITY * length * (1.0 - (i + 0.5) / 100000), l = 1.0;
        for (int k = 0; k < 20; k++) {
            l -= (0.5 * stiff * (l * l - 1.0) * l - load) / (0.5 * stiff * (3.0 * l * l - 1.0));
        }
        exact += length * l / 100000;
    }
    for (int k = 0; k < 3; k++) {
        int rows = 4 << k;
        tsuya_drape_fabric f = plain(mass, 1e-6);
        tsuya_drape_sheet sheet;
        tsuya_drape_options o = tsuya_drape_options_default();
        tsuya_drape_info info;
        f.stretch_weft_n_m = f.stretch_warp_n_m = stiff;
        o.self_contact = false;
        o.rest_m_s = 1e-7;
        assert_ok(tsuya_drape_sheet_grid(&sheet, 0.0, -length, length / rows, 2, rows));
        for (size_t v = 0; v < sheet.vertex_count; v++) {
            sheet.position[3 * v + 2] = sheet.position[3 * v + 1];
            sheet.position[3 * v + 1] = 0.0;
            sheet.fixed[v] = sheet.position[3 * v + 2] > -1e-9;
        }
        run(&info, &sheet, &f, NULL, 0, &o, 1);
        error[k] = fabs(-sheet.position[5] / exact - 1.0); /* middle of the hem */
        print_message("%d rows: length %.6f, exact %.6f\n", rows, -sheet.position[5], exact);
        tsuya_drape_sheet_free(&sheet);
    }
    double order = log2(error[0] / error[2]) / 2.0;
    print_message("error %.2e, order %.2f\n", error[2], order);
    assert_true(error[2] < 1e-3 && order >= 1.5);
}

/* A saddle z = t u v bends neither yarn. */
static void a_saddle_costs_twist_alone(void **state)
{
    (void)state;
    const double t = 0.5, side = 0.4;
    tsuya_drape_fabric f = plain(0.1, 1e-5);
    tsuya_drape_sheet sheet;
    double stretch, with, without;
    assert_ok(tsuya_drape_sheet_grid(&sheet, -0.5 * side, -0.5 * side, side / 80, 80, 80));
    for (size_t v = 0; v < sheet.vertex_count; v++) {
        sheet.position[3 * v + 2] = t * sheet.position[3 * v] * sheet.position[3 * v + 1];
    }
    assert_ok(tsuya_drape_elastic_energy(&stretch, &with, &sheet, &f));
    f.twist_nm *= 0.5;
    assert_ok(tsuya_drape_elastic_energy(&stretch, &without, &sheet, &f));
    print_message("saddle: %.6g J, half the twist rigidity %.6g J; T t2 A / 2 = %.6g J\n", with, without, f.twist_nm * t * t * side * side);
    assert_true(fabs(with / (f.twist_nm * t * t * side * side) - 1.0) < 0.05);
    assert_true(fabs(without / with - 0.5) < 0.02);
    tsuya_drape_sheet_free(&sheet);
}

static void threads_do_not_matter(void **state)
{
    (void)state;
    double *position[2];
    for (int k = 0; k < 2; k++) {
        swatch w = swatch_alike(0.02);
        w.spacing_m = 0.015;
        w.threads = k ? 4 : 1;
        cusick(&w, 3, &position[k]);
    }
    assert_memory_equal(position[0], position[1], 3 * 331 * sizeof(double));
    tsuya_free(position[0]);
    tsuya_free(position[1]);
}

/* A square of cloth thrown over a thin bar on a floor: layers meet and none crosses. */
static void cloth_over_a_bar_does_not_pass_through(void **state)
{
    (void)state;
    tsuya_drape_fabric f;
    tsuya_drape_sheet sheet;
    tsuya_drape_options o = tsuya_drape_options_default();
    tsuya_drape_info info;
    size_t crossings;
    const tsuya_drape_body body[] = {{.shape = TSUYA_DRAPE_BAR, .a = {-0.3, 0, 0.08}, .b = {0.3, 0, 0.08}, .radius_m = 0.008},
                                     {.shape = TSUYA_DRAPE_FLOOR, .a = {0, 0, 0}}};
    assert_true(tsuya_drape_fabric_named(&f, "silk"));
    o.steps_most = 60;
    assert_ok(tsuya_drape_sheet_grid(&sheet, -0.1, -0.15, 0.015, 13, 20));
    for (size_t v = 0; v < sheet.vertex_count; v++) {
        sheet.position[3 * v + 2] = 0.091 + 1e-4 * tsuya_random_uniform(1, 2, v);
    }
    run(&info, &sheet, &f, body, 2, &o, 2);
    assert_ok(tsuya_drape_intersections(&crossings, &sheet));
    assert_int_equal(crossings, 0);
    assert_true(info.contacts > 20 && info.energy_rise_j <= 1e-9);
    for (size_t v = 0; v < sheet.vertex_count; v++) {
        tsuya_vec3 p = {sheet.position[3 * v], sheet.position[3 * v + 1], sheet.position[3 * v + 2]};
        assert_true(tsuya_drape_body_distance(&body[0], p, NULL) > 0.0 && p.z > 0.0);
    }
    tsuya_drape_sheet_free(&sheet);
}

/* From coarse to fine over a thin bar: layers touch, nothing crosses, and threads change no bit of it. */
static void coarse_to_fine_comes_to_rest(void **state)
{
    (void)state;
    tsuya_drape_sheet sheet[2];
    tsuya_drape_fabric f;
    tsuya_drape_info info;
    tsuya_drape_options o = tsuya_drape_options_default();
    size_t crossings;
    const tsuya_drape_body body[] = {{.shape = TSUYA_DRAPE_BAR, .a = {-0.3, 0, 0.14}, .b = {0.3, 0, 0.14}, .radius_m = 0.01},
                                     {.shape = TSUYA_DRAPE_FLOOR, .a = {0, 0, 0}}};
    assert_true(tsuya_drape_fabric_named(&f, "silk"));
    o.steps_most = 60;
    for (int k = 0; k < 2; k++) {
        tsuya_context context = tsuya_context_default();
        context.threads = k ? 3 : 1;
        assert_ok(tsuya_drape_sheet_grid(&sheet[k], -0.06, -0.12, 0.024, 5, 10));
        for (size_t v = 0; v < sheet[k].vertex_count; v++) {
            sheet[k].position[3 * v + 2] = 0.152 + 1e-4 * tsuya_random_uniform(1, 2, v);
        }
        assert_ok(tsuya_drape_settle(&info, &sheet[k], &f, body, 2, &o, 1, &context));
        print_message("  %zu vertices: %d steps, %d newton, rise %.1e J, contacts %d\n", sheet[k].vertex_count, info.steps, info.newton_steps, info.energy_rise_j, info.contacts);
    }
    assert_ok(tsuya_drape_intersections(&crossings, &sheet[0]));
    assert_int_equal(crossings, 0);
    assert_true(info.contacts > 10 && info.energy_rise_j <= 1e-9 && sheet[0].vertex_count == 11 * 21);
    assert_memory_equal(sheet[0].position, sheet[1].position, 3 * sheet[0].vertex_count * sizeof(double));
    tsuya_drape_sheet_free(&sheet[0]);
    tsuya_drape_sheet_free(&sheet[1]);
}

/* The costume's plan: its area, its symmetry, an opening from the neck down the front alone. */
static void a_karaori_is_cut_by_its_plan(void **state)
{
    (void)state;
    tsuya_drape_sheet s;
    double area = 0.0, low[2] = {1, 1}, high[2] = {-1, -1};
    assert_ok(tsuya_drape_sheet_karaori(&s, 1.4, 0.02));
    for (size_t t = 0; t < s.triangle_count; t++) {
        const double *c = s.uv + 6 * t;
        area += 0.5 * ((c[2] - c[0]) * (c[5] - c[1]) - (c[4] - c[0]) * (c[3] - c[1]));
        for (int k = 0; k < 6; k++) {
            low[k % 2] = fmin(low[k % 2], c[k]);
            high[k % 2] = fmax(high[k % 2], c[k]);
        }
        double u = (c[0] + c[2] + c[4]) / 3.0, v = (c[1] + c[3] + c[5]) / 3.0;
        assert_false(v > 0.0 && fabs(u) < 0.009);        /* open in front */
        assert_false(fabs(v) < 0.03 && fabs(u) < 0.06);  /* neck */
        assert_false(fabs(u) > 0.34 && fabs(v) > 0.56);  /* below the sleeves */
    }
    double flat = 2.0 * 1.4 * 1.4 * (2.0 * 0.225 * 1.05 + 2.0 * (0.5 - 0.225) * 0.38);
    assert_true(fabs(area / flat - 1.0) < 0.04); /* the cells' size, the slit */
    assert_true(fabs(low[0] + high[0]) < 1e-12 && fabs(low[1] + high[1]) < 1e-12 && fabs(high[0] - 0.7) < 0.02 && fabs(high[1] - 1.47) < 0.02);
    tsuya_drape_sheet_free(&s);
    assert_fails(tsuya_drape_sheet_karaori(&s, 1.4, 0.2), "from 15 to 2000 cells");
}

/* Of the curtain's row j, so long is it, and so often does it change sides. */
static double length_of_row(const tsuya_drape_sheet *s, size_t columns, size_t j, int *changes)
{
    double sum = 0.0;
    *changes = 0;
    for (size_t i = 0; i < columns; i++) {
        const double *a = s->position + 3 * (j * (columns + 1) + i), *b = a + 3;
        sum += sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) + (a[2] - b[2]) * (a[2] - b[2]));
        *changes += i > 0 && i + 1 < columns && (a[1] > 0.0) != (b[1] > 0.0);
    }
    return sum;
}

/* The heading follows its wave without a stretch and stays where it is held; the pleats go down to the hem. */
static void a_curtain_hangs_from_its_heading(void **state)
{
    (void)state;
    enum { COLUMNS = 60, ROWS = 25 };
    tsuya_drape_sheet s;
    tsuya_drape_fabric f;
    tsuya_drape_info info;
    tsuya_drape_options o = tsuya_drape_options_default();
    size_t crossings;
    int changes;
    double heading[3 * (COLUMNS + 1)];
    const double *top, *hem;
    assert_ok(tsuya_drape_sheet_curtain(&s, 0.6, 0.5, 2.0, 5, 0.02));
    assert_int_equal(s.vertex_count, (COLUMNS + 1) * (ROWS + 1));
    top = s.position + 3 * ROWS * (COLUMNS + 1);
    assert_true(fabs(length_of_row(&s, COLUMNS, ROWS, &changes) - 1.2) < 1e-9 && fabs(top[0] + 0.3) < 1e-12 && fabs(top[3 * COLUMNS] - 0.3) < 1e-9);
    assert_int_equal(changes, 9);
    memcpy(heading, top, sizeof heading);
    for (size_t v = 0; v < s.vertex_count; v++) {
        s.position[3 * v + 1] += s.fixed[v] ? 0.0 : 1e-4 * tsuya_random_uniform(1, 2, v);
    }
    assert_true(tsuya_drape_fabric_named(&f, "cotton"));
    run(&info, &s, &f, NULL, 0, &o, 2);
    assert_ok(tsuya_drape_intersections(&crossings, &s));
    assert_memory_equal(heading, s.position + 3 * ROWS * (COLUMNS + 1), sizeof heading);
    hem = s.position;
    double length = length_of_row(&s, COLUMNS, 0, &changes), lowest = 0.0, highest = -1.0;
    for (size_t i = 0; i <= COLUMNS; i++) {
        lowest = fmin(lowest, hem[3 * i + 2]);
        highest = fmax(highest, hem[3 * i + 2]);
    }
    print_message("hem %.4f m long, %.4f to %.4f m under the heading, %d times across; %s\n", length, -highest, -lowest, changes, info.at_rest ? "at rest" : "moving");
    assert_true(info.at_rest && info.energy_rise_j <= 1e-9);
    assert_int_equal(crossings, 0);
    assert_int_equal(changes, 9);
    assert_true(fabs(length - 1.2) < 0.006 && lowest > -0.505 && highest < -0.45);
    tsuya_drape_sheet_free(&s);
    assert_fails(tsuya_drape_sheet_curtain(&s, 0.6, 0.5, 5.0, 5, 0.02), "1.02 to 4 times");
    assert_fails(tsuya_drape_sheet_curtain(&s, 0.6, 0.5, 2.0, 8, 0.02), "at least 8 cells a pleat");
}

static void senseless_numbers_are_refused(void **state)
{
    (void)state;
    tsuya_drape_fabric f = plain(0.1, 1e-6);
    tsuya_drape_sheet sheet;
    tsuya_drape_options o = tsuya_drape_options_default();
    tsuya_drape_info info;
    tsuya_context context = tsuya_context_default();
    const tsuya_drape_body floor = {.shape = TSUYA_DRAPE_FLOOR, .a = {0, 0, 1}};
    assert_ok(tsuya_drape_sheet_grid(&sheet, 0.0, 0.0, 0.1, 2, 2));
    assert_fails(tsuya_drape_run(&info, &sheet, &f, &floor, 1, &o, NULL, NULL, &context), "starts inside a body");
    f.shear_n_m = -1.0;
    assert_fails(tsuya_drape_run(&info, &sheet, &f, NULL, 0, &o, NULL, NULL, &context), "shear stiffness -1");
    tsuya_drape_sheet_free(&sheet);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_cantilever_hangs_as_an_elastica),      cmocka_unit_test(a_hanging_sheet_stretches_under_its_weight),
        cmocka_unit_test(a_saddle_costs_twist_alone),             cmocka_unit_test(threads_do_not_matter),
        cmocka_unit_test(cloth_over_a_bar_does_not_pass_through), cmocka_unit_test(senseless_numbers_are_refused),
        cmocka_unit_test(coarse_to_fine_comes_to_rest), cmocka_unit_test(a_karaori_is_cut_by_its_plan),
        cmocka_unit_test(a_curtain_hangs_from_its_heading),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
