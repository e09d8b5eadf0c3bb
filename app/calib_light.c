#include "app/calib_light.h"

#include "core/file.h"
#include "core/photo.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { FEWEST_CORNERS = 12, BALL_CORNERS = 8 };
static const double PICTURE_HIGH = 0.05, MISFIT = 0.04, EXPONENT_OFF = 0.25;

typedef struct run {
    const tsuya_calib_light_input *input;
    const tsuya_context *context;
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
    tsuya_lamp lamp;
} run;

static int compare_names(const void *a, const void *b)
{
    return strcmp(tsuya_path_name(*(const char *const *)a), tsuya_path_name(*(const char *const *)b));
}

static tsuya_status list_photos(run *r)
{
    const tsuya_calib_light_input *in = r->input;
    bool folder = in->photo_count == 1 && tsuya_path_is_folder(in->photos[0]);
    if (folder) {
        TSUYA_TRY(tsuya_photo_set_load(&r->photos, in->photos[0], NULL));
    }
    r->count = folder ? r->photos.count : in->photo_count;
    r->path = tsuya_calloc((size_t)r->count, sizeof *r->path);
    r->exposure = tsuya_calloc((size_t)r->count, sizeof *r->exposure);
    if (!r->path || !r->exposure) {
        return TSUYA_ERROR_MEMORY;
    }
    for (int i = 0; i < r->count; i++) {
        r->path[i] = folder ? r->photos.photo[i].path : in->photos[i];
    }
    qsort(r->path, (size_t)r->count, sizeof *r->path, compare_names);
    return TSUYA_OK;
}

/* Exposures by EXIF, where all photographs have it; otherwise they are taken to be one. */
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
    double first = r->exposure[0];
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

/* World from a view's plate.  Several plates: the first lies still in the world and is in every photograph.  One plate: camera and
 * lamp stand still, the plate is moved, and the world is where it lay in the first photograph. */
