/* White of tags as a light meter. */
#include "calib/apriltag_adapter.h"
#include "calib/lamp.h"
#include "core/memory.h"

#include <string.h>

enum { FEWEST_CELLS = 3 };
static const double CELL_PX = 6.0, CLIPPED_VALUE = 0.985;

void tsuya_lamp_readings_free(tsuya_lamp_readings *readings)
{
    tsuya_free(readings->reading);
    *readings = (tsuya_lamp_readings){0};
}

static tsuya_status append(tsuya_lamp_readings *r, tsuya_lamp_reading reading)
{
    if (r->count == r->capacity) {
        int capacity = r->capacity ? 2 * r->capacity : 256;
        tsuya_lamp_reading *more = tsuya_realloc(r->reading, (size_t)capacity, sizeof *more);
        if (!more) {
            return TSUYA_ERROR_MEMORY;
        }
        r->reading = more;
        r->capacity = capacity;
    }
    r->reading[r->count++] = reading;
    return TSUYA_OK;
}

typedef struct meter {
    const tsuya_image *photo;
    const tsuya_camera *camera;
    tsuya_pose camera_from_plate;
    const tsuya_board_tag *tag;
    const tsuya_tag_pattern *pattern;
    double cell_px, sum[3], place[2], clipped, pixels;
    int cells;
} meter;

/* A place of the tag, u from its left edge to its right, v from its lower edge up, in edges. */
static tsuya_vec2 on_tag(const tsuya_board_tag *tag, double u, double v)
{
    const tsuya_vec2 *c = tag->corner_m;
    return (tsuya_vec2){(1 - v) * ((1 - u) * c[0].x + u * c[1].x) + v * ((1 - u) * c[3].x + u * c[2].x),
                        (1 - v) * ((1 - u) * c[0].y + u * c[1].y) + v * ((1 - u) * c[3].y + u * c[2].y)};
}

static double linear(const tsuya_image *photo, int x, int y, int channel)
{
    float value = tsuya_image_get(photo, x, y, photo->channels >= 3 ? channel : 0);
    return (double)(photo->encoding == TSUYA_ENCODING_SRGB ? tsuya_srgb_decode(value) : value);
}

/* Mean of the pixels in the middle of a white cell, clear of its edges' blur. */
static void add_cell(meter *m, int column, int row)
{
    tsuya_vec2 q;
    const tsuya_tag_pattern *p = m->pattern;
    double rim = 0.5 * (p->width - p->border_width), u = (column + 0.5 - rim) / p->border_width, v = 1.0 - (row + 0.5 - rim) / p->border_width;
    tsuya_vec2 place = on_tag(m->tag, u, v);
    int reach = (int)fmin(floor(0.5 * m->cell_px - 2.0), floor(0.3 * m->cell_px));
    if (!tsuya_camera_project(m->camera, tsuya_pose_apply(m->camera_from_plate, (tsuya_vec3){place.x, place.y, 0}), &q)) {
        return;
    }
    int x = (int)lround(q.x), y = (int)lround(q.y), n = (2 * reach + 1) * (2 * reach + 1);
    if (x - reach < 0 || y - reach < 0 || x + reach >= m->photo->width_px || y + reach >= m->photo->height_px) {
        return;
    }
    for (int k = 0; k < n; k++) {
        int px = x - reach + k % (2 * reach + 1), py = y - reach + k / (2 * reach + 1);
        bool over = false;
        for (int c = 0; c < 3; c++) {
            m->sum[c] += linear(m->photo, px, py, c) / n;
            over |= tsuya_image_get(m->photo, px, py, m->photo->channels >= 3 ? c : 0) >= (float)CLIPPED_VALUE;
        }
        m->clipped += over;
    }
    m->pixels += n;
    m->place[0] += place.x;
    m->place[1] += place.y;
    m->cells++;
}

/* The tag's corners in the image, and the length of its shortest edge; 0 where it does not project. */
static double outline(tsuya_vec2 q[4], const tsuya_board_tag *tag, const tsuya_camera *camera, tsuya_pose pose)
{
    double shortest = INFINITY;
    for (int c = 0; c < 4; c++) {
        if (!tsuya_camera_project(camera, tsuya_pose_apply(pose, (tsuya_vec3){tag->corner_m[c].x, tag->corner_m[c].y, 0}), &q[c])) {
            return 0.0;
        }
    }
    for (int c = 0; c < 4; c++) {
        shortest = fmin(shortest, hypot(q[c].x - q[(c + 1) % 4].x, q[c].y - q[(c + 1) % 4].y));
    }
    return shortest;
}

