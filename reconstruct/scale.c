#include "reconstruct/scale.h"

#include "core/memory.h"
#include "reconstruct/scale_fit.h"
#include "reconstruct/scale_points.h"

/* Where the tag's centre is seen, in the model; false unless all four corners are fine. */
static bool seen_center(tsuya_vec3 *center, const tsuya_scale_problem *p, int tag)
{
    int n = 0;
    *center = (tsuya_vec3){0, 0, 0};
    for (int k = 0; k < p->count; k++) {
        if (p->item[k].tag == tag && !p->item[k].outlier) {
            *center = tsuya_vec3_mad(*center, 0.25, p->item[k].model);
            n++;
        }
    }
    return n == 4;
}

static double spacing_rms(const tsuya_scale_problem *p)
{
    const tsuya_scale_tag *tag = p->input->tag;
    double sum = 0.0;
    long long n = 0;
    tsuya_vec3 *center = tsuya_calloc((size_t)p->input->tag_count, sizeof *center);
    bool *seen = tsuya_calloc((size_t)p->input->tag_count, sizeof *seen);
    for (int a = 0; center && seen && a < p->input->tag_count; a++) {
        seen[a] = seen_center(&center[a], p, a);
        for (int b = 0; b < a && seen[a]; b++) {
            if (seen[b] && tag[a].plate == tag[b].plate) {
                tsuya_vec3 ca = tsuya_vec3_scale(tsuya_vec3_add(tag[a].corner_m[0], tag[a].corner_m[2]), 0.5);
                tsuya_vec3 cb = tsuya_vec3_scale(tsuya_vec3_add(tag[b].corner_m[0], tag[b].corner_m[2]), 0.5);
                double e = p->fit.scale * tsuya_vec3_norm(tsuya_vec3_sub(center[a], center[b])) - tsuya_vec3_norm(tsuya_vec3_sub(ca, cb));
                sum += e * e;
                n++;
            }
        }
    }
    tsuya_free(center);
    tsuya_free(seen);
    return n ? sqrt(sum / (double)n) : NAN;
}

static void report_plates(tsuya_scale_info *info, const tsuya_scale_problem *p)
{
    const tsuya_scale_plate_fit *reference = &p->fit.plate[info->reference];
    for (int k = 0; k < p->input->plate_count; k++) {
        tsuya_scale_plate *out = &info->plate[k];
        const tsuya_scale_plate_fit *f = &p->fit.plate[k];
        double sum = 0.0;
        out->tags = tsuya_scale_tags_used(p, k);
        out->growth = f->growth;
        for (int i = 0; i < p->count; i++) {
            if (p->item[i].plate == k && !p->item[i].outlier) {
                tsuya_vec3 e = tsuya_scale_error(&p->fit, &p->item[i]);
                sum += tsuya_vec3_dot(e, e);
                out->corners++;
            } else if (p->item[i].plate == k) {
                out->outliers++;
            }
        }
        out->rms_m = out->corners ? sqrt(sum / out->corners) : NAN;
        out->plate_from_reference.rotation = tsuya_mat3_multiply(f->rotation, tsuya_mat3_transpose(reference->rotation));
        out->plate_from_reference.translation =
            tsuya_vec3_sub(f->translation, tsuya_mat3_apply(out->plate_from_reference.rotation, reference->translation));
        info->outliers += out->outliers;
    }
}

static void take_items(tsuya_scale_problem *p, tsuya_scale_info *info, const tsuya_scale_points *points)
{
    for (int t = 0; t < p->input->tag_count; t++) {
        const tsuya_scale_tag *tag = &p->input->tag[t];
        int sighted = 0;
        for (int c = 0; c < 4; c++) {
            const tsuya_scale_point *q = &points->point[4 * t + c];
            sighted += q->sighted > 0;
            info->points_lost += q->sighted > 0 && !q->found;
            if (q->found) {
                p->item[p->count++] = (tsuya_scale_item){.tag = t, .plate = tag->plate, .model = q->position, .target = tag->corner_m[c],
                                             .center = tsuya_vec3_scale(tsuya_vec3_add(tag->corner_m[0], tag->corner_m[2]), 0.5),
                                             .covariance = q->covariance};
                p->tag_corners[t]++;
            }
        }
        info->tags_seen += sighted > 0;
    }
    info->points = p->count;
}

