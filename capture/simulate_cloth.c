/* A scene's cloth on its stand. */
#include "capture/simulate_parts.h"

#include "core/file.h"
#include "core/image.h"
#include "core/memory.h"

#include <math.h>
#include <string.h>

static const double ROUND_M = 0.003, START_M = 1e-3;

static bool is(const char *a, const char *b) { return strcmp(a, b) == 0; }

tsuya_vec3 tsuya_simulate_foot(const tsuya_simulate_scene *s)
{
    const tsuya_scene_tags *m = &s->mat;
    if (!s->has_mat) {
        return (tsuya_vec3){0, 0, 0};
    }
    return (tsuya_vec3){0.5e-3 * (m->cols * m->tag_mm + (m->cols - 1) * m->gap_mm), 0.5e-3 * (m->rows * m->tag_mm + (m->rows - 1) * m->gap_mm), 0.0};
}

int tsuya_simulate_bodies(tsuya_drape_body body[SIMULATE_BODIES], const tsuya_simulate_scene *scene)
{
    const tsuya_scene_stand *s = &scene->stand;
    tsuya_vec3 foot = tsuya_simulate_foot(scene), top = tsuya_vec3_add(foot, (tsuya_vec3){0, 0, s->height_m});
    double half = 0.5 * s->length_m, r = s->radius_m;
    body[0] = (tsuya_drape_body){.shape = TSUYA_DRAPE_FLOOR, .a = foot};
    body[1] = (tsuya_drape_body){.shape = TSUYA_DRAPE_DISC, .a = foot, .b = top, .radius_m = r, .round_m = fmin(ROUND_M, 0.5 * r)};
    if (is(s->kind, "table")) {
        body[1] = (tsuya_drape_body){.shape = TSUYA_DRAPE_BOX, .a = {foot.x - half, foot.y - half, foot.z}, .b = {top.x + half, top.y + half, top.z},
                                     .round_m = fmin(ROUND_M, 0.4 * half)};
    } else if (is(s->kind, "bar")) {
        body[1] = (tsuya_drape_body){.shape = TSUYA_DRAPE_BAR, .a = {top.x - half, top.y, top.z - r}, .b = {top.x + half, top.y, top.z - r}, .radius_m = r};
    } else if (is(s->kind, "form")) {
        body[1] = (tsuya_drape_body){.shape = TSUYA_DRAPE_FORM, .a = {top.x, top.y, foot.z + 0.3 * s->height_m}, .b = {top.x, top.y, top.z - 0.4 * r},
                                     .radius_m = r, .radius_b_m = 0.4 * r};
    }
    return 2;
}

tsuya_studio_weave tsuya_simulate_weave(const tsuya_simulate_scene *s, uint64_t seed)
{
    tsuya_studio_weave w = tsuya_studio_weave_default();
    w.weft_pitch_m = 1e-3 * s->cloth.weft_mm;
    w.warp_pitch_m = 1e-3 * s->cloth.warp_mm;
    w.unevenness = s->cloth.unevenness;
    /* what hangs from a bar has no border all round */
    w.half_side_m = is(s->cloth.kind, "karaori") || is(s->cloth.kind, "curtain") ? 10.0 : 0.5 * s->cloth.side_m;
    w.seed = seed;
    return w;
}

/* Shapes of their kind, not one measured cloth; the volume's albedo is chosen so that white dye sends back about 0.8. */
const tsuya_microcylinder *tsuya_simulate_reflectance(const tsuya_simulate_scene *s)
{
    static const tsuya_microcylinder satin = {
        .weft = {.eta = 1.35, .albedo = {0.75, 0.75, 0.75}, .isotropic = 0.35, .surface_deg = 10, .volume_deg = 22, .area = 0.78, .knot_count = 2,
                 .offset_deg = {-18, 18}, .length = {1}},
        .warp = {.eta = 1.35, .albedo = {0.75, 0.75, 0.75}, .isotropic = 0.5, .surface_deg = 16, .volume_deg = 30, .area = 0.2, .knot_count = 2,
                 .offset_deg = {0, 0}, .length = {1}},
        .step_deg = 4.0,
    };
    static const tsuya_microcylinder linen = {
        .weft = {.eta = 1.46, .albedo = {0.75, 0.75, 0.75}, .isotropic = 0.5, .surface_deg = 14, .volume_deg = 28, .area = 0.45, .knot_count = 2,
                 .offset_deg = {-24, 24}, .length = {1}},
        .warp = {.eta = 1.46, .albedo = {0.75, 0.75, 0.75}, .isotropic = 0.5, .surface_deg = 14, .volume_deg = 28, .area = 0.45, .knot_count = 2,
                 .offset_deg = {-24, 24}, .length = {1}},
        .step_deg = 6.0,
    };
    return is(s->cloth.reflectance, "satin") ? &satin : is(s->cloth.reflectance, "linen") ? &linen : NULL;
}

