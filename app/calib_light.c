#include "app/calib_light.h"

#include "core/file.h"
#include "core/photo.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { FEWEST_CORNERS = 12, BALL_CORNERS = 8 };
static const double MISFIT = 0.04, EXPONENT_OFF = 0.25, APART_PX = 2.0;

/* What the lamps of one command share: the camera that stands still, and the exposure that radiance is counted from. */
typedef struct common {
    bool there;
    double exposure;
    tsuya_pose camera_from_world;
} common;

/* Balls and the photographs that show them. */
typedef struct balls {
    tsuya_lamp_ball ball[TSUYA_LAMP_BALLS];
    bool *shown; /* ball by ball, one a photograph */
    tsuya_lamp_highlight *highlight;
    int count;
} balls;

/* One lamp. */
typedef struct run {
    const tsuya_calib_light_input *input;
    const tsuya_context *context;
    common *common;
    const char *name;       /* of the lamp; NULL where it is the only one */
    const char *const *given;
    int photo_count;
    tsuya_board board;
    tsuya_camera camera;
    tsuya_color color;
    tsuya_photo_set photos; /* of a folder */
    const char **path;      /* in the order of the corners' names */
    double *exposure;       /* each against the first's */
    int count;
    tsuya_corner_set corners;
    tsuya_detect_info detected;
    tsuya_solve solve;
    tsuya_lamp_readings readings;
    balls balls;
    tsuya_lamp lamp;
} run;

static int compare_names(const void *a, const void *b)
{
    return strcmp(tsuya_path_name(*(const char *const *)a), tsuya_path_name(*(const char *const *)b));
}

static tsuya_status list_photos(run *r)
{
    bool folder = r->photo_count == 1 && tsuya_path_is_folder(r->given[0]);
    if (folder) {
        TSUYA_TRY(tsuya_photo_set_load(&r->photos, r->given[0], NULL));
    }
    r->count = folder ? r->photos.count : r->photo_count;
    r->path = tsuya_calloc((size_t)r->count, sizeof *r->path);
    r->exposure = tsuya_calloc((size_t)r->count, sizeof *r->exposure);
    if (!r->path || !r->exposure) {
        return TSUYA_ERROR_MEMORY;
    }
    for (int i = 0; i < r->count; i++) {
        r->path[i] = folder ? r->photos.photo[i].path : r->given[i];
    }
    qsort(r->path, (size_t)r->count, sizeof *r->path, compare_names);
    return TSUYA_OK;
}

/* Exposures by EXIF against the very first photograph's, where all have it; otherwise they are taken to be one. */
static tsuya_status read_exposures(run *r)
{
    int known = 0;
    for (int i = 0; i < r->count; i++) {
        tsuya_photo photo;
        TSUYA_TRY(tsuya_photo_load(&photo, r->path[i]));
        r->exposure[i] = photo.exposure_s > 0.0 && photo.f_number > 0.0 && photo.iso > 0.0 ? photo.exposure_s * photo.iso / (photo.f_number * photo.f_number) : 0.0;
        known += r->exposure[i] > 0.0;
        tsuya_photo_free(&photo);
    }
    double first = r->common->there ? r->common->exposure : r->exposure[0];
    if (r->common->there && (known == r->count) != (first > 0.0)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "only some of the lamps' photographs tell their exposure in their EXIF; all of them or none are expected");
    }
    r->common->exposure = known == r->count ? first : 0.0;
    for (int i = 0; i < r->count; i++) {
        r->exposure[i] = known == r->count ? r->exposure[i] / first : 1.0;
    }
    if (known && known < r->count) {
        tsuya_warn("%d of %d photographs have no exposure in their EXIF; all are taken to be exposed alike", r->count - known, r->count);
    }
    return TSUYA_OK;
}

static tsuya_status find_plates(run *r)
{
    const tsuya_calib_light_input *in = r->input;
    TSUYA_TRY(tsuya_detect_photos(&r->corners, &r->detected, &r->board, r->path, r->count, r->context));
    if (r->detected.width_px != r->camera.width_px || r->detected.height_px != r->camera.height_px) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s is %d x %d px, %s is for %d x %d; one size is expected", r->path[0], r->detected.width_px, r->detected.height_px,
                          in->camera, r->camera.width_px, r->camera.height_px);
    }
    if (in->color && r->color.vignetting.width_px && (r->color.vignetting.width_px != r->camera.width_px || r->color.vignetting.height_px != r->camera.height_px)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s has the vignetting of %d x %d px, the photographs are %d x %d; one size is expected", in->color,
                          r->color.vignetting.width_px, r->color.vignetting.height_px, r->camera.width_px, r->camera.height_px);
    }
    if (r->corners.count == 0) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: none of its tags is seen in %d photographs; is the plate lit, and its white not clipped?", in->board, r->count);
    }
    TSUYA_TRY(tsuya_solve_create(&r->solve, &r->board, &r->corners, NULL, in->balls ? BALL_CORNERS : FEWEST_CORNERS, r->camera.width_px, r->camera.height_px));
    return tsuya_solve_poses(&r->solve, &r->camera);
}

