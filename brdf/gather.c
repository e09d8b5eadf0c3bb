#include "brdf/gather_parts.h"

#include "core/memory.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double STEP_EDGES = 3.0; /* depth between neighbouring pixels that is no step: so many pixels' width */

tsuya_gather_options tsuya_gather_options_default(void)
{
    return (tsuya_gather_options){.cell = 0.05, .grazing_deg = 10.0, .alone = 0.8, .clip = 0.98, .fewest_px = 12, .shadow_px = 512, .pattern = true};
}

/* --- the surface's patches: cubes of space, numbered as they are met -------------------------------------------------- */

typedef struct cube_entry { uint64_t key; uint32_t number; bool used; } cube_entry;

static uint64_t cube_key(const tsuya_gather *g, size_t v)
{
    uint64_t key = 0;
    for (int k = 0; k < 3; k++) {
        key = key << 21 | (uint64_t)((long long)floor((double)g->mesh->position[3 * v + (size_t)k] / g->options.patch_m) + (1 << 20));
    }
    return key;
}

static tsuya_status number_patches(tsuya_gather *g)
{
    tsuya_status status = TSUYA_OK;
    cube_entry *table = NULL;
    size_t room = 64;
    while (room < 2 * g->mesh->vertex_count) {
        room *= 2;
    }
    TSUYA_NEW(status, table, room);
    for (size_t v = 0; v < g->mesh->vertex_count; v++) {
        uint64_t key = cube_key(g, v);
        size_t at = (size_t)tsuya_random_u64(1, 1, key) & (room - 1);
        while (table[at].used && table[at].key != key) {
            at = (at + 1) & (room - 1);
        }
        if (!table[at].used) {
            table[at] = (cube_entry){key, g->patches++, true};
        }
        g->patch[v] = table[at].number;
    }
done:
    tsuya_free(table);
    return status;
}

tsuya_status tsuya_gather_create(tsuya_gather **gather, const tsuya_mesh *mesh, const tsuya_gather_options *options)
{
    tsuya_status status = TSUYA_OK;
    tsuya_gather *g;
    tsuya_vec3 low, high;
    *gather = NULL;
    if (!mesh->normal || !mesh->weft || mesh->triangle_count == 0) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "the surface has no %s; a mesh with nx ny nz and weft_x weft_y weft_z is accepted",
                          mesh->triangle_count == 0 ? "triangles" : mesh->normal ? "weft" : "normals");
    }
    TSUYA_NEW(status, g, 1);
    g->mesh = mesh;
    g->options = *options;
    tsuya_mesh_bounds(mesh, &low, &high);
    g->middle = tsuya_vec3_scale(tsuya_vec3_add(low, high), 0.5);
    g->radius_m = 0.5 * tsuya_vec3_norm(tsuya_vec3_sub(high, low));
    g->edge_m = tsuya_mesh_mean_edge(mesh);
    g->options.patch_m = options->patch_m > 0.0 ? options->patch_m : g->radius_m / 25.0;
    g->patch = tsuya_calloc(mesh->vertex_count, sizeof *g->patch);
    status = g->patch ? number_patches(g) : TSUYA_ERROR_MEMORY;
    if (status != TSUYA_OK) {
        tsuya_gather_free(g);
        return status;
    }
    *gather = g;
done:
    return status;
}

void tsuya_gather_free(tsuya_gather *g)
{
    if (g) {
        tsuya_free(g->patch);
        tsuya_free(g->reading);
        tsuya_free(g);
    }
}

/* --- one photograph ----------------------------------------------------------------------------------------------------- */

static tsuya_vec3 mixed(const float *vectors, const uint32_t *t, const double w[3])
{
    tsuya_vec3 sum = {0, 0, 0};
    for (int k = 0; k < 3; k++) {
        const float *v = vectors + 3 * (size_t)t[k];
        sum = tsuya_vec3_mad(sum, w[k], (tsuya_vec3){(double)v[0], (double)v[1], (double)v[2]});
    }
    return sum;
}

bool tsuya_gather_place(gather_place *place, const tsuya_gather *g, const tsuya_raster *raster, const tsuya_camera *camera, tsuya_pose pose, int x, int y)
{
    uint32_t triangle = raster->triangle[(size_t)y * (size_t)raster->width_px + (size_t)x];
    double w[3];
    if (triangle == UINT32_MAX || !tsuya_raster_weights(w, g->mesh, triangle, camera, pose, (tsuya_vec2){x, y})) {
        return false;
    }
    const uint32_t *t = g->mesh->triangle + 3 * (size_t)triangle;
    place->p = mixed(g->mesh->position, t, w);
    place->n = tsuya_vec3_unit(mixed(g->mesh->normal, t, w));
    place->weft = tsuya_vec3_tangent(mixed(g->mesh->weft, t, w), place->n);
    int nearest = w[1] > w[0] ? (w[2] > w[1] ? 2 : 1) : w[2] > w[0] ? 2 : 0;
    place->vertex = t[nearest];
    return tsuya_vec3_norm(place->weft) > 0.5;
}