/* Over the bar, front and back straight down from it. */
static void hang(tsuya_drape_sheet *sheet, const tsuya_simulate_scene *s, double gap_m, uint64_t seed)
{
    tsuya_vec3 foot = tsuya_simulate_foot(s);
    double r = s->stand.radius_m + gap_m, axis = foot.z + s->stand.height_m - s->stand.radius_m, quarter = 0.5 * M_PI * r;
    for (size_t v = 0; v < sheet->vertex_count; v++) {
        double *p = sheet->position + 3 * v, along = p[1], side = along < 0.0 ? -1.0 : 1.0, over = fabs(along) - quarter;
        p[0] += foot.x;
        p[1] = foot.y + (over > 0.0 ? side * r : r * sin(along / r)) + side * 5e-4 * tsuya_random_uniform(seed, SIMULATE_START, v);
        p[2] = axis + (over > 0.0 ? -over : r * cos(along / r));
    }
}

/* Moves the sheet there; what is not held is not quite even, so that folds find their place. */
static void place(tsuya_drape_sheet *sheet, tsuya_vec3 to, uint64_t seed)
{
    for (size_t v = 0; v < sheet->vertex_count; v++) {
        double *p = sheet->position + 3 * v;
        p[0] += to.x;
        p[1] += to.y;
        p[2] += to.z + (sheet->fixed[v] ? 0.0 : 5e-4 * tsuya_random_uniform(seed, SIMULATE_START, v));
    }
}

/* The flat sheet a little over the stand, or hung under it. */
static tsuya_status lay_out(tsuya_drape_sheet *sheet, const tsuya_simulate_scene *s, const tsuya_drape_fabric *fabric, uint64_t seed)
{
    tsuya_vec3 foot = tsuya_simulate_foot(s);
    double side = s->cloth.side_m, spacing = s->cloth.spacing_m * (1 << s->cloth.levels), z = foot.z + s->stand.height_m + fabric->thickness_m + START_M;
    if (is(s->cloth.kind, "karaori")) {
        double sagging = spacing * spacing / (8.0 * s->stand.radius_m); /* of an edge over the bar */
        TSUYA_TRY(tsuya_drape_sheet_karaori(sheet, side, spacing));
        hang(sheet, s, fabric->thickness_m + START_M + 1.2 * sagging, seed);
        return TSUYA_OK;
    }
    if (is(s->cloth.kind, "curtain")) {
        const tsuya_scene_cloth *c = &s->cloth;
        TSUYA_TRY(tsuya_drape_sheet_curtain(sheet, side, c->drop_m, c->fullness, c->pleats, spacing));
        place(sheet, (tsuya_vec3){foot.x, foot.y, foot.z + s->stand.height_m - 2.0 * s->stand.radius_m - fabric->thickness_m - START_M}, seed);
        return TSUYA_OK;
    }
    if (is(s->cloth.kind, "disc")) {
        TSUYA_TRY(tsuya_drape_sheet_disc(sheet, 0.5 * side, 0.0, spacing));
    } else {
        int cells = (int)fmax(2.0, ceil(side / spacing));
        TSUYA_TRY(tsuya_drape_sheet_grid(sheet, -0.5 * side, -0.5 * side, side / cells, cells, cells));
    }
    place(sheet, (tsuya_vec3){foot.x, foot.y, z}, seed);
    return TSUYA_OK;
}

