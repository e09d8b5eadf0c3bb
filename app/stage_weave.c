/* Stage weave. */
#include "app/stage.h"

tsuya_status tsuya_stage_weave_plan(tsuya_stage_plan *plan, const tsuya_stage_run *run)
{
    (void)run;
    plan->not_needed = "no checks yet";
    return TSUYA_OK;
}

tsuya_status tsuya_stage_weave_run(const tsuya_stage_run *run)
{
    (void)run;
    return TSUYA_OK;
}
