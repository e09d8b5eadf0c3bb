/* COLMAP's text model files (COLMAP documentation, "Output Format"). */
#include "core/colmap_lens.h"

#include "core/memory.h"

#include <inttypes.h>
#include <stdlib.h>

/* The next line that is no comment and, unless asked for, not empty; NULL at the end. The reader's bytes are cut in place. */
static char *next_line(tsuya_colmap_reader *r, bool empty_too)
{
    while (r->at < r->end) {
        char *line = (char *)(uintptr_t)r->at, *end = memchr(line, '\n', tsuya_colmap_left(r));
        r->at = end ? end + 1 : r->end;
        end = end ? end : (char *)(uintptr_t)r->end;
        *end = '\0';
        if (end > line && end[-1] == '\r') {
            end[-1] = '\0';
        }
        if (line[0] == '#' || (line[0] == '\0' && !empty_too)) {
            continue;
        }
        return line;
    }
    return NULL;
}

/* The next word of a line as a finite number. */
static bool word_number(char **at, double *number)
{
    char *end;
    *number = strtod(*at, &end);
    bool fine = end != *at && isfinite(*number) && (*end == '\0' || *end == ' ' || *end == '\t');
    *at = end;
    return fine;
}

static bool word_id(char **at, int64_t lowest, int64_t highest, int64_t *id)
{
    char *end;
    *id = strtoll(*at, &end, 10);
    bool fine = end != *at && *id >= lowest && *id <= highest && (*end == '\0' || *end == ' ' || *end == '\t');
    *at = end;
    return fine;
}

static bool ends(const char *at)
{
    return at[strspn(at, " \t")] == '\0';
}

static size_t count_lines(const tsuya_colmap_reader *r)
{
    size_t lines = 1;
    for (const char *p = r->at; p < r->end; p++) {
        lines += *p == '\n';
    }
    return lines;
}

tsuya_status tsuya_colmap_cameras_text(tsuya_colmap_reader *r, tsuya_sparse_model *model)
{
    TSUYA_TRY(tsuya_colmap_new_cameras(model, count_lines(r)));
    for (char *line; (line = next_line(r, false));) {
        char *at = line, name[64];
        int length = 0;
        int64_t id, width, height;
        double p[12] = {0};
        const tsuya_colmap_lens *entry = NULL;
        bool fine = word_id(&at, 0, UINT32_MAX, &id) && sscanf(at, " %63s%n", name, &length) == 1;
        for (int e = 0; fine && e < TSUYA_COLMAP_LENS_COUNT; e++) {
            entry = strcmp(tsuya_colmap_lenses[e].name, name) == 0 ? &tsuya_colmap_lenses[e] : entry;
        }
        if (fine && !entry) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: lens model %s; SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV and FULL_OPENCV are "
                              "accepted", r->path, name);
        }
        at += length;
        fine = fine && word_id(&at, 1, LARGEST_SIDE, &width) && word_id(&at, 1, LARGEST_SIDE, &height);
        for (int k = 0; fine && k < entry->parameters; k++) {
            fine = word_number(&at, &p[k]);
        }
        if (!fine || !ends(at)) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: \"%.60s\": ID MODEL WIDTH HEIGHT PARAMETERS expected", r->path, line);
        }
        tsuya_camera *camera = &model->camera[model->camera_count];
        tsuya_colmap_camera(camera, entry, p);
        TSUYA_TRY(tsuya_colmap_check_camera(r, camera, (uint64_t)width, (uint64_t)height));
        camera->width_px = (int)width;
        camera->height_px = (int)height;
        model->camera_id[model->camera_count++] = (uint32_t)id;
    }
    return TSUYA_OK;
}

