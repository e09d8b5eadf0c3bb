#include "app/state.h"

#include "core/file.h"

enum { FORMAT = 1 };

static tsuya_status read_stages(tsuya_state *state)
{
    tsuya_json *old;
    TSUYA_TRY(tsuya_json_load(&old, state->path));
    int format;
    tsuya_status status = tsuya_json_get_int(&format, old, "format");
    if (status == TSUYA_OK && format > FORMAT) {
        status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: format %d is from a newer program, this one reads %d", state->path, format, FORMAT);
    }
    const tsuya_json *stages = tsuya_json_member(old, "stages");
    if (status == TSUYA_OK && !tsuya_json_is_object(stages)) {
        status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: stages: expected an object; remove the file to start afresh", state->path);
    }
    for (const tsuya_json *s = tsuya_json_first(stages); status == TSUYA_OK && s; s = tsuya_json_next(s)) {
        tsuya_json_set_copy(state->stages, tsuya_json_key(s), s);
    }
    tsuya_json_free(old);
    return status;
}

tsuya_status tsuya_state_load(tsuya_state *state, const char *folder, const char *job_name)
{
    *state = (tsuya_state){.root = tsuya_json_create_object(), .path = tsuya_path_join(folder, "state.json")};
    if (!state->root || !state->path) {
        tsuya_state_free(state);
        return TSUYA_ERROR_MEMORY;
    }
    tsuya_json_set_number(state->root, "format", FORMAT);
    tsuya_json_set_text(state->root, "program", TSUYA_VERSION);
    tsuya_json_set_text(state->root, "job", job_name);
    state->stages = tsuya_json_set_object(state->root, "stages");
    tsuya_status status = state->stages ? TSUYA_OK : TSUYA_ERROR_MEMORY;
    if (status == TSUYA_OK && tsuya_path_exists(state->path)) {
        status = read_stages(state);
    }
    if (status != TSUYA_OK) {
        tsuya_state_free(state);
    }
    return status;
}

tsuya_status tsuya_state_save(const tsuya_state *state) { return tsuya_json_save(state->root, state->path); }

void tsuya_state_free(tsuya_state *state)
{
    tsuya_json_free(state->root);
    tsuya_free(state->path);
    *state = (tsuya_state){0};
}

const tsuya_json *tsuya_state_record(const tsuya_state *state, const char *stage)
{
    const tsuya_json *record = tsuya_json_member(state->stages, stage);
    return tsuya_json_is_object(record) ? record : NULL;
}
