/* Highlights of mirror balls, and the lamp that makes them. */
#include "calib/lamp_parts.h"

#include "core/memory.h"

#include <string.h>

enum { LAMP = 3, STEPS = 60, ROUNDS = 3 };
static const double PLACE_SIGMA_M = 1e-3, FIRST_SIGMA_PX = 0.5, LEAST_SIGMA_PX = 0.05, OUTLINE = 0.97, SPOT = 0.7, STANDS_OUT = 3.0, SPOT_SHARE = 0.15,
                    WEAKEST = 0.15; /* of several lamps, of the brightest as the photograph has it */

/* The window of a photograph that holds a ball. */
typedef struct window {
    int x0, y0, width, height, inside;
    float *value;          /* linear; negative outside the outline */
    int *label, *stack;
} window;

static void window_free(window *w)
{
    tsuya_free(w->value);
    tsuya_free(w->label);
    tsuya_free(w->stack);
}

static double linear(const tsuya_image *photo, int x, int y)
{
    double sum = 0.0;
    for (int c = 0; c < 3; c++) {
        float v = tsuya_image_get(photo, x, y, photo->channels >= 3 ? c : 0);
        sum += (double)(photo->encoding == TSUYA_ENCODING_SRGB ? tsuya_srgb_decode(v) : v) / 3.0;
    }
    return sum;
}

static tsuya_vec3 center_of(const tsuya_lamp_ball *b) { return (tsuya_vec3){b->x_m, b->y_m, 0.5 * b->diameter_m}; }

static tsuya_status cut_window(window *w, const tsuya_image *photo, const char *name, const tsuya_camera *camera, tsuya_vec3 c, double radius_m)
{
    tsuya_vec2 middle;
    tsuya_status status = TSUYA_OK;
    double distance = tsuya_vec3_norm(c);
    *w = (window){0};
    if (!tsuya_camera_project(camera, c, &middle) || distance <= radius_m) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: the ball lies behind the camera", name);
    }
    int reach = (int)ceil(1.6 * fmax(camera->fx_px, camera->fy_px) * radius_m / c.z) + 2;
    w->x0 = (int)middle.x - reach;
    w->y0 = (int)middle.y - reach;
    w->width = w->height = 2 * reach + 1;
    if (w->x0 < 0 || w->y0 < 0 || w->x0 + w->width > photo->width_px || w->y0 + w->height > photo->height_px) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: the ball at %.0f, %.0f px is not wholly in the picture", name, middle.x, middle.y);
    }
    size_t n = (size_t)w->width * (size_t)w->height;
    TSUYA_NEW(status, w->value, n);
    TSUYA_NEW(status, w->label, n);
    TSUYA_NEW(status, w->stack, n);
    double least = cos(OUTLINE * asin(radius_m / distance)) * distance;
    for (int i = 0; i < w->width * w->height; i++) {
        tsuya_vec3 ray;
        int x = w->x0 + i % w->width, y = w->y0 + i / w->width;
        bool in = tsuya_camera_unproject(camera, (tsuya_vec2){x, y}, &ray) && tsuya_vec3_dot(ray, c) > least;
        w->value[i] = in ? (float)linear(photo, x, y) : -1.0f;
        w->inside += in;
    }
done:
    return status;
}

typedef struct spot { int pixels; double weight, x, y; } spot;

/* The pixels of label `before` above the threshold that hang together with one of them, by flooding; they get the label `after`. */
static spot flood(window *w, int from, float threshold, int before, int after)
{
    spot s = {0};
    int top = 0;
    w->stack[top++] = from;
    w->label[from] = after;
    while (top) {
        int i = w->stack[--top], x = i % w->width, y = i / w->width;
        s.pixels++;
        s.weight += (double)w->value[i];
        s.x += (double)w->value[i] * x;
        s.y += (double)w->value[i] * y;
        for (int k = 0; k < 8; k++) {
            static const int dx[] = {-1, 0, 1, -1, 1, -1, 0, 1}, dy[] = {-1, -1, -1, 0, 0, 1, 1, 1};
            int u = x + dx[k], v = y + dy[k], j = v * w->width + u;
            if (u >= 0 && v >= 0 && u < w->width && v < w->height && w->label[j] == before && w->value[j] > threshold) {
                w->label[j] = after;
                w->stack[top++] = j;
            }
        }
    }
    s.x = w->x0 + s.x / s.weight;
    s.y = w->y0 + s.y / s.weight;
    return s;
}

