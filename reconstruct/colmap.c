#include "reconstruct/colmap.h"

#include "core/colmap_lens.h"
#include "core/file.h"
#include "core/process.h"

#include <stdlib.h>

enum { MOST_ARGUMENTS = 64, ARGUMENT_SIZE = 4096 };

static const char *const ENVIRONMENT[] = {"QT_QPA_PLATFORM=offscreen", "OPENBLAS_NUM_THREADS=1", NULL};
/* Features at the lowest row and at the ends of an octave get no descriptor from VLFeat: COLMAP stores what lay in that memory, which
 * changes from run to run.  glibc's malloc fills it with zeros instead (the complement of the value; its thread cache does not). */
static const char *const ZEROED[] = {"QT_QPA_PLATFORM=offscreen", "OPENBLAS_NUM_THREADS=1", "GLIBC_TUNABLES=glibc.malloc.tcache_count=0:glibc.malloc.perturb=255", NULL};

typedef struct command {
    tsuya_colmap *colmap;
    const char *name, *help;
    char argument[MOST_ARGUMENTS][ARGUMENT_SIZE];
    const char *argv[MOST_ARGUMENTS + 1];
    int count;
    const char *missing; /* a needed option that this COLMAP lacks */
    const char *label;   /* of the progress */
    double done, total;
    bool one_processor, zeroed;
    int part; /* its number where several run at once, 0: alone */
    tsuya_line_sink sink; /* NULL: follow */
    void *sink_user;
    char trouble[256]; /* what its database said; COLMAP itself goes on and exits with 0 */
} command;

static void add(command *c, const char *text)
{
    if (c->count < MOST_ARGUMENTS) {
        snprintf(c->argument[c->count], ARGUMENT_SIZE, "%s", text);
        c->argv[c->count] = c->argument[c->count];
        c->count++;
    }
}

static bool has_option(const command *c, const char *option)
{
    size_t length = strlen(option);
    for (const char *at = c->help; (at = strstr(at, option)); at += length) {
        if (at[length] == ' ' || at[length] == '\n' || at[length] == '\0') {
            return true;
        }
    }
    return false;
}

static void set(command *c, const char *option, const char *value)
{
    if (!has_option(c, option)) {
        c->missing = option;
        return;
    }
    add(c, option);
    add(c, value);
}

/* An option that only helps. */
static void set_if_known(command *c, const char *option, const char *value)
{
    if (has_option(c, option)) {
        set(c, option, value);
    }
}

static void set_path(command *c, const char *option, const char *relative)
{
    char path[ARGUMENT_SIZE];
    snprintf(path, sizeof path, "%s/%s", c->colmap->folder, relative);
    set(c, option, path);
}

static void start(command *c)
{
    add(c, "colmap");
    add(c, c->name);
    set_if_known(c, "--random_seed", "1");
}

static tsuya_status begin(command *c, tsuya_colmap *colmap, const char *name, const char *label, char **help)
{
    *c = (command){.colmap = colmap, .name = name, .label = label};
    const char *const ask[] = {"colmap", name, "-h", NULL};
    TSUYA_TRY(tsuya_process_capture(help, NULL, ask, ENVIRONMENT));
    c->help = *help;
    start(c);
    return TSUYA_OK;
}

/* "Processed file [3/40]", "Matching image [3/40]", "Matching block [1/2]", "Registering image #12 (7)", "Undistorting image [3/39]". */
static void follow(void *user, const char *line)
{
    command *c = user;
    int done, total, id;
    const char *bracket = strchr(line, '[');
    if (strncmp(line, "SQLite error", 12) == 0) {
        const char *said = strrchr(line, ':');
        snprintf(c->trouble, sizeof c->trouble, "%.200s", said && said[1] ? said + 2 : line);
        return;
    }
    if (c->sink) {
        c->sink(c->sink_user, line);
        return;
    }
    if (strncmp(line, "Registering image #", 19) == 0 && sscanf(line + 19, "%d (%d)", &id, &done) == 2) {
        c->done = done;
    } else if (bracket && sscanf(bracket, "[%d/%d]", &done, &total) == 2 && total > 0) {
        c->done = done;
        c->total = total;
    } else {
        return;
    }
    tsuya_progress_update(c->colmap->context, c->label, c->done, c->total > c->done ? c->total : c->done, NULL);
}

