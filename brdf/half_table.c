#include "brdf/half_table.h"

#include "brdf/sampling.h"
#include "core/memory.h"

enum { PHI_CELLS = 48, THETA_CELLS = 40, SUB = 3 };
static const double cosine_share = 0.1 * TSUYA_HALF_COSINE_TENTHS;

/* Equal steps of θh; the cell's solid angle Δφ (cosθ₀ − cosθ₁) turns its share into a density. */
static double edge_cosine(const tsuya_half_table *t, int i) { return i >= t->theta_cells ? 0.0 : cos(0.5 * M_PI * i / t->theta_cells); }

static double cell_mean(double (*density)(const void *, tsuya_vec3), const void *user, const tsuya_half_table *t, int i, int j)
{
    double sum = 0.0;
    for (int k = 0; k < SUB * SUB; ++k) {
        double theta = 0.5 * M_PI * (i + (k / SUB + 0.5) / SUB) / t->theta_cells, phi = 2.0 * M_PI * (j + (k % SUB + 0.5) / SUB) / t->phi_cells;
        double d = density(user, (tsuya_vec3){sin(theta) * cos(phi), sin(theta) * sin(phi), cos(theta)});
        sum += d > 0.0 && isfinite(d) ? d * cos(theta) : 0.0;
    }
    return sum / (SUB * SUB);
}

static void fill(tsuya_half_table *t, double (*density)(const void *, tsuya_vec3), const void *user)
{
    double total = 0.0;
    for (int i = 0; i < t->theta_cells; ++i) {
        float *row = t->conditional + i * (t->phi_cells + 1);
        double sum = 0.0, area = edge_cosine(t, i) - edge_cosine(t, i + 1);
        for (int j = 0; j < t->phi_cells; ++j) {
            sum += cell_mean(density, user, t, i, j);
            row[j + 1] = (float)sum;
        }
        for (int j = 0; j <= t->phi_cells; ++j) {
            row[j] = sum > 0.0 ? (float)(row[j] / sum) : (float)j / (float)t->phi_cells;
        }
        row[t->phi_cells] = 1.0f;
        total += sum * area;
        t->marginal[i + 1] = (float)total;
    }
    for (int i = 0; i <= t->theta_cells; ++i) {
        t->marginal[i] = total > 0.0 ? (float)(t->marginal[i] / total) : (float)i / (float)t->theta_cells;
    }
    t->marginal[t->theta_cells] = 1.0f;
    for (int k = 0; k < t->theta_cells * t->phi_cells; ++k) {
        int i = k / t->phi_cells;
        const float *row = t->conditional + i * (t->phi_cells + 1) + k % t->phi_cells;
        double share = (double)(t->marginal[i + 1] - t->marginal[i]) * (double)(row[1] - row[0]);
        t->density[k] = (float)(share * t->phi_cells / (2.0 * M_PI * (edge_cosine(t, i) - edge_cosine(t, i + 1))));
    }
}

tsuya_status tsuya_half_table_create(tsuya_half_table **table, double (*density)(const void *user, tsuya_vec3 h), const void *user)
{
    tsuya_status status = TSUYA_OK;
    tsuya_half_table *t;
    *table = NULL;
    TSUYA_NEW(status, t, 1);
    t->phi_cells = PHI_CELLS;
    t->theta_cells = THETA_CELLS;
    TSUYA_NEW(status, t->marginal, THETA_CELLS + 1);
    TSUYA_NEW(status, t->conditional, THETA_CELLS * (PHI_CELLS + 1));
    TSUYA_NEW(status, t->density, THETA_CELLS * PHI_CELLS);
    TSUYA_NEW(status, t->edge, THETA_CELLS + 1);
    for (int i = 0; i <= THETA_CELLS; ++i) {
        t->edge[i] = (float)edge_cosine(t, i);
    }
    fill(t, density, user);
    *table = t;
    return TSUYA_OK;
done:
    tsuya_half_table_free(t);
    return status;
}

void tsuya_half_table_free(tsuya_half_table *table)
{
    if (table) {
        tsuya_free(table->marginal);
        tsuya_free(table->conditional);
        tsuya_free(table->density);
        tsuya_free(table->edge);
        tsuya_free(table);
    }
}

size_t tsuya_half_table_bytes(const tsuya_half_table *t)
{
    return sizeof *t + sizeof(float) * (size_t)(2 * (t->theta_cells + 1) + t->theta_cells * (2 * t->phi_cells + 1));
}

static double half_density(const tsuya_half_table *t, tsuya_vec3 h)
{
    double phi = atan2(h.y, h.x), turn = phi / (2.0 * M_PI) + (phi < 0.0 ? 1.0 : 0.0);
    int i = (int)(atan2(sqrt(h.x * h.x + h.y * h.y), h.z) / (0.5 * M_PI) * t->theta_cells), j = (int)(turn * t->phi_cells);
    i = i < t->theta_cells ? i : t->theta_cells - 1;
    j = j < t->phi_cells ? j : t->phi_cells - 1;
    return (double)t->density[i * t->phi_cells + j];
}

double tsuya_half_table_pdf(const tsuya_half_table *t, tsuya_vec3 wi, tsuya_vec3 wo)
{
    tsuya_vec3 h = tsuya_vec3_unit(tsuya_vec3_add(wi, wo));
    double cosine = tsuya_vec3_dot(wo, h);
    return cosine_share * wi.z / M_PI + (1.0 - cosine_share) * half_density(t, h) / (4.0 * fmax(cosine, 1e-12));
}

/* The interval of a cumulative table that holds u, and the place in it. */
static int find(const float *cumulative, int cells, double u, double *fraction)
{
    int low = 0, high = cells;
    while (high - low > 1) {
        int middle = (low + high) / 2;
        if (u < (double)cumulative[middle]) {
            high = middle;
        } else {
            low = middle;
        }
    }
    double width = (double)(cumulative[low + 1] - cumulative[low]);
    *fraction = width > 0.0 ? fmin(fmax((u - (double)cumulative[low]) / width, 0.0), 1.0) : 0.5;
    return low;
}

tsuya_vec3 tsuya_half_table_draw(const tsuya_half_table *t, const double u[2])
{
    double a, b;
    int i = find(t->marginal, t->theta_cells, u[0], &a);
    int j = find(t->conditional + i * (t->phi_cells + 1), t->phi_cells, u[1], &b);
    double z = edge_cosine(t, i) + a * (edge_cosine(t, i + 1) - edge_cosine(t, i)), r = sqrt(fmax(0.0, 1.0 - z * z));
    double phi = 2.0 * M_PI * (j + b) / t->phi_cells;
    return (tsuya_vec3){r * cos(phi), r * sin(phi), z};
}

bool tsuya_half_table_sample(const tsuya_half_table *t, tsuya_vec3 wo, const double u[2], tsuya_vec3 *wi)
{
    if (u[0] < cosine_share) {
        *wi = tsuya_sample_cosine(u[0] / cosine_share, u[1]);
        return wi->z > 0.0;
    }
    tsuya_vec3 h = tsuya_half_table_draw(t, (const double[2]){(u[0] - cosine_share) / (1.0 - cosine_share), u[1]});
    double cosine = tsuya_vec3_dot(wo, h);
    if (!(cosine > 0.0)) {
        return false;
    }
    *wi = tsuya_vec3_unit(tsuya_vec3_mad(tsuya_vec3_scale(wo, -1.0), 2.0 * cosine, h));
    return wi->z > 0.0;
}
