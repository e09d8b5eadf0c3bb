/* Photographs against each other: who sees what others see, and what that makes of each. */
#include "capture/check_photo.h"

#include "core/memory.h"
#include "core/order.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { WINDOW = 5, ALL_PAIRS_BELOW = 16 };
/* A photograph is called foreign only in a session that hangs together: whose usual photograph shares so many times what makes
 * a neighbour.  Round marble taken every 20 degrees shares hardly more than chance, and says nothing. */
enum { CLEAR = 3 };
static const double TOLERANCE_SHARE = 0.003;   /* of the longer side: two-view geometry */
static const double SAME_VIEW_SHARE = 0.004;   /* features of the same view move less */
static const double SAME_VIEW_FEATURES = 0.35; /* of the fewer features of both */

typedef tsuya_check_relation relation;

double tsuya_check_median(double *value, int count)
{
    tsuya_sort_doubles(value, (size_t)count);
    return count == 0 ? NAN : count % 2 ? value[count / 2] : 0.5 * (value[count / 2 - 1] + value[count / 2]);
}

static void relate(relation *r, const tsuya_check_sight *a, const tsuya_check_sight *b, const tsuya_feature_pair *pair, double *list)
{
    tsuya_check_compare_light(r, a, b, pair, list);
    for (int k = 0; k < r->shared; k++) {
        double ax, ay, bx, by;
        tsuya_features_place(a->features, pair[k].a, &ax, &ay);
        tsuya_features_place(b->features, pair[k].b, &bx, &by);
        list[k] = hypot(ax / a->work_long_side_px - bx / b->work_long_side_px, ay / a->work_long_side_px - by / b->work_long_side_px);
    }
    r->moved = tsuya_check_median(list, r->shared);
}

/* All pairs of a small session; of a large one those close in the order of their names, which is the order of taking. */
static bool is_close(int i, int j, int count) { return count < ALL_PAIRS_BELOW || abs(j - i) <= WINDOW || count - abs(j - i) <= WINDOW; }

typedef struct matcher {
    const tsuya_check *check;
    const tsuya_check_sight *sight;
    relation *relations;
    tsuya_feature_pair *pair;
    double *list;
    int fewest;
} matcher;

static tsuya_status match_pair(const matcher *m, int i, int j, int threads)
{
    relation *r = &m->relations[i * m->check->count + j], *back = &m->relations[j * m->check->count + i];
    const tsuya_check_sight *a = &m->sight[i], *b = &m->sight[j];
    r->used = back->used = true;
    if (!a->features || !b->features || r->known) {
        return TSUYA_OK;
    }
    TSUYA_TRY(tsuya_features_match(m->pair, &r->shared, a->features, b->features, TOLERANCE_SHARE * a->work_long_side_px, threads));
    relate(r, a, b, m->pair, m->list);
    if (r->shared >= m->fewest) {
        tsuya_features_view from = {a->features, a->focal_px, a->middle}, to = {b->features, b->focal_px, b->middle};
        TSUYA_TRY(tsuya_features_turn(&r->turn, &r->turned, &from, &to, m->pair, r->shared, TOLERANCE_SHARE * a->work_long_side_px));
    }
    r->known = true;
    *back = *r;
    back->turn = tsuya_mat3_transpose(r->turn);
    for (int c = 0; c < 3; c++) {
        back->ratio[c] = -r->ratio[c];
    }
    return TSUYA_OK;
}

/* No neighbour among those near in order. */
static bool is_lonely(const matcher *m, int i)
{
    bool lonely = true;
    for (int j = 0; j < m->check->count; j++) {
        lonely = lonely && !(is_close(i, j, m->check->count) && m->relations[i * m->check->count + j].shared >= m->fewest);
    }
    return lonely;
}

