/* Atomic writes and what is left when they fail, loading, folders, hashes, the lock. */
#include "failures.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>

static int entries(const char *folder)
{
    char command[TEST_PATH + 32];
    snprintf(command, sizeof command, "ls -A '%s' | wc -l", folder);
    FILE *pipe = popen(command, "r");
    int count = -1;
    assert_int_equal(fscanf(pipe, "%d", &count), 1);
    pclose(pipe);
    return count;
}

static void assert_content(const char *path, const char *expected)
{
    char *bytes;
    size_t size;
    assert_ok(tsuya_file_load(&bytes, &size, path, 1 << 20));
    assert_int_equal(size, strlen(expected));
    assert_string_equal(bytes, expected);
    tsuya_free(bytes);
}

static const char *fresh_folder(void)
{
    const char *folder = test_path("files");
    assert_ok(tsuya_folder_remove(folder));
    assert_ok(tsuya_folder_make(folder));
    return folder;
}

static void test_a_write_is_whole_or_nothing(void **state)
{
    (void)state;
    const char *folder = fresh_folder(), *path = test_path("files/a.txt");
    assert_ok(tsuya_file_write(path, "old", 3));
    tsuya_file_writer writer;
    assert_ok(tsuya_file_begin(&writer, path));
    fputs("new", writer.stream);
    fflush(writer.stream);
    assert_content(path, "old");
    tsuya_file_abort(&writer);
    tsuya_file_abort(&writer);
    assert_content(path, "old");
    assert_int_equal(entries(folder), 1);
    assert_ok(tsuya_file_begin(&writer, path));
    fputs("new", writer.stream);
    assert_ok(tsuya_file_commit(&writer));
    tsuya_file_abort(&writer); /* safe after commit */
    assert_content(path, "new");
    assert_int_equal(entries(folder), 1);
    assert_fails(tsuya_file_begin(&writer, test_path("files/none/a.txt")), "files/none/a.txt: cannot write: No such file");
    assert_fails(tsuya_file_write(test_path("files"), "x", 1), "cannot write"); /* a folder has that name */
    assert_int_equal(entries(folder), 1);
}

static void test_what_a_killed_writer_leaves_is_not_listed(void **state)
{
    (void)state;
    fresh_folder();
    pid_t pid = fork();
    if (pid == 0) {
        tsuya_file_writer writer;
        if (tsuya_file_begin(&writer, test_path("files/photo.jpg")) == TSUYA_OK && fputs("half", writer.stream) >= 0 && fflush(writer.stream) == 0) {
            raise(SIGKILL);
        }
        _exit(1);
    }
    int status, count;
    char **names;
    tsuya_arena *arena;
    assert_int_equal(waitpid(pid, &status, 0), pid);
    assert_true(WIFSIGNALED(status));
    assert_int_equal(entries(test_path("files")), 1);
    assert_ok(tsuya_arena_create(&arena, 1024));
    assert_ok(tsuya_folder_list(&names, &count, test_path("files"), arena));
    assert_int_equal(count, 0);
    tsuya_arena_free(arena);
    char *temporary; /* for libraries that choose the format by the name */
    assert_ok(tsuya_file_temporary_name(&temporary, test_path("files/photo.jpg")));
    assert_string_equal(tsuya_path_extension(temporary), ".jpg");
    tsuya_free(temporary);
}

/* In a child, so that the limit ends with it; SIGXFSZ ignored, writes then fail with EFBIG as they do with ENOSPC. */
static void write_beyond_limit(void)
{
    struct rlimit limit = {4096, 4096};
    static char large[100000];
    signal(SIGXFSZ, SIG_IGN);
    setrlimit(RLIMIT_FSIZE, &limit);
    tsuya_status status = tsuya_file_write(test_path("files/big.bin"), large, sizeof large);
    bool fine = status == TSUYA_ERROR_IO && strstr(tsuya_reason(), "big.bin: cannot write");
    tsuya_file_writer writer;
    fine = fine && tsuya_file_begin(&writer, test_path("files/buffered.bin")) == TSUYA_OK;
    for (int i = 0; fine && i < 10000; i++) {
        fputs("0123456789", writer.stream); /* nobody looks at the results: commit has to */
    }
    fine = fine && tsuya_file_commit(&writer) == TSUYA_ERROR_IO && strstr(tsuya_reason(), "buffered.bin: cannot write");
    _exit(fine ? 0 : 1);
}

