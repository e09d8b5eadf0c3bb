/* A mesh as a graph of vertices, with what carries directions along its edges. */
#ifndef TSUYA_WEAVE_DETECT_MESH_GRAPH_H
#define TSUYA_WEAVE_DETECT_MESH_GRAPH_H

#include "core/mesh.h"

/* Neighbours of vertex v: entries start[v] … start[v + 1] − 1, by rising index.  An angle θ in the tangent basis of the
 * neighbour is θ + turn in the basis of v (parallel transport along the edge, the normals turned onto each other).  weight:
 * cotangents (Pinkall & Polthier 1993), kept ≥ 0.05, less over sharp folds; turn and weight fit both ways. */
typedef struct tsuya_mesh_graph {
    size_t vertex_count;
    uint32_t *start, *neighbour;
    float *turn_rad, *weight;
    float *area;   /* of each vertex: a third of its triangles */
    uint8_t *rim;  /* 1 where an edge of the vertex has one triangle only */
} tsuya_mesh_graph;

/* The mesh must have normals.  O(triangles). */
TSUYA_MUST_CHECK tsuya_status tsuya_mesh_graph_create(tsuya_mesh_graph *graph, const tsuya_mesh *mesh);
void tsuya_mesh_graph_free(tsuya_mesh_graph *graph);

/* Index of the entry (v → neighbour); UINT32_MAX where there is none. */
uint32_t tsuya_mesh_graph_find(const tsuya_mesh_graph *graph, uint32_t v, uint32_t neighbour);

#endif
