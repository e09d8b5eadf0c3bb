#include "brdf/export_loss.h"
#include "brdf/model.h"

#include "core/file.h"

#include <math.h>
#include <string.h>

enum { THETA_H = 90, THETA_D = 90, PHI_D = 180, CELLS = THETA_H * THETA_D * PHI_D, TURNS = 24 };
static const double scale[3] = {1.0 / 1500.0, 1.15 / 1500.0, 1.66 / 1500.0};

/* Cells are equal in √θh, in θd and in φd < 180° (reciprocity gives the rest); a reader takes the cell that a direction falls into. */
static void cell_directions(tsuya_vec3 *wi, tsuya_vec3 *wo, int h, int d, int p, double turn)
{
    double th = 0.5 * M_PI * pow((h + 0.5) / THETA_H, 2.0), td = 0.5 * M_PI * (d + 0.5) / THETA_D, pd = M_PI * (p + 0.5) / PHI_D;
    tsuya_vec3 normal = {sin(th) * cos(turn), sin(th) * sin(turn), cos(th)}, t = {cos(th) * cos(turn), cos(th) * sin(turn), -sin(th)}, b = {-sin(turn), cos(turn), 0};
    tsuya_vec3 x = tsuya_vec3_add(tsuya_vec3_scale(t, cos(pd)), tsuya_vec3_scale(b, sin(pd)));
    *wi = tsuya_vec3_mad(tsuya_vec3_scale(normal, cos(td)), sin(td), x);
    *wo = tsuya_vec3_mad(tsuya_vec3_scale(normal, cos(td)), -sin(td), x);
}

static void fill(double *table, const tsuya_material *m)
{
#pragma omp parallel for schedule(dynamic, 1)
    for (int h = 0; h < THETA_H; ++h) {
        for (int k = 0; k < THETA_D * PHI_D; ++k) {
            double value[3], sum[3] = {0.0, 0.0, 0.0};
            for (int t = 0; t < TURNS; ++t) {
                tsuya_vec3 wi, wo;
                cell_directions(&wi, &wo, h, k / PHI_D, k % PHI_D, 2.0 * M_PI * (t + 0.5) / TURNS);
                tsuya_material_eval(m, NULL, wi, wo, value);
                for (int c = 0; c < 3; ++c) {
                    sum[c] += value[c] / TURNS;
                }
            }
            for (int c = 0; c < 3; ++c) {
                table[(size_t)c * CELLS + (size_t)h * THETA_D * PHI_D + (size_t)k] = sum[c] / scale[c];
            }
        }
    }
}

static void look_up(double *value, const void *user, tsuya_vec3 wi, tsuya_vec3 wo)
{
    const double *table = user;
    tsuya_vec3 h = tsuya_vec3_unit(tsuya_vec3_add(wi, wo));
    double th = acos(fmin(h.z, 1.0)), ph = atan2(h.y, h.x), x = cos(ph) * wi.x + sin(ph) * wi.y, y = cos(ph) * wi.y - sin(ph) * wi.x;
    double across = cos(th) * x - sin(th) * wi.z, td = acos(fmin(tsuya_vec3_dot(wi, h), 1.0)), pd = atan2(y, across);
    pd += pd < 0.0 ? M_PI : 0.0;
    int i = (int)fmin(sqrt(th / (0.5 * M_PI)) * THETA_H, THETA_H - 1), j = (int)fmin(td / (0.5 * M_PI) * THETA_D, THETA_D - 1), k = (int)fmin(pd / M_PI * PHI_D, PHI_D - 1);
    for (int c = 0; c < 3; ++c) {
        value[c] = table[(size_t)c * CELLS + ((size_t)i * THETA_D + (size_t)j) * PHI_D + (size_t)k] * scale[c];
    }
}

tsuya_status tsuya_export_merl(tsuya_export_loss *loss, const char *path, const tsuya_material *m)
{
    const int32_t size[3] = {THETA_H, THETA_D, PHI_D};
    if (m->channel_count != 3 || strcmp(m->channel[0], "r") != 0) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: MERL tables hold r, g, b; the material has %d channels from %s", path, m->channel_count, m->channel[0]);
    }
    double *table = tsuya_calloc(3 * CELLS, sizeof *table);
    if (!table) {
        return TSUYA_ERROR_MEMORY;
    }
    tsuya_file_writer w = {0};
    tsuya_status status;
    fill(table, m);
    TSUYA_GOTO_DONE(status, tsuya_export_measure(loss, m, look_up, table));
    TSUYA_GOTO_DONE(status, tsuya_file_begin(&w, path));
    fwrite(size, sizeof size, 1, w.stream);
    fwrite(table, sizeof *table, 3 * CELLS, w.stream);
    status = tsuya_file_commit(&w);
    loss->bytes = sizeof size + 3.0 * CELLS * sizeof *table;
done:
    tsuya_free(table);
    return status;
}
