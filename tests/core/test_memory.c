/* Allocation, its failure hook, and the arena. */
#include "failures.h"

static void test_blocks_are_zeroed_aligned_and_keep_their_contents(void **state)
{
    (void)state;
    static const size_t sizes[] = {0, 1, 63, 64, 65, 4096, 100003};
    for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++) {
        unsigned char *block = tsuya_calloc(sizes[i], 1);
        assert_non_null(block);
        assert_int_equal((uintptr_t)block % 64, 0);
        for (size_t k = 0; k < sizes[i]; k++) {
            assert_int_equal(block[k], 0);
            block[k] = (unsigned char)(k * 7);
        }
        block = tsuya_realloc(block, sizes[i] * 2 + 5, 1);
        assert_non_null(block);
        for (size_t k = 0; k < sizes[i]; k++) {
            assert_int_equal(block[k], (unsigned char)(k * 7));
        }
        block = tsuya_realloc(block, sizes[i] / 2, 1);
        for (size_t k = 0; k < sizes[i] / 2; k++) {
            assert_int_equal(block[k], (unsigned char)(k * 7));
        }
        tsuya_free(block);
    }
    tsuya_free(NULL);
}

static void test_sizes_that_overflow_are_refused(void **state)
{
    (void)state;
    assert_null(tsuya_calloc(SIZE_MAX, 2));
    assert_null(tsuya_calloc(SIZE_MAX / 2 + 1, 1));
    assert_non_null(strstr(tsuya_reason(), "do not fit into memory"));
    char *kept = tsuya_strdup("kept");
    assert_null(tsuya_realloc(kept, SIZE_MAX / 4, 16));
    assert_string_equal(kept, "kept");
    tsuya_free(kept);
}

static tsuya_status make_two(void *user)
{
    (void)user;
    char *a = tsuya_strdup("a"), *b = a ? tsuya_realloc(NULL, 10, 10) : NULL;
    tsuya_free(a);
    tsuya_free(b);
    return a && b ? TSUYA_OK : TSUYA_ERROR_MEMORY;
}

static void test_the_hook_fails_one_allocation(void **state)
{
    (void)state;
    assert_int_equal(test_every_allocation(make_two, NULL), 2);
    (void)tsuya_memory_fail_at(0);
    tsuya_free(tsuya_calloc(1, 1));
    assert_int_equal(tsuya_memory_fail_at(0), 1);
}

static tsuya_status use_arena(void *user)
{
    tsuya_arena *arena;
    (void)user;
    TSUYA_TRY(tsuya_arena_create(&arena, 0));
    tsuya_status status = TSUYA_OK;
    for (int i = 0; status == TSUYA_OK && i < 40; i++) {
        unsigned char *item = tsuya_arena_alloc(arena, 100, (size_t)(i + 1));
        if (!item) {
            status = TSUYA_ERROR_MEMORY;
            break;
        }
        assert_int_equal((uintptr_t)item % 64, 0);
        for (int k = 0; k < 100 * (i + 1); k++) {
            assert_int_equal(item[k], 0);
        }
        memset(item, 0xaa, 100 * (size_t)(i + 1));
    }
    tsuya_arena_free(arena);
    return status;
}

static void test_arena(void **state)
{
    (void)state;
    assert_true(test_every_allocation(use_arena, NULL) > 3);
    tsuya_arena *arena;
    assert_ok(tsuya_arena_create(&arena, 2048));
    char *kept = tsuya_arena_printf(arena, "%s-%d", "kept", 7);
    tsuya_arena_mark mark = tsuya_arena_get_mark(arena);
    char *first = tsuya_arena_alloc(arena, 1, 500);
    for (int round = 0; round < 3; round++) {
        memset(tsuya_arena_alloc(arena, 1, 100000), 0x55, 100000); /* a block of its own, given back by the reset */
        tsuya_arena_reset(arena, mark);
        assert_string_equal(kept, "kept-7");
        char *again = tsuya_arena_alloc(arena, 1, 500);
        assert_ptr_equal(again, first);
        for (int k = 0; k < 500; k++) {
            assert_int_equal(again[k], 0);
        }
        memset(again, 0x77, 500);
    }
    assert_non_null(tsuya_arena_alloc(arena, 0, 8));
    assert_null(tsuya_arena_alloc(arena, SIZE_MAX / 2, 4));
    tsuya_arena_free(arena);
    tsuya_arena_free(NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_blocks_are_zeroed_aligned_and_keep_their_contents),
        cmocka_unit_test(test_sizes_that_overflow_are_refused),
        cmocka_unit_test(test_the_hook_fails_one_allocation),
        cmocka_unit_test(test_arena),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
