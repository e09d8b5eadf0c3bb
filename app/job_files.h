/* What the later stages of a job read from the user, read once before the first: a reconstruction takes hours, and a table of
 * the wrong kind need not wait for it. */
#ifndef TSUYA_APP_JOB_FILES_H
#define TSUYA_APP_JOB_FILES_H

#include "app/job.h"

/* Materials (their tables or models) and, where they are to be rendered, their channels and the lamps; fails as the stages brdf and
 * render would. */
TSUYA_MUST_CHECK tsuya_status tsuya_job_check_files(const tsuya_job *job, bool rendered);

#endif