/* The first plate's view in a photograph; −1 where it is not seen. */
static int reference_view(const run *r, int photo)
{
    for (int v = 0; v < r->solve.view_count; v++) {
        if (r->solve.view[v].photo == photo && r->solve.view[v].plate == 0) {
            return v;
        }
    }
    return -1;
}

/* Camera from world for a view.  Several plates: the first lies still and is the world, in every photograph.  One plate and balls on it: it
 * lies still too.  One plate alone: camera and lamp stand still, the plate is moved, and the world is where it lay in the very first photograph. */
static bool camera_from_world(tsuya_pose *pose, const run *r, int view)
{
    int reference = r->board.plate_count > 1 ? reference_view(r, r->solve.view[view].photo) : view;
    if (reference >= 0) {
        *pose = r->board.plate_count > 1 || r->input->balls ? r->solve.view[reference].camera_from_plate : r->common->camera_from_world;
    }
    return reference >= 0;
}

static tsuya_status load_photo(tsuya_image *photo, const run *r, int i)
{
    TSUYA_TRY(tsuya_check_interrupt());
    TSUYA_TRY(tsuya_image_load(photo, r->path[i]));
    photo->encoding = r->input->linear ? TSUYA_ENCODING_LINEAR : photo->encoding;
    return TSUYA_OK;
}

static tsuya_status read_plates(run *r)
{
    tsuya_status status = TSUYA_OK;
    int lost = 0;
    for (int begin = 0, end; begin < r->solve.view_count && status == TSUYA_OK; begin = end) {
        int photo = r->solve.view[begin].photo;
        tsuya_image image;
        TSUYA_TRY(load_photo(&image, r, photo));
        for (end = begin; end < r->solve.view_count && r->solve.view[end].photo == photo; end++) {
            tsuya_pose camera;
            bool placed = camera_from_world(&camera, r, end);
            lost += !placed;
            if (placed && status == TSUYA_OK) {
                tsuya_pose world = tsuya_pose_compose(tsuya_pose_inverse(camera), r->solve.view[end].camera_from_plate);
                status = tsuya_lamp_read(&r->readings, &image, &r->solve, end, world, r->input->color ? &r->color : NULL, r->exposure[photo]);
            }
        }
        tsuya_image_free(&image);
        tsuya_progress_update(r->context, "light", end, r->solve.view_count, tsuya_path_name(r->path[photo]));
    }
    if (status == TSUYA_OK && lost) {
        tsuya_warn("%d views of plates are left out: plate %s is not in the same photograph", lost, r->board.plate[0].name);
    }
    return status;
}

static void warn_plate(const run *r)
{
    const tsuya_lamp *l = &r->lamp;
    const char *name = r->name ? r->name : "", *stop = r->name ? ": " : "";
    if (l->rms > MISFIT) {
        tsuya_warn("%s%sthe plate's white lies %.1f %% (RMS) off one lamp: look at the residual picture", name, stop, 100.0 * l->rms);
    }
    if (fabs(l->distance_exponent - 2.0) > fmax(EXPONENT_OFF, 3.0 * l->distance_exponent_sigma)) {
        tsuya_warn("%s%sthe light falls with the distance's power %.2f instead of 2: a large lamp, bounced light, or a plate that shines", name, stop, l->distance_exponent);
    }
    if (r->readings.clipped) {
        tsuya_warn("%s%s%d tags are left out, their white is clipped", name, stop, r->readings.clipped);
    }
    if (l->rms_px > APART_PX) {
        tsuya_warn("%s%shighlights lie %.1f px (RMS) off the lamp that the plate's white shows: check the balls' places and diameters", name, stop, l->rms_px);
    }
}

