#include "core/geometry.h"

#include <stddef.h>

tsuya_mat3 tsuya_mat3_multiply(tsuya_mat3 a, tsuya_mat3 b)
{
    tsuya_mat3 product;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            product.e[i][j] = a.e[i][0] * b.e[0][j] + a.e[i][1] * b.e[1][j] + a.e[i][2] * b.e[2][j];
        }
    }
    return product;
}

tsuya_mat3 tsuya_mat3_transpose(tsuya_mat3 a)
{
    tsuya_mat3 t;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            t.e[i][j] = a.e[j][i];
        }
    }
    return t;
}

double tsuya_mat3_determinant(tsuya_mat3 a)
{
    return a.e[0][0] * (a.e[1][1] * a.e[2][2] - a.e[1][2] * a.e[2][1]) - a.e[0][1] * (a.e[1][0] * a.e[2][2] - a.e[1][2] * a.e[2][0])
         + a.e[0][2] * (a.e[1][0] * a.e[2][1] - a.e[1][1] * a.e[2][0]);
}

static tsuya_vec3 column(const tsuya_mat3 *m, int j)
{
    return (tsuya_vec3){m->e[0][j], m->e[1][j], m->e[2][j]};
}

static void set_column(tsuya_mat3 *m, int j, tsuya_vec3 v)
{
    m->e[0][j] = v.x;
    m->e[1][j] = v.y;
    m->e[2][j] = v.z;
}

/* Cosine and sine that make the off-diagonal term of [[p, r], [r, q]] vanish (Golub & Van Loan, sym.schur2). */
static void jacobi_rotation(double p, double q, double r, double *c, double *s)
{
    double tau = (q - p) / (2.0 * r);
    double t = (tau >= 0.0 ? 1.0 : -1.0) / (fabs(tau) + sqrt(1.0 + tau * tau));
    *c = 1.0 / sqrt(1.0 + t * t);
    *s = t * *c;
}

void tsuya_mat3_eigen_symmetric(tsuya_mat3 a, double values[3], tsuya_mat3 *vectors)
{
    tsuya_mat3 v = tsuya_mat3_identity();
    for (int sweep = 0; sweep < 30; sweep++) {
        bool rotated = false;
        for (int p = 0; p < 2; p++) {
            for (int q = p + 1; q < 3; q++) {
                double r = a.e[p][q];
                if (fabs(r) <= 1e-17 * sqrt(fabs(a.e[p][p])) * sqrt(fabs(a.e[q][q])) || r == 0.0) {
                    continue;
                }
                double c, s;
                jacobi_rotation(a.e[p][p], a.e[q][q], r, &c, &s);
                tsuya_mat3 j = tsuya_mat3_identity();
                j.e[p][p] = j.e[q][q] = c;
                j.e[p][q] = s;
                j.e[q][p] = -s;
                a = tsuya_mat3_multiply(tsuya_mat3_transpose(j), tsuya_mat3_multiply(a, j));
                a.e[p][q] = a.e[q][p] = 0.0;
                v = tsuya_mat3_multiply(v, j);
                rotated = true;
            }
        }
        if (!rotated) {
            break;
        }
    }
    int order[3] = {0, 1, 2};
    for (int i = 0; i < 2; i++) {
        for (int j = 0; j < 2 - i; j++) {
            if (a.e[order[j]][order[j]] > a.e[order[j + 1]][order[j + 1]]) {
                int kept = order[j];
                order[j] = order[j + 1];
                order[j + 1] = kept;
            }
        }
    }
    for (int j = 0; j < 3; j++) {
        values[j] = a.e[order[j]][order[j]];
        if (vectors) {
            set_column(vectors, j, tsuya_vec3_unit(column(&v, order[j])));
        }
    }
}

