#include "capture/irawan.h"

#include "core/file.h"

#include <stdio.h>
#include <string.h>

enum { ACROSS_STEPS = 64, ALONG_STEPS = 128, UNEVEN = 5 };
static const double flat_conic = 1e-6; /* nearer to a parabola than this is one */

/* Radius of curvature where the spine has risen by u.  The spine is the conic whose ends rise by u_max, l − 2 a sin u_max apart. */
static double curvature_radius(double u, double end, double kappa, double width, double length)
{
    double shape = 1.0 + kappa * (1.0 + 1.0 / tan(end)), half = 0.5 * length - 0.5 * width * sin(end);
    if (fabs(shape) < flat_conic) {
        double t = tan(u);
        return half / tan(end) * pow(1.0 + t * t, 1.5);
    }
    if (shape > 0.0) { /* (b sin t, (b/shape) cos t), risen by u where tan t = shape tan u */
        double b = half / sin(atan(shape * tan(end))), a = b / shape, t = atan(shape * tan(u)), c = b * cos(t), s = a * sin(t);
        return pow(c * c + s * s, 1.5) / (a * b);
    }
    double m = -shape, t = atanh(m * tan(u)), b = half / sinh(atanh(m * tan(end))), a = b / m, c = b * cosh(t), s = a * sinh(t);
    return pow(c * c + s * s, 1.5) / (a * b);
}

static double seeliger(double ci, double co) { return ci > 0.0 && co > 0.0 ? ci * co / (4.0 * M_PI * (ci + co)) : 0.0; }

static double bessel_i0(double x)
{
    double term = 1.0, sum = 1.0;
    for (int k = 1; k < 60; ++k) {
        term *= 0.25 * x * x / (k * k);
        sum += term;
    }
    return sum;
}

static double phase(const tsuya_irawan *cloth, double cosine)
{
    return cloth->uniform + exp(cloth->forward * cosine) / (2.0 * M_PI * bessel_i0(cloth->forward));
}

static double fading(double x)
{
    double t = fmin(fmax(x, 0.0), 1.0);
    return 1.0 - t * t * (3.0 - 2.0 * t);
}

/* ∫∫ of the header over one segment without f_c; y runs along the yarn.  Untwisted fibres: one u reflects, at every v. */
static double filament(const tsuya_irawan_yarn *p, double end, double smoothing, tsuya_vec3 wi, tsuya_vec3 wo)
{
    tsuya_vec3 both = tsuya_vec3_add(wi, wo);
    double u = atan2(both.y, both.z), level = (1.0 - smoothing) * end, a = 0.5 * p->width;
    if (fabs(u) >= end) {
        return 0.0;
    }
    double radius = curvature_radius(fmin(fabs(u), level), level, p->kappa, p->width, p->length), sum = 0.0;
    for (int k = 0; k < ACROSS_STEPS; ++k) {
        double v = M_PI * ((k + 0.5) / ACROSS_STEPS - 0.5);
        tsuya_vec3 n = {sin(v), sin(u) * cos(v), cos(u) * cos(v)};
        sum += seeliger(tsuya_vec3_dot(n, wi), tsuya_vec3_dot(n, wo)) * a * (radius + a * cos(v));
    }
    double fade = smoothing > 0.0 ? fading((fabs(u) - level) / (smoothing * end)) : 1.0;
    return fade * sum * (M_PI / ACROSS_STEPS) / hypot(both.y, both.z);
}

/* Twisted fibres: at every u one v reflects. */
static double staple(const tsuya_irawan_yarn *p, double end, tsuya_vec3 wi, tsuya_vec3 wo)
{
    tsuya_vec3 both = tsuya_vec3_add(wi, wo);
    double twist = tsuya_rad_from_deg(p->twist_deg), a = 0.5 * p->width, sum = 0.0;
    for (int k = 0; k < ALONG_STEPS; ++k) {
        double u = end * (2.0 * (k + 0.5) / ALONG_STEPS - 1.0), c = cos(u), s = sin(u);
        double up = both.y * s + both.z * c, along = both.y * c - both.z * s, across = hypot(both.x, up), turn = along / (across * tan(twist));
        if (!(fabs(turn) < 1.0)) {
            continue;
        }
        double v = remainder(acos(turn) - atan2(up, both.x), 2.0 * M_PI);
        if (fabs(v) < 0.5 * M_PI) {
            tsuya_vec3 n = {sin(v), s * cos(v), c * cos(v)};
            double lean = fabs(sin(twist)) * tsuya_vec3_dot(n, both);
            double area = a * (curvature_radius(fabs(u), end, p->kappa, p->width, p->length) + a * cos(v));
            sum += lean > 0.0 ? seeliger(tsuya_vec3_dot(n, wi), tsuya_vec3_dot(n, wo)) * area / lean : 0.0;
        }
    }
    return sum * 2.0 * end / ALONG_STEPS;
}