static tsuya_status mark_photo(bool *shown, const run *r, const char *name, size_t length, const char *text)
{
    for (int i = 0; i < r->count; i++) {
        const char *mine = tsuya_path_name(r->path[i]);
        if (strlen(mine) == length && memcmp(mine, name, length) == 0) {
            shown[i] = true;
            return TSUYA_OK;
        }
    }
    return tsuya_fail(TSUYA_ERROR_INPUT, "--ball: '%s': %.*s is none of the photographs", text, (int)length, name);
}

static tsuya_status parse_ball(tsuya_lamp_ball *ball, bool *shown, const run *r, const char *text)
{
    int used = 0;
    double x, y, d;
    if (sscanf(text, " %lf , %lf , %lf %n", &x, &y, &d, &used) != 3 || !(d > 0.0 && d < 1e4 && fabs(x) < 1e5 && fabs(y) < 1e5) || (text[used] && text[used] != ';')) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "--ball: '%s' is not \"X,Y,DIAMETER\" or \"X,Y,DIAMETER; PHOTO PHOTO\", millimetres", text);
    }
    *ball = (tsuya_lamp_ball){1e-3 * x, 1e-3 * y, 1e-3 * d};
    const char *at = text[used] ? text + used + 1 : text + used;
    at += strspn(at, " ");
    for (int i = 0; !*at && i < r->count; i++) {
        shown[i] = true;
    }
    while (*at) {
        size_t length = strcspn(at, " ");
        TSUYA_TRY(mark_photo(shown, r, at, length, text));
        at += length;
        at += strspn(at, " ");
    }
    return TSUYA_OK;
}

/* One photograph's highlights.  A ball that cannot be read is said and left out. */
static tsuya_status read_highlights(balls *b, const run *r, int view)
{
    int photo = r->solve.view[view].photo;
    tsuya_image image;
    TSUYA_TRY(load_photo(&image, r, photo));
    for (int k = 0; k < r->input->balls; k++) {
        tsuya_lamp_highlight *h = &b->highlight[b->count];
        if (!b->shown[k * r->count + photo]) {
            continue;
        }
        for (int i = 0; i < r->input->lamps; i++) {
            h[i] = (tsuya_lamp_highlight){.ball = k, .photo = photo};
        }
        tsuya_status status = tsuya_lamp_ball_find(h, r->input->lamps, &image, tsuya_path_name(r->path[photo]), &r->camera, r->solve.view[view].camera_from_plate, &b->ball[k]);
        if (status == TSUYA_OK) {
            b->count += r->input->lamps;
        } else if (status == TSUYA_ERROR_INPUT) {
            tsuya_warn("%s", tsuya_reason());
        } else {
            tsuya_image_free(&image);
            return status;
        }
    }
    tsuya_image_free(&image);
    return TSUYA_OK;
}

static void set_balls(tsuya_json *figures, const balls *b, const run *r)
{
    tsuya_json *list = tsuya_json_set_array(figures, "balls");
    for (int k = 0; k < r->input->balls; k++) {
        tsuya_json *o = tsuya_json_add_object(list);
        tsuya_json_set_numbers(o, "at_mm", (double[]){1e3 * b->ball[k].x_m, 1e3 * b->ball[k].y_m}, 2);
        tsuya_json_set_number(o, "diameter_mm", 1e3 * b->ball[k].diameter_m);
    }
    list = tsuya_json_set_array(figures, "spots");
    for (int i = 0; i < b->count; i++) {
        const tsuya_lamp_highlight *h = &b->highlight[i];
        tsuya_json *o = tsuya_json_add_object(list);
        tsuya_json_set_text(o, "name", r->corners.photo[h->photo]);
        tsuya_json_set_number(o, "ball", h->ball + 1);
        tsuya_json_set_numbers(o, "pixel", &h->pixel.x, 2);
        tsuya_json_set_numbers(o, "residual_px", &h->residual_px.x, 2);
    }
}

static tsuya_status find_highlights(run *r)
{
    balls *b = &r->balls;
    size_t most = (size_t)r->input->balls * (size_t)r->count;
    b->shown = tsuya_calloc(most, sizeof *b->shown);
    b->highlight = tsuya_calloc(most * (size_t)r->input->lamps, sizeof *b->highlight);
    if (!b->shown || !b->highlight) {
        return TSUYA_ERROR_MEMORY;
    }
    for (int k = 0; k < r->input->balls; k++) {
        TSUYA_TRY(parse_ball(&b->ball[k], b->shown + k * r->count, r, r->input->ball[k]));
    }
    for (int v = 0; v < r->solve.view_count; v++) {
        if (r->solve.view[v].plate == 0) {
            TSUYA_TRY(read_highlights(b, r, v));
        }
    }
    return b->count ? TSUYA_OK : tsuya_fail(TSUYA_ERROR_INPUT, "no photograph shows a highlight in a ball beside the tags of plate %s", r->board.plate[0].name);
}

