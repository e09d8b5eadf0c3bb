/* Exact matching against a plain double loop, and the guides. */
#include "tests/support.h"

#include "core/context.h"
#include "core/matching.h"
#include "core/memory.h"

enum { A = 301, B = 1203 };

/* Descriptors of length 512; b holds noisy copies of half of a, elsewhere, and other features. */
static void make_features(tsuya_sift *f, int count, uint64_t stream)
{
    f->count = count;
    f->position = tsuya_calloc((size_t)count, sizeof *f->position);
    f->descriptor = tsuya_calloc((size_t)count * TSUYA_DESCRIPTOR_LENGTH, 1);
    assert_true(f->position && f->descriptor);
    for (int i = 0; i < count; i++) {
        f->position[i] = (tsuya_sift_position){(float)(1000.0 * tsuya_random_uniform(stream, 1, (uint64_t)i)),
                                               (float)(800.0 * tsuya_random_uniform(stream, 2, (uint64_t)i))};
        double v[TSUYA_DESCRIPTOR_LENGTH], norm = 0.0;
        for (int k = 0; k < TSUYA_DESCRIPTOR_LENGTH; k++) {
            double u = tsuya_random_uniform(stream, 3, (uint64_t)(i * TSUYA_DESCRIPTOR_LENGTH + k));
            v[k] = u * u;
            norm += v[k] * v[k];
        }
        for (int k = 0; k < TSUYA_DESCRIPTOR_LENGTH; k++) {
            f->descriptor[i * TSUYA_DESCRIPTOR_LENGTH + k] = (uint8_t)lround(fmin(512.0 * v[k] / sqrt(norm), 255.0));
        }
    }
}

static int place_of(int i)
{
    return (i * 7 + 11) % B;
}

static void copy_half(tsuya_sift *b, const tsuya_sift *a)
{
    for (int i = 0; i < a->count; i += 2) {
        uint8_t *to = b->descriptor + (size_t)place_of(i) * TSUYA_DESCRIPTOR_LENGTH;
        for (int k = 0; k < TSUYA_DESCRIPTOR_LENGTH; k++) {
            int noisy = a->descriptor[(size_t)i * TSUYA_DESCRIPTOR_LENGTH + (size_t)k] + (k % 3) - 1;
            to[k] = (uint8_t)(noisy < 0 ? 0 : noisy > 255 ? 255 : noisy);
        }
    }
}

static double angle(const tsuya_sift *a, int i, const tsuya_sift *b, int j)
{
    double sum = 0.0;
    for (int k = 0; k < TSUYA_DESCRIPTOR_LENGTH; k++) {
        sum += (double)a->descriptor[i * TSUYA_DESCRIPTOR_LENGTH + k] * (double)b->descriptor[j * TSUYA_DESCRIPTOR_LENGTH + k];
    }
    return acos(fmin(sum / (512.0 * 512.0), 1.0));
}

/* The nearest of feature i of a in b that is distinct, −1 for none. */
static int nearest_plain(const tsuya_sift *a, int i, const tsuya_sift *b)
{
    double best = INFINITY, second = INFINITY;
    int index = -1;
    for (int j = 0; j < b->count; j++) {
        double d = angle(a, i, b, j);
        if (d < best) {
            second = best;
            best = d;
            index = j;
        } else if (d < second) {
            second = d;
        }
    }
    return best <= 0.7 && best < 0.8 * second ? index : -1;
}

static void test_same_as_the_plain_loop(void **state)
{
    (void)state;
    tsuya_sift a, b;
    make_features(&a, A, 1);
    make_features(&b, B, 2);
    copy_half(&b, &a);
    for (int threads = 1; threads <= 3; threads++) {
        tsuya_match *match;
        int count, next = 0;
        assert_ok(tsuya_match_features(&match, &count, &a, &b, NULL, threads));
        for (int i = 0; i < A; i++) {
            int j = nearest_plain(&a, i, &b);
            if (j >= 0 && nearest_plain(&b, j, &a) == i) {
                assert_true(next < count);
                assert_int_equal(match[next].a, i);
                assert_int_equal(match[next].b, j);
                next++;
            }
        }
        assert_int_equal(next, count);
        assert_true(count >= A / 2);
        tsuya_free(match);
    }
    tsuya_sift_free(&a);
    tsuya_sift_free(&b);
}

