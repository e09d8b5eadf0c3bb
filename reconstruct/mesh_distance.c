/* Closest point on a triangle after Ericson, "Real-Time Collision Detection" (2005), 5.1.5; the hierarchy splits at the
 * median of the triangles' centres along the longest side. */
#include "reconstruct/mesh_distance.h"

#include "core/memory.h"

#include <stdlib.h>

enum { LEAF_TRIANGLES = 4, STACK_SIZE = 96 };

typedef struct node {
    float low[3], high[3];
    uint32_t begin, count; /* leaf: range of `order`; inner (count 0): index of the second child, the first follows */
} node;

struct tsuya_mesh_tree {
    const tsuya_mesh *mesh;
    uint32_t *order;
    node *nodes;
    uint32_t node_count;
};

static tsuya_vec3 corner(const tsuya_mesh *mesh, uint32_t triangle, size_t k)
{
    return tsuya_mesh_position(mesh, mesh->triangle[3 * (size_t)triangle + k]);
}

static float center_along(const tsuya_mesh *mesh, uint32_t triangle, int axis)
{
    const uint32_t *i = mesh->triangle + 3 * (size_t)triangle;
    return mesh->position[3 * (size_t)i[0] + axis] + mesh->position[3 * (size_t)i[1] + axis] +
           mesh->position[3 * (size_t)i[2] + axis];
}

static void bound(node *n, const tsuya_mesh_tree *tree, uint32_t begin, uint32_t end)
{
    for (int axis = 0; axis < 3; axis++) {
        n->low[axis] = INFINITY;
        n->high[axis] = -INFINITY;
        for (uint32_t o = begin; o < end; o++) {
            for (size_t k = 0; k < 3; k++) {
                float x = tree->mesh->position[3 * (size_t)tree->mesh->triangle[3 * (size_t)tree->order[o] + k] + axis];
                n->low[axis] = fminf(n->low[axis], x);
                n->high[axis] = fmaxf(n->high[axis], x);
            }
        }
    }
}

/* Quickselect: order[middle] gets the triangle that sorting would put there; equal centres fall by index. */
static void select_middle(tsuya_mesh_tree *tree, uint32_t begin, uint32_t end, uint32_t middle, int axis)
{
    uint32_t *o = tree->order;
    while (end - begin > 1) {
        uint32_t pivot = o[begin + (end - begin) / 2];
        float value = center_along(tree->mesh, pivot, axis);
        uint32_t i = begin, j = end - 1;
        while (i <= j) {
            float left, right;
            while (left = center_along(tree->mesh, o[i], axis), left < value || (left == value && o[i] < pivot)) {
                i++;
            }
            while (right = center_along(tree->mesh, o[j], axis), right > value || (right == value && o[j] > pivot)) {
                j--;
            }
            if (i <= j) {
                uint32_t swap = o[i];
                o[i++] = o[j];
                o[j] = swap;
                if (j-- == 0) {
                    break;
                }
            }
        }
        if (middle + 1 <= j + 1) {
            end = j + 1;
        } else if (middle >= i) {
            begin = i;
        } else {
            return;
        }
    }
}

static void build(tsuya_mesh_tree *tree, uint32_t begin, uint32_t end)
{
    node *n = &tree->nodes[tree->node_count++];
    bound(n, tree, begin, end);
    if (end - begin <= LEAF_TRIANGLES) {
        n->begin = begin;
        n->count = end - begin;
        return;
    }
    int axis = 0;
    for (int a = 1; a < 3; a++) {
        axis = n->high[a] - n->low[a] > n->high[axis] - n->low[axis] ? a : axis;
    }
    uint32_t middle = begin + (end - begin) / 2;
    select_middle(tree, begin, end, middle, axis);
    n->count = 0;
    build(tree, begin, middle); /* depth is the logarithm of the count, since halves are equal */
    n->begin = tree->node_count;
    build(tree, middle, end);
}

tsuya_status tsuya_mesh_tree_create(tsuya_mesh_tree **tree, const tsuya_mesh *mesh)
{
    *tree = NULL;
    if (mesh->triangle_count == 0) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "distances to a mesh of 0 triangles; at least 1 is needed");
    }
    tsuya_status status = TSUYA_OK;
    tsuya_mesh_tree *made;
    TSUYA_NEW(status, made, 1);
    made->mesh = mesh;
    TSUYA_NEW(status, made->order, mesh->triangle_count);
    TSUYA_NEW(status, made->nodes, 2 * mesh->triangle_count); /* a leaf has at least one triangle */
    for (uint32_t t = 0; t < mesh->triangle_count; t++) {
        made->order[t] = t;
    }
    build(made, 0, (uint32_t)mesh->triangle_count);
    *tree = made;
    return TSUYA_OK;
done:
    tsuya_mesh_tree_free(made);
    return status;
}

void tsuya_mesh_tree_free(tsuya_mesh_tree *tree)
{
    if (tree) {
        tsuya_free(tree->order);
        tsuya_free(tree->nodes);
        tsuya_free(tree);
    }
}

