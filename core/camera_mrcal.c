/* mrcal's .cameramodel files: a Python dict literal (mrcal, mrcal/cameramodel.py).  Read here: lensmodel, intrinsics,
 * imagersize, extrinsics (rt_cam_ref: Rodrigues vector and translation); other keys are passed over. */
#include "core/camera.h"

#include "core/file.h"
#include "core/table.h"

#include <stdlib.h>
#include <string.h>

enum { LARGEST_FILE = 256 << 20, MOST_NUMBERS = 4 + 2 * TSUYA_SPLINE_MOST, LONGEST_WORD = 128, DEEPEST = 16 };

typedef struct lens_name {
    const char *name;
    tsuya_lens lens;
    int distortions;
} lens_name;

static const lens_name LENSES[] = {
    {"LENSMODEL_PINHOLE", TSUYA_LENS_PINHOLE, 0}, {"LENSMODEL_OPENCV4", TSUYA_LENS_OPENCV4, 4},
    {"LENSMODEL_OPENCV5", TSUYA_LENS_OPENCV5, 5}, {"LENSMODEL_OPENCV8", TSUYA_LENS_OPENCV8, 8},
    {"LENSMODEL_OPENCV12", TSUYA_LENS_OPENCV12, 12},
};
enum { LENS_COUNT = sizeof LENSES / sizeof LENSES[0] };
static const char SPLINED[] = "LENSMODEL_SPLINED_STEREOGRAPHIC_order=3_Nx=%d_Ny=%d_fov_x_deg=%d";

typedef struct value {
    char text[LONGEST_WORD]; /* of a string */
    double number[MOST_NUMBERS];
    int count; /* −1: not a flat list of numbers */
} value;

static void skip_blank(const char **at)
{
    for (;;) {
        *at += strspn(*at, " \t\r\n,");
        if (**at != '#') {
            return;
        }
        *at += strcspn(*at, "\n");
    }
}

/* A quoted Python string or bytes literal; what does not fit is cut. */
static bool take_string(const char **at, char text[LONGEST_WORD])
{
    if (**at == 'b' || **at == 'r') {
        ++*at;
    }
    char quote = **at;
    if (quote != '\'' && quote != '"') {
        return false;
    }
    size_t used = 0;
    for (++*at; **at && **at != quote; ++*at) {
        if (**at == '\\' && (*at)[1]) {
            ++*at;
        }
        if (used + 1 < LONGEST_WORD) {
            text[used++] = **at;
        }
    }
    text[used] = '\0';
    return *(*at)++ == quote;
}

static bool take_number(const char **at, double *number)
{
    char word[LONGEST_WORD];
    size_t length = strspn(*at, "+-.0123456789eE");
    if (length == 0 || length >= sizeof word) {
        return false;
    }
    memcpy(word, *at, length);
    word[length] = '\0';
    *at += length;
    return tsuya_parse_number(number, word);
}

/* A string, number, word (None, True) or list; nested lists are passed over. */
static bool take_value(const char **at, value *v, int depth)
{
    v->count = 0;
    v->text[0] = '\0';
    skip_blank(at);
    if (**at == '\'' || **at == '"' || (**at == 'b' && ((*at)[1] == '\'' || (*at)[1] == '"'))) {
        v->count = -1;
        return take_string(at, v->text);
    }
    if (**at != '[' && **at != '(') {
        if (strspn(*at, "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ") > 0) {
            *at += strspn(*at, "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ");
            v->count = -1;
            return true;
        }
        v->count = 1;
        return take_number(at, &v->number[0]);
    }
    char close = **at == '[' ? ']' : ')';
    ++*at;
    for (skip_blank(at); **at && **at != close; skip_blank(at)) {
        if (**at == '[' || **at == '(' || v->count < 0 || v->count == MOST_NUMBERS) {
            value inner;
            if (depth == DEEPEST || !take_value(at, &inner, depth + 1)) {
                return false;
            }
            v->count = -1;
        } else if (!take_number(at, &v->number[v->count++])) {
            return false;
        }
    }
    return *(*at)++ == close;
}

typedef struct contents {
    value lens, intrinsics, size, extrinsics;
    bool has_lens, has_intrinsics, has_size, has_extrinsics;
} contents;

