/* Choices of two (which family, which sign) made consistent over a mesh, along the surest edges first. */
#ifndef TSUYA_WEAVE_DETECT_SPANNING_H
#define TSUYA_WEAVE_DETECT_SPANNING_H

#include "weave_detect/mesh_graph.h"

/* An undirected edge between two vertices that says whether their choices differ. */
typedef struct tsuya_choice_edge {
    uint32_t u, v;
    float trust;
    uint8_t differs;
} tsuya_choice_edge;

/* Maximum spanning forest (Kruskal, ties by the vertices' indices).  choice[v] gets 0 or 1 relative to its tree's root, whose choice is
 * 0; root[v] the root's index.  Reorders `edge`. */
TSUYA_MUST_CHECK tsuya_status tsuya_spanning_choices(uint8_t *choice, uint32_t *root, tsuya_choice_edge *edge, size_t edge_count,
                                                     size_t vertex_count);

#endif