/* What stands out, and the typical value inside the outline. */
static tsuya_status look(double *most, double *typical, const window *w)
{
    int k = 0;
    double *inside = tsuya_calloc((size_t)w->inside, sizeof *inside);
    if (!inside) {
        return TSUYA_ERROR_MEMORY;
    }
    *most = 0.0;
    for (int i = 0; i < w->width * w->height; i++) {
        if (w->value[i] >= 0.0f) {
            inside[k++] = (double)w->value[i];
            *most = fmax(*most, (double)w->value[i]);
        }
    }
    *typical = tsuya_lamp_median(inside, k);
    tsuya_free(inside);
    return TSUYA_OK;
}

enum { UNSEEN, REGION, DONE, LISTED = TSUYA_LAMPS_MOST + 1 };

static int keep_spot(spot list[LISTED], int count, spot s)
{
    int place = count < LISTED ? count++ : LISTED;
    for (; place > 0 && list[place - 1].pixels < s.pixels; place--) {
        if (place < LISTED) {
            list[place] = list[place - 1];
        }
    }
    if (place < LISTED) {
        list[place] = s;
    }
    return count;
}

/* The largest spots, in order.  What hangs together above `least` is cut at SPOT of its own brightest pixel, so that a weak lamp beside a strong one is
 * measured as that one is. */
static int list_spots(spot list[LISTED], window *w, double least)
{
    const int n = w->width * w->height;
    int count = 0;
    for (int i = 0; i < n; i++) {
        float peak = 0.0f;
        if (w->label[i] != UNSEEN || !(w->value[i] > (float)least)) {
            continue;
        }
        (void)flood(w, i, (float)least, UNSEEN, REGION);
        for (int j = i; j < n; j++) {
            peak = w->label[j] == REGION && w->value[j] > peak ? w->value[j] : peak;
        }
        for (int j = i; j < n; j++) {
            if (w->label[j] == REGION && w->value[j] > (float)SPOT * peak) {
                count = keep_spot(list, count, flood(w, j, (float)SPOT * peak, REGION, DONE));
            }
        }
        for (int j = i; j < n; j++) {
            w->label[j] = w->label[j] == REGION ? DONE : w->label[j];
        }
    }
    return count;
}

static tsuya_status brightest(tsuya_lamp_highlight *highlight, int lamps, window *w, const char *name)
{
    spot list[LISTED];
    double most, typical;
    TSUYA_TRY(look(&most, &typical, w));
    if (!(most > STANDS_OUT * typical)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: no highlight stands out in the ball (brightest %.3f, typical %.3f of the range); expose less, in a dark room", name,
                          most, typical);
    }
    int count = list_spots(list, w, lamps == 1 ? SPOT * most : fmin(fmax(STANDS_OUT * typical, WEAKEST * most), SPOT * most));
    if (count < lamps) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: %d highlight%s in the ball, at %.0f, %.0f px%s; %d lamps are expected", name, count, count == 1 ? "" : "s", list[0].x, list[0].y,
                          count == 1 ? "" : " and elsewhere", lamps);
    }
    if (count > lamps && 2 * list[lamps].pixels > list[lamps - 1].pixels && list[lamps].pixels > 3) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: %s highlights in the ball, at %.0f, %.0f and %.0f, %.0f px; %s expected", name, lamps == 1 ? "two" : "more", list[lamps - 1].x,
                          list[lamps - 1].y, list[lamps].x, list[lamps].y, lamps == 1 ? "one lamp is (--lamps says how many shine at once)" : "fewer lamps are");
    }
    if (list[0].pixels > SPOT_SHARE * w->inside) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: the highlight fills %.0f %% of the ball; a lamp is a small spot: expose less", name, 100.0 * list[0].pixels / w->inside);
    }
    for (int k = 0; k < lamps; k++) {
        highlight[k].pixel = (tsuya_vec2){list[k].x, list[k].y};
    }
    return TSUYA_OK;
}

