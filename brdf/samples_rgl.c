/* RGL tensor files (.bsdf) as samples.
 *
 * J. Dupuy, W. Jakob, "An Adaptive Parameterization for Efficient Material Acquisition and Rendering", ACM TOG 37(6), 2018.  For each
 * incidence (φi, θi) the values stand on a square whose points u are warped by the distribution `vndf` into the half vector's
 * (√(2θh/π), (φh + π)/2π); with isotropic tables φh counts from φi.  There f cosθo = value · ndf(h) / (4 σ(wi)), where the
 * file's `jacobian` is set, and the value itself where it is not.  Samples are the square's nodes; isotropic ones stand at four azimuths. */
#include "brdf/samples_internal.h"

#include "core/memory.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { FIELDS = 64, DIMENSIONS = 8, U8 = 1, F32 = 10, TYPES = 12, MOST_CHANNELS = 256, MOST_SAMPLES = 1 << 24, TURNS = 4 };
static const unsigned char type_size[TYPES] = {0, 1, 1, 2, 2, 4, 4, 8, 8, 2, 4, 8};

typedef struct field {
    char name[32];
    int type, dimensions;
    size_t shape[DIMENSIONS];
    const char *data;
} field;

typedef struct tensor_file {
    const char *name, *bytes;
    size_t size, at;
    field field[FIELDS];
    int count;
} tensor_file;

static bool take(tensor_file *t, void *to, size_t size)
{
    if (size > t->size - t->at) {
        return false;
    }
    memcpy(to, t->bytes + t->at, size);
    t->at += size;
    return true;
}

static tsuya_status read_field(tensor_file *t, field *f)
{
    uint16_t length, dimensions;
    uint8_t type;
    uint64_t offset, side;
    size_t elements = 1;
    if (!take(t, &length, 2) || length == 0 || length >= sizeof f->name || !take(t, f->name, length) || !take(t, &dimensions, 2) ||
        dimensions < 1 || dimensions > DIMENSIONS || !take(t, &type, 1) || type == 0 || type >= TYPES || !take(t, &offset, 8)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: tensor %d: no valid name, type and offset", t->name, t->count + 1);
    }
    for (int d = 0; d < dimensions; ++d) {
        if (!take(t, &side, 8) || side == 0 || side > t->size || elements > t->size / side) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: tensor %s: a shape that the file cannot hold", t->name, f->name);
        }
        f->shape[d] = (size_t)side;
        elements *= (size_t)side;
    }
    if (offset > t->size || elements > (t->size - (size_t)offset) / type_size[type]) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: tensor %s: its data lie beyond the end of the file", t->name, f->name);
    }
    f->type = type;
    f->dimensions = dimensions;
    f->data = t->bytes + offset;
    for (size_t k = 0; type == F32 && k < elements; ++k) {
        float v;
        memcpy(&v, f->data + 4 * k, 4);
        if (!isfinite(v)) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: tensor %s: element %zu is not a finite number", t->name, f->name, k);
        }
    }
    return TSUYA_OK;
}

static tsuya_status read_header(tensor_file *t)
{
    char magic[12];
    uint8_t version[2];
    uint32_t count;
    if (!take(t, magic, 12) || memcmp(magic, "tensor_file", 12) != 0 || !take(t, version, 2) || version[0] != 1 || !take(t, &count, 4) || count < 1 ||
        count > FIELDS) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: no RGL tensor file of version 1 with at most %d tensors", t->name, FIELDS);
    }
    for (; t->count < (int)count; ++t->count) {
        TSUYA_TRY(read_field(t, &t->field[t->count]));
    }
    return TSUYA_OK;
}

static const field *find(const tensor_file *t, const char *name)
{
    for (int k = 0; k < t->count; ++k) {
        if (strcmp(t->field[k].name, name) == 0) {
            return &t->field[k];
        }
    }
    return NULL;
}

static double at(const field *f, size_t k)
{
    float v;
    memcpy(&v, f->data + 4 * k, 4);
    return v;
}

typedef struct measured {
    const field *phi, *theta, *sigma, *ndf, *vndf, *value, *nm;
    size_t side_y, side_x, warp_y, warp_x, channels;
    bool jacobian;
} measured;

static tsuya_status get(const field **f, const tensor_file *t, const char *name, int dimensions)
{
    *f = find(t, name);
    if (!*f || (*f)->type != F32 || (*f)->dimensions != dimensions) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: expected a tensor %s of %d dimensions in float32", t->name, name, dimensions);
    }
    return TSUYA_OK;
}

static tsuya_status check_angles(const tensor_file *t, const field *f, double low, double high)
{
    for (size_t k = 0; k < f->shape[0]; ++k) {
        if (!(at(f, k) >= low - 1e-5 && at(f, k) <= high + 1e-5)) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: tensor %s: element %zu is %g; expected radians from %.4g to %.4g", t->name, f->name, k, at(f, k), low, high);
        }
    }
    return TSUYA_OK;
}

