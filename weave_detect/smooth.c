#include "weave_detect/smooth.h"

#include "core/memory.h"

enum { CHUNK = 4096, STEPS_MOST = 400 };
static const double RESIDUAL = 1e-5, TIE = 1e-9; /* TIE keeps a vertex that nothing speaks for solvable */

typedef struct solver {
    const tsuya_mesh_graph *graph;
    const double *pull;
    tsuya_complex *turn; /* w · e^{i n turn}, one an entry */
    double *diagonal, *partial;
    int threads;
} solver;

static void apply(tsuya_complex *out, const tsuya_complex *in, const solver *s)
{
    const tsuya_mesh_graph *g = s->graph;
#pragma omp parallel for schedule(static) num_threads(s->threads)
    for (long long v = 0; v < (long long)g->vertex_count; v++) {
        double re = s->diagonal[v] * in[v].re, im = s->diagonal[v] * in[v].im;
        for (uint32_t e = g->start[v]; e < g->start[v + 1]; e++) {
            tsuya_complex t = s->turn[e], z = in[g->neighbour[e]];
            re -= t.re * z.re - t.im * z.im;
            im -= t.re * z.im + t.im * z.re;
        }
        out[v] = (tsuya_complex){re, im};
    }
}

/* Re Σ conj(a)·b·scale in chunks of a fixed size, added in their order. */
static double dot(const tsuya_complex *a, const tsuya_complex *b, const double *inverse_scale, const solver *s)
{
    long long n = (long long)s->graph->vertex_count, chunks = (n + CHUNK - 1) / CHUNK;
#pragma omp parallel for schedule(static) num_threads(s->threads)
    for (long long c = 0; c < chunks; c++) {
        double sum = 0.0;
        long long end = (c + 1) * CHUNK < n ? (c + 1) * CHUNK : n;
        for (long long v = c * CHUNK; v < end; v++) {
            double product = a[v].re * b[v].re + a[v].im * b[v].im;
            sum += inverse_scale ? product / inverse_scale[v] : product;
        }
        s->partial[c] = sum;
    }
    double sum = 0.0;
    for (long long c = 0; c < chunks; c++) {
        sum += s->partial[c];
    }
    return sum;
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

static void conjugate_gradients(tsuya_complex *z, tsuya_complex *r, tsuya_complex *p, tsuya_complex *q, const solver *s, double bound)
{
    long long n = (long long)s->graph->vertex_count;
    double rho = dot(r, r, s->diagonal, s);
    for (long long v = 0; v < n; v++) {
        p[v] = (tsuya_complex){r[v].re / s->diagonal[v], r[v].im / s->diagonal[v]};
    }
    for (int step = 0; step < STEPS_MOST && rho > bound; step++) {
        apply(q, p, s);
        double curvature = dot(p, q, NULL, s);
        if (!(curvature > 0.0)) {
            return;
        }
        double alpha = rho / curvature;
#pragma omp parallel for schedule(static) num_threads(s->threads)
        for (long long v = 0; v < n; v++) {
            z[v].re += alpha * p[v].re;
            z[v].im += alpha * p[v].im;
            r[v].re -= alpha * q[v].re;
            r[v].im -= alpha * q[v].im;
        }
        double next = dot(r, r, s->diagonal, s), beta = next / rho;
        rho = next;
#pragma omp parallel for schedule(static) num_threads(s->threads)
        for (long long v = 0; v < n; v++) {
            p[v].re = r[v].re / s->diagonal[v] + beta * p[v].re;
            p[v].im = r[v].im / s->diagonal[v] + beta * p[v].im;
        }
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
    TSUYA_NEW(status, s.partial, n / CHUNK + 1);
    TSUYA_NEW(status, r, n);
    TSUYA_NEW(status, p, n);
    TSUYA_NEW(status, q, n);
    prepare(&s, edge_scale, fold);
    for (size_t v = 0; v < n; v++) {
        r[v] = (tsuya_complex){pull[v] * target[v].re, pull[v] * target[v].im};
    }
    double scale = dot(r, r, s.diagonal, &s);
    apply(q, z, &s);
    for (size_t v = 0; v < n; v++) {
        r[v].re -= q[v].re;
        r[v].im -= q[v].im;
    }
    conjugate_gradients(z, r, p, q, &s, RESIDUAL * RESIDUAL * scale);
done:
    tsuya_free(s.turn);
    tsuya_free(s.diagonal);
    tsuya_free(s.partial);
    tsuya_free(r);
    tsuya_free(p);
    tsuya_free(q);
    return status;
}
