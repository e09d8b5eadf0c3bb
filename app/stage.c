#include "app/stage.h"

#include "core/file.h"

#include <assert.h>
#include <string.h>

int tsuya_stage_find(const char *name)
{
    for (int i = 0; i < TSUYA_STAGE_COUNT; i++) {
        if (strcmp(tsuya_stages[i].name, name) == 0) {
            return i;
        }
    }
    return -1;
}

tsuya_status tsuya_stage_input(tsuya_stage_plan *plan, const char *label, const char *path)
{
    if (!path) {
        return TSUYA_OK;
    }
    if (!tsuya_path_exists(path)) {
        tsuya_json_set_null(plan->inputs, label);
        return TSUYA_OK;
    }
    tsuya_hash hash;
    TSUYA_TRY(tsuya_path_is_folder(path) ? tsuya_hash_folder(&hash, path) : tsuya_hash_file(&hash, path));
    tsuya_json_set_text(plan->inputs, label, hash.hex);
    return TSUYA_OK;
}

void tsuya_stage_output(tsuya_stage_plan *plan, const char *relative_path)
{
    assert(plan->output_count < TSUYA_STAGE_OUTPUTS);
    plan->output[plan->output_count++] = relative_path;
}