static tsuya_status gather(measured *m, const tensor_file *t)
{
    const field *jacobian = find(t, "jacobian");
    TSUYA_TRY(get(&m->phi, t, "phi_i", 1));
    TSUYA_TRY(get(&m->theta, t, "theta_i", 1));
    TSUYA_TRY(get(&m->sigma, t, "sigma", 2));
    TSUYA_TRY(get(&m->ndf, t, "ndf", 2));
    TSUYA_TRY(get(&m->vndf, t, "vndf", 4));
    TSUYA_TRY(get(&m->value, t, find(t, "spectra") ? "spectra" : "rgb", 5));
    if (find(t, "spectra")) {
        TSUYA_TRY(get(&m->nm, t, "wavelengths", 1));
    }
    TSUYA_TRY(check_angles(t, m->phi, -2.0 * M_PI, 2.0 * M_PI));
    TSUYA_TRY(check_angles(t, m->theta, 0.0, 0.5 * M_PI));
    m->warp_y = m->vndf->shape[2];
    m->warp_x = m->vndf->shape[3];
    m->channels = m->value->shape[2];
    m->side_y = m->value->shape[3];
    m->side_x = m->value->shape[4];
    m->jacobian = jacobian && jacobian->type == U8 && jacobian->data[0];
    size_t a = m->phi->shape[0], b = m->theta->shape[0], turns = a <= 2 ? TURNS : 1;
    bool fits = m->vndf->shape[0] == a && m->vndf->shape[1] == b && m->value->shape[0] == a && m->value->shape[1] == b;
    fits &= m->nm ? m->nm->shape[0] == m->channels : m->channels == 3;
    fits &= m->warp_x >= 2 && m->warp_y >= 2 && m->side_x >= 2 && m->side_y >= 2 && m->channels <= MOST_CHANNELS && m->sigma->shape[0] >= 2 &&
            m->sigma->shape[1] >= 2 && m->ndf->shape[0] >= 2 && m->ndf->shape[1] >= 2;
    if (!fits || a * b * turns > MOST_SAMPLES / (m->side_x * m->side_y)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: the shapes of phi_i, theta_i, vndf and %s do not belong together", t->name, m->value->name);
    }
    return TSUYA_OK;
}

/* Bilinear on a table over the unit square, rows along y. */
static double bilinear(const field *f, double x, double y)
{
    size_t w = f->shape[1], h = f->shape[0];
    double px = fmin(1.0, fmax(0.0, x)) * (double)(w - 1), py = fmin(1.0, fmax(0.0, y)) * (double)(h - 1);
    size_t i = (size_t)fmin(px, (double)(w - 2)), j = (size_t)fmin(py, (double)(h - 2));
    double u = px - (double)i, v = py - (double)j;
    return (1 - v) * ((1 - u) * at(f, j * w + i) + u * at(f, j * w + i + 1)) + v * ((1 - u) * at(f, (j + 1) * w + i) + u * at(f, (j + 1) * w + i + 1));
}

/* Where the integral of a piecewise linear density reaches the share `u` of its total, in [0, 1]. */
static double inverse_share(const double *density, size_t count, double u)
{
    double total = 0.0;
    for (size_t k = 0; k + 1 < count; ++k) {
        total += 0.5 * (density[k] + density[k + 1]);
    }
    double rest = u * total;
    for (size_t k = 0; k + 1 < count; ++k) {
        double a = density[k], b = density[k + 1], cell = 0.5 * (a + b);
        if (rest <= cell || k + 2 == count) {
            rest = fmin(rest, cell);
            double root = a + sqrt(fmax(0.0, a * a + 2.0 * rest * (b - a)));
            return ((double)k + (root > 0.0 ? fmin(1.0, 2.0 * rest / root) : 0.0)) / (double)(count - 1);
        }
        rest -= cell;
    }
    return 1.0;
}

/* The warp of one incidence: u to the half vector's square.  `line`: room for warp_x + warp_y numbers. */
static void warp(double to[2], const measured *m, size_t slice, double ux, double uy, double *line)
{
    size_t w = m->warp_x, h = m->warp_y, first = slice * w * h;
    double *rows = line + w;
    for (size_t j = 0; j < h; ++j) {
        rows[j] = 0.0;
        for (size_t i = 0; i + 1 < w; ++i) {
            rows[j] += 0.5 * (fmax(0.0, at(m->vndf, first + j * w + i)) + fmax(0.0, at(m->vndf, first + j * w + i + 1)));
        }
    }
    to[1] = inverse_share(rows, h, uy);
    double py = to[1] * (double)(h - 1);
    size_t j = (size_t)fmin(py, (double)(h - 2));
    for (size_t i = 0; i < w; ++i) {
        line[i] = fmax(0.0, (1.0 - (py - (double)j)) * at(m->vndf, first + j * w + i) + (py - (double)j) * at(m->vndf, first + (j + 1) * w + i));
    }
    to[0] = inverse_share(line, w, ux);
}