/* A unit vector that is perpendicular to the unit vectors a and, when it is not zero, b. */
static tsuya_vec3 complete_basis(tsuya_vec3 a, tsuya_vec3 b)
{
    tsuya_vec3 c = tsuya_vec3_cross(a, b);
    if (tsuya_vec3_norm(c) > 0.5) {
        return tsuya_vec3_unit(c);
    }
    tsuya_vec3 axis = fabs(a.x) <= fabs(a.y) && fabs(a.x) <= fabs(a.z) ? (tsuya_vec3){1, 0, 0}
                    : fabs(a.y) <= fabs(a.z)                           ? (tsuya_vec3){0, 1, 0}
                                                                       : (tsuya_vec3){0, 0, 1};
    return tsuya_vec3_tangent(axis, a);
}

/* One-sided Jacobi (Hestenes 1958): columns of a·v are made orthogonal; their lengths are the singular values. */
void tsuya_mat3_svd(tsuya_mat3 a, tsuya_mat3 *u, double values[3], tsuya_mat3 *v)
{
    double largest = 0.0;
    for (int i = 0; i < 9; i++) {
        largest = fmax(largest, fabs(a.e[i / 3][i % 3]));
    }
    double unit = largest > 0.0 ? largest : 1.0; /* squares neither overflow nor vanish */
    tsuya_vec3 w[3], right[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    for (int j = 0; j < 3; j++) {
        w[j] = tsuya_vec3_scale(column(&a, j), 1.0 / unit);
    }
    for (int sweep = 0; sweep < 40; sweep++) {
        bool rotated = false;
        for (int p = 0; p < 2; p++) {
            for (int q = p + 1; q < 3; q++) {
                double r = tsuya_vec3_dot(w[p], w[q]), pp = tsuya_vec3_dot(w[p], w[p]), qq = tsuya_vec3_dot(w[q], w[q]);
                if (r == 0.0 || fabs(r) <= 1e-16 * sqrt(pp * qq)) {
                    continue;
                }
                double c, s;
                jacobi_rotation(pp, qq, r, &c, &s);
                tsuya_vec3 kept = w[p];
                w[p] = tsuya_vec3_mad(tsuya_vec3_scale(w[p], c), -s, w[q]);
                w[q] = tsuya_vec3_mad(tsuya_vec3_scale(w[q], c), s, kept);
                kept = right[p];
                right[p] = tsuya_vec3_mad(tsuya_vec3_scale(right[p], c), -s, right[q]);
                right[q] = tsuya_vec3_mad(tsuya_vec3_scale(right[q], c), s, kept);
                rotated = true;
            }
        }
        if (!rotated) {
            break;
        }
    }
    int order[3] = {0, 1, 2};
    double length[3];
    for (int j = 0; j < 3; j++) {
        length[j] = tsuya_vec3_norm(w[j]);
    }
    for (int i = 0; i < 2; i++) {
        for (int j = 0; j < 2 - i; j++) {
            if (length[order[j]] < length[order[j + 1]]) {
                int kept = order[j];
                order[j] = order[j + 1];
                order[j + 1] = kept;
            }
        }
    }
    tsuya_vec3 left[3] = {{1, 0, 0}, {0, 0, 0}, {0, 0, 0}};
    for (int j = 0; j < 3; j++) {
        double n = length[order[j]];
        values[j] = n * unit;
        set_column(v, j, right[order[j]]);
        if (n > 1e-15) {
            left[j] = tsuya_vec3_scale(w[order[j]], 1.0 / n);
        } else if (j > 0) { /* rank deficient: any orthonormal completion */
            left[j] = complete_basis(left[0], j == 2 ? left[1] : (tsuya_vec3){0, 0, 0});
        }
        set_column(u, j, left[j]);
    }
}

tsuya_mat3 tsuya_mat3_from_quaternion(tsuya_quaternion q)
{
    double n = sqrt(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z);
    if (!(n > 0.0)) {
        return tsuya_mat3_identity();
    }
    double w = q.w / n, x = q.x / n, y = q.y / n, z = q.z / n;
    return (tsuya_mat3){{{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)},
                         {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)},
                         {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)}}};
}

