#include "render/views.h"

#include "render/frame.h"

enum { RIM_POINTS = 64 };

/* The mesh as a cylinder about the table's axis: heights [low, high], radius. */
typedef struct cylinder { double low, high, radius; } cylinder;

/* Axis through the middle of the mesh's extent across it. */
static cylinder enclose(tsuya_turntable *t, const tsuya_mesh *mesh)
{
    tsuya_vec3 x, y;
    tsuya_frame_from_normal(t->up, &x, &y);
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (size_t v = 0; v < mesh->vertex_count; ++v) {
        tsuya_vec3 p = tsuya_mesh_position(mesh, v);
        const double e[3] = {tsuya_vec3_dot(p, x), tsuya_vec3_dot(p, y), tsuya_vec3_dot(p, t->up)};
        for (int k = 0; k < 3; ++k) {
            low[k] = fmin(low[k], e[k]);
            high[k] = fmax(high[k], e[k]);
        }
    }
    const double middle[3] = {0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), 0.5 * (low[2] + high[2])};
    t->center = tsuya_vec3_mad(tsuya_vec3_mad(tsuya_vec3_scale(x, middle[0]), middle[1], y), middle[2], t->up);
    cylinder c = {low[2] - middle[2], high[2] - middle[2], 0.0};
    for (size_t v = 0; v < mesh->vertex_count; ++v) {
        tsuya_vec3 d = tsuya_vec3_sub(tsuya_mesh_position(mesh, v), t->center);
        d = tsuya_vec3_mad(d, -tsuya_vec3_dot(d, t->up), t->up);
        c.radius = fmax(c.radius, tsuya_vec3_norm(d));
    }
    return c;
}

static bool inside(const tsuya_turntable *t, const cylinder *c)
{
    const double margin = 0.92;
    tsuya_camera camera;
    tsuya_pose pose;
    tsuya_vec3 x, y;
    tsuya_frame_from_normal(t->up, &x, &y);
    tsuya_turntable_view(t, 0, 1, &camera, &pose);
    for (int k = 0; k < 2 * RIM_POINTS; ++k) {
        double a = 2.0 * M_PI * (k / 2) / RIM_POINTS;
        tsuya_vec3 p = tsuya_vec3_mad(t->center, k % 2 ? c->high : c->low, t->up);
        p = tsuya_vec3_mad(tsuya_vec3_mad(p, c->radius * cos(a), x), c->radius * sin(a), y);
        tsuya_vec2 pixel;
        if (!tsuya_camera_project(&camera, tsuya_pose_apply(pose, p), &pixel) ||
            fabs(pixel.x - camera.cx_px) > 0.5 * margin * t->width_px || fabs(pixel.y - camera.cy_px) > 0.5 * margin * t->height_px) {
            return false;
        }
    }
    return true;
}

tsuya_status tsuya_turntable_fit(tsuya_turntable *table, const tsuya_mesh *mesh)
{
    table->up = tsuya_vec3_unit(table->up);
    if (!(tsuya_vec3_norm(table->up) > 0.5) || !(fabs(table->elevation_rad) <= tsuya_rad_from_deg(89.0)) ||
        !(table->field_rad > 0.01 && table->field_rad < 2.8)) {
        return tsuya_fail(TSUYA_ERROR_INPUT,
                          "turntable: axis (%g, %g, %g), elevation %g°, field of view %g°; expected an axis that is not zero, ±89° and 1 to 160°",
                          table->up.x, table->up.y, table->up.z, tsuya_deg_from_rad(table->elevation_rad),
                          tsuya_deg_from_rad(table->field_rad));
    }
    if (mesh->vertex_count == 0) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "turntable: the mesh has no vertices to look at");
    }
    cylinder c = enclose(table, mesh);
    table->radius = fmax(hypot(c.radius, c.high), 1e-6);
    double near = table->radius, far = 2.0 * table->radius;
    for (int k = 0; k < 20; ++k) {
        table->distance = far;
        if (inside(table, &c)) {
            break;
        }
        far *= 2.0;
    }
    for (int k = 0; k < 40; ++k) {
        table->distance = 0.5 * (near + far);
        *(inside(table, &c) ? &far : &near) = table->distance;
    }
    table->distance = far;
    return TSUYA_OK;
}

void tsuya_turntable_view(const tsuya_turntable *t, int k, int n, tsuya_camera *camera, tsuya_pose *camera_from_world)
{
    /* view 0 looks from −y when z is up */
    tsuya_vec3 back = tsuya_vec3_tangent((tsuya_vec3){0, -1, 0}, t->up);
    if (!(tsuya_vec3_norm(back) > 0.5)) {
        back = tsuya_vec3_tangent((tsuya_vec3){0, 0, 1}, t->up);
    }
    tsuya_vec3 left = tsuya_vec3_cross(t->up, back);
    double a = 2.0 * M_PI * k / n, f = 0.5 * fmin(t->width_px, t->height_px) / tan(0.5 * t->field_rad);
    tsuya_vec3 out = tsuya_vec3_add(tsuya_vec3_scale(back, cos(a)), tsuya_vec3_scale(left, sin(a)));
    out = tsuya_vec3_add(tsuya_vec3_scale(out, cos(t->elevation_rad)), tsuya_vec3_scale(t->up, sin(t->elevation_rad)));
    *camera = (tsuya_camera){.lens = TSUYA_LENS_PINHOLE, .width_px = t->width_px, .height_px = t->height_px, .fx_px = f, .fy_px = f,
                             .cx_px = 0.5 * (t->width_px - 1), .cy_px = 0.5 * (t->height_px - 1)};
    *camera_from_world = tsuya_pose_look_at(tsuya_vec3_mad(t->center, t->distance, out), t->center, t->up);
}

tsuya_vec3 tsuya_up_from_cameras(const tsuya_pose *camera_from_world, int count)
{
    tsuya_vec3 sum = {0, 0, 0};
    for (int k = 0; k < count; ++k) {
        const double(*r)[3] = camera_from_world[k].rotation.e;
        sum = tsuya_vec3_sub(sum, (tsuya_vec3){r[1][0], r[1][1], r[1][2]});
    }
    return tsuya_vec3_norm(sum) > 1e-3 * count ? tsuya_vec3_unit(sum) : (tsuya_vec3){0, 0, 1};
}
