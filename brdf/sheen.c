#include "brdf/sheen.h"

#include "brdf/half_table.h"
#include "core/memory.h"

#include <string.h>

tsuya_half_angles tsuya_half_angles_of(tsuya_vec3 wi, tsuya_vec3 wo)
{
    tsuya_vec3 sum = tsuya_vec3_add(wi, wo), difference = tsuya_vec3_sub(wi, wo);
    double across = sqrt(sum.x * sum.x + sum.y * sum.y);
    return (tsuya_half_angles){
        .psi_t = atan2(sum.x, sum.z),
        .psi_b = atan2(sum.y, sum.z),
        .phi_h = across > 0.0 ? atan2(sum.y, sum.x) : 0.0,
        .theta_h = atan2(across, sum.z),
        .theta_d = atan2(tsuya_vec3_norm(difference), tsuya_vec3_norm(sum)),
        .falloff = 0.5 / (wi.z + wo.z),
        .cosine = fmin(0.5 * tsuya_vec3_norm(sum), 1.0),
        .dt2 = 0.25 * difference.x * difference.x,
        .db2 = 0.25 * difference.y * difference.y,
    };
}

double tsuya_sheen_rise(const tsuya_sheen *s, double cosine)
{
    double eta = s->eta;
    if (!(eta > 1.0)) {
        return 0.0;
    }
    cosine = fmin(fmax(cosine, s->lowest_cosine), 1.0);
    double g = sqrt(eta * eta - 1.0 + cosine * cosine), ratio = (eta - 1.0) / (eta + 1.0);
    double a = (g - cosine) / (g + cosine), b = (cosine * (g + cosine) - 1.0) / (cosine * (g - cosine) + 1.0);
    return 0.5 * a * a * (1.0 + b * b) / (ratio * ratio) - 1.0;
}

static void cubic_weights(double w[4], double t)
{
    double s = 1.0 - t;
    w[0] = s * s * s / 6.0;
    w[1] = (4.0 + t * t * (3.0 * t - 6.0)) / 6.0;
    w[2] = (4.0 + s * s * (3.0 * s - 6.0)) / 6.0;
    w[3] = t * t * t / 6.0;
}

int tsuya_uniform_weights(double weight[4], double x, double low, double high, int spans, bool periodic)
{
    double t = (x - low) * spans / (high - low);
    if (periodic) {
        t -= spans * floor(t / spans);
    }
    int i = (int)fmin(fmax(t, 0.0), spans - 1);
    cubic_weights(weight, fmin(fmax(t - i, 0.0), 1.0));
    return i;
}

int tsuya_sheen_stencil(int *index, double *weight, const tsuya_half_angles *a, int nu, int nv, int nd)
{
    double wu[4], wv[4], wd[4] = {1.0};
    int fu = tsuya_uniform_weights(wu, a->phi_h, 0.0, 2.0 * M_PI, nu, true);
    int fv = tsuya_uniform_weights(wv, a->theta_h, 0.0, 0.5 * M_PI, nv, false);
    int fd = nd > 0 ? tsuya_uniform_weights(wd, a->theta_d, 0.0, 0.5 * M_PI, nd, false) : 0, deep = nd > 0 ? 4 : 1, count = 0;
    for (int d = 0; d < deep; ++d) {
        for (int u = 0; u < 4; ++u) {
            for (int v = 0; v < 4; ++v) {
                index[count] = ((fd + d) * nu + (fu + u) % nu) * (nv + 3) + fv + v;
                weight[count++] = wd[d] * wu[u] * wv[v];
            }
        }
    }
    return count;
}

tsuya_status tsuya_sheen_create(tsuya_sheen **sheen, int channels, int spans, int nu, int nv, int nd)
{
    tsuya_status status = TSUYA_OK;
    tsuya_sheen *s;
    size_t n = (size_t)channels;
    *sheen = NULL;
    TSUYA_NEW(status, s, 1);
    s->channels = channels;
    s->spans = spans;
    s->nu = nu;
    s->nv = nv;
    s->nd = nd;
    s->eta = 1.0;
    for (int k = 0; k < TSUYA_SHEEN_CURVES; ++k) {
        TSUYA_NEW(status, s->curve[k], (size_t)spans + 3);
    }
    TSUYA_NEW(status, s->strength[0], n);
    TSUYA_NEW(status, s->strength[1], n);
    TSUYA_NEW(status, s->matte, n);
    s->line = (channels + 3) & ~3;
    for (int k = 0; k < TSUYA_SHEEN_FACTORS; ++k) {
        TSUYA_NEW(status, s->factor[k], (size_t)(TSUYA_SHEEN_TERMS * tsuya_sheen_factor_size(s, k)));
    }
    s->reach[0] = s->reach[1] = 1.0;
    *sheen = s;
    return TSUYA_OK;
done:
    tsuya_sheen_free(s);
    return status;
}

tsuya_status tsuya_sheen_create_net(tsuya_sheen *s)
{
    s->net = tsuya_calloc((size_t)tsuya_sheen_net_points(s->nu, s->nv, s->nd) * (size_t)s->line, sizeof *s->net);
    return s->net || s->nu == 0 ? TSUYA_OK : TSUYA_ERROR_MEMORY;
}