/* Shepperd 1978: the largest of the four squares is divided by. */
tsuya_quaternion tsuya_quaternion_from_mat3(tsuya_mat3 rotation)
{
    const double(*e)[3] = rotation.e;
    double square[4] = {1 + e[0][0] + e[1][1] + e[2][2], 1 + e[0][0] - e[1][1] - e[2][2], 1 - e[0][0] + e[1][1] - e[2][2],
                        1 - e[0][0] - e[1][1] + e[2][2]};
    int largest = 0;
    for (int i = 1; i < 4; i++) {
        if (square[i] > square[largest]) {
            largest = i;
        }
    }
    double d = sqrt(square[largest]) / 2.0, f = 0.25 / d;
    tsuya_quaternion q;
    switch (largest) {
    case 0: q = (tsuya_quaternion){d, (e[2][1] - e[1][2]) * f, (e[0][2] - e[2][0]) * f, (e[1][0] - e[0][1]) * f}; break;
    case 1: q = (tsuya_quaternion){(e[2][1] - e[1][2]) * f, d, (e[0][1] + e[1][0]) * f, (e[0][2] + e[2][0]) * f}; break;
    case 2: q = (tsuya_quaternion){(e[0][2] - e[2][0]) * f, (e[0][1] + e[1][0]) * f, d, (e[1][2] + e[2][1]) * f}; break;
    default: q = (tsuya_quaternion){(e[1][0] - e[0][1]) * f, (e[0][2] + e[2][0]) * f, (e[1][2] + e[2][1]) * f, d}; break;
    }
    double n = copysign(sqrt(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z), q.w);
    return (tsuya_quaternion){q.w / n, q.x / n, q.y / n, q.z / n};
}

tsuya_mat3 tsuya_mat3_from_rodrigues(tsuya_vec3 r_rad)
{
    double angle = tsuya_vec3_norm(r_rad);
    double half = angle / 2.0, s = angle > 1e-8 ? sin(half) / angle : 0.5; /* sin(x/2)/x → ½ */
    return tsuya_mat3_from_quaternion((tsuya_quaternion){cos(half), r_rad.x * s, r_rad.y * s, r_rad.z * s});
}

tsuya_vec3 tsuya_rodrigues_from_mat3(tsuya_mat3 rotation)
{
    tsuya_quaternion q = tsuya_quaternion_from_mat3(rotation);
    double n = sqrt(q.x * q.x + q.y * q.y + q.z * q.z);
    double f = n > 1e-12 ? 2.0 * atan2(n, q.w) / n : 2.0;
    return (tsuya_vec3){q.x * f, q.y * f, q.z * f};
}

double tsuya_mat3_rotation_angle_rad(tsuya_mat3 rotation)
{
    tsuya_quaternion q = tsuya_quaternion_from_mat3(rotation);
    return 2.0 * atan2(sqrt(q.x * q.x + q.y * q.y + q.z * q.z), q.w);
}

tsuya_pose tsuya_pose_inverse(tsuya_pose a_from_b)
{
    tsuya_vec3 t = tsuya_mat3_apply_transposed(a_from_b.rotation, a_from_b.translation);
    return (tsuya_pose){tsuya_mat3_transpose(a_from_b.rotation), {-t.x, -t.y, -t.z}};
}

tsuya_pose tsuya_pose_compose(tsuya_pose a_from_b, tsuya_pose b_from_c)
{
    return (tsuya_pose){tsuya_mat3_multiply(a_from_b.rotation, b_from_c.rotation),
                        tsuya_pose_apply(a_from_b, b_from_c.translation)};
}

tsuya_vec3 tsuya_pose_center(tsuya_pose camera_from_world)
{
    return tsuya_pose_inverse(camera_from_world).translation;
}