static double held_end(double end_deg, const tsuya_irawan_yarn *p)
{
    double most = p->width > p->length ? tsuya_deg_from_rad(asin(p->length / p->width)) - 1.0 : 85.0;
    return tsuya_rad_from_deg(fmin(fmax(end_deg, 1.0), fmin(most, 85.0)));
}

/* f_s of one yarn before scaling; where u_max is uneven, over five values of it, weighted as throws of four coins. */
static double specular(const tsuya_irawan *cloth, const tsuya_irawan_yarn *p, tsuya_vec3 wi, tsuya_vec3 wo)
{
    static const double weight[UNEVEN] = {1.0 / 16, 4.0 / 16, 6.0 / 16, 4.0 / 16, 1.0 / 16};
    double sum = 0.0;
    for (int k = 0; k < UNEVEN; ++k) {
        if (p->uneven_deg > 0.0 || k == UNEVEN / 2) {
            double end = held_end(p->end_deg + (k - UNEVEN / 2) * p->uneven_deg, p);
            double one = p->twist_deg != 0.0 ? staple(p, end, wi, wo) : filament(p, end, cloth->smoothing, wi, wo);
            sum += (p->uneven_deg > 0.0 ? weight[k] : 1.0) * one;
        }
    }
    return sum * phase(cloth, -tsuya_vec3_dot(wi, wo)) / (p->width * p->length);
}

static tsuya_vec3 along_weft(tsuya_vec3 w) { return (tsuya_vec3){-w.y, w.x, w.z}; } /* the weft runs along x */

void tsuya_irawan_eval(const tsuya_irawan *cloth, tsuya_vec3 wi, tsuya_vec3 wo, double value[3])
{
    memset(value, 0, 3 * sizeof *value);
    if (!(wi.z > 0.0 && wo.z > 0.0)) {
        return;
    }
    double share = cloth->warp_share, warp = cloth->scale * share * specular(cloth, &cloth->warp, wi, wo);
    double weft = cloth->scale * (1.0 - share) * specular(cloth, &cloth->weft, along_weft(wi), along_weft(wo));
    for (int c = 0; c < 3; ++c) {
        double below = (share * cloth->warp.diffuse[c] + (1.0 - share) * cloth->weft.diffuse[c]) / M_PI;
        value[c] = below + warp * cloth->warp.specular[c] + weft * cloth->weft.specular[c];
    }
}

static tsuya_status check(const tsuya_irawan_yarn *p, const char *which, const char *name)
{
    if (!(p->width > 0.0 && p->length > 0.0 && p->end_deg >= 1.0 && p->end_deg <= 85.0 && fabs(p->twist_deg) <= 80.0 && p->kappa > -1.0 &&
          p->uneven_deg >= 0.0 && p->width * sin(tsuya_rad_from_deg(p->end_deg)) < p->length)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: %s: psi %g umax %g kappa %g width %g length %g: expected |psi| up to 80, umax 1 to 85, kappa above -1, width * sin(umax) below length",
                          name, which, p->twist_deg, p->end_deg, p->kappa, p->width, p->length);
    }
    return TSUYA_OK;
}

