/* Fits the weights of weave_detect/lattice.c on drawn cloth and on pictures that are none, and prints lattice_weights.h.
 *
 *     build/release/tests/weave_detect/fit_lattice 4000 [DRAWN] > weave_detect/lattice_weights.h
 *
 * The fit goes on from the weights that are there (first of 18,000 draws without prints and seams), and is held to them where the draws say
 * little.
 * Maximum likelihood of the right alternative (or of "none" where no alternative is right), by Adam (Kingma & Ba 2015), on windows of 128 px
 * and on their middle 64.  Draws with seed 1000; tests and benches use other seeds.  DRAWN keeps the pictures for the next fit. */
#include "scene_hard.h"
#include "scene_other.h"
#include "scene_weave.h"

#include "core/context.h"
#include "core/memory.h"
#include "weave_detect/lattice.h"
#include "weave_detect/lattice_weights.h"

#include <math.h>
#include <omp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { N = 64, WIDE = 128, EPOCHS = 10, BATCH = 128, SEED = 1000 };

static const double HOLD = 1e-4;

typedef struct example {
    int count;
    float weight;
    uint8_t right[TSUYA_BASES + 1]; /* the last alternative is "none" */
    float feature[TSUYA_BASES + 1][TSUYA_FEATURES];
} example;

enum { CLOTH, ROUGH, SPUN, PRINTED, SEAMED, FINER, OTHER, KINDS };

typedef struct sample {
    int kind, draft;
    float contrast, rough;
    float weft_deg[2], warp_deg[2], weft_px[2], warp_px[2]; /* of one cloth, of two where they are sewn together; px 0: none */
    uint16_t value[WIDE * WIDE];
} sample;

static int random_kind(uint64_t index)
{
    static const double share[KINDS] = {0.27, 0.12, 0.19, 0.13, 0.05, 0.13, 0.11};
    double at = tsuya_random_uniform(SEED, 7, index);
    int kind = 0;
    while (kind + 1 < KINDS && at >= share[kind]) {
        at -= share[kind++];
    }
    return kind;
}

static void random_cloth(weave_cloth *cloth, weave_camera *camera, int kind, uint64_t index)
{
    int which = kind == ROUGH || kind == SPUN ? kind : kind == CLOTH || kind == FINER ? CLOTH : (int)(3.0 * tsuya_random_uniform(SEED, 8, index));
    (which == ROUGH ? weave_random_rough : which == SPUN ? weave_random_spun : weave_random)(cloth, camera, SEED, index);
    if (kind == FINER) { /* what is seen is moiré; half of it of about a pixel a thread, where not even the interlacing is seen beside it */
        double r = tsuya_random_uniform(SEED, 6, index), least = r < 0.5 ? 0.8 + r : 0.6 + 1.4 * r;
        double finer = least / fmax(cloth->weft_px, cloth->warp_px);
        cloth->weft_px *= finer;
        cloth->warp_px *= finer;
        cloth->uneven = 0.0;
        camera->blur_px = fmin(camera->blur_px, 0.45);
        camera->contrast *= 2.0;
    }
}

static void note(sample *s, int k, const weave_cloth *cloth)
{
    s->weft_deg[k] = (float)cloth->weft_deg;
    s->warp_deg[k] = (float)cloth->warp_deg;
    s->weft_px[k] = (float)cloth->weft_px;
    s->warp_px[k] = (float)cloth->warp_px;
}

static void sew(float *values, sample *s, weave_cloth *cloth, weave_camera *camera, uint64_t index)
{
    float other[WIDE * WIDE];
    double turn = 10.0 + 70.0 * tsuya_random_uniform(SEED, 9, index);
    cloth->weft_deg += turn;
    cloth->warp_deg += turn;
    cloth->seed += 3;
    camera->seed += 3;
    weave_draw(other, WIDE, cloth, camera);
    note(s, 1, cloth);
    hard_join(values, other, WIDE, SEED, index);
}

static void draw(sample *s, uint64_t index)
{
    float values[WIDE * WIDE];
    weave_cloth cloth = {0};
    weave_camera camera = {0};
    *s = (sample){.kind = random_kind(index)};
    if (s->kind == OTHER) {
        other_draw(values, WIDE, (other_kind)(int)((OTHER_KIND_COUNT - 1) * tsuya_random_uniform(SEED, 10, index)), SEED, index);
    } else {
        random_cloth(&cloth, &camera, s->kind, index);
        weave_draw(values, WIDE, &cloth, &camera);
        if (s->kind != FINER) {
            note(s, 0, &cloth);
        }
        if (s->kind == PRINTED) {
            hard_print(values, WIDE, cloth.weft_deg, cloth.warp_deg, SEED, index);
        } else if (s->kind == SEAMED) {
            sew(values, s, &cloth, &camera, index);
        }
    }
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
    for (int k = 0; k < 2 && s->weft_px[k] > 0.0f; k++) {
        double weft = (double)s->weft_deg[k], warp = (double)s->warp_deg[k], weft_px = (double)s->weft_px[k], warp_px = (double)s->warp_px[k];
        double rough = (double)s->rough;
        if ((family_right(b->f[0], weft, weft_px, rough) && family_right(b->f[1], warp, warp_px, rough)) ||
            (family_right(b->f[1], weft, weft_px, rough) && family_right(b->f[0], warp, warp_px, rough))) {
            return true;
        }
    }
    return false;
}