/* As the fits take them. */
static tsuya_lamp_balls balls_of(run *r) { return (tsuya_lamp_balls){r->balls.ball, r->balls.highlight, r->input->balls, r->balls.count, &r->camera}; }

static tsuya_status estimate(run *r)
{
    const tsuya_calib_light_input *in = r->input;
    tsuya_lamp_options options = tsuya_lamp_options_default();
    if (in->balls) {
        TSUYA_TRY(find_highlights(r));
    }
    tsuya_lamp_balls b = balls_of(r);
    if (in->balls && !in->white) {
        return tsuya_lamp_ball_fit(&r->lamp, &b);
    }
    options.reflectance = in->reflectance;
    options.vignetting_known = in->color && r->color.vignetting.width_px;
    options.balls = in->balls ? &b : NULL;
    TSUYA_TRY(read_plates(r));
    TSUYA_TRY(tsuya_lamp_fit(&r->lamp, &r->readings, &options));
    warn_plate(r);
    return TSUYA_OK;
}

/* The first of 0.1, 0.2, 0.5, 1 … % that holds three RMS, so that a picture shows what is there. */
static double picture_high(const tsuya_lamp *lamp)
{
    static const double step[] = {0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5};
    int i = 0;
    while (i < 8 && step[i] < 3.0 * lamp->rms) {
        i++;
    }
    return step[i];
}

/* Residuals beside light.json: light.png, or light_NAME.png of several lamps. */
static tsuya_status save_picture(tsuya_json *figures, run *r)
{
    const char *file = r->input->file, *name = r->name ? r->name : "";
    tsuya_lamp_balls b = balls_of(r);
    size_t stem = strlen(file) - strlen(tsuya_path_extension(file)), bytes = stem + strlen(name) + 6;
    char *picture = tsuya_calloc(bytes, 1);
    if (!picture) {
        return TSUYA_ERROR_MEMORY;
    }
    snprintf(picture, bytes, "%.*s%s%s.png", (int)stem, file, r->name ? "_" : "", name);
    if (r->readings.count) {
        tsuya_json_set_number(figures, "picture_full", picture_high(&r->lamp));
    }
    tsuya_status status = tsuya_calib_light_picture(picture, &r->readings, r->balls.count ? &b : NULL, r->count, picture_high(&r->lamp));
    tsuya_free(picture);
    return status;
}

/* The very first photograph's plate is the world of a camera that stands still. */
static tsuya_status see_plates(run *r)
{
    TSUYA_TRY(list_photos(r));
    TSUYA_TRY(read_exposures(r));
    TSUYA_TRY(find_plates(r));
    if (!r->common->there) {
        r->common->camera_from_world = r->solve.view[0].camera_from_plate;
    }
    r->common->there = true;
    return TSUYA_OK;
}

static tsuya_status find_lamp(run *r)
{
    TSUYA_TRY(see_plates(r));
    return estimate(r);
}

static void run_free(run *r)
{
    tsuya_lamp_readings_free(&r->readings);
    tsuya_solve_free(&r->solve);
    tsuya_corner_set_free(&r->corners);
    tsuya_detect_info_free(&r->detected);
    tsuya_photo_set_free(&r->photos);
    tsuya_free(r->balls.shown);
    tsuya_free(r->balls.highlight);
    tsuya_free(r->path);
    tsuya_free(r->exposure);
}

/* The reason of a failure, with the lamp's name before it. */
static tsuya_status name_failure(tsuya_status status, const char *name)
{
    char reason[512];
    if (!name || status != TSUYA_ERROR_INPUT) {
        return status;
    }
    snprintf(reason, sizeof reason, "%s", tsuya_reason());
    return tsuya_fail(status, "%s: %s", name, reason);
}

/* A lamp that was found.  `lights`, `lamps`: NULL where there is one lamp only, which is the file itself. */
static tsuya_status tell_lamp(tsuya_json *figures, tsuya_json *lights, tsuya_json *lamps, run *r)
{
    tsuya_json *mine = lamps ? tsuya_json_add_object(lamps) : figures;
    if (lamps) {
        tsuya_json_set_text(mine, "name", r->name);
        tsuya_lamp_add_lights(lights, &r->lamp);
        tsuya_lamp_describe(mine, &r->lamp);
    } else {
        tsuya_lamp_to_json(mine, &r->lamp);
    }
    if (r->balls.count) {
        set_balls(mine, &r->balls, r);
    }
    return save_picture(mine, r);
}