tsuya_status tsuya_lamp_ball_find(tsuya_lamp_highlight *highlight, int lamps, const tsuya_image *photo, const char *name, const tsuya_camera *camera,
                                  tsuya_pose camera_from_world, const tsuya_lamp_ball *ball)
{
    window w;
    tsuya_status status = cut_window(&w, photo, name, camera, tsuya_pose_apply(camera_from_world, center_of(ball)), 0.5 * ball->diameter_m);
    for (int k = 0; k < lamps; k++) {
        highlight[k].camera_from_world = camera_from_world;
    }
    if (status == TSUYA_OK) {
        status = brightest(highlight, lamps, &w, name);
    }
    window_free(&w);
    return status;
}

/* What is estimated from balls alone. */
typedef struct scene {
    const tsuya_lamp_balls *balls;
    tsuya_lamp_place place;
    double sigma_px, shift_m[2 * TSUYA_LAMP_BALLS];
} scene;

static double angle_between(tsuya_vec3 a, tsuya_vec3 b) { return atan2(tsuya_vec3_norm(tsuya_vec3_cross(a, b)), tsuya_vec3_dot(a, b)); }

static tsuya_vec3 way(const tsuya_lamp_place *p, tsuya_vec3 from) { return tsuya_vec3_mad(p->to_lamp, -p->inverse_m, tsuya_vec3_sub(from, p->middle)); }

/* Where the ball mirrors the lamp to the eye: the normal between both directions at which the angles are alike (Alhazen). */
static tsuya_vec3 mirror_point(const tsuya_lamp_place *p, tsuya_vec3 eye, tsuya_vec3 center, double radius)
{
    tsuya_vec3 a = tsuya_vec3_unit(tsuya_vec3_sub(eye, center)), b = tsuya_vec3_unit(way(p, center)), q = center;
    double low = 0.0, high = 1.0, apart = angle_between(a, b);
    tsuya_vec3 side = tsuya_vec3_tangent(b, a);
    for (int k = 0; k < 50; k++) {
        double t = 0.5 * (low + high) * apart;
        tsuya_vec3 n = tsuya_vec3_add(tsuya_vec3_scale(a, cos(t)), tsuya_vec3_scale(side, sin(t)));
        q = tsuya_vec3_mad(center, radius, n);
        *(angle_between(n, tsuya_vec3_sub(eye, q)) < angle_between(n, way(p, q)) ? &low : &high) = 0.5 * (low + high);
    }
    return q;
}

/* Pixel of the highlight less where it would be; false where that is not in the camera's view. */
bool tsuya_lamp_ball_miss(double e[2], const tsuya_lamp_balls *b, const tsuya_lamp_highlight *h, const tsuya_lamp_place *p, const double *shift_m)
{
    tsuya_vec2 pixel;
    const tsuya_lamp_ball *ball = &b->ball[h->ball];
    tsuya_vec3 center = tsuya_vec3_add(center_of(ball), (tsuya_vec3){shift_m[2 * h->ball], shift_m[2 * h->ball + 1], 0});
    tsuya_vec3 q = mirror_point(p, tsuya_pose_center(h->camera_from_world), center, 0.5 * ball->diameter_m);
    bool seen = tsuya_camera_project(b->camera, tsuya_pose_apply(h->camera_from_world, q), &pixel);
    e[0] = seen ? h->pixel.x - pixel.x : 0.0;
    e[1] = seen ? h->pixel.y - pixel.y : 0.0;
    return seen;
}

void tsuya_lamp_ball_rows(double *row, const tsuya_lamp_balls *b, const tsuya_lamp_place *place, const double *shift_m, double sigma_px)
{
    for (int i = 0; i < b->highlights; i++) {
        double e[2];
        bool seen = tsuya_lamp_ball_miss(e, b, &b->highlight[i], place, shift_m);
        *row++ = seen ? e[0] / sigma_px : 1e3;
        *row++ = seen ? e[1] / sigma_px : 1e3;
    }
    for (int k = 0; k < 2 * b->balls; k++) {
        *row++ = shift_m[k] / PLACE_SIGMA_M;
    }
}

