/* Flat sheets to be draped, and draped sheets as meshes with their weft. */
#include "capture/drape_parts.h"

#include "core/memory.h"

#include <math.h>
#include <string.h>

tsuya_status tsuya_drape_sheet_create(tsuya_drape_sheet *s, size_t vertices, size_t triangles)
{
    tsuya_status status;
    *s = (tsuya_drape_sheet){.vertex_count = vertices, .triangle_count = triangles};
    TSUYA_NEW(status, s->position, 3 * vertices);
    TSUYA_NEW(status, s->fixed, vertices);
    TSUYA_NEW(status, s->triangle, 3 * triangles);
    TSUYA_NEW(status, s->uv, 6 * triangles);
    return TSUYA_OK;
done:
    tsuya_drape_sheet_free(s);
    return status;
}

void tsuya_drape_sheet_free(tsuya_drape_sheet *s)
{
    tsuya_free(s->position);
    tsuya_free(s->fixed);
    tsuya_free(s->triangle);
    tsuya_free(s->uv);
    *s = (tsuya_drape_sheet){0};
}

/* Corners, and where they lie in the flat cloth: where they stand now. */
static void set_flat(tsuya_drape_sheet *s, size_t t, uint32_t a, uint32_t b, uint32_t c)
{
    const uint32_t v[3] = {a, b, c};
    for (size_t i = 0; i < 3; i++) {
        s->triangle[3 * t + i] = v[i];
        s->uv[6 * t + 2 * i] = s->position[3 * v[i]];
        s->uv[6 * t + 2 * i + 1] = s->position[3 * v[i] + 1];
    }
}

tsuya_status tsuya_drape_sheet_grid(tsuya_drape_sheet *s, double u0_m, double v0_m, double spacing_m, int columns, int rows)
{
    if (!(spacing_m > 0.0) || columns < 1 || rows < 1 || columns > 10000 || rows > 10000) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "drape: a sheet of %d x %d cells of %g m; 1 to 10000 cells above 0 m are accepted", columns, rows, spacing_m);
    }
    TSUYA_TRY(tsuya_drape_sheet_create(s, (size_t)(columns + 1) * (size_t)(rows + 1), 2 * (size_t)columns * (size_t)rows));
    for (int j = 0; j <= rows; j++) {
        for (int i = 0; i <= columns; i++) {
            double *p = s->position + 3 * (j * (columns + 1) + i);
            p[0] = u0_m + spacing_m * i;
            p[1] = v0_m + spacing_m * j;
        }
    }
    for (int j = 0, t = 0; j < rows; j++) {
        for (int i = 0; i < columns; i++, t += 2) {
            uint32_t a = (uint32_t)(j * (columns + 1) + i), d = a + (uint32_t)columns + 1;
            /* One way everywhere: with diagonals by turns only every second vertex feels the shear, and rows of yarns zigzag. */
            set_flat(s, (size_t)t, a, a + 1, d + 1);
            set_flat(s, (size_t)t + 1, a, d + 1, d);
        }
    }
    return TSUYA_OK;
}

/* Shares of the width from sleeve to sleeve: half the body, a sleeve's depth, front or back length; the neck. */
static const double BODY = 0.225, SLEEVE = 0.38, LENGTH = 1.05, NECK = 0.055, NECK_FRONT = 0.09, NECK_BACK = 0.03;

/* Whether the cloth covers a place, in shares of the width; gap: half of how far the fronts stand apart. */
static bool in_karaori(double u, double v, double gap)
{
    bool inside = fabs(u) < BODY ? fabs(v) < LENGTH : fabs(u) < 0.5 && fabs(v) < SLEEVE;
    bool open = (v > -NECK_BACK && fabs(u) < gap) || (v > -NECK_BACK && v < NECK_FRONT && fabs(u) < NECK);
    return inside && !open;
}

