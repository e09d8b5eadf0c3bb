/* Stage report: depends on what every stage before has recorded. */
#include "app/report.h"
#include "app/stage.h"

#include <string.h>

tsuya_status tsuya_stage_report_plan(tsuya_stage_plan *plan, const tsuya_stage_run *run)
{
    for (int i = 0; strcmp(tsuya_stages[i].name, "report") != 0; i++) {
        const tsuya_json *record = tsuya_state_record(run->state, tsuya_stages[i].name);
        const tsuya_json *key = tsuya_json_member(record, "key"), *finished = tsuya_json_member(record, "finished");
        if (record) {
            tsuya_json_set_text(plan->inputs, tsuya_stages[i].name, tsuya_json_text_or(key, ""));
            tsuya_json_set_text(plan->options, tsuya_stages[i].name, tsuya_json_text_or(finished, ""));
        }
    }
    const char *demo = tsuya_job_path(run->job, "demo.json");
    if (!demo) {
        return TSUYA_ERROR_MEMORY;
    }
    TSUYA_TRY(tsuya_stage_input(plan, "demo.json", demo));
    tsuya_json_set_text(plan->options, "name", run->job->name);
    tsuya_stage_output(plan, "report/index.html");
    return TSUYA_OK;
}

tsuya_status tsuya_stage_report_run(const tsuya_stage_run *run)
{
    return tsuya_report_write(run->figures, run->job, run->state, run->context);
}
