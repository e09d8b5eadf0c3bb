/* Sample tables: directions, or the stage angles of a goniometer. */
#include "brdf/samples_internal.h"

#include "brdf/samples_color.h"
#include "core/memory.h"
#include "core/table.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef enum quantity { BRDF, BRDF_COS, RADIANCE, RADIANCE_FACTOR } quantity;
static const char *const quantity_name[] = {"brdf", "brdf_cos", "radiance", "radiance_factor", NULL};
static const char *const direction_columns[] = {"theta_i_deg", "phi_i_deg", "theta_o_deg", "phi_o_deg", NULL};
static const char *const stage_columns[] = {"azimuth_deg", "tilt_deg", NULL};
static const char *const key_names[] = {"quantity", "irradiance", "illuminant", "scale_uncertainty", "clip", "light_theta_deg", "light_phi_deg", "view_theta_deg", "view_phi_deg", NULL};
static const char *const all_columns[] = {"theta_i_deg", "phi_i_deg", "theta_o_deg", "phi_o_deg", "azimuth_deg", "tilt_deg", "r", "g", "b", "sigma", NULL}; /* sigma: for the reader of the table */

typedef struct reading {
    const tsuya_table *table;
    bool goniometer;
    int angle[4], *channel, channel_count;
    quantity quantity;
    double lamp[256], clip, scale_sigma; /* lamp: irradiance of each channel; only its course where has_irradiance is false */
    bool has_irradiance, has_clip;
    double light_deg[2], view_deg[2];
} reading;

static bool is_wavelength(const char *name)
{
    double nm;
    return tsuya_channel_nm(&nm, name);
}

static tsuya_status number_key(double *value, bool *found, const tsuya_table *t, const char *key, double low, double high)
{
    const char *text = tsuya_table_key(t, key);
    *found = text != NULL;
    if (text && (!tsuya_parse_number(value, text) || !(*value >= low && *value <= high))) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: # %s=%.40s: expected a number from %g to %g", t->path, key, text, low, high);
    }
    return TSUYA_OK;
}

static tsuya_status check_keys(const tsuya_table *t)
{
    for (int k = 0; k < t->key_count; ++k) {
        int i = 0;
        while (key_names[i] && strcmp(key_names[i], t->key[k]) != 0) {
            i++;
        }
        const char *nearest = key_names[i] ? NULL : tsuya_nearest_name(t->key[k], key_names);
        if (nearest) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: # %.40s=: no such key; the nearest known one is %s", t->path, t->key[k], nearest);
        }
    }
    return TSUYA_OK;
}

/* One number for all channels, or one a channel: r,g,b, or as the wavelengths stand: "irradiance=812,640,377". */
static tsuya_status read_irradiance(reading *r)
{
    const char *text = tsuya_table_key(r->table, "irradiance"), *at = text;
    int count = 0;
    for (int c = 0; c < r->channel_count; ++c) {
        r->lamp[c] = 1.0;
    }
    r->has_irradiance = text != NULL;
    while (at && count < r->channel_count) {
        char *end;
        double value = strtod(at, &end);
        if (end == at || !(value >= 1e-30 && value <= 1e30)) {
            break;
        }
        r->lamp[count++] = value;
        at = *end == ',' ? end + 1 : end;
        if (*end != ',') {
            break;
        }
    }
    if (text && (*at || (count != 1 && count != r->channel_count))) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: # irradiance=%.40s: expected a number from 1e-30 to 1e30, or one for each of %d channels", r->table->path, text,
                          r->channel_count);
    }
    for (int c = 1; count == 1 && c < r->channel_count; ++c) {
        r->lamp[c] = r->lamp[0];
    }
    return TSUYA_OK;
}

/* The lamp's colour, which a radiance carries and a reflectance does not. */
static tsuya_status read_illuminant(reading *r)
{
    const tsuya_table *t = r->table;
    const char *name = tsuya_table_key(t, "illuminant");
    double nm[256], power[256];
    if (!name) {
        return TSUYA_OK;
    }
    if (r->quantity != RADIANCE) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: # illuminant=%.40s: belongs to quantity=radiance; a reflectance has its lamp divided out", t->path, name);
    }
    for (int c = 0; c < r->channel_count; ++c) {
        if (!tsuya_channel_nm(&nm[c], t->column[r->channel[c]])) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: # illuminant=%.40s: needs wavelengths (nm390,…); for r,g,b give \"irradiance=R,G,B\"", t->path, name);
        }
    }
    TSUYA_TRY(tsuya_illuminant_power(power, nm, r->channel_count, name, t->path));
    for (int c = 0; c < r->channel_count; ++c) {
        r->lamp[c] *= power[c];
    }
    return TSUYA_OK;
}

