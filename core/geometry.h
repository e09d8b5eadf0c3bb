/* Vectors, matrices, rotations, poses.  Values, passed and returned by value; nothing here fails.
 *
 * A pose named a_from_b takes coordinates in b to coordinates in a: p_a = rotation · p_b + translation.
 * Camera frame: x right, y down, z forward (OpenCV, COLMAP, mrcal).  Matrices are row-major, m.e[row][column].
 * Quaternions are w, x, y, z, unit, Hamilton (COLMAP's order). */
#ifndef TSUYA_CORE_GEOMETRY_H
#define TSUYA_CORE_GEOMETRY_H

#include "core/api.h"

#include <math.h>
#include <stdbool.h>

#ifndef M_PI
#define M_PI 3.14159265358979323846
#endif

typedef struct tsuya_vec2 { double x, y; } tsuya_vec2;
typedef struct tsuya_vec3 { double x, y, z; } tsuya_vec3;
typedef struct tsuya_vec3f { float x, y, z; } tsuya_vec3f;
typedef struct tsuya_mat3 { double e[3][3]; } tsuya_mat3;
typedef struct tsuya_quaternion { double w, x, y, z; } tsuya_quaternion;
typedef struct tsuya_pose { tsuya_mat3 rotation; tsuya_vec3 translation; } tsuya_pose;
/* p_a = scale · rotation · p_b + translation */
typedef struct tsuya_similarity { double scale; tsuya_mat3 rotation; tsuya_vec3 translation; } tsuya_similarity;

