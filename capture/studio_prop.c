#include "capture/studio_prop.h"

#include "calib/apriltag_adapter.h"
#include "core/memory.h"
#include "render/frame.h"

#include <math.h>
#include <string.h>

enum { FLOOR_CELLS = 96, SIDES = 96 };
static const double FLOOR_HALF_M = 2.5;
static const float GREY = 0.32f, PAPER = 0.78f, INK = 0.035f;

void tsuya_studio_prop_free(tsuya_studio_prop *p)
{
    tsuya_mesh_free(&p->mesh);
    if (p->print) {
        tsuya_free(p->print->white);
        tsuya_free(p->print->patch);
        tsuya_free(p->print);
    }
    *p = (tsuya_studio_prop){0};
}

static void put(float *to, tsuya_vec3 v)
{
    to[0] = (float)v.x;
    to[1] = (float)v.y;
    to[2] = (float)v.z;
}

/* (columns + 1) × (rows + 1) vertices of a grid; with `closed` the last column is the first again and is left out. */
static tsuya_status grid(tsuya_studio_prop *p, int columns, int rows, bool closed, float albedo)
{
    uint32_t stride = (uint32_t)(closed ? columns : columns + 1);
    *p = (tsuya_studio_prop){.albedo = {albedo, albedo, albedo}};
    TSUYA_TRY(tsuya_mesh_create(&p->mesh, stride * (size_t)(rows + 1), 2 * (size_t)columns * (size_t)rows, TSUYA_MESH_NORMAL));
    uint32_t *t = p->mesh.triangle;
    for (uint32_t j = 0; j < (uint32_t)rows; j++) {
        for (uint32_t i = 0; i < (uint32_t)columns; i++, t += 6) {
            uint32_t a = j * stride + i, b = j * stride + (i + 1) % (closed ? stride : stride + 1);
            memcpy(t, (uint32_t[]){a, b, b + stride, a, b + stride, a + stride}, 6 * sizeof *t);
        }
    }
    return TSUYA_OK;
}

tsuya_status tsuya_studio_prop_floor(tsuya_studio_prop *p, tsuya_vec3 center)
{
    TSUYA_TRY(grid(p, FLOOR_CELLS, FLOOR_CELLS, false, GREY));
    for (size_t v = 0; v < p->mesh.vertex_count; v++) {
        double x = 2.0 * (double)(v % (FLOOR_CELLS + 1)) / FLOOR_CELLS - 1.0, y = 2.0 * (double)(v / (FLOOR_CELLS + 1)) / FLOOR_CELLS - 1.0;
        put(p->mesh.position + 3 * v, tsuya_vec3_add(center, (tsuya_vec3){FLOOR_HALF_M * x * fabs(x), FLOOR_HALF_M * y * fabs(y), 0.0}));
        put(p->mesh.normal + 3 * v, (tsuya_vec3){0, 0, 1});
    }
    return TSUYA_OK;
}

tsuya_status tsuya_studio_prop_revolve(tsuya_studio_prop *p, tsuya_vec3 a, tsuya_vec3 axis, const double (*profile)[2], int count)
{
    tsuya_vec3 x, y;
    tsuya_frame_from_normal(axis, &x, &y);
    TSUYA_TRY(grid(p, SIDES, count - 1, true, GREY));
    for (int row = 0; row < count; row++) {
        int before = row > 0 ? row - 1 : row, after = row + 1 < count ? row + 1 : row;
        double rise = profile[after][0] - profile[before][0], run = profile[after][1] - profile[before][1], length = hypot(rise, run);
        for (int k = 0; k < SIDES; k++) {
            size_t v = (size_t)(row * SIDES + k);
            double phi = 2.0 * M_PI * k / SIDES;
            tsuya_vec3 out = tsuya_vec3_mad(tsuya_vec3_scale(x, cos(phi)), sin(phi), y);
            put(p->mesh.position + 3 * v, tsuya_vec3_mad(tsuya_vec3_mad(a, profile[row][0], axis), profile[row][1], out));
            put(p->mesh.normal + 3 * v, tsuya_vec3_mad(tsuya_vec3_scale(out, rise / length), -run / length, axis));
        }
    }
    return TSUYA_OK;
}

