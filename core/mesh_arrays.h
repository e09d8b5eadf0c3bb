/* The arrays of a tsuya_mesh as a table, so that copying, filtering, reading and writing treat them alike. */
#ifndef TSUYA_CORE_MESH_ARRAYS_H
#define TSUYA_CORE_MESH_ARRAYS_H

#include "core/mesh.h"

typedef struct tsuya_mesh_array {
    unsigned flag; /* TSUYA_MESH_…, 0 for the position */
    size_t offset; /* of the pointer in tsuya_mesh */
    int components;
    bool bytes;    /* uint8_t, else float */
    const char *property[3]; /* names in PLY */
} tsuya_mesh_array;

enum { TSUYA_MESH_ARRAY_COUNT = 10 };
/* In the order of the PLY's properties; the position comes first. */
extern const tsuya_mesh_array tsuya_mesh_arrays[TSUYA_MESH_ARRAY_COUNT];

static inline void **tsuya_mesh_array_slot(tsuya_mesh *mesh, const tsuya_mesh_array *array)
{
    return (void **)((char *)mesh + array->offset);
}
static inline void *tsuya_mesh_array_data(const tsuya_mesh *mesh, const tsuya_mesh_array *array)
{
    return *(void *const *)((const char *)mesh + array->offset);
}
/* Bytes of one vertex in the array. */
static inline size_t tsuya_mesh_array_stride(const tsuya_mesh_array *array)
{
    return (size_t)array->components * (array->bytes ? 1 : sizeof(float));
}

#endif
