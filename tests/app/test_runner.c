/* The runner with stages of its own: what runs again and what does not, what a failure leaves, who is kept out. */
#include "support.h"

#include "app/runner.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>

/* Each stage appends its letter to what the stage before it wrote; stage calib is not needed. */
static int runs[TSUYA_STAGE_COUNT];
static int failing = -1, killed = -1, interrupted = -1, option;
static useconds_t pause_us; /* of every stage, so that a signal finds it at work */
static char input_path[TEST_PATH];

static const char *output_of(const tsuya_job *job, int stage)
{
    return tsuya_job_path(job, "%s/out.txt", tsuya_stages[stage].name);
}

static tsuya_status plan(tsuya_stage_plan *p, const tsuya_stage_run *run, int stage)
{
    static const char *const outputs[] = {"capture/out.txt", "calib/out.txt", "reconstruct/out.txt", "weave/out.txt",
                                          "brdf/out.txt",    "render/out.txt", "report/out.txt"};
    if (stage == 1) {
        p->not_needed = "nothing to do";
        return TSUYA_OK;
    }
    int before = stage == 2 ? 0 : stage - 1;
    TSUYA_TRY(tsuya_stage_input(p, "input", stage == 0 ? input_path : output_of(run->job, before)));
    tsuya_json_set_number(p->options, "option", stage == 3 ? option : 0);
    tsuya_stage_output(p, outputs[stage]);
    return TSUYA_OK;
}

static tsuya_status work(const tsuya_stage_run *run, int stage)
{
    char *text;
    size_t size;
    runs[stage]++;
    usleep(pause_us);
    if (stage == interrupted) {
        tsuya_interrupt();
        TSUYA_TRY(tsuya_check_interrupt());
    }
    if (stage == failing) {
        return tsuya_fail(TSUYA_ERROR_IO, "stage %d: no space left on the disk", stage);
    }
    TSUYA_TRY(tsuya_file_load(&text, &size, stage == 0 ? input_path : output_of(run->job, stage == 2 ? 0 : stage - 1), 4096));
    char result[4096];
    int length = snprintf(result, sizeof result, "%s%c%d", text, 'a' + stage, stage == 3 ? option : 0);
    tsuya_free(text);
    TSUYA_TRY(tsuya_file_write(output_of(run->job, stage), result, (size_t)length));
    if (stage == killed) {
        raise(SIGKILL);
    }
    tsuya_json_set_number(run->figures, "letters", length);
    tsuya_warn("stage %d ran", stage);
    return TSUYA_OK;
}

#define STAGE(i)                                                                                                     \
    static tsuya_status plan##i(tsuya_stage_plan *p, const tsuya_stage_run *run) { return plan(p, run, i); }          \
    static tsuya_status work##i(const tsuya_stage_run *run) { return work(run, i); }
STAGE(0) STAGE(1) STAGE(2) STAGE(3) STAGE(4) STAGE(5) STAGE(6)

const tsuya_stage tsuya_stages[TSUYA_STAGE_COUNT] = {
    {"capture", 1, plan0, work0}, {"calib", 1, plan1, work1}, {"reconstruct", 1, plan2, work2}, {"weave", 1, plan3, work3},
    {"brdf", 1, plan4, work4},    {"render", 1, plan5, work5}, {"report", 1, plan6, work6},
};

static tsuya_job job;
static tsuya_context context;

static tsuya_status run(tsuya_json **result, int from, int to, bool force)
{
    tsuya_runner_options options = {.from = from, .to = to, .force = force};
    memset(runs, 0, sizeof runs);
    *result = tsuya_json_create_object();
    return tsuya_runner_run(*result, &job, &options, &context);
}

static void run_ok(int from, int to, bool force, const char *expected)
{
    tsuya_json *result;
    char ran[TSUYA_STAGE_COUNT + 1] = "";
    assert_ok(run(&result, from, to, force));
    for (int i = 0, n = 0; i < TSUYA_STAGE_COUNT; i++) {
        if (runs[i]) {
            ran[n++] = (char)('a' + i);
        }
    }
    assert_string_equal(ran, expected);
    tsuya_json_free(result);
}

static void write_input(const char *text) { assert_ok(tsuya_file_write(input_path, text, strlen(text))); }

