#include "weave_detect/spanning.h"

#include "core/memory.h"

#include <stdlib.h>

static int compare_edges(const void *a, const void *b)
{
    const tsuya_choice_edge *x = a, *y = b;
    if (x->trust != y->trust) {
        return x->trust > y->trust ? -1 : 1;
    }
    if (x->u != y->u) {
        return x->u < y->u ? -1 : 1;
    }
    return x->v < y->v ? -1 : x->v > y->v;
}

/* Union–find with the parity of the way to the parent. */
typedef struct forest {
    uint32_t *parent, *size;
    uint8_t *parity;
} forest;

static uint32_t find(forest *f, uint32_t v, uint8_t *parity)
{
    uint32_t at = v;
    uint8_t sum = 0;
    while (f->parent[at] != at) {
        sum ^= f->parity[at];
        at = f->parent[at];
    }
    *parity = sum;
    while (f->parent[v] != at && v != at) { /* shorten the way */
        uint32_t next = f->parent[v];
        uint8_t own = f->parity[v];
        f->parent[v] = at;
        f->parity[v] = sum;
        sum ^= own;
        v = next;
    }
    return at;
}

static void join(forest *f, const tsuya_choice_edge *edge)
{
    uint8_t pu, pv;
    uint32_t u = find(f, edge->u, &pu), v = find(f, edge->v, &pv);
    if (u == v) {
        return;
    }
    if (f->size[u] < f->size[v]) {
        uint32_t swap = u;
        u = v;
        v = swap;
    }
    f->parent[v] = u;
    f->parity[v] = pu ^ pv ^ edge->differs;
    f->size[u] += f->size[v];
}

tsuya_status tsuya_spanning_choices(uint8_t *choice, uint32_t *root, tsuya_choice_edge *edge, size_t edge_count, size_t vertex_count)
{
    tsuya_status status = TSUYA_OK;
    forest f = {0};
    TSUYA_NEW(status, f.parent, vertex_count);
    TSUYA_NEW(status, f.size, vertex_count);
    TSUYA_NEW(status, f.parity, vertex_count);
    for (size_t v = 0; v < vertex_count; v++) {
        f.parent[v] = (uint32_t)v;
        f.size[v] = 1;
    }
    qsort(edge, edge_count, sizeof *edge, compare_edges);
    for (size_t e = 0; e < edge_count; e++) {
        join(&f, &edge[e]);
    }
    for (size_t v = 0; v < vertex_count; v++) {
        root[v] = find(&f, (uint32_t)v, &choice[v]);
    }
done:
    tsuya_free(f.parent);
    tsuya_free(f.size);
    tsuya_free(f.parity);
    return status;
}