double tsuya_lamp_ball_sigma(const tsuya_lamp_balls *b, const tsuya_lamp_place *place, const double *shift_m, double sigma_px)
{
    double sum = 0.0, freedom = 2.0 * b->highlights - LAMP;
    for (int k = 0; k < 2 * b->balls; k++) { /* what the balls' shifts took out of the residuals */
        sum += shift_m[k] * shift_m[k] / (PLACE_SIGMA_M * PLACE_SIGMA_M) * sigma_px * sigma_px;
    }
    for (int i = 0; i < b->highlights; i++) {
        double e[2];
        (void)tsuya_lamp_ball_miss(e, b, &b->highlight[i], place, shift_m);
        sum += e[0] * e[0] + e[1] * e[1];
    }
    return freedom < 3.0 ? sigma_px : fmax(sqrt(sum / freedom), LEAST_SIGMA_PX);
}

void tsuya_lamp_ball_settle(tsuya_lamp *lamp, tsuya_lamp_balls *b, const tsuya_lamp_place *place, const double *shift_m)
{
    double sum = 0.0;
    for (int i = 0; i < b->highlights; i++) {
        double e[2];
        (void)tsuya_lamp_ball_miss(e, b, &b->highlight[i], place, shift_m);
        b->highlight[i].residual_px = (tsuya_vec2){e[0], e[1]};
        sum += e[0] * e[0] + e[1] * e[1];
    }
    lamp->highlights = b->highlights;
    lamp->rms_px = sqrt(sum / (2.0 * b->highlights));
    for (int k = 0; k < b->balls; k++) {
        b->ball[k].x_m += shift_m[2 * k];
        b->ball[k].y_m += shift_m[2 * k + 1];
    }
}

static void residuals(double *row, const void *at)
{
    const scene *s = at;
    tsuya_lamp_ball_rows(row, s->balls, &s->place, s->shift_m, s->sigma_px);
}

static void move(void *at, const double *step)
{
    scene *s = at;
    s->place.to_lamp = tsuya_lamp_turn(s->place.to_lamp, step[0], step[1]);
    s->place.inverse_m = fmax(s->place.inverse_m + step[2], 0.0);
    for (int k = 0; k < 2 * s->balls->balls; k++) {
        s->shift_m[k] += step[LAMP + k];
    }
}

tsuya_vec3 tsuya_lamp_ball_mirrored(const tsuya_lamp_balls *b, const tsuya_lamp_highlight *h)
{
    tsuya_vec3 ray, eye = tsuya_pose_center(h->camera_from_world), c = center_of(&b->ball[h->ball]);
    double radius = 0.5 * b->ball[h->ball].diameter_m;
    if (!tsuya_camera_unproject(b->camera, h->pixel, &ray)) {
        return (tsuya_vec3){0, 0, 0};
    }
    tsuya_vec3 d = tsuya_mat3_apply_transposed(h->camera_from_world.rotation, ray), to = tsuya_vec3_sub(c, eye);
    double along = tsuya_vec3_dot(to, d), short2 = radius * radius - (tsuya_vec3_dot(to, to) - along * along);
    tsuya_vec3 n = tsuya_vec3_unit(tsuya_vec3_sub(tsuya_vec3_mad(eye, along - sqrt(fmax(short2, 0.0)), d), c));
    return tsuya_vec3_mad(d, -2.0 * tsuya_vec3_dot(d, n), n);
}

/* Mean direction of the mirrored rays, the balls where they were measured. */
static tsuya_vec3 first_direction(const scene *s)
{
    tsuya_vec3 sum = {0, 0, 0};
    for (int i = 0; i < s->balls->highlights; i++) {
        sum = tsuya_vec3_add(sum, tsuya_lamp_ball_mirrored(s->balls, &s->balls->highlight[i]));
    }
    return tsuya_vec3_unit(sum);
}

static void set_result(tsuya_lamp *lamp, const scene *s, const double *c, int n)
{
    tsuya_vec3 t[2];
    double d = 1.0 / fmax(s->place.inverse_m, 1e-9), by[3][3];
    tsuya_lamp_tangents(t, s->place.to_lamp);
    for (int i = 0; i < 3; i++) {
        by[i][0] = d * (&t[0].x)[i], by[i][1] = d * (&t[1].x)[i], by[i][2] = -d * d * (&s->place.to_lamp.x)[i];
    }
    for (int i = 0; i < 9; i++) {
        for (int a = 0; a < 9; a++) {
            lamp->position_cov_m2[i] += by[i / 3][a / 3] * c[(a / 3) * n + a % 3] * by[i % 3][a % 3];
        }
    }
    lamp->to_lamp = s->place.to_lamp;
    lamp->distance_m = d;
    lamp->distance_sigma_m = d * d * sqrt(c[2 * (n + 1)]);
    lamp->position_m = tsuya_vec3_mad(s->place.middle, d, s->place.to_lamp);
    lamp->to_lamp_sigma_deg = tsuya_deg_from_rad(sqrt(0.5 * (c[0] + c[n + 1]) + hypot(0.5 * (c[0] - c[n + 1]), c[1])));
    lamp->direction = tsuya_vec3_scale(s->place.to_lamp, -1.0);
    lamp->direction_sigma_deg = lamp->falloff_sigma = lamp->distance_exponent_sigma = INFINITY;
    lamp->distance_exponent = 2.0;
    lamp->rgb[0] = lamp->rgb[1] = lamp->rgb[2] = 1.0;
    lamp->rgb_sigma_rel = INFINITY;
}

