#include "brdf/measured_bsdf.h"

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_TENSORS = 32, MOST_SIDES = 6 };

typedef struct tensor {
    char name[64];
    unsigned sides;
    uint64_t side[MOST_SIDES], elements, offset;
    int type; /* 1 uint8, 10 float32 */
    float *number; /* of float32 */
    uint8_t *byte; /* of uint8 */
} tensor;

struct measured_bsdf {
    tensor all[MOST_TENSORS];
    int count;
    const tensor *phi, *theta, *sigma, *ndf, *vndf, *luminance, *value, *nm;
    bool isotropic, jacobian;
};

static bool read_tensor(tensor *t, FILE *f)
{
    uint16_t length, sides;
    uint8_t type;
    if (fread(&length, 2, 1, f) != 1 || length >= sizeof t->name || fread(t->name, 1, length, f) != length || fread(&sides, 2, 1, f) != 1 || sides > MOST_SIDES ||
        fread(&type, 1, 1, f) != 1 || fread(&t->offset, 8, 1, f) != 1 || fread(t->side, 8, sides, f) != sides) {
        return false;
    }
    t->sides = sides;
    t->type = type;
    t->elements = 1;
    for (unsigned k = 0; k < sides; ++k) {
        t->elements *= t->side[k];
    }
    return true;
}

static bool read_data(tensor *t, FILE *f)
{
    if (t->type != 10 && t->type != 1) {
        return true; /* version numbers and the like */
    }
    size_t size = t->type == 10 ? 4 : 1;
    void *data = malloc(t->elements * size + 1);
    *(t->type == 10 ? (void **)&t->number : (void **)&t->byte) = data;
    return data && fseek(f, (long)t->offset, SEEK_SET) == 0 && fread(data, size, t->elements, f) == t->elements;
}

static bool read_file(measured_bsdf *b, FILE *f)
{
    char magic[12];
    uint8_t version[2];
    uint32_t count;
    if (fread(magic, 1, 12, f) != 12 || memcmp(magic, "tensor_file\0", 12) != 0 || fread(version, 1, 2, f) != 2 || version[0] != 1 || version[1] != 0 ||
        fread(&count, 4, 1, f) != 1 || count > MOST_TENSORS) {
        return false;
    }
    for (uint32_t k = 0; k < count; ++k) {
        if (!read_tensor(&b->all[k], f)) {
            return false;
        }
        b->count++;
    }
    for (uint32_t k = 0; k < count; ++k) {
        if (!read_data(&b->all[k], f)) {
            return false;
        }
    }
    return true;
}

static const tensor *find(const measured_bsdf *b, const char *name, int type, unsigned sides)
{
    for (int k = 0; k < b->count; ++k) {
        if (strcmp(b->all[k].name, name) == 0 && b->all[k].type == type && b->all[k].sides == sides) {
            return &b->all[k];
        }
    }
    return NULL;
}

/* What renderers demand before they take a file. */
static bool check(measured_bsdf *b)
{
    const tensor *description = find(b, "description", 1, 1), *jacobian = find(b, "jacobian", 1, 1);
    b->nm = find(b, "wavelengths", 10, 1);
    b->phi = find(b, "phi_i", 10, 1);
    b->theta = find(b, "theta_i", 10, 1);
    b->sigma = find(b, "sigma", 10, 2);
    b->ndf = find(b, "ndf", 10, 2);
    b->vndf = find(b, "vndf", 10, 4);
    b->luminance = find(b, "luminance", 10, 4);
    b->value = find(b, b->nm ? "spectra" : "rgb", 10, 5);
    if (!description || !jacobian || !b->phi || !b->theta || !b->sigma || !b->ndf || !b->vndf || !b->luminance || !b->value || jacobian->side[0] != 1) {
        return false;
    }
    uint64_t turns = b->phi->side[0], tilts = b->theta->side[0];
    b->isotropic = turns <= 2;
    b->jacobian = jacobian->byte[0];
    double span = (double)(b->phi->number[turns - 1] - b->phi->number[0]);
    return b->vndf->side[0] == turns && b->vndf->side[1] == tilts && b->luminance->side[0] == turns && b->luminance->side[1] == tilts &&
           b->luminance->side[2] == b->luminance->side[3] && b->value->side[0] == turns && b->value->side[1] == tilts &&
           b->value->side[2] == (b->nm ? b->nm->side[0] : 3) && b->value->side[3] == b->luminance->side[2] && b->value->side[4] == b->luminance->side[3] &&
           (b->isotropic || fabs(2.0 * M_PI / span - 1.0) < 0.25);
}

