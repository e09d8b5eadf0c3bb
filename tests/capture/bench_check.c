/* A session of 24-Mpix photographs: how long the check takes for each, on two threads, and whom it names. */
#include "support.h"

#include "bench.h"
#include "capture/faults.h"
#include "core/image.h"

#include <math.h>
#include <sys/resource.h>

enum { LONG_PX = 6000, SHORT_PX = 4000, PHOTOS = 12, FIRST = 6 };

static double cpu_s(void)
{
    struct rusage r;
    getrusage(RUSAGE_SELF, &r);
    return (double)(r.ru_utime.tv_sec + r.ru_stime.tv_sec) + 1e-6 * (double)(r.ru_utime.tv_usec + r.ru_stime.tv_usec);
}

/* The middle of a photograph in the proportions of a full frame, enlarged, with the grain of its own pixels: as heavy a file as a camera's. */
static void enlarge(const char *to, const char *from, uint64_t seed)
{
    tsuya_image loaded, linear, cut, large, encoded;
    tsuya_image_save_options options = tsuya_image_save_options_default();
    options.jpeg_quality = 95;
    assert_ok(tsuya_image_load(&loaded, from));
    assert_ok(tsuya_image_convert(&linear, &loaded, TSUYA_SAMPLE_F32, TSUYA_ENCODING_LINEAR));
    bool upright = linear.height_px > linear.width_px;
    int width = linear.width_px, height = linear.height_px;
    int keep = upright ? width * LONG_PX / SHORT_PX : height * LONG_PX / SHORT_PX, from_px = upright ? (height - keep) / 2 : (width - keep) / 2;
    assert_ok(tsuya_image_create(&cut, upright ? width : keep, upright ? keep : height, 3, TSUYA_SAMPLE_F32, TSUYA_ENCODING_LINEAR));
    for (int y = 0; y < cut.height_px; y++) {
        memcpy(tsuya_image_f32(&cut, 0, y), tsuya_image_f32(&linear, upright ? 0 : from_px, upright ? y + from_px : y), 3 * sizeof(float) * (size_t)cut.width_px);
    }
    assert_ok(tsuya_image_resize(&large, &cut, upright ? SHORT_PX : LONG_PX, upright ? LONG_PX : SHORT_PX));
    for (int y = 0; y < large.height_px; y++) {
        for (int x = 0; x < large.width_px; x++) {
            float *v = tsuya_image_f32(&large, x, y);
            for (uint64_t c = 0; c < 3; c++) {
                double grain = tsuya_random_uniform(seed, c, 8192 * (uint64_t)y + (uint64_t)x) - 0.5;
                v[c] = (float)fmax(0.0, (double)v[c] + 0.04 * grain * sqrt((double)v[c]));
            }
        }
    }
    assert_ok(tsuya_image_convert(&encoded, &large, TSUYA_SAMPLE_U8, TSUYA_ENCODING_SRGB));
    assert_ok(tsuya_image_save(&encoded, to, &options));
    tsuya_image *const owned[] = {&loaded, &linear, &cut, &large, &encoded};
    for (size_t k = 0; k < sizeof owned / sizeof owned[0]; k++) {
        tsuya_image_free(owned[k]);
    }
}

static void spoil(const char *folder, char **name)
{
    char path[TEST_PATH], to[TEST_PATH];
    for (int k = 0; k < 5; k++) {
        snprintf(path, sizeof path, "%s/%s", folder, name[FIRST + (int[]){1, 4, 7, 10, 2}[k]]);
        switch (k) {
        case 0: fault_gaussian(path, path, 6.0); break;
        case 1: fault_motion(path, path, 25); break;
        case 2: fault_gain(path, path, 0.5, 0.5, 0.5); break;
        case 3: fault_gain(path, path, 0.72, 1.0, 1.3); break;
        default: snprintf(to, sizeof to, "%s/zz-copy.jpg", folder); fault_again(to, path);
        }
    }
}

