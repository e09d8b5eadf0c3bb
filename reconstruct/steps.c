#include "reconstruct/steps.h"

#include <string.h>

tsuya_status tsuya_steps_load(tsuya_steps *steps, const char *folder, tsuya_hash inputs)
{
    *steps = (tsuya_steps){.key = inputs};
    steps->path = tsuya_path_join(folder, "steps.json");
    if (!steps->path) {
        return TSUYA_ERROR_MEMORY;
    }
    if (tsuya_path_exists(steps->path) && (tsuya_json_load(&steps->record, steps->path) != TSUYA_OK || !tsuya_json_is_object(steps->record))) {
        tsuya_warn("%s: cannot be used; all steps are run again", steps->path);
        tsuya_json_free(steps->record);
        steps->record = NULL;
    }
    if (!steps->record) {
        steps->record = tsuya_json_create_object();
    }
    return steps->record ? TSUYA_OK : TSUYA_ERROR_MEMORY;
}

void tsuya_steps_free(tsuya_steps *steps)
{
    tsuya_json_free(steps->record);
    tsuya_free(steps->path);
    *steps = (tsuya_steps){0};
}

bool tsuya_step_begin(tsuya_steps *steps, const char *name, const char *options, const char *output)
{
    char text[4096];
    snprintf(text, sizeof text, "%s|%s|%s|%s", steps->key.hex, name, TSUYA_VERSION, options);
    steps->key = tsuya_hash_bytes(text, strlen(text));
    tsuya_step *step = &steps->step[steps->count];
    *step = (tsuya_step){0};
    snprintf(step->name, sizeof step->name, "%s", name);
    const tsuya_json *record = tsuya_json_member(steps->record, name);
    bool same = strcmp(tsuya_json_text_or(tsuya_json_member(record, "key"), ""), steps->key.hex) == 0;
    step->skipped = same && (!output || tsuya_path_exists(output));
    if (step->skipped) {
        step->seconds = tsuya_json_number_or(tsuya_json_member(record, "seconds"), 0.0);
        step->peak_mb = tsuya_json_number_or(tsuya_json_member(record, "peak_mb"), 0.0);
        steps->count++;
        return true;
    }
    steps->start_s = tsuya_clock_s();
    steps->child_mb = 0.0;
    tsuya_peak_memory_reset();
    return false;
}

tsuya_status tsuya_step_end(tsuya_steps *steps, const tsuya_json *figures)
{
    tsuya_step *step = &steps->step[steps->count++];
    double own_mb = tsuya_peak_memory_mb();
    step->seconds = tsuya_clock_s() - steps->start_s;
    step->peak_mb = steps->child_mb > own_mb ? steps->child_mb : own_mb;
    tsuya_json *record = tsuya_json_set_object(steps->record, step->name);
    tsuya_json_set_text(record, "key", steps->key.hex);
    tsuya_json_set_number(record, "seconds", step->seconds);
    tsuya_json_set_number(record, "peak_mb", step->peak_mb);
    if (figures) {
        tsuya_json_set_copy(record, "figures", figures);
    }
    return tsuya_json_save(steps->record, steps->path);
}

const tsuya_json *tsuya_step_figures(const tsuya_steps *steps, const char *name)
{
    return tsuya_json_member(tsuya_json_member(steps->record, name), "figures");
}