static int begin(void **state)
{
    (void)state;
    snprintf(input_path, sizeof input_path, "%s", test_path("input.txt"));
    assert_ok(tsuya_folder_remove(test_path("job")));
    write_input("x");
    option = 0;
    failing = killed = interrupted = -1;
    pause_us = 0;
    context = tsuya_context_default();
    job = (tsuya_job){.name = "job"};
    assert_ok(tsuya_arena_create(&job.arena, 1 << 16));
    job.folder = tsuya_arena_printf(job.arena, "%s", test_path("job"));
    return 0;
}

static int end(void **state)
{
    (void)state;
    tsuya_arena_free(job.arena);
    return 0;
}

static void test_only_what_changed_runs(void **state)
{
    (void)state;
    run_ok(0, 6, false, "acdefg");
    run_ok(0, 6, false, "");
    option = 1;
    run_ok(0, 6, false, "defg");
    write_input("y");
    run_ok(0, 6, false, "acdefg");
    assert_ok(tsuya_file_write(output_of(&job, 4), "tampered", 8));
    run_ok(0, 6, false, "e"); /* its output is again what the later stages used */
    run_ok(0, 6, true, "acdefg");
}

static void test_ranges(void **state)
{
    (void)state;
    tsuya_json *result;
    run_ok(0, 2, false, "ac");
    assert_fails(run(&result, 4, 6, false), "'weave' is not finished");
    tsuya_json_free(result);
    run_ok(3, 3, false, "d");
    write_input("z");
    run_ok(4, 6, false, "efg"); /* capture is out of date, which is said, and used as it is */
    run_ok(0, 6, false, "acdefg");
}

static void test_dry_run_writes_nothing(void **state)
{
    (void)state;
    tsuya_runner_options options = {.to = 6, .dry_run = true};
    tsuya_json *result = tsuya_json_create_object();
    assert_ok(tsuya_runner_run(result, &job, &options, &context));
    assert_false(tsuya_path_exists(job.folder));
    tsuya_json_free(result);
}

static void test_failure_keeps_what_is_finished(void **state)
{
    (void)state;
    tsuya_json *result;
    failing = 4;
    assert_fails(run(&result, 0, 6, false), "no space left");
    tsuya_json_free(result);
    failing = -1;
    run_ok(0, 6, false, "efg");
}

static void test_kill_keeps_what_is_finished_and_frees_the_folder(void **state)
{
    (void)state;
    tsuya_json *result;
    fflush(NULL);
    pid_t pid = fork();
    if (pid == 0) {
        killed = 3;
        (void)!run(&result, 0, 6, false);
        _exit(0);
    }
    int status;
    assert_int_equal(waitpid(pid, &status, 0), pid);
    assert_true(WIFSIGNALED(status));
    run_ok(0, 6, false, "defg");
    char *text;
    size_t size;
    assert_ok(tsuya_file_load(&text, &size, output_of(&job, 6), 4096));
    assert_string_equal(text, "xa0c0d0e0f0g0");
    tsuya_free(text);
}

static void assert_result(const char *expected)
{
    char *text;
    size_t size;
    assert_ok(tsuya_file_load(&text, &size, output_of(&job, 6), 4096));
    assert_string_equal(text, expected);
    tsuya_free(text);
}

static void test_interruption_keeps_what_is_finished(void **state)
{
    (void)state;
    tsuya_json *result;
    interrupted = 4;
    assert_int_equal(run(&result, 0, 6, false), TSUYA_ERROR_INTERRUPTED);
    tsuya_json_free(result);
    assert_int_equal(runs[3], 1);
    assert_int_equal(run(&result, 0, 6, false), TSUYA_ERROR_INTERRUPTED); /* the wish still stands: nothing is begun */
    tsuya_json_free(result);
    assert_int_equal(runs[4], 0);
    tsuya_interrupt_clear();
    interrupted = -1;
    run_ok(0, 6, false, "efg");
    assert_result("xa0c0d0e0f0g0");
}

/* Killed again and again, wherever it is, the run gets done, and its result is that of one that nobody disturbed. */
static void test_kills_at_any_moment(void **state)
{
    (void)state;
    tsuya_json *result;
    for (int round = 0; round < 25; round++) {
        int status;
        fflush(NULL);
        pid_t pid = fork();
        if (pid == 0) {
            pause_us = 1500;
            (void)!run(&result, 0, 6, false);
            _exit(0);
        }
        usleep((useconds_t)(1000 + tsuya_random_u64(1, 1, (uint64_t)round) % 12000));
        kill(pid, SIGKILL);
        assert_int_equal(waitpid(pid, &status, 0), pid);
    }
    assert_ok(run(&result, 0, 6, false));
    tsuya_json_free(result);
    assert_result("xa0c0d0e0f0g0");
    run_ok(0, 6, false, "");
}

