/* Matrices, rotations, poses, similarities: identities, round trips, and derivatives where something is to be continuous. */
#include "support.h"

#include "core/context.h"
#include "core/geometry.h"

static uint64_t counter;
static double uniform(double low, double high) { return low + (high - low) * tsuya_random_uniform(7, 0, counter++); }
static tsuya_vec3 random_vector(double size) { return (tsuya_vec3){uniform(-size, size), uniform(-size, size), uniform(-size, size)}; }
static tsuya_mat3 random_matrix(void)
{
    tsuya_mat3 m;
    for (int i = 0; i < 9; i++) {
        m.e[i / 3][i % 3] = uniform(-1, 1);
    }
    return m;
}
static tsuya_mat3 random_rotation(void) { return tsuya_mat3_from_quaternion((tsuya_quaternion){uniform(-1, 1), uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)}); }

static double difference(tsuya_mat3 a, tsuya_mat3 b)
{
    double most = 0.0;
    for (int i = 0; i < 9; i++) {
        most = fmax(most, fabs(a.e[i / 3][i % 3] - b.e[i / 3][i % 3]));
    }
    return most;
}
static double distance(tsuya_vec3 a, tsuya_vec3 b) { return tsuya_vec3_norm(tsuya_vec3_sub(a, b)); }
static double orthogonality(tsuya_mat3 q) { return difference(tsuya_mat3_multiply(tsuya_mat3_transpose(q), q), tsuya_mat3_identity()); }

static void test_vectors(void **state)
{
    (void)state;
    for (int i = 0; i < 100; i++) {
        tsuya_vec3 a = random_vector(3), b = random_vector(3), c = tsuya_vec3_cross(a, b), n = tsuya_vec3_unit(a);
        assert_near(tsuya_vec3_dot(a, c), 0, 1e-13);
        assert_near(tsuya_vec3_dot(c, c) + tsuya_vec3_dot(a, b) * tsuya_vec3_dot(a, b), tsuya_vec3_dot(a, a) * tsuya_vec3_dot(b, b), 1e-11);
        tsuya_vec3 t = tsuya_vec3_tangent(b, n);
        assert_near(tsuya_vec3_dot(t, n), 0, 1e-12);
        assert_near(tsuya_vec3_norm(t), 1, 1e-14);
    }
    assert_near(tsuya_vec3_norm(tsuya_vec3_unit((tsuya_vec3){0, 0, 0})), 0, 0);
}

static void test_eigenvectors(void **state)
{
    (void)state;
    for (int i = 0; i < 500; i++) {
        tsuya_mat3 q = random_rotation(), d = {0}, v;
        double value[3], known[3] = {uniform(-2, 0), uniform(0, 1), i % 5 ? uniform(1, 2) : 1e9};
        if (i % 7 == 0) {
            known[1] = known[0]; /* twice the same */
        }
        for (int k = 0; k < 3; k++) {
            d.e[k][k] = known[k];
        }
        tsuya_mat3 a = tsuya_mat3_multiply(tsuya_mat3_multiply(q, d), tsuya_mat3_transpose(q));
        tsuya_mat3_eigen_symmetric(a, value, &v);
        double scale = fabs(known[2]);
        assert_true(orthogonality(v) < 1e-14);
        for (int k = 0; k < 3; k++) {
            assert_near(value[k], known[k], 1e-14 * scale);
            tsuya_vec3 column = {v.e[0][k], v.e[1][k], v.e[2][k]};
            assert_true(distance(tsuya_mat3_apply(a, column), tsuya_vec3_scale(column, value[k])) < 2e-14 * scale + 1e-14);
        }
    }
    double value[3];
    tsuya_mat3_eigen_symmetric((tsuya_mat3){0}, value, NULL);
    assert_near(value[0], 0, 0);
}

static void test_singular_values(void **state)
{
    (void)state;
    for (int i = 0; i < 500; i++) {
        tsuya_mat3 a = random_matrix(), u, v, s = {0};
        double value[3], scale = i % 3 == 0 ? 1e150 : i % 3 == 1 ? 1e-150 : 1.0;
        for (int k = 0; k < 9; k++) {
            a.e[k / 3][k % 3] *= scale;
        }
        if (i % 5 == 0) { /* rank 2, 1 and 0 */
            for (int k = 0; k < 3; k++) {
                a.e[2][k] = i % 2 ? 2 * a.e[1][k] : 0.0;
                a.e[1][k] *= i % 15 ? 1 : 0;
                a.e[0][k] *= i % 45 ? 1 : 0;
            }
        }
        tsuya_mat3_svd(a, &u, value, &v);
        assert_true(value[0] >= value[1] && value[1] >= value[2] && value[2] >= 0.0);
        assert_true(orthogonality(u) < 1e-13 && orthogonality(v) < 1e-13);
        for (int k = 0; k < 3; k++) {
            s.e[k][k] = value[k];
        }
        assert_true(difference(tsuya_mat3_multiply(tsuya_mat3_multiply(u, s), tsuya_mat3_transpose(v)), a) < 4e-15 * scale);
    }
}

