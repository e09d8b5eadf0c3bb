/* A material as glTF 2.0 parameters: the published BRDF (brdf/gltf.h) by Levenberg–Marquardt on cube roots, from the best of four starts. */
#include "brdf/export_loss.h"
#include "brdf/gltf.h"
#include "brdf/model.h"

#include "core/file.h"
#include "core/json.h"

#include <math.h>
#include <string.h>

enum { PAIRS = 1500, UNKNOWNS = 14, ROUGHNESS = 9, ANISOTROPY, ROTATION, SHEEN_ROUGHNESS, SPECULAR, STEPS = 40 };

typedef struct problem {
    tsuya_samples pairs;
    double *root;           /* PAIRS × 3: ∛(f cosθi) of the material */
    double *row, *residual; /* UNKNOWNS + 1 rows of PAIRS × 3 */
} problem;

static tsuya_gltf parameters_of(const double x[UNKNOWNS])
{
    tsuya_gltf g = {.roughness = x[ROUGHNESS], .anisotropy = x[ANISOTROPY], .rotation_rad = x[ROTATION], .sheen_roughness = x[SHEEN_ROUGHNESS]};
    memcpy(g.base, x, sizeof g.base);
    for (int c = 0; c < 3; ++c) {
        g.f0[c] = x[SPECULAR] * x[3 + c];
    }
    g.f90 = x[SPECULAR];
    memcpy(g.sheen, x + 6, sizeof g.sheen);
    tsuya_gltf_prepare(&g);
    return g;
}

static double lowest(int k) { return k == ROUGHNESS ? 0.1 : k == SHEEN_ROUGHNESS ? 0.2 : k == ROTATION ? -INFINITY : k == SPECULAR ? 0.01 : 0.0; }
static double highest(int k) { return k == ROTATION ? INFINITY : 1.0; }

/* Differences of cube roots; their sum of squares. */
static double differences(double *r, const problem *p, const double x[UNKNOWNS])
{
    const tsuya_gltf g = parameters_of(x);
    double sum = 0.0, value[3];
    for (int k = 0; k < PAIRS; ++k) {
        tsuya_gltf_eval(value, &g, p->pairs.wi[k], p->pairs.wo[k]);
        for (int c = 0; c < 3; ++c) {
            double d = cbrt(value[c] * p->pairs.wi[k].z) - p->root[3 * k + c];
            r[3 * k + c] = d;
            sum += d * d;
        }
    }
    return sum;
}

/* (A + damping · diag A) x = b by Gauss without pivots: A is a sum of squares. */
static void solve(double x[UNKNOWNS], const double a[UNKNOWNS][UNKNOWNS], const double b[UNKNOWNS], double damping)
{
    double m[UNKNOWNS][UNKNOWNS + 1];
    for (int i = 0; i < UNKNOWNS; ++i) {
        memcpy(m[i], a[i], sizeof a[i]); /* an UNKNOWNS + 1st column holds b */
        m[i][i] += damping * a[i][i] + 1e-12;
        m[i][UNKNOWNS] = b[i];
    }
    for (int i = 0; i < UNKNOWNS; ++i) {
        for (int j = i + 1; j < UNKNOWNS; ++j) {
            double factor = m[j][i] / m[i][i];
            for (int k = i; k <= UNKNOWNS; ++k) {
                m[j][k] -= factor * m[i][k];
            }
        }
    }
    for (int i = UNKNOWNS - 1; i >= 0; --i) {
        x[i] = m[i][UNKNOWNS];
        for (int k = i + 1; k < UNKNOWNS; ++k) {
            x[i] -= m[i][k] * x[k];
        }
        x[i] /= m[i][i];
    }
}

static void normal_equations(double a[UNKNOWNS][UNKNOWNS], double b[UNKNOWNS], const problem *p, const double x[UNKNOWNS])
{
    enum { ROWS = 3 * PAIRS };
    for (int k = 0; k < UNKNOWNS; ++k) {
        double moved[UNKNOWNS], step = x[k] > 0.5 && k != ROTATION ? -1e-5 : 1e-5, *row = p->row + (size_t)k * ROWS;
        memcpy(moved, x, sizeof moved);
        moved[k] += step;
        differences(row, p, moved);
        for (int i = 0; i < ROWS; ++i) {
            row[i] = (row[i] - p->residual[i]) / step;
        }
    }
    for (int k = 0; k < UNKNOWNS; ++k) {
        for (int j = 0; j <= k; ++j) {
            double sum = 0.0;
            for (int i = 0; i < ROWS; ++i) {
                sum += p->row[(size_t)k * ROWS + (size_t)i] * p->row[(size_t)j * ROWS + (size_t)i];
            }
            a[k][j] = a[j][k] = sum;
        }
        b[k] = 0.0;
        for (int i = 0; i < ROWS; ++i) {
            b[k] -= p->row[(size_t)k * ROWS + (size_t)i] * p->residual[i];
        }
    }
}

