/* Where two models of one set would join. */
#include "support.h"

#include "reconstruct/groups.h"

enum { PHOTOS = 6 };

static char *const names[PHOTOS] = {"a.jpg", "b.jpg", "c.jpg", "d.jpg", "e.jpg", "f.jpg"};

typedef struct set {
    tsuya_view view[2][4];
    tsuya_sparse_model model[2];
    tsuya_photo photo[PHOTOS];
    tsuya_photo_set photos;
    float likeness[PHOTOS * PHOTOS];
    tsuya_pairs pairs;
    tsuya_database_image image[PHOTOS];
    tsuya_database_pair pair[4];
    tsuya_database database;
} set;

/* a b c d | d e f: d stands in both. */
static void set_create(set *s)
{
    memset(s, 0, sizeof *s);
    for (int i = 0; i < PHOTOS; i++) {
        s->photo[i].name = names[i];
        s->image[i] = (tsuya_database_image){.image_id = (uint32_t)i + 1, .name = names[i]};
        for (int k = 0; k < PHOTOS; k++) {
            s->likeness[i * PHOTOS + k] = 1.0f / (1.0f + (float)abs(i - k));
        }
    }
    for (int i = 0; i < 4; i++) {
        s->view[0][i].name = names[i];
        s->view[1][i].name = names[i + 3 < PHOTOS ? i + 3 : 5];
    }
    s->model[0] = (tsuya_sparse_model){.view = s->view[0], .view_count = 4};
    s->model[1] = (tsuya_sparse_model){.view = s->view[1], .view_count = 3};
    s->photos = (tsuya_photo_set){.photo = s->photo, .count = PHOTOS};
    s->pairs = (tsuya_pairs){.photo_count = PHOTOS, .likeness = s->likeness};
    s->database = (tsuya_database){.image = s->image, .image_count = PHOTOS, .pair = s->pair};
}

static tsuya_bridge bridge_of(const set *s)
{
    tsuya_bridge bridge;
    assert_true(tsuya_groups_bridge(&bridge, &s->model[0], &s->model[1], &s->database, &s->pairs, &s->photos));
    return bridge;
}

static void the_likest_of_either_side_are_named(void **state)
{
    (void)state;
    set s;
    set_create(&s);
    tsuya_bridge b = bridge_of(&s);
    assert_string_equal(b.from, "c.jpg");
    assert_string_equal(b.to, "e.jpg");
    assert_int_equal(b.matches, 0);
}

static void matches_count_before_looks(void **state)
{
    (void)state;
    set s;
    set_create(&s);
    s.pair[0] = (tsuya_database_pair){2, 3, 90}; /* within a model */
    s.pair[1] = (tsuya_database_pair){0, 5, 9};
    s.pair[2] = (tsuya_database_pair){1, 4, 7};
    s.database.pair_count = 3;
    tsuya_bridge b = bridge_of(&s);
    assert_string_equal(b.from, "a.jpg");
    assert_string_equal(b.to, "f.jpg");
    assert_int_equal(b.matches, 9);
}

static void a_model_without_a_photograph_of_its_own_has_no_bridge(void **state)
{
    (void)state;
    set s;
    tsuya_bridge bridge;
    set_create(&s);
    s.model[1].view_count = 1; /* d alone */
    assert_false(tsuya_groups_bridge(&bridge, &s.model[0], &s.model[1], &s.database, &s.pairs, &s.photos));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_likest_of_either_side_are_named),
        cmocka_unit_test(matches_count_before_looks),
        cmocka_unit_test(a_model_without_a_photograph_of_its_own_has_no_bridge),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