static inline tsuya_vec3 tsuya_vec3_make(double x, double y, double z) { return (tsuya_vec3){x, y, z}; }
static inline tsuya_vec3 tsuya_vec3_add(tsuya_vec3 a, tsuya_vec3 b) { return (tsuya_vec3){a.x + b.x, a.y + b.y, a.z + b.z}; }
static inline tsuya_vec3 tsuya_vec3_sub(tsuya_vec3 a, tsuya_vec3 b) { return (tsuya_vec3){a.x - b.x, a.y - b.y, a.z - b.z}; }
static inline tsuya_vec3 tsuya_vec3_scale(tsuya_vec3 a, double s) { return (tsuya_vec3){a.x * s, a.y * s, a.z * s}; }
/* a + s·b */
static inline tsuya_vec3 tsuya_vec3_mad(tsuya_vec3 a, double s, tsuya_vec3 b)
{
    return (tsuya_vec3){a.x + s * b.x, a.y + s * b.y, a.z + s * b.z};
}
static inline double tsuya_vec3_dot(tsuya_vec3 a, tsuya_vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static inline tsuya_vec3 tsuya_vec3_cross(tsuya_vec3 a, tsuya_vec3 b)
{
    return (tsuya_vec3){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
static inline double tsuya_vec3_norm(tsuya_vec3 a) { return sqrt(tsuya_vec3_dot(a, a)); }
/* The zero vector stays zero. */
static inline tsuya_vec3 tsuya_vec3_unit(tsuya_vec3 a)
{
    double n = tsuya_vec3_norm(a);
    return n > 0.0 ? tsuya_vec3_scale(a, 1.0 / n) : (tsuya_vec3){0.0, 0.0, 0.0};
}
/* The part of `a` that is perpendicular to the unit vector `n`, made unit; zero where `a` is parallel to `n`. */
static inline tsuya_vec3 tsuya_vec3_tangent(tsuya_vec3 a, tsuya_vec3 n)
{
    return tsuya_vec3_unit(tsuya_vec3_mad(a, -tsuya_vec3_dot(a, n), n));
}

static inline tsuya_mat3 tsuya_mat3_identity(void) { return (tsuya_mat3){{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}}; }
TSUYA_API tsuya_mat3 tsuya_mat3_multiply(tsuya_mat3 a, tsuya_mat3 b);
TSUYA_API tsuya_mat3 tsuya_mat3_transpose(tsuya_mat3 a);
TSUYA_API double tsuya_mat3_determinant(tsuya_mat3 a);
static inline tsuya_vec3 tsuya_mat3_apply(tsuya_mat3 m, tsuya_vec3 v)
{
    return (tsuya_vec3){m.e[0][0] * v.x + m.e[0][1] * v.y + m.e[0][2] * v.z,
                        m.e[1][0] * v.x + m.e[1][1] * v.y + m.e[1][2] * v.z,
                        m.e[2][0] * v.x + m.e[2][1] * v.y + m.e[2][2] * v.z};
}
/* transpose(m) · v, the inverse for a rotation */
static inline tsuya_vec3 tsuya_mat3_apply_transposed(tsuya_mat3 m, tsuya_vec3 v)
{
    return (tsuya_vec3){m.e[0][0] * v.x + m.e[1][0] * v.y + m.e[2][0] * v.z,
                        m.e[0][1] * v.x + m.e[1][1] * v.y + m.e[2][1] * v.z,
                        m.e[0][2] * v.x + m.e[1][2] * v.y + m.e[2][2] * v.z};
}
/* Eigenvalues ascending and unit eigenvectors (columns of `vectors`) of a symmetric matrix; cyclic Jacobi. */
TSUYA_API void tsuya_mat3_eigen_symmetric(tsuya_mat3 a, double values[3], tsuya_mat3 *vectors);
/* Singular values descending, a = u · diag(values) · vᵀ; one-sided Jacobi. */
TSUYA_API void tsuya_mat3_svd(tsuya_mat3 a, tsuya_mat3 *u, double values[3], tsuya_mat3 *v);

TSUYA_API tsuya_mat3 tsuya_mat3_from_quaternion(tsuya_quaternion q); /* q need not be unit; zero gives the identity */
TSUYA_API tsuya_quaternion tsuya_quaternion_from_mat3(tsuya_mat3 rotation); /* w ≥ 0 */
/* Rodrigues vector: axis times angle in radians.  Continuous at 0 and at π. */
TSUYA_API tsuya_mat3 tsuya_mat3_from_rodrigues(tsuya_vec3 r_rad);
TSUYA_API tsuya_vec3 tsuya_rodrigues_from_mat3(tsuya_mat3 rotation);
/* Angle of a rotation, radians in [0, π], accurate near both ends. */
TSUYA_API double tsuya_mat3_rotation_angle_rad(tsuya_mat3 rotation);

static inline tsuya_pose tsuya_pose_identity(void) { return (tsuya_pose){tsuya_mat3_identity(), {0, 0, 0}}; }
static inline tsuya_vec3 tsuya_pose_apply(tsuya_pose a_from_b, tsuya_vec3 p_b)
{
    return tsuya_vec3_add(tsuya_mat3_apply(a_from_b.rotation, p_b), a_from_b.translation);
}
TSUYA_API tsuya_pose tsuya_pose_inverse(tsuya_pose a_from_b);
TSUYA_API tsuya_pose tsuya_pose_compose(tsuya_pose a_from_b, tsuya_pose b_from_c); /* a_from_c */
/* Where the camera stands: the origin of b's other side, −Rᵀt. */
TSUYA_API tsuya_vec3 tsuya_pose_center(tsuya_pose camera_from_world);
/* A camera at `eye` that looks at `target`, image top towards `up`. */
TSUYA_API tsuya_pose tsuya_pose_look_at(tsuya_vec3 eye, tsuya_vec3 target, tsuya_vec3 up);

static inline tsuya_vec3 tsuya_similarity_apply(tsuya_similarity s, tsuya_vec3 p)
{
    return tsuya_vec3_mad(s.translation, s.scale, tsuya_mat3_apply(s.rotation, p));
}
/* Least squares a_from_b over n point pairs (Umeyama 1991, eq. 38–42), n ≥ 3 and not collinear; false otherwise.
 * rms: root mean square distance in a's unit. */
TSUYA_API bool tsuya_similarity_align(tsuya_similarity *a_from_b, double *rms, const tsuya_vec3 *a, const tsuya_vec3 *b, int n);

static inline double tsuya_rad_from_deg(double deg) { return deg * (M_PI / 180.0); }
static inline double tsuya_deg_from_rad(double rad) { return rad * (180.0 / M_PI); }

#endif