/* What stands at an end of its range and would leave it stays there. */
static void hold_at_ends(double a[UNKNOWNS][UNKNOWNS], double b[UNKNOWNS], const double x[UNKNOWNS])
{
    for (int k = 0; k < UNKNOWNS; ++k) {
        if ((x[k] <= lowest(k) && b[k] < 0.0) || (x[k] >= highest(k) && b[k] > 0.0)) {
            for (int j = 0; j < UNKNOWNS; ++j) {
                a[k][j] = a[j][k] = j == k ? 1.0 : 0.0;
            }
            b[k] = 0.0;
        }
    }
}

static double descend(double x[UNKNOWNS], const problem *p)
{
    double a[UNKNOWNS][UNKNOWNS], b[UNKNOWNS], step[UNKNOWNS], damping = 1e-2, sum = differences(p->residual, p, x);
    for (int i = 0; i < STEPS; ++i) {
        double now = INFINITY, trial[UNKNOWNS];
        normal_equations(a, b, p, x);
        hold_at_ends(a, b, x);
        for (int attempt = 0; attempt < 8 && !(now < sum); ++attempt) {
            solve(step, a, b, damping);
            for (int k = 0; k < UNKNOWNS; ++k) {
                trial[k] = fmin(fmax(x[k] + fmin(fmax(step[k], -0.3), 0.3), lowest(k)), highest(k));
            }
            now = differences(p->row, p, trial);
            damping *= now < sum ? 0.2 : 5.0;
        }
        if (!(now < sum)) {
            break;
        }
        bool settled = sum - now < 1e-6 * sum;
        memcpy(x, trial, sizeof trial);
        sum = differences(p->residual, p, x);
        if (settled) {
            break;
        }
    }
    return sum;
}

static tsuya_gltf fit(const problem *p)
{
    static const double roughness[4] = {0.4, 0.4, 0.7, 0.7}, rotation[4] = {0.0, 0.5 * M_PI, 0.0, 0.5 * M_PI};
    double best[UNKNOWNS] = {0}, least = INFINITY;
    for (int start = 0; start < 4; ++start) {
        double x[UNKNOWNS] = {0.2, 0.2, 0.2, 0.1, 0.1, 0.1, 0.05, 0.05, 0.05, roughness[start], 0.4, rotation[start], 0.6, 0.5};
        double sum = descend(x, p);
        if (sum < least * (1.0 - 1e-9)) {
            least = sum;
            memcpy(best, x, sizeof best);
        }
    }
    best[ROTATION] = remainder(best[ROTATION], M_PI);
    return parameters_of(best);
}

static void see(double *value, const void *user, tsuya_vec3 wi, tsuya_vec3 wo) { tsuya_gltf_eval(value, user, wi, wo); }

/* A surface that reflects more than a twentieth over next to nothing is a metal, whose base colour is its reflectance. */
static bool is_metal(tsuya_gltf *g)
{
    double below = fmax(fmax(g->base[0], g->base[1]), g->base[2]), above = fmax(fmax(g->f0[0], g->f0[1]), g->f0[2]);
    bool metal = above > 0.08 && below < 0.01 && g->f90 > 0.5;
    for (int c = 0; c < 3 && metal; ++c) {
        g->base[c] = 0.0;
    }
    g->f90 = metal ? 1.0 : g->f90;
    return metal;
}

