#include "weave_detect/detector.h"

#include "core/memory.h"
#include "weave_detect/flow.h"
#include "weave_detect/refine.h"

#include <math.h>

static const double SAME_RAD = 2.0 * M_PI / 180.0, RIGHT_RAD = 2.0 * M_PI / 180.0;
static const float LONE_LEVEL = 3.5f, NOISE_LEVEL = 2.55f, NONE = 0.5f;
static const double KIND_MARGIN = 0.25; /* of the level's feature over the next step's, before a kind is named */

struct tsuya_detector {
    int n, rounds;
    tsuya_spectrum *spectrum;
    tsuya_refiner *refiner;
    tsuya_bases bases;
};

tsuya_status tsuya_detector_create(tsuya_detector **detector, int n, const tsuya_detector_options *options)
{
    tsuya_status status = TSUYA_OK;
    tsuya_detector *d = tsuya_calloc(1, sizeof *d);
    *detector = NULL;
    if (!d) {
        return TSUYA_ERROR_MEMORY;
    }
    d->n = n;
    d->rounds = options ? options->rounds : 1;
    TSUYA_GOTO_DONE(status, tsuya_spectrum_create(&d->spectrum, n));
    TSUYA_GOTO_DONE(status, tsuya_refiner_create(&d->refiner, n));
    *detector = d;
done:
    if (status != TSUYA_OK) {
        tsuya_detector_free(d);
    }
    return status;
}

void tsuya_detector_free(tsuya_detector *d)
{
    if (d) {
        tsuya_spectrum_free(d->spectrum);
        tsuya_refiner_free(d->refiner);
        tsuya_free(d);
    }
}

/* Threads run at right angles to their frequency; y up. */
static double thread_angle(const double f[2]) { return tsuya_line_wrap(atan2(f[0], f[1])); }

static bool same_threads(const tsuya_basis *p, const tsuya_basis *q)
{
    double aa = tsuya_line_difference(thread_angle(p->f[0]), thread_angle(q->f[0])), bb = tsuya_line_difference(thread_angle(p->f[1]), thread_angle(q->f[1]));
    double ab = tsuya_line_difference(thread_angle(p->f[0]), thread_angle(q->f[1])), ba = tsuya_line_difference(thread_angle(p->f[1]), thread_angle(q->f[0]));
    return fmin(fmax(aa, bb), fmax(ab, ba)) < SAME_RAD;
}

/* The angle pair of highest probability; `best` its likeliest basis. */
static double choose(const tsuya_bases *bases, int *best)
{
    double highest = 0.0;
    *best = -1;
    for (int i = 0; i < bases->count; i++) {
        double sum = 0.0;
        if ((double)bases->basis[i].probability < 0.02 * highest) {
            continue;
        }
        for (int j = 0; j < bases->count; j++) {
            sum += same_threads(&bases->basis[i], &bases->basis[j]) ? (double)bases->basis[j].probability : 0.0;
        }
        bool likelier = *best < 0 || sum > highest * 1.0001 || (sum > highest * 0.9999 && bases->basis[i].probability > bases->basis[*best].probability);
        if (likelier) {
            highest = fmax(sum, highest);
            *best = i;
        }
    }
    return fmin(highest, 1.0);
}

static tsuya_thread_family family_of(const double f[2], double sigma_rad)
{
    return (tsuya_thread_family){true, thread_angle(f), 1.0 / hypot(f[0], f[1]), sigma_rad};
}

/* Of a grating, or of threads that hide the others: the strongest peak alone. */
static void one_family(tsuya_detector *d, tsuya_threads *threads)
{
    const tsuya_peak *p = d->spectrum->peak;
    double f[2] = {(double)p->fx, (double)p->fy}, sigma;
    if (d->spectrum->peak_count > 0 && p->level > LONE_LEVEL) {
        tsuya_refine_single(f, &sigma, d->refiner, d->spectrum, d->rounds);
        threads->a = family_of(f, sigma);
    }
}

/* All peaks but the strongest and its harmonics are as noise makes them. */
static bool is_one_tone(const tsuya_spectrum *s)
{
    const tsuya_peak *p = s->peak;
    double pp = (double)(p->fx * p->fx + p->fy * p->fy);
    if (s->peak_count == 0 || p->level < LONE_LEVEL) {
        return false;
    }
    for (int i = 1; i < s->peak_count && s->peak[i].level > NOISE_LEVEL; i++) {
        const tsuya_peak *q = &s->peak[i];
        double times = rint((double)(p->fx * q->fx + p->fy * q->fy) / pp), dx = (double)q->fx - times * (double)p->fx, dy = (double)q->fy - times * (double)p->fy;
        if (times == 0.0 || dx * dx + dy * dy > 1.0 / ((double)s->n * s->n)) {
            return false;
        }
    }
    return true;
}

void tsuya_detector_run(tsuya_detector *d, tsuya_threads *threads, const float *values)
{
    int best;
    tsuya_refined refined;
    *threads = (tsuya_threads){0};
    if (!tsuya_spectrum_run(d->spectrum, values)) {
        return;
    }
    tsuya_flow(threads, d->spectrum->detrended, d->n);
    tsuya_bases_list(&d->bases, d->spectrum);
    tsuya_bases_weigh(&d->bases);
    double probability = choose(&d->bases, &best);
    if (best < 0 || d->bases.none_probability > NONE || is_one_tone(d->spectrum)) {
        one_family(d, threads);
        return;
    }
    const tsuya_basis *b = &d->bases.basis[best];
    tsuya_refine(&refined, d->refiner, d->spectrum, b, d->rounds);
    threads->a = family_of(refined.f[0], refined.sigma_rad[0]);
    threads->b = family_of(refined.f[1], refined.sigma_rad[1]);
    double worse = fmax(refined.sigma_rad[0], refined.sigma_rad[1]);
    threads->confidence = probability * erf(RIGHT_RAD / (sqrt(2.0) * fmax(worse, 1e-6)));
    if (b->feature[TSUYA_FEATURE_MARGIN] > (float)KIND_MARGIN) {
        threads->kind = tsuya_steps[b->step].kind;
    }
}
