#include "render/lamp_spectrum.h"

#include "core/color.h"
#include "core/file.h"
#include "core/memory.h"
#include "core/spectrum.h"
#include "core/table.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_ROWS = 4096 };

tsuya_vec3 tsuya_display_observer(double nm)
{
    /* white of the fitted observer's D65 at every nm, over Rec.709's */
    static const double too_large_x = 0.9998157012, too_large_z = 0.9995414916;
    tsuya_vec3 o = tsuya_observer(nm);
    return (tsuya_vec3){o.x / too_large_x, o.y, o.z / too_large_z};
}

/* Luminance 1. */
static tsuya_status scale(tsuya_lamp_spectrum *s, const char *name)
{
    double sum = 0.0;
    for (int k = 0; k < TSUYA_SPECTRUM_COUNT; ++k) {
        sum += s->power[k] * tsuya_display_observer(TSUYA_SPECTRUM_FIRST_NM + k).y;
    }
    if (!(sum > 0.0 && isfinite(sum))) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: dark from 430 to 670 nm; expected the power of a lamp", name);
    }
    for (int k = 0; k < TSUYA_SPECTRUM_COUNT; ++k) {
        s->power[k] /= sum;
    }
    return TSUYA_OK;
}

static tsuya_status check_row(const tsuya_table *table, size_t k, const char *path)
{
    double nm = tsuya_table_at(table, k, tsuya_table_column(table, "nm")), power = tsuya_table_at(table, k, tsuya_table_column(table, "power"));
    double before = k > 0 ? tsuya_table_at(table, k - 1, tsuya_table_column(table, "nm")) : 0.0;
    if (!(power >= 0.0 && isfinite(power)) || !(nm > before && isfinite(nm)) || (k > 0 && before < 670.0 && nm > 430.0 && nm - before > 40.0)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d: %g nm, power %g; expected ascending wavelengths at most 40 nm apart and powers ≥ 0",
                          path, table->line[k], nm, power);
    }
    return TSUYA_OK;
}

static tsuya_status check_table(const tsuya_table *table, const char *path)
{
    int nm = tsuya_table_column(table, "nm");
    size_t rows = table->row_count;
    if (rows < 2 || rows > MOST_ROWS) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: %zu rows; expected 2 to %d wavelengths", path, rows, MOST_ROWS);
    }
    for (size_t k = 0; k < rows; ++k) {
        TSUYA_TRY(check_row(table, k, path));
    }
    if (!(tsuya_table_at(table, 0, nm) <= 430.0 && tsuya_table_at(table, rows - 1, nm) >= 670.0)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: %g to %g nm; a lamp's spectrum must reach from 430 to 670 nm", path,
                          tsuya_table_at(table, 0, nm), tsuya_table_at(table, rows - 1, nm));
    }
    return TSUYA_OK;
}

static double power_at(const tsuya_table *table, double nm)
{
    int x = tsuya_table_column(table, "nm"), y = tsuya_table_column(table, "power");
    size_t k = 0;
    while (k + 2 < table->row_count && tsuya_table_at(table, k + 1, x) < nm) {
        ++k;
    }
    double low = tsuya_table_at(table, k, x), high = tsuya_table_at(table, k + 1, x);
    if (nm < low || nm > high) {
        return 0.0;
    }
    double t = (nm - low) / (high - low);
    return (1.0 - t) * tsuya_table_at(table, k, y) + t * tsuya_table_at(table, k + 1, y);
}

static tsuya_status load_table(tsuya_lamp_spectrum *s, const char *name, const char *folder)
{
    static const char *const columns[] = {"nm", "power", NULL};
    const tsuya_table_options options = {.required = columns, .known = columns};
    tsuya_table table = {0};
    tsuya_status status = TSUYA_OK;
    char *path = name[0] == '/' ? tsuya_strdup(name) : tsuya_path_join(folder, name);
    if (!path) {
        return TSUYA_ERROR_MEMORY;
    }
    TSUYA_GOTO_DONE(status, tsuya_table_load(&table, path, &options));
    TSUYA_GOTO_DONE(status, check_table(&table, path));
    for (int k = 0; k < TSUYA_SPECTRUM_COUNT; ++k) {
        s->power[k] = power_at(&table, TSUYA_SPECTRUM_FIRST_NM + k);
    }
    status = scale(s, path);
done:
    tsuya_table_free(&table);
    tsuya_free(path);
    return status;
}