static void test_a_full_disk_leaves_nothing(void **state)
{
    (void)state;
    const char *folder = fresh_folder();
    int status;
    pid_t pid = fork();
    if (pid == 0) {
        write_beyond_limit();
    }
    assert_int_equal(waitpid(pid, &status, 0), pid);
    assert_true(WIFEXITED(status) && WEXITSTATUS(status) == 0);
    assert_int_equal(entries(folder), 0);
}

static tsuya_status write_attempt(void *user) { return tsuya_file_write(user, "text", 4); }

static tsuya_status list_attempt(void *user)
{
    tsuya_arena *arena;
    char **names;
    int count;
    TSUYA_TRY(tsuya_arena_create(&arena, 1024));
    tsuya_status status = tsuya_folder_list(&names, &count, user, arena);
    tsuya_hash hash;
    if (status == TSUYA_OK) {
        status = tsuya_hash_folder(&hash, user);
    }
    tsuya_arena_free(arena);
    return status;
}

static void test_failing_memory(void **state)
{
    (void)state;
    const char *folder = fresh_folder();
    assert_int_equal(test_every_allocation(write_attempt, (void *)(uintptr_t)test_path("files/a.txt")), 3);
    assert_int_equal(entries(folder), 1);
    assert_true(test_every_allocation(list_attempt, (void *)(uintptr_t)folder) > 5);
}

static void test_loading_has_limits(void **state)
{
    (void)state;
    fresh_folder();
    char *bytes;
    size_t size;
    assert_ok(tsuya_file_write(test_path("files/a.txt"), "0123456789", 10));
    assert_ok(tsuya_file_load(&bytes, &size, test_path("files/a.txt"), 10));
    assert_int_equal(bytes[10], 0);
    tsuya_free(bytes);
    assert_fails(tsuya_file_load(&bytes, &size, test_path("files/a.txt"), 9), "a.txt: 10 bytes, at most 9 are accepted");
    assert_fails(tsuya_file_load(&bytes, &size, test_path("files/none"), 9), "none: cannot read: No such file");
    assert_fails(tsuya_file_load(&bytes, &size, test_path("files"), 9), "cannot read");
    assert_fails(tsuya_file_load(&bytes, &size, "/dev/zero", 100000), "more than 100000 bytes"); /* no size, no end */
    assert_ok(tsuya_file_write(test_path("files/empty"), "", 0));
    assert_ok(tsuya_file_load(&bytes, &size, test_path("files/empty"), 0));
    assert_int_equal(size, 0);
    tsuya_free(bytes);
}

static void test_paths(void **state)
{
    (void)state;
    static const char *const join[][3] = {{"a", "b", "a/b"}, {"a/", "b", "a/b"}, {"a", "/b", "/b"}, {"", "b", "b"}, {"/", "b", "/b"}};
    for (size_t i = 0; i < sizeof join / sizeof join[0]; i++) {
        char *path = tsuya_path_join(join[i][0], join[i][1]);
        assert_string_equal(path, join[i][2]);
        tsuya_free(path);
    }
    static const char *const folder[][2] = {{"a/b.c", "a"}, {"b.c", "."}, {"/b", "/"}, {"a/b/c", "a/b"}};
    for (size_t i = 0; i < sizeof folder / sizeof folder[0]; i++) {
        char *path = tsuya_path_folder(folder[i][0]);
        assert_string_equal(path, folder[i][1]);
        tsuya_free(path);
    }
    assert_string_equal(tsuya_path_extension("a.b/c.tar.gz"), ".gz");
    assert_string_equal(tsuya_path_extension("a.b/c"), "");
    assert_string_equal(tsuya_path_extension(".hidden"), "");
    assert_string_equal(tsuya_path_name("a/b.c"), "b.c");
}

