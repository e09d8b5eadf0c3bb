#include "support.h"

#include "capture/swatch.h"
#include "core/memory.h"

#include <math.h>

tsuya_drape_fabric plain(double mass, double bend)
{
    return (tsuya_drape_fabric){.mass_kg_m2 = mass, .stretch_weft_n_m = 3000.0, .stretch_warp_n_m = 3000.0, .shear_n_m = 40.0,
                                .bend_weft_nm = bend, .bend_warp_nm = bend, .twist_nm = 2.0 * TWIST * bend, .thickness_m = 1e-3, .friction = 0.2};
}

/* By shooting on θ'(0). */
void elastica(double w_over_b, double *x, double *drop)
{
    enum { STEPS = 4000 };
    double low = 0.0, high = 4.0 + w_over_b;
    for (int k = 0; k < 80; k++) {
        double theta = 0.0, bend = 0.5 * (low + high), h = 1.0 / STEPS;
        *x = *drop = 0.0;
        for (int i = 0; i < STEPS; i++) { /* midpoint rule */
            double s = i * h, middle = theta + 0.5 * h * bend;
            double bend_middle = bend - 0.5 * h * w_over_b * (1.0 - s) * cos(theta);
            *x += h * cos(middle);
            *drop += h * sin(middle);
            theta += h * bend_middle;
            bend -= h * w_over_b * (1.0 - s - 0.5 * h) * cos(middle);
        }
        *(bend > 0.0 ? &high : &low) = 0.5 * (low + high);
    }
}

void run(tsuya_drape_info *info, tsuya_drape_sheet *sheet, const tsuya_drape_fabric *f, const tsuya_drape_body *body, int bodies,
         const tsuya_drape_options *o, int threads)
{
    tsuya_context context = tsuya_context_default();
    context.threads = threads;
    assert_ok(tsuya_drape_run(info, sheet, f, body, bodies, o, NULL, NULL, &context));
    print_message("  %zu vertices: %d steps, %d newton, energy %.6g J, rise %.1e J, speed %.1e m/s, contacts %d%s\n", sheet->vertex_count,
                  info->steps, info->newton_steps, info->energy_j, info->energy_rise_j, info->speed_m_s, info->contacts,
                  info->at_rest ? "" : ", NOT AT REST");
}

/* Shadow of the hanging rim: drape coefficient, and how many folds: maxima of the rim's radius. */
static double drape_coefficient(const tsuya_drape_sheet *s, int *folds)
{
    size_t rings = 0;
    while (3 * rings * (rings + 1) + 1 < s->vertex_count) {
        rings++;
    }
    size_t first = 3 * rings * (rings - 1) + 1, count = 6 * rings;
    double area = 0.0, mean = 0.0, a[64] = {0}, b[64] = {0};
    for (size_t k = 0; k < count; k++) {
        const double *p = s->position + 3 * (first + k), *q = s->position + 3 * (first + (k + 1) % count);
        area += 0.5 * (p[0] * q[1] - q[0] * p[1]);
        mean += hypot(p[0], p[1]) / (double)count;
        for (int m = 1; m < 25; m++) {
            a[m] += hypot(p[0], p[1]) * cos(m * atan2(p[1], p[0]));
            b[m] += hypot(p[0], p[1]) * sin(m * atan2(p[1], p[0]));
        }
    }
    *folds = 1;
    for (int m = 2; m < 25; m++) {
        *folds = hypot(a[m], b[m]) > hypot(a[*folds], b[*folds]) ? m : *folds;
    }
    return 100.0 * (area - M_PI * 0.0081) / (M_PI * (0.0225 - 0.0081));
}

/* As a hand lays it down: waves of two to eight folds, half a centimetre high at the rim.  Started level it stays caught in the folds that
 * grow first, which are too many. */
static void lay_unevenly(tsuya_drape_sheet *sheet, uint64_t seed)
{
    for (size_t v = 0; v < sheet->vertex_count; v++) {
        double *p = sheet->position + 3 * v, out = (hypot(p[0], p[1]) - 0.09) / 0.06, around = atan2(p[1], p[0]);
        if (sheet->fixed[v]) {
            continue;
        }
        p[2] = 5e-4 * (tsuya_random_uniform(seed, 1, v) - 0.5);
        for (uint64_t m = 2; m <= 8; m++) {
            double height = 5e-3 * (2.0 * tsuya_random_uniform(seed, 2, m) - 1.0);
            p[2] += out * height * cos((double)m * around + 2.0 * M_PI * tsuya_random_uniform(seed, 3, m));
        }
    }
}

swatch swatch_alike(double bending_length_m) { return (swatch){bending_length_m, 1.0, TWIST, 0.01, 1}; }

draped cusick(const swatch *w, uint64_t seed, double **positions)
{
    const double mass = 0.15, weft_m = 2.0 * w->bending_length_m / (1.0 + w->ratio);
    tsuya_drape_fabric f = plain(mass, mass * GRAVITY * pow(weft_m, 3.0));
    tsuya_drape_sheet sheet;
    tsuya_drape_options o = tsuya_drape_options_default();
    tsuya_drape_info info;
    draped d;
    size_t crossings;
    f.bend_warp_nm *= pow(w->ratio, 3.0);
    f.twist_nm = w->twist * (f.bend_weft_nm + f.bend_warp_nm);
    o.self_contact = false;
    o.steps_most = 400;
    assert_ok(tsuya_drape_sheet_disc(&sheet, 0.15, 0.09, w->spacing_m));
    lay_unevenly(&sheet, seed);
    run(&info, &sheet, &f, NULL, 0, &o, w->threads);
    assert_true(info.energy_rise_j <= 1e-9);
    assert_ok(tsuya_drape_intersections(&crossings, &sheet));
    assert_int_equal(crossings, 0); /* without contact: the swatch does not meet itself */
    d.coefficient = drape_coefficient(&sheet, &d.folds);
    d.energy_j = info.energy_j;
    print_message("bending length %.1f cm: drape coefficient %.1f %%, %d folds, %.4g mJ%s\n", 100.0 * w->bending_length_m, d.coefficient, d.folds,
                  1e3 * d.energy_j, info.at_rest ? "" : " (still moving)");
    if (positions) {
        *positions = sheet.position;
        sheet.position = NULL;
    }
    tsuya_drape_sheet_free(&sheet);
    return d;
}

draped settled(const swatch *w, int starts, double *spread)
{
    double sum = 0.0, squares = 0.0, low = 100.0, high = 0.0;
    draped best = {.energy_j = INFINITY};
    int least = 99, most = 0;
    for (int seed = 1; seed <= starts; seed++) {
        draped d = cusick(w, (uint64_t)seed, NULL);
        sum += d.coefficient;
        squares += d.coefficient * d.coefficient;
        low = fmin(low, d.coefficient);
        high = fmax(high, d.coefficient);
        least = d.folds < least ? d.folds : least;
        most = d.folds > most ? d.folds : most;
        best = d.energy_j < best.energy_j ? d : best;
    }
    double mean = sum / starts;
    *spread = sqrt(fmax(squares / starts - mean * mean, 0.0) * starts / fmax(starts - 1, 1.0));
    print_message("%d starts at %.1f cm in cells of %.1f mm: %.1f +- %.1f %% (%.1f to %.1f), %d to %d folds; least energy %.1f %%, %d folds\n", starts,
                  100.0 * w->bending_length_m, 1e3 * w->spacing_m, mean, *spread, low, high, least, most, best.coefficient, best.folds);
    return best;
}