static void take_color(double rgb[3], const tsuya_color *color, tsuya_vec2 pixel)
{
    if (color && color->has_matrix) {
        tsuya_vec3 out = tsuya_color_apply(color, rgb, pixel.x, pixel.y);
        rgb[0] = out.x, rgb[1] = out.y, rgb[2] = out.z;
    } else if (color) {
        double light = tsuya_vignetting_at(&color->vignetting, pixel.x, pixel.y);
        for (int c = 0; c < 3; c++) {
            rgb[c] *= color->white_balance[c] / light;
        }
    }
}

static tsuya_status read_tag(tsuya_lamp_readings *r, const tsuya_image *photo, const tsuya_solve *s, int view, int tag, tsuya_pose world_from_plate,
                             const tsuya_color *color, double exposure)
{
    const tsuya_solve_view *v = &s->view[view];
    tsuya_tag_pattern pattern;
    meter m = {.photo = photo, .camera = &s->camera, .camera_from_plate = v->camera_from_plate, .tag = &s->board->tag[tag], .pattern = &pattern};
    tsuya_lamp_reading reading = {.photo = v->photo, .plate = v->plate};
    double edge = reading.size_px = outline(reading.outline_px, m.tag, m.camera, m.camera_from_plate);
    TSUYA_TRY(tsuya_tag_pattern_create(&pattern, s->board->family, s->board->border_bits, s->board->tag[tag].id));
    m.cell_px = edge / pattern.border_width;
    for (int i = 0; m.cell_px >= CELL_PX && i < pattern.width * pattern.width; i++) {
        if (pattern.white[i]) {
            add_cell(&m, i % pattern.width, i / pattern.width);
        }
    }
    tsuya_tag_pattern_free(&pattern);
    r->small += m.cell_px < CELL_PX;
    if (m.cells < FEWEST_CELLS) {
        return TSUYA_OK;
    }
    if (m.clipped > 0.05 * m.pixels) {
        r->clipped++;
        return TSUYA_OK;
    }
    tsuya_vec3 place = {m.place[0] / m.cells, m.place[1] / m.cells, 0};
    if (!tsuya_camera_project(m.camera, tsuya_pose_apply(m.camera_from_plate, place), &reading.pixel)) {
        return TSUYA_OK;
    }
    double dx = reading.pixel.x - 0.5 * (photo->width_px - 1), dy = reading.pixel.y - 0.5 * (photo->height_px - 1);
    reading.radius2 = 4.0 * (dx * dx + dy * dy) / ((double)photo->width_px * photo->width_px + (double)photo->height_px * photo->height_px);
    reading.place_m = (tsuya_vec2){place.x, place.y};
    reading.position_m = tsuya_pose_apply(world_from_plate, place);
    reading.normal = tsuya_mat3_apply(world_from_plate.rotation, (tsuya_vec3){0, 0, 1});
    for (int c = 0; c < 3; c++) {
        reading.rgb[c] = m.sum[c] / m.cells / exposure;
    }
    take_color(reading.rgb, color, reading.pixel);
    return append(r, reading);
}

tsuya_status tsuya_lamp_read(tsuya_lamp_readings *readings, const tsuya_image *photo, const tsuya_solve *solve, int view, tsuya_pose world_from_plate,
                             const tsuya_color *color, double exposure)
{
    const tsuya_solve_view *v = &solve->view[view];
    for (int i = v->first; i < v->first + v->count; i++) {
        int tag = solve->observation[i].tag;
        if (i == v->first || tag != solve->observation[i - 1].tag) {
            TSUYA_TRY(read_tag(readings, photo, solve, view, tag, world_from_plate, color, exposure));
        }
    }
    readings->photos = v->photo + 1 > readings->photos ? v->photo + 1 : readings->photos;
    readings->plates = solve->board->plate_count;
    return TSUYA_OK;
}