/* What else may have been done to a piece of cloth: nothing, dyed once, dyed crosswise, seen through a colour filter array. */
enum { AS_DRAWN, DYED, CROSSED, FILTERED };

static int second_look(const sample *s, uint64_t index)
{
    double r = tsuya_random_uniform(SEED, 11, index);
    return s->kind > SPUN ? AS_DRAWN : r < 0.13 ? DYED : r < 0.25 ? CROSSED : r < 0.42 ? FILTERED : AS_DRAWN;
}

static void change(sample *s, int look, uint64_t index)
{
    float values[WIDE * WIDE];
    for (int i = 0; i < WIDE * WIDE; i++) {
        values[i] = (float)(s->value[i] - 8192) / 32768.0f;
    }
    if (look == FILTERED) {
        hard_mosaic(values, WIDE, SEED + 1, index);
    } else {
        hard_print(values, WIDE, (double)s->weft_deg[0], (double)s->warp_deg[0], SEED + 1, index);
    }
    if (look == CROSSED) {
        hard_print(values, WIDE, (double)s->weft_deg[0], (double)s->warp_deg[0], SEED + 2, index);
    }
    for (int i = 0; i < WIDE * WIDE; i++) {
        s->value[i] = (uint16_t)fmin(fmax(32768.0 * (double)values[i] + 8192.0, 0.0), 65535.0);
    }
}

/* The middle n × n. */
static void make(example *e, const sample *s, int n)
{
    static const float weight[KINDS] = {[CLOTH] = 2.0f, [ROUGH] = 1.0f, [SPUN] = 1.5f, [PRINTED] = 1.0f, [SEAMED] = 1.0f, [FINER] = 3.0f, [OTHER] = 1.5f};
    e->weight = weight[s->kind];
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
        double slope = (double)e->weight * (p[k] / sum - (e->right[k] ? p[k] / good : 0.0)); /* of the loss by the score */
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
        weight[i] = tsuya_lattice_weights[i];
    }
    for (int epoch = 0; epoch < EPOCHS; epoch++) {
        double rate = 0.002 * pow(0.04, (double)epoch / EPOCHS);
        for (int start = 0; start + BATCH <= count; start += BATCH) {
            float gradient[TSUYA_WEIGHTS] = {0};
            for (int k = 0; k < BATCH; k++) {
                bool hit;
                accumulate(gradient, weight, &list[tsuya_random_u64(SEED, (uint64_t)(100 + epoch), (uint64_t)(start + k)) % (uint64_t)count], &hit);
            }
            step++;
            for (int i = 0; i < TSUYA_WEIGHTS; i++) {
                double g = (double)gradient[i] / BATCH + HOLD * (double)(weight[i] - tsuya_lattice_weights[i]);
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

/* Pictures that `path` holds are taken from there, the others are drawn and added to it.  Four examples of each: two looks at two sizes; one
 * look that changes nothing counts nothing. */
static void draw_all(example *list, int count, const char *path)
{
    FILE *file = path ? fopen(path, "a+b") : NULL;
    bool kept = file != NULL;
#pragma omp parallel for ordered schedule(dynamic, 1)
    for (int i = 0; i < count; i++) {
        sample s;
        bool ready = false;
#pragma omp critical(fit_lattice_file)
        if (kept) {
            ready = fseek(file, (long)i * (long)sizeof s, SEEK_SET) == 0 && fread(&s, sizeof s, 1, file) == 1;
        }
        if (!ready) {
            draw(&s, (uint64_t)i);
        }
#pragma omp ordered
#pragma omp critical(fit_lattice_file)
        if (file && !ready && fwrite(&s, sizeof s, 1, file) != 1) {
            abort();
        }
        make(&list[4 * i], &s, N);
        make(&list[4 * i + 1], &s, WIDE);
        int look = second_look(&s, (uint64_t)i);
        if (look != AS_DRAWN) {
            change(&s, look, (uint64_t)i);
            make(&list[4 * i + 2], &s, N);
            make(&list[4 * i + 3], &s, WIDE);
            list[4 * i + 2].weight = list[4 * i + 3].weight = 1.0f;
        }
    }
    if (file) {
        fclose(file);
    }
}

int main(int argc, char **argv)
{
    int count = argc > 1 ? atoi(argv[1]) : 6000, held = count / 10;
    static float weight[TSUYA_WEIGHTS];
    example *list = tsuya_calloc(4 * (size_t)count, sizeof *list);
    if (!list) {
        return 1;
    }
    draw_all(list, count, argc > 2 ? argv[2] : NULL);
    fprintf(stderr, "drawn\n");
    int used = 0, used_held = 0;
    for (int i = 0; i < 4 * count; i++) { /* without the looks that were not taken; still by turns 64 and 128 px */
        if (list[i].weight > 0.0f) {
            list[used++] = list[i];
        }
        used_held = i + 1 == 4 * held ? used : used_held;
    }
    fit(weight, list + used_held, used - used_held, list, used_held);
    print_weights(weight);
    tsuya_free(list);
    return 0;
}