tsuya_status tsuya_studio_prop_plate(tsuya_studio_prop *p, tsuya_pose world_from_plate, tsuya_vec2 low, tsuya_vec2 high, double spacing_m)
{
    int columns = (int)ceil((high.x - low.x) / spacing_m), rows = (int)ceil((high.y - low.y) / spacing_m);
    TSUYA_TRY(grid(p, columns, rows, false, PAPER));
    for (size_t v = 0; v < p->mesh.vertex_count; v++) {
        double x = (double)(v % (size_t)(columns + 1)) / columns, y = (double)(v / (size_t)(columns + 1)) / rows;
        tsuya_vec3 at = {low.x + x * (high.x - low.x), low.y + y * (high.y - low.y), 0.0};
        put(p->mesh.position + 3 * v, tsuya_pose_apply(world_from_plate, at));
        put(p->mesh.normal + 3 * v, tsuya_mat3_apply(world_from_plate.rotation, (tsuya_vec3){0, 0, 1}));
    }
    return TSUYA_OK;
}

static tsuya_status printed(tsuya_studio_prop *p, tsuya_pose world_from_print, int cols, int rows, double size_m, double gap_m)
{
    double width = cols * size_m + (cols - 1) * gap_m, height = rows * size_m + (rows - 1) * gap_m;
    TSUYA_TRY(tsuya_studio_prop_plate(p, world_from_print, (tsuya_vec2){-gap_m, -gap_m}, (tsuya_vec2){width + gap_m, height + gap_m},
                                      fmax(0.02, 0.02 * fmax(width, height))));
    p->print = tsuya_calloc(1, sizeof *p->print);
    if (!p->print) {
        return TSUYA_ERROR_MEMORY;
    }
    *p->print = (tsuya_studio_print){.print_from_world = tsuya_pose_inverse(world_from_print), .paper = PAPER, .ink = INK, .cols = cols,
                                     .rows = rows, .size_m = size_m, .gap_m = gap_m, .width = 1, .border_width = 1};
    return TSUYA_OK;
}

static tsuya_status print_tags(tsuya_studio_print *print, const tsuya_studio_grid *g)
{
    for (int i = 0; i < g->cols * g->rows; i++) {
        tsuya_tag_pattern pattern;
        TSUYA_TRY(tsuya_tag_pattern_create(&pattern, g->family, g->border_bits, g->first_id + i));
        size_t cells = (size_t)pattern.width * (size_t)pattern.width;
        if (!print->white) {
            print->white = tsuya_calloc(cells * (size_t)(g->cols * g->rows), 1);
            print->width = pattern.width;
            print->border_width = pattern.border_width;
        }
        if (print->white) {
            memcpy(print->white + cells * (size_t)i, pattern.white, cells);
        }
        tsuya_tag_pattern_free(&pattern);
        if (!print->white) {
            return TSUYA_ERROR_MEMORY;
        }
    }
    return TSUYA_OK;
}

tsuya_status tsuya_studio_prop_tags(tsuya_studio_prop *p, tsuya_pose world_from_print, const tsuya_studio_grid *g)
{
    tsuya_status status = printed(p, world_from_print, g->cols, g->rows, 1e-3 * g->tag_mm, 1e-3 * g->gap_mm);
    if (status == TSUYA_OK) {
        status = print_tags(p->print, g);
    }
    if (status != TSUYA_OK) {
        tsuya_studio_prop_free(p);
    }
    return status;
}

