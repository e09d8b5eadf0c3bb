#include "brdf/cholmod_adapter.h"

#include "core/memory.h"

#include <cholmod.h>
#include <string.h>

tsuya_status tsuya_sparse_add(tsuya_sparse_sum *s, int i, int j, double value)
{
    if (s->count == s->capacity) {
        size_t capacity = s->capacity ? 2 * s->capacity : 4096;
        int *row = tsuya_realloc(s->row, capacity, sizeof *row);
        s->row = row ? row : s->row;
        int *column = row ? tsuya_realloc(s->column, capacity, sizeof *column) : NULL;
        s->column = column ? column : s->column;
        double *v = column ? tsuya_realloc(s->value, capacity, sizeof *v) : NULL;
        s->value = v ? v : s->value;
        if (!v) {
            return TSUYA_ERROR_MEMORY;
        }
        s->capacity = capacity;
    }
    s->row[s->count] = i < j ? i : j;
    s->column[s->count] = i < j ? j : i;
    s->value[s->count++] = value;
    return TSUYA_OK;
}

void tsuya_sparse_free(tsuya_sparse_sum *s)
{
    tsuya_free(s->row);
    tsuya_free(s->column);
    tsuya_free(s->value);
    *s = (tsuya_sparse_sum){0};
}

static tsuya_status factor_and_solve(double *b, int sides, cholmod_sparse *a, double *reciprocal_condition, cholmod_common *cm)
{
    cholmod_factor *factor = cholmod_analyze(a, cm);
    tsuya_status status = TSUYA_OK;
    if (!factor || !cholmod_factorize(a, factor, cm) || factor->minor < factor->n) {
        status = tsuya_fail(TSUYA_ERROR_NUMERIC, "least squares: %zu unknowns are not determined by the data", a->nrow);
    }
    cholmod_dense rhs = {.nrow = a->nrow, .ncol = (size_t)sides, .nzmax = a->nrow * (size_t)sides, .d = a->nrow, .x = b,
                         .xtype = CHOLMOD_REAL, .dtype = CHOLMOD_DOUBLE};
    cholmod_dense *x = status == TSUYA_OK ? cholmod_solve(CHOLMOD_A, factor, &rhs, cm) : NULL;
    if (x) {
        memcpy(b, x->x, a->nrow * (size_t)sides * sizeof *b);
        if (reciprocal_condition) {
            *reciprocal_condition = cholmod_rcond(factor, cm);
        }
        cholmod_free_dense(&x, cm);
    } else if (status == TSUYA_OK) {
        status = tsuya_fail(TSUYA_ERROR_MEMORY, "least squares: memory is short");
    }
    cholmod_free_factor(&factor, cm);
    return status;
}

tsuya_status tsuya_sparse_solve(double *b, int sides, const tsuya_sparse_sum *sum, double *reciprocal_condition)
{
    cholmod_common cm;
    size_t n = (size_t)sum->size;
    cholmod_start(&cm);
    cm.supernodal = CHOLMOD_SIMPLICIAL;
    cm.final_ll = 1;
    cm.print = 0;
    cm.try_catch = 1;
    cholmod_triplet triplet = {.nrow = n, .ncol = n, .nzmax = sum->count, .nnz = sum->count, .i = sum->row, .j = sum->column, .x = sum->value,
                               .stype = 1, .itype = CHOLMOD_INT, .xtype = CHOLMOD_REAL, .dtype = CHOLMOD_DOUBLE};
    cholmod_sparse *a = cholmod_triplet_to_sparse(&triplet, sum->count, &cm);
    tsuya_status status = a ? factor_and_solve(b, sides, a, reciprocal_condition, &cm)
                            : tsuya_fail(TSUYA_ERROR_MEMORY, "least squares: memory is short");
    cholmod_free_sparse(&a, &cm);
    cholmod_finish(&cm);
    return status;
}
