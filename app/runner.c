#include "app/runner.h"

#include "app/terminal.h"
#include "core/file.h"

#include <string.h>
#include <time.h>

typedef struct runner {
    const tsuya_job *job;
    const tsuya_runner_options *options;
    const tsuya_context *context;
    tsuya_state state;
    tsuya_json *result, *result_stages;
    bool earlier_would_run; /* dry run: inputs of later stages are not known yet */
} runner;

tsuya_runner_options tsuya_runner_options_default(void)
{
    return (tsuya_runner_options){.from = 0, .to = TSUYA_STAGE_COUNT - 1};
}

static tsuya_status stage_key(tsuya_hash *key, const tsuya_stage *stage, const tsuya_stage_plan *plan)
{
    char *inputs, *options;
    TSUYA_TRY(tsuya_json_print(&inputs, plan->inputs));
    tsuya_status status = tsuya_json_print(&options, plan->options);
    tsuya_hasher *hasher = NULL;
    if (status == TSUYA_OK) {
        status = tsuya_hasher_create(&hasher);
    }
    if (status == TSUYA_OK) {
        tsuya_hasher_add_text(hasher, stage->name);
        tsuya_hasher_add(hasher, &stage->version, sizeof stage->version);
        tsuya_hasher_add_text(hasher, inputs);
        tsuya_hasher_add_text(hasher, options);
        *key = tsuya_hasher_end(hasher);
        tsuya_free(options);
    }
    tsuya_free(inputs);
    return status;
}

static tsuya_status make_plan(tsuya_stage_plan *plan, const runner *r, const tsuya_stage *stage)
{
    *plan = (tsuya_stage_plan){.inputs = tsuya_json_create_object(), .options = tsuya_json_create_object()};
    if (!plan->inputs || !plan->options) {
        return TSUYA_ERROR_MEMORY;
    }
    tsuya_stage_run run = {.job = r->job, .context = r->context, .state = &r->state};
    return stage->plan(plan, &run);
}

static void free_plan(tsuya_stage_plan *plan)
{
    tsuya_json_free(plan->inputs);
    tsuya_json_free(plan->options);
}

/* What a finished stage left must still be there, as it was. */
static bool outputs_stand(const runner *r, const tsuya_json *record, const char **changed)
{
    const tsuya_json *outputs = tsuya_json_member(record, "outputs");
    for (const tsuya_json *o = tsuya_json_first(outputs); o; o = tsuya_json_next(o)) {
        char *path = tsuya_path_join(r->job->folder, tsuya_json_key(o));
        const char *kept = tsuya_json_text_or(o, "");
        bool stands = path != NULL;
        if (stands && strcmp(kept, "folder") == 0) {
            stands = tsuya_path_is_folder(path);
        } else if (stands) {
            tsuya_hash hash;
            stands = tsuya_path_exists(path) && tsuya_hash_file(&hash, path) == TSUYA_OK && strcmp(hash.hex, kept) == 0;
        }
        tsuya_free(path);
        if (!stands) {
            *changed = tsuya_json_key(o);
            return false;
        }
    }
    return true;
}

/* NULL when the record still holds, else why the stage has to run. */
static const char *why_run(const runner *r, const tsuya_json *record, const tsuya_hash *key)
{
    static char reason[256];
    const char *changed = "";
    if (!record) {
        return "not done yet";
    }
    if (r->options->force) {
        return "forced";
    }
    if (strcmp(tsuya_json_text_or(tsuya_json_member(record, "key"), ""), key->hex) != 0) {
        return "inputs, options or version changed";
    }
    if (!outputs_stand(r, record, &changed)) {
        snprintf(reason, sizeof reason, "%s is missing or was changed", changed);
        return reason;
    }
    return NULL;
}

static tsuya_status record_outputs(tsuya_json *record, const runner *r, const tsuya_stage_plan *plan)
{
    tsuya_json *outputs = tsuya_json_set_object(record, "outputs");
    for (int i = 0; i < plan->output_count; i++) {
        char *path = tsuya_path_join(r->job->folder, plan->output[i]);
        if (!path) {
            return TSUYA_ERROR_MEMORY;
        }
        tsuya_hash hash;
        tsuya_status status = TSUYA_OK;
        if (tsuya_path_is_folder(path)) {
            tsuya_json_set_text(outputs, plan->output[i], "folder");
        } else {
            status = tsuya_hash_file(&hash, path);
            if (status == TSUYA_OK) {
                tsuya_json_set_text(outputs, plan->output[i], hash.hex);
            }
        }
        tsuya_free(path);
        TSUYA_TRY(status);
    }
    return TSUYA_OK;
}

