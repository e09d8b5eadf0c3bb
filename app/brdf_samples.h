/* Samples as the commands `tsuya brdf …` take them: a table, a radiometer's table beside it, and the channels wanted. */
#ifndef TSUYA_APP_BRDF_SAMPLES_H
#define TSUYA_APP_BRDF_SAMPLES_H

#include "brdf/samples_join.h"
#include "core/json.h"

typedef struct tsuya_samples_source {
    const char *path, *radiometer; /* radiometer: NULL where there is none */
    const char *channels;          /* NULL or "own": as measured (joined: wavelengths); "rgb" */
} tsuya_samples_source;

/* `info->linked` is 0 where nothing was joined. */
TSUYA_MUST_CHECK tsuya_status tsuya_brdf_samples(tsuya_samples *samples, tsuya_join_info *info, const tsuya_samples_source *source,
                                                 const tsuya_context *context);
/* "joined": what tsuya_samples_join says; nothing where nothing was joined. */
void tsuya_brdf_joined(tsuya_json *figures, const tsuya_join_info *info);
/* true for "own" and "rgb" */
bool tsuya_brdf_channels_known(const char *text);

/* Help of the two options, and their keys. */
enum { TSUYA_KEY_WITH = 0x2001, TSUYA_KEY_CHANNELS };
#define TSUYA_BRDF_WITH_HELP "A radiometer's spectra at a few of the angles; the camera's SAMPLES.csv and they are joined, their scales reconciled"
#define TSUYA_BRDF_CHANNELS_HELP "own (default): as measured, with --with the wavelengths; rgb: spectra become linear Rec.709 under D65"

#endif