static tsuya_status read_contents(contents *c, const char *text, const char *path)
{
    const char *at = text;
    *c = (contents){0};
    skip_blank(&at);
    if (*at++ != '{') {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: not an mrcal camera model: '{' is expected", path);
    }
    for (skip_blank(&at); *at && *at != '}'; skip_blank(&at)) {
        char key[LONGEST_WORD];
        value v;
        bool fine = take_string(&at, key);
        skip_blank(&at);
        fine = fine && *at++ == ':' && take_value(&at, &v, 0);
        if (!fine) {
            int line = 1;
            for (const char *p = text; p < at; p++) {
                line += *p == '\n';
            }
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d: not an mrcal camera model: 'key': value is expected", path, line);
        }
        if (strcmp(key, "lensmodel") == 0 || strcmp(key, "lens_model") == 0) {
            c->lens = v;
            c->has_lens = true;
        } else if (strcmp(key, "intrinsics") == 0) {
            c->intrinsics = v;
            c->has_intrinsics = true;
        } else if (strcmp(key, "imagersize") == 0) {
            c->size = v;
            c->has_size = true;
        } else if (strcmp(key, "extrinsics") == 0 || strcmp(key, "rt_cam_ref") == 0) {
            c->extrinsics = v;
            c->has_extrinsics = true;
        }
    }
    return *at == '}' ? TSUYA_OK : tsuya_fail(TSUYA_ERROR_INPUT, "%s: truncated: the closing '}' is missing", path);
}

/* A splined lens by its name, which must be written as mrcal writes it. */
static bool parse_splined(tsuya_lens_spline *s, const char *name)
{
    char again[LONGEST_WORD];
    if (sscanf(name, SPLINED, &s->nx, &s->ny, &s->fov_x_deg) != 3) {
        return false;
    }
    snprintf(again, sizeof again, SPLINED, s->nx, s->ny, s->fov_x_deg);
    return strcmp(again, name) == 0 && s->nx >= TSUYA_SPLINE_LEAST_SIDE && s->ny >= TSUYA_SPLINE_LEAST_SIDE && s->nx <= TSUYA_SPLINE_MOST / s->ny
        && s->fov_x_deg >= 1 && s->fov_x_deg < 360;
}

/* Which lens, and how many numbers it has beyond the core. */
static tsuya_status find_lens(tsuya_camera *camera, int *more, const contents *c, const char *path)
{
    for (int i = 0; c->has_lens && i < LENS_COUNT; i++) {
        if (strcmp(LENSES[i].name, c->lens.text) == 0) {
            camera->lens = LENSES[i].lens;
            *more = LENSES[i].distortions;
            return TSUYA_OK;
        }
    }
    if (c->has_lens && parse_splined(&camera->spline, c->lens.text)) {
        camera->lens = TSUYA_LENS_SPLINED_STEREOGRAPHIC;
        *more = 2 * camera->spline.nx * camera->spline.ny;
        return TSUYA_OK;
    }
    return tsuya_fail(TSUYA_ERROR_INPUT, "%s: lens model \"%s\"; LENSMODEL_PINHOLE, _OPENCV4, _OPENCV5, _OPENCV8, _OPENCV12 and _SPLINED_STEREOGRAPHIC "
                      "(order=3, Nx and Ny of 4 or more, Nx Ny at most %d) are accepted", path, c->lens.text, TSUYA_SPLINE_MOST);
}

static tsuya_status fill(tsuya_camera *camera, tsuya_pose *pose, const contents *c, const char *path)
{
    int more = 0;
    *camera = (tsuya_camera){0};
    TSUYA_TRY(find_lens(camera, &more, c, path));
    const double *p = c->intrinsics.number, *size = c->size.number;
    if (c->intrinsics.count != 4 + more || !(p[0] > 0.0) || !(p[1] > 0.0)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: intrinsics: %d numbers with positive focal lengths are expected for %s", path, 4 + more, c->lens.text);
    }
    if (c->size.count != 2 || !(size[0] >= 1 && size[0] <= 65535) || !(size[1] >= 1 && size[1] <= 65535)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: imagersize: two numbers in 1 … 65535 are expected", path);
    }
    if (c->has_extrinsics && c->extrinsics.count != 6) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: extrinsics: six numbers (rotation vector, translation) are expected", path);
    }
    camera->width_px = (int)size[0];
    camera->height_px = (int)size[1];
    camera->fx_px = p[0];
    camera->fy_px = p[1];
    camera->cx_px = p[2];
    camera->cy_px = p[3];
    memcpy(camera->lens == TSUYA_LENS_SPLINED_STEREOGRAPHIC ? camera->spline.point : camera->distortion, p + 4, (size_t)more * sizeof *p);
    if (pose) {
        const double *e = c->extrinsics.number;
        *pose = tsuya_pose_identity();
        if (c->has_extrinsics) {
            *pose = (tsuya_pose){tsuya_mat3_from_rodrigues((tsuya_vec3){e[0], e[1], e[2]}), {e[3], e[4], e[5]}};
        }
    }
    return TSUYA_OK;
}