static void record_time(tsuya_json *record)
{
    time_t now = time(NULL);
    struct tm utc;
    char text[32];
    gmtime_r(&now, &utc);
    strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &utc);
    tsuya_json_set_text(record, "finished", text);
}

static void report_stage(runner *r, const tsuya_stage *stage, const tsuya_json *record, bool skipped)
{
    tsuya_json *entry = tsuya_json_set_object(r->result_stages, stage->name);
    tsuya_json_set_number(entry, "seconds", tsuya_json_number_or(tsuya_json_member(record, "seconds"), 0.0));
    tsuya_json_set_number(entry, "peak_mb", tsuya_json_number_or(tsuya_json_member(record, "peak_mb"), 0.0));
    tsuya_json_set_bool(entry, "skipped", skipped);
    const tsuya_json *figures = tsuya_json_member(record, "figures");
    if (figures) {
        tsuya_json_set_copy(r->result, stage->name, figures);
    }
}

/* STAGE/.key holds the key of the attempt that filled the folder.  What an attempt with another key left is removed, so that
 * nothing of it is taken for a result; what a killed attempt with the same key left is kept, and the stage goes on from it. */
static tsuya_status prepare_folder(const runner *r, const char *folder, const tsuya_hash *key)
{
    char *path = tsuya_path_join(folder, ".key"), *kept = NULL;
    size_t size;
    tsuya_status status = path ? TSUYA_OK : TSUYA_ERROR_MEMORY;
    bool same = path && !r->options->force && tsuya_path_exists(path) && tsuya_file_load(&kept, &size, path, 4096) == TSUYA_OK &&
                strcmp(kept, key->hex) == 0;
    if (status == TSUYA_OK && !same) {
        status = tsuya_folder_remove(folder);
    }
    if (status == TSUYA_OK) {
        status = tsuya_folder_make(folder);
    }
    if (status == TSUYA_OK && !same) {
        status = tsuya_file_write(path, key->hex, strlen(key->hex));
    }
    tsuya_free(kept);
    tsuya_free(path);
    return status;
}

static tsuya_status clear_stage(runner *r, const tsuya_stage *stage, const tsuya_hash *key)
{
    tsuya_json_remove(r->state.stages, stage->name);
    TSUYA_TRY(tsuya_state_save(&r->state));
    char *folder = tsuya_path_join(r->job->folder, stage->name);
    tsuya_status status = folder ? prepare_folder(r, folder, key) : TSUYA_ERROR_MEMORY;
    tsuya_free(folder);
    return status;
}

static tsuya_status run_and_record(runner *r, const tsuya_stage *stage, const tsuya_stage_plan *plan, const tsuya_hash *key)
{
    TSUYA_TRY(clear_stage(r, stage, key));
    tsuya_json *record = tsuya_json_create_object();
    if (!record) {
        return TSUYA_ERROR_MEMORY;
    }
    tsuya_json_set_copy(record, "inputs", plan->inputs);
    tsuya_json_set_copy(record, "options", plan->options);
    tsuya_json_set_number(record, "version", stage->version);
    tsuya_json_set_text(record, "program", TSUYA_VERSION);
    tsuya_json_set_text(record, "key", key->hex);
    tsuya_json *figures = tsuya_json_set_object(record, "figures");
    tsuya_peak_memory_reset();
    double start_s = tsuya_clock_s();
    tsuya_terminal_collect_warnings(tsuya_json_set_array(record, "warnings"));
    tsuya_stage_run run = {.job = r->job, .context = r->context, .state = &r->state, .figures = figures};
    tsuya_status status = stage->run(&run);
    tsuya_terminal_collect_warnings(NULL);
    tsuya_terminal_end_line();
    if (status == TSUYA_OK) {
        status = record_outputs(record, r, plan);
    }
    if (status == TSUYA_OK) {
        double own_mb = tsuya_peak_memory_mb();
        double with_children_mb = tsuya_json_number_or(tsuya_json_member(figures, "peak_mb"), 0.0);
        tsuya_json_set_number(record, "seconds", tsuya_clock_s() - start_s);
        tsuya_json_set_number(record, "peak_mb", own_mb > with_children_mb ? own_mb : with_children_mb);
        record_time(record);
        tsuya_json_set_copy(r->state.stages, stage->name, record);
        status = tsuya_state_save(&r->state);
        report_stage(r, stage, record, false);
    }
    tsuya_json_free(record);
    return status;
}

