/* PCL behind plain structs: nearest neighbours and Poisson surfaces.  No exception leaves it. */
#ifndef TSUYA_RECONSTRUCT_PCL_ADAPTER_H
#define TSUYA_RECONSTRUCT_PCL_ADAPTER_H

#include "core/mesh.h"

/* Exact nearest neighbours (FLANN's single k-d tree). */
typedef struct tsuya_pcl_tree tsuya_pcl_tree;
/* `position`: 3 × count finite floats, copied.  count in 1 … 2³¹−1. */
TSUYA_MUST_CHECK TSUYA_INTERNAL tsuya_status tsuya_pcl_tree_create(tsuya_pcl_tree **tree, const float *position, size_t count);
TSUYA_INTERNAL void tsuya_pcl_tree_free(tsuya_pcl_tree *tree);
/* The k nearest points of each query, nearest first: `index` and `distance2` (squared) are query_count × k.  k ≤ count. */
TSUYA_MUST_CHECK TSUYA_INTERNAL tsuya_status tsuya_pcl_nearest(uint32_t *index, float *distance2, const tsuya_pcl_tree *tree,
                                                               const float *query, size_t query_count, int k, int threads);

/* Screened Poisson surface (Kazhdan & Hoppe 2013) of a cloud with unit normals; a closed or boundary-clipped mesh with
 * positions only.  The octree has 2^depth cells along 1.1 times the cloud's longest side.  One thread, so that the mesh is
 * the same bit for bit.  What PCL prints meanwhile is dropped. */
TSUYA_MUST_CHECK TSUYA_INTERNAL tsuya_status tsuya_pcl_poisson(tsuya_mesh *mesh, const tsuya_mesh *cloud, int depth,
                                                               float point_weight);

#endif
