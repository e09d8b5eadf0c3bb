#include "weave_detect/detector.h"

#include "core/memory.h"
#include "weave_detect/flow.h"
#include "weave_detect/refine.h"

#include <math.h>
#include <string.h>

static const double SAME_RAD = 2.0 * M_PI / 180.0, RIGHT_RAD = 2.0 * M_PI / 180.0;
static const float LONE_LEVEL = 3.5f, NOISE_LEVEL = 2.55f, NONE = 0.5f;
enum { FOLLOW_ROUNDS = 2 };
static const float LEAST_PROBABILITY = 0.003f;
static const double SHARE_LEAST = 0.2; /* of the window's power that a patch must hold */
static const double DOUBT = 0.5;       /* below, the patch is also looked at alone */

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

static bool same_angles(const double p[2], const double q[2])
{
    double straight = fmax(tsuya_line_difference(p[0], q[0]), tsuya_line_difference(p[1], q[1]));
    double swapped = fmax(tsuya_line_difference(p[0], q[1]), tsuya_line_difference(p[1], q[0]));
    return fmin(straight, swapped) < SAME_RAD;
}

#define FREQUENCIES(p) ((const double(*)[2])(p)->f)

/* The angle pair of highest probability; `best` its likeliest basis. */
static double choose(const tsuya_bases *bases, int *best)
{
    double highest = 0.0, angle[TSUYA_BASES][2];
    *best = -1;
    for (int i = 0; i < bases->count; i++) {
        for (int k = 0; k < 2; k++) {
            angle[i][k] = bases->basis[i].probability > 1e-4f ? thread_angle(bases->basis[i].f[k]) : 0.0;
        }
    }
    for (int i = 0; i < bases->count; i++) {
        double sum = 0.0;
        if ((double)bases->basis[i].probability < 0.02 * highest) {
            continue;
        }
        for (int j = 0; j < bases->count; j++) {
            bool alike = bases->basis[j].probability > 1e-4f && same_angles(angle[i], angle[j]);
            sum += alike ? (double)bases->basis[j].probability : 0.0;
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

static void set_threads(tsuya_threads *threads, const tsuya_refined *refined, double probability, tsuya_kind kind)
{
    /* where threads are uneven the points stray by more than noise says, and neighbouring points stray together: hence the square */
    double stray = fmax(refined->scatter, 1.0), worse = fmax(refined->sigma_rad[0], refined->sigma_rad[1]) * stray * stray;
    threads->a = family_of(refined->f[0], refined->sigma_rad[0]);
    threads->b = family_of(refined->f[1], refined->sigma_rad[1]);
    threads->confidence = probability * erf(RIGHT_RAD / (sqrt(2.0) * fmax(worse, 1e-6)));
    threads->kind = kind.kind;
    threads->diagonal_rad = kind.diagonal_rad;
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
    set_threads(threads, &refined, probability, tsuya_kind_tell(d->spectrum, FREQUENCIES(&refined)));
}

static void keep_alternative(tsuya_finding *finding, const tsuya_basis *b)
{
    int place = finding->count < TSUYA_ALTERNATIVES ? finding->count++ : TSUYA_ALTERNATIVES;
    while (place > 0 && finding->alternative[place - 1].probability < b->probability) {
        if (place < TSUYA_ALTERNATIVES) {
            finding->alternative[place] = finding->alternative[place - 1];
        }
        place--;
    }
    if (place < TSUYA_ALTERNATIVES) {
        tsuya_alternative *a = &finding->alternative[place];
        *a = (tsuya_alternative){.probability = b->probability, .step = b->step};
        memcpy(a->f, b->f, sizeof a->f);
        for (int k = 0; k < 2; k++) {
            a->angle_rad[k] = thread_angle(b->f[k]);
            a->length[k] = hypot(b->f[k][0], b->f[k][1]);
        }
    }
}

void tsuya_detector_find(tsuya_detector *d, tsuya_finding *finding, const float *values)
{
    finding->count = 0;
    finding->none_probability = 1.0f;
    finding->belief = 0.0f;
    finding->empty = !tsuya_spectrum_run(d->spectrum, values) || d->spectrum->peak_count == 0 || d->spectrum->peak[0].level < LONE_LEVEL;
    if (finding->empty) {
        return;
    }
    tsuya_bases_list(&d->bases, d->spectrum);
    tsuya_bases_weigh(&d->bases);
    finding->none_probability = is_one_tone(d->spectrum) ? 1.0f : d->bases.none_probability;
    for (int k = 0; k < d->bases.count; k++) {
        if (d->bases.basis[k].probability > LEAST_PROBABILITY) {
            keep_alternative(finding, &d->bases.basis[k]);
        }
    }
    for (int k = 0; k < finding->count; k++) {
        tsuya_alternative *a = &finding->alternative[k];
        a->kind = tsuya_kind_tell(d->spectrum, FREQUENCIES(a));
        a->point_count = tsuya_refine_points(a->point, TSUYA_TONES, d->spectrum, a->step, FREQUENCIES(a));
    }
    tsuya_finding_believe(finding);
}

void tsuya_finding_believe(tsuya_finding *finding)
{
    const tsuya_alternative *list = finding->alternative;
    double sum = 0.0;
    for (int k = 0; k < finding->count; k++) {
        sum += same_angles(list[0].angle_rad, list[k].angle_rad) ? (double)list[k].probability : 0.0;
    }
    finding->belief = finding->none_probability < NONE ? (float)fmin(sum, 1.0) : 0.0f;
}

/* The likeliest alternative on the patch; false where the patch does not hold its share of it. */
static bool follow(tsuya_detector *d, tsuya_threads *threads, const tsuya_finding *finding)
{
    const tsuya_alternative *a = &finding->alternative[0];
    tsuya_refined refined;
    double want = 0.0;
    for (int t = 0; t < a->point_count; t++) {
        want += (double)a->point[t].power;
    }
    memcpy(refined.f, a->f, sizeof refined.f);
    for (int round = 0; round < FOLLOW_ROUNDS; round++) {
        double f[2][2];
        memcpy(f, refined.f, sizeof f);
        int count = round + 1 < FOLLOW_ROUNDS && a->point_count > TSUYA_TONES_FIRST ? TSUYA_TONES_FIRST : a->point_count; /* they are sorted */
        if (!tsuya_refine_at(&refined, d->refiner, (const double(*)[2])f, a->point, count)) {
            return false;
        }
    }
    const double angle[2] = {thread_angle(refined.f[0]), thread_angle(refined.f[1])};
    if (refined.power < SHARE_LEAST * want || !same_angles(a->angle_rad, angle)) {
        return false;
    }
    set_threads(threads, &refined, (double)finding->belief, a->kind);
    return true;
}

void tsuya_detector_follow(tsuya_detector *d, tsuya_threads *threads, const tsuya_finding *const *finding, int count, const float *values)
{
    bool empty = count > 0, followed = false;
    *threads = (tsuya_threads){0};
    for (int k = 0; k < count; k++) {
        empty = empty && finding[k]->empty;
    }
    if (!tsuya_spectrum_detrend(d->spectrum, values)) {
        return;
    }
    tsuya_flow(threads, d->spectrum->detrended, d->n);
    tsuya_refine_begin(d->refiner, d->spectrum);
    for (int k = 0; k < count && !followed && !empty; k++) {
        followed = finding[k]->count > 0 && finding[k]->none_probability < NONE && follow(d, threads, finding[k]);
    }
    if (!empty && (!followed || threads->confidence < DOUBT)) {
        tsuya_threads own;
        tsuya_detector_run(d, &own, values);
        *threads = own.confidence > threads->confidence || !followed ? own : *threads;
    }
}