static tsuya_status nothing_found(const tsuya_scale_info *info, const tsuya_scale_points *points, const tsuya_scale_input *input)
{
    const char *what = input->distance_count ? "points" : "tags";
    if (points->photos == 0) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: none of its %s is seen in a photograph that could be registered", input->source, what);
    }
    if (points->photos == 1) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: its %s are seen in one registered photograph only; two from different sides are needed, five are usual",
                          input->source, what);
    }
    return tsuya_fail(TSUYA_ERROR_INPUT, "%s: %d of its %s are seen in %d registered photographs, none in two that agree; photograph it from more sides",
                      input->source, info->tags_seen, what, points->photos);
}

static tsuya_status scale_by_tags(tsuya_similarity *out, tsuya_scale_info *info, const tsuya_scale_points *points, const tsuya_scale_input *input)
{
    tsuya_scale_problem p = {.input = input};
    tsuya_status status = TSUYA_OK;
    TSUYA_NEW(status, p.item, 4 * (size_t)input->tag_count);
    TSUYA_NEW(status, p.tag_corners, (size_t)input->tag_count);
    take_items(&p, info, points);
    if (p.count < TSUYA_SCALE_LEAST_CORNERS) {
        status = nothing_found(info, points, input);
        goto done;
    }
    TSUYA_GOTO_DONE(status, tsuya_scale_fit_plates(&p));
    info->tags_used = tsuya_scale_tags_used(&p, -1);
    if (info->tags_used == 0) {
        status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: its tags do not lie as the file says; is this the right board file?", input->source);
        goto done;
    }
    for (info->reference = 0; tsuya_scale_tags_used(&p, info->reference) == 0;) {
        info->reference++;
    }
    *out = (tsuya_similarity){p.fit.scale, p.fit.plate[info->reference].rotation, p.fit.plate[info->reference].translation};
    info->scale_m_per_unit = p.fit.scale;
    info->sigma_rel = p.fit.sigma_rel;
    info->rms_m = tsuya_scale_held_out_rms(&p);
    info->spacing_rms_m = spacing_rms(&p);
    report_plates(info, &p);
done:
    tsuya_free(p.item);
    tsuya_free(p.tag_corners);
    return status;
}

/* Σ w d_m d / Σ w d² over all distances but one (−1: none); `information` of the scale's logarithm. */
static double distance_scale(double *information, const tsuya_scale_points *points, const tsuya_scale_input *input, int but)
{
    double above = 0.0, below = 0.0;
    for (int i = 0; i < input->distance_count; i++) {
        const tsuya_scale_distance *d = &input->distance[i];
        const tsuya_scale_point *a = &points->point[d->a], *b = &points->point[d->b];
        if (i == but || !a->found || !b->found) {
            continue;
        }
        tsuya_vec3 along = tsuya_vec3_sub(b->position, a->position), n = tsuya_vec3_unit(along);
        double length = tsuya_vec3_norm(along);
        double variance = tsuya_vec3_dot(n, tsuya_mat3_apply(a->covariance, n)) + tsuya_vec3_dot(n, tsuya_mat3_apply(b->covariance, n));
        if (length > 0.0 && variance > 0.0) {
            above += d->distance_m * length / variance;
            below += length * length / variance;
        }
    }
    *information = below;
    return below > 0.0 ? above / below : NAN;
}

static tsuya_status scale_by_distances(tsuya_similarity *out, tsuya_scale_info *info, const tsuya_scale_points *points, const tsuya_scale_input *input)
{
    double information, sum = 0.0;
    int n = 0;
    info->scale_m_per_unit = distance_scale(&information, points, input, -1);
    if (!isfinite(info->scale_m_per_unit)) {
        return nothing_found(info, points, input);
    }
    info->sigma_rel = 1.0 / sqrt(information);
    for (int i = 0; i < input->distance_count; i++) {
        const tsuya_scale_point *a = &points->point[input->distance[i].a], *b = &points->point[input->distance[i].b];
        double s = distance_scale(&information, points, input, i);
        info->points += a->found + b->found;
        info->points_lost += !a->found + !b->found;
        if (a->found && b->found && isfinite(s)) {
            double e = s * tsuya_vec3_norm(tsuya_vec3_sub(b->position, a->position)) - input->distance[i].distance_m;
            sum += e * e;
            n++;
        }
    }
    info->rms_m = n ? sqrt(sum / n) : NAN;
    *out = (tsuya_similarity){info->scale_m_per_unit, tsuya_mat3_identity(), {0, 0, 0}};
    return TSUYA_OK;
}