/* What is close in order; then whoever found no neighbour there against everybody else. */
static tsuya_status match_all(const matcher *m, const tsuya_context *context)
{
    int count = m->check->count;
    for (int i = 0; i < count; i++) {
        tsuya_progress_update(context, "overlaps", i, count, NULL);
        TSUYA_TRY(tsuya_check_interrupt());
        for (int j = i + 1; j < count; j++) {
            if (is_close(i, j, count)) {
                TSUYA_TRY(match_pair(m, i, j, context->threads));
            }
        }
    }
    for (int i = 0; i < count; i++) {
        bool lonely = is_lonely(m, i);
        for (int j = 0; lonely && j < count; j++) {
            if (j != i && !is_close(i, j, count)) {
                TSUYA_TRY(match_pair(m, i < j ? i : j, i < j ? j : i, context->threads));
            }
        }
    }
    tsuya_progress_update(context, "overlaps", count, count, NULL);
    return TSUYA_OK;
}

static tsuya_status match_pairs(relation *relations, const tsuya_check *check, const tsuya_check_sight *sight, const tsuya_check_options *options,
                                const tsuya_context *context)
{
    tsuya_status status = TSUYA_OK;
    matcher m = {.check = check, .sight = sight, .relations = relations, .fewest = options->shared_features};
    size_t room = 1;
    for (int i = 0; i < check->count; i++) {
        room = (size_t)check->photo[i].features > room ? (size_t)check->photo[i].features : room;
    }
    TSUYA_NEW(status, m.pair, room);
    TSUYA_NEW(status, m.list, 3 * room);
    status = match_all(&m, context);
done:
    tsuya_free(m.pair);
    tsuya_free(m.list);
    return status;
}

static tsuya_status median_shared(tsuya_check *check)
{
    tsuya_status status = TSUYA_OK;
    double *shared;
    TSUYA_NEW(status, shared, (size_t)check->count);
    for (int i = 0; i < check->count; i++) {
        shared[i] = check->photo[i].strongest;
    }
    check->shared = check->count > 0 ? (int)tsuya_check_median(shared, check->count) : 0;
    tsuya_free(shared);
done:
    return status;
}

tsuya_status tsuya_check_relations(tsuya_check *check, tsuya_check_relation *relations, const tsuya_check_sight *sight,
                                   const tsuya_check_options *options, const tsuya_context *context)
{
    for (int k = 0; k < check->count * check->count; k++) {
        relations[k].used = false;
    }
    TSUYA_TRY(match_pairs(relations, check, sight, options, context));
    for (int i = 0; i < check->count; i++) {
        tsuya_checked_photo *p = &check->photo[i];
        p->neighbours = p->strongest = 0;
        p->same_as = -1;
        for (int j = 0; j < check->count; j++) {
            const relation *r = &relations[i * check->count + j];
            if (!r->used) {
                continue;
            }
            p->neighbours += r->shared >= options->shared_features;
            p->strongest = r->shared > p->strongest ? r->shared : p->strongest;
            int fewer = p->features < check->photo[j].features ? p->features : check->photo[j].features;
            bool same = j < i && r->shared >= options->shared_features && r->shared > SAME_VIEW_FEATURES * fewer && r->moved < SAME_VIEW_SHARE;
            p->same_as = same && p->same_as < 0 ? j : p->same_as;
        }
    }
    TSUYA_TRY(median_shared(check));
    return tsuya_check_light(check, relations, options);
}

static void judge_blur(const tsuya_check *check, tsuya_checked_photo *p, const tsuya_check_options *o)
{
    double worst = p->blur.worst_px, best = p->blur.best_px, session = check->blur_px;
    if (!(worst > o->blur_ratio * session) || !(worst * worst > session * session + o->blur_excess_px * o->blur_excess_px) ||
        !(worst > check->blur_limit_px)) {
        return;
    }
    if (best < 0.6 * worst) {
        tsuya_check_fault(p, "blurred by motion: edges %.1f px wide one way, %.1f px the other (session %.1f px)", worst, best, session);
    } else {
        tsuya_check_fault(p, "blurred: edges are %.1f px wide (session %.1f px)", worst, session);
    }
}

