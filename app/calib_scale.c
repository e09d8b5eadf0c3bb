#include "app/calib_scale.h"

#include "calib/detect.h"
#include "calib/edge_bias.h"
#include "core/table.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double MARKED_SIGMA_PX = 0.7; /* of a point marked by hand */
enum { PAIRS_LEAST = 12 }; /* of neighbouring tags, to believe what they say of the edges */
static const double CERTAIN = 3.0;

static tsuya_status take_board(tsuya_calib_scale *s, const tsuya_board *board)
{
    const char **name = tsuya_arena_alloc(s->arena, (size_t)board->plate_count, sizeof *name);
    tsuya_scale_tag *tag = tsuya_arena_alloc(s->arena, (size_t)board->tag_count, sizeof *tag);
    if (!name || !tag) {
        return TSUYA_ERROR_MEMORY;
    }
    for (int k = 0; k < board->plate_count; k++) {
        name[k] = tsuya_arena_printf(s->arena, "%s", board->plate[k].name);
        if (!name[k]) {
            return TSUYA_ERROR_MEMORY;
        }
    }
    for (int t = 0; t < board->tag_count; t++) {
        tag[t] = (tsuya_scale_tag){.id = board->tag[t].id, .plate = board->tag[t].plate};
        for (int c = 0; c < 4; c++) {
            tag[t].corner_m[c] = tsuya_board_corner(board, t, c);
        }
    }
    s->input.tag = tag;
    s->input.tag_count = board->tag_count;
    s->input.plate = name;
    s->input.plate_count = board->plate_count;
    return TSUYA_OK;
}

static int compare_sightings(const void *pa, const void *pb)
{
    const tsuya_scale_sighting *a = pa, *b = pb;
    return a->point != b->point ? (a->point > b->point) - (a->point < b->point) : strcmp(a->photo, b->photo);
}

static tsuya_status take_corners(tsuya_calib_scale *s, const tsuya_corner_set *corners, const tsuya_board *board)
{
    tsuya_scale_sighting *sighting = tsuya_arena_alloc(s->arena, (size_t)corners->count, sizeof *sighting);
    char **name = tsuya_arena_alloc(s->arena, (size_t)corners->photo_count, sizeof *name);
    if (!sighting || !name) {
        return TSUYA_ERROR_MEMORY;
    }
    for (int i = 0; i < corners->photo_count; i++) {
        name[i] = tsuya_arena_printf(s->arena, "%s", corners->photo[i]);
        if (!name[i]) {
            return TSUYA_ERROR_MEMORY;
        }
    }
    for (int i = 0; i < corners->count; i++) {
        const tsuya_corner *c = &corners->corner[i];
        sighting[i] = (tsuya_scale_sighting){name[c->photo], 4 * tsuya_board_find(board, c->tag_id) + c->corner, {c->x_px, c->y_px}, c->sigma_px};
    }
    qsort(sighting, (size_t)corners->count, sizeof *sighting, compare_sightings);
    s->input.sighting = sighting;
    s->input.sighting_count = corners->count;
    return TSUYA_OK;
}

static tsuya_status none_seen(const char *path, const tsuya_board *board, const tsuya_detect_info *info, int photos)
{
    int foreign = 0;
    for (int i = 0; i < photos; i++) {
        foreign += info->report[i].rejected.foreign;
    }
    return tsuya_fail(TSUYA_ERROR_INPUT, "%s: none of its tags (%s, border of %d) is seen in %d photographs%s", path, board->family, board->border_bits,
                      photos, foreign ? "; tags with other ids are: is this the right board file?" : "");
}

/* Tags that look too large or too small beside the distances between them would pull cameras apart that see them from two sides. */
static tsuya_status straighten(tsuya_calib_scale *s, tsuya_corner_set *corners, const tsuya_board *board)
{
    tsuya_edge_bias bias;
    TSUYA_TRY(tsuya_edge_bias_measure(&bias, corners, board));
    if (bias.pairs >= PAIRS_LEAST && fabs(bias.bias) > CERTAIN * bias.sigma) {
        tsuya_edge_bias_remove(corners, bias.bias);
        s->input.edge_bias = bias.bias;
    }
    return TSUYA_OK;
}

