#include "brdf/predict.h"

#include "brdf/model.h"
#include "brdf/sheen.h"
#include "core/memory.h"
#include "core/table.h"

#include <math.h>
#include <string.h>

enum { BINS = TSUYA_PREDICT_BINS, SPANS = 90, TRACE = 7200, PATH_STEPS = 64 };
static const char *const sections[] = {"circle", "ellipse", "triangle", "rounded-triangle", "trilobal", "hollow", "ribbon", NULL};
static const double lowest = 1e-5; /* of a curve's largest value: what no facet shows is dark, not minus infinity */

const char *const *tsuya_predict_sections(void) { return sections; }

tsuya_predict_options tsuya_predict_options_default(void)
{
    const tsuya_predict_yarn yarn = {.section = "triangle", .crimp_deg = 30.0, .along_deg = 4.0, .turn_deg = 10.0, .eta = 1.54};
    return (tsuya_predict_options){.name = "predicted", .warp = yarn, .weft = yarn};
}

static double angle_of(int bin) { return 0.5 * bin - 90.0; }

static void add(double *density, double angle_deg, double weight)
{
    double at = (angle_deg + 90.0) * 2.0;
    if (at >= 0.0 && at <= BINS - 1) {
        int k = (int)fmin(at, BINS - 2);
        density[k] += weight * (1.0 - (at - k));
        density[k + 1] += weight * (at - k);
    }
}

/* A triangle on its base, sides of length 1 that lean by `face`, corners rounded by `radius`. */
static void add_triangle(double *density, double face_deg, double radius)
{
    for (int side = -1; side <= 1; side += 2) {
        add(density, side * face_deg, 1.0 - radius);
    }
    for (int k = 0; k < BINS; ++k) { /* the upper corner between the faces, the lower ones outside them */
        add(density, angle_of(k), radius * M_PI / 360.0);
    }
}

/* Upper half of r(φ) = 1 + lobes cos 3φ (one lobe up), or of an ellipse: normals weighted by length. */
static void add_outline(double *density, double lobes, double flat)
{
    for (int k = 0; k < TRACE; ++k) {
        double x[2], y[2];
        for (int e = 0; e < 2; ++e) {
            double phi = 2.0 * M_PI * (k + e) / TRACE, r = 1.0 + lobes * cos(3.0 * (phi - 0.5 * M_PI));
            x[e] = r * cos(phi);
            y[e] = flat * r * sin(phi);
        }
        double dx = x[1] - x[0], dy = y[1] - y[0]; /* counter-clockwise: the outward normal is (dy, −dx) */
        if (-dx > 0.0) {
            add(density, tsuya_deg_from_rad(atan2(dy, -dx)), hypot(dx, dy));
        }
    }
}

static void normalize(double *density)
{
    double sum = 0.0;
    for (int k = 0; k < BINS; ++k) {
        sum += density[k];
    }
    for (int k = 0; k < BINS; ++k) {
        density[k] /= sum * M_PI / 360.0;
    }
}

/* Convolution with a Gaussian; what would turn under the horizon is hidden. */
static void blur(double *density, double sigma_deg)
{
    double out[BINS];
    for (int k = 0; k < BINS; ++k) {
        double sum = 0.0;
        for (int j = 0; j < BINS; ++j) {
            double x = 0.5 * (k - j) / sigma_deg;
            sum += density[j] * exp(-0.5 * x * x);
        }
        out[k] = sum;
    }
    memcpy(density, out, sizeof out);
}

tsuya_status tsuya_predict_across(double density[BINS], const tsuya_predict_yarn *yarn)
{
    memset(density, 0, BINS * sizeof *density);
    const char *s = yarn->section;
    if (strcmp(s, "circle") == 0 || strcmp(s, "hollow") == 0) { /* a hollow fibre's inner wall mirrors as its outer one */
        add_outline(density, 0.0, 1.0);
    } else if (strcmp(s, "ellipse") == 0) {
        add_outline(density, 0.0, 0.5);
    } else if (strcmp(s, "trilobal") == 0) {
        add_outline(density, 0.2, 1.0);
    } else if (strcmp(s, "triangle") == 0) {
        add_triangle(density, 60.0, 0.1);
    } else if (strcmp(s, "rounded-triangle") == 0) {
        add_triangle(density, 50.0, 0.4);
    } else if (strcmp(s, "ribbon") == 0) {
        add(density, 0.0, 1.0);
    } else {
        const char *nearest = tsuya_nearest_name(s, sections);
        return tsuya_fail(TSUYA_ERROR_INPUT, "fibre '%.40s' is not known%s%s", s, nearest ? "; the nearest known one is " : "", nearest ? nearest : "");
    }
    blur(density, fmax(yarn->turn_deg, 0.5));
    normalize(density);
    return TSUYA_OK;
}

/* Tangents of one float over `length` crossings: from +crimp to −crimp, level in the middle, the more so the longer it is. */
static void add_float(double *density, int length, double crimp_deg)
{
    double power = fmin(1.0 + 0.5 * (length - 1), 3.0);
    for (int k = 0; k < PATH_STEPS * length; ++k) {
        double c = cos(M_PI * (k + 0.5) / (PATH_STEPS * length));
        add(density, copysign(crimp_deg * pow(fabs(c), power), c), 1.0 / PATH_STEPS);
    }
}

static bool on_face(const tsuya_draft *d, bool warp, int yarn, int crossing)
{
    return warp ? d->warp_up[(crossing % d->picks) * d->ends + yarn] : !d->warp_up[yarn * d->ends + crossing % d->ends];
}