tsuya_status tsuya_irawan_prepare(tsuya_irawan *cloth, const char *name)
{
    enum { RINGS = 48, TURNS = 96 };
    const tsuya_vec3 up = {0.0, 0.0, 1.0};
    double albedo = 0.0;
    TSUYA_TRY(check(&cloth->warp, "warp", name));
    TSUYA_TRY(check(&cloth->weft, "weft", name));
    if (!(cloth->warp_share >= 0.0 && cloth->warp_share <= 1.0 && cloth->uniform >= 0.0 && cloth->forward >= 0.0 && cloth->forward <= 30.0 &&
          cloth->smoothing >= 0.0 && cloth->smoothing < 1.0)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: warp share %g, alpha %g, beta %g, ss %g: expected 0 to 1, from 0, 0 to 30, 0 to below 1", name, cloth->warp_share,
                          cloth->uniform, cloth->forward, cloth->smoothing);
    }
    for (int k = 0; k < RINGS * TURNS; ++k) { /* equal shares of cosθ dω */
        double r2 = (k / TURNS + 0.5) / RINGS, r = sqrt(r2), phi = 2.0 * M_PI * (k % TURNS + 0.5) / TURNS;
        tsuya_vec3 w = {r * cos(phi), r * sin(phi), sqrt(1.0 - r2)};
        double f = cloth->warp_share * specular(cloth, &cloth->warp, w, up) + (1.0 - cloth->warp_share) * specular(cloth, &cloth->weft, along_weft(w), up);
        albedo += f * M_PI / (RINGS * TURNS);
    }
    cloth->scale = albedo > 0.0 ? 1.0 / albedo : 0.0;
    return TSUYA_OK;
}

/* The table gives a segment's extents along x and along y: the weft runs along x. */
static bool parse_yarn(tsuya_irawan_yarn *p, const char *line, const char *key, bool along_y)
{
    const char *at = strstr(line, key);
    double *x = along_y ? &p->width : &p->length, *y = along_y ? &p->length : &p->width;
    *p = (tsuya_irawan_yarn){.diffuse = {0.1, 0.1, 0.1}, .specular = {0.3, 0.3, 0.3}};
    return at && sscanf(at + strlen(key), "%lf %lf %lf %lf %lf", &p->twist_deg, &p->end_deg, &p->kappa, x, y) == 5;
}

/* The noise that moves u_max is smooth; its standard deviation is about 0.3 of the amplitude that the table gives along each direction. */
static void parse_uneven(tsuya_irawan *cloth, const char *line)
{
    const char *at = strstr(line, "dUmax ");
    double d[4];
    if (at && sscanf(at + strlen("dUmax "), "%lf %lf %lf %lf", &d[0], &d[1], &d[2], &d[3]) == 4) {
        cloth->warp.uneven_deg = 0.3 * hypot(d[0], d[1]);
        cloth->weft.uneven_deg = 0.3 * hypot(d[2], d[3]);
    }
}

/* A cloth has a line NAME tileW tileH alpha beta ss hWidth warpArea weftArea, and behind it one with its yarns. */
static tsuya_status parse(tsuya_irawan *cloth, char *text, const char *path, const char *name)
{
    char *rest, *head = NULL, found[64];
    for (char *line = strtok_r(text, "\n", &rest); line; line = strtok_r(NULL, "\n", &rest)) {
        if (line[0] != '#' && line[0] != ' ' && sscanf(line, "%63s", found) == 1 && strcmp(found, name) == 0) {
            head = line;
            break;
        }
    }
    if (!head) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: no weave %s", path, name);
    }
    char *yarns = strtok_r(NULL, "\n", &rest);
    double areas[2];
    tsuya_irawan c = {0};
    if (sscanf(head, "%*s %*f %*f %lf %lf %lf %*f %lf %lf", &c.uniform, &c.forward, &c.smoothing, &areas[0], &areas[1]) != 5 || !yarns ||
        !parse_yarn(&c.warp, yarns, "warp ", true) || !parse_yarn(&c.weft, yarns, "weft ", false) || !(areas[0] + areas[1] > 0.0)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: weave %s: expected tile, alpha, beta, ss, hWidth, areas, and a line of warp and weft", path, name);
    }
    c.warp_share = areas[0] / (areas[0] + areas[1]);
    *cloth = c;
    parse_uneven(cloth, head);
    return TSUYA_OK;
}

tsuya_status tsuya_irawan_load(tsuya_irawan *cloth, const char *path, const char *name)
{
    char *text;
    size_t size;
    *cloth = (tsuya_irawan){0};
    TSUYA_TRY(tsuya_file_load(&text, &size, path, 1 << 20));
    tsuya_status status = parse(cloth, text, path, name);
    tsuya_free(text);
    return status == TSUYA_OK ? tsuya_irawan_prepare(cloth, name) : status;
}
