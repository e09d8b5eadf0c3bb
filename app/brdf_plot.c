#include "app/brdf_plot.h"

#include "core/memory.h"
#include "core/order.h"
#include "core/table.h"

#include <math.h>
#include <string.h>

static const double nearness_deg = 2.0;

tsuya_plot_bench tsuya_plot_bench_default(void) { return (tsuya_plot_bench){{30.0, 0.0}, {30.0, 180.0}}; }

/* Lab direction of a direction in the sample's frame: the stage's turn and tilt undone. */
static void lab_angles(double angles_deg[2], tsuya_vec3 w, double azimuth_deg, double tilt_deg)
{
    double a = tsuya_rad_from_deg(azimuth_deg), t = tsuya_rad_from_deg(tilt_deg);
    double x = cos(a) * w.x + sin(a) * w.y, y = cos(a) * w.y - sin(a) * w.x;
    tsuya_vec3 lab = {cos(t) * x + sin(t) * w.z, y, cos(t) * w.z - sin(t) * x};
    angles_deg[0] = tsuya_deg_from_rad(atan2(hypot(lab.x, lab.y), lab.z));
    angles_deg[1] = tsuya_deg_from_rad(atan2(lab.y, lab.x));
}

bool tsuya_plot_bench_of(tsuya_plot_bench *bench, const tsuya_samples *s)
{
    if (!s->azimuth_deg || s->count == 0) {
        return false;
    }
    lab_angles(bench->light_deg, s->wi[0], s->azimuth_deg[0], s->tilt_deg[0]);
    lab_angles(bench->view_deg, s->wo[0], s->azimuth_deg[0], s->tilt_deg[0]);
    return true;
}

static tsuya_vec3 light(const tsuya_plot_bench *b, double a, double t) { return tsuya_goniometer_direction(b->light_deg[0], b->light_deg[1], a, t); }
static tsuya_vec3 view(const tsuya_plot_bench *b, double a, double t) { return tsuya_goniometer_direction(b->view_deg[0], b->view_deg[1], a, t); }

static bool near(tsuya_vec3 a, tsuya_vec3 b) { return tsuya_vec3_dot(a, b) >= cos(tsuya_rad_from_deg(nearness_deg)); }

/* The stage's position that would give these directions: with lamp and camera in the plane of the tilt, the half vector's tilt and
 * azimuth say it, or the light's azimuth where the half vector is the normal. */
static bool place(double *azimuth_deg, double *tilt_deg, const tsuya_plot_bench *b, tsuya_vec3 wi, tsuya_vec3 wo)
{
    tsuya_vec3 lab = tsuya_vec3_add(light(b, 0, 0), view(b, 0, 0)), h = tsuya_vec3_add(wi, wo);
    double rest = tsuya_deg_from_rad(atan2(lab.x, lab.z)), across = hypot(h.x, h.y), theta = tsuya_deg_from_rad(atan2(across, h.z));
    tsuya_vec3 lead = across > 1e-6 ? h : wi;
    double first = tsuya_deg_from_rad(atan2(lead.y, lead.x));
    for (int k = 0; k < 4; ++k) { /* the half vector ahead or behind, from either side */
        double a = first + 180.0 * (k & 1), t = rest - (k == 1 || k == 2 ? -theta : theta);
        if (near(light(b, a, t), wi) && near(view(b, a, t), wo)) {
            *azimuth_deg = fmod(a + 720.0, 360.0);
            *tilt_deg = t;
            return true;
        }
    }
    return false;
}

static int find_channel(int count, const char *name, const char *(*at)(const void *, int), const void *of)
{
    for (int c = 0; c < count; ++c) {
        if (strcmp(at(of, c), name) == 0) {
            return c;
        }
    }
    return -1;
}

static const char *material_name(const void *m, int c) { return tsuya_material_get_info(m).channel[c]; }
static const char *sample_name(const void *s, int c) { return ((const tsuya_samples *)s)->channel[c]; }