static void test_rotations_round_trip(void **state)
{
    (void)state;
    for (int i = 0; i < 2000; i++) {
        tsuya_mat3 r = random_rotation();
        assert_true(orthogonality(r) < 1e-14);
        assert_near(tsuya_mat3_determinant(r), 1, 1e-14);
        tsuya_quaternion q = tsuya_quaternion_from_mat3(r);
        assert_true(q.w >= 0.0);
        assert_true(difference(tsuya_mat3_from_quaternion(q), r) < 1e-14);
        assert_true(difference(tsuya_mat3_from_rodrigues(tsuya_rodrigues_from_mat3(r)), r) < 1e-14);
        tsuya_vec3 v = random_vector(1);
        assert_true(distance(tsuya_mat3_apply_transposed(r, tsuya_mat3_apply(r, v)), v) < 1e-14);
    }
    assert_true(difference(tsuya_mat3_from_quaternion((tsuya_quaternion){0, 0, 0, 0}), tsuya_mat3_identity()) == 0.0);
}

static void test_angles_hold_near_zero_and_half_a_turn(void **state)
{
    (void)state;
    static const double angles[] = {0, 1e-300, 1e-12, 1e-9, 1e-8, 1.1e-8, 1e-4, 1, 3, M_PI - 1e-4, M_PI - 1e-9, M_PI - 1e-14, M_PI};
    for (size_t i = 0; i < sizeof angles / sizeof angles[0]; i++) {
        for (int k = 0; k < 50; k++) {
            tsuya_vec3 axis = k < 3 ? (tsuya_vec3){k == 0, k == 1, k == 2} : tsuya_vec3_unit(random_vector(1));
            tsuya_mat3 r = tsuya_mat3_from_rodrigues(tsuya_vec3_scale(axis, angles[i]));
            assert_near(tsuya_mat3_rotation_angle_rad(r), angles[i], 2e-15 + 1e-15 * angles[i]);
            tsuya_vec3 back = tsuya_rodrigues_from_mat3(r);
            double sign = angles[i] > M_PI - 1e-8 && tsuya_vec3_dot(back, axis) < 0 ? -1.0 : 1.0; /* at π both axes are right */
            assert_true(distance(back, tsuya_vec3_scale(axis, sign * angles[i])) < 2e-8);
            assert_true(difference(tsuya_mat3_from_rodrigues(back), r) < 1e-14);
        }
    }
}

/* dR/dr at 0 is the cross product matrix: the derivative by differences has to agree, and not to jump where the series begins. */
static void test_rodrigues_derivative(void **state)
{
    (void)state;
    for (int i = 0; i < 50; i++) {
        tsuya_vec3 axis = tsuya_vec3_unit(random_vector(1)), v = random_vector(1);
        static const double at[] = {0.0, 5e-9, 1e-8, 2e-8, 0.3};
        for (size_t k = 0; k < sizeof at / sizeof at[0]; k++) {
            const double h = 1e-6;
            tsuya_vec3 high = tsuya_mat3_apply(tsuya_mat3_from_rodrigues(tsuya_vec3_scale(axis, at[k] + h)), v);
            tsuya_vec3 low = tsuya_mat3_apply(tsuya_mat3_from_rodrigues(tsuya_vec3_scale(axis, at[k] - h)), v);
            tsuya_vec3 now = tsuya_mat3_apply(tsuya_mat3_from_rodrigues(tsuya_vec3_scale(axis, at[k])), v);
            tsuya_vec3 slope = tsuya_vec3_scale(tsuya_vec3_sub(high, low), 1.0 / (2 * h));
            assert_true(distance(slope, tsuya_vec3_cross(axis, now)) < 1e-9);
        }
    }
}

static void test_poses(void **state)
{
    (void)state;
    for (int i = 0; i < 200; i++) {
        tsuya_pose ab = {random_rotation(), random_vector(5)}, bc = {random_rotation(), random_vector(5)};
        tsuya_vec3 p = random_vector(5), there = tsuya_pose_apply(ab, p);
        assert_true(distance(tsuya_pose_apply(tsuya_pose_inverse(ab), there), p) < 1e-13);
        assert_true(distance(tsuya_pose_apply(tsuya_pose_compose(ab, bc), p), tsuya_pose_apply(ab, tsuya_pose_apply(bc, p))) < 1e-13);
        assert_true(tsuya_vec3_norm(tsuya_pose_apply(ab, tsuya_pose_center(ab))) < 1e-13);
    }
}