static void test_folders(void **state)
{
    (void)state;
    fresh_folder();
    assert_ok(tsuya_folder_make(test_path("files/x/y/z")));
    assert_ok(tsuya_folder_make(test_path("files/x/y/z/")));
    assert_ok(tsuya_file_write(test_path("files/x/kept.txt"), "kept", 4));
    assert_fails(tsuya_folder_make(test_path("files/x/kept.txt/below")), "cannot make the folder");
    assert_fails(tsuya_folder_make(test_path("files/x/kept.txt")), "cannot make the folder");
    assert_ok(tsuya_folder_make(test_path("files/gone/deep")));
    assert_int_equal(symlink("../x", test_path("files/gone/link")), 0);
    assert_ok(tsuya_folder_remove(test_path("files/gone")));
    assert_false(tsuya_path_exists(test_path("files/gone")));
    assert_content(test_path("files/x/kept.txt"), "kept"); /* the link was not followed */
    assert_ok(tsuya_folder_remove(test_path("files/gone")));
    assert_int_equal(symlink("x", test_path("files/way")), 0);
    assert_fails(tsuya_folder_remove(test_path("files/way")), "cannot remove");
    assert_true(tsuya_path_is_folder(test_path("files/x")) && !tsuya_path_is_folder(test_path("files/x/kept.txt")));
    char **names;
    int count;
    tsuya_arena *arena;
    assert_ok(tsuya_file_write(test_path("files/x/b"), "", 0));
    assert_ok(tsuya_file_write(test_path("files/x/Z"), "", 0));
    assert_ok(tsuya_file_write(test_path("files/x/.hidden"), "", 0));
    assert_ok(tsuya_arena_create(&arena, 1024));
    assert_ok(tsuya_folder_list(&names, &count, test_path("files/x"), arena));
    assert_int_equal(count, 4);
    static const char *const order[] = {"Z", "b", "kept.txt", "y"};
    for (int i = 0; i < 4; i++) {
        assert_string_equal(names[i], order[i]);
    }
    assert_fails(tsuya_folder_list(&names, &count, test_path("files/none"), arena), "cannot read the folder");
    tsuya_arena_free(arena);
}

static void test_hashes(void **state)
{
    (void)state;
    fresh_folder();
    /* XXH3, 128 bits, seed 0, of nothing and of "a": the reference implementation's own values. */
    assert_string_equal(tsuya_hash_bytes("", 0).hex, "99aa06d3014798d86001c324468d497f");
    assert_string_equal(tsuya_hash_bytes("a", 1).hex, "a96faf705af16834e6c632b61e964e1f");
    tsuya_hash a, b;
    assert_ok(tsuya_folder_make(test_path("files/one/sub")));
    assert_ok(tsuya_folder_make(test_path("files/two/sub")));
    for (int i = 0; i < 2; i++) { /* the same content in another order of making */
        assert_ok(tsuya_file_write(test_path(i ? "files/two/b" : "files/one/a"), i ? "B" : "A", 1));
        assert_ok(tsuya_file_write(test_path(i ? "files/two/a" : "files/one/b"), i ? "A" : "B", 1));
        assert_ok(tsuya_file_write(test_path(i ? "files/two/sub/c" : "files/one/sub/c"), "C", 1));
    }
    assert_ok(tsuya_hash_folder(&a, test_path("files/one")));
    assert_ok(tsuya_hash_folder(&b, test_path("files/two")));
    assert_string_equal(a.hex, b.hex);
    assert_int_equal(rename(test_path("files/two/a"), test_path("files/two/a2")), 0);
    assert_ok(tsuya_hash_folder(&b, test_path("files/two")));
    assert_string_not_equal(a.hex, b.hex);
    assert_int_equal(rename(test_path("files/two/a2"), test_path("files/two/a")), 0);
    assert_ok(tsuya_file_write(test_path("files/two/sub/c"), "c", 1));
    assert_ok(tsuya_hash_folder(&b, test_path("files/two")));
    assert_string_not_equal(a.hex, b.hex);
    tsuya_hasher *hasher; /* parts do not run together */
    assert_ok(tsuya_hasher_create(&hasher));
    tsuya_hasher_add_text(hasher, "ab");
    tsuya_hasher_add_text(hasher, "c");
    a = tsuya_hasher_end(hasher);
    assert_ok(tsuya_hasher_create(&hasher));
    tsuya_hasher_add_text(hasher, "a");
    tsuya_hasher_add_text(hasher, "bc");
    b = tsuya_hasher_end(hasher);
    assert_string_not_equal(a.hex, b.hex);
    assert_fails(tsuya_hash_file(&a, test_path("files/none")), "none: cannot read");
    assert_fails(tsuya_hash_folder(&a, test_path("files/none")), "cannot read the folder");
}

