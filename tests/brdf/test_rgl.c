/* RGL tensor files: a real one, which must be reciprocal and give back what it receives, a made one, and hostile ones. */
#include "brdf/samples.h"
#include "support.h"

/* Pairs of samples of an isotropic surface whose directions are exchanged (polar angles and the angle between them alike, away from
 * the horizon and from the mirror direction): the mean |ln| of their ratio. */
static double unequal(const tsuya_samples *s, int *pairs)
{
    double sum = 0.0;
    *pairs = 0;
    for (int i = 0; i < s->count; i += 7) {
        double between = tsuya_vec3_dot(s->wi[i], s->wo[i]);
        for (int j = 0; j < s->count && s->wi[i].z > 0.3 && s->wo[i].z > 0.3; ++j) {
            if (fabs(s->wi[i].z - s->wo[j].z) < 0.01 && fabs(s->wo[i].z - s->wi[j].z) < 0.01 && fabs(s->wi[i].z - s->wo[i].z) > 0.05 &&
                fabs(between - tsuya_vec3_dot(s->wi[j], s->wo[j])) < 0.01 && s->value[3 * i + 1] > 0.0 && s->value[3 * j + 1] > 0.0) {
                sum += fabs(log(s->value[3 * i + 1] / s->value[3 * j + 1]));
                ++*pairs;
            }
        }
    }
    return *pairs ? sum / *pairs : NAN;
}

static void test_real_file(void **state)
{
    (void)state;
    const char *path = test_data("brdf/rgl_container_example.bsdf");
    if (!path) {
        skip();
    }
    tsuya_samples s;
    int pairs;
    assert_ok(tsuya_samples_load(&s, path));
    assert_int_equal(s.channel_count, 3);
    double ratio = unequal(&s, &pairs), blue = 0.0, red = 0.0;
    for (int k = 0; k < s.count; ++k) {
        red += s.value[3 * k];
        blue += s.value[3 * k + 2];
        assert_true(s.value[3 * k] >= 0.0 && isfinite(s.value[3 * k]));
    }
    print_message("%d samples, %d of %d left out; %d exchanged pairs differ by %.3f in the mean logarithm; blue over red %.2f\n", s.count, s.dropped_below,
                  s.count + s.dropped_below, pairs, ratio, blue / red);
    assert_true(pairs > 100 && ratio < 0.35);
    assert_true(blue > red); /* a blue vinyl */
    tsuya_samples_free(&s);
}

static void put_field(char *file, size_t *at, const char *name, int type, int dimensions, const uint64_t *shape, uint64_t offset)
{
    uint16_t length = (uint16_t)strlen(name), n = (uint16_t)dimensions;
    uint8_t t = (uint8_t)type;
    memcpy(file + *at, &length, 2);
    memcpy(file + *at + 2, name, length);
    memcpy(file + *at + 2 + length, &n, 2);
    memcpy(file + *at + 4 + length, &t, 1);
    memcpy(file + *at + 5 + length, &offset, 8);
    memcpy(file + *at + 13 + length, shape, 8 * (size_t)dimensions);
    *at += 13 + length + 8 * (size_t)dimensions;
}

enum { NODES = 9, DATA = 1024, SIZE = DATA + 4 * 1024 };

/* Two azimuths too many to be isotropic, one incidence of 30°, a flat warp, values 0.5 · 4 in the first channel. */
static void make_file(char file[SIZE])
{
    const uint64_t three[] = {3}, one[] = {1}, table[] = {2, 2}, warp[] = {3, 1, 2, 2}, values[] = {3, 1, 3, NODES, NODES};
    const float phi[3] = {0.0f, 1.0f, 2.0f}, theta = (float)(M_PI / 6);
    float number = 1.0f;
    size_t at = 18;
    memset(file, 0, SIZE);
    memcpy(file, "tensor_file\0\1\0\7\0\0\0", 18);
    put_field(file, &at, "phi_i", 10, 1, three, DATA);
    put_field(file, &at, "theta_i", 10, 1, one, DATA + 16);
    put_field(file, &at, "sigma", 10, 2, table, DATA + 32);
    put_field(file, &at, "ndf", 10, 2, table, DATA + 32);
    put_field(file, &at, "vndf", 10, 4, warp, DATA + 32);
    put_field(file, &at, "rgb", 10, 5, values, DATA + 128);
    put_field(file, &at, "jacobian", 1, 1, one, DATA + 96);
    assert_true(at <= DATA);
    memcpy(file + DATA, phi, sizeof phi);
    memcpy(file + DATA + 16, &theta, 4);
    for (int k = 0; k < 12; ++k) {
        memcpy(file + DATA + 32 + 4 * k, &number, 4);
    }
    file[DATA + 96] = 1;
    for (int k = 0; k < 3 * 3 * NODES * NODES; ++k) {
        number = k / (NODES * NODES) % 3 == 0 ? 2.0f : 0.0f;
        memcpy(file + DATA + 128 + 4 * k, &number, 4);
    }
}

static tsuya_status load(tsuya_samples *s, const char *file, size_t size)
{
    const char *path = test_path("made.bsdf");
    assert_ok(tsuya_file_write(path, file, size));
    return tsuya_samples_load(s, path);
}

static void test_made_file(void **state)
{
    (void)state;
    static char file[SIZE];
    tsuya_samples s;
    make_file(file);
    assert_ok(load(&s, file, SIZE));
    assert_int_equal(s.count + s.dropped_below, 3 * NODES * NODES);
    assert_true(s.count > NODES);
    for (int k = 0; k < s.count; ++k) { /* f cosθo = 2 · 1 / (4 · 1) */
        assert_near(s.value[3 * k] * s.wo[k].z, 0.5, 1e-6);
        assert_near(s.wi[k].z, cos(M_PI / 6), 1e-6);
    }
    bool mirror = false; /* u = (0, ·): half vector at the normal */
    for (int k = 0; k < s.count; ++k) {
        mirror |= fabs(s.wo[k].x + s.wi[k].x) + fabs(s.wo[k].y + s.wi[k].y) < 1e-6;
    }
    assert_true(mirror);
    tsuya_samples_free(&s);
}

static void test_hostile_files(void **state)
{
    (void)state;
    static char file[SIZE], good[SIZE];
    tsuya_samples s;
    make_file(good);
    for (size_t size = 12; size < SIZE; size += size < 300 ? 7 : 397) { /* cut anywhere */
        assert_int_not_equal(load(&s, good, size < DATA + 128 + 4 * 9 * NODES * NODES ? size : DATA), TSUYA_OK);
    }
    uint64_t seed = 7;
    for (int k = 0; k < 400; ++k) { /* any byte of the header changed: refused or read, never worse */
        memcpy(file, good, SIZE);
        seed = seed * 6364136223846793005u + 1442695040888963407u;
        file[12 + (seed >> 33) % 300] = (char)(seed >> 20);
        if (load(&s, file, SIZE) == TSUYA_OK) {
            tsuya_samples_free(&s);
        }
    }
    memcpy(file, good, SIZE);
    float nan = NAN;
    memcpy(file + DATA + 128, &nan, 4);
    assert_fails(load(&s, file, SIZE), "not a finite number");
    memcpy(file, good, SIZE);
    file[12] = 2;
    assert_fails(load(&s, file, SIZE), "version 1");
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_made_file), cmocka_unit_test(test_hostile_files), cmocka_unit_test(test_real_file)};
    int failed = cmocka_run_group_tests(tests, NULL, NULL);
    test_folder_remove();
    return failed;
}