/* Photographs that are there already are taken as they are. */
static void make_session(const char *folder, const char *from, const char *foreign, char **name)
{
    char to[TEST_PATH], source[TEST_PATH];
    assert_ok(tsuya_folder_make(folder));
    snprintf(to, sizeof to, "%s/zz-copy.jpg", folder);
    if (access(to, R_OK) != 0) {
        for (int k = 0; k < PHOTOS; k++) {
            snprintf(source, sizeof source, "%s/%s", from, name[FIRST + k]);
            snprintf(to, sizeof to, "%s/%s", folder, name[FIRST + k]);
            enlarge(to, source, (uint64_t)k + 1);
        }
        spoil(folder, name);
    }
    snprintf(to, sizeof to, "%s/zz-foreign.jpg", folder);
    if (access(to, R_OK) != 0) {
        const char *lying = test_path("lying.jpg");
        enlarge(lying, foreign, 99);
        fault_foreign(to, lying, SHORT_PX, LONG_PX); /* upright as the others are */
    }
}

static void a_session_of_24_mpix(void **state)
{
    (void)state;
    const char *from = test_data("garment/asclepius/images"), *foreign = test_data("garment/kermit_jacket/kermit002.jpg");
    if (!from || !foreign) {
        skip();
    }
    static const char *const wrong[] = {"blurred", "blurred by motion", "darker", "white balance"};
    const char *folder = getenv("TSUYA_BENCH_PHOTOS") ? getenv("TSUYA_BENCH_PHOTOS") : test_path("photos");
    tsuya_arena *arena;
    char **name;
    int count;
    assert_ok(tsuya_arena_create(&arena, 1 << 14));
    assert_ok(tsuya_folder_list(&name, &count, from, arena));
    make_session(folder, from, foreign, name);
    tsuya_check check;
    tsuya_check_options options = tsuya_check_options_default();
    tsuya_context context = tsuya_context_default();
    context.threads = 2;
    double cpu = cpu_s();
    assert_ok(tsuya_check_session(&check, folder, NULL, &options, &context));
    cpu = cpu_s() - cpu;
    int accused = 0;
    for (int i = 0; i < check.count; i++) {
        const tsuya_checked_photo *p = &check.photo[i];
        accused += p->fault_count > 0;
        print_message("%-28s %5d x %4d  edges %.2f px, %d features, %d neighbours: %s\n", p->photo.name, p->photo.width_px, p->photo.height_px,
                      p->blur.worst_px, p->features, p->neighbours, p->fault_count ? p->fault[0] : "good");
    }
    int spoilt = 6, named = 0;
    for (int k = 0; k < 6; k++) {
        const tsuya_checked_photo *p = checked(&check, k < 4 ? name[FIRST + 1 + 3 * k] : k == 4 ? "zz-copy.jpg" : "zz-foreign.jpg");
        bool found = false;
        for (int f = 0; f < p->fault_count; f++) {
            found = found || strstr(p->fault[f], k < 4 ? wrong[k] : k == 4 ? "same view" : "foreign");
        }
        named += found;
    }
    double each = check.seconds / check.count;
    print_message("%d photographs of 24 Mpix: %.2f s each on 2 threads, %.2f s of cpu; named %d of %d spoilt, accused %d of %d good\n", check.count, each,
                  cpu / check.count, named, spoilt, accused - named, check.count - spoilt);
    bench_point("check of a 24-Mpix photograph", "two threads", (double)(spoilt - named + accused - named) / check.count, "misjudged", each, "s");
    assert_true(each < 2.0);
    assert_int_equal(named, spoilt);
    assert_int_equal(accused, spoilt);
    tsuya_check_free(&check);
    tsuya_arena_free(arena);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(a_session_of_24_mpix)};
    return cmocka_run_group_tests(tests, NULL, test_folder_tear_down);
}
