#include "weave_detect/smooth.h"

#include "core/memory.h"

enum { CHUNK = 4096, STEPS_MOST = 400 };
static const double RESIDUAL = 1e-5, TIE = 1e-9; /* TIE keeps a vertex that nothing speaks for solvable */

/* A solve runs on one thread.  Its steps are short, a mesh of 200,000 vertices takes a millisecond each, and there are thousands: where other
 * work shares the machine, threads that meet after every one of them mostly wait for each other.  Independent solves run side by side instead. */
typedef struct solver {
    const tsuya_mesh_graph *graph;
    const double *pull;
    tsuya_complex *turn; /* w · e^{i n turn}, one an entry */
    double *diagonal;
    int threads;         /* of what is done once a solve */
} solver;

static inline tsuya_complex product_at(const tsuya_complex *in, const solver *s, size_t v)
{
    const tsuya_mesh_graph *g = s->graph;
    double re = s->diagonal[v] * in[v].re, im = s->diagonal[v] * in[v].im;
    for (uint32_t e = g->start[v]; e < g->start[v + 1]; e++) {
        tsuya_complex t = s->turn[e], z = in[g->neighbour[e]];
        re -= t.re * z.re - t.im * z.im;
        im -= t.re * z.im + t.im * z.re;
    }
    return (tsuya_complex){re, im};
}

static inline double dot_at(tsuya_complex a, tsuya_complex b) { return a.re * b.re + a.im * b.im; }

/* out = A·in; returns Re Σ conj(in)·out.  Sums run over chunks of a fixed size, so that they lose less than one long sum. */
static double apply(tsuya_complex *out, const tsuya_complex *in, const solver *s)
{
    double all = 0.0;
    for (size_t first = 0, n = s->graph->vertex_count; first < n; first += CHUNK) {
        double sum = 0.0;
        for (size_t v = first; v < first + CHUNK && v < n; v++) {
            out[v] = product_at(in, s, v);
            sum += dot_at(in[v], out[v]);
        }
        all += sum;
    }
    return all;
}

/* r −= alpha·q, z += alpha·p; returns Σ |r|² over the diagonal. */
static double advance(tsuya_complex *z, tsuya_complex *r, const tsuya_complex *p, const tsuya_complex *q, double alpha, const solver *s)
{
    double all = 0.0;
    for (size_t first = 0, n = s->graph->vertex_count; first < n; first += CHUNK) {
        double sum = 0.0;
        for (size_t v = first; v < first + CHUNK && v < n; v++) {
            z[v].re += alpha * p[v].re;
            z[v].im += alpha * p[v].im;
            r[v].re -= alpha * q[v].re;
            r[v].im -= alpha * q[v].im;
            sum += dot_at(r[v], r[v]) / s->diagonal[v];
        }
        all += sum;
    }
    return all;
}

static void prepare(solver *s, const float *edge_scale, int fold)
{
    const tsuya_mesh_graph *g = s->graph;
#pragma omp parallel for schedule(static) num_threads(s->threads)
    for (long long v = 0; v < (long long)g->vertex_count; v++) {
        double sum = s->pull[v] + TIE;
        for (uint32_t e = g->start[v]; e < g->start[v + 1]; e++) {
            double w = (double)g->weight[e] * (edge_scale ? (double)edge_scale[e] : 1.0), angle = fold * (double)g->turn_rad[e];
            s->turn[e] = (tsuya_complex){w * cos(angle), w * sin(angle)};
            sum += w;
        }
        s->diagonal[v] = sum;
    }
}

/* p = r over the diagonal, plus beta·p. */
static void turn_search(tsuya_complex *p, const tsuya_complex *r, double beta, const solver *s)
{
    for (size_t v = 0; v < s->graph->vertex_count; v++) {
        p[v].re = r[v].re / s->diagonal[v] + beta * p[v].re;
        p[v].im = r[v].im / s->diagonal[v] + beta * p[v].im;
    }
}

/* rho: Σ |r|² over the diagonal. */
static void conjugate_gradients(tsuya_complex *z, tsuya_complex *r, tsuya_complex *p, tsuya_complex *q, const solver *s, double rho, double bound)
{
    turn_search(p, r, 0.0, s); /* p is 0 */
    for (int step = 0; step < STEPS_MOST && rho > bound; step++) {
        double curvature = apply(q, p, s);
        if (!(curvature > 0.0)) {
            return;
        }
        double next = advance(z, r, p, q, rho / curvature, s);
        turn_search(p, r, next / rho, s);
        rho = next;
    }
}

tsuya_status tsuya_smooth_directions(tsuya_complex *z, const tsuya_complex *target, const double *pull, const float *edge_scale,
                                     int fold, const tsuya_mesh_graph *graph, const tsuya_context *context)
{
    tsuya_status status = TSUYA_OK;
    size_t n = graph->vertex_count;
    tsuya_complex *r = NULL, *p = NULL, *q = NULL;
    solver s = {.graph = graph, .pull = pull, .threads = context->threads};
    TSUYA_NEW(status, s.turn, n > 0 ? graph->start[n] : 0);
    TSUYA_NEW(status, s.diagonal, n);
    TSUYA_NEW(status, r, n);
    TSUYA_NEW(status, p, n);
    TSUYA_NEW(status, q, n);
    prepare(&s, edge_scale, fold);
    for (size_t v = 0; v < n; v++) {
        r[v] = (tsuya_complex){pull[v] * target[v].re, pull[v] * target[v].im};
    }
    double scale = advance(z, r, p, q, 0.0, &s); /* p and q are 0 */
    apply(q, z, &s);
    conjugate_gradients(z, r, p, q, &s, advance(z, r, p, q, 1.0, &s), RESIDUAL * RESIDUAL * scale);
done:
    tsuya_free(s.turn);
    tsuya_free(s.diagonal);
    tsuya_free(r);
    tsuya_free(p);
    tsuya_free(q);
    return status;
}