static tsuya_status finish(command *c)
{
    char log[ARGUMENT_SIZE], part[16];
    snprintf(log, sizeof log, "%s/log", c->colmap->folder);
    TSUYA_TRY(tsuya_folder_make(log));
    snprintf(part, sizeof part, "-%d", c->part);
    snprintf(log, sizeof log, "%s/log/%s%s.txt", c->colmap->folder, c->name, c->part ? part : "");
    if (c->missing) {
        return tsuya_fail(TSUYA_ERROR_UNAVAILABLE, "colmap %s: %s has no option %s; COLMAP 3.8 is known to work", c->name, c->colmap->version, c->missing);
    }
    c->argv[c->count] = NULL;
    tsuya_process_options options = {.log_path = log, .environment = c->zeroed ? ZEROED : ENVIRONMENT, .line = follow, .line_user = c, .one_processor = c->one_processor};
    tsuya_process_info info;
    tsuya_status status = tsuya_process_run(&info, c->argv, &options);
    c->colmap->peak_mb = info.peak_mb > c->colmap->peak_mb ? info.peak_mb : c->colmap->peak_mb;
    if (c->trouble[0] && (status == TSUYA_OK || (status == TSUYA_ERROR_CHILD && info.signal_number == 0))) {
        return tsuya_fail(TSUYA_ERROR_CHILD, "%s/database.db: colmap %s could not use it: %s; is the disk full? (log: %s)", c->colmap->folder, c->name,
                          c->trouble, log);
    }
    return status;
}

static void set_threads(command *c, const char *option)
{
    char text[16];
    snprintf(text, sizeof text, "%d", c->colmap->context->threads);
    set_if_known(c, option, text);
}

tsuya_status tsuya_colmap_create(tsuya_colmap *colmap, const char *folder, const char *photos, const tsuya_context *context)
{
    *colmap = (tsuya_colmap){.folder = folder, .photos = photos, .context = context};
    const char *const ask[] = {"colmap", "help", NULL};
    char *text;
    TSUYA_TRY(tsuya_process_capture(&text, NULL, ask, ENVIRONMENT));
    const char *found = strstr(text, "COLMAP ");
    int length = found ? (int)strcspn(found, "\n-") : 0;
    snprintf(colmap->version, sizeof colmap->version, "%.*s", length > 0 ? length : 6, found ? found : "COLMAP");
    for (size_t end = strlen(colmap->version); end > 0 && colmap->version[end - 1] == ' '; end--) {
        colmap->version[end - 1] = '\0';
    }
    tsuya_free(text);
    return TSUYA_OK;
}

static const char *lens_name(tsuya_lens lens)
{
    for (int i = 0; i < TSUYA_COLMAP_LENS_COUNT; i++) {
        if (tsuya_colmap_lenses[i].lens == lens) {
            return tsuya_colmap_lenses[i].name;
        }
    }
    return "SIMPLE_RADIAL";
}

static tsuya_status set_camera(command *c, const tsuya_camera *camera)
{
    double p[12] = {0};
    char text[512] = "";
    const tsuya_colmap_lens *lens = tsuya_colmap_parameters(p, camera);
    if (!lens) {
        return TSUYA_ERROR_INPUT;
    }
    for (int i = 0; i < lens->parameters; i++) {
        snprintf(text + strlen(text), sizeof text - strlen(text), "%s%.17g", i ? "," : "", p[i]);
    }
    set(c, "--ImageReader.camera_model", lens->name);
    set(c, "--ImageReader.camera_params", text);
    return TSUYA_OK;
}

