/* A small job out of real photographs: some of a folder, reduced, with their EXIF and masks. */
#ifndef TSUYA_TESTS_PIPELINE_REDUCED_H
#define TSUYA_TESTS_PIPELINE_REDUCED_H

#include "core/status.h"

/* Writes FOLDER/photos, FOLDER/masks and FOLDER/JOB.yaml of `count` photographs of the museum figure, from index `first` in
 * the order of their names, at 1/divisor of their size; `extra`: further lines of JOB.yaml. */
TSUYA_MUST_CHECK tsuya_status reduced_job_write(const char *folder, const char *data, int first, int count, int divisor,
                                                const char *extra);

#endif