void tsuya_predict_along(double density[BINS], double *share, const tsuya_draft *d, bool warp, const tsuya_predict_yarn *yarn)
{
    int yarns = warp ? d->ends : d->picks, crossings = warp ? d->picks : d->ends, seen = 0;
    memset(density, 0, BINS * sizeof *density);
    for (int y = 0; y < yarns; ++y) {
        int first = 0; /* behind the first dive, so that no float is cut by the repeat's edge */
        while (first < crossings && on_face(d, warp, y, first)) {
            first++;
        }
        int run = first == crossings ? crossings : 0;
        for (int k = 1; k <= crossings && first < crossings; ++k) {
            if (on_face(d, warp, y, first + k)) {
                run++;
            } else if (run > 0) {
                add_float(density, run, yarn->crimp_deg);
                seen += run;
                run = 0;
            }
        }
        if (first == crossings) { /* never dives */
            add(density, 0.0, crossings);
            seen += crossings;
        }
    }
    *share = (double)seen / ((double)d->ends * d->picks);
    if (seen == 0) {
        add(density, 0.0, 1.0);
    }
    blur(density, fmax(yarn->along_deg, 0.5));
    normalize(density);
}

static double fresnel(double eta, double cosine)
{
    double t = sqrt(1.0 - (1.0 - cosine * cosine) / (eta * eta)), s = (cosine - eta * t) / (cosine + eta * t), p = (eta * cosine - t) / (eta * cosine + t);
    return 0.5 * (s * s + p * p);
}

/* Control values of log(density / top) at the functions' centres: with spans of 2° the spline's own smoothing is below the spreads. */
static void set_curve(double *control, const double *density, bool section, double top)
{
    for (int k = 0; k < SPANS + 3; ++k) {
        double psi = fmin(fmax((k - 1) * 180.0 / SPANS - 90.0, -90.0), 90.0), at = (psi + 90.0) * 2.0;
        int i = (int)fmin(at, BINS - 2);
        double value = density[i] + (at - i) * (density[i + 1] - density[i]);
        value /= section ? fmax(cos(tsuya_rad_from_deg(psi)), 0.1) : 1.0;
        control[k] = log(fmax(value / top, lowest));
    }
}

static double mean_cosine(const double *density)
{
    double sum = 0.0;
    for (int k = 0; k < BINS; ++k) {
        sum += density[k] * cos(tsuya_rad_from_deg(angle_of(k))) * M_PI / 360.0;
    }
    return sum;
}

static tsuya_status set_yarn(tsuya_sheen *s, const tsuya_draft *draft, bool warp, const tsuya_predict_yarn *yarn)
{
    double along[BINS], across[BINS], share, mirrored[BINS], top[2] = {0.0, 0.0};
    if (!(yarn->crimp_deg >= 0.0 && yarn->crimp_deg <= 80.0 && yarn->along_deg >= 0.0 && yarn->along_deg <= 60.0 && yarn->turn_deg >= 0.0 &&
          yarn->turn_deg <= 180.0 && yarn->eta >= 1.01 && yarn->eta <= 4.0)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "yarn: crimp %g (0 to 80°), spread %g (0 to 60°), turn %g (0 to 180°), index %g (1.01 to 4)", yarn->crimp_deg,
                          yarn->along_deg, yarn->turn_deg, yarn->eta);
    }
    TSUYA_TRY(tsuya_predict_across(across, yarn));
    tsuya_predict_along(along, &share, draft, warp, yarn);
    for (int k = 0; k < BINS; ++k) {
        mirrored[k] = along[BINS - 1 - k]; /* ψ = −α */
        top[0] = fmax(top[0], along[k]);
        top[1] = fmax(top[1], across[k]);
    }
    set_curve(s->curve[warp ? TSUYA_SHEEN_WARP_ALONG : TSUYA_SHEEN_WEFT_ALONG], mirrored, false, top[0]);
    set_curve(s->curve[warp ? TSUYA_SHEEN_WARP_ACROSS : TSUYA_SHEEN_WEFT_ACROSS], across, true, top[1]);
    double strength = share * top[0] * top[1] / (mean_cosine(along) * mean_cosine(across)), walls = strcmp(yarn->section, "hollow") == 0 ? 1.0 : 0.0;
    double f = fresnel(yarn->eta, cos(M_PI / 6.0));
    bool metal = yarn->metal[0] > 0.0 || yarn->metal[1] > 0.0 || yarn->metal[2] > 0.0;
    for (int c = 0; c < 3; ++c) {
        s->strength[warp ? 0 : 1][c] = strength * (metal ? yarn->metal[c] : f * (1.0 + walls * (1.0 - f) * (1.0 - f)));
    }
    return TSUYA_OK;
}

tsuya_status tsuya_predict(tsuya_material **material, const tsuya_draft *draft, const tsuya_predict_options *options)
{
    tsuya_sheen *s;
    *material = NULL;
    TSUYA_TRY(tsuya_sheen_create(&s, 3, SPANS, 0, 0, 0));
    tsuya_status status = set_yarn(s, draft, true, &options->warp);
    if (status == TSUYA_OK) {
        status = set_yarn(s, draft, false, &options->weft);
    }
    if (status == TSUYA_OK) {
        status = tsuya_sheen_prepare(s);
    }
    if (status != TSUYA_OK) {
        tsuya_sheen_free(s);
        return status;
    }
    TSUYA_TRY(tsuya_material_create(material, &tsuya_brdf_yarn, s, options->name, 3, NULL));
    status = tsuya_material_set_dye(*material, options->dye);
    if (status == TSUYA_OK) {
        status = tsuya_material_set_note(*material, "predicted from fibre and weave; measured on nothing");
    }
    if (status != TSUYA_OK) {
        tsuya_material_free(*material);
        *material = NULL;
    }
    return status;
}
