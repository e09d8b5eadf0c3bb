/* Stretch, shear and bending of the triangles. */
#include "capture/drape_parts.h"

#include "core/memory.h"

#include <stdlib.h>
#include <string.h>

/* Area and the gradients of the three shape functions in (u, v). */
static tsuya_status shape(drape_element *e, const tsuya_drape_sheet *sheet, size_t t)
{
    const double *uv = sheet->uv + 6 * t;
    double twice = (uv[2] - uv[0]) * (uv[5] - uv[1]) - (uv[4] - uv[0]) * (uv[3] - uv[1]);
    e->area = 0.5 * twice;
    if (!(twice > 0.0)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "drape: triangle %zu: area %g m2 in the flat cloth; above 0 is accepted", t, e->area);
    }
    for (int i = 0; i < 3; i++) {
        const double *b = uv + 2 * ((i + 1) % 3), *c = uv + 2 * ((i + 2) % 3);
        e->v[i] = e->v[3 + i] = sheet->triangle[3 * t + (size_t)i];
        e->gradient[i][0] = (b[1] - c[1]) / twice;
        e->gradient[i][1] = (c[0] - b[0]) / twice;
    }
    return TSUYA_OK;
}

/* Outward normal of the edge across a corner: against that corner's gradient.  Its length is 2 area |gradient|. */
static double normal_of(const drape_element *e, uint32_t corner, double n[2])
{
    double g = hypot(e->gradient[corner][0], e->gradient[corner][1]);
    n[0] = -e->gradient[corner][0] / g;
    n[1] = -e->gradient[corner][1] / g;
    return 2.0 * e->area * g;
}

/* What the hinge over an edge adds to the second derivatives of `e`; `other` on its far side. */
static void add_hinge(drape_element *e, uint32_t corner, const drape_element *other, uint32_t other_corner)
{
    double n[2], m[2], length = normal_of(e, corner, n);
    normal_of(other, other_corner, m);
    double k = -0.5 * length / e->area;
    e->v[3 + corner] = other->v[other_corner];
    for (int side = 0; side < 2; side++) {
        const drape_element *t = side ? other : e;
        const double *normal = side ? m : n;
        for (uint32_t i = 0; i < 3; i++) {
            uint32_t at = side == 0 ? i : i == other_corner ? 3 + corner : t->v[i] == e->v[(corner + 1) % 3] ? (corner + 1) % 3 : (corner + 2) % 3;
            double slope = k * (t->gradient[i][0] * normal[0] + t->gradient[i][1] * normal[1]);
            e->second[at][0] += slope * n[0] * n[0];
            e->second[at][1] += slope * n[1] * n[1];
            e->second[at][2] += slope * n[0] * n[1];
        }
    }
}

static tsuya_status connect(drape_element *element, uint32_t *edge, size_t *edge_count, tsuya_side *half, size_t count)
{
    *edge_count = 0;
    for (size_t i = 0, j; i < count; i = j) {
        for (j = i + 1; j < count && tsuya_side_same_edge(&half[j], &half[i]); j++) {
        }
        if (j - i > 2) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "drape: %zu triangles at the edge of vertices %u and %u; at most 2 are accepted", j - i,
                              half[i].low, half[i].high);
        }
        edge[2 * *edge_count] = half[i].low;
        edge[2 * *edge_count + 1] = half[i].high;
        ++*edge_count;
        if (j - i == 2) {
            uint32_t one = half[i].corner, other = half[i + 1].corner;
            add_hinge(&element[one / 3], one % 3, &element[other / 3], other % 3);
            add_hinge(&element[other / 3], other % 3, &element[one / 3], one % 3);
        }
    }
    return TSUYA_OK;
}