tsuya_status tsuya_colmap_features(tsuya_colmap *colmap, const char *masks, const tsuya_camera *camera, tsuya_lens lens, int most)
{
    static const char *const LEFT[] = {"database.db", "database.db-shm", "database.db-wal"};
    char *help = NULL, path[ARGUMENT_SIZE], limit[16];
    command *c = tsuya_calloc(1, sizeof *c);
    tsuya_status status = c ? begin(c, colmap, "feature_extractor", "features", &help) : TSUYA_ERROR_MEMORY;
    if (status != TSUYA_OK) {
        goto done;
    }
    for (size_t i = 0; i < sizeof LEFT / sizeof LEFT[0]; i++) {
        snprintf(path, sizeof path, "%s/%s", colmap->folder, LEFT[i]);
        remove(path);
    }
    set_path(c, "--database_path", "database.db");
    set(c, "--image_path", colmap->photos);
    if (masks) {
        set(c, "--ImageReader.mask_path", masks);
    }
    set(c, "--ImageReader.single_camera", "1");
    if (camera) {
        TSUYA_GOTO_DONE(status, set_camera(c, camera));
    } else {
        set(c, "--ImageReader.camera_model", lens_name(lens));
    }
    set(c, "--SiftExtraction.use_gpu", "0");
    set_threads(c, "--SiftExtraction.num_threads");
    snprintf(limit, sizeof limit, "%d", most);
    set(c, "--SiftExtraction.max_num_features", limit);
    c->zeroed = true;
    status = finish(c);
done:
    tsuya_free(help);
    tsuya_free(c);
    return status;
}

/* Pairs seen by all parts together. */
typedef struct verification {
    tsuya_colmap *colmap;
    const char *help;
    int seen, pairs;
} verification;

/* "first.jpg - second.jpg" */
static void follow_pair(void *user, const char *line)
{
    verification *v = user;
    int seen;
    if (strstr(line, " - ")) {
#pragma omp atomic capture
        seen = ++v->seen;
        tsuya_progress_update(v->colmap->context, "verification", seen, v->pairs, NULL);
    }
}

/* Of a pair without geometry all are spent; with a quarter of its matches right, five of them are drawn once in a thousand. */
static const char TRIALS[] = "4000";

static tsuya_status verify_part(verification *v, int part)
{
    char path[64];
    tsuya_colmap own = *v->colmap;
    command *c = tsuya_calloc(1, sizeof *c);
    if (!c) {
        return TSUYA_ERROR_MEMORY;
    }
    *c = (command){.colmap = &own, .name = "matches_importer", .help = v->help, .part = part + 1, .sink = follow_pair, .sink_user = v};
    start(c);
    snprintf(path, sizeof path, "verify/%d.db", part);
    set_path(c, "--database_path", path);
    snprintf(path, sizeof path, "verify/%d.txt", part);
    set_path(c, "--match_list_path", path);
    set(c, "--match_type", "raw");
    set(c, "--SiftMatching.use_gpu", "0");
    set_if_known(c, "--SiftMatching.num_threads", "1");
    set_if_known(c, "--SiftMatching.max_num_trials", TRIALS);
    set_if_known(c, "--TwoViewGeometry.max_num_trials", TRIALS); /* its name from 3.9 on */
    tsuya_status status = finish(c);
    tsuya_free(c);
#pragma omp critical(tsuya_colmap_peak)
    v->colmap->peak_mb = own.peak_mb > v->colmap->peak_mb ? own.peak_mb : v->colmap->peak_mb;
    return status;
}

tsuya_status tsuya_colmap_verify(tsuya_colmap *colmap, int parts, int pairs)
{
    const char *const ask[] = {"colmap", "matches_importer", "-h", NULL};
    char *help;
    tsuya_failure failure = {0};
    TSUYA_TRY(tsuya_process_capture(&help, NULL, ask, ENVIRONMENT));
    verification v = {.colmap = colmap, .help = help, .pairs = pairs};
#pragma omp parallel for schedule(dynamic, 1) num_threads(colmap->context->threads)
    for (int i = 0; i < parts; i++) {
        tsuya_status status = verify_part(&v, i);
        if (status != TSUYA_OK) {
#pragma omp critical(tsuya_colmap_verify)
            tsuya_failure_keep(&failure, (size_t)i, status);
        }
    }
    tsuya_free(help);
    return tsuya_failure_raise(&failure);
}

static void fix_intrinsics(command *c)
{
    set(c, "--Mapper.ba_refine_focal_length", "0");
    set(c, "--Mapper.ba_refine_principal_point", "0");
    set(c, "--Mapper.ba_refine_extra_params", "0");
}

