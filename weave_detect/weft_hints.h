/* Which family of a connected piece of cloth is the weft: the user's word, the thread counts, hem and selvedge, else only a name.
 *
 * A warp is usually the denser.  Cloth is usually cut along its threads: a level rim (a hem) then runs along the weft, an upright one (a selvedge,
 * an opening) along the warp. */
#ifndef TSUYA_WEAVE_DETECT_WEFT_HINTS_H
#define TSUYA_WEAVE_DETECT_WEFT_HINTS_H

#include "weave_detect/mesh_graph.h"
#include "weave_detect/threads.h"

/* Sums over the piece: positive speaks for the first family. */
typedef struct tsuya_weft_hints {
    double count, count_weight; /* of weights and of their absolute values */
    double rim, rim_weight;
    double level;               /* by which the first family is the more level one */
    double user;                /* likewise, towards the user's direction */
    bool has_user;
} tsuya_weft_hints;

/* True where the second family is the weft. */
bool tsuya_weft_decide(tsuya_weft_told *told, const tsuya_weft_hints *hints);

/* Along the rim at a rim vertex, unit; false where no rim vertices are beside it, or the rim turns a corner. */
bool tsuya_rim_direction(tsuya_vec3 *along, const tsuya_mesh *mesh, const tsuya_mesh_graph *graph, size_t vertex);

/* What a rim says of a line that makes the angle with it: +1 a weft, −1 a warp, 0 nothing, where neither family runs along it or it is neither
 * level nor upright.  `up_cosine`: of the rim with the vertical. */
double tsuya_rim_hint(double angle_rad, double up_cosine);

#endif
