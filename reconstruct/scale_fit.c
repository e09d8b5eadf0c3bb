#include "reconstruct/scale_fit.h"

#include "core/dense.h"
#include "core/memory.h"
#include "core/order.h"
#include "reconstruct/scale_points.h"

#include <string.h>

enum { UNKNOWNS = 7, ROUNDS = 5, STEPS = 6, HELD_OUT_STEPS = 3, PAIR_TAGS = 48 };

/* A corner is left out beyond this (χ² of three coordinates, 1e-4); a first look takes corners within this share of the tag's
 * edge; tags grow by a few per cent at most. */
static const double OUTLIER_CHI2 = 21.1, FIRST_LOOK = 0.25, GROWTH_SIGMA = 0.03;

tsuya_vec3 tsuya_scale_error(const tsuya_scale_fit *f, const tsuya_scale_item *i)
{
    const tsuya_scale_plate_fit *p = &f->plate[i->plate];
    tsuya_vec3 at = tsuya_vec3_mad(p->translation, f->scale, tsuya_mat3_apply(p->rotation, i->model));
    return tsuya_vec3_sub(at, tsuya_vec3_mad(i->center, 1.0 + p->growth, tsuya_vec3_sub(i->target, i->center)));
}

/* Weight (inverse covariance on the plate) of a corner. */
static bool weight_of(tsuya_mat3 *weight, const tsuya_scale_fit *f, const tsuya_scale_item *i)
{
    const tsuya_mat3 *r = &f->plate[i->plate].rotation;
    tsuya_mat3 c = tsuya_mat3_multiply(tsuya_mat3_multiply(*r, i->covariance), tsuya_mat3_transpose(*r));
    for (int a = 0; a < 3; a++) {
        for (int b = 0; b < 3; b++) {
            c.e[a][b] = c.e[a][b] * f->scale * f->scale + (a == b ? f->floor_m * f->floor_m : 0.0);
        }
    }
    return tsuya_scale_invert(weight, c);
}

/* First fits: every pair of tags of a plate proposes a similarity. */
static int vote(const tsuya_scale_problem *p, int plate, const tsuya_similarity *s, double *cost)
{
    int inliers = 0;
    *cost = 0.0;
    for (int k = 0; k < p->count; k++) {
        const tsuya_scale_item *i = &p->item[k];
        if (i->plate == plate) {
            double tolerance = FIRST_LOOK * 1.41 * tsuya_vec3_norm(tsuya_vec3_sub(i->target, i->center));
            double d = tsuya_vec3_norm(tsuya_vec3_sub(tsuya_similarity_apply(*s, i->model), i->target)) / tolerance;
            inliers += d < 1.0;
            *cost += fmin(1.0, d * d);
        }
    }
    return inliers;
}

static void try_pair(tsuya_similarity *best, double *least, int *most, const tsuya_scale_problem *p, int plate, int a, int b)
{
    tsuya_vec3 from[8], to[8];
    int n = 0, inliers;
    double rms, cost;
    tsuya_similarity s;
    for (int k = 0; k < p->count && n < 8; k++) {
        if (p->item[k].tag == a || p->item[k].tag == b) {
            from[n] = p->item[k].model;
            to[n++] = p->item[k].target;
        }
    }
    if (n < TSUYA_SCALE_LEAST_CORNERS || !tsuya_similarity_align(&s, &rms, to, from, n)) {
        return;
    }
    inliers = vote(p, plate, &s, &cost);
    if (cost < *least) {
        *least = cost;
        *most = inliers;
        *best = s;
    }
}

/* Tags of a plate with enough corners; at most `capacity`, evenly taken. */
static int plate_tags(int *tag, const tsuya_scale_problem *p, int plate, int capacity)
{
    int n = 0, all = 0, seen = 0;
    for (int t = 0; t < p->input->tag_count; t++) {
        all += p->input->tag[t].plate == plate && p->tag_corners[t] > 0;
    }
    for (int t = 0; t < p->input->tag_count; t++) {
        if (p->input->tag[t].plate == plate && p->tag_corners[t] > 0) {
            if (n < capacity && (long long)seen * capacity >= (long long)n * all) {
                tag[n++] = t;
            }
            seen++;
        }
    }
    return n;
}