void tsuya_sheen_free(void *sheen)
{
    tsuya_sheen *s = sheen;
    if (!s) {
        return;
    }
    for (int k = 0; k < TSUYA_SHEEN_CURVES; ++k) {
        tsuya_free(s->curve[k]);
    }
    tsuya_free(s->strength[0]);
    tsuya_free(s->strength[1]);
    tsuya_free(s->matte);
    tsuya_free(s->net);
    for (int k = 0; k < TSUYA_SHEEN_FACTORS; ++k) {
        tsuya_free(s->factor[k]);
    }
    tsuya_free(s->fast);
    tsuya_free(s->wide);
    tsuya_half_table_free(s->half);
    tsuya_free(s);
}

static double dot4(const double *c, const double w[4]) { return c[0] * w[0] + c[1] * w[1] + c[2] * w[2] + c[3] * w[3]; }

static double slanted(const double slant[2], const double reach[2], double along, double across)
{
    return slant[0] * (slant[0] > 0.0 ? fmin(along, reach[0]) : along) + slant[1] * (slant[1] > 0.0 ? fmin(across, reach[1]) : across);
}

void tsuya_sheen_yarns(double log_yarn[2], const tsuya_sheen *s, const tsuya_half_angles *a)
{
    double wt[4], wb[4];
    int t = tsuya_uniform_weights(wt, a->psi_t, -0.5 * M_PI, 0.5 * M_PI, s->spans, false);
    int b = tsuya_uniform_weights(wb, a->psi_b, -0.5 * M_PI, 0.5 * M_PI, s->spans, false);
    log_yarn[0] = dot4(s->curve[TSUYA_SHEEN_WARP_ALONG] + b, wb) + dot4(s->curve[TSUYA_SHEEN_WARP_ACROSS] + t, wt);
    log_yarn[0] += slanted(s->slant[0], (const double[2]){s->reach[1], s->reach[0]}, a->db2, a->dt2);
    log_yarn[1] = slanted(s->slant[1], s->reach, a->dt2, a->db2) + dot4(s->curve[TSUYA_SHEEN_WEFT_ALONG] + t, wt) + dot4(s->curve[TSUYA_SHEEN_WEFT_ACROSS] + b, wb);
}

void tsuya_sheen_guide(double *value, const tsuya_sheen *s, const tsuya_half_angles *a)
{
    double yarn[2];
    tsuya_sheen_yarns(yarn, s, a);
    double warp = exp(yarn[0]), weft = exp(yarn[1]), gloss = (s->gloss[0] * warp + s->gloss[1] * weft) * tsuya_sheen_rise(s, a->cosine);
    for (int c = 0; c < s->channels; ++c) {
        value[c] = (s->strength[0][c] * warp + s->strength[1][c] * weft + s->matte[c] + gloss) * a->falloff;
    }
}

/* A product of numbers that a file may each hold must not make f infinite. */
static const double most_log = 200.0;

void tsuya_sheen_surface(double *log_value, const tsuya_sheen *s, const tsuya_half_angles *a)
{
    double wu[4], wv[4], wd[4];
    memset(log_value, 0, (size_t)s->channels * sizeof *log_value);
    if (s->terms == 0) {
        return;
    }
    int u = tsuya_uniform_weights(wu, a->phi_h, 0.0, 2.0 * M_PI, s->nu, true);
    int v = tsuya_uniform_weights(wv, a->theta_h, 0.0, 0.5 * M_PI, s->nv, false);
    int d = s->nd > 0 ? tsuya_uniform_weights(wd, a->theta_d, 0.0, 0.5 * M_PI, s->nd, false) : 0;
    for (int r = 0; r < s->terms; ++r) {
        const double *round = s->factor[TSUYA_SHEEN_ROUND] + r * s->nu, *tint = s->factor[TSUYA_SHEEN_TINT] + r * s->channels;
        double part = dot4(s->factor[TSUYA_SHEEN_TILT] + r * (s->nv + 3) + v, wv), around = 0.0;
        for (int i = 0; i < 4; ++i) {
            around += wu[i] * round[u + i < s->nu ? u + i : u + i - s->nu];
        }
        part *= around * (s->nd > 0 ? dot4(s->factor[TSUYA_SHEEN_DEEP] + r * (s->nd + 3) + d, wd) : *(s->factor[TSUYA_SHEEN_DEEP] + r));
        for (int c = 0; c < s->channels; ++c) {
            log_value[c] += tint[c] * part;
        }
    }
    for (int c = 0; c < s->channels; ++c) {
        log_value[c] = fmin(log_value[c], most_log);
    }
}

void tsuya_sheen_eval(const void *sheen, int channels, tsuya_vec3 wi, tsuya_vec3 wo, double *value)
{
    const tsuya_sheen *s = sheen;
    tsuya_half_angles a = tsuya_half_angles_of(wi, wo);
    tsuya_sheen_guide(value, s, &a);
    if (s->terms > 0) {
        double log_value[TSUYA_MATERIAL_MAX_CHANNELS];
        tsuya_sheen_surface(log_value, s, &a);
        for (int c = 0; c < channels; ++c) {
            value[c] *= exp(log_value[c]);
        }
    }
}