tsuya_status tsuya_drape_sheet_karaori(tsuya_drape_sheet *s, double width_m, double spacing_m)
{
    int columns = 2 * (int)(0.5 * width_m / spacing_m) + 1, rows = (int)ceil(2.0 * LENGTH * width_m / spacing_m), stride = columns + 1;
    uint32_t *number = NULL, vertices = 0;
    size_t triangles = 0;
    tsuya_status status = TSUYA_OK;
    if (!(spacing_m > 0.0) || columns < 15 || columns > 2000) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "drape: a karaori of %g m in cells of %g m; from 15 to 2000 cells are accepted", width_m, spacing_m);
    }
    TSUYA_NEW(status, number, (size_t)stride * (size_t)(rows + 1));
    for (int pass = 0; pass < 2; pass++) { /* counts; fills */
        size_t t = 0;
        for (int k = 0; k < columns * rows; k++) {
            int i = k % columns, j = k / columns;
            double u = (i - 0.5 * (columns - 1)) * spacing_m / width_m, v = (j - 0.5 * (rows - 1)) * spacing_m / width_m;
            if (!in_karaori(u, v, 0.6 * spacing_m / width_m)) {
                continue;
            }
            const int corner[4] = {j * stride + i, j * stride + i + 1, (j + 1) * stride + i + 1, (j + 1) * stride + i};
            for (int c = 0; pass == 0 && c < 4; c++) {
                number[corner[c]] = number[corner[c]] ? number[corner[c]] : ++vertices;
            }
            for (int c = 0; pass == 1 && c < 4; c++) {
                double *p = s->position + 3 * (number[corner[c]] - 1);
                p[0] = (corner[c] % stride - 0.5 * columns) * spacing_m;
                p[1] = (corner[c] / stride - 0.5 * rows) * spacing_m;
            }
            if (pass == 1) {
                set_flat(s, t, number[corner[0]] - 1, number[corner[1]] - 1, number[corner[2]] - 1);
                set_flat(s, t + 1, number[corner[0]] - 1, number[corner[2]] - 1, number[corner[3]] - 1);
            }
            t += 2;
        }
        triangles = t;
        if (pass == 0) {
            TSUYA_GOTO_DONE(status, tsuya_drape_sheet_create(s, vertices, triangles));
        }
    }
done:
    tsuya_free(number);
    return status;
}

/* Ring k has 6 k vertices. */
static uint32_t ring_vertex(int ring, int k) { return ring == 0 ? 0 : (uint32_t)(3 * ring * (ring - 1) + 1 + k % (6 * ring)); }

tsuya_status tsuya_drape_sheet_disc(tsuya_drape_sheet *s, double radius_m, double clamp_m, double spacing_m)
{
    if (!(spacing_m > 0.0) || !(radius_m > 2.0 * spacing_m) || !(clamp_m >= 0.0 && clamp_m < radius_m - spacing_m) || radius_m / spacing_m > 1000.0) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "drape: a disc of %g m held up to %g m in rings of %g m; from 2 to 1000 rings are accepted", radius_m,
                          clamp_m, spacing_m);
    }
    double half = 0.5 * spacing_m;
    int inner = clamp_m > 0.0 ? (int)lround((clamp_m - half) / spacing_m) : 0, outer = (int)lround((radius_m - clamp_m - (inner ? half : 0.0)) / spacing_m);
    int rings = inner + outer + (inner ? 1 : 0);
    TSUYA_TRY(tsuya_drape_sheet_create(s, (size_t)(3 * rings * (rings + 1) + 1), (size_t)(6 * rings * rings)));
    for (int r = 0; r <= rings; r++) {
        double radius = !inner ? radius_m * r / rings : r <= inner ? (clamp_m - half) * r / inner
                        : clamp_m + half + (radius_m - clamp_m - half) * (r - inner - 1) / outer;
        for (int k = 0; k < (r ? 6 * r : 1); k++) {
            uint32_t v = ring_vertex(r, k);
            s->position[3 * v] = radius * cos(2.0 * M_PI * k / fmax(6.0 * r, 1.0));
            s->position[3 * v + 1] = radius * sin(2.0 * M_PI * k / fmax(6.0 * r, 1.0));
            s->fixed[v] = inner > 0 && r <= inner + 1;
        }
    }
    size_t t = 0;
    for (int r = 1; r <= rings; r++) {
        for (int side = 0; side < 6; side++) {
            for (int k = 0; k < r; k++) {
                int out = side * r + k, in = side * (r - 1) + k;
                set_flat(s, t++, ring_vertex(r - 1, r > 1 ? in : 0), ring_vertex(r, out), ring_vertex(r, out + 1));
                if (k + 1 < r) {
                    set_flat(s, t++, ring_vertex(r - 1, in), ring_vertex(r, out + 1), ring_vertex(r - 1, in + 1));
                }
            }
        }
    }
    return TSUYA_OK;
}

