/* What the tests of readers and writers share: every allocation failing in turn, and files that are cut or damaged. */
#ifndef TSUYA_TESTS_CORE_FAILURES_H
#define TSUYA_TESTS_CORE_FAILURES_H

#include "support.h"

#include "core/context.h"
#include "core/memory.h"

/* An operation from its beginning to its end; frees what it made. */
typedef tsuya_status (*test_attempt)(void *user);

/* Each allocation that `attempt` makes fails in turn; it must say so every time.  Returns how many there were. */
static inline int test_every_allocation(test_attempt attempt, void *user)
{
    for (int n = 1; n < 100000; n++) {
        (void)tsuya_memory_fail_at((uint64_t)n);
        tsuya_status status = attempt(user);
        uint64_t made = tsuya_memory_fail_at(0);
        if (status == TSUYA_OK) {
            assert_true(made < (uint64_t)n); /* one that failed was passed over otherwise */
            return n - 1;
        }
        assert_int_equal(status, TSUYA_ERROR_MEMORY);
        assert_int_not_equal(tsuya_reason()[0], '\0');
    }
    fail_msg("no end of allocations");
    return 0;
}

/* Reads the file at `path` and frees what it got.  Anything but a crash, a sanitizer's word or a status without a reason is
 * right for a damaged file; for a cut one, whatever `cut_may_pass` says. */
typedef tsuya_status (*test_reader)(const char *path);

static inline void test_write(const char *path, const void *bytes, size_t size)
{
    unlink(path); /* ext4 would wait for the disk when a file is cut and written again */
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(bytes, 1, size, file), size);
    assert_int_equal(fclose(file), 0);
}

static inline void test_one_damaged(test_reader read, const char *path, const void *bytes, size_t size)
{
    test_write(path, bytes, size);
    if (read(path) != TSUYA_OK && !strstr(tsuya_reason(), tsuya_path_name(path))) {
        fail_msg("the reason \"%s\" does not name %s", tsuya_reason(), path);
    }
}

/* Cut at every length (at most 400 of them), then `rounds` copies with 1 … 8 bytes changed.  `shortest`: a file cut below
 * this length must be refused. */
static inline void test_damage(test_reader read, const char *path, const char *good, size_t shortest, int rounds)
{
    char *bytes, *copy;
    size_t size;
    assert_ok(tsuya_file_load(&bytes, &size, good, 1 << 24));
    assert_non_null(copy = malloc(size + 1));
    size_t step = size / 400 + 1;
    for (size_t length = 0; length < size; length += step) {
        memcpy(copy, bytes, size);
        test_one_damaged(read, path, copy, length);
        if (length < shortest && read(path) == TSUYA_OK) {
            fail_msg("%s: cut to %zu of %zu bytes, and read", path, length, size);
        }
    }
    for (int round = 0; round < rounds; round++) {
        memcpy(copy, bytes, size);
        int changes = 1 + (int)(tsuya_random_u64(1, (uint64_t)round, 0) % 8);
        for (int k = 0; k < changes; k++) {
            uint64_t random = tsuya_random_u64(2, (uint64_t)round, (uint64_t)k);
            size_t at = (size_t)(random >> 16) % (round % 2 ? size : (size < 256 ? size : 256)); /* half of them in the header */
            uint64_t value = random & 0x100 ? random : random & 0x200 ? 0xff : (uint64_t)copy[at] ^ (1U << (random & 7));
            copy[at] = (char)(value & 0xff);
        }
        test_one_damaged(read, path, copy, size);
    }
    free(copy);
    tsuya_free(bytes);
}

#endif