static void judge_colors(const tsuya_check *check, tsuya_checked_photo *p, const tsuya_check_options *o)
{
    static const char *const names[3] = {"red", "green", "blue"};
    for (int c = 0; c < 3; c++) {
        if (p->bright_clipped[c] > o->clipped_share) {
            tsuya_check_fault(p, "overexposed: %.0f %% of %s is clipped", 100.0 * p->bright_clipped[c], names[c]);
            break;
        }
    }
    const double *off = p->apart_ev;
    if (fabs(off[1]) > check->limit_ev[1]) {
        tsuya_check_fault(p, "%s than the others that show the same by %.1f EV", off[1] < 0.0 ? "darker" : "brighter", fabs(off[1]));
    } else if (p->told_ev != 0.0) {
        tsuya_check_fault(p, "%s than the others: exposed %+.1f EV against the session", p->told_ev < 0.0 ? "darker" : "brighter", p->told_ev);
    }
    if (fabs(off[0]) > check->limit_ev[0] || fabs(off[2]) > check->limit_ev[2]) {
        tsuya_check_fault(p, "another white balance: red %+.2f EV, blue %+.2f EV against green", off[0], off[2]);
    }
}

static void judge(tsuya_check *check, tsuya_checked_photo *p, const tsuya_check_options *o)
{
    if (p->photo.width_px != check->width_px || p->photo.height_px != check->height_px) {
        tsuya_check_fault(p, "%d x %d pixels, the others have %d x %d", p->photo.width_px, p->photo.height_px, check->width_px, check->height_px);
    }
    if (check->focal_mm > 0.0 && p->photo.focal_mm > 0.0 && fabs(p->photo.focal_mm / check->focal_mm - 1.0) > 0.01) {
        tsuya_check_fault(p, "taken at %g mm, the others at %g mm", p->photo.focal_mm, check->focal_mm);
    }
    judge_blur(check, p, o);
    judge_colors(check, p, o);
    if (p->same_as >= 0) {
        tsuya_check_fault(p, "the same view as %.100s", check->photo[p->same_as].photo.name);
    }
    if (p->strongest == 0 && check->count > 2 && p->fault_count == 0 && check->shared >= CLEAR * o->shared_features) {
        tsuya_check_fault(p, "shows nothing that another photograph shows: a foreign picture, or too far from its neighbours");
    }
}

/* The most common number, 0 where there is none. */
static double most_common(const double *value, int count)
{
    double common = 0.0;
    int most = 0;
    for (int i = 0; i < count; i++) {
        int same = 0;
        for (int j = 0; j < count; j++) {
            same += value[j] == value[i];
        }
        if (value[i] > 0.0 && same > most) {
            most = same;
            common = value[i];
        }
    }
    return common;
}

tsuya_status tsuya_check_verdicts(tsuya_check *check, const tsuya_check_options *options)
{
    int edges = 0, n = 0;
    check->again = 0;
    double *value = tsuya_calloc((size_t)check->count * 3, sizeof *value);
    if (!value) {
        return TSUYA_ERROR_MEMORY;
    }
    double *focal = value + check->count, *pixels = focal + check->count;
    for (int i = 0; i < check->count; i++) {
        const tsuya_checked_photo *p = &check->photo[i];
        if (p->readable) {
            focal[n] = p->photo.focal_mm;
            pixels[n++] = p->photo.width_px * 65536.0 + p->photo.height_px;
            value[edges] = p->blur.worst_px;
            edges += isfinite(p->blur.worst_px);
        }
    }
    check->blur_px = tsuya_check_median(value, edges);
    for (int k = 0; k < edges; k++) { /* blur adds in squares */
        value[k] = fabs(value[k] * value[k] - check->blur_px * check->blur_px);
    }
    double scatter = edges > 0 ? 1.4826 * tsuya_check_median(value, edges) : 0.0;
    check->blur_limit_px = sqrt(check->blur_px * check->blur_px + TSUYA_CHECK_OUTLIER * scatter);
    check->focal_mm = most_common(focal, n);
    double size = most_common(pixels, n);
    check->width_px = (int)(size / 65536.0);
    check->height_px = (int)fmod(size, 65536.0);
    tsuya_free(value);
    TSUYA_TRY(tsuya_check_tags_verdicts(check));
    for (int i = 0; i < check->count; i++) {
        if (check->photo[i].readable) {
            judge(check, &check->photo[i], options);
        }
        check->again += check->photo[i].fault_count > 0;
    }
    return TSUYA_OK;
}