tsuya_status tsuya_drape_elements_create(drape_element **element, uint32_t **edge, size_t *edge_count, const tsuya_drape_sheet *sheet)
{
    tsuya_status status;
    tsuya_side *half = NULL;
    size_t count = 3 * sheet->triangle_count;
    *edge = NULL;
    TSUYA_NEW(status, *element, sheet->triangle_count);
    TSUYA_NEW(status, *edge, 2 * count);
    TSUYA_NEW(status, half, count);
    for (size_t t = 0; t < sheet->triangle_count; t++) {
        TSUYA_GOTO_DONE(status, shape(*element + t, sheet, t));
    }
    (void)tsuya_mesh_sides(half, sheet->triangle, sheet->triangle_count);
    status = connect(*element, *edge, edge_count, half, count);
done:
    tsuya_free(half);
    return status;
}

/* Columns of the deformation gradient: ∂x/∂u, ∂x/∂v. */
static void tangents(const drape_element *e, const double *x, tsuya_vec3 f[2])
{
    f[0] = f[1] = (tsuya_vec3){0, 0, 0};
    for (int i = 0; i < 3; i++) {
        f[0] = tsuya_vec3_mad(f[0], e->gradient[i][0], drape_at(x, e->v[i]));
        f[1] = tsuya_vec3_mad(f[1], e->gradient[i][1], drape_at(x, e->v[i]));
    }
}

/* Yarns that are pushed buckle within the cloth and push back little (Choi & Ko, "Stable but responsive cloth", 2002). */
static const double PUSHED = 0.02;

/* Stiffness along weft and warp at these tangents. */
static void stiffness(double k[2], const drape_state *s, const tsuya_vec3 f[2])
{
    k[0] = s->fabric->stretch_weft_n_m * (tsuya_vec3_dot(f[0], f[0]) < 1.0 ? PUSHED : 1.0);
    k[1] = s->fabric->stretch_warp_n_m * (tsuya_vec3_dot(f[1], f[1]) < 1.0 ? PUSHED : 1.0);
}

/* Green's strain and the tensions that belong to it. */
static double tensions(const drape_state *s, const tsuya_vec3 f[2], double tension[3])
{
    double k[2];
    stiffness(k, s, f);
    double uu = 0.5 * (tsuya_vec3_dot(f[0], f[0]) - 1.0), vv = 0.5 * (tsuya_vec3_dot(f[1], f[1]) - 1.0), uv = tsuya_vec3_dot(f[0], f[1]);
    tension[0] = k[0] * uu;
    tension[1] = k[1] * vv;
    tension[2] = s->fabric->shear_n_m * uv;
    return 0.5 * (tension[0] * uu + tension[1] * vv + tension[2] * uv);
}

static void seconds(const drape_element *e, const double *x, tsuya_vec3 k[3])
{
    for (int j = 0; j < 3; j++) {
        k[j] = (tsuya_vec3){0, 0, 0};
        for (int i = 0; i < 6; i++) {
            k[j] = tsuya_vec3_mad(k[j], e->second[i][j], drape_at(x, e->v[i]));
        }
    }
}

static void rigidities(const drape_state *s, double b[3])
{
    b[0] = s->fabric->bend_weft_nm;
    b[1] = s->fabric->bend_warp_nm;
    b[2] = s->fabric->twist_nm;
}

double tsuya_drape_stretch_energy(const drape_state *s, const double *x)
{
    double sum = 0.0, tension[3];
    for (size_t t = 0; t < s->sheet->triangle_count; t++) {
        tsuya_vec3 f[2];
        tangents(&s->element[t], x, f);
        sum += s->element[t].area * tensions(s, f, tension);
    }
    return sum;
}

double tsuya_drape_bend_energy(const drape_state *s, const double *x)
{
    double sum = 0.0, b[3];
    rigidities(s, b);
    for (size_t t = 0; t < s->sheet->triangle_count; t++) {
        tsuya_vec3 k[3];
        seconds(&s->element[t], x, k);
        for (int j = 0; j < 3; j++) {
            sum += 0.5 * s->element[t].area * b[j] * tsuya_vec3_dot(k[j], k[j]);
        }
    }
    return sum;
}

