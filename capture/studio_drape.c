/* The closed form of a cloth over a round stand.
 *
 * In polar coordinates (ρ, φ) of the flat cloth, s = ρ − a is what hangs over the stand's edge of radius a.  The profile
 * turns from flat to upright over a length L,
 *
 *     r_m(s) = a + L (1 − e^(−s/L)),   z(s) = h − L (arcosh e^(s/L) − sqrt(1 − e^(−2s/L)))
 *
 * which has unit speed.  A circle of circumference 2πρ has to find room on a radius r_m < ρ; it does so in n folds of
 * amplitude B with r = r_m + B cos(nφ + …), and to second order its length is kept by B n / r_m = sqrt(2 ((ρ/r_m)² − 1)). */
#include "capture/studio.h"

#include "core/memory.h"

#include <math.h>

static const double STEEPEST_FOLD = 1.25; /* B n / r_m; beyond it the length is not kept, and the cloth stays visible */

tsuya_studio_drape tsuya_studio_drape_default(void)
{
    return (tsuya_studio_drape){.side_m = 0.33, .stand_radius_m = 0.080, .stand_height_m = 0.150, .edge_radius_m = 0.018,
                                .folds = 8, .spacing_m = 0.0014};
}

tsuya_vec3 tsuya_studio_drape_at(const tsuya_studio_drape *o, double u_m, double v_m)
{
    double rho = hypot(u_m, v_m), phi = atan2(v_m, u_m), s = rho - o->stand_radius_m, bend = o->edge_radius_m;
    if (s <= 0.0) {
        return (tsuya_vec3){u_m, v_m, o->stand_height_m};
    }
    double decay = exp(-s / bend), radius = o->stand_radius_m + bend * (1.0 - decay);
    double drop = bend * (acosh(1.0 / decay) - sqrt(1.0 - decay * decay));
    double slope = 0.9 * sqrt(2.0 * fmax((rho / radius) * (rho / radius) - 1.0, 0.0));
    slope = STEEPEST_FOLD * tanh(slope / STEEPEST_FOLD) * (1.0 - decay); /* begins without a kink in the threads */
    double uneven = 0.85 + 0.15 * cos(phi + 1.0) * cos(3.0 * phi);
    double wave = cos(o->folds * phi + 0.35 * sin(2.0 * phi + 0.4) + 0.25 * sin(3.0 * phi) + 4.0 * s);
    double r = radius + uneven * slope * radius / o->folds * wave;
    return (tsuya_vec3){r * cos(phi), r * sin(phi), o->stand_height_m - drop};
}

/* Derivatives by central differences of the closed form; h trades truncation (h²) against rounding. */
static void tangents(tsuya_vec3 *weft, tsuya_vec3 *warp, tsuya_vec3 *normal, const tsuya_studio_drape *o, double u, double v)
{
    const double h = 1e-5;
    *weft = tsuya_vec3_unit(tsuya_vec3_sub(tsuya_studio_drape_at(o, u + h, v), tsuya_studio_drape_at(o, u - h, v)));
    *warp = tsuya_vec3_unit(tsuya_vec3_sub(tsuya_studio_drape_at(o, u, v + h), tsuya_studio_drape_at(o, u, v - h)));
    *normal = tsuya_vec3_unit(tsuya_vec3_cross(*weft, *warp));
}

static void put(float *to, tsuya_vec3 v)
{
    to[0] = (float)v.x;
    to[1] = (float)v.y;
    to[2] = (float)v.z;
}

static void fill_vertex(tsuya_studio_cloth *cloth, const tsuya_studio_drape *o, size_t vertex, double u, double v)
{
    tsuya_vec3 weft, warp, normal;
    tangents(&weft, &warp, &normal, o, u, v);
    put(cloth->mesh.position + 3 * vertex, tsuya_studio_drape_at(o, u, v));
    put(cloth->mesh.normal + 3 * vertex, normal);
    put(cloth->mesh.weft + 3 * vertex, weft);
    put(cloth->warp + 3 * vertex, warp);
    cloth->uv[2 * vertex] = (float)u;
    cloth->uv[2 * vertex + 1] = (float)v;
}

static void fill_triangles(tsuya_mesh *mesh, size_t cells)
{
    uint32_t *t = mesh->triangle;
    for (size_t j = 0; j < cells; j++) {
        for (size_t i = 0; i < cells; i++) {
            uint32_t a = (uint32_t)(j * (cells + 1) + i), b = a + 1, d = a + (uint32_t)(cells + 1), c = d + 1;
            uint32_t even[6] = {a, b, c, a, c, d}, odd[6] = {a, b, d, b, c, d};
            for (int k = 0; k < 6; k++) {
                *t++ = (i + j) % 2 ? odd[k] : even[k];
            }
        }
    }
}

tsuya_status tsuya_studio_drape_create(tsuya_studio_cloth *cloth, const tsuya_studio_drape *o)
{
    tsuya_status status;
    *cloth = (tsuya_studio_cloth){0};
    if (!(o->side_m > 0.0) || !(o->spacing_m > 0.0) || !(o->side_m / o->spacing_m <= 5000.0) || o->folds < 1) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "drape: side %g m at a spacing of %g m in %d folds; up to 5000 vertices a side are accepted",
                          o->side_m, o->spacing_m, o->folds);
    }
    size_t cells = (size_t)ceil(o->side_m / o->spacing_m), row = cells + 1;
    TSUYA_GOTO_DONE(status, tsuya_mesh_create(&cloth->mesh, row * row, 2 * cells * cells, TSUYA_MESH_NORMAL | TSUYA_MESH_WEFT));
    TSUYA_NEW(status, cloth->warp, 3 * row * row);
    TSUYA_NEW(status, cloth->uv, 2 * row * row);
    for (size_t vertex = 0; vertex < row * row; vertex++) {
        double u = ((double)(vertex % row) / (double)cells - 0.5) * o->side_m;
        double v = ((double)(vertex / row) / (double)cells - 0.5) * o->side_m;
        fill_vertex(cloth, o, vertex, u, v);
    }
    fill_triangles(&cloth->mesh, cells);
done:
    if (status != TSUYA_OK) {
        tsuya_studio_cloth_free(cloth);
    }
    return status;
}

void tsuya_studio_cloth_free(tsuya_studio_cloth *cloth)
{
    tsuya_mesh_free(&cloth->mesh);
    tsuya_free(cloth->warp);
    tsuya_free(cloth->uv);
    *cloth = (tsuya_studio_cloth){0};
}
