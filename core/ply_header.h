/* What a PLY header declares, and the parser of it; used by core/ply_read.c. */
#ifndef TSUYA_CORE_PLY_HEADER_H
#define TSUYA_CORE_PLY_HEADER_H

#include "core/status.h"

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

typedef enum ply_type { PLY_NONE, PLY_I8, PLY_U8, PLY_I16, PLY_U16, PLY_I32, PLY_U32, PLY_F32, PLY_F64 } ply_type;
typedef enum ply_format { PLY_ASCII, PLY_LITTLE, PLY_BIG } ply_format;

enum { PLY_NAME_SIZE = 64, PLY_ELEMENTS_MAX = 32, PLY_PROPERTIES_MAX = 128 };

typedef struct ply_property {
    char name[PLY_NAME_SIZE];
    ply_type type;       /* of the scalar or of the list's items */
    ply_type count_type; /* PLY_NONE: a scalar */
} ply_property;

typedef struct ply_element {
    char name[PLY_NAME_SIZE];
    uint64_t count;
    int first_property, property_count;
} ply_element;

typedef struct ply_header {
    ply_format format;
    ply_element element[PLY_ELEMENTS_MAX];
    int element_count;
    ply_property property[PLY_PROPERTIES_MAX]; /* of all elements, in order */
    int property_count;
    uint64_t bytes; /* length of the header */
    int lines;
} ply_header;

/* Reads up to and with the line end_header; the stream then stands at the body. */
TSUYA_MUST_CHECK TSUYA_INTERNAL tsuya_status tsuya_ply_header_read(ply_header *header, FILE *stream, const char *path);
/* Bytes of a scalar in binary. */
TSUYA_INTERNAL int tsuya_ply_type_size(ply_type type);

#endif
