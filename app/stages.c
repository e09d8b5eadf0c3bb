#include "app/stage.h"

const tsuya_stage tsuya_stages[TSUYA_STAGE_COUNT] = {
    {"capture", 8, tsuya_stage_capture_plan, tsuya_stage_capture_run},
    {"calib", 6, tsuya_stage_calib_plan, tsuya_stage_calib_run},
    {"reconstruct", 10, tsuya_stage_reconstruct_plan, tsuya_stage_reconstruct_run},
    {"weave", 7, tsuya_stage_weave_plan, tsuya_stage_weave_run},
    {"brdf", 6, tsuya_stage_brdf_plan, tsuya_stage_brdf_run},
    {"render", 10, tsuya_stage_render_plan, tsuya_stage_render_run},
    {"report", 2, tsuya_stage_report_plan, tsuya_stage_report_run},
};