static tsuya_status no_distance(const scene *s)
{
    return tsuya_fail(TSUYA_ERROR_INPUT, "%d highlight%s the lamp's direction (%.2f %.2f %.2f) but no distance; photograph a ball at another place too, as far away "
                      "as the mat allows", s->balls->highlights, s->balls->highlights == 1 ? " gives" : "s give", s->place.to_lamp.x, s->place.to_lamp.y, s->place.to_lamp.z);
}

static tsuya_status check_result(tsuya_lamp *lamp, const scene *s, double spread_m)
{
    double sigma = lamp->distance_sigma_m / (lamp->distance_m * lamp->distance_m), nearest = 1.0 / (s->place.inverse_m + 2.0 * sigma);
    lamp->far_away = sigma > 0.2 * s->place.inverse_m;
    return lamp->far_away && (nearest < 4.0 * spread_m || lamp->to_lamp_sigma_deg > 3.0) ? no_distance(s) : TSUYA_OK;
}

/* Solves with sigmas from the residuals themselves. */
static tsuya_status solve(double *covariance, scene *s, double spread_m)
{
    double nudge[LAMP + 2 * TSUYA_LAMP_BALLS], cost;
    const tsuya_lamp_balls *b = s->balls;
    int n = LAMP + 2 * b->balls;
    for (int k = 0; k < n; k++) {
        nudge[k] = k < 2 ? 1e-5 : k == 2 ? 1e-5 / fmax(spread_m, 0.05) : 1e-7;
    }
    tsuya_lamp_problem p = {s, sizeof *s, n, 2 * (b->highlights + b->balls), residuals, move, nudge};
    for (int round = 0; round < ROUNDS; round++) {
        TSUYA_TRY(tsuya_lamp_descend(&cost, &p, STEPS));
        s->sigma_px = tsuya_lamp_ball_sigma(b, &s->place, s->shift_m, s->sigma_px);
    }
    tsuya_status status = tsuya_lamp_covariance(covariance, &p);
    return status == TSUYA_ERROR_NUMERIC ? no_distance(s) : status;
}

tsuya_status tsuya_lamp_ball_fit(tsuya_lamp *lamp, tsuya_lamp_balls *b)
{
    double covariance[(LAMP + 2 * TSUYA_LAMP_BALLS) * (LAMP + 2 * TSUYA_LAMP_BALLS)], spread = 0.0;
    scene s = {.balls = b, .place = {.inverse_m = 1.0}, .sigma_px = FIRST_SIGMA_PX};
    *lamp = (tsuya_lamp){0};
    for (int k = 0; k < b->balls; k++) {
        s.place.middle = tsuya_vec3_mad(s.place.middle, 1.0 / b->balls, center_of(&b->ball[k]));
    }
    for (int k = 0; k < b->balls; k++) {
        spread = fmax(spread, tsuya_vec3_norm(tsuya_vec3_sub(center_of(&b->ball[k]), s.place.middle)));
    }
    s.place.to_lamp = first_direction(&s);
    if (!(tsuya_vec3_norm(s.place.to_lamp) > 0.5)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "the highlights lie beside the balls; check the balls' places and diameters");
    }
    TSUYA_TRY(solve(covariance, &s, spread));
    set_result(lamp, &s, covariance, LAMP + 2 * b->balls);
    TSUYA_TRY(check_result(lamp, &s, spread));
    tsuya_lamp_ball_settle(lamp, b, &s.place, s.shift_m);
    return TSUYA_OK;
}