static char note[TSUYA_REASON_SIZE];
static void keep_note(void *user, tsuya_log_level level, const char *line)
{
    (void)user, (void)level;
    snprintf(note, sizeof note, "%s", line);
}

/* A child that takes the lock, says so, and dies as it is told. */
static pid_t holder(const char *folder, int tell[2])
{
    char byte = 'x';
    int ready[2];
    assert_int_equal(pipe(ready) | pipe(tell), 0);
    pid_t pid = fork();
    if (pid == 0) {
        tsuya_lock lock;
        bool fine = tsuya_lock_take(&lock, folder) == TSUYA_OK && write(ready[1], &byte, 1) == 1 && read(tell[0], &byte, 1) == 1;
        if (fine && byte == 'r') {
            tsuya_lock_release(&lock);
        }
        _exit(fine ? 0 : 1);
    }
    assert_int_equal(read(ready[0], &byte, 1), 1);
    close(ready[0]), close(ready[1]);
    return pid;
}

static void test_the_lock(void **state)
{
    (void)state;
    const char *folder = fresh_folder();
    tsuya_lock lock, second;
    int tell[2], status;
    char number[32];
    pid_t pid = holder(folder, tell);
    assert_fails(tsuya_lock_take(&lock, folder), "another tsuya works in this folder");
    snprintf(number, sizeof number, "pid %ld since 20", (long)pid);
    assert_non_null(strstr(tsuya_reason(), number));
    assert_int_equal(write(tell[1], "r", 1), 1);
    assert_int_equal(waitpid(pid, &status, 0), pid);
    tsuya_log_set_sink(keep_note, NULL);
    note[0] = '\0';
    assert_ok(tsuya_lock_take(&lock, folder));
    assert_string_equal(note, ""); /* it was released properly */
    assert_fails(tsuya_lock_take(&second, folder), "another tsuya works");
    tsuya_lock_release(&second);
    tsuya_lock_release(&lock);
    tsuya_lock_release(&lock);
    close(tell[0]), close(tell[1]);
    pid = holder(folder, tell);
    kill(pid, SIGKILL);
    assert_int_equal(waitpid(pid, &status, 0), pid);
    assert_ok(tsuya_lock_take(&lock, folder)); /* stale: taken over, and said */
    assert_non_null(strstr(note, "ended without releasing its lock"));
    tsuya_lock_release(&lock);
    close(tell[0]), close(tell[1]);
    assert_ok(tsuya_file_write(test_path("files/.tsuya.lock"), "\xff\0garbage", 9));
    assert_ok(tsuya_lock_take(&lock, folder));
    tsuya_lock_release(&lock);
    tsuya_log_set_sink(NULL, NULL);
    assert_fails(tsuya_lock_take(&lock, test_path("files/none")), "cannot lock");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_write_is_whole_or_nothing),
        cmocka_unit_test(test_what_a_killed_writer_leaves_is_not_listed),
        cmocka_unit_test(test_a_full_disk_leaves_nothing),
        cmocka_unit_test(test_failing_memory),
        cmocka_unit_test(test_loading_has_limits),
        cmocka_unit_test(test_paths),
        cmocka_unit_test(test_folders),
        cmocka_unit_test(test_hashes),
        cmocka_unit_test(test_the_lock),
    };
    int result = cmocka_run_group_tests(tests, NULL, NULL);
    test_folder_remove();
    return result;
}