/* Two cameras look at points; every feature is the same to the eye, so that only the epipolar line tells them apart. */
static void test_epipolar_lines_lead(void **state)
{
    (void)state;
    enum { POINTS = 40 };
    tsuya_camera camera = {.lens = TSUYA_LENS_OPENCV4, .width_px = 1000, .height_px = 800, .fx_px = 900, .fy_px = 900, .cx_px = 499.5, .cy_px = 399.5,
                           .distortion = {-0.1, 0.02, 1e-3, -5e-4}};
    tsuya_vec3 up = tsuya_vec3_make(0, 1, 0), aim = tsuya_vec3_make(0, 0, 0);
    tsuya_pose pose_a = tsuya_pose_look_at(tsuya_vec3_make(0.0, 0.0, 3.0), aim, up), pose_b = tsuya_pose_look_at(tsuya_vec3_make(0.7, 0.1, 2.9), aim, up);
    tsuya_sift a, b;
    make_features(&a, 2 * POINTS, 3);
    make_features(&b, 2 * POINTS, 4);
    for (int i = 0; i < POINTS; i++) {
        tsuya_vec3 p = tsuya_vec3_make(0.1 * tsuya_random_normal(5, 1, (uint64_t)i), -0.8 + 1.6 * i / POINTS, 0.1 * tsuya_random_normal(5, 2, (uint64_t)i));
        tsuya_vec2 pixel;
        assert_true(tsuya_camera_project(&camera, tsuya_pose_apply(pose_a, p), &pixel));
        a.position[i] = (tsuya_sift_position){(float)(pixel.x + 0.5), (float)(pixel.y + 0.5)};
        assert_true(tsuya_camera_project(&camera, tsuya_pose_apply(pose_b, p), &pixel));
        b.position[i] = (tsuya_sift_position){(float)(pixel.x + 0.5), (float)(pixel.y + 0.5)};
        memcpy(b.descriptor + (size_t)i * TSUYA_DESCRIPTOR_LENGTH, a.descriptor, TSUYA_DESCRIPTOR_LENGTH);
        memcpy(a.descriptor + (size_t)i * TSUYA_DESCRIPTOR_LENGTH, a.descriptor, TSUYA_DESCRIPTOR_LENGTH);
    }
    tsuya_match *match;
    int count;
    assert_ok(tsuya_match_features(&match, &count, &a, &b, NULL, 1));
    for (int i = 0; i < count; i++) {
        assert_true(match[i].a >= POINTS && match[i].b >= POINTS);
    }
    tsuya_free(match);
    tsuya_sift_undistort(&a, &camera);
    tsuya_sift_undistort(&b, &camera);
    tsuya_guide guide = tsuya_guide_of_poses(pose_a, pose_b, 0.5 / 900.0);
    assert_ok(tsuya_match_features(&match, &count, &a, &b, &guide, 2));
    int right = 0;
    for (int i = 0; i < count; i++) {
        right += match[i].a < POINTS && match[i].a == match[i].b;
        assert_true(match[i].a >= POINTS || match[i].a == match[i].b);
    }
    assert_true(right >= POINTS * 8 / 10);
    tsuya_free(match);
    tsuya_sift_free(&a);
    tsuya_sift_free(&b);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_same_as_the_plain_loop), cmocka_unit_test(test_epipolar_lines_lead),
    };
    return cmocka_run_group_tests(tests, NULL, test_folder_tear_down);
}