static tsuya_status drape(tsuya_drape_sheet *sheet, tsuya_simulate_info *info, const tsuya_simulate_scene *s, const tsuya_context *context)
{
    tsuya_drape_fabric fabric;
    tsuya_drape_body body[SIMULATE_BODIES];
    tsuya_drape_options options = tsuya_drape_options_default();
    tsuya_drape_info own;
    double start_s = tsuya_clock_s();
    (void)tsuya_drape_fabric_named(&fabric, s->cloth.fabric); /* the scene's check knows it */
    TSUYA_TRY(lay_out(sheet, s, &fabric, context->seed));
    TSUYA_TRY(tsuya_drape_settle(&own, sheet, &fabric, body, tsuya_simulate_bodies(body, s), &options, s->cloth.levels, context));
    info->drape_steps = own.steps;
    info->at_rest = own.at_rest;
    info->energy_j = own.energy_j;
    info->drape_s = tsuya_clock_s() - start_s;
    for (int k = 0; k < s->cloth.smooth; k++) {
        tsuya_drape_sheet fine;
        TSUYA_TRY(tsuya_drape_sheet_subdivide(&fine, sheet, true));
        tsuya_drape_sheet_free(sheet);
        *sheet = fine;
    }
    return TSUYA_OK;
}

/* Which of a vertex' copies has these material coordinates; a new one where none has. */
static uint32_t copy_of(uint32_t *next, double *uv, uint32_t *count, uint32_t vertex, const double *corner)
{
    uint32_t at = vertex;
    for (;; at = next[at]) {
        if (isnan(uv[2 * at])) {
            memcpy(uv + 2 * at, corner, 2 * sizeof *uv);
            return at;
        }
        if (fabs(uv[2 * at] - corner[0]) + fabs(uv[2 * at + 1] - corner[1]) < 1e-7) {
            return at;
        }
        if (next[at] == UINT32_MAX) {
            break;
        }
    }
    uint32_t own = (*count)++;
    next[at] = own;
    memcpy(uv + 2 * own, corner, 2 * sizeof *uv);
    return own;
}

static void put(float *to, const double *from)
{
    for (int i = 0; i < 3; i++) {
        to[i] = (float)from[i];
    }
}

/* weft, warp: sums over each copy's own triangles. */
static tsuya_status fill_cloth(tsuya_studio_cloth *cloth, const tsuya_drape_sheet *s, const tsuya_mesh *whole, const uint32_t *copy, const double *uv,
                               const uint32_t *vertex, const double *along, uint32_t count)
{
    tsuya_status status = TSUYA_OK;
    TSUYA_TRY(tsuya_mesh_create(&cloth->mesh, count, s->triangle_count, TSUYA_MESH_NORMAL | TSUYA_MESH_WEFT));
    TSUYA_NEW(status, cloth->warp, 3 * (size_t)count);
    TSUYA_NEW(status, cloth->uv, 2 * (size_t)count);
    memcpy(cloth->mesh.triangle, copy, 3 * s->triangle_count * sizeof *copy);
    for (size_t v = 0; v < count; v++) {
        const float *n = whole->normal + 3 * vertex[v];
        tsuya_vec3 normal = {n[0], n[1], n[2]};
        memcpy(cloth->mesh.normal + 3 * v, n, 3 * sizeof *n);
        put(cloth->mesh.position + 3 * v, s->position + 3 * vertex[v]);
        for (int k = 0; k < 2; k++) {
            const double *a = along + 6 * v + 3 * k;
            tsuya_vec3 t = tsuya_vec3_tangent((tsuya_vec3){a[0], a[1], a[2]}, normal);
            put((k ? cloth->warp : cloth->mesh.weft) + 3 * v, &t.x);
            cloth->uv[2 * v + (size_t)k] = (float)uv[2 * v + (size_t)k];
        }
    }
done:
    return status;
}

static void add_tangents(double *along, const tsuya_drape_sheet *s, const uint32_t *copy, size_t t)
{
    const double *c = s->uv + 6 * t, *x = s->position;
    const uint32_t *v = s->triangle + 3 * t;
    double u1 = c[2] - c[0], v1 = c[3] - c[1], u2 = c[4] - c[0], v2 = c[5] - c[1];
    for (size_t i = 0; i < 3; i++) {
        for (size_t k = 0; k < 3; k++) {
            double a = x[3 * v[1] + k] - x[3 * v[0] + k], b = x[3 * v[2] + k] - x[3 * v[0] + k];
            along[6 * copy[3 * t + i] + k] += v2 * a - v1 * b; /* × area: weights */
            along[6 * copy[3 * t + i] + 3 + k] += u1 * b - u2 * a;
        }
    }
}

