#include "weave_detect/field_figures.h"

#include "core/memory.h"
#include "core/order.h"


static double quantile(float *value, size_t count, double q)
{
    if (count == 0) {
        return NAN;
    }
    tsuya_sort_floats(value, count);
    return (double)value[(size_t)(q * (double)(count - 1))];
}

int tsuya_field_index(const tsuya_field_view *f, const uint32_t vertex[3])
{
    const double quarter = 0.5 * M_PI;
    double turn = 0.0, change = 0.0;
    for (int k = 0; k < 3; k++) {
        uint32_t v = vertex[k], u = vertex[(k + 1) % 3], e = tsuya_mesh_graph_find(f->graph, v, u);
        if (e == UINT32_MAX || (f->edge_scale && f->edge_scale[e] < 0.5f)) {
            return 0;
        }
        double step = (double)f->graph->turn_rad[e]; /* u's angles plus this are v's */
        double d = (double)f->weft_rad[u] + step - (double)f->weft_rad[v];
        change += d - quarter * round(d / quarter);
        turn += step;
    }
    turn -= 2.0 * M_PI * round(turn / (2.0 * M_PI));
    return (int)lround((change - turn) / quarter);
}

static tsuya_weave_singularity singularity_at(const tsuya_field_view *f, const uint32_t v[3], int quarters)
{
    tsuya_weave_singularity s = {.quarters = quarters};
    for (int k = 0; k < 3; k++) {
        s.position = tsuya_vec3_mad(s.position, 1.0 / 3.0, tsuya_mesh_position(f->mesh, v[k]));
        s.confidence += (double)f->mesh->weave_confidence[v[k]] / 3.0;
    }
    return s;
}

/* Counts, then lists. */
static tsuya_status find_singularities(tsuya_weave_mesh_info *info, const tsuya_field_view *f)
{
    tsuya_status status = TSUYA_OK;
    for (int pass = 0; pass < 2; pass++) {
        int count = 0;
        for (size_t t = 0; t < f->mesh->triangle_count; t++) {
            const uint32_t *v = f->mesh->triangle + 3 * t;
            bool rim = f->graph->rim[v[0]] || f->graph->rim[v[1]] || f->graph->rim[v[2]];
            int quarters = rim ? 0 : tsuya_field_index(f, v);
            if (quarters != 0 && pass == 1) {
                info->singularity[count] = singularity_at(f, v, quarters);
            }
            count += quarters != 0;
        }
        info->singularities = count;
        if (pass == 0) {
            TSUYA_NEW(status, info->singularity, (size_t)count);
        }
    }
done:
    return status;
}

void tsuya_weave_mesh_info_free(tsuya_weave_mesh_info *info)
{
    tsuya_free(info->singularity);
    *info = (tsuya_weave_mesh_info){0};
}

static void areas(tsuya_weave_mesh_info *info, const tsuya_field_view *f)
{
    double all = 0.0, covered = 0.0, textured = 0.0;
    for (size_t v = 0; v < f->mesh->vertex_count; v++) {
        double area = (double)f->graph->area[v];
        all += area;
        covered += f->mesh->weave_confidence[v] >= 0.5f ? area : 0.0;
        textured += f->evidence[v].confidence >= 0.5f || f->evidence[v].flow_weight > 0.1f ? area : 0.0;
    }
    info->covered_fraction = all > 0.0 ? covered / all : 0.0;
    info->textured_fraction = all > 0.0 ? textured / all : 0.0;
}

tsuya_status tsuya_field_figures(tsuya_weave_mesh_info *info, const tsuya_field_view *f)
{
    tsuya_status status = TSUYA_OK;
    size_t n = 0, count = f->mesh->vertex_count;
    float *weft = NULL, *warp = NULL, *shear = NULL;
    *info = (tsuya_weave_mesh_info){.photos = f->votes->photos, .patches = f->votes->patches, .threads_seen = f->threads_seen, .weft_told = f->weft_told};
    TSUYA_NEW(status, weft, count);
    TSUYA_NEW(status, warp, count);
    TSUYA_NEW(status, shear, count);
    for (size_t v = 0; v < count; v++) {
        if (f->threads_seen && f->mesh->weave_confidence[v] >= 0.5f) {
            weft[n] = f->mesh->threads_per_m[2 * v];
            warp[n] = f->mesh->threads_per_m[2 * v + 1];
            shear[n++] = fabsf(f->mesh->shear_deg[v]);
        }
    }
    info->patches_sure = f->votes->patches > 0 ? (double)f->votes->sure / (double)f->votes->patches : 0.0;
    info->threads_per_m_weft = quantile(weft, n, 0.5);
    info->threads_per_m_warp = quantile(warp, n, 0.5);
    info->shear_deg_median = quantile(shear, n, 0.5);
    info->shear_deg_p90 = quantile(shear, n, 0.9);
    TSUYA_GOTO_DONE(status, find_singularities(info, f));
    areas(info, f);
done:
    tsuya_free(weft);
    tsuya_free(warp);
    tsuya_free(shear);
    return status;
}

void tsuya_weave_mesh_info_to_json(tsuya_json *figures, const tsuya_weave_mesh_info *info)
{
    tsuya_json_set_number(figures, "photos", info->photos);
    tsuya_json_set_number(figures, "patches", (double)info->patches);
    tsuya_json_set_number(figures, "patches_sure", info->patches_sure);
    tsuya_json_set_number(figures, "covered_fraction", info->covered_fraction);
    tsuya_json_set_number(figures, "textured_fraction", info->textured_fraction);
    tsuya_json_set_bool(figures, "threads_seen", info->threads_seen);
    tsuya_json_set_text(figures, "weft_told_by", tsuya_weft_told_name(info->weft_told));
    tsuya_json_set_number(figures, "singularities", info->singularities);
    tsuya_json *list = tsuya_json_set_array(figures, "singularity_list");
    for (int i = 0; i < info->singularities; i++) {
        const tsuya_weave_singularity *s = &info->singularity[i];
        tsuya_json *one = tsuya_json_add_object(list);
        tsuya_json_set_number(one, "x", s->position.x);
        tsuya_json_set_number(one, "y", s->position.y);
        tsuya_json_set_number(one, "z", s->position.z);
        tsuya_json_set_number(one, "quarter_turns", s->quarters);
        tsuya_json_set_number(one, "confidence", s->confidence);
    }
    tsuya_json_set_number(figures, "threads_per_m_weft", info->threads_per_m_weft);
    tsuya_json_set_number(figures, "threads_per_m_warp", info->threads_per_m_warp);
    tsuya_json_set_number(figures, "shear_deg_median", info->shear_deg_median);
    tsuya_json_set_number(figures, "shear_deg_p90", info->shear_deg_p90);
    tsuya_json_set_number(figures, "seconds", info->seconds);
}
