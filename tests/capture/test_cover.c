/* Directions and missing views: out of turns that are known exactly, out of wrong ones among them, and as photographs arrive. */
#include "support.h"

#include "capture/check_photo.h"
#include "capture/faults.h"
#include "core/json.h"

#include <math.h>

enum { RING = 24, MOST = 40 };

typedef struct orbit {
    tsuya_check check;
    tsuya_checked_photo photo[MOST];
    tsuya_check_sight sight[MOST];
    tsuya_check_relation relation[MOST * MOST];
    tsuya_pose pose[MOST];
    double azimuth_deg[MOST], elevation_deg[MOST];
    char name[MOST][16];
} orbit;

static void add(orbit *o, double azimuth_deg, double elevation_deg)
{
    int k = o->check.count++;
    double a = tsuya_rad_from_deg(azimuth_deg), e = tsuya_rad_from_deg(elevation_deg);
    tsuya_vec3 eye = {0.3 + cos(e) * cos(a), -0.2 + cos(e) * sin(a), 0.7 + sin(e)};
    o->azimuth_deg[k] = azimuth_deg;
    o->elevation_deg[k] = elevation_deg;
    snprintf(o->name[k], sizeof o->name[k], "IMG_%02d.jpg", k);
    o->photo[k] = (tsuya_checked_photo){.photo = {.name = o->name[k], .orientation = 1}, .readable = true, .same_as = -1};
    o->sight[k] = (tsuya_check_sight){.towards = {0, 0, 1}};
    o->pose[k] = tsuya_pose_look_at(eye, (tsuya_vec3){0.3, -0.2, 0.7}, (tsuya_vec3){0, 0, 1});
}

/* Turns between photographs up to 50 degrees apart; every `wrong`th is off by 40 degrees, all by noise. */
static void relate_all(orbit *o, double noise_deg, int wrong)
{
    int n = o->check.count, pairs = 0;
    o->check.photo = o->photo;
    for (int i = 0; i < n; i++) {
        for (int j = i + 1; j < n; j++) {
            tsuya_check_relation *r = &o->relation[i * n + j], *back = &o->relation[j * n + i];
            tsuya_mat3 turn = tsuya_mat3_multiply(o->pose[j].rotation, tsuya_mat3_transpose(o->pose[i].rotation));
            double angle = tsuya_deg_from_rad(tsuya_mat3_rotation_angle_rad(turn));
            *r = (tsuya_check_relation){.known = true};
            if (angle < 50.0) {
                uint64_t c = (uint64_t)(3 * (i * n + j));
                double off = tsuya_rad_from_deg(++pairs % wrong == 0 ? 40.0 : noise_deg);
                tsuya_vec3 axis = {tsuya_random_normal(1, 1, c), tsuya_random_normal(1, 1, c + 1), tsuya_random_normal(1, 1, c + 2)};
                r->used = true;
                r->shared = r->turned = pairs % wrong == 0 ? 14 : (int)(120.0 - angle);
                r->turn = tsuya_mat3_multiply(tsuya_mat3_from_rodrigues(tsuya_vec3_scale(tsuya_vec3_unit(axis), off)), turn);
            }
            *back = *r;
            back->turn = tsuya_mat3_transpose(r->turn);
        }
    }
}

static double worst_direction(const orbit *o)
{
    double worst = 0.0;
    for (int i = 0; i < o->check.count; i++) {
        double a = remainder(o->photo[i].azimuth_deg - (o->azimuth_deg[i] - o->azimuth_deg[0]), 360.0);
        worst = fmax(worst, fmax(fabs(a) * cos(tsuya_rad_from_deg(o->elevation_deg[i])), fabs(o->photo[i].elevation_deg - o->elevation_deg[i])));
    }
    return worst;
}

static void two_rings(orbit *o, double from_deg, double to_deg)
{
    for (int k = 0; k < RING; k++) {
        double azimuth = 360.0 / RING * k;
        if (azimuth < from_deg || azimuth > to_deg) {
            add(o, azimuth, k % 2 ? 15.0 : 40.0);
        }
    }
}

static void directions_come_back(void **state)
{
    (void)state;
    tsuya_check_options options = tsuya_check_options_default();
    orbit *o = calloc(1, sizeof *o);
    two_rings(o, 400, 400);
    relate_all(o, 0.0, 1000);
    assert_ok(tsuya_check_cover(&o->check, o->relation, o->sight, &options));
    assert_int_equal(o->check.placed, RING);
    assert_true(worst_direction(o) < 1.0);
    relate_all(o, 1.5, 7); /* noise, and every seventh pair plainly wrong */
    assert_ok(tsuya_check_cover(&o->check, o->relation, o->sight, &options));
    print_message("1.5 degrees of noise, every 7th turn off by 40 degrees: directions to %.1f degrees\n", worst_direction(o));
    assert_true(worst_direction(o) < 5.0);
    free(o);
}

