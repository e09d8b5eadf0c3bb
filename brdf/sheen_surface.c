/* S, the logarithm of what the two yarns leave: penalised linear least squares on the control net. */
#include "brdf/polar_fit.h"
#include "brdf/sheen_fit.h"

#include "core/memory.h"

tsuya_polar_options tsuya_sheen_surface_options_default(void)
{
    return (tsuya_polar_options){.smooth_phi = 1e-6, .smooth_theta = 1e-8, .smooth_d = 1e-6, .shrink = 1e-7};
}

/* Logarithms of what is left of one channel, weighted as cube roots would. */
static void residuals(double *target, double *weight, const tsuya_fit_data *data, int c, const double *guide)
{
    for (int k = 0; k < data->count; ++k) {
        size_t at = (size_t)k * (size_t)data->channels + (size_t)c;
        double f = data->value[at], root = data->root[at], g = guide[at];
        bool usable = f > 0.0 && g > 0.0;
        target[k] = usable ? log(f / g) : 0.0;
        weight[k] = usable ? root * root / (9.0 * data->root_sum) : 0.0;
    }
}

tsuya_status tsuya_sheen_fit_surface(tsuya_sheen *sheen, double *reciprocal_condition, const tsuya_fit_data *data,
                                     const tsuya_polar_options *options)
{
    tsuya_status status = TSUYA_OK;
    int points = tsuya_sheen_net_points(sheen->nu, sheen->nv, sheen->nd);
    size_t n = (size_t)data->count, channels = (size_t)data->channels;
    double *guide = NULL, *target = NULL, *weight = NULL, *control = NULL;
    *reciprocal_condition = 1.0;
    TSUYA_GOTO_DONE(status, tsuya_sheen_create_net(sheen));
    TSUYA_NEW(status, guide, n * channels);
    TSUYA_NEW(status, target, n);
    TSUYA_NEW(status, weight, n);
    TSUYA_NEW(status, control, (size_t)points);
    for (size_t k = 0; k < n; ++k) {
        tsuya_sheen_guide(guide + k * channels, sheen, &data->angles[k]);
    }
    const tsuya_polar_samples samples = {data->count, data->angles, target, weight};
    for (int c = 0; c < data->channels; ++c) {
        double condition;
        residuals(target, weight, data, c, guide);
        TSUYA_GOTO_DONE(status, tsuya_polar_fit(control, &condition, sheen->nu, sheen->nv, sheen->nd, &samples, options));
        *reciprocal_condition = fmin(*reciprocal_condition, condition);
        for (int k = 0; k < points; ++k) {
            sheen->net[(size_t)k * (size_t)sheen->line + (size_t)c] = (float)control[k];
        }
    }
done:
    tsuya_free(guide);
    tsuya_free(target);
    tsuya_free(weight);
    tsuya_free(control);
    return status;
}

/* √ of the readings' share that touches a control value, and a little everywhere. */
static void share_of(double *weight, int count)
{
    double sum = 0.0;
    for (int k = 0; k < count; ++k) {
        sum += weight[k];
    }
    for (int k = 0; k < count; ++k) {
        weight[k] = sqrt(0.1 + (sum > 0.0 ? weight[k] * count / sum : 1.0));
    }
}

tsuya_status tsuya_sheen_separate_by(tsuya_sheen *sheen, const tsuya_fit_data *data)
{
    tsuya_status status = TSUYA_OK;
    int layers = tsuya_sheen_layers(sheen);
    double *tilt = NULL, *deep = NULL, w[4];
    TSUYA_NEW(status, tilt, (size_t)sheen->nv + 3);
    TSUYA_NEW(status, deep, (size_t)layers);
    for (int k = 0; k < data->count; ++k) {
        double most = 0.0;
        for (int c = 0; c < data->channels; ++c) {
            most = fmax(most, data->root[(size_t)k * (size_t)data->channels + (size_t)c]); /* leaves NaN out */
        }
        int at = tsuya_uniform_weights(w, data->angles[k].theta_h, 0.0, 0.5 * M_PI, sheen->nv, false);
        for (int i = 0; i < 4; ++i) {
            tilt[at + i] += most * most * w[i];
        }
        at = sheen->nd > 0 ? tsuya_uniform_weights(w, data->angles[k].theta_d, 0.0, 0.5 * M_PI, sheen->nd, false) : 0;
        for (int i = 0; i < 4 && sheen->nd > 0; ++i) {
            deep[at + i] += most * most * w[i];
        }
    }
    share_of(tilt, sheen->nv + 3);
    share_of(deep, layers);
    status = tsuya_sheen_separate(sheen, tilt, sheen->nd > 0 ? deep : NULL);
done:
    tsuya_free(tilt);
    tsuya_free(deep);
    return status;
}
