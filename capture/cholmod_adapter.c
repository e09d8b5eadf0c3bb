#include "capture/cholmod_adapter.h"

#include "core/memory.h"

#include <omp.h>
#include <stdlib.h>
#include <string.h>
#include <suitesparse/cholmod.h>

/* OpenBLAS' sums depend on how many threads share them; where it is the BLAS, it works with one here. */
extern void openblas_set_num_threads(int threads) __attribute__((weak));

struct drape_solver {
    cholmod_common common;
    size_t n; /* unknowns */
    int *order;
};

tsuya_status tsuya_drape_matrix_reserve(drape_matrix *m, size_t more)
{
    if (m->count + more <= m->room) {
        return TSUYA_OK;
    }
    size_t room = m->count + more + m->room / 2 + 1024;
    int *row = tsuya_realloc(m->row, room, sizeof *row);
    m->row = row ? row : m->row;
    int *column = tsuya_realloc(m->column, room, sizeof *column);
    m->column = column ? column : m->column;
    double *value = tsuya_realloc(m->value, room, sizeof *value);
    m->value = value ? value : m->value;
    m->room = row && column && value ? room : m->room;
    return row && column && value ? TSUYA_OK : TSUYA_ERROR_MEMORY;
}

void tsuya_drape_matrix_free(drape_matrix *m)
{
    tsuya_free(m->row);
    tsuya_free(m->column);
    tsuya_free(m->value);
    *m = (drape_matrix){0};
}

void tsuya_drape_matrix_add(drape_matrix *m, uint32_t i, uint32_t j, const double block[3][3])
{
    for (int a = 0; a < 3; a++) {
        for (int b = 0; b < (i == j ? a + 1 : 3); b++) {
            m->row[m->count] = (int)(3 * i) + a;
            m->column[m->count] = (int)(3 * j) + b;
            m->value[m->count++] = block[a][b];
        }
    }
}

/* The vertices' order by CHOLMOD's own choice, then three unknowns each. */
static tsuya_status find_order(drape_solver *s, size_t vertices, const uint32_t *pair, size_t pair_count)
{
    cholmod_common *c = &s->common;
    tsuya_status status = TSUYA_ERROR_MEMORY;
    cholmod_factor *factor = NULL;
    cholmod_sparse *graph = NULL;
    cholmod_triplet *t = cholmod_allocate_triplet(vertices, vertices, vertices + pair_count, -1, CHOLMOD_REAL, c);
    if (!t) {
        goto done;
    }
    for (size_t k = 0; k < vertices + pair_count; k++) {
        ((int *)t->i)[k] = (int)(k < vertices ? k : pair[2 * (k - vertices)]);
        ((int *)t->j)[k] = (int)(k < vertices ? k : pair[2 * (k - vertices) + 1]);
        ((double *)t->x)[k] = 1.0;
    }
    t->nnz = vertices + pair_count;
    graph = cholmod_triplet_to_sparse(t, 0, c);
    factor = graph ? cholmod_analyze(graph, c) : NULL;
    for (size_t k = 0; factor && k < 3 * vertices; k++) {
        s->order[k] = 3 * ((int *)factor->Perm)[k / 3] + (int)(k % 3);
    }
    status = factor ? TSUYA_OK : tsuya_fail(TSUYA_ERROR_MEMORY, "drape: no memory for the order of %zu vertices", vertices);
done:
    cholmod_free_factor(&factor, c);
    cholmod_free_sparse(&graph, c);
    cholmod_free_triplet(&t, c);
    return status;
}

tsuya_status tsuya_drape_solver_create(drape_solver **solver, size_t vertices, const uint32_t *pair, size_t pair_count)
{
    tsuya_status status;
    drape_solver *s;
    *solver = NULL;
    TSUYA_NEW(status, s, 1);
    cholmod_start(&s->common);
    s->common.print = 0;
    s->common.quick_return_if_not_posdef = 1;
    s->n = 3 * vertices;
    TSUYA_NEW(status, s->order, s->n);
    TSUYA_GOTO_DONE(status, find_order(s, vertices, pair, pair_count));
    s->common.nmethods = 1;
    s->common.method[0].ordering = CHOLMOD_GIVEN;
    s->common.postorder = 1;
    *solver = s;
    s = NULL;
done:
    tsuya_drape_solver_free(s);
    return status;
}

void tsuya_drape_solver_free(drape_solver *s)
{
    if (s) {
        cholmod_finish(&s->common);
        tsuya_free(s->order);
        tsuya_free(s);
    }
}

tsuya_status tsuya_drape_solver_solve(double *x, bool *definite, drape_solver *s, const drape_matrix *m, const double *b)
{
    cholmod_common *c = &s->common;
    tsuya_status status = TSUYA_ERROR_MEMORY;
    cholmod_triplet t = {.nrow = s->n, .ncol = s->n, .nzmax = m->count, .nnz = m->count, .i = m->row, .j = m->column, .x = m->value,
                         .stype = -1, .itype = CHOLMOD_INT, .xtype = CHOLMOD_REAL, .dtype = CHOLMOD_DOUBLE};
    cholmod_dense right = {.nrow = s->n, .ncol = 1, .nzmax = s->n, .d = s->n, .x = (void *)(uintptr_t)b, .xtype = CHOLMOD_REAL,
                           .dtype = CHOLMOD_DOUBLE};
    cholmod_factor *factor = NULL;
    cholmod_dense *left = NULL;
    int levels = omp_get_max_active_levels();
    if (openblas_set_num_threads) {
        openblas_set_num_threads(1);
    }
    omp_set_max_active_levels(0); /* CHOLMOD's loops over a supernode's few columns cost more to share than to run */
    *definite = false;
    cholmod_sparse *a = cholmod_triplet_to_sparse(&t, 0, c);
    factor = a ? cholmod_analyze_p(a, s->order, NULL, 0, c) : NULL;
    if (factor && cholmod_factorize(a, factor, c) && factor->minor == factor->n) {
        left = cholmod_solve(CHOLMOD_A, factor, &right, c);
        *definite = left != NULL;
    }
    if (left) {
        memcpy(x, left->x, s->n * sizeof *x);
    }
    status = c->status == CHOLMOD_OUT_OF_MEMORY ? tsuya_fail(TSUYA_ERROR_MEMORY, "drape: no memory for %zu unknowns", s->n) : TSUYA_OK;
    c->status = CHOLMOD_OK;
    omp_set_max_active_levels(levels);
    cholmod_free_dense(&left, c);
    cholmod_free_factor(&factor, c);
    cholmod_free_sparse(&a, c);
    return status;
}