tsuya_status tsuya_scale_find(tsuya_similarity *out, tsuya_scale_info *info, const tsuya_sparse_model *model, const tsuya_scale_input *input)
{
    tsuya_scale_points points;
    *info = (tsuya_scale_info){.scale_m_per_unit = NAN, .rms_m = NAN, .sigma_rel = NAN, .spacing_rms_m = NAN, .reference = -1};
    if (input->plate_count > TSUYA_SCALE_PLATES) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: %d plates; at most %d give a scale", input->source, input->plate_count, TSUYA_SCALE_PLATES);
    }
    int count = 4 * input->tag_count;
    for (int i = 0; i < input->distance_count; i++) {
        count = (int)fmax(count, fmax(input->distance[i].a, input->distance[i].b) + 1);
    }
    for (int i = 0; i < input->sighting_count; i++) {
        count = count > input->sighting[i].point ? count : input->sighting[i].point + 1;
    }
    TSUYA_TRY(tsuya_scale_points_create(&points, count, model, input));
    info->photos = points.photos;
    info->reprojection_px = points.reprojection_px;
    tsuya_status status = input->distance_count ? scale_by_distances(out, info, &points, input) : scale_by_tags(out, info, &points, input);
    tsuya_scale_points_free(&points);
    return status;
}

static void plates_to_json(tsuya_json *object, const tsuya_scale_info *info, const tsuya_scale_input *input)
{
    tsuya_json *list = tsuya_json_set_array(object, "plates");
    for (int k = 0; k < input->plate_count; k++) {
        const tsuya_scale_plate *p = &info->plate[k];
        tsuya_json *o = tsuya_json_add_object(list);
        tsuya_json_set_text(o, "name", input->plate[k]);
        tsuya_json_set_number(o, "tags", p->tags);
        tsuya_json_set_number(o, "corners", p->corners);
        tsuya_json_set_number(o, "corners_outlier", p->outliers);
        if (p->tags > 0) {
            tsuya_json_set_number(o, "rms_m", p->rms_m);
            tsuya_json_set_number(o, "tag_growth", p->growth);
            tsuya_json_set_text(o, "reference", input->plate[info->reference]);
            tsuya_json_set_number(o, "angle_deg", tsuya_deg_from_rad(tsuya_mat3_rotation_angle_rad(p->plate_from_reference.rotation)));
            tsuya_json_set_number(o, "distance_m", tsuya_vec3_norm(p->plate_from_reference.translation));
        }
    }
}

void tsuya_scale_info_to_json(tsuya_json *object, const tsuya_scale_info *info, const tsuya_scale_input *input)
{
    tsuya_json_set_text(object, "source", input->source);
    tsuya_json_set_number(object, "scale_m_per_unit", info->scale_m_per_unit);
    tsuya_json_set_number(object, "scale_rms_m", info->rms_m);
    tsuya_json_set_number(object, "scale_sigma_rel", info->sigma_rel);
    tsuya_json_set_number(object, "photos", info->photos);
    tsuya_json_set_number(object, "points", info->points);
    tsuya_json_set_number(object, "points_lost", info->points_lost);
    if (input->tag_count > 0) {
        tsuya_json_set_number(object, "edge_bias", input->edge_bias);
    }
    tsuya_json_set_number(object, "reprojection_px", info->reprojection_px);
    tsuya_json_set_text(object, "frame", info->reference >= 0 ? input->plate[info->reference] : "kept");
    if (input->tag_count) {
        tsuya_json_set_number(object, "tags_used", info->tags_used);
        tsuya_json_set_number(object, "tags_seen", info->tags_seen);
        tsuya_json_set_number(object, "corners_outlier", info->outliers);
        tsuya_json_set_number(object, "spacing_rms_m", info->spacing_rms_m);
        plates_to_json(object, info, input);
    }
}
