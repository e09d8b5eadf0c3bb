/* A job held against the truth of a simulated one: truth/{mesh.ply, sparse/}. */
#ifndef TSUYA_APP_TRUTH_H
#define TSUYA_APP_TRUTH_H

#include "app/stage.h"
#include "brdf/material.h"

/* Figures of INTERFACE's demo, as far as this version measures them; the others are null.
 *
 * A job with a scale of its own has the mat's frame, as the truth has, and is held against it as it stands; scale_rel is how far the
 * similarity that best aligns the camera centres is from scale 1.  Another job is moved onto the truth by that similarity
 * (and by nothing else: no fitting of surfaces), and its scale_rel is null.  Distances are in ground sample
 * distances of the photographs.
 *   focal_rel          |f / f_true − 1|
 *   camera_center_gsd  rms over the photographs
 *   surface_gsd        vertices of the result to the true surface
 *   completeness       share of the true surface, seen by three photographs or more, within 2 GSD of the result
 *   weft_deg           angle to the true weft where the field has confidence
 *   weft_all_deg       the same over all vertices, those included that inherit it
 *   covered_fraction   of the field, as the stage says
 *   brdf_cbrt.table    e_cbrt of the fitted material on truth/held_out.csv (half a step beside the bench's azimuths and tilts), where
 *                      the job measured one; table_hemispheres: on truth/reflectance.csv, pairs over both hemispheres
 *   brdf_cbrt.photos   the same of the photographed swatch, see tsuya_truth_swatch
 *   rerender_de00      as the render stage measured it on the photographs of hold_out */
TSUYA_MUST_CHECK tsuya_status tsuya_truth_compare(tsuya_json *figures, const tsuya_job *job, const tsuya_state *state,
                                                  const char *truth_folder, const tsuya_context *context);

/* e_cbrt of a material on a table of directions; NaN where their channels differ in number. */
TSUYA_MUST_CHECK tsuya_status tsuya_truth_reflectance(double *error, const tsuya_material *material, const char *table);
/* e_cbrt on truth/reflectance.csv of what `brdf gather` and `brdf fit` make of the photographs in TRUTH/../swatch, with the stage's own
 * poses (TRUTH/swatch); NaN without such photographs. */
TSUYA_MUST_CHECK tsuya_status tsuya_truth_swatch(double *error, const char *truth_folder, const tsuya_context *context);

/* The surface of a reconstruction (its folder: mesh.ply, sparse/0) against a mesh in the same frame, for example with known
 * poses: accuracy_m {median, p90} and completeness {tolerance_m, fraction}. */
TSUYA_MUST_CHECK tsuya_status tsuya_truth_compare_surface(tsuya_json *figures, const char *folder, const char *true_mesh_path,
                                                          double gsd, const tsuya_context *context);

#endif
