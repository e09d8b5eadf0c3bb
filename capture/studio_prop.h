/* Matt things in the studio beside the cloth: floor, stands, plates with tags or a colour chart printed on them. */
#ifndef TSUYA_CAPTURE_STUDIO_PROP_H
#define TSUYA_CAPTURE_STUDIO_PROP_H

#include "core/geometry.h"
#include "core/mesh.h"

/* A grid of AprilTags as calib/board.h has it (origin at the lower left corner of the first tag), or a grid of even patches. */
typedef struct tsuya_studio_print {
    tsuya_pose print_from_world; /* x right, y up, z off the plate */
    float paper, ink;            /* albedo */
    int cols, rows;
    double size_m, gap_m;        /* of a tag or patch, and between them */
    uint8_t *white;              /* tags: cols × rows patterns of width² cells, from the top; NULL: patches */
    int width, border_width;     /* of a pattern in cells; of the tag's edge in it; 1 and 1: patches */
    float (*patch)[3];           /* cols × rows albedos, linear Rec.709 */
} tsuya_studio_print;
/* Mean albedo about a point in the print's frame, over spread_m (≥ 0) along its x and y. */
TSUYA_API void tsuya_studio_print_at(const tsuya_studio_print *print, tsuya_vec3 p, const double spread_m[2], float rgb[3]);

typedef struct tsuya_studio_prop {
    tsuya_mesh mesh;           /* position, normal */
    float albedo[3];
    tsuya_studio_print *print; /* owned; NULL: plain */
} tsuya_studio_prop;
TSUYA_API void tsuya_studio_prop_free(tsuya_studio_prop *prop);
/* A grey floor at z, 5 m wide, finer in the middle. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_studio_prop_floor(tsuya_studio_prop *prop, tsuya_vec3 center);
/* Grey, round about the axis from a along `axis` (unit): rings of profile[i][1] m radius at profile[i][0] m from a. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_studio_prop_revolve(tsuya_studio_prop *prop, tsuya_vec3 a, tsuya_vec3 axis,
                                                                  const double (*profile)[2], int count);
/* A white rectangle in the plane z = 0 of its own frame. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_studio_prop_plate(tsuya_studio_prop *prop, tsuya_pose world_from_plate, tsuya_vec2 low,
                                                                tsuya_vec2 high, double spacing_m);

typedef struct tsuya_studio_grid {
    const char *family;
    int border_bits, cols, rows, first_id;
    double tag_mm, gap_mm;
} tsuya_studio_grid;
/* A plate with tags, a gap of paper around them.  Fails on families and ids that do not exist. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_studio_prop_tags(tsuya_studio_prop *prop, tsuya_pose world_from_print,
                                                               const tsuya_studio_grid *grid);
/* A chart of 6 × 4 colours of 30 mm; its lowest row is grey. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_studio_prop_chart(tsuya_studio_prop *prop, tsuya_pose world_from_print);

#endif
