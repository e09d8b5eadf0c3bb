/* The dyes of a job's cloth, where its lamps were measured.  For stage render. */
#ifndef TSUYA_APP_STAGE_DYE_H
#define TSUYA_APP_STAGE_DYE_H

#include "app/stage.h"

#include "core/camera.h"

/* Lamps of a file, as measured in the room where the photographs were taken; a preset is a wish. */
bool tsuya_stage_has_measured_lamps(const tsuya_job *job);
/* From all placed photographs but those of hold_out into JOB/render/dyed.ply; figures get "dye".  *path stays NULL where the mesh has
 * no colours, or a material is spectral (with a warning). */
TSUYA_MUST_CHECK tsuya_status tsuya_stage_dye(const char **path, const tsuya_stage_run *run, const tsuya_sparse_model *model);

#endif
