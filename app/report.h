/* report/index.html: one self-contained file about a job, readable from disk without a network. */
#ifndef TSUYA_APP_REPORT_H
#define TSUYA_APP_REPORT_H

#include "app/stage.h"

/* Writes the report out of what the stages have left in the job folder; what a job lacks is left out or said.
 * `figures`: pictures, bytes. */
TSUYA_MUST_CHECK tsuya_status tsuya_report_write(tsuya_json *figures, const tsuya_job *job, const tsuya_state *state,
                                                 const tsuya_context *context);

#endif
