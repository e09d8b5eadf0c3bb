/* Fits the weights of weave_detect/lattice.c on drawn cloth and on pictures that are none, and prints lattice_weights.h.
 *
 *     build/release/tests/weave_detect/fit_lattice 36000 > weave_detect/lattice_weights.h
 *
 * Maximum likelihood of the right alternative (or of "none" where no alternative is right), by Adam (Kingma & Ba 2015).  Draws with
 * seed 1000; tests and benches use other seeds. */
#include "scene_other.h"
#include "scene_weave.h"

#include "core/context.h"
#include "core/memory.h"
#include "weave_detect/lattice.h"

#include <math.h>
#include <omp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { N = 64, EPOCHS = 36, BATCH = 128, SEED = 1000 };

typedef struct example {
    int count, right[TSUYA_BASES + 1]; /* the last alternative is "none" */
    float feature[TSUYA_BASES + 1][TSUYA_FEATURES];
} example;

static double angle(const double f[2]) { return tsuya_line_wrap(atan2(f[0], f[1])); }

static bool family_right(const double f[2], double want_deg, double want_px)
{
    double miss = tsuya_line_difference(angle(f), want_deg * M_PI / 180.0);
    return miss < 2.5 * M_PI / 180.0 && fabs(hypot(f[0], f[1]) * want_px - 1.0) < 0.09;
}

static void make(example *e, uint64_t index)
{
    static _Thread_local tsuya_spectrum *s;
    float values[N * N];
    weave_cloth cloth;
    weave_camera camera;
    tsuya_bases bases;
    bool is_cloth = index % 5 != 4, unresolved = index % 20 == 19;
    if (!s && tsuya_spectrum_create(&s, N) != TSUYA_OK) {
        abort();
    }
    if (is_cloth) {
        weave_random(&cloth, &camera, SEED, index);
        weave_draw(values, N, &cloth, &camera);
    } else if (unresolved) { /* finer than pixels: what is seen is moiré */
        weave_random(&cloth, &camera, SEED, index);
        double finer = 1.7 / fmin(cloth.weft_px, cloth.warp_px) * (0.4 + 0.6 * tsuya_random_uniform(SEED, 6, index));
        cloth.weft_px *= finer;
        cloth.warp_px *= finer;
        cloth.uneven = 0.0;
        camera.blur_px = 0.3;
        camera.contrast *= 2.0;
        weave_draw(values, N, &cloth, &camera);
    } else {
        other_draw(values, N, (other_kind)(index / 5 % (OTHER_KIND_COUNT - 1)), SEED, index);
    }
    tsuya_spectrum_run(s, values);
    tsuya_bases_list(&bases, s);
    bool any = false;
    e->count = bases.count;
    for (int k = 0; k < bases.count; k++) {
        const tsuya_basis *b = &bases.basis[k];
        memcpy(e->feature[k], b->feature, sizeof b->feature);
        e->right[k] = is_cloth && ((family_right(b->f[0], cloth.weft_deg, cloth.weft_px) && family_right(b->f[1], cloth.warp_deg, cloth.warp_px)) ||
                                   (family_right(b->f[1], cloth.weft_deg, cloth.weft_px) && family_right(b->f[0], cloth.warp_deg, cloth.warp_px)));
        any = any || e->right[k];
    }
    memcpy(e->feature[bases.count], bases.none_feature, sizeof bases.none_feature);
    e->right[bases.count] = !any;
}

typedef struct layers {
    float in[TSUYA_HIDDEN];
    double score;
} layers;

static void forward(layers *l, const float *weight, const float *feature)
{
    const float *out = weight + TSUYA_HIDDEN * (TSUYA_FEATURES + 1);
    l->score = (double)out[TSUYA_HIDDEN];
    for (int h = 0; h < TSUYA_HIDDEN; h++) {
        const float *w = weight + h * (TSUYA_FEATURES + 1);
        float lane[8] = {0};
        for (int f = 0; f < TSUYA_FEATURES; f += 8) {
            for (int k = 0; k < 8; k++) {
                lane[k] += w[f + k] * feature[f + k];
            }
        }
        float in = w[TSUYA_FEATURES];
        for (int k = 0; k < 8; k++) {
            in += lane[k];
        }
        l->in[h] = in;
        l->score += (double)(out[h] * (in > 0.0f ? in : 0.1f * in));
    }
}

static void backward(float *gradient, const float *weight, const float *feature, const layers *l, float slope)
{
    const float *out = weight + TSUYA_HIDDEN * (TSUYA_FEATURES + 1);
    float *out_gradient = gradient + TSUYA_HIDDEN * (TSUYA_FEATURES + 1);
    for (int h = 0; h < TSUYA_HIDDEN; h++) {
        float leak = l->in[h] > 0.0f ? 1.0f : 0.1f, through = slope * out[h] * leak, *g = gradient + h * (TSUYA_FEATURES + 1);
        out_gradient[h] += slope * l->in[h] * leak;
        for (int f = 0; f < TSUYA_FEATURES; f++) {
            g[f] += through * feature[f];
        }
        g[TSUYA_FEATURES] += through;
    }
    out_gradient[TSUYA_HIDDEN] += slope;
}

