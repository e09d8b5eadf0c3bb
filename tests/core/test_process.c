/* Child processes: log, explained ends, environment, and that nobody is left behind. */
#include "failures.h"

#include "core/process.h"

#include <fcntl.h>
#include <pthread.h>
#include <signal.h>
#include <sys/sysinfo.h>
#include <sys/wait.h>

static tsuya_status shell(tsuya_process_info *info, const char *script, const tsuya_process_options *options)
{
    const char *argv[] = {"sh", "-c", script, NULL};
    return tsuya_process_run(info, argv, options);
}

static char lines[4096];
static void keep_line(void *user, const char *line)
{
    size_t used = strlen(lines);
    assert_ptr_equal(user, lines);
    snprintf(lines + used, sizeof lines - used, "%s|", line);
}

static void test_the_log_is_kept(void **state)
{
    (void)state;
    tsuya_process_options options = {.log_path = test_path("log.txt"), .line = keep_line, .line_user = lines};
    tsuya_process_info info;
    char *log;
    size_t size;
    lines[0] = '\0';
    assert_ok(shell(&info, "echo out; echo err >&2; printf 'half\\rwhole'", &options));
    assert_true(info.exit_code == 0 && info.signal_number == 0 && info.seconds > 0 && info.peak_mb > 0);
    assert_string_equal(lines, "out|err|half|whole|");
    assert_ok(shell(NULL, "echo again", &options)); /* appended */
    assert_ok(tsuya_file_load(&log, &size, test_path("log.txt"), 1 << 16));
    assert_non_null(strstr(log, "$ sh -c echo out"));
    assert_non_null(strstr(log, "out\nerr\nhalf\rwhole$ sh -c echo again\nagain\n"));
    tsuya_free(log);
    options.log_path = test_path("none/log.txt");
    assert_fails(shell(NULL, "true", &options), "none/log.txt: cannot write");
}

static void test_ends_are_explained(void **state)
{
    (void)state;
    tsuya_process_info info;
    tsuya_process_options options = {.log_path = test_path("end.txt")};
    assert_int_equal(shell(&info, "echo 'first'; echo 'no features found'; echo; exit 3", &options), TSUYA_ERROR_CHILD);
    assert_int_equal(info.exit_code, 3);
    assert_non_null(strstr(tsuya_reason(), "sh: exited with 3; its last line: no features found (log: "));
    assert_non_null(strstr(tsuya_reason(), "end.txt)"));
    assert_int_equal(shell(&info, "kill -SEGV $$", NULL), TSUYA_ERROR_CHILD);
    assert_true(info.exit_code == -1 && info.signal_number == SIGSEGV);
    assert_string_equal(tsuya_reason(), "sh: ended by signal 11 (Segmentation fault); its last line: none");
    assert_fails(shell(&info, "kill -KILL $$", NULL), "signal 9 (Killed, out of memory?)");
    const char *missing[] = {"tsuya-no-such-program", "x", NULL};
    assert_int_equal(tsuya_process_run(&info, missing, NULL), TSUYA_ERROR_UNAVAILABLE);
    assert_non_null(strstr(tsuya_reason(), "tsuya-no-such-program: program not found"));
    assert_fails(tsuya_process_run(&info, (const char *[]){test_path("end.txt"), NULL}, NULL), "not found"); /* not executable */
    assert_true(tsuya_process_available("sh") && !tsuya_process_available("tsuya-no-such-program"));
    char *path = tsuya_strdup(getenv("PATH"));
    setenv("PATH", "", 1);
    const char *colmap[] = {"colmap", "mapper", NULL};
    assert_int_equal(tsuya_process_run(&info, colmap, NULL), TSUYA_ERROR_UNAVAILABLE);
    assert_string_equal(tsuya_reason(), "colmap: program not found; install Debian's package colmap (make deps)");
    setenv("PATH", path, 1);
    tsuya_free(path);
}