static bool start_plate(tsuya_similarity *best, int *inliers, const tsuya_scale_problem *p, int plate)
{
    int tag[PAIR_TAGS], n = plate_tags(tag, p, plate, PAIR_TAGS);
    double least = INFINITY;
    int corners = 0;
    *inliers = 0;
    for (int a = 0; a < n; a++) {
        for (int b = n > 1 ? a + 1 : a; b < n; b++) {
            try_pair(best, &least, inliers, p, plate, tag[a], tag[b]);
        }
    }
    for (int t = 0; t < p->input->tag_count; t++) {
        corners += p->input->tag[t].plate == plate ? p->tag_corners[t] : 0;
    }
    /* Of more than one tag, where there is more than one; and a fit that a third of the corners does not share is chance. */
    return *inliers >= (n > 1 ? 5 : TSUYA_SCALE_LEAST_CORNERS) && 3 * *inliers >= corners;
}

/* Rotations from each plate's own first fit, one scale from the one that explains most. */
static bool start(tsuya_scale_problem *p)
{
    tsuya_similarity s[TSUYA_SCALE_PLATES];
    int most = 0;
    for (int k = 0; k < p->input->plate_count; k++) {
        int inliers;
        p->fit.plate[k].used = start_plate(&s[k], &inliers, p, k);
        if (p->fit.plate[k].used && inliers > most) {
            most = inliers;
            p->fit.scale = s[k].scale;
        }
    }
    for (int k = 0; k < p->input->plate_count; k++) {
        tsuya_scale_plate_fit *f = &p->fit.plate[k];
        if (f->used) {
            tsuya_vec3 model = {0, 0, 0}, target = {0, 0, 0};
            double n = 0.0;
            for (int i = 0; i < p->count; i++) {
                if (p->item[i].plate == k) {
                    const tsuya_scale_item *at = &p->item[i];
                    double tolerance = FIRST_LOOK * 1.41 * tsuya_vec3_norm(tsuya_vec3_sub(at->target, at->center));
                    p->item[i].outlier = tsuya_vec3_norm(tsuya_vec3_sub(tsuya_similarity_apply(s[k], at->model), at->target)) > tolerance;
                    if (!p->item[i].outlier) {
                        model = tsuya_vec3_add(model, at->model);
                        target = tsuya_vec3_add(target, at->target);
                        n += 1.0;
                    }
                }
            }
            f->rotation = s[k].rotation;
            f->translation = tsuya_vec3_mad(tsuya_vec3_scale(target, 1.0 / n), -p->fit.scale / n, tsuya_mat3_apply(f->rotation, model));
        }
    }
    return most > 0;
}

/* Derivatives of a corner's error: by rotation, translation, growth (columns 0 … 6) and by the scale's logarithm (7). */
static void derivatives(double j[3][UNKNOWNS + 1], const tsuya_scale_fit *f, const tsuya_scale_item *i)
{
    tsuya_vec3 m = tsuya_vec3_scale(tsuya_mat3_apply(f->plate[i->plate].rotation, i->model), f->scale);
    tsuya_vec3 g = tsuya_vec3_sub(i->center, i->target);
    double rows[3][UNKNOWNS + 1] = {{0, m.z, -m.y, 1, 0, 0, g.x, m.x}, {-m.z, 0, m.x, 0, 1, 0, g.y, m.y}, {m.y, -m.x, 0, 0, 0, 1, g.z, m.z}};
    memcpy(j, rows, sizeof rows);
}

typedef struct normal {
    double a[UNKNOWNS + 1][UNKNOWNS + 1], b[UNKNOWNS + 1];
} normal;

