/* Fits the weights of weave_detect/lattice.c on drawn cloth and on pictures that are none, and prints lattice_weights.h.
 *
 *     build/release/tests/weave_detect/fit_lattice 18000 [DRAWN] > weave_detect/lattice_weights.h
 *
 * Maximum likelihood of the right alternative (or of "none" where no alternative is right), by Adam (Kingma & Ba 2015), on windows of 128 px
 * and on their middle 64.  Draws with seed 1000; tests and benches use other seeds.  DRAWN keeps the pictures for the next fit. */
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

enum { N = 64, WIDE = 128, EPOCHS = 30, BATCH = 128, SEED = 1000 };

typedef struct example {
    int count;
    uint8_t right[TSUYA_BASES + 1]; /* the last alternative is "none" */
    float feature[TSUYA_BASES + 1][TSUYA_FEATURES];
} example;

typedef struct sample {
    int kind; /* 0 cloth, 1 rough cloth, 2 finer than pixels, else no cloth */
    float weft_deg, warp_deg, weft_px, warp_px, contrast, rough;
    int draft;
    uint16_t value[WIDE * WIDE];
} sample;

static void draw(sample *s, uint64_t index)
{
    float values[WIDE * WIDE];
    weave_cloth cloth = {0};
    weave_camera camera = {0};
    s->kind = index % 10 < 5 ? 0 : index % 10 < 8 ? 1 : index % 20 == 19 ? 2 : 3;
    if (s->kind == 3) {
        other_draw(values, WIDE, (other_kind)(index / 10 % (OTHER_KIND_COUNT - 1)), SEED, index);
    } else {
        (s->kind == 1 ? weave_random_rough : weave_random)(&cloth, &camera, SEED, index);
        if (s->kind == 2) { /* what is seen is moiré */
            double finer = 1.7 / fmin(cloth.weft_px, cloth.warp_px) * (0.4 + 0.6 * tsuya_random_uniform(SEED, 6, index));
            cloth.weft_px *= finer;
            cloth.warp_px *= finer;
            cloth.uneven = 0.0;
            camera.blur_px = 0.3;
            camera.contrast *= 2.0;
        }
        weave_draw(values, WIDE, &cloth, &camera);
    }
    s->weft_deg = (float)cloth.weft_deg;
    s->warp_deg = (float)cloth.warp_deg;
    s->weft_px = (float)cloth.weft_px;
    s->warp_px = (float)cloth.warp_px;
    s->contrast = (float)camera.contrast;
    s->rough = (float)cloth.rough;
    s->draft = (int)cloth.draft;
    for (int i = 0; i < WIDE * WIDE; i++) {
        s->value[i] = (uint16_t)fmin(fmax(32768.0 * (double)values[i] + 8192.0, 0.0), 65535.0);
    }
}

static double angle(const double f[2]) { return tsuya_line_wrap(atan2(f[0], f[1])); }

static bool family_right(const double f[2], double want_deg, double want_px, double rough)
{
    double miss = tsuya_line_difference(angle(f), want_deg * M_PI / 180.0);
    return miss < 2.5 * M_PI / 180.0 && fabs(hypot(f[0], f[1]) * want_px - 1.0) < 0.09 + 0.08 * rough;
}

static bool is_right(const tsuya_basis *b, const sample *s)
{
    double weft = (double)s->weft_deg, warp = (double)s->warp_deg, weft_px = (double)s->weft_px, warp_px = (double)s->warp_px, rough = (double)s->rough;
    return s->kind < 2 && ((family_right(b->f[0], weft, weft_px, rough) && family_right(b->f[1], warp, warp_px, rough)) ||
                           (family_right(b->f[1], weft, weft_px, rough) && family_right(b->f[0], warp, warp_px, rough)));
}

/* The middle n × n. */
static void make(example *e, const sample *s, int n)
{
    static _Thread_local tsuya_spectrum *spectra[2];
    tsuya_spectrum **spectrum = &spectra[n == WIDE];
    float values[WIDE * WIDE];
    tsuya_bases bases;
    if (!*spectrum && tsuya_spectrum_create(spectrum, n) != TSUYA_OK) {
        abort();
    }
    for (int y = 0; y < n; y++) {
        for (int x = 0; x < n; x++) {
            int from = (WIDE - n) / 2;
            values[y * n + x] = (float)(s->value[(y + from) * WIDE + x + from] - 8192) / 32768.0f;
        }
    }
    tsuya_spectrum_run(*spectrum, values);
    tsuya_bases_list(&bases, *spectrum);
    bool any = false;
    e->count = bases.count;
    for (int k = 0; k < bases.count; k++) {
        memcpy(e->feature[k], bases.basis[k].feature, sizeof e->feature[k]);
        e->right[k] = is_right(&bases.basis[k], s);
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
    layers l[TSUYA_BASES + 1];
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
    double loss[2] = {0.0, 0.0};
    int hits[2] = {0, 0}, reachable[2] = {0, 0};
#pragma omp parallel for reduction(+ : loss, hits, reachable)
    for (int i = 0; i < count; i++) {
        bool hit;
        loss[i & 1] += accumulate(NULL, weight, &list[i], &hit);
        hits[i & 1] += hit;
        reachable[i & 1] += !list[i].right[list[i].count];
    }
    for (int wide = 0; wide < 2; wide++) {
        double half = 0.5 * count;
        fprintf(stderr, "%s, %d px: loss %.4f, right %.4f, reachable %.4f\n", name, wide ? WIDE : N, loss[wide] / half, hits[wide] / half, reachable[wide] / half);
    }
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

static void draw_all(example *list, int count, const char *path)
{
    FILE *kept = path ? fopen(path, "rb") : NULL;
    FILE *out = path && !kept ? fopen(path, "wb") : NULL;
#pragma omp parallel for ordered schedule(dynamic, 1)
    for (int i = 0; i < count; i++) {
        sample s;
        if (!kept) {
            draw(&s, (uint64_t)i);
        }
#pragma omp ordered
        {
            if ((kept && fread(&s, sizeof s, 1, kept) != 1) || (out && fwrite(&s, sizeof s, 1, out) != 1)) {
                abort();
            }
        }
        make(&list[2 * i], &s, N);
        make(&list[2 * i + 1], &s, WIDE);
    }
    if (kept) {
        fclose(kept);
    }
    if (out) {
        fclose(out);
    }
}

int main(int argc, char **argv)
{
    int count = argc > 1 ? atoi(argv[1]) : 6000, held = count / 10;
    static float weight[TSUYA_WEIGHTS];
    example *list = tsuya_calloc(2 * (size_t)count, sizeof *list);
    if (!list) {
        return 1;
    }
    draw_all(list, count, argc > 2 ? argv[2] : NULL);
    fprintf(stderr, "drawn\n");
    fit(weight, list + 2 * held, 2 * (count - held), list, 2 * held);
    print_weights(weight);
    tsuya_free(list);
    return 0;
}
