/* A weft field held against the true one. */
#ifndef TSUYA_APP_WEAVE_TRUTH_H
#define TSUYA_APP_WEAVE_TRUTH_H

#include "core/json.h"
#include "core/mesh.h"

/* Figures over the vertices of confidence ≥ 0.5: angle_error_deg {median, p90}, between the weft and the truth's at the nearest
 * point of its surface, as lines; wrong_family, the share with the warp taken for the weft (error above 45 degrees).  The truth
 * must lie in the same frame and carry weft_x weft_y weft_z. */
TSUYA_MUST_CHECK tsuya_status tsuya_weave_truth(tsuya_json *figures, const tsuya_mesh *mesh, const char *truth_path);

#endif