static bool world_from_view(tsuya_pose *pose, const run *r, int view)
{
    const tsuya_solve_view *v = &r->solve.view[view];
    int reference = r->board.plate_count > 1 ? reference_view(r, v->photo) : 0;
    if (reference < 0) {
        return false;
    }
    *pose = tsuya_pose_compose(tsuya_pose_inverse(r->solve.view[reference].camera_from_plate), v->camera_from_plate);
    return true;
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
            tsuya_pose world;
            bool placed = world_from_view(&world, r, end);
            lost += !placed;
            if (placed && status == TSUYA_OK) {
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
    if (l->rms > MISFIT) {
        tsuya_warn("the plate's white lies %.1f %% (RMS) off one lamp: look at the residual picture", 100.0 * l->rms);
    }
    if (fabs(l->distance_exponent - 2.0) > fmax(EXPONENT_OFF, 3.0 * l->distance_exponent_sigma)) {
        tsuya_warn("the light falls with the distance's power %.2f instead of 2: a large lamp, bounced light, or a plate that shines", l->distance_exponent);
    }
    if (r->readings.clipped) {
        tsuya_warn("%d tags are left out, their white is clipped", r->readings.clipped);
    }
}

static tsuya_status by_plate(tsuya_json *figures, run *r)
{
    tsuya_lamp_options options = tsuya_lamp_options_default();
    options.reflectance = r->input->reflectance;
    options.vignetting_known = r->input->color && r->color.vignetting.width_px;
    TSUYA_TRY(read_plates(r));
    TSUYA_TRY(tsuya_lamp_fit(&r->lamp, &r->readings, &options));
    warn_plate(r);
    tsuya_lamp_to_json(figures, &r->lamp);
    size_t stem = strlen(r->input->file) - strlen(tsuya_path_extension(r->input->file));
    char *picture = tsuya_calloc(stem + 5, 1);
    if (!picture) {
        return TSUYA_ERROR_MEMORY;
    }
    memcpy(picture, r->input->file, stem);
    memcpy(picture + stem, ".png", 4);
    tsuya_status status = tsuya_calib_light_picture(picture, &r->readings, &r->camera, PICTURE_HIGH);
    tsuya_free(picture);
    return status;
}

/* Balls and the photographs that show them. */
typedef struct balls {
    tsuya_lamp_ball ball[TSUYA_LAMP_BALLS];
    bool *shown; /* ball by ball, one a photograph */
    tsuya_lamp_highlight *highlight;
    int count;
} balls;

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
static tsuya_status read_balls(balls *b, const run *r, int view)
{
    int photo = r->solve.view[view].photo;
    tsuya_image image;
    TSUYA_TRY(load_photo(&image, r, photo));
    for (int k = 0; k < r->input->balls; k++) {
        tsuya_lamp_highlight *h = &b->highlight[b->count];
        if (!b->shown[k * r->count + photo]) {
            continue;
        }
        *h = (tsuya_lamp_highlight){.ball = k, .photo = photo};
        tsuya_status status = tsuya_lamp_ball_find(h, &image, tsuya_path_name(r->path[photo]), &r->camera, r->solve.view[view].camera_from_plate, &b->ball[k]);
        if (status == TSUYA_OK) {
            b->count++;
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

static tsuya_status by_balls(tsuya_json *figures, run *r)
{
    balls b = {0};
    tsuya_status status = TSUYA_OK;
    size_t most = (size_t)r->input->balls * (size_t)r->count;
    TSUYA_NEW(status, b.shown, most);
    TSUYA_NEW(status, b.highlight, most);
    for (int k = 0; k < r->input->balls; k++) {
        TSUYA_GOTO_DONE(status, parse_ball(&b.ball[k], b.shown + k * r->count, r, r->input->ball[k]));
    }
    for (int v = 0; v < r->solve.view_count; v++) {
        if (r->solve.view[v].plate == 0) {
            TSUYA_GOTO_DONE(status, read_balls(&b, r, v));
        }
    }
    if (b.count == 0) {
        status = tsuya_fail(TSUYA_ERROR_INPUT, "no photograph shows a highlight in a ball beside the tags of plate %s", r->board.plate[0].name);
        goto done;
    }
    TSUYA_GOTO_DONE(status, tsuya_lamp_ball_fit(&r->lamp, b.ball, r->input->balls, b.highlight, b.count, &r->camera));
    tsuya_lamp_to_json(figures, &r->lamp);
    set_balls(figures, &b, r);
done:
    tsuya_free(b.shown);
    tsuya_free(b.highlight);
    return status;
}

static tsuya_status work(tsuya_json *figures, run *r)
{
    const tsuya_calib_light_input *in = r->input;
    TSUYA_TRY(tsuya_cameramodel_load(&r->camera, NULL, in->camera));
    if (in->color) {
        TSUYA_TRY(tsuya_color_load(&r->color, in->color));
    }
    TSUYA_TRY(list_photos(r));
    TSUYA_TRY(read_exposures(r));
    TSUYA_TRY(find_plates(r));
    TSUYA_TRY(in->balls ? by_balls(figures, r) : by_plate(figures, r));
    return tsuya_json_save(figures, in->file);
}

tsuya_status tsuya_calib_light(tsuya_json *figures, const tsuya_calib_light_input *input, const tsuya_context *context)
{
    run r = {.input = input, .context = context};
    TSUYA_TRY(tsuya_board_load(&r.board, input->board));
    tsuya_status status = work(figures, &r);
    tsuya_lamp_readings_free(&r.readings);
    tsuya_solve_free(&r.solve);
    tsuya_corner_set_free(&r.corners);
    tsuya_detect_info_free(&r.detected);
    tsuya_photo_set_free(&r.photos);
    tsuya_free(r.path);
    tsuya_free(r.exposure);
    tsuya_board_free(&r.board);
    return status;
}