typedef enum fate { NOTHING, BORDER, CLIPPED, GRAZING, SHADOWED, SHARED, USED } fate;

typedef struct pixel_reading {
    fate fate;
    uint32_t patch;
    uint64_t cell;
    float wi[3], wo[3], value[3], other[3];
} pixel_reading;

typedef struct looking {
    const tsuya_gather *g;
    const tsuya_gather_view *view;
    const tsuya_raster *raster;
    const gather_shadow *shadow;
    tsuya_vec3 eye;
} looking;

/* The surface all around, without a step in depth. */
static bool is_inside(const looking *l, int x, int y)
{
    const tsuya_raster *r = l->raster;
    size_t at = (size_t)y * (size_t)r->width_px + (size_t)x;
    if (x < 1 || y < 1 || x + 1 >= r->width_px || y + 1 >= r->height_px || !(r->depth[at] > 0.0f)) {
        return false;
    }
    double width = (double)r->depth[at] / l->view->camera->fx_px / sin(tsuya_rad_from_deg(l->g->options.grazing_deg));
    for (int k = 0; k < 9; k++) {
        double depth = (double)r->depth[at + (size_t)(k % 3) + (size_t)(k / 3) * (size_t)r->width_px - 1 - (size_t)r->width_px];
        if (!(depth > 0.0) || fabs(depth - (double)r->depth[at]) > STEP_EDGES * width) {
            return false;
        }
    }
    return true;
}

static bool is_clipped(const looking *l, int x, int y)
{
    for (int k = 0; k < 9; k++) {
        const float *v = tsuya_image_f32(l->view->image, x + k % 3 - 1, y + k / 3 - 1);
        if ((double)fmaxf(v[0], fmaxf(v[1], v[2])) >= l->g->options.clip) {
            return true;
        }
    }
    return false;
}

/* Lambert's equal-area disc, two numbers a direction. */
static uint64_t cell_of(double cell, tsuya_vec3 wi, tsuya_vec3 wo)
{
    const double a = 1.0 / sqrt(1.0 + wi.z), b = 1.0 / sqrt(1.0 + wo.z), c[4] = {wi.x * a, wi.y * a, wo.x * b, wo.y * b};
    uint64_t key = 0;
    for (int k = 0; k < 4; k++) {
        key = key << 16 | (uint64_t)((long long)floor(c[k] / cell) + (1 << 15));
    }
    return key;
}

static void put(float *to, tsuya_vec3 v)
{
    to[0] = (float)v.x;
    to[1] = (float)v.y;
    to[2] = (float)v.z;
}

static fate read_pixel(pixel_reading *out, const looking *l, int x, int y)
{
    const tsuya_gather_view *view = l->view;
    gather_place at;
    double low = sin(tsuya_rad_from_deg(l->g->options.grazing_deg));
    if (l->raster->triangle[(size_t)y * (size_t)l->raster->width_px + (size_t)x] == UINT32_MAX) {
        return NOTHING;
    }
    if ((view->mask && *tsuya_image_u8(view->mask, x, y) <= 127) || !is_inside(l, x, y) ||
        !tsuya_gather_place(&at, l->g, l->raster, view->camera, view->camera_from_world, x, y)) {
        return BORDER;
    }
    if (is_clipped(l, x, y)) {
        return CLIPPED;
    }
    tsuya_vec3 wo = gather_local(&at, tsuya_vec3_unit(tsuya_vec3_sub(l->eye, at.p)));
    if (wo.z < low) {
        return GRAZING;
    }
    gather_light light = tsuya_gather_light(l->g, view->lamps, l->shadow, at.p, at.n);
    tsuya_vec3 wi = gather_local(&at, light.wi);
    if (!light.whole) {
        return SHADOWED;
    }
    if (wi.z < low) {
        return GRAZING;
    }
    if (light.share < l->g->options.alone) {
        return SHARED;
    }
    const float *v = tsuya_image_f32(view->image, x, y);
    for (int c = 0; c < 3; c++) {
        out->value[c] = (float)((double)v[c] * view->gain[c] / light.irradiance[c]);
        out->other[c] = (float)(light.other[c] / light.irradiance[c]);
    }
    put(out->wi, wi);
    put(out->wo, wo);
    out->patch = l->g->patch[at.vertex];
    out->cell = cell_of(l->g->options.cell, wi, wo);
    return USED;
}