static tsuya_status cloth_of(tsuya_studio_cloth *cloth, const tsuya_drape_sheet *s)
{
    tsuya_status status;
    tsuya_mesh whole = {0};
    size_t most = s->vertex_count + 3 * s->triangle_count;
    uint32_t *copy = NULL, *next = NULL, *vertex = NULL, count = (uint32_t)s->vertex_count;
    double *uv = NULL, *along = NULL;
    TSUYA_GOTO_DONE(status, tsuya_drape_sheet_mesh(&whole, NULL, NULL, s));
    TSUYA_NEW(status, copy, 3 * s->triangle_count);
    TSUYA_NEW(status, next, most);
    TSUYA_NEW(status, vertex, most);
    TSUYA_NEW(status, uv, 2 * most);
    TSUYA_NEW(status, along, 6 * most);
    for (size_t v = 0; v < most; v++) {
        next[v] = UINT32_MAX;
        uv[2 * v] = NAN;
        vertex[v] = v < s->vertex_count ? (uint32_t)v : 0;
    }
    for (size_t i = 0; i < 3 * s->triangle_count; i++) {
        copy[i] = copy_of(next, uv, &count, s->triangle[i], s->uv + 2 * i);
        vertex[copy[i]] = s->triangle[i];
    }
    for (size_t t = 0; t < s->triangle_count; t++) {
        add_tangents(along, s, copy, t);
    }
    status = fill_cloth(cloth, s, &whole, copy, uv, vertex, along, count);
done:
    tsuya_mesh_free(&whole);
    tsuya_free(copy);
    tsuya_free(next);
    tsuya_free(vertex);
    tsuya_free(uv);
    tsuya_free(along);
    return status;
}

static tsuya_status closed_form(tsuya_studio_cloth *cloth, const tsuya_simulate_scene *s)
{
    tsuya_studio_drape d = tsuya_studio_drape_default();
    tsuya_vec3 foot = tsuya_simulate_foot(s);
    d.side_m = s->cloth.side_m;
    d.stand_radius_m = s->stand.radius_m;
    d.stand_height_m = s->stand.height_m;
    d.spacing_m = s->cloth.spacing_m;
    if (!is(s->stand.kind, "disc") || hypot(d.side_m, d.side_m) / 2.0 - d.stand_radius_m > 1.2 * d.stand_height_m) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: cloth: kind: closed needs a stand of kind disc that is high enough for a cloth of side_m %g; radius_m %g, "
                          "height_m %g are given", s->path, d.side_m, d.stand_radius_m, d.stand_height_m);
    }
    TSUYA_TRY(tsuya_studio_drape_create(cloth, &d));
    for (size_t v = 0; v < cloth->mesh.vertex_count; v++) {
        cloth->mesh.position[3 * v] += (float)foot.x;
        cloth->mesh.position[3 * v + 1] += (float)foot.y;
    }
    return TSUYA_OK;
}

static tsuya_status color(tsuya_mesh *mesh, const float *uv, const tsuya_studio_weave *weave)
{
    TSUYA_TRY(tsuya_mesh_add_arrays(mesh, TSUYA_MESH_COLOR));
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        float rgb[3];
        tsuya_studio_dye_at(weave, (double)uv[2 * v], (double)uv[2 * v + 1], rgb);
        for (size_t c = 0; c < 3; c++) {
            mesh->color[3 * v + c] = (uint8_t)lroundf(255.0f * tsuya_srgb_encode(rgb[c]));
        }
    }
    return TSUYA_OK;
}

tsuya_status tsuya_simulate_cloth(tsuya_studio_cloth *cloth, tsuya_simulate_info *info, const tsuya_simulate_scene *s, const tsuya_studio_weave *weave,
                                  const tsuya_context *context)
{
    tsuya_drape_sheet sheet = {0};
    tsuya_status status = TSUYA_OK;
    info->at_rest = true;
    if (is(s->cloth.kind, "closed")) {
        status = closed_form(cloth, s);
    } else {
        status = drape(&sheet, info, s, context);
        status = status == TSUYA_OK ? cloth_of(cloth, &sheet) : status;
        tsuya_drape_sheet_free(&sheet);
    }
    info->vertices = cloth->mesh.vertex_count;
    return status == TSUYA_OK ? color(&cloth->mesh, cloth->uv, weave) : status;
}