/* Stages before --from are taken as they are, but they must be there. */
static tsuya_status take_as_is(runner *r, const tsuya_stage *stage, const tsuya_stage_plan *plan)
{
    const tsuya_json *record = tsuya_state_record(&r->state, stage->name);
    if (plan->not_needed) {
        return TSUYA_OK;
    }
    if (!record) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: stage '%s' is not finished, so the run cannot start from '%s'; begin with --from %s",
                          r->job->folder, stage->name, tsuya_stages[r->options->from].name, stage->name);
    }
    tsuya_hash key;
    TSUYA_TRY(stage_key(&key, stage, plan));
    if (strcmp(tsuya_json_text_or(tsuya_json_member(record, "key"), ""), key.hex) != 0) {
        tsuya_warn("stage '%s' is out of date, and used as it is because of --from", stage->name);
    }
    report_stage(r, stage, record, true);
    return TSUYA_OK;
}

static tsuya_status visit_planned(runner *r, const tsuya_stage *stage, const tsuya_stage_plan *plan)
{
    char duration[TSUYA_DURATION_SIZE];
    tsuya_hash key;
    TSUYA_TRY(stage_key(&key, stage, plan));
    const tsuya_json *record = tsuya_state_record(&r->state, stage->name);
    const char *why = why_run(r, record, &key);
    if (r->options->dry_run) {
        if (!why && r->earlier_would_run) {
            why = "if what comes before it changes";
        }
        printf("%-12s %s%s%s\n", stage->name, why ? "runs" : "is done", why ? ": " : "", why ? why : "");
        r->earlier_would_run = r->earlier_would_run || why;
        return TSUYA_OK;
    }
    if (!why) {
        tsuya_terminal_log("%-12s is done", stage->name);
        report_stage(r, stage, record, true);
        return TSUYA_OK;
    }
    tsuya_terminal_log("%-12s runs: %s", stage->name, why);
    double start_s = tsuya_clock_s();
    TSUYA_TRY(run_and_record(r, stage, plan, &key));
    tsuya_terminal_log("%-12s done in %s", stage->name, tsuya_format_duration(duration, tsuya_clock_s() - start_s));
    return TSUYA_OK;
}

static tsuya_status visit(runner *r, int index)
{
    const tsuya_stage *stage = &tsuya_stages[index];
    TSUYA_TRY(tsuya_check_interrupt());
    tsuya_stage_plan plan;
    tsuya_status status = make_plan(&plan, r, stage);
    if (status == TSUYA_OK && index < r->options->from) {
        status = take_as_is(r, stage, &plan);
    } else if (status == TSUYA_OK && plan.not_needed) {
        if (r->options->dry_run) {
            printf("%-12s not needed: %s\n", stage->name, plan.not_needed);
        }
        tsuya_json *entry = tsuya_json_set_object(r->result_stages, stage->name);
        tsuya_json_set_number(entry, "seconds", 0.0);
        tsuya_json_set_number(entry, "peak_mb", 0.0);
        tsuya_json_set_bool(entry, "skipped", true);
    } else if (status == TSUYA_OK) {
        status = visit_planned(r, stage, &plan);
    }
    free_plan(&plan);
    return status;
}

tsuya_status tsuya_runner_run(tsuya_json *result, const tsuya_job *job, const tsuya_runner_options *options,
                              const tsuya_context *context)
{
    runner r = {.job = job, .options = options, .context = context, .result = result};
    tsuya_lock lock = {.descriptor = -1};
    if (!options->dry_run) {
        TSUYA_TRY(tsuya_folder_make(job->folder));
        TSUYA_TRY(tsuya_lock_take(&lock, job->folder));
    }
    double start_s = tsuya_clock_s();
    r.result_stages = tsuya_json_set_object(result, "stages");
    tsuya_status status = tsuya_state_load(&r.state, job->folder, job->name);
    for (int i = 0; status == TSUYA_OK && i <= options->to; i++) {
        status = visit(&r, i);
    }
    tsuya_json_set_number(result, "seconds", tsuya_clock_s() - start_s);
    tsuya_state_free(&r.state);
    if (!options->dry_run) {
        tsuya_lock_release(&lock);
    }
    return status;
}
