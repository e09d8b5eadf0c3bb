/* Triangle meshes and point clouds in memory, and the PLY that holds them.
 *
 * Optional arrays are NULL where a file or a stage has none.  Counter-clockwise triangles seen from outside. */
#ifndef TSUYA_CORE_MESH_H
#define TSUYA_CORE_MESH_H

#include "core/geometry.h"
#include "core/status.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct tsuya_mesh {
    size_t vertex_count, triangle_count; /* a cloud has no triangles */
    float *position;          /* 3 × vertex_count, metres (or COLMAP's unit), x y z */
    float *normal;            /* 3 × vertex_count, unit; nx ny nz */
    uint8_t *color;           /* 3 × vertex_count, sRGB; red green blue */
    float *weft;              /* 3 × vertex_count, unit tangent along the weft; weft_x weft_y weft_z */
    float *weave_confidence;  /* vertex_count, [0, 1] */
    float *shear_deg;         /* vertex_count, angle from weft to warp, counter-clockwise about the normal, less 90 degrees */
    float *threads_per_m;     /* 2 × vertex_count, of weft and of warp, across them, per unit of position; 0: not seen */
    float *evidence;          /* vertex_count, how many photographs support the place */
    float *sigma;             /* vertex_count, standard deviation of the position along the normal, unit of position */
    uint8_t *material;        /* vertex_count, index of the material */
    uint32_t *triangle;       /* 3 × triangle_count, each < vertex_count */
} tsuya_mesh;

/* Which optional arrays a new mesh gets. */
enum {
    TSUYA_MESH_NORMAL = 1, TSUYA_MESH_COLOR = 2, TSUYA_MESH_WEFT = 4, TSUYA_MESH_CONFIDENCE = 8, TSUYA_MESH_EVIDENCE = 16,
    TSUYA_MESH_MATERIAL = 32, TSUYA_MESH_SIGMA = 64, TSUYA_MESH_SHEAR = 128, TSUYA_MESH_THREADS = 256,
};

/* Zeroed arrays. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_mesh_create(tsuya_mesh *mesh, size_t vertex_count, size_t triangle_count,
                                                          unsigned optional_arrays);
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_mesh_copy(tsuya_mesh *copy, const tsuya_mesh *mesh);
TSUYA_API void tsuya_mesh_free(tsuya_mesh *mesh);
/* Adds a missing optional array (zeroed); an existing one stays. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_mesh_add_arrays(tsuya_mesh *mesh, unsigned optional_arrays);

/* PLY 1.0, binary little or big endian or ASCII; scalar properties of any PLY type, in any order; unknown scalar properties
 * and elements are passed over; faces are fan-triangulated.  Refused with the file, line or element, and value: headers
 * that lie about counts (checked against the file's size before memory is taken), list lengths outside 3 … 255, indices
 * out of range, NaN or infinite positions (with the vertex's index), truncated bodies. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_ply_load(tsuya_mesh *mesh, const char *path);
typedef struct tsuya_ply_save_options {
    bool ascii;
    int comment_count;
    const char *const *comment;
} tsuya_ply_save_options;
/* Atomic.  Property order: x y z nx ny nz red green blue weft_x weft_y weft_z weave_confidence shear_deg
 * weft_threads_per_m warp_threads_per_m evidence sigma material. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_ply_save(const tsuya_mesh *mesh, const char *path,
                                                       const tsuya_ply_save_options *options /* NULL: binary little-endian */);

static inline tsuya_vec3 tsuya_mesh_position(const tsuya_mesh *m, size_t v)
{
    return (tsuya_vec3){m->position[3 * v], m->position[3 * v + 1], m->position[3 * v + 2]};
}
/* Area-weighted vertex normals into `normal` (added when missing); degenerate triangles count nothing, lonely vertices get 0. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_mesh_compute_normals(tsuya_mesh *mesh);
TSUYA_API void tsuya_mesh_bounds(const tsuya_mesh *mesh, tsuya_vec3 *low, tsuya_vec3 *high); /* empty: low > high */
TSUYA_API double tsuya_mesh_mean_edge(const tsuya_mesh *mesh);
TSUYA_API double tsuya_mesh_area(const tsuya_mesh *mesh);
/* One side of a triangle, its ends in order.  corner: 3 × triangle + the corner across; the side runs from the corner after it to the next. */
typedef struct tsuya_side { uint32_t low, high, corner; } tsuya_side;
/* Fills 3 × triangle_count sides, those of one edge beside each other, by low, high, corner; returns the number of edges. */
TSUYA_API size_t tsuya_mesh_sides(tsuya_side *side, const uint32_t *triangle, size_t triangle_count);
static inline bool tsuya_side_same_edge(const tsuya_side *a, const tsuya_side *b) { return a->low == b->low && a->high == b->high; }
/* Drops what `keep_vertex` says no to, the triangles that touch it, and, with `drop_lonely`, vertices of no triangle.
 * Order is kept. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_mesh_filter(tsuya_mesh *mesh, const uint8_t *keep_vertex, bool drop_lonely);

#endif