static tsuya_status keep_reading(tsuya_gather *g, const gather_reading *reading)
{
    if (g->count == g->room) {
        size_t room = g->room ? 2 * g->room : 1024;
        gather_reading *more = tsuya_realloc(g->reading, room, sizeof *more);
        if (!more) {
            return TSUYA_ERROR_MEMORY;
        }
        g->reading = more;
        g->room = room;
    }
    g->reading[g->count++] = *reading;
    return TSUYA_OK;
}

static int by_cell(const void *a, const void *b)
{
    const pixel_reading *x = a, *y = b;
    if (x->cell != y->cell) {
        return x->cell < y->cell ? -1 : 1;
    }
    if (x->patch != y->patch) {
        return x->patch < y->patch ? -1 : 1;
    }
    return memcmp(x->value, y->value, sizeof x->value); /* equal pixels are equal: the order of their sum does not matter */
}

static void add_pixel(gather_reading *r, const pixel_reading *p)
{
    for (int c = 0; c < 3; c++) {
        r->wi[c] += p->wi[c];
        r->wo[c] += p->wo[c];
        r->value[c] += p->value[c];
        r->other[c] += p->other[c];
    }
    r->square += p->value[1] * p->value[1];
    r->pixels++;
}

static void to_mean(gather_reading *r)
{
    float n = (float)r->pixels;
    for (int c = 0; c < 3; c++) {
        r->wi[c] /= n;
        r->wo[c] /= n;
        r->value[c] /= n;
        r->other[c] /= n;
    }
    r->square = fmaxf(0.0f, r->square / n - r->value[1] * r->value[1]); /* now the variance of a pixel */
}

/* Pixels of one photograph, sorted, become readings. */
static tsuya_status average(tsuya_gather *g, pixel_reading *pixel, size_t count)
{
    qsort(pixel, count, sizeof *pixel, by_cell);
    for (size_t i = 0; i < count;) {
        gather_reading r = {.cell = pixel[i].cell, .patch = pixel[i].patch, .photo = g->photos};
        size_t j = i;
        for (; j < count && pixel[j].cell == r.cell && pixel[j].patch == r.patch; j++) {
            add_pixel(&r, &pixel[j]);
        }
        i = j;
        to_mean(&r);
        TSUYA_TRY(keep_reading(g, &r));
    }
    return TSUYA_OK;
}

static size_t collect(pixel_reading *pixel, size_t count, tsuya_gather_counts *counts)
{
    size_t used = 0;
    for (size_t i = 0; i < count; i++) {
        fate f = pixel[i].fate;
        counts->seen += f != NOTHING;
        counts->used += f == USED;
        counts->border += f == BORDER;
        counts->clipped += f == CLIPPED;
        counts->grazing += f == GRAZING;
        counts->shadowed += f == SHADOWED;
        counts->shared += f == SHARED;
        if (f == USED) {
            pixel[used++] = pixel[i];
        }
    }
    return used;
}

tsuya_status tsuya_gather_add(tsuya_gather *g, tsuya_gather_counts *counts, const tsuya_gather_view *view, const tsuya_context *context)
{
    tsuya_status status;
    tsuya_raster raster = {0};
    gather_shadow *shadow = NULL;
    pixel_reading *pixel = NULL;
    int width = view->camera->width_px, height = view->camera->height_px;
    if (view->image->width_px != width || view->image->height_px != height) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "a photograph has %d x %d pixels, its camera %d x %d", view->image->width_px, view->image->height_px, width, height);
    }
    TSUYA_GOTO_DONE(status, tsuya_raster_create(&raster, width, height));
    TSUYA_GOTO_DONE(status, tsuya_raster_draw(&raster, g->mesh, view->camera, view->camera_from_world, context));
    TSUYA_GOTO_DONE(status, tsuya_gather_shadows(&shadow, g, view->lamps, context));
    TSUYA_NEW(status, pixel, (size_t)width * (size_t)height);
    looking l = {g, view, &raster, shadow, tsuya_pose_center(view->camera_from_world)};
#pragma omp parallel for schedule(dynamic, 8) num_threads(context->threads)
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            pixel_reading *p = &pixel[(size_t)y * (size_t)width + (size_t)x];
            p->fate = read_pixel(p, &l, x, y);
        }
    }
    status = average(g, pixel, collect(pixel, (size_t)width * (size_t)height, counts));
    g->photos++;
done:
    tsuya_raster_free(&raster);
    tsuya_gather_shadows_free(shadow, view->lamps->count);
    tsuya_free(pixel);
    return status;
}