static void test_what_a_child_gets(void **state)
{
    (void)state;
    char *output;
    tsuya_process_info info;
    static const char *const environment[] = {"TSUYA_TEST=new", "QT_QPA_PLATFORM=offscreen", NULL};
    setenv("TSUYA_TEST", "old", 1);
    const char *argv[] = {"sh", "-c", "echo $TSUYA_TEST $QT_QPA_PLATFORM; cat; ls /proc/self/fd | wc -l; exit 5", NULL};
    int extra = open("/dev/null", 0); /* no descriptor of ours is passed on, with or without O_CLOEXEC */
    assert_ok(tsuya_process_capture(&output, &info, argv, environment));
    assert_int_equal(info.exit_code, 5);
    assert_string_equal(output, "new offscreen\n4\n"); /* 0 1 2, and the folder that ls reads */
    tsuya_free(output);
    close(extra);
    tsuya_process_options options = {.working_folder = test_folder(), .line = keep_line, .line_user = lines};
    lines[0] = '\0';
    assert_ok(shell(&info, "basename $(pwd)", &options));
    assert_int_equal(strncmp(lines, tsuya_path_name(test_folder()), strlen(tsuya_path_name(test_folder()))), 0);
    const char *large[] = {"sh", "-c", "head -c 3000000 /dev/zero | tr '\\0' x", NULL};
    assert_ok(tsuya_process_capture(&output, &info, large, NULL));
    assert_int_equal(strlen(output), 1 << 20);
    tsuya_free(output);
}

/* COLMAP asks the C library how many threads to take, whatever processors it may run on. */
static void test_one_processor(void **state)
{
    (void)state;
    static const char *const environment[] = {"ASAN_OPTIONS=verify_asan_link_order=0", NULL};
    char self[TEST_PATH];
    ssize_t length = readlink("/proc/self/exe", self, sizeof self - 1);
    assert_true(length > 0);
    self[length] = '\0';
    const char *argv[] = {self, "count", NULL};
    for (int one = 0; one < 2; one++) {
        char want[64];
        tsuya_process_options options = {.environment = environment, .line = keep_line, .line_user = lines, .one_processor = one};
        snprintf(want, sizeof want, "%d processors|", one ? 1 : get_nprocs());
        lines[0] = '\0';
        assert_ok(tsuya_process_run(NULL, argv, &options));
        assert_string_equal(lines, want);
    }
}

static bool alive(pid_t pid)
{
    char path[64], state = 'Z';
    snprintf(path, sizeof path, "/proc/%ld/stat", (long)pid);
    FILE *file = fopen(path, "r");
    int got = file ? fscanf(file, "%*d (%*[^)]) %c", &state) : 0;
    if (file) {
        fclose(file);
    }
    return got == 1 && state != 'Z' && state != 'X';
}

static bool gone_within(pid_t pid, double seconds)
{
    for (double start = tsuya_clock_s(); tsuya_clock_s() - start < seconds; usleep(20000)) {
        if (!alive(pid)) {
            return true;
        }
    }
    return false;
}

static pid_t pid_in(const char *path)
{
    long pid = 0;
    for (int i = 0; i < 1000 && pid == 0; i++) {
        FILE *file = fopen(path, "r");
        if (file) {
            if (fscanf(file, "%ld\n", &pid) != 1) {
                pid = 0;
            }
            fclose(file);
        }
        usleep(10000);
    }
    assert_true(pid > 0);
    return (pid_t)pid;
}

static void *interrupt_soon(void *path)
{
    (void)pid_in(path);
    tsuya_interrupt();
    return NULL;
}