static void the_hole_is_asked_for_first(void **state)
{
    (void)state;
    tsuya_check_options options = tsuya_check_options_default();
    orbit *o = calloc(1, sizeof *o);
    two_rings(o, 100, 210);
    relate_all(o, 0.5, 1000);
    assert_ok(tsuya_check_cover(&o->check, o->relation, o->sight, &options));
    double covered = o->check.covered;
    assert_true(covered < 0.9);
    assert_true(o->check.missing_count >= 2);
    for (int k = 0; k < o->check.missing_count; k++) {
        const tsuya_check_missing *m = &o->check.missing[k];
        char text[320];
        tsuya_check_missing_text(text, sizeof text, &o->check, m);
        print_message("%s: +%.1f %%\n", text, 100.0 * m->gain);
        assert_true(k == 0 || m->gain <= m[-1].gain + 1e-12);
        assert_non_null(strstr(text, "IMG_"));
        if (k < 2) {
            assert_true(m->azimuth_deg + o->azimuth_deg[0] > 95.0 && m->azimuth_deg + o->azimuth_deg[0] < 215.0);
        }
    }
    /* Taken as asked for, the hole is closed. */
    orbit *full = calloc(1, sizeof *full);
    two_rings(full, 100, 210);
    for (int k = 0; k < o->check.missing_count; k++) {
        add(full, o->check.missing[k].azimuth_deg + o->azimuth_deg[0], o->check.missing[k].elevation_deg);
    }
    relate_all(full, 0.0, 1000);
    assert_ok(tsuya_check_cover(&full->check, full->relation, full->sight, &options));
    print_message("covered %.3f before, %.3f after %d more\n", covered, full->check.covered, o->check.missing_count);
    assert_true(full->check.covered > 0.95);
    /* A photograph that is to be taken again covers nothing. */
    full->photo[3].fault_count = full->photo[4].fault_count = full->photo[5].fault_count = full->photo[6].fault_count = 1;
    double before = full->check.covered;
    assert_ok(tsuya_check_cover(&full->check, full->relation, full->sight, &options));
    assert_true(full->check.covered < before);
    free(o);
    free(full);
}

static void nothing_shared_says_nothing(void **state)
{
    (void)state;
    tsuya_check_options options = tsuya_check_options_default();
    orbit *o = calloc(1, sizeof *o);
    two_rings(o, 400, 400);
    relate_all(o, 0.0, 1000);
    memset(o->relation, 0, sizeof o->relation);
    assert_ok(tsuya_check_cover(&o->check, o->relation, o->sight, &options));
    assert_int_equal(o->check.placed, 0);
    assert_int_equal(o->check.missing_count, 0);
    assert_true(isnan(o->check.covered));
    free(o);
}

/* Everything but the time. */
static char *text_of(const tsuya_check *check)
{
    char *text;
    tsuya_json *object = tsuya_json_create_object();
    tsuya_check_to_json(object, check);
    tsuya_json_remove(object, "seconds");
    assert_ok(tsuya_json_print(&text, object));
    tsuya_json_free(object);
    return text;
}

static void link_photo(const char *folder, const char *from, const char *name)
{
    char source[TEST_PATH], to[TEST_PATH];
    snprintf(source, sizeof source, "%s/%s", from, name);
    snprintf(to, sizeof to, "%s/%s", folder, name);
    assert_int_equal(symlink(source, to), 0);
}

static void photographs_that_arrive_read_as_a_whole_session(void **state)
{
    (void)state;
    const char *from = test_data("garment/kermit_jacket"), *folder = test_path("arriving");
    if (!from) {
        skip();
    }
    tsuya_check_options options = tsuya_check_options_default();
    tsuya_context context = tsuya_context_default();
    tsuya_check_watch *watch;
    int read;
    assert_ok(tsuya_folder_make(folder));
    assert_ok(tsuya_check_watch_create(&watch, folder, NULL, &options));
    assert_ok(tsuya_check_watch_refresh(watch, &read, &context)); /* empty */
    assert_int_equal(read, 0);
    link_photo(folder, from, "kermit003.jpg");
    link_photo(folder, from, "kermit001.jpg");
    assert_ok(tsuya_check_watch_refresh(watch, &read, &context));
    assert_int_equal(read, 2);
    link_photo(folder, from, "kermit002.jpg");
    assert_ok(tsuya_file_write(test_path("arriving/kermit009.jpg"), "half", 4));
    assert_ok(tsuya_check_watch_refresh(watch, &read, &context));
    assert_int_equal(read, 2);
    assert_accused(tsuya_check_watch_result(watch), "kermit009.jpg", "cannot be read");
    assert_int_equal(unlink(test_path("arriving/kermit009.jpg")), 0);
    link_photo(folder, from, "kermit009.jpg"); /* it arrives whole */
    assert_int_equal(unlink(test_path("arriving/kermit003.jpg")), 0);
    assert_ok(tsuya_check_watch_refresh(watch, &read, &context));
    assert_int_equal(read, 1);
    assert_int_equal(tsuya_check_watch_result(watch)->count, 3);
    assert_ok(tsuya_check_watch_refresh(watch, &read, &context));
    assert_int_equal(read, 0);
    tsuya_check whole;
    context.threads = 1;
    assert_ok(tsuya_check_session(&whole, folder, NULL, &options, &context));
    char *a = text_of(&whole), *b = text_of(tsuya_check_watch_result(watch));
    assert_string_equal(a, b);
    tsuya_free(a);
    tsuya_free(b);
    tsuya_check_free(&whole);
    tsuya_check_watch_free(watch);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(directions_come_back),
        cmocka_unit_test(the_hole_is_asked_for_first),
        cmocka_unit_test(nothing_shared_says_nothing),
        cmocka_unit_test(photographs_that_arrive_read_as_a_whole_session),
    };
    return cmocka_run_group_tests(tests, NULL, test_folder_tear_down);
}