static tsuya_status read_quantity(reading *r)
{
    const tsuya_table *t = r->table;
    const char *text = tsuya_table_key(t, "quantity");
    if (!text) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: no line \"# quantity=\": brdf, brdf_cos, radiance or radiance_factor, which nothing else tells", t->path);
    }
    for (int q = 0; quantity_name[q]; ++q) {
        if (strcmp(text, quantity_name[q]) == 0) {
            r->quantity = (quantity)q;
            bool stated;
            r->scale_sigma = NAN;
            TSUYA_TRY(read_irradiance(r));
            TSUYA_TRY(read_illuminant(r));
            TSUYA_TRY(number_key(&r->scale_sigma, &stated, t, "scale_uncertainty", 1e-6, 1.0));
            return number_key(&r->clip, &r->has_clip, t, "clip", 1e-30, 1e30);
        }
    }
    return tsuya_fail(TSUYA_ERROR_INPUT, "%s: # quantity=%.40s: expected brdf, brdf_cos, radiance or radiance_factor", t->path, text);
}

static tsuya_status read_geometry(reading *r)
{
    static const char *const names[4] = {"light_theta_deg", "light_phi_deg", "view_theta_deg", "view_phi_deg"};
    double *to[4] = {&r->light_deg[0], &r->light_deg[1], &r->view_deg[0], &r->view_deg[1]};
    for (int k = 0; k < 4; ++k) {
        bool found;
        TSUYA_TRY(number_key(to[k], &found, r->table, names[k], k % 2 ? -360.0 : -90.0, k % 2 ? 360.0 : 90.0));
        if (!found) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: no line \"# %s=\", which a table of stage angles needs", r->table->path, names[k]);
        }
    }
    return TSUYA_OK;
}

static tsuya_status find_columns(reading *r)
{
    const tsuya_table *t = r->table;
    r->goniometer = tsuya_table_column(t, "azimuth_deg") >= 0 || tsuya_table_column(t, "tilt_deg") >= 0;
    const char *const *names = r->goniometer ? stage_columns : direction_columns;
    for (int k = 0; names[k]; ++k) {
        r->angle[k] = tsuya_table_column(t, names[k]);
        if (r->angle[k] < 0) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: column %s is missing", t->path, names[k]);
        }
    }
    static const char *const rgb[] = {"r", "g", "b"};
    int have = 0;
    for (int c = 0; c < 3; ++c) {
        have += tsuya_table_column(t, rgb[c]) >= 0;
    }
    for (int c = 0; c < t->column_count; ++c) {
        if (is_wavelength(t->column[c]) || !strcmp(t->column[c], "r") || !strcmp(t->column[c], "g") || !strcmp(t->column[c], "b")) {
            r->channel[r->channel_count++] = c;
        }
    }
    if (have > 0 && (have < 3 || r->channel_count > 3)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: channels are either r, g, b (all three) or nm…, not both", t->path);
    }
    if (r->channel_count < 1 || r->channel_count > 256) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: %d channels; expected the columns r,g,b or nm390,nm400,… (at most 256)", t->path, r->channel_count);
    }
    for (int c = 0; have == 3 && c < 3; ++c) { /* in the order r, g, b whatever the file's */
        r->channel[c] = tsuya_table_column(t, rgb[c]);
    }
    return TSUYA_OK;
}

/* Eight or more rows whose polar angles are fractional and all below π/2 were not measured in degrees. */
static tsuya_status check_radians(const reading *r)
{
    const tsuya_table *t = r->table;
    for (int k = 0; k < (r->goniometer ? 2 : 4); ++k) {
        double largest = 0.0;
        int odd = 0;
        for (size_t row = 0; row < t->row_count; ++row) {
            double v = fabs(tsuya_table_at(t, row, r->angle[k]));
            largest = fmax(largest, v);
            odd += fabs(v * 2.0 - round(v * 2.0)) > 1e-6;
        }
        if (t->row_count >= 8 && largest > 0.2 && largest <= 6.2832 && (double)odd > 0.6 * (double)t->row_count && (k % 2 || largest < 1.5709)) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: column %s: no value above %.4g: these look like radians; degrees are expected", t->path,
                              t->column[r->angle[k]], largest);
        }
    }
    return TSUYA_OK;
}