static void accumulate(normal *n, const tsuya_scale_fit *f, const tsuya_scale_item *i)
{
    double j[3][UNKNOWNS + 1];
    tsuya_mat3 w;
    if (!weight_of(&w, f, i)) {
        return;
    }
    tsuya_vec3 e = tsuya_scale_error(f, i);
    derivatives(j, f, i);
    for (int c = 0; c <= UNKNOWNS; c++) {
        tsuya_vec3 wj = tsuya_mat3_apply(w, (tsuya_vec3){j[0][c], j[1][c], j[2][c]});
        n->b[c] -= tsuya_vec3_dot(wj, e);
        for (int d = 0; d <= UNKNOWNS; d++) {
            n->a[c][d] += wj.x * j[0][d] + wj.y * j[1][d] + wj.z * j[2][d];
        }
    }
}

static void move_plate(tsuya_scale_plate_fit *p, const double x[UNKNOWNS])
{
    p->rotation = tsuya_mat3_multiply(tsuya_mat3_from_rodrigues((tsuya_vec3){x[0], x[1], x[2]}), p->rotation);
    p->translation = tsuya_vec3_add(p->translation, (tsuya_vec3){x[3], x[4], x[5]});
    p->growth += x[6];
}

/* One Gauss–Newton step: plates are eliminated, the scale is left. */
static bool step(tsuya_scale_fit *f, const tsuya_scale_problem *p)
{
    double curvature = 0.0, gradient = 0.0, x[TSUYA_SCALE_PLATES][2][UNKNOWNS];
    for (int k = 0; k < p->input->plate_count; k++) {
        normal n = {.b = {0}};
        double a[UNKNOWNS * UNKNOWNS];
        if (!f->plate[k].used) {
            continue;
        }
        for (int i = 0; i < p->count; i++) {
            if (p->item[i].plate == k && !p->item[i].outlier && !p->item[i].aside) {
                accumulate(&n, f, &p->item[i]);
            }
        }
        for (int c = 0; c < UNKNOWNS && !f->plate[k].growth_free; c++) {
            n.a[c][6] = n.a[6][c] = n.a[7][6] = n.a[6][7] = n.b[6] = 0.0;
        }
        n.a[6][6] += 1.0 / (GROWTH_SIGMA * GROWTH_SIGMA);
        n.b[6] -= f->plate[k].growth / (GROWTH_SIGMA * GROWTH_SIGMA);
        for (int c = 0; c < UNKNOWNS; c++) {
            memcpy(a + c * UNKNOWNS, n.a[c], UNKNOWNS * sizeof *a);
            x[k][0][c] = n.b[c];
            x[k][1][c] = n.a[c][7];
        }
        if (!tsuya_dense_cholesky(a, UNKNOWNS)) {
            return false;
        }
        for (int side = 0; side < 2; side++) {
            tsuya_dense_forward(a, x[k][side], UNKNOWNS, 1);
            tsuya_dense_backward(a, x[k][side], UNKNOWNS, 1);
        }
        curvature += n.a[7][7];
        gradient += n.b[7];
        for (int c = 0; c < UNKNOWNS; c++) {
            curvature -= n.a[7][c] * x[k][1][c];
            gradient -= n.a[7][c] * x[k][0][c];
        }
    }
    if (!(curvature > 0.0)) {
        return false;
    }
    double grow = gradient / curvature;
    for (int k = 0; k < p->input->plate_count; k++) {
        for (int c = 0; c < UNKNOWNS && f->plate[k].used; c++) {
            x[k][0][c] -= grow * x[k][1][c];
        }
        if (f->plate[k].used) {
            move_plate(&f->plate[k], x[k][0]);
        }
    }
    f->scale *= exp(grow);
    f->sigma_rel = 1.0 / sqrt(curvature);
    return isfinite(f->scale);
}

