/* What every test needs: cmocka with its headers in the right order, the data folder, a folder to write into. */
#ifndef TSUYA_TESTS_SUPPORT_H
#define TSUYA_TESTS_SUPPORT_H

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

#include "core/file.h"
#include "core/status.h"

enum { TEST_PATH = 4096, TEST_SKIPPED = 77 };

/* PATH below the folder of real data (TSUYA_DATA, else the build's default), or NULL where it does not exist.  One of eight
 * buffers that are used in turn. */
static inline const char *test_data(const char *path)
{
    static char buffer[8][TEST_PATH];
    static int turn;
    const char *folder = getenv("TSUYA_DATA");
    char *full = buffer[turn++ % 8];
    snprintf(full, TEST_PATH, "%s/%s", folder && folder[0] ? folder : TSUYA_DATA_DEFAULT, path);
    struct stat status;
    return stat(full, &status) == 0 ? full : NULL;
}

/* A fresh folder for this test process; test_folder_remove takes it away again. */
static inline const char *test_folder(void)
{
    static char folder[TEST_PATH];
    if (!folder[0]) {
        const char *base = getenv("TMPDIR");
        snprintf(folder, sizeof folder, "%s/tsuya-test-XXXXXX", base && base[0] ? base : "/tmp");
        if (!mkdtemp(folder)) {
            perror(folder);
            exit(1);
        }
    }
    return folder;
}

static inline void test_folder_remove(void)
{
    if (tsuya_folder_remove(test_folder()) != TSUYA_OK) {
        fprintf(stderr, "%s\n", tsuya_reason());
    }
}

/* The same as a group's tear-down. */
static inline int test_folder_tear_down(void **state)
{
    (void)state;
    test_folder_remove();
    return 0;
}

/* test_folder()/NAME; one of eight buffers that are used in turn. */
static inline const char *test_path(const char *name)
{
    static char buffer[8][TEST_PATH];
    static int turn;
    char *full = buffer[turn++ % 8];
    snprintf(full, TEST_PATH, "%s/%s", test_folder(), name);
    return full;
}

/* Success, or the reason in the test's output. */
#define assert_ok(expression)                                                         \
    do {                                                                              \
        tsuya_status assert_status_ = (expression);                                   \
        if (assert_status_ != TSUYA_OK) {                                             \
            fail_msg("%s: %s", #expression, tsuya_reason());                          \
        }                                                                             \
    } while (0)

/* Doubles within a tolerance (cmocka's own macro compares floats). */
#define assert_near(value, expected, tolerance)                                       \
    do {                                                                              \
        double near_value_ = (value), near_expected_ = (expected);                    \
        if (!(fabs(near_value_ - near_expected_) <= (tolerance))) {                   \
            fail_msg("%s: %.17g, %.17g was expected", #value, near_value_, near_expected_); \
        }                                                                             \
    } while (0)

/* A failure whose reason contains `part`. */
#define assert_fails(expression, part)                                                \
    do {                                                                              \
        tsuya_status assert_status_ = (expression);                                   \
        if (assert_status_ == TSUYA_OK) {                                             \
            fail_msg("%s: succeeded, a failure with \"%s\" was expected", #expression, part); \
        }                                                                             \
        if (!strstr(tsuya_reason(), part)) {                                          \
            fail_msg("%s: the reason \"%s\" lacks \"%s\"", #expression, tsuya_reason(), part); \
        }                                                                             \
    } while (0)

#endif