static void test_an_interruption_ends_the_child_and_its_children(void **state)
{
    (void)state;
    static char one[TEST_PATH], two[TEST_PATH], script[3 * TEST_PATH];
    for (int stubborn = 0; stubborn < 2; stubborn++) { /* the second one does not hear SIGTERM */
        snprintf(one, sizeof one, "%s", test_path("one.pid"));
        snprintf(two, sizeof two, "%s", test_path("two.pid"));
        unlink(one), unlink(two);
        snprintf(script, sizeof script, "%s sleep 60 & echo $! > %s; echo $$ > %s; wait; sleep 60", stubborn ? "trap '' TERM;" : "", two, one);
        pthread_t thread;
        assert_int_equal(pthread_create(&thread, NULL, interrupt_soon, one), 0);
        double start = tsuya_clock_s();
        tsuya_process_info info;
        assert_int_equal(shell(&info, script, NULL), TSUYA_ERROR_INTERRUPTED);
        assert_true(tsuya_clock_s() - start < 20.0);
        assert_int_equal(pthread_join(thread, NULL), 0);
        assert_int_equal(info.signal_number, stubborn ? SIGKILL : SIGTERM);
        assert_true(gone_within(pid_in(one), 5) && gone_within(pid_in(two), 5));
        assert_int_equal(shell(NULL, "true", NULL), TSUYA_ERROR_INTERRUPTED); /* nothing new is begun */
        tsuya_interrupt_clear();
    }
}

static void on_signal(int number)
{
    (void)number;
    tsuya_interrupt();
}

/* A process that runs a child, as the program does. */
static void be_parent(const char *script)
{
    signal(SIGINT, on_signal);
    signal(SIGTERM, on_signal);
    _exit(shell(NULL, script, NULL) == TSUYA_ERROR_INTERRUPTED ? 1 : 9);
}

static void test_no_orphan_whatever_ends_the_parent(void **state)
{
    (void)state;
    if (!tsuya_process_available("setpriv")) {
        skip();
    }
    static const int signals[] = {SIGINT, SIGTERM, SIGKILL, SIGQUIT};
    for (size_t i = 0; i < sizeof signals / sizeof signals[0]; i++) {
        static char path[TEST_PATH], script[2 * TEST_PATH];
        snprintf(path, sizeof path, "%s", test_path("child.pid"));
        unlink(path);
        snprintf(script, sizeof script, "echo $$ > %s; exec sleep 60", path);
        fflush(NULL);
        pid_t parent = fork();
        if (parent == 0) {
            be_parent(script);
        }
        pid_t child = pid_in(path);
        assert_true(alive(child));
        kill(parent, signals[i]);
        int status;
        assert_int_equal(waitpid(parent, &status, 0), parent);
        assert_int_equal(WIFSIGNALED(status), signals[i] == SIGKILL || signals[i] == SIGQUIT);
        assert_true(gone_within(child, 10));
    }
}

/* A grandchild that keeps the pipe open does not keep us. */
static void test_a_daemon_does_not_hold_the_caller(void **state)
{
    (void)state;
    double start = tsuya_clock_s();
    assert_ok(shell(NULL, "sleep 60 & echo started", NULL));
    assert_true(tsuya_clock_s() - start < 30.0);
}

static tsuya_status attempt(void *user)
{
    (void)user;
    char *output;
    tsuya_process_info info;
    TSUYA_TRY(tsuya_process_capture(&output, &info, (const char *[]){"true", NULL}, NULL));
    tsuya_free(output);
    return TSUYA_OK;
}

static void test_failing_memory(void **state)
{
    (void)state;
    assert_int_equal(test_every_allocation(attempt, NULL), 3);
}

int main(int argc, char **argv)
{
    if (argc == 2 && strcmp(argv[1], "count") == 0) {
        printf("%d processors\n", get_nprocs());
        return 0;
    }
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_the_log_is_kept),
        cmocka_unit_test(test_ends_are_explained),
        cmocka_unit_test(test_what_a_child_gets),
        cmocka_unit_test(test_one_processor),
        cmocka_unit_test(test_an_interruption_ends_the_child_and_its_children),
        cmocka_unit_test(test_no_orphan_whatever_ends_the_parent),
        cmocka_unit_test(test_a_daemon_does_not_hold_the_caller),
        cmocka_unit_test(test_failing_memory),
    };
    int result = cmocka_run_group_tests(tests, NULL, NULL);
    test_folder_remove();
    return result;
}