void tsuya_drape_elastic_gradient(const drape_state *s, const double *x, double *g)
{
    double tension[3], b[3];
    rigidities(s, b);
    for (size_t t = 0; t < s->sheet->triangle_count; t++) {
        const drape_element *e = &s->element[t];
        tsuya_vec3 f[2], k[3];
        tangents(e, x, f);
        tensions(s, f, tension);
        for (int i = 0; i < 3; i++) {
            double du = e->gradient[i][0], dv = e->gradient[i][1];
            drape_add(g, e->v[i], e->area * (tension[0] * du + tension[2] * dv), f[0]);
            drape_add(g, e->v[i], e->area * (tension[1] * dv + tension[2] * du), f[1]);
        }
        seconds(e, x, k);
        for (int i = 0; i < 6; i++) {
            for (int j = 0; j < 3; j++) {
                drape_add(g, e->v[i], e->area * b[j] * e->second[i][j], k[j]);
            }
        }
    }
}

/* The positive part of the tensions' 2 × 2 matrix (u v; order uu vv uv). */
static void positive_part(double t[3])
{
    double mean = 0.5 * (t[0] + t[1]), half = 0.5 * (t[0] - t[1]), r = hypot(half, t[2]), high = mean + r, low = mean - r;
    if (low >= 0.0) {
        return;
    }
    if (high <= 0.0) {
        t[0] = t[1] = t[2] = 0.0;
        return;
    }
    double c = r > 0.0 ? half / r : 0.0, n = r > 0.0 ? t[2] / r : 0.0; /* cos, sin of twice the angle */
    t[0] = 0.5 * high * (1.0 + c);
    t[1] = 0.5 * high * (1.0 - c);
    t[2] = 0.5 * high * n;
}

static void stretch_block(double block[3][3], const drape_state *s, const drape_element *e, const tsuya_vec3 f[2], const double tension[3],
                          int i, int j)
{
    double k[2];
    stiffness(k, s, f);
    double ui = e->gradient[i][0], vi = e->gradient[i][1], uj = e->gradient[j][0], vj = e->gradient[j][1];
    const double *a = &f[0].x, *b = &f[1].x;
    double along = tension[0] * ui * uj + tension[1] * vi * vj + tension[2] * (ui * vj + vi * uj);
    for (int p = 0; p < 3; p++) {
        for (int q = 0; q < 3; q++) {
            double shear_p = vi * a[p] + ui * b[p], shear_q = vj * a[q] + uj * b[q];
            block[p][q] = e->area * (k[0] * ui * uj * a[p] * a[q] + k[1] * vi * vj * b[p] * b[q] +
                                     s->fabric->shear_n_m * shear_p * shear_q + (p == q ? along : 0.0));
        }
    }
}

tsuya_status tsuya_drape_elastic_hessian(drape_state *s, const double *x)
{
    double tension[3], b[3];
    rigidities(s, b);
    TSUYA_TRY(tsuya_drape_matrix_reserve(&s->matrix, s->sheet->triangle_count * (54 + 63)));
    drape_matrix *m = &s->matrix;
    for (size_t t = 0; t < s->sheet->triangle_count; t++) {
        const drape_element *e = &s->element[t];
        tsuya_vec3 f[2];
        tangents(e, x, f);
        tensions(s, f, tension);
        positive_part(tension);
        for (int i = 0; i < 3; i++) {
            for (int j = 0; j <= i; j++) {
                double block[3][3];
                stretch_block(block, s, e, f, tension, i, j);
                tsuya_drape_matrix_add(m, e->v[i], e->v[j], block);
            }
        }
        for (int i = 0; i < 6; i++) {
            for (int j = 0; j <= i; j++) {
                double k = 0.0;
                for (int l = 0; l < 3; l++) {
                    k += e->area * b[l] * e->second[i][l] * e->second[j][l];
                }
                if (k == 0.0) {
                    continue;
                }
                k *= i != j && e->v[i] == e->v[j] ? 2.0 : 1.0;
                for (int p = 0; p < 3; p++) {
                    m->row[m->count] = (int)(3 * e->v[i]) + p;
                    m->column[m->count] = (int)(3 * e->v[j]) + p;
                    m->value[m->count++] = k;
                }
            }
        }
    }
    return TSUYA_OK;
}