static tsuya_status detect(tsuya_calib_scale *s, const tsuya_board *board, const tsuya_photo_set *photos, const tsuya_context *context)
{
    tsuya_corner_set corners;
    tsuya_detect_info info;
    const char **path = tsuya_arena_alloc(s->arena, (size_t)photos->count, sizeof *path);
    if (!path) {
        return TSUYA_ERROR_MEMORY;
    }
    for (int i = 0; i < photos->count; i++) {
        path[i] = photos->photo[i].path;
    }
    TSUYA_TRY(tsuya_detect_photos(&corners, &info, board, path, photos->count, context));
    tsuya_status status = straighten(s, &corners, board);
    status = status != TSUYA_OK ? status : corners.count ? take_corners(s, &corners, board) : none_seen(s->input.source, board, &info, photos->count);
    tsuya_corner_set_free(&corners);
    tsuya_detect_info_free(&info);
    return status;
}

static tsuya_status begin(tsuya_calib_scale *s, const char *source)
{
    *s = (tsuya_calib_scale){0};
    TSUYA_TRY(tsuya_arena_create(&s->arena, 1 << 16));
    s->input.source = tsuya_arena_printf(s->arena, "%s", source);
    return s->input.source ? TSUYA_OK : TSUYA_ERROR_MEMORY;
}

tsuya_status tsuya_calib_scale_from_board(tsuya_calib_scale *s, const char *path, const tsuya_photo_set *photos, const tsuya_context *context)
{
    tsuya_board board;
    TSUYA_TRY(begin(s, path));
    tsuya_status status = tsuya_board_load(&board, path);
    if (status == TSUYA_OK) {
        status = take_board(s, &board);
        if (status == TSUYA_OK) {
            status = detect(s, &board, photos, context);
        }
        tsuya_board_free(&board);
    }
    if (status != TSUYA_OK) {
        tsuya_calib_scale_free(s);
    }
    return status;
}

/* The last word of a text, cut off it; NULL where there is one word alone. */
static char *cut_last(char *text)
{
    size_t end = strlen(text);
    while (end > 0 && text[end - 1] == ' ') {
        text[--end] = '\0';
    }
    char *space = strrchr(text, ' ');
    if (space) {
        *space = '\0';
    }
    return space ? space + 1 : NULL;
}

static bool parse_pixel(bool *seen, tsuya_vec2 *pixel, char *word)
{
    *seen = strcmp(word, "-") != 0;
    char *comma = strchr(word, ',');
    if (!*seen || !comma) {
        return !*seen;
    }
    *comma = '\0';
    return tsuya_parse_number(&pixel->x, word) && tsuya_parse_number(&pixel->y, comma + 1);
}

static const tsuya_photo *find_photo(const tsuya_photo_set *photos, const char *name)
{
    for (int i = 0; i < photos->count; i++) {
        if (strcmp(photos->photo[i].name, name) == 0) {
            return &photos->photo[i];
        }
    }
    return NULL;
}

/* `PHOTO X,Y X,Y`: one or two sightings of the points 2i and 2i + 1. */
static tsuya_status take_mark(tsuya_scale_sighting *sighting, int *count, const tsuya_calib_scale *s, const char *mark, int point,
                              const tsuya_photo_set *photos)
{
    char *text = tsuya_arena_printf(s->arena, "%s", mark), *end[2] = {NULL, NULL};
    tsuya_vec2 pixel[2];
    bool seen[2];
    if (!text) {
        return TSUYA_ERROR_MEMORY;
    }
    end[1] = cut_last(text);
    end[0] = end[1] ? cut_last(text) : NULL;
    if (!end[0] || !parse_pixel(&seen[0], &pixel[0], end[0]) || !parse_pixel(&seen[1], &pixel[1], end[1])) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: '%s' is not a photograph with the pixels of both ends: PHOTO X,Y X,Y ('-' for an end out of sight)",
                          s->input.source, mark);
    }
    const tsuya_photo *photo = find_photo(photos, text);
    if (!photo) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: '%s': '%s' is not one of the photographs", s->input.source, mark, text);
    }
    for (int e = 0; e < 2; e++) {
        if (seen[e] && !(pixel[e].x >= -0.5 && pixel[e].y >= -0.5 && pixel[e].x <= photo->width_px - 0.5 && pixel[e].y <= photo->height_px - 0.5)) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: '%s' lies outside the photograph of %d x %d", s->input.source, mark, photo->width_px, photo->height_px);
        }
        if (seen[e]) {
            sighting[(*count)++] = (tsuya_scale_sighting){photo->name, point + e, pixel[e], MARKED_SIGMA_PX};
        }
    }
    return TSUYA_OK;
}