measured_bsdf *measured_bsdf_open(const char *path)
{
    measured_bsdf *b = calloc(1, sizeof *b);
    FILE *f = fopen(path, "rb");
    bool ok = b && f && read_file(b, f) && check(b);
    if (f) {
        fclose(f);
    }
    if (!ok) {
        fprintf(stderr, "%s: no measured BRDF\n", path);
        measured_bsdf_close(b);
        return NULL;
    }
    return b;
}

void measured_bsdf_close(measured_bsdf *b)
{
    for (int k = 0; b && k < b->count; ++k) {
        free(b->all[k].number);
        free(b->all[k].byte);
    }
    free(b);
}

int measured_bsdf_channels(const measured_bsdf *b) { return (int)b->value->side[2]; }
const float *measured_bsdf_wavelengths(const measured_bsdf *b) { return b->nm ? b->nm->number : NULL; }

/* Lower neighbour and the upper one's share on ascending nodes. */
typedef struct place {
    uint64_t low, high;
    double share;
} place;

static place on_nodes(const tensor *nodes, double x)
{
    uint64_t n = nodes->side[0], k = 0;
    if (n == 1) {
        return (place){0, 0, 0.0};
    }
    while (k + 2 < n && (double)nodes->number[k + 1] <= x) {
        k++;
    }
    double a = (double)nodes->number[k], d = (double)nodes->number[k + 1] - a;
    return (place){k, k + 1, fmin(fmax((x - a) / d, 0.0), 1.0)};
}

static place on_grid(uint64_t n, double x)
{
    double at = fmin(fmax(x, 0.0), 1.0) * (double)(n - 1);
    uint64_t k = (uint64_t)fmin(at, (double)(n - 2));
    return (place){k, k + 1, at - (double)k};
}

static double mix(double a, double b, double share) { return a + share * (b - a); }

static double on_square(const tensor *t, uint64_t first, double x, double y)
{
    uint64_t w = t->side[t->sides - 1], h = t->side[t->sides - 2];
    place i = on_grid(w, x), j = on_grid(h, y);
    const float *v = t->number + first;
    return mix(mix((double)v[j.low * w + i.low], (double)v[j.low * w + i.high], i.share), mix((double)v[j.high * w + i.low], (double)v[j.high * w + i.high], i.share), j.share);
}

typedef struct lookup {
    place turn, tilt;
    double x, y;             /* of the half vector */
    double square[2];        /* where the values stand for it */
    double u_light[2];
    double theta_h, theta_d;
} lookup;

/* The density `vndf` between the four incidences, at a node. */
static double density(const measured_bsdf *b, const lookup *q, uint64_t j, uint64_t i)
{
    const tensor *t = b->vndf;
    uint64_t tilts = t->side[1], h = t->side[2], w = t->side[3], node = j * w + i;
    const float *v = t->number;
    double a = mix((double)v[(q->turn.low * tilts + q->tilt.low) * h * w + node], (double)v[(q->turn.low * tilts + q->tilt.high) * h * w + node], q->tilt.share);
    double c = mix((double)v[(q->turn.high * tilts + q->tilt.low) * h * w + node], (double)v[(q->turn.high * tilts + q->tilt.high) * h * w + node], q->tilt.share);
    return mix(a, c, q->turn.share);
}

/* Share of the integral of a piecewise linear density that lies below x. */
static double share_below(const double *node, uint64_t n, double x)
{
    place p = on_grid(n, x);
    double below = 0.0, all = 0.0;
    for (uint64_t k = 0; k + 1 < n; ++k) {
        double cell = 0.5 * (node[k] + node[k + 1]);
        below += k < p.low ? cell : 0.0;
        all += cell;
    }
    below += p.share * node[p.low] + 0.5 * p.share * p.share * (node[p.high] - node[p.low]);
    return all > 0.0 ? below / all : x;
}