static tsuya_status choose_channel(tsuya_plot_data *d, const tsuya_brdf_picture *p)
{
    int material = p->material ? tsuya_material_get_info(p->material).channel_count : 0, samples = p->samples ? p->samples->channel_count : 0;
    const char *name = p->channel;
    if (!name) {
        bool green = (material && find_channel(material, "g", material_name, p->material) >= 0) ||
                     (!material && find_channel(samples, "g", sample_name, p->samples) >= 0);
        name = green ? "g" : material ? material_name(p->material, material / 2) : sample_name(p->samples, samples / 2);
    }
    d->material_channel = find_channel(material, name, material_name, p->material);
    d->sample_channel = find_channel(samples, name, sample_name, p->samples);
    if (d->material_channel < 0 && d->sample_channel < 0) {
        const char *first = material ? material_name(p->material, 0) : sample_name(p->samples, 0);
        const char *last = material ? material_name(p->material, material - 1) : sample_name(p->samples, samples - 1);
        return tsuya_fail(TSUYA_ERROR_INPUT, "channel '%s' is not there; the channels go from %s to %s", name, first, last);
    }
    d->channel = d->material_channel >= 0 ? material_name(p->material, d->material_channel) : sample_name(p->samples, d->sample_channel);
    return TSUYA_OK;
}

static void gather_points(tsuya_plot_data *d, const tsuya_brdf_picture *p)
{
    const tsuya_samples *s = p->samples;
    for (int k = 0; k < s->count; ++k) {
        double value = s->value[(size_t)k * (size_t)s->channel_count + (size_t)d->sample_channel], a, t;
        if (!isfinite(value)) {
            continue;
        }
        if (s->azimuth_deg) {
            a = fmod(fmod(s->azimuth_deg[k], 360.0) + 360.0, 360.0);
            t = s->tilt_deg[k];
        } else if (!place(&a, &t, &p->bench, s->wi[k], s->wo[k])) {
            d->left_out++;
            continue;
        }
        bool back = a >= 180.0 - 1e-9 && fabs(p->bench.light_deg[0] - p->bench.view_deg[0]) < 0.5; /* the same facet from the other side */
        /* lamp and camera change places there: f stays, the cosine is the other one's */
        d->point[d->count++] = (tsuya_plot_point){back ? a - 180.0 : a, back ? -t : t, value * (back ? s->wo[k].z : s->wi[k].z)};
    }
}

static tsuya_status choose_curves(tsuya_plot_data *d)
{
    static const double usual[] = {0, 45, 90, 135};
    double *sorted = tsuya_calloc((size_t)d->count + 1, sizeof *sorted);
    int unique = 0;
    if (!sorted) {
        return TSUYA_ERROR_MEMORY;
    }
    d->tilt_deg[0] = INFINITY;
    d->tilt_deg[1] = -INFINITY;
    for (int k = 0; k < d->count; ++k) {
        sorted[k] = d->point[k].azimuth_deg;
        d->tilt_deg[0] = fmin(d->tilt_deg[0], d->point[k].tilt_deg);
        d->tilt_deg[1] = fmax(d->tilt_deg[1], d->point[k].tilt_deg);
    }
    tsuya_sort_doubles(sorted, (size_t)d->count);
    for (int k = 0; k < d->count; ++k) {
        if (unique == 0 || sorted[k] - sorted[unique - 1] > 0.05) {
            sorted[unique++] = sorted[k];
        }
    }
    d->azimuths = unique == 0 ? 4 : unique < TSUYA_PLOT_AZIMUTHS ? unique : TSUYA_PLOT_AZIMUTHS;
    for (int k = 0; k < d->azimuths; ++k) {
        d->azimuth_deg[k] = unique == 0 ? usual[k] : sorted[(size_t)k * (size_t)unique / (size_t)d->azimuths];
    }
    if (d->count == 0 || d->tilt_deg[1] - d->tilt_deg[0] < 1.0) {
        d->tilt_deg[0] = -57.0;
        d->tilt_deg[1] = 57.0;
    }
    tsuya_free(sorted);
    return TSUYA_OK;
}

tsuya_status tsuya_plot_data_create(tsuya_plot_data *data, const tsuya_brdf_picture *picture)
{
    *data = (tsuya_plot_data){.sample_channel = -1, .material_channel = -1};
    TSUYA_TRY(choose_channel(data, picture));
    if (data->sample_channel >= 0) {
        data->point = tsuya_calloc((size_t)picture->samples->count, sizeof *data->point);
        if (!data->point) {
            return TSUYA_ERROR_MEMORY;
        }
        gather_points(data, picture);
    }
    tsuya_status status = choose_curves(data);
    if (status != TSUYA_OK) {
        tsuya_plot_data_free(data);
    }
    return status;
}

void tsuya_plot_data_free(tsuya_plot_data *data)
{
    tsuya_free(data->point);
    *data = (tsuya_plot_data){0};
}
