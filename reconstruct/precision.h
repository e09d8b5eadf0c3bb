/* How fine the dense steps have to be for an error that is asked for (inside reconstruct/).
 *
 * A step is a size of the depth maps and a number of sources.  Its error is two standard deviations of a fused point along
 * its normal, as fusion.c reckons them: matching to 0.15 pixels of the map, at the angle that the sources give, in as many
 * views; and, in squares, a ground sample distance of the map, for folds that are finer cannot be seen in it.  Of a tolerance the depth may take 0.8 and the mesh 0.5: together, in squares, 0.94. */
#ifndef TSUYA_RECONSTRUCT_PRECISION_H
#define TSUYA_RECONSTRUCT_PRECISION_H

#include "core/camera.h"
#include "core/json.h"
#include "core/memory.h"

typedef struct tsuya_precision_step {
    int long_side_px, source_views;
    double error;       /* of the depth, unit of the world */
    double cost;        /* relative: megapixels times views compared */
} tsuya_precision_step;

typedef struct tsuya_precision {
    tsuya_precision_step chosen, finer; /* finer.long_side_px 0: nothing is finer */
    double tolerance;       /* asked for; 0: the step was given */
    double mesh_tolerance;  /* of the decimation; 0: the surface's own default */
    bool reached;           /* chosen.error keeps the depth's share */
} tsuya_precision;

/* Standard deviation of the depth of one pair of views whose rays meet at an angle with this sine. */
double tsuya_matching_sigma(double gsd, double sine);

/* The cheapest step that keeps `tolerance` (0: the step `given`), and the cheapest one whose error is at least a tenth
 * lower.  `gsd`: of photographs with a longer side of `full_px`.  Parts of `given` that are above 0 are kept in any case. */
TSUYA_MUST_CHECK tsuya_status tsuya_precision_choose(tsuya_precision *out, const tsuya_sparse_model *model, double gsd, int full_px,
                                                     double tolerance, tsuya_precision_step given, tsuya_arena *arena);

/* `seconds`: what the chosen step took. */
void tsuya_precision_to_json(tsuya_json *object, const tsuya_precision *precision, double seconds);

#endif