static tsuya_status read_observations_text(tsuya_colmap_reader *r, tsuya_view *view, char *line)
{
    size_t words = 0;
    for (const char *p = line; *p; p++) {
        words += *p != ' ' && *p != '\t' && (p == line || p[-1] == ' ' || p[-1] == '\t');
    }
    if (words % 3 != 0 || words / 3 > INT32_MAX) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: image %s: its second line holds %zu numbers; triples X Y POINT3D_ID expected", r->path,
                          view->name, words);
    }
    if (!(view->observation = tsuya_calloc(words / 3, sizeof *view->observation))) {
        return TSUYA_ERROR_MEMORY;
    }
    view->observation_count = (int)(words / 3);
    for (int k = 0; k < view->observation_count; k++) {
        double x, y;
        if (!word_number(&line, &x) || !word_number(&line, &y) || !word_id(&line, -1, INT64_MAX, &view->observation[k].point)) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: image %s: observation %d is not X Y POINT3D_ID", r->path, view->name, k);
        }
        view->observation[k].x_px = (float)(x - 0.5);
        view->observation[k].y_px = (float)(y - 0.5);
    }
    return TSUYA_OK;
}

tsuya_status tsuya_colmap_views_text(tsuya_colmap_reader *r, tsuya_sparse_model *model)
{
    if (!(model->view = tsuya_calloc(count_lines(r) / 2 + 1, sizeof *model->view))) {
        return TSUYA_ERROR_MEMORY;
    }
    for (char *line; (line = next_line(r, false));) {
        tsuya_view *view = &model->view[model->view_count];
        char *at = line;
        int64_t id, camera;
        double p[7];
        bool fine = word_id(&at, 0, UINT32_MAX, &id);
        for (int k = 0; fine && k < 7; k++) {
            fine = word_number(&at, &p[k]);
        }
        fine = fine && word_id(&at, 0, UINT32_MAX, &camera);
        at += strspn(at, " \t");
        if (!fine || !at[0] || strlen(at) >= LONGEST_NAME) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: \"%.60s\": IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME expected", r->path, line);
        }
        model->view_count++;
        view->image_id = (uint32_t)id;
        view->camera_id = (uint32_t)camera;
        view->camera_from_world.rotation = tsuya_mat3_from_quaternion((tsuya_quaternion){p[0], p[1], p[2], p[3]});
        view->camera_from_world.translation = (tsuya_vec3){p[4], p[5], p[6]};
        if (!(view->name = tsuya_strdup(at))) {
            return TSUYA_ERROR_MEMORY;
        }
        char *second = next_line(r, true);
        if (second) {
            TSUYA_TRY(read_observations_text(r, view, second));
        }
    }
    return TSUYA_OK;
}

tsuya_status tsuya_colmap_points_text(tsuya_colmap_reader *r, tsuya_sparse_model *model)
{
    if (!(model->point = tsuya_calloc(count_lines(r), sizeof *model->point))) {
        return TSUYA_ERROR_MEMORY;
    }
    for (char *line; (line = next_line(r, false));) {
        tsuya_point *point = &model->point[model->point_count];
        char *at = line;
        int64_t id, color[3] = {0};
        bool fine = word_id(&at, 0, INT64_MAX, &id) && word_number(&at, &point->position.x) && word_number(&at, &point->position.y)
                 && word_number(&at, &point->position.z);
        for (int k = 0; fine && k < 3; k++) {
            fine = word_id(&at, 0, 255, &color[k]);
            point->color[k] = (uint8_t)color[k];
        }
        if (!fine || !word_number(&at, &point->error_px)) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: \"%.60s\": POINT3D_ID X Y Z R G B ERROR TRACK expected", r->path, line);
        }
        model->point_count++;
        point->point_id = (uint64_t)id;
        if (!(point->track = tsuya_calloc(strlen(at) / 4 + 1, sizeof *point->track))) {
            return TSUYA_ERROR_MEMORY;
        }
        while (!ends(at)) {
            int64_t image, observation;
            if (!word_id(&at, 0, INT32_MAX, &image) || !word_id(&at, 0, INT32_MAX, &observation)) {
                return tsuya_fail(TSUYA_ERROR_INPUT, "%s: point %" PRId64 ": its track is not pairs of IMAGE_ID POINT2D_IDX", r->path, id);
            }
            point->track[point->track_count++] = (tsuya_track_element){(int)image, (int)observation};
        }
    }
    return TSUYA_OK;
}