static tsuya_status take_distance(tsuya_calib_scale *s, tsuya_scale_distance *distance, tsuya_scale_sighting *sighting, const tsuya_yaml_list *list, int i,
                                  const tsuya_photo_set *photos)
{
    const char *const *text = list->item;
    *distance = (tsuya_scale_distance){2 * i, 2 * i + 1, 0.0};
    if (list->count < 3 || !tsuya_parse_number(&distance->distance_m, text[0]) || !(distance->distance_m > 0.0)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: distance %d: needs metres and two photographs or more: [0.3, \"IMG_1.jpg 512,300 1022,310\", \"IMG_2.jpg ...\"]",
                          s->input.source, i + 1);
    }
    for (int k = 1; k < list->count; k++) {
        TSUYA_TRY(take_mark(sighting, &s->input.sighting_count, s, text[k], 2 * i, photos));
    }
    return TSUYA_OK;
}

static tsuya_status take_distances(tsuya_calib_scale *s, const tsuya_yaml_list *distances, const tsuya_photo_set *photos)
{
    const tsuya_yaml_list *list = distances->item;
    int marks = 0;
    for (int i = 0; i < distances->count; i++) {
        marks += list[i].count;
    }
    tsuya_scale_sighting *sighting = tsuya_arena_alloc(s->arena, 2 * (size_t)marks, sizeof *sighting);
    tsuya_scale_distance *distance = tsuya_arena_alloc(s->arena, (size_t)distances->count, sizeof *distance);
    if (!sighting || !distance) {
        return TSUYA_ERROR_MEMORY;
    }
    for (int i = 0; i < distances->count; i++) {
        TSUYA_TRY(take_distance(s, &distance[i], sighting, &list[i], i, photos));
    }
    qsort(sighting, (size_t)s->input.sighting_count, sizeof *sighting, compare_sightings);
    for (int i = 0; i < s->input.sighting_count; i++) { /* the set of photographs may go before the step is run */
        sighting[i].photo = tsuya_arena_printf(s->arena, "%s", sighting[i].photo);
        if (!sighting[i].photo) {
            return TSUYA_ERROR_MEMORY;
        }
    }
    s->input.sighting = sighting;
    s->input.distance = distance;
    s->input.distance_count = distances->count;
    return TSUYA_OK;
}

tsuya_status tsuya_calib_scale_from_distances(tsuya_calib_scale *s, const tsuya_yaml_list *distances, const char *where, const tsuya_photo_set *photos)
{
    TSUYA_TRY(begin(s, where));
    tsuya_status status = take_distances(s, distances, photos);
    if (status != TSUYA_OK) {
        tsuya_calib_scale_free(s);
    }
    return status;
}

tsuya_status tsuya_calib_scale_split(tsuya_yaml_list *list, const char *text, tsuya_arena *arena)
{
    char *copy = tsuya_arena_printf(arena, "%s", text), *rest = copy;
    const char **part = tsuya_arena_alloc(arena, strlen(text) + 1, sizeof *part);
    *list = (tsuya_yaml_list){part, 0};
    if (!copy || !part) {
        return TSUYA_ERROR_MEMORY;
    }
    for (char *at; (at = strsep(&rest, ";"));) {
        at += strspn(at, " ");
        size_t length = strlen(at);
        while (length > 0 && at[length - 1] == ' ') {
            at[--length] = '\0';
        }
        part[list->count++] = at;
    }
    return TSUYA_OK;
}

void tsuya_calib_scale_free(tsuya_calib_scale *s)
{
    tsuya_arena_free(s->arena);
    *s = (tsuya_calib_scale){0};
}