static void test_look_at(void **state)
{
    (void)state;
    tsuya_vec3 eye = {1, -4, 2}, target = {0, 0.5, 1}, up = {0, 0, 1};
    tsuya_pose pose = tsuya_pose_look_at(eye, target, up);
    assert_true(orthogonality(pose.rotation) < 1e-14 && tsuya_mat3_determinant(pose.rotation) > 0);
    assert_true(distance(tsuya_pose_center(pose), eye) < 1e-14);
    tsuya_vec3 t = tsuya_pose_apply(pose, target), above = tsuya_pose_apply(pose, tsuya_vec3_add(target, up));
    assert_near(t.x, 0, 1e-14);
    assert_near(t.y, 0, 1e-14);
    assert_near(t.z, distance(eye, target), 1e-14);
    assert_true(above.y < 0 && fabs(above.x) < 1e-14); /* up is up in the picture, where y grows downwards */
    pose = tsuya_pose_look_at(eye, (tsuya_vec3){1, -4, 7}, up); /* straight up */
    assert_true(orthogonality(pose.rotation) < 1e-14 && tsuya_mat3_determinant(pose.rotation) > 0);
    pose = tsuya_pose_look_at(eye, eye, up);
    assert_true(orthogonality(pose.rotation) < 1e-14);
}

static void test_similarity(void **state)
{
    (void)state;
    for (int round = 0; round < 100; round++) {
        tsuya_similarity truth = {exp(uniform(-3, 3)), random_rotation(), random_vector(10)}, found;
        tsuya_vec3 a[12], b[12];
        int n = 3 + round % 10;
        double rms;
        for (int i = 0; i < n; i++) {
            b[i] = random_vector(2);
            b[i].z *= round % 4 == 0 ? 0.0 : 1.0; /* flat sets too: no mirror image may come out */
            a[i] = tsuya_similarity_apply(truth, b[i]);
        }
        assert_true(tsuya_similarity_align(&found, &rms, a, b, n));
        assert_near(found.scale / truth.scale, 1, 1e-12);
        assert_true(difference(found.rotation, truth.rotation) < 1e-6);
        assert_near(tsuya_mat3_determinant(found.rotation), 1, 1e-12);
        assert_true(rms < 1e-12 * (1 + truth.scale));
    }
    tsuya_similarity s;
    tsuya_vec3 line[4] = {{0, 0, 0}, {1, 1, 1}, {2, 2, 2}, {5, 5, 5}}, same[4] = {{1, 2, 3}, {1, 2, 3}, {1, 2, 3}, {1, 2, 3}};
    assert_false(tsuya_similarity_align(&s, NULL, line, line, 4));
    assert_false(tsuya_similarity_align(&s, NULL, same, same, 4));
    assert_false(tsuya_similarity_align(&s, NULL, line, line, 2));
    assert_near(s.scale, 1, 0);
}

/* Least squares: no small change of the seven parameters makes the sum smaller. */
static void test_similarity_is_the_minimum(void **state)
{
    (void)state;
    tsuya_vec3 a[20], b[20];
    tsuya_similarity truth = {2.0, random_rotation(), random_vector(3)}, best;
    double rms;
    for (int i = 0; i < 20; i++) {
        b[i] = random_vector(1);
        a[i] = tsuya_vec3_add(tsuya_similarity_apply(truth, b[i]), random_vector(0.1));
    }
    assert_true(tsuya_similarity_align(&best, &rms, a, b, 20));
    for (int k = 0; k < 14; k++) {
        double h = k % 2 ? 1e-4 : -1e-4, sum = 0.0;
        tsuya_similarity s = best;
        tsuya_vec3 axis = {k / 2 == 0, k / 2 == 1, k / 2 == 2}, shift = {k / 2 == 3, k / 2 == 4, k / 2 == 5};
        s.rotation = tsuya_mat3_multiply(tsuya_mat3_from_rodrigues(tsuya_vec3_scale(axis, h)), s.rotation);
        s.translation = tsuya_vec3_mad(s.translation, h, shift);
        s.scale *= k / 2 == 6 ? 1 + h : 1;
        for (int i = 0; i < 20; i++) {
            tsuya_vec3 e = tsuya_vec3_sub(a[i], tsuya_similarity_apply(s, b[i]));
            sum += tsuya_vec3_dot(e, e);
        }
        assert_true(sqrt(sum / 20) > rms);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_vectors), cmocka_unit_test(test_eigenvectors), cmocka_unit_test(test_singular_values),
        cmocka_unit_test(test_rotations_round_trip), cmocka_unit_test(test_angles_hold_near_zero_and_half_a_turn),
        cmocka_unit_test(test_rodrigues_derivative), cmocka_unit_test(test_poses), cmocka_unit_test(test_look_at),
        cmocka_unit_test(test_similarity), cmocka_unit_test(test_similarity_is_the_minimum),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