/* Adds the gradient of −ln P(right) to `gradient`; returns the loss, and whether the most probable alternative is right. */
static double accumulate(float *gradient, const float *weight, const example *e, bool *hit)
{
    static layers l[TSUYA_BASES + 1];
    double p[TSUYA_BASES + 1], sum = 0.0, good = 0.0, highest = -1e30;
    int best = 0;
    for (int k = 0; k <= e->count; k++) {
        forward(&l[k], weight, e->feature[k]);
        best = l[k].score > highest ? k : best;
        highest = fmax(highest, l[k].score);
    }
    for (int k = 0; k <= e->count; k++) {
        p[k] = exp(l[k].score - highest);
        sum += p[k];
        good += e->right[k] ? p[k] : 0.0;
    }
    *hit = e->right[best];
    for (int k = 0; gradient && k <= e->count; k++) {
        double slope = p[k] / sum - (e->right[k] ? p[k] / good : 0.0); /* of the loss by the score */
        if (fabs(slope) > 1e-4) {
            backward(gradient, weight, e->feature[k], &l[k], (float)slope);
        }
    }
    return -log(fmax(good / sum, 1e-12));
}

static void report(const char *name, const float *weight, const example *list, int count)
{
    double loss = 0.0;
    int hits = 0, reachable = 0;
    for (int i = 0; i < count; i++) {
        bool hit;
        loss += accumulate(NULL, weight, &list[i], &hit);
        hits += hit;
        reachable += !list[i].right[list[i].count];
    }
    fprintf(stderr, "%s: loss %.4f, right %.4f, reachable %.4f\n", name, loss / count, (double)hits / count, (double)reachable / count);
}

static void fit(float *weight, const example *list, int count, const example *held, int held_count)
{
    static double m[TSUYA_WEIGHTS], v[TSUYA_WEIGHTS];
    int step = 0;
    for (int i = 0; i < TSUYA_WEIGHTS; i++) {
        weight[i] = (float)(0.25 * tsuya_random_normal(SEED, 5, (uint64_t)i));
    }
    for (int epoch = 0; epoch < EPOCHS; epoch++) {
        double rate = 0.004 * pow(0.04, (double)epoch / EPOCHS);
        for (int start = 0; start + BATCH <= count; start += BATCH) {
            float gradient[TSUYA_WEIGHTS] = {0};
            for (int k = 0; k < BATCH; k++) {
                bool hit;
                accumulate(gradient, weight, &list[tsuya_random_u64(SEED, (uint64_t)(100 + epoch), (uint64_t)(start + k)) % (uint64_t)count], &hit);
            }
            step++;
            for (int i = 0; i < TSUYA_WEIGHTS; i++) {
                double g = (double)gradient[i] / BATCH + 1e-5 * (double)weight[i];
                m[i] = 0.9 * m[i] + 0.1 * g;
                v[i] = 0.999 * v[i] + 0.001 * g * g;
                double mh = m[i] / (1.0 - pow(0.9, step)), vh = v[i] / (1.0 - pow(0.999, step));
                weight[i] -= (float)(rate * mh / (sqrt(vh) + 1e-8));
            }
        }
        if (epoch % 6 == 5) {
            report("fit", weight, list, count);
            report("held out", weight, held, held_count);
        }
    }
}

static void print_weights(const float *weight)
{
    printf("/* Weights of the network in lattice.c, written by tests/weave_detect/fit_lattice.c: hidden units × (%d features, bias), then the output's. */\n"
           "#ifndef TSUYA_WEAVE_DETECT_LATTICE_WEIGHTS_H\n#define TSUYA_WEAVE_DETECT_LATTICE_WEIGHTS_H\n\n"
           "static const float tsuya_lattice_weights[%d] = {", TSUYA_FEATURES, TSUYA_WEIGHTS);
    for (int i = 0; i < TSUYA_WEIGHTS; i++) {
        printf("%s%.5gf,", i % 10 == 0 ? "\n    " : " ", (double)weight[i] == rint((double)weight[i]) ? (double)weight[i] + 1e-6 : (double)weight[i]);
    }
    printf("\n};\n\n#endif\n");
}

int main(int argc, char **argv)
{
    int count = argc > 1 ? atoi(argv[1]) : 6000, held = count / 10;
    static float weight[TSUYA_WEIGHTS];
    example *list = tsuya_calloc((size_t)count, sizeof *list);
    if (!list) {
        return 1;
    }
#pragma omp parallel for schedule(dynamic, 16)
    for (int i = 0; i < count; i++) {
        make(&list[i], (uint64_t)i);
    }
    fprintf(stderr, "drawn\n");
    fit(weight, list + held, count - held, list, held);
    print_weights(weight);
    tsuya_free(list);
    return 0;
}
