/* Reasons: one line, kept by thread, raised again in another; warnings go to the sink. */
#include "support.h"

#include <errno.h>
#include <pthread.h>

static void test_a_reason_is_one_line(void **state)
{
    (void)state;
    assert_int_equal(tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d", "evil\nname\r\t\x1b[31m.ply", 3), TSUYA_ERROR_INPUT);
    assert_string_equal(tsuya_reason(), "evil name   [31m.ply: line 3");
    char *overlong = malloc(5000);
    memset(overlong, 'x', 4999);
    overlong[4999] = '\0';
    (void)tsuya_fail(TSUYA_ERROR_INPUT, "%s", overlong);
    assert_int_equal(strlen(tsuya_reason()), TSUYA_REASON_SIZE - 1);
    free(overlong);
    (void)tsuya_fail(TSUYA_ERROR_INPUT, "first");
    (void)tsuya_fail(TSUYA_ERROR_IO, "again: %s", tsuya_reason()); /* the argument is the old reason itself */
    assert_string_equal(tsuya_reason(), "again: first");
}

static void test_errno_is_explained(void **state)
{
    (void)state;
    errno = ENOSPC;
    assert_int_equal(tsuya_fail_errno("a.ply", "cannot write"), TSUYA_ERROR_IO);
    assert_string_equal(tsuya_reason(), "a.ply: cannot write: no space left on the disk");
    errno = ENOENT;
    assert_int_equal(tsuya_fail_errno("b", "cannot read"), TSUYA_ERROR_IO);
    assert_string_equal(tsuya_reason(), "b: cannot read: No such file or directory");
    errno = ENOMEM;
    assert_int_equal(tsuya_fail_errno("c", "cannot read"), TSUYA_ERROR_MEMORY);
}

static void *fail_elsewhere(void *user)
{
    (void)user;
    assert_string_equal(tsuya_reason(), "");
    (void)tsuya_fail(TSUYA_ERROR_NUMERIC, "elsewhere");
    return NULL;
}

static void test_a_reason_belongs_to_its_thread(void **state)
{
    (void)state;
    pthread_t thread;
    (void)tsuya_fail(TSUYA_ERROR_INPUT, "here");
    assert_int_equal(pthread_create(&thread, NULL, fail_elsewhere, NULL), 0);
    assert_int_equal(pthread_join(thread, NULL), 0);
    assert_string_equal(tsuya_reason(), "here");
}

static void test_a_parallel_loop_keeps_its_lowest_failure(void **state)
{
    (void)state;
    for (int threads = 1; threads <= 4; threads++) {
        tsuya_failure failure = {0};
        assert_ok(tsuya_failure_raise(&failure));
#pragma omp parallel for num_threads(threads) schedule(dynamic, 1)
        for (int i = 0; i < 64; i++) {
            if (i % 7 == 3) {
                tsuya_status status = tsuya_fail(i == 3 ? TSUYA_ERROR_IO : TSUYA_ERROR_INPUT, "item %d", i);
#pragma omp critical
                tsuya_failure_keep(&failure, (size_t)i, status);
            }
        }
        assert_int_equal(tsuya_failure_raise(&failure), TSUYA_ERROR_IO);
        assert_string_equal(tsuya_reason(), "item 3");
    }
}

static void test_every_status_has_a_name(void **state)
{
    (void)state;
    for (int s = TSUYA_OK; s <= TSUYA_ERROR_INTERRUPTED; s++) {
        assert_string_not_equal(tsuya_status_name((tsuya_status)s), "unknown");
    }
    assert_string_equal(tsuya_status_name((tsuya_status)99), "unknown");
}

static char seen[TSUYA_REASON_SIZE];
static tsuya_log_level seen_level;

static void sink(void *user, tsuya_log_level level, const char *line)
{
    assert_ptr_equal(user, seen);
    seen_level = level;
    snprintf(seen, sizeof seen, "%s", line);
}

static void test_warnings_reach_the_sink(void **state)
{
    (void)state;
    tsuya_warn("dropped, there is no sink");
    tsuya_log_set_sink(sink, seen);
    tsuya_warn("%d\nphotographs", 3);
    assert_string_equal(seen, "3 photographs");
    assert_int_equal(seen_level, TSUYA_LOG_WARNING);
    tsuya_note("passed over");
    assert_int_equal(seen_level, TSUYA_LOG_NOTE);
    tsuya_log_set_sink(NULL, NULL);
    tsuya_note("dropped");
    assert_string_equal(seen, "passed over");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_reason_is_one_line),
        cmocka_unit_test(test_errno_is_explained),
        cmocka_unit_test(test_a_reason_belongs_to_its_thread),
        cmocka_unit_test(test_a_parallel_loop_keeps_its_lowest_failure),
        cmocka_unit_test(test_every_status_has_a_name),
        cmocka_unit_test(test_warnings_reach_the_sink),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