tsuya_status tsuya_cameramodel_load(tsuya_camera *camera, tsuya_pose *camera_from_world, const char *path)
{
    char *text;
    size_t size;
    TSUYA_TRY(tsuya_file_load(&text, &size, path, LARGEST_FILE));
    contents c;
    tsuya_status status = read_contents(&c, text, path);
    if (status == TSUYA_OK) {
        status = fill(camera, camera_from_world, &c, path);
    }
    tsuya_free(text);
    return status;
}

/* COLMAP's names for less are written as the mrcal model that contains them. */
static const lens_name *lens_for(tsuya_lens lens)
{
    if (lens == TSUYA_LENS_SIMPLE_PINHOLE) {
        lens = TSUYA_LENS_PINHOLE;
    } else if (lens == TSUYA_LENS_SIMPLE_RADIAL || lens == TSUYA_LENS_RADIAL) {
        lens = TSUYA_LENS_OPENCV4;
    }
    int i = 0;
    while (i + 1 < LENS_COUNT && LENSES[i].lens != lens) {
        i++;
    }
    return &LENSES[i];
}

void tsuya_cameramodel_lens(char name[TSUYA_LENS_NAME], const tsuya_camera *camera)
{
    if (camera->lens == TSUYA_LENS_SPLINED_STEREOGRAPHIC) {
        snprintf(name, TSUYA_LENS_NAME, SPLINED, camera->spline.nx, camera->spline.ny, camera->spline.fov_x_deg);
    } else {
        snprintf(name, TSUYA_LENS_NAME, "%s", lens_for(camera->lens)->name);
    }
}

tsuya_status tsuya_cameramodel_save(const tsuya_camera *camera, tsuya_pose camera_from_world, const char *path)
{
    const lens_name *lens = lens_for(camera->lens);
    bool splined = camera->lens == TSUYA_LENS_SPLINED_STEREOGRAPHIC;
    const double *more = splined ? camera->spline.point : camera->distortion;
    int count = splined ? 2 * camera->spline.nx * camera->spline.ny : lens->distortions;
    char name[TSUYA_LENS_NAME];
    tsuya_cameramodel_lens(name, camera);
    tsuya_vec3 r = tsuya_rodrigues_from_mat3(camera_from_world.rotation), t = camera_from_world.translation;
    tsuya_file_writer writer;
    TSUYA_TRY(tsuya_file_begin(&writer, path));
    FILE *out = writer.stream;
    fprintf(out, "{\n    'lensmodel':  '%s',\n\n    # fx, fy, cx, cy, %s; pixel (0,0) is the centre of the first pixel\n", name, splined ? "control points" : "distortions");
    fprintf(out, "    'intrinsics': [ %.17g, %.17g, %.17g, %.17g,", camera->fx_px, camera->fy_px, camera->cx_px, camera->cy_px);
    for (int i = 0; i < count; i++) {
        fprintf(out, " %.17g,", more[i]);
    }
    fprintf(out, " ],\n\n    # rt_cam_ref: rotation vector and translation, metres\n");
    fprintf(out, "    'extrinsics': [ %.17g, %.17g, %.17g, %.17g, %.17g, %.17g, ],\n\n", r.x, r.y, r.z, t.x, t.y, t.z);
    fprintf(out, "    'imagersize': [ %d, %d,],\n}\n", camera->width_px, camera->height_px);
    return tsuya_file_commit(&writer);
}
