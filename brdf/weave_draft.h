/* Drafts: which yarn lies on the face, crossing by crossing. */
#ifndef TSUYA_BRDF_WEAVE_DRAFT_H
#define TSUYA_BRDF_WEAVE_DRAFT_H

#include "core/status.h"

enum { TSUYA_DRAFT_MOST = 2048, TSUYA_DRAFT_SHAFTS = 256 };

/* One repeat: warp_up[pick * ends + end] is 1 where the warp lies over the weft.  tsuya_draft_free. */
typedef struct tsuya_draft {
    int ends, picks;
    unsigned char *warp_up;
} tsuya_draft;

/* "plain"; "twill-N/M" (the warp over N wefts and under M, stepping by one); "satin-N" or "satin-N/S" (the warp over N − 1 wefts, steps
 * of S; S left out: the smallest that makes a satin, 2 for 5 and 3 for 8); "sateen-N/S" (its back); or FILE.wif. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_draft_create(tsuya_draft *draft, const char *name_or_file);
/* A WIF 1.1 draft from its text: threading with treadling and tie-up, or with a lift plan; rising and sinking sheds. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_draft_parse(tsuya_draft *draft, const char *text, const char *name_for_messages);
TSUYA_API void tsuya_draft_free(tsuya_draft *draft);

#endif