static tsuya_vec3 direction(double theta_deg, double phi_deg)
{
    double t = tsuya_rad_from_deg(theta_deg), p = tsuya_rad_from_deg(phi_deg);
    return (tsuya_vec3){sin(t) * cos(p), sin(t) * sin(p), cos(t)};
}

static tsuya_status row_directions(tsuya_vec3 *wi, tsuya_vec3 *wo, const reading *r, size_t row)
{
    const tsuya_table *t = r->table;
    double a[4] = {0};
    for (int k = 0; k < (r->goniometer ? 2 : 4); ++k) {
        a[k] = tsuya_table_at(t, row, r->angle[k]);
        double limit = r->goniometer ? (k ? 180.0 : 720.0) : (k % 2 ? 720.0 : 180.0);
        if (!(fabs(a[k]) <= limit)) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d, column %s: %g: expected degrees from %g to %g", t->path, t->line[row],
                              t->column[r->angle[k]], a[k], -limit, limit);
        }
    }
    *wi = r->goniometer ? tsuya_goniometer_direction(r->light_deg[0], r->light_deg[1], a[0], a[1]) : direction(a[0], a[1]);
    *wo = r->goniometer ? tsuya_goniometer_direction(r->view_deg[0], r->view_deg[1], a[0], a[1]) : direction(a[2], a[3]);
    return TSUYA_OK;
}

static double brdf_from(const reading *r, int channel, double value, double cosine)
{
    switch (r->quantity) {
    case BRDF: return value;
    case BRDF_COS: return value / cosine;
    case RADIANCE: return value / (r->lamp[channel] * cosine);
    default: return value / M_PI;
    }
}

static tsuya_status read_values(tsuya_samples *s, int to, const reading *r, size_t row)
{
    const tsuya_table *t = r->table;
    for (int c = 0; c < r->channel_count; ++c) {
        double v = tsuya_table_at(t, row, r->channel[c]), *f = &s->value[(size_t)to * (size_t)r->channel_count + (size_t)c];
        if (r->has_clip && v >= r->clip) {
            *f = NAN;
            s->clipped++;
        } else if (v < 0.0 && r->quantity != RADIANCE) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d, column %s: %g: a reflectance is not negative", t->path, t->line[row],
                              t->column[r->channel[c]], v);
        } else {
            *f = brdf_from(r, c, fmax(v, 0.0), s->wi[to].z); /* dark-corrected radiance may fall below zero by noise */
        }
    }
    return TSUYA_OK;
}

static tsuya_status read_rows(tsuya_samples *s, const reading *r)
{
    const double horizon = 1e-6;
    s->count = 0;
    for (size_t row = 0; row < r->table->row_count; ++row) {
        int to = s->count;
        TSUYA_TRY(row_directions(&s->wi[to], &s->wo[to], r, row));
        if (!(s->wi[to].z > horizon && s->wo[to].z > horizon)) {
            s->dropped_below++;
            continue;
        }
        TSUYA_TRY(read_values(s, to, r, row));
        if (s->azimuth_deg) {
            s->azimuth_deg[to] = tsuya_table_at(r->table, row, r->angle[0]);
            s->tilt_deg[to] = tsuya_table_at(r->table, row, r->angle[1]);
        }
        s->count++;
    }
    return TSUYA_OK;
}

static _Thread_local const tsuya_samples *sorted;

static int by_direction(const void *a, const void *b)
{
    int i = *(const int *)a, j = *(const int *)b;
    const double x[6] = {sorted->wi[i].x, sorted->wi[i].y, sorted->wi[i].z, sorted->wo[i].x, sorted->wo[i].y, sorted->wo[i].z};
    const double y[6] = {sorted->wi[j].x, sorted->wi[j].y, sorted->wi[j].z, sorted->wo[j].x, sorted->wo[j].y, sorted->wo[j].z};
    for (int k = 0; k < 6; ++k) {
        if (x[k] != y[k]) {
            return x[k] < y[k] ? -1 : 1;
        }
    }
    return i - j;
}