tsuya_pose tsuya_pose_look_at(tsuya_vec3 eye, tsuya_vec3 target, tsuya_vec3 up)
{
    tsuya_vec3 z = tsuya_vec3_unit(tsuya_vec3_sub(target, eye));
    if (tsuya_vec3_norm(z) == 0.0) {
        z = (tsuya_vec3){0, 0, 1};
    }
    tsuya_vec3 x = tsuya_vec3_unit(tsuya_vec3_cross(z, up));
    if (tsuya_vec3_norm(x) < 0.5) { /* looking along up: any horizontal */
        x = complete_basis(z, (tsuya_vec3){0, 0, 0});
    }
    tsuya_vec3 y = tsuya_vec3_cross(z, x);
    tsuya_pose pose = {{{{x.x, x.y, x.z}, {y.x, y.y, y.z}, {z.x, z.y, z.z}}}, {0, 0, 0}};
    tsuya_vec3 t = tsuya_mat3_apply(pose.rotation, eye);
    pose.translation = (tsuya_vec3){-t.x, -t.y, -t.z};
    return pose;
}

static tsuya_vec3 mean_of(const tsuya_vec3 *p, int n)
{
    tsuya_vec3 sum = {0, 0, 0};
    for (int i = 0; i < n; i++) {
        sum = tsuya_vec3_add(sum, p[i]);
    }
    return tsuya_vec3_scale(sum, 1.0 / n);
}

static tsuya_mat3 outer_add(tsuya_mat3 m, tsuya_vec3 a, tsuya_vec3 b, double f)
{
    double l[3] = {a.x, a.y, a.z}, r[3] = {b.x, b.y, b.z};
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            m.e[i][j] += f * l[i] * r[j];
        }
    }
    return m;
}

bool tsuya_similarity_align(tsuya_similarity *a_from_b, double *rms, const tsuya_vec3 *a, const tsuya_vec3 *b, int n)
{
    *a_from_b = (tsuya_similarity){1.0, tsuya_mat3_identity(), {0, 0, 0}};
    if (n < 3) {
        return false;
    }
    tsuya_vec3 mean_a = mean_of(a, n), mean_b = mean_of(b, n);
    tsuya_mat3 covariance = {0}, spread = {0};
    double variance_b = 0.0;
    for (int i = 0; i < n; i++) {
        tsuya_vec3 da = tsuya_vec3_sub(a[i], mean_a), db = tsuya_vec3_sub(b[i], mean_b);
        covariance = outer_add(covariance, da, db, 1.0 / n);
        spread = outer_add(spread, db, db, 1.0 / n);
        variance_b += tsuya_vec3_dot(db, db) / n;
    }
    double own[3], value[3];
    tsuya_mat3_eigen_symmetric(spread, own, NULL);
    tsuya_mat3 u, v;
    tsuya_mat3_svd(covariance, &u, value, &v);
    if (!(own[1] > 1e-14 * own[2]) || !(value[1] > 1e-9 * value[0])) {
        return false; /* collinear: the rotation about the line is free */
    }
    double sign = tsuya_mat3_determinant(u) * tsuya_mat3_determinant(v) < 0.0 ? -1.0 : 1.0;
    tsuya_mat3 d = tsuya_mat3_identity();
    d.e[2][2] = sign;
    a_from_b->rotation = tsuya_mat3_multiply(tsuya_mat3_multiply(u, d), tsuya_mat3_transpose(v));
    a_from_b->scale = (value[0] + value[1] + sign * value[2]) / variance_b;
    a_from_b->translation = tsuya_vec3_mad(mean_a, -a_from_b->scale, tsuya_mat3_apply(a_from_b->rotation, mean_b));
    if (rms) {
        double sum = 0.0;
        for (int i = 0; i < n; i++) {
            tsuya_vec3 e = tsuya_vec3_sub(a[i], tsuya_similarity_apply(*a_from_b, b[i]));
            sum += tsuya_vec3_dot(e, e);
        }
        *rms = sqrt(sum / n);
    }
    return true;
}
