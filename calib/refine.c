#include "calib/refine.h"

#include "calib/refine_quad.h"

#include <string.h>

static void refine_tag(tsuya_refined_tag *tag, const tsuya_tag_sighting *sighting, const tsuya_image *grey, const tsuya_edge_grid *grid,
                       const tsuya_edge_look *look, double blur_px)
{
    tsuya_edge_quad q = {0};
    memcpy(tag->corner_px, sighting->corner_px, sizeof tag->corner_px);
    tsuya_edge_quad_start(&q, blur_px);
    tsuya_edge_quad_settle(&q, tag->corner_px, grey, grid, look, false);
    for (int i = 0; i < 4; i++) {
        if (!tsuya_edge_quad_corner(&tag->corner_px[i], &tag->sigma_px[i], &q, i)) {
            tag->sigma_px[i] = INFINITY;
        }
        tag->spread_px[i] = tsuya_edge_quad_spread(&q, i);
        tag->edge[i] = q.edge[i].reason;
        tag->blur_px[i] = q.edge[i].reason == TSUYA_REFINE_FINE ? tsuya_edge_blur(&q.edge[i]) : NAN;
    }
}

static void count_reasons(tsuya_refine_info *info, const tsuya_refined_tag *tag, int count)
{
    for (int t = 0; t < count; t++) {
        for (int i = 0; i < 4; i++) {
            info->failed[tag[t].edge[i]]++;
            info->edges++;
        }
    }
}

tsuya_status tsuya_refine_tags(tsuya_refined_tag *refined, tsuya_refine_info *info, const tsuya_image *grey,
                               const tsuya_tag_sighting *sighting, int count, const tsuya_refine_options *options)
{
    tsuya_edge_grid grid = {options->cells, options->border_bits};
    *info = (tsuya_refine_info){0};
    if (grey->channels != 1 || grey->sample != TSUYA_SAMPLE_F32) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "corner refinement: a grey image of floats is expected");
    }
#pragma omp parallel for schedule(static)
    for (int t = 0; t < count; t++) {
        refine_tag(&refined[t], &sighting[t], grey, &grid, &options->look, options->blur_px);
    }
    count_reasons(info, refined, count);
    return TSUYA_OK;
}

const char *tsuya_refine_reason_text(tsuya_refine_reason reason)
{
    static const char *const text[] = {"fine", "too small, or at the image's edge", "too little contrast", "edge not where the tag was seen",
                                       "does not look like an edge"};
    return text[reason];
}