static bool same_direction(const tsuya_samples *s, int i, int j)
{
    return tsuya_vec3_dot(s->wi[i], s->wi[j]) > 1.0 - 1e-14 && tsuya_vec3_dot(s->wo[i], s->wo[j]) > 1.0 - 1e-14;
}

static tsuya_status count_disagreeing(tsuya_samples *s)
{
    int *order = tsuya_calloc((size_t)s->count, sizeof *order);
    if (!order) {
        return TSUYA_ERROR_MEMORY;
    }
    for (int k = 0; k < s->count; ++k) {
        order[k] = k;
    }
    sorted = s;
    qsort(order, (size_t)s->count, sizeof *order, by_direction);
    for (int k = 1; k < s->count; ++k) {
        bool differs = false;
        for (int c = 0; same_direction(s, order[k - 1], order[k]) && c < s->channel_count; ++c) {
            double a = s->value[order[k - 1] * s->channel_count + c], b = s->value[order[k] * s->channel_count + c];
            differs |= fabs(a - b) > 0.1 * (fabs(a) + fabs(b)) / 2.0;
        }
        s->disagreeing += differs;
    }
    tsuya_free(order);
    return TSUYA_OK;
}

static tsuya_status warn_about(const tsuya_samples *s, const reading *r)
{
    const char *path = r->table->path;
    if (s->count == 0) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: no row has light and viewer above the surface", path);
    }
    if (s->dropped_below) {
        tsuya_warn("%s: %d of %d rows have the light or the viewer under the surface and are left out", path, s->dropped_below, (int)r->table->row_count);
    }
    if (s->clipped) {
        tsuya_warn("%s: %d readings are clipped (>= %g) and are left out", path, s->clipped, r->clip);
    }
    if (s->disagreeing) {
        tsuya_warn("%s: %d repeated directions disagree by more than 10 %%; their mean is fitted", path, s->disagreeing);
    }
    if (s->relative) {
        tsuya_warn("%s: quantity=radiance without irradiance=: the material is known up to one common factor", path);
    }
    return TSUYA_OK;
}

static tsuya_status from_table(tsuya_samples *samples, reading *r)
{
    tsuya_status status = TSUYA_OK;
    const char *names[256];
    TSUYA_TRY(check_keys(r->table));
    TSUYA_TRY(find_columns(r));
    TSUYA_TRY(read_quantity(r));
    if (r->goniometer) {
        TSUYA_TRY(read_geometry(r));
    }
    if (r->table->row_count == 0) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: no rows", r->table->path);
    }
    TSUYA_TRY(check_radians(r));
    for (int c = 0; c < r->channel_count; ++c) {
        names[c] = r->table->column[r->channel[c]];
        if (strlen(names[c]) >= TSUYA_SAMPLES_CHANNEL_SIZE) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: column %.40s: a channel's name has at most %d characters", r->table->path, names[c], TSUYA_SAMPLES_CHANNEL_SIZE - 1);
        }
    }
    TSUYA_TRY(tsuya_samples_create(samples, (int)r->table->row_count, r->channel_count, names));
    samples->relative = r->quantity == RADIANCE && !r->has_irradiance;
    samples->scale_sigma = r->scale_sigma;
    if (r->goniometer) {
        TSUYA_NEW(status, samples->azimuth_deg, r->table->row_count);
        TSUYA_NEW(status, samples->tilt_deg, r->table->row_count);
    }
    TSUYA_GOTO_DONE(status, read_rows(samples, r));
    TSUYA_GOTO_DONE(status, count_disagreeing(samples));
    TSUYA_GOTO_DONE(status, warn_about(samples, r));
    return TSUYA_OK;
done:
    tsuya_samples_free(samples);
    return status;
}

tsuya_status tsuya_samples_parse(tsuya_samples *samples, const char *text, const char *name_for_messages)
{
    static const tsuya_table_options options = {.known = all_columns, .known_name = is_wavelength};
    tsuya_table table = {0};
    *samples = (tsuya_samples){0};
    TSUYA_TRY(tsuya_table_parse(&table, text, name_for_messages, &options));
    reading r = {.table = &table};
    tsuya_status status = TSUYA_ERROR_MEMORY;
    r.channel = tsuya_calloc((size_t)table.column_count, sizeof *r.channel);
    if (r.channel) {
        status = from_table(samples, &r);
    }
    tsuya_free(r.channel);
    tsuya_table_free(&table);
    return status;
}