static double led_power(double nm)
{
    double g = exp(-pow((nm - 452.0) / 22.0, 2.0)), t = (nm - 590.0) / (nm < 590.0 ? 52.0 : 60.0);
    return 0.62 * (g + 2.0 * pow(g, 5.0)) / 3.0 + exp(-0.5 * t * t);
}

typedef enum law { LAW_NONE, LAW_PLANCK, LAW_DAYLIGHT, LAW_LED, LAW_EQUAL } law;

/* "3200K" or, behind a D, daylight. */
static law law_of_temperature(const char *name, double *kelvin)
{
    law which = name[0] == 'D' ? LAW_DAYLIGHT : LAW_PLANCK;
    char *end = NULL;
    name += which == LAW_DAYLIGHT;
    *kelvin = strtod(name, &end);
    bool good = end != name && strcmp(end, "K") == 0 && *kelvin >= (which == LAW_DAYLIGHT ? 4000.0 : 1000.0) && *kelvin <= 20000.0;
    return good ? which : LAW_NONE;
}

static law law_of(const char *name, double *kelvin)
{
    static const struct { const char *name; law law; double kelvin; } known[] = {
        {"halogen", LAW_PLANCK, 3000.0}, {"led", LAW_LED, 0.0},        {"daylight", LAW_DAYLIGHT, 6504.0}, {"A", LAW_PLANCK, TSUYA_ILLUMINANT_A_K},
        {"D50", LAW_DAYLIGHT, 5003.0},   {"D65", LAW_DAYLIGHT, 6504.0}, {"E", LAW_EQUAL, 0.0},
    };
    for (size_t k = 0; k < sizeof known / sizeof known[0]; ++k) {
        if (strcmp(known[k].name, name) == 0) {
            *kelvin = known[k].kelvin;
            return known[k].law;
        }
    }
    return law_of_temperature(name, kelvin);
}

tsuya_status tsuya_lamp_spectrum_load(tsuya_lamp_spectrum *s, const char *name, const char *folder)
{
    size_t length = strlen(name);
    double kelvin = 0.0;
    if (length > 4 && strcmp(name + length - 4, ".csv") == 0) {
        return load_table(s, name, folder);
    }
    law which = law_of(name, &kelvin);
    if (which == LAW_NONE) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "spectrum \"%.40s\": expected halogen, led, daylight, A, D50, D65, E, a black body (3200K), daylight of "
                          "a temperature (D5400K) or FILE.csv with nm,power", name);
    }
    for (int k = 0; k < TSUYA_SPECTRUM_COUNT; ++k) {
        double nm = TSUYA_SPECTRUM_FIRST_NM + k;
        s->power[k] = which == LAW_PLANCK     ? tsuya_blackbody_power(nm, kelvin)
                      : which == LAW_DAYLIGHT ? tsuya_daylight_power(nm, kelvin)
                      : which == LAW_LED      ? led_power(nm)
                                              : 1.0;
    }
    return scale(s, name);
}

tsuya_vec3 tsuya_lamp_spectrum_rgb(const tsuya_lamp_spectrum *s)
{
    tsuya_vec3 xyz = {0, 0, 0};
    for (int k = 0; k < TSUYA_SPECTRUM_COUNT; ++k) {
        xyz = tsuya_vec3_mad(xyz, s->power[k], tsuya_display_observer(TSUYA_SPECTRUM_FIRST_NM + k));
    }
    return tsuya_rgb_of_lamp(xyz);
}