/* What the triangulation's covariances do not explain (cameras that are bent together, a mat that is not flat), metres. */
static tsuya_status find_floor(tsuya_scale_problem *p)
{
    double *error = tsuya_calloc(6 * (size_t)p->count, sizeof *error), *own = error + 3 * p->count;
    int n = 0;
    if (!error) {
        return TSUYA_ERROR_MEMORY;
    }
    for (int k = 0; k < p->count; k++) {
        const tsuya_scale_item *i = &p->item[k];
        if (p->fit.plate[i->plate].used && !i->outlier) {
            tsuya_vec3 e = tsuya_scale_error(&p->fit, i);
            double variance = (i->covariance.e[0][0] + i->covariance.e[1][1] + i->covariance.e[2][2]) / 3.0;
            double v[3] = {fabs(e.x), fabs(e.y), fabs(e.z)};
            for (int c = 0; c < 3; c++, n++) {
                error[n] = v[c];
                own[n] = variance * p->fit.scale * p->fit.scale;
            }
        }
    }
    tsuya_sort_doubles(error, (size_t)n);
    tsuya_sort_doubles(own, (size_t)n);
    double seen = n ? 1.4826 * error[n / 2] : 0.0;
    p->fit.floor_m = n ? sqrt(fmax(seen * seen - own[n / 2], 1e-4 * seen * seen)) : 0.0;
    tsuya_free(error);
    return TSUYA_OK;
}

static void mark_outliers(tsuya_scale_problem *p)
{
    int left[TSUYA_SCALE_PLATES] = {0};
    for (int k = 0; k < p->count; k++) {
        tsuya_scale_item *i = &p->item[k];
        tsuya_mat3 w;
        tsuya_vec3 e = tsuya_scale_error(&p->fit, i);
        i->outlier = !p->fit.plate[i->plate].used || !weight_of(&w, &p->fit, i) || tsuya_vec3_dot(e, tsuya_mat3_apply(w, e)) > OUTLIER_CHI2;
        left[i->plate] += !i->outlier;
    }
    for (int k = 0; k < p->input->plate_count; k++) {
        p->fit.plate[k].used &= left[k] >= TSUYA_SCALE_LEAST_CORNERS;
    }
}

static bool tag_used(const tsuya_scale_problem *p, int tag)
{
    for (int k = 0; k < p->count; k++) {
        if (p->item[k].tag == tag && !p->item[k].outlier) {
            return true;
        }
    }
    return false;
}

int tsuya_scale_tags_used(const tsuya_scale_problem *p, int plate)
{
    int n = 0;
    for (int t = 0; t < p->input->tag_count; t++) {
        n += (plate < 0 || p->input->tag[t].plate == plate) && tag_used(p, t);
    }
    return n;
}

tsuya_status tsuya_scale_fit_plates(tsuya_scale_problem *p)
{
    if (!start(p)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: its tags do not lie as the file says (no two that are seen agree); is this the right board file?",
                          p->input->source);
    }
    for (int round = 0; round < ROUNDS; round++) {
        for (int k = 0; k < p->input->plate_count; k++) {
            p->fit.plate[k].growth_free = tsuya_scale_tags_used(p, k) > 1;
        }
        TSUYA_TRY(find_floor(p));
        for (int i = 0; i < STEPS; i++) {
            if (!step(&p->fit, p)) {
                return tsuya_fail(TSUYA_ERROR_NUMERIC, "%s: the tags that are seen do not determine the scale; show more of the mat in more photographs",
                                  p->input->source);
            }
        }
        mark_outliers(p);
    }
    return TSUYA_OK;
}

double tsuya_scale_held_out_rms(tsuya_scale_problem *p)
{
    double sum = 0.0;
    int n = 0;
    for (int t = 0; t < p->input->tag_count; t++) {
        tsuya_scale_fit f = p->fit;
        bool fine = tag_used(p, t) && tsuya_scale_tags_used(p, p->input->tag[t].plate) > 1;
        for (int k = 0; k < p->count; k++) {
            p->item[k].aside = p->item[k].tag == t;
        }
        for (int i = 0; i < HELD_OUT_STEPS && fine; i++) {
            fine = step(&f, p);
        }
        for (int k = 0; k < p->count && fine; k++) {
            if (p->item[k].tag == t && !p->item[k].outlier) {
                tsuya_vec3 e = tsuya_scale_error(&f, &p->item[k]);
                sum += tsuya_vec3_dot(e, e);
                n++;
            }
        }
    }
    for (int k = 0; k < p->count; k++) {
        p->item[k].aside = false;
    }
    return n ? sqrt(sum / n) : NAN;
}