static tsuya_status one_lamp(tsuya_json *figures, tsuya_json *lights, tsuya_json *lamps, run r)
{
    tsuya_status status = name_failure(find_lamp(&r), r.name);
    if (status == TSUYA_OK) {
        status = tell_lamp(figures, lights, lamps, &r);
    }
    run_free(&r);
    return status;
}

/* Lamps that shine at once, told apart in the balls and named by their number. */
static tsuya_status lamps_at_once(tsuya_json *lights, tsuya_json *lamps, run r)
{
    const int count = r.input->lamps;
    tsuya_status status;
    TSUYA_GOTO_DONE(status, see_plates(&r));
    TSUYA_GOTO_DONE(status, find_highlights(&r));
    tsuya_lamp_balls all = balls_of(&r);
    TSUYA_GOTO_DONE(status, tsuya_lamp_balls_sort(&all, count));
    for (int k = 0; k < count; k++) {
        char name[16];
        run one = r;
        snprintf(name, sizeof name, "%d", k + 1);
        one.name = name;
        one.balls.count /= count;
        one.balls.highlight += k * one.balls.count;
        tsuya_lamp_balls own = balls_of(&one);
        TSUYA_GOTO_DONE(status, name_failure(tsuya_lamp_ball_fit(&one.lamp, &own), name));
        TSUYA_GOTO_DONE(status, tell_lamp(NULL, lights, lamps, &one));
    }
done:
    run_free(&r);
    return status;
}

/* Several folders: each has the photographs that one lamp lit alone. */
static tsuya_status check_folders(bool *several, const tsuya_calib_light_input *in)
{
    int folders = 0;
    for (int i = 0; i < in->photo_count; i++) {
        folders += tsuya_path_is_folder(in->photos[i]);
        for (int k = 0; k < i; k++) {
            if (tsuya_path_is_folder(in->photos[i]) && strcmp(tsuya_path_name(in->photos[i]), tsuya_path_name(in->photos[k])) == 0) {
                return tsuya_fail(TSUYA_ERROR_INPUT, "%s and %s have the same name; each folder names a lamp", in->photos[k], in->photos[i]);
            }
        }
    }
    *several = folders > 1 && folders == in->photo_count;
    return folders == 0 || folders == in->photo_count ? TSUYA_OK
                                                      : tsuya_fail(TSUYA_ERROR_INPUT, "%d folders and %d files are given; files, one folder, or a folder for each lamp are expected",
                                                                   folders, in->photo_count - folders);
}

static tsuya_status all_lamps(tsuya_json *figures, run first)
{
    const tsuya_calib_light_input *in = first.input;
    bool several;
    common shared = {0};
    TSUYA_TRY(check_folders(&several, in));
    TSUYA_TRY(tsuya_cameramodel_load(&first.camera, NULL, in->camera));
    if (in->color) {
        TSUYA_TRY(tsuya_color_load(&first.color, in->color));
    }
    first.common = &shared;
    first.given = in->photos;
    first.photo_count = in->photo_count;
    if (!several && in->lamps == 1) {
        return one_lamp(figures, NULL, NULL, first);
    }
    if (several && in->lamps > 1) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "--lamps: %d folders are given, a lamp each; one folder, or files, with lamps that shine at once is expected", in->photo_count);
    }
    tsuya_json_set_text(figures, "format", "tsuya light");
    tsuya_json_set_text(figures, "version", "1.0");
    tsuya_json *lights = tsuya_json_set_array(figures, "lights"), *lamps = tsuya_json_set_array(figures, "lamps");
    if (in->lamps > 1) {
        return lamps_at_once(lights, lamps, first);
    }
    for (int k = 0; k < in->photo_count; k++) {
        run r = first;
        r.name = tsuya_path_name(in->photos[k]);
        r.given = &in->photos[k];
        r.photo_count = 1;
        TSUYA_TRY(one_lamp(figures, lights, lamps, r));
    }
    return TSUYA_OK;
}

tsuya_status tsuya_calib_light(tsuya_json *figures, const tsuya_calib_light_input *input, const tsuya_context *context)
{
    run r = {.input = input, .context = context};
    TSUYA_TRY(tsuya_board_load(&r.board, input->board));
    tsuya_status status = all_lamps(figures, r);
    tsuya_board_free(&r.board);
    return status == TSUYA_OK ? tsuya_json_save(figures, input->file) : status;
}