/* The inverse of the warp: rows first, then along the row. */
static void unwarp(double to[2], double *at, const measured_bsdf *b, const lookup *q)
{
    uint64_t h = b->vndf->side[2], w = b->vndf->side[3];
    double *rows = calloc(h + w, sizeof *rows), *line = rows + h, all = 0.0;
    place j = on_grid(h, q->y), i = on_grid(w, q->x);
    for (uint64_t r = 0; r < h; ++r) {
        for (uint64_t c = 0; c + 1 < w; ++c) {
            rows[r] += 0.5 * (density(b, q, r, c) + density(b, q, r, c + 1)) / (double)(w - 1);
        }
        all += rows[r] * (r == 0 || r == h - 1 ? 0.5 : 1.0) / (double)(h - 1);
    }
    for (uint64_t c = 0; c < w; ++c) {
        line[c] = mix(density(b, q, j.low, c), density(b, q, j.high, c), j.share);
    }
    to[0] = share_below(line, w, q->x);
    to[1] = share_below(rows, h, q->y);
    *at = all > 0.0 ? mix(line[i.low], line[i.high], i.share) / all : 0.0;
    free(rows);
}

static lookup look_up(double *vndf, const measured_bsdf *b, tsuya_vec3 wi, tsuya_vec3 wo)
{
    lookup q;
    tsuya_vec3 h = tsuya_vec3_unit(tsuya_vec3_add(wi, wo));
    double phi_i = atan2(wi.y, wi.x), theta_i = acos(fmin(wi.z, 1.0)), phi_h = atan2(h.y, h.x) - (b->isotropic ? phi_i : 0.0);
    q.theta_h = acos(fmin(h.z, 1.0));
    q.theta_d = acos(fmin(tsuya_vec3_dot(wi, h), 1.0));
    q.x = sqrt(q.theta_h * 2.0 / M_PI);
    q.y = (phi_h + M_PI) / (2.0 * M_PI);
    q.y -= floor(q.y);
    q.u_light[0] = sqrt(theta_i * 2.0 / M_PI);
    q.u_light[1] = (phi_i + M_PI) / (2.0 * M_PI);
    q.turn = b->isotropic ? (place){0, 0, 0.0} : on_nodes(b->phi, phi_i);
    q.tilt = on_nodes(b->theta, theta_i);
    unwarp(q.square, vndf, b, &q);
    return q;
}

static double between_incidences(const tensor *t, const lookup *q, uint64_t channel, uint64_t channels)
{
    uint64_t tilts = t->side[1], cell = t->side[t->sides - 1] * t->side[t->sides - 2], at[4];
    const uint64_t turn[4] = {q->turn.low, q->turn.low, q->turn.high, q->turn.high}, tilt[4] = {q->tilt.low, q->tilt.high, q->tilt.low, q->tilt.high};
    double v[4];
    for (int k = 0; k < 4; ++k) {
        at[k] = ((turn[k] * tilts + tilt[k]) * channels + channel) * cell;
        v[k] = on_square(t, at[k], q->square[0], q->square[1]);
    }
    return mix(mix(v[0], v[1], q->tilt.share), mix(v[2], v[3], q->tilt.share), q->turn.share);
}

void measured_bsdf_eval(double *value, const measured_bsdf *b, tsuya_vec3 wi, tsuya_vec3 wo)
{
    uint64_t channels = b->value->side[2];
    double vndf;
    lookup q = look_up(&vndf, b, wi, wo);
    double factor = b->jacobian ? on_square(b->ndf, 0, q.x, q.y) / (4.0 * on_square(b->sigma, 0, q.u_light[0], q.u_light[1])) : 1.0;
    for (uint64_t c = 0; c < channels; ++c) {
        value[c] = fmax(0.0, between_incidences(b->value, &q, c, channels)) * factor / wo.z;
    }
}

double measured_bsdf_pdf(const measured_bsdf *b, tsuya_vec3 wi, tsuya_vec3 wo)
{
    double vndf, all = 0.0;
    lookup q = look_up(&vndf, b, wi, wo), node = q;
    uint64_t n = b->luminance->side[2];
    for (uint64_t k = 0; k < n * n; ++k) { /* its own integral over the square */
        uint64_t i = k % n, j = k / n;
        node.square[0] = (double)i / (double)(n - 1);
        node.square[1] = (double)j / (double)(n - 1);
        double weight = (i == 0 || i == n - 1 ? 0.5 : 1.0) * (j == 0 || j == n - 1 ? 0.5 : 1.0) / (double)((n - 1) * (n - 1));
        all += weight * between_incidences(b->luminance, &node, 0, 1);
    }
    double area = fmax(2.0 * M_PI * M_PI * q.x * sin(q.theta_h), 1e-6) * 4.0 * cos(q.theta_d);
    return between_incidences(b->luminance, &q, 0, 1) / all * vndf / area;
}