/* Greys by halves of a stop, then hues in three strengths. */
static void patch_color(float rgb[3], int col, int row)
{
    for (int c = 0; c < 3; c++) {
        double hue = 2.0 * M_PI * (col / 6.0 - c / 3.0), strength = row == 1 ? 0.75 : row == 2 ? 1.0 : 0.6, level = row == 1 ? 0.12 : row == 2 ? 0.28 : 0.5;
        rgb[c] = (float)(row == 0 ? 0.9 * pow(0.5, 0.9 * col) : level * (1.0 - 0.85 * strength * (0.5 - 0.5 * cos(hue))));
    }
}

tsuya_status tsuya_studio_prop_chart(tsuya_studio_prop *p, tsuya_pose world_from_print)
{
    tsuya_status status = printed(p, world_from_print, 6, 4, 0.03, 0.006);
    if (status == TSUYA_OK) {
        p->print->paper = INK;
        p->print->patch = tsuya_calloc(24, sizeof *p->print->patch);
        status = p->print->patch ? TSUYA_OK : TSUYA_ERROR_MEMORY;
    }
    for (int i = 0; status == TSUYA_OK && i < 24; i++) {
        patch_color(p->print->patch[i], i % 6, i / 6);
    }
    if (status != TSUYA_OK) {
        tsuya_studio_prop_free(p);
    }
    return status;
}

/* A stretch along one axis of a print: within one cell of one tag or patch, or (cell −1) of paper. */
typedef struct stretch { int tag, cell; double share; } stretch;
enum { STRETCHES = 32 };

/* Cuts low … high at the edges of cells; `tags`: in this axis.  What is longer than STRETCHES ends with the last. */
static int cut(stretch out[STRETCHES], const tsuya_studio_print *print, int tags, double low, double high)
{
    const double pitch = print->size_m + print->gap_m, cell = print->size_m / print->border_width, rim = 0.5 * (print->width - print->border_width) * cell;
    const double length = high - low;
    int n = 0;
    for (double at = low; n < STRETCHES; n++) {
        const int tag = (int)floor((at + 0.5 * print->gap_m) / pitch), k = (int)floor((at - tag * pitch + rim) / cell);
        const bool on = tag >= 0 && tag < tags && k >= 0 && k < print->width;
        double next = on ? tag * pitch - rim + (k + 1) * cell : k < 0 && tag >= 0 && tag < tags ? tag * pitch - rim : (tag + 1) * pitch - 0.5 * print->gap_m;
        next = n == STRETCHES - 1 || !(next < high) ? high : fmax(next, at + 1e-6 * cell);
        out[n] = (stretch){tag, on ? k : -1, length > 0.0 ? (next - at) / length : 1.0};
        if (next >= high) {
            return n + 1;
        }
        at = next;
    }
    return n;
}

void tsuya_studio_print_at(const tsuya_studio_print *print, tsuya_vec3 p, const double spread_m[2], float rgb[3])
{
    stretch across[STRETCHES], along[STRETCHES];
    const int columns = cut(across, print, print->cols, p.x - 0.5 * spread_m[0], p.x + 0.5 * spread_m[0]);
    const int rows = cut(along, print, print->rows, p.y - 0.5 * spread_m[1], p.y + 0.5 * spread_m[1]);
    rgb[0] = rgb[1] = rgb[2] = 0.0f;
    for (int k = 0; k < columns * rows; k++) {
        const stretch *x = &across[k % columns], *y = &along[k / columns];
        const float paper[3] = {print->paper, print->paper, print->paper}, ink[3] = {print->ink, print->ink, print->ink}, *color = paper;
        if (x->cell >= 0 && y->cell >= 0) {
            const size_t tag = (size_t)(y->tag * print->cols + x->tag), row = (size_t)(print->width - 1 - y->cell);
            color = print->patch ? print->patch[tag] : print->white[(tag * (size_t)print->width + row) * (size_t)print->width + (size_t)x->cell] ? paper : ink;
        }
        for (int c = 0; c < 3; c++) {
            rgb[c] += (float)(x->share * y->share) * color[c];
        }
    }
}
