#include "reconstruct/precision.h"

#include "core/order.h"
#include "reconstruct/stereo_views.h"

#include <math.h>

enum { LEAST_SIDE_PX = 160, HALVINGS = 6, MOST_SOURCES = 12 }; /* steps of half an octave */
static const int SOURCES[] = {3, 5, 8};
enum { SOURCE_CHOICES = sizeof SOURCES / sizeof SOURCES[0] };
static const double DEPTH_SHARE = 0.8, MESH_SHARE = 0.5, FINER = 0.9;

double tsuya_matching_sigma(double gsd, double sine)
{
    const double matching_px = 0.15;
    return matching_px * gsd / fmax(sine, 0.01);
}

/* Middle of the points that a view sees. */
static bool middle_of(tsuya_vec3 *middle, const tsuya_sparse_model *model, int v)
{
    const tsuya_view *view = &model->view[v];
    int count = 0;
    *middle = (tsuya_vec3){0, 0, 0};
    for (int i = 0; i < view->observation_count; i++) {
        if (view->observation[i].point >= 0) {
            *middle = tsuya_vec3_add(*middle, model->point[view->observation[i].point].position);
            count++;
        }
    }
    *middle = tsuya_vec3_scale(*middle, count ? 1.0 / count : 0.0);
    return count > 0;
}

/* For each number of sources: over the views, the median of the largest sine between their own ray and those of the sources
 * that they would be given. */
static tsuya_status sines_of_sources(double *sine, const tsuya_sparse_model *model, int most_sources, tsuya_arena *arena)
{
    tsuya_view_plan *plan;
    const size_t row = (size_t)model->view_count;
    double *most = tsuya_arena_alloc(arena, row * (size_t)(most_sources + 1), sizeof *most);
    size_t views = 0;
    if (!most) {
        return TSUYA_ERROR_MEMORY;
    }
    TSUYA_TRY(tsuya_view_plans_make(&plan, model, NULL, 0, most_sources, "dense", arena));
    for (int v = 0; v < model->view_count; v++) {
        tsuya_vec3 middle;
        double largest = 0.0;
        if (!plan[v].used || !middle_of(&middle, model, v)) {
            continue;
        }
        tsuya_vec3 own = tsuya_vec3_unit(tsuya_vec3_sub(tsuya_pose_center(model->view[v].camera_from_world), middle));
        for (int k = 0; k < most_sources; k++) {
            if (k < plan[v].source_count) {
                tsuya_vec3 other = tsuya_vec3_sub(tsuya_pose_center(model->view[plan[v].source[k]].camera_from_world), middle);
                largest = fmax(largest, tsuya_vec3_norm(tsuya_vec3_cross(own, tsuya_vec3_unit(other))));
            }
            most[row * (size_t)(k + 1) + views] = largest;
        }
        views++;
    }
    for (int k = 1; k <= most_sources; k++) {
        tsuya_sort_doubles(most + row * (size_t)k, views);
        sine[k] = views ? most[row * (size_t)k + views / 2] : 0.0;
    }
    return TSUYA_OK;
}

typedef struct choice { double gsd, sine[MOST_SOURCES + 1]; int full_px; } choice;

static tsuya_precision_step step_of(const choice *c, int long_side_px, int sources, double aspect)
{
    const double correlation = 0.7, gsd = c->gsd * c->full_px / long_side_px;
    const double depth = 2.0 * tsuya_matching_sigma(gsd, c->sine[sources]) * sqrt(correlation + (1.0 - correlation) / (1 + sources));
    return (tsuya_precision_step){
        .long_side_px = long_side_px, .source_views = sources,
        .error = hypot(depth, gsd),
        .cost = 1e-6 * aspect * long_side_px * (double)long_side_px * (1 + sources),
    };
}

/* The cheapest step with an error of at most `most`, else the one with the least error; parts of `given` above 0 are kept. */
static tsuya_precision_step cheapest(const choice *c, double most, tsuya_precision_step given, double aspect)
{
    tsuya_precision_step best = {0};
    for (int h = 0; h <= HALVINGS; h++) {
        int side = given.long_side_px > 0 ? given.long_side_px : (int)lrint(c->full_px * pow(2.0, -0.5 * h));
        if (h > 0 && (side < LEAST_SIDE_PX || given.long_side_px > 0)) {
            break;
        }
        for (int k = 0; k < SOURCE_CHOICES; k++) {
            tsuya_precision_step s = step_of(c, side, given.source_views > 0 ? given.source_views : SOURCES[k], aspect);
            bool better = s.error <= most ? best.error > most || s.cost < best.cost : s.error < best.error;
            if (best.long_side_px == 0 || better) {
                best = s;
            }
        }
    }
    return best;
}

tsuya_status tsuya_precision_choose(tsuya_precision *out, const tsuya_sparse_model *model, double gsd, int full_px,
                                    double tolerance, tsuya_precision_step given, tsuya_arena *arena)
{
    choice c = {.gsd = gsd, .full_px = full_px};
    const tsuya_camera *camera = &model->camera[0];
    const double aspect = fmin((double)camera->width_px / camera->height_px, (double)camera->height_px / camera->width_px);
    const tsuya_precision_step free_step = {0};
    *out = (tsuya_precision){.tolerance = tolerance, .mesh_tolerance = MESH_SHARE * tolerance, .reached = true};
    TSUYA_TRY(sines_of_sources(c.sine, model, MOST_SOURCES, arena));
    out->chosen = cheapest(&c, tolerance > 0.0 ? DEPTH_SHARE * tolerance : HUGE_VAL, given, aspect);
    out->reached = !(tolerance > 0.0) || out->chosen.error <= DEPTH_SHARE * tolerance;
    tsuya_precision_step finer = cheapest(&c, FINER * out->chosen.error, free_step, aspect);
    out->finer = finer.error <= FINER * out->chosen.error ? finer : free_step;
    return TSUYA_OK;
}

static void step_to_json(tsuya_json *object, const tsuya_precision_step *s, double seconds)
{
    tsuya_json_set_number(object, "dense_long_side_px", s->long_side_px);
    tsuya_json_set_number(object, "source_views", s->source_views);
    tsuya_json_set_number(object, "error_units", s->error);
    tsuya_json_set_number(object, "dense_seconds", seconds);
}

void tsuya_precision_to_json(tsuya_json *object, const tsuya_precision *p, double seconds)
{
    tsuya_json_set_number(object, "tolerance_units", p->tolerance > 0.0 ? p->tolerance : NAN);
    tsuya_json_set_bool(object, "reached", p->reached);
    step_to_json(tsuya_json_set_object(object, "chosen"), &p->chosen, seconds);
    if (p->finer.long_side_px > 0) {
        step_to_json(tsuya_json_set_object(object, "finer"), &p->finer, seconds * p->finer.cost / p->chosen.cost);
    } else {
        tsuya_json_set_null(object, "finer");
    }
}