static tsuya_vec3 closest_on_segment(tsuya_vec3 p, tsuya_vec3 a, tsuya_vec3 b)
{
    tsuya_vec3 ab = tsuya_vec3_sub(b, a);
    double length2 = tsuya_vec3_dot(ab, ab);
    double t = length2 > 0.0 ? tsuya_vec3_dot(tsuya_vec3_sub(p, a), ab) / length2 : 0.0;
    return tsuya_vec3_mad(a, fmin(fmax(t, 0.0), 1.0), ab);
}

static tsuya_vec3 closest_on_triangle(tsuya_vec3 p, tsuya_vec3 a, tsuya_vec3 b, tsuya_vec3 c)
{
    tsuya_vec3 ab = tsuya_vec3_sub(b, a), ac = tsuya_vec3_sub(c, a), ap = tsuya_vec3_sub(p, a);
    tsuya_vec3 bp = tsuya_vec3_sub(p, b), cp = tsuya_vec3_sub(p, c);
    double d1 = tsuya_vec3_dot(ab, ap), d2 = tsuya_vec3_dot(ac, ap), d3 = tsuya_vec3_dot(ab, bp);
    double d4 = tsuya_vec3_dot(ac, bp), d5 = tsuya_vec3_dot(ab, cp), d6 = tsuya_vec3_dot(ac, cp);
    double va = d3 * d6 - d5 * d4, vb = d5 * d2 - d1 * d6, vc = d1 * d4 - d3 * d2;
    if (va > 0.0 && vb > 0.0 && vc > 0.0) {
        double sum = va + vb + vc;
        return tsuya_vec3_mad(tsuya_vec3_mad(a, vb / sum, ab), vc / sum, ac);
    }
    tsuya_vec3 best = closest_on_segment(p, a, b);
    const tsuya_vec3 others[2] = {closest_on_segment(p, b, c), closest_on_segment(p, c, a)};
    for (int k = 0; k < 2; k++) {
        tsuya_vec3 old = tsuya_vec3_sub(best, p), new = tsuya_vec3_sub(others[k], p);
        best = tsuya_vec3_dot(new, new) < tsuya_vec3_dot(old, old) ? others[k] : best;
    }
    return best;
}

static double box_distance2(const node *n, tsuya_vec3 p)
{
    const double x[3] = {p.x, p.y, p.z};
    double sum = 0.0;
    for (int a = 0; a < 3; a++) {
        double d = fmax(fmax((double)n->low[a] - x[a], x[a] - (double)n->high[a]), 0.0);
        sum += d * d;
    }
    return sum;
}

static void try_leaf(tsuya_mesh_hit *hit, double *best2, const tsuya_mesh_tree *tree, const node *n, tsuya_vec3 p)
{
    for (uint32_t o = n->begin; o < n->begin + n->count; o++) {
        uint32_t t = tree->order[o];
        tsuya_vec3 q = closest_on_triangle(p, corner(tree->mesh, t, 0), corner(tree->mesh, t, 1), corner(tree->mesh, t, 2));
        tsuya_vec3 d = tsuya_vec3_sub(q, p);
        double d2 = tsuya_vec3_dot(d, d);
        if (d2 < *best2) {
            *best2 = d2;
            *hit = (tsuya_mesh_hit){sqrt(d2), q, t};
        }
    }
}

tsuya_mesh_hit tsuya_mesh_tree_closest(const tsuya_mesh_tree *tree, tsuya_vec3 point, double limit)
{
    tsuya_mesh_hit hit = {INFINITY, point, UINT32_MAX};
    double best2 = limit * limit;
    uint32_t stack[STACK_SIZE];
    int depth = 0;
    stack[depth++] = 0;
    while (depth > 0) {
        uint32_t at = stack[--depth];
        const node *n = &tree->nodes[at];
        if (box_distance2(n, point) >= best2) {
            continue;
        }
        if (n->count > 0) {
            try_leaf(&hit, &best2, tree, n, point);
            continue;
        }
        uint32_t first = at + 1, second = n->begin;
        bool swap = box_distance2(&tree->nodes[second], point) < box_distance2(&tree->nodes[first], point);
        stack[depth++] = swap ? first : second; /* the nearer child is looked at first */
        stack[depth++] = swap ? second : first;
    }
    return hit;
}

tsuya_status tsuya_mesh_distances(float *distance, const tsuya_mesh *mesh, const float *point, size_t count,
                                  const tsuya_context *context)
{
    tsuya_mesh_tree *tree;
    TSUYA_TRY(tsuya_mesh_tree_create(&tree, mesh));
#pragma omp parallel for num_threads(context->threads) schedule(dynamic, 4096)
    for (size_t p = 0; p < count; p++) {
        const tsuya_vec3 at = {point[3 * p], point[3 * p + 1], point[3 * p + 2]};
        distance[p] = (float)tsuya_mesh_tree_closest(tree, at, INFINITY).distance;
    }
    tsuya_mesh_tree_free(tree);
    return TSUYA_OK;
}