/* In a child whose files may not grow, as on a full disk: one line that names the file, and a folder that works again. */
static void test_a_full_disk(void **state)
{
    (void)state;
    int status;
    tsuya_json *result;
    run_ok(0, 2, false, "ac");
    fflush(NULL);
    pid_t pid = fork();
    if (pid == 0) {
        struct rlimit limit = {100, 100};
        signal(SIGXFSZ, SIG_IGN);
        setrlimit(RLIMIT_FSIZE, &limit);
        bool fine = run(&result, 0, 6, false) == TSUYA_ERROR_IO && strstr(tsuya_reason(), "state.json: cannot write");
        _exit(fine ? 0 : 1);
    }
    assert_int_equal(waitpid(pid, &status, 0), pid);
    assert_int_equal(status, 0);
    run_ok(0, 6, false, "defg");
}

static void test_a_second_program_is_refused(void **state)
{
    (void)state;
    int ready[2], leave[2], status;
    char byte = 0;
    tsuya_json *result;
    assert_ok(tsuya_folder_make(job.folder));
    assert_int_equal(pipe(ready) | pipe(leave), 0);
    fflush(NULL);
    pid_t pid = fork();
    if (pid == 0) {
        tsuya_lock lock;
        int code = tsuya_lock_take(&lock, job.folder) == TSUYA_OK && write(ready[1], &byte, 1) == 1 && read(leave[0], &byte, 1) == 1;
        _exit(code ? 0 : 1);
    }
    assert_int_equal(read(ready[0], &byte, 1), 1);
    assert_int_not_equal(run(&result, 0, 6, false), TSUYA_OK);
    char number[32];
    snprintf(number, sizeof number, "%ld", (long)pid);
    assert_non_null(strstr(tsuya_reason(), number));
    tsuya_json_free(result);
    assert_int_equal(write(leave[1], &byte, 1), 1);
    assert_int_equal(waitpid(pid, &status, 0), pid);
    assert_int_equal(status, 0);
    run_ok(0, 6, false, "acdefg");
    close(ready[0]), close(ready[1]), close(leave[0]), close(leave[1]);
}

static void test_state_says_what_was_done(void **state)
{
    (void)state;
    run_ok(0, 6, false, "acdefg");
    tsuya_json *root;
    double value;
    assert_ok(tsuya_json_load(&root, test_path("job/state.json")));
    const tsuya_json *record = tsuya_json_member(tsuya_json_member(root, "stages"), "weave");
    assert_ok(tsuya_json_get_number(&value, tsuya_json_member(record, "figures"), "letters"));
    assert_float_equal(value, 7.0, 0.0);
    assert_true(tsuya_json_is_text(tsuya_json_member(tsuya_json_member(record, "inputs"), "input")));
    assert_ok(tsuya_json_get_number(&value, record, "seconds"));
    assert_ok(tsuya_json_get_number(&value, record, "peak_mb"));
    assert_true(value > 0.0);
    assert_null(tsuya_json_member(tsuya_json_member(root, "stages"), "calib"));
    tsuya_json_free(root);
    assert_ok(tsuya_file_write(test_path("job/state.json"), "{\"format\": 99, \"stages\": {}}", 28));
    assert_fails(run(&root, 0, 6, false), "newer");
    tsuya_json_free(root);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_only_what_changed_runs, begin, end),
        cmocka_unit_test_setup_teardown(test_ranges, begin, end),
        cmocka_unit_test_setup_teardown(test_dry_run_writes_nothing, begin, end),
        cmocka_unit_test_setup_teardown(test_failure_keeps_what_is_finished, begin, end),
        cmocka_unit_test_setup_teardown(test_kill_keeps_what_is_finished_and_frees_the_folder, begin, end),
        cmocka_unit_test_setup_teardown(test_interruption_keeps_what_is_finished, begin, end),
        cmocka_unit_test_setup_teardown(test_kills_at_any_moment, begin, end),
        cmocka_unit_test_setup_teardown(test_a_full_disk, begin, end),
        cmocka_unit_test_setup_teardown(test_a_second_program_is_refused, begin, end),
        cmocka_unit_test_setup_teardown(test_state_says_what_was_done, begin, end),
    };
    int result = cmocka_run_group_tests(tests, NULL, NULL);
    test_folder_remove();
    return result;
}