tsuya_status tsuya_colmap_map(tsuya_colmap *colmap, const char *output, bool fixed_intrinsics)
{
    char *help = NULL, path[ARGUMENT_SIZE];
    command *c = tsuya_calloc(1, sizeof *c);
    tsuya_status status = c ? begin(c, colmap, "mapper", "mapping", &help) : TSUYA_ERROR_MEMORY;
    if (status != TSUYA_OK) {
        goto done;
    }
    snprintf(path, sizeof path, "%s/%s", colmap->folder, output);
    TSUYA_GOTO_DONE(status, tsuya_folder_remove(path));
    TSUYA_GOTO_DONE(status, tsuya_folder_make(path));
    set_path(c, "--database_path", "database.db");
    set(c, "--image_path", colmap->photos);
    set(c, "--output_path", path);
    set_if_known(c, "--Mapper.num_threads", "1"); /* its sums depend on the number of threads, and from run to run on their order */
    set_if_known(c, "--Mapper.min_model_size", "3");
    set_if_known(c, "--Mapper.abs_pose_min_num_inliers", "15"); /* not 30: pairs that chance explains are out already */
    if (fixed_intrinsics) {
        fix_intrinsics(c);
    }
    status = finish(c);
done:
    tsuya_free(help);
    tsuya_free(c);
    return status;
}

tsuya_status tsuya_colmap_adjust(tsuya_colmap *colmap, const char *input, const char *output, tsuya_adjust_what what)
{
    char *help = NULL, path[ARGUMENT_SIZE];
    command *c = tsuya_calloc(1, sizeof *c);
    tsuya_status status = c ? begin(c, colmap, "bundle_adjuster", "adjustment", &help) : TSUYA_ERROR_MEMORY;
    if (status != TSUYA_OK) {
        goto done;
    }
    snprintf(path, sizeof path, "%s/%s", colmap->folder, output);
    TSUYA_GOTO_DONE(status, tsuya_folder_make(path));
    set_path(c, "--input_path", input);
    set(c, "--output_path", path);
    set(c, "--BundleAdjustment.refine_focal_length", what >= TSUYA_ADJUST_LENS ? "1" : "0");
    set(c, "--BundleAdjustment.refine_extra_params", what >= TSUYA_ADJUST_LENS ? "1" : "0");
    set(c, "--BundleAdjustment.refine_principal_point", what >= TSUYA_ADJUST_CENTER ? "1" : "0");
    c->one_processor = true;
    status = finish(c);
done:
    tsuya_free(help);
    tsuya_free(c);
    return status;
}

tsuya_status tsuya_colmap_triangulate(tsuya_colmap *colmap, const char *input, const char *output)
{
    char *help = NULL, path[ARGUMENT_SIZE];
    command *c = tsuya_calloc(1, sizeof *c);
    tsuya_status status = c ? begin(c, colmap, "point_triangulator", "triangulation", &help) : TSUYA_ERROR_MEMORY;
    if (status != TSUYA_OK) {
        goto done;
    }
    snprintf(path, sizeof path, "%s/%s", colmap->folder, output);
    TSUYA_GOTO_DONE(status, tsuya_folder_make(path));
    set_path(c, "--database_path", "database.db");
    set(c, "--image_path", colmap->photos);
    set_path(c, "--input_path", input);
    set(c, "--output_path", path);
    set_if_known(c, "--clear_points", "1");
    fix_intrinsics(c);
    set_if_known(c, "--Mapper.num_threads", "1");
    c->one_processor = true; /* its last adjustment takes all that there are */
    status = finish(c);
done:
    tsuya_free(help);
    tsuya_free(c);
    return status;
}

tsuya_status tsuya_colmap_undistort(tsuya_colmap *colmap, const char *input, const char *output, double scale)
{
    char *help = NULL, path[ARGUMENT_SIZE], text[32];
    command *c = tsuya_calloc(1, sizeof *c);
    tsuya_status status = c ? begin(c, colmap, "image_undistorter", "undistortion", &help) : TSUYA_ERROR_MEMORY;
    if (status == TSUYA_OK) {
        snprintf(path, sizeof path, "%s/%s", colmap->folder, output);
        set(c, "--image_path", colmap->photos);
        set_path(c, "--input_path", input);
        set(c, "--output_path", path);
        set(c, "--output_type", "COLMAP");
        if (scale > 0.0) {
            snprintf(text, sizeof text, "%.2f", scale);
            set(c, "--min_scale", text);
            set(c, "--max_scale", text);
        }
        status = finish(c);
    }
    tsuya_free(help);
    tsuya_free(c);
    return status;
}