tsuya_status tsuya_drape_sheet_mesh(tsuya_mesh *mesh, float **warp, float **uv, const tsuya_drape_sheet *s)
{
    tsuya_status status;
    double *along = NULL;
    TSUYA_TRY(tsuya_mesh_create(mesh, s->vertex_count, s->triangle_count, TSUYA_MESH_NORMAL | TSUYA_MESH_WEFT));
    TSUYA_NEW(status, along, 6 * s->vertex_count);
    if (warp) {
        TSUYA_NEW(status, *warp, 3 * s->vertex_count);
    }
    if (uv) {
        TSUYA_NEW(status, *uv, 2 * s->vertex_count);
    }
    memcpy(mesh->triangle, s->triangle, 3 * s->triangle_count * sizeof *s->triangle);
    for (size_t i = 0; i < 3 * s->vertex_count; i++) {
        mesh->position[i] = (float)s->position[i];
    }
    TSUYA_GOTO_DONE(status, tsuya_mesh_compute_normals(mesh));
    for (size_t t = 0; t < s->triangle_count; t++) {
        const double *c = s->uv + 6 * t;
        const uint32_t *v = s->triangle + 3 * t;
        double u1 = c[2] - c[0], v1 = c[3] - c[1], u2 = c[4] - c[0], v2 = c[5] - c[1];
        tsuya_vec3 a = tsuya_vec3_sub(drape_at(s->position, v[1]), drape_at(s->position, v[0]));
        tsuya_vec3 b = tsuya_vec3_sub(drape_at(s->position, v[2]), drape_at(s->position, v[0]));
        tsuya_vec3 weft = tsuya_vec3_mad(tsuya_vec3_scale(a, v2), -v1, b), over = tsuya_vec3_mad(tsuya_vec3_scale(b, u1), -u2, a); /* × area: weights */
        for (uint32_t i = 0; i < 3; i++) {
            drape_add(along, 2 * v[i], 1.0, weft);
            drape_add(along, 2 * v[i] + 1, 1.0, over);
            if (uv) {
                (*uv)[2 * v[i]] = (float)c[2 * i];
                (*uv)[2 * v[i] + 1] = (float)c[2 * i + 1];
            }
        }
    }
    for (size_t v = 0; v < s->vertex_count; v++) {
        const float *n = mesh->normal + 3 * v;
        for (uint32_t k = 0; k < (warp ? 2u : 1u); k++) {
            tsuya_vec3 d = tsuya_vec3_tangent(drape_at(along, 2 * (uint32_t)v + k), (tsuya_vec3){n[0], n[1], n[2]});
            float *out = (k ? *warp : mesh->weft) + 3 * v;
            out[0] = (float)d.x;
            out[1] = (float)d.y;
            out[2] = (float)d.z;
        }
    }
done:
    tsuya_free(along);
    if (status != TSUYA_OK) {
        tsuya_mesh_free(mesh);
    }
    return status;
}

/* Does the segment cross the triangle? */
static bool pierces(tsuya_vec3 p, tsuya_vec3 q, tsuya_vec3 a, tsuya_vec3 b, tsuya_vec3 c)
{
    tsuya_vec3 d = tsuya_vec3_sub(q, p), e = tsuya_vec3_sub(b, a), f = tsuya_vec3_sub(c, a), h = tsuya_vec3_cross(d, f), r = tsuya_vec3_sub(p, a);
    double det = tsuya_vec3_dot(e, h);
    if (fabs(det) < 1e-10 * tsuya_vec3_norm(d) * tsuya_vec3_norm(e) * tsuya_vec3_norm(f)) { /* in the plane: rounding */
        return false;
    }
    tsuya_vec3 o = tsuya_vec3_cross(r, e);
    double u = tsuya_vec3_dot(r, h) / det, v = tsuya_vec3_dot(d, o) / det, t = tsuya_vec3_dot(f, o) / det;
    return u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t >= 0.0 && t <= 1.0;
}

tsuya_status tsuya_drape_intersections(size_t *count, const tsuya_drape_sheet *s)
{
    drape_element *element = NULL;
    uint32_t *edge = NULL;
    size_t edges;
    *count = 0;
    tsuya_status status = tsuya_drape_elements_create(&element, &edge, &edges, s);
    for (size_t e = 0; e < edges && status == TSUYA_OK; e++) {
        tsuya_vec3 p = drape_at(s->position, edge[2 * e]), q = drape_at(s->position, edge[2 * e + 1]);
        double reach = tsuya_vec3_norm(tsuya_vec3_sub(q, p));
        for (size_t t = 0; t < s->triangle_count; t++) {
            const uint32_t *v = s->triangle + 3 * t;
            tsuya_vec3 a = drape_at(s->position, v[0]);
            if (fabs(a.x - p.x) > 4.0 * reach || fabs(a.y - p.y) > 4.0 * reach || fabs(a.z - p.z) > 4.0 * reach) {
                continue;
            }
            bool shared = false;
            for (int i = 0; i < 3; i++) {
                shared = shared || v[i] == edge[2 * e] || v[i] == edge[2 * e + 1];
            }
            *count += !shared && pierces(p, q, a, drape_at(s->position, v[1]), drape_at(s->position, v[2]));
        }
    }
    tsuya_free(element);
    tsuya_free(edge);
    return status;
}