static tsuya_vec3 polar(double theta, double phi)
{
    return (tsuya_vec3){sin(theta) * cos(phi), sin(theta) * sin(phi), cos(theta)};
}

/* One node of one incidence, turned by `turn`: appended when both directions are above the surface. */
static void add_node(tsuya_samples *s, const measured *m, size_t slice, size_t node, const double half[2], double turn)
{
    size_t a = slice / m->theta->shape[0], area = m->side_x * m->side_y;
    double phi = at(m->phi, a), theta = at(m->theta, slice % m->theta->shape[0]), theta_h = 0.5 * M_PI * half[0] * half[0];
    double phi_h = 2.0 * M_PI * half[1] - M_PI + (m->phi->shape[0] <= 2 ? phi : 0.0);
    tsuya_vec3 wi = polar(theta, phi + turn), h = polar(theta_h, phi_h + turn), wo = tsuya_vec3_mad(tsuya_vec3_scale(wi, -1.0), 2.0 * tsuya_vec3_dot(wi, h), h);
    double factor = 1.0;
    if (m->jacobian) {
        double sigma = bilinear(m->sigma, sqrt(theta * 2.0 / M_PI), (phi + M_PI) / (2.0 * M_PI));
        factor = sigma > 0.0 ? bilinear(m->ndf, half[0], half[1]) / (4.0 * sigma) : NAN;
    }
    if (!(wi.z > 1e-6 && wo.z > 0.02 && isfinite(factor))) { /* f cosθo says nothing of f at the horizon */
        s->dropped_below++;
        return;
    }
    for (size_t c = 0; c < m->channels; ++c) {
        s->value[(size_t)s->count * m->channels + c] = fmax(0.0, at(m->value, (slice * m->channels + c) * area + node)) * factor / wo.z;
    }
    s->wi[s->count] = wi;
    s->wo[s->count++] = wo;
}

static tsuya_status fill(tsuya_samples *s, const measured *m, const char *name)
{
    size_t slices = m->phi->shape[0] * m->theta->shape[0];
    int turns = m->phi->shape[0] <= 2 ? TURNS : 1;
    double *line = tsuya_calloc(m->warp_x + m->warp_y, sizeof *line), half[2];
    if (!line) {
        return TSUYA_ERROR_MEMORY;
    }
    s->count = 0;
    for (size_t slice = 0; slice < slices; ++slice) {
        for (size_t node = 0; node < m->side_x * m->side_y; ++node) {
            warp(half, m, slice, (double)(node % m->side_x) / (double)(m->side_x - 1), (double)(node / m->side_x) / (double)(m->side_y - 1), line);
            for (int k = 0; k < turns; ++k) {
                add_node(s, m, slice, node, half, 0.25 * M_PI * k);
            }
        }
    }
    tsuya_free(line);
    return s->count ? TSUYA_OK : tsuya_fail(TSUYA_ERROR_INPUT, "%s: no value with both directions above the surface", name);
}

tsuya_status tsuya_samples_from_rgl(tsuya_samples *samples, const char *bytes, size_t size, const char *name)
{
    tensor_file *t = tsuya_calloc(1, sizeof *t);
    measured m = {0};
    char text[MOST_CHANNELS][TSUYA_SAMPLES_CHANNEL_SIZE];
    const char *channel[MOST_CHANNELS];
    if (!t) {
        return TSUYA_ERROR_MEMORY;
    }
    *t = (tensor_file){.name = name, .bytes = bytes, .size = size};
    tsuya_status status = read_header(t);
    if (status == TSUYA_OK) {
        status = gather(&m, t);
    }
    if (status == TSUYA_OK) {
        for (size_t c = 0; m.nm && c < m.channels; ++c) {
            snprintf(text[c], sizeof text[c], "nm%.5g", at(m.nm, c));
            channel[c] = text[c];
        }
        size_t rows = m.phi->shape[0] * m.theta->shape[0] * m.side_x * m.side_y * (m.phi->shape[0] <= 2 ? TURNS : 1);
        status = tsuya_samples_create(samples, (int)rows, (int)m.channels, m.nm ? channel : NULL);
    }
    if (status == TSUYA_OK) {
        status = fill(samples, &m, name);
        if (status != TSUYA_OK) {
            tsuya_samples_free(samples);
        }
    }
    tsuya_free(t);
    return status;
}