static void add_material(tsuya_json *m, const char *name, const tsuya_gltf *g, bool metal, const tsuya_export_loss *loss)
{
    double base[4] = {g->base[0], g->base[1], g->base[2], 1.0}, specular[3];
    tsuya_json_set_text(m, "name", name);
    tsuya_json *pbr = tsuya_json_set_object(m, "pbrMetallicRoughness"), *extensions = tsuya_json_set_object(m, "extensions");
    for (int c = 0; c < 3; ++c) {
        base[c] = metal ? g->f0[c] : base[c];
        specular[c] = g->f0[c] / (0.04 * g->f90);
    }
    tsuya_json_set_numbers(pbr, "baseColorFactor", base, 4);
    tsuya_json_set_number(pbr, "metallicFactor", metal ? 1.0 : 0.0);
    tsuya_json_set_number(pbr, "roughnessFactor", g->roughness);
    if (!metal) {
        tsuya_json *s = tsuya_json_set_object(extensions, "KHR_materials_specular");
        tsuya_json_set_number(s, "specularFactor", g->f90);
        tsuya_json_set_numbers(s, "specularColorFactor", specular, 3);
    }
    tsuya_json *anisotropy = tsuya_json_set_object(extensions, "KHR_materials_anisotropy"), *sheen = tsuya_json_set_object(extensions, "KHR_materials_sheen");
    tsuya_json_set_number(anisotropy, "anisotropyStrength", g->anisotropy);
    tsuya_json_set_number(anisotropy, "anisotropyRotation", g->rotation_rad);
    tsuya_json_set_numbers(sheen, "sheenColorFactor", g->sheen, 3);
    tsuya_json_set_number(sheen, "sheenRoughnessFactor", g->sheen_roughness);
    tsuya_json *extras = tsuya_json_set_object(m, "extras");
    tsuya_json_set_text(extras, "tangent", "weft");
    tsuya_json_set_number(extras, "error_cbrt", loss->cbrt);
    tsuya_json_set_number(extras, "de00_median", loss->de00_median);
    tsuya_json_set_number(extras, "de00_p95", loss->de00_p95);
}

static tsuya_status save(tsuya_export_loss *loss, const char *path, const char *name, const tsuya_gltf *g, bool metal)
{
    tsuya_json *root = tsuya_json_create_object();
    if (!root) {
        return TSUYA_ERROR_MEMORY;
    }
    tsuya_json *asset = tsuya_json_set_object(root, "asset");
    tsuya_json_set_text(asset, "version", "2.0");
    tsuya_json_set_text(asset, "generator", "tsuya " TSUYA_VERSION);
    tsuya_json *used = tsuya_json_set_array(root, "extensionsUsed");
    if (!metal) {
        tsuya_json_add_text(used, "KHR_materials_specular");
    }
    tsuya_json_add_text(used, "KHR_materials_anisotropy");
    tsuya_json_add_text(used, "KHR_materials_sheen");
    add_material(tsuya_json_add_object(tsuya_json_set_array(root, "materials")), name, g, metal, loss);
    char *text = NULL;
    tsuya_status status = tsuya_json_print(&text, root);
    if (status == TSUYA_OK) {
        loss->bytes = (double)strlen(text);
        status = tsuya_file_write(path, text, strlen(text));
    }
    tsuya_free(text);
    tsuya_json_free(root);
    return status;
}

static tsuya_status prepare(problem *p, const tsuya_material *m)
{
    tsuya_status status;
    TSUYA_GOTO_DONE(status, tsuya_samples_create(&p->pairs, PAIRS, 3, m->channel));
    TSUYA_NEW(status, p->root, 3 * (size_t)PAIRS);
    TSUYA_NEW(status, p->row, 3 * (size_t)PAIRS * UNKNOWNS);
    TSUYA_NEW(status, p->residual, 3 * (size_t)PAIRS);
    tsuya_export_pairs(&p->pairs, 5);
    for (int k = 0; k < PAIRS; ++k) {
        double value[3];
        tsuya_material_eval(m, NULL, p->pairs.wi[k], p->pairs.wo[k], value);
        for (int c = 0; c < 3; ++c) {
            p->root[3 * k + c] = cbrt(value[c] * p->pairs.wi[k].z);
        }
    }
done:
    return status;
}

tsuya_status tsuya_export_gltf(tsuya_export_loss *loss, const char *path, const tsuya_material *material)
{
    problem p = {0};
    tsuya_status status;
    if (material->channel_count != 3 || strcmp(material->channel[0], "r") != 0) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: glTF materials hold r, g, b; the material's first channel is %s", path, material->channel[0]);
    }
    TSUYA_GOTO_DONE(status, prepare(&p, material));
    tsuya_gltf g = fit(&p);
    bool metal = is_metal(&g);
    TSUYA_GOTO_DONE(status, tsuya_export_measure(loss, material, see, &g));
    status = save(loss, path, material->name, &g, metal);
done:
    tsuya_samples_free(&p.pairs);
    tsuya_free(p.root);
    tsuya_free(p.row);
    tsuya_free(p.residual);
    return status;
}
