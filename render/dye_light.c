#include "render/dye_light.h"

#include "core/memory.h"

#include <math.h>
#include <omp.h>
#include <string.h>

enum { LAMP_SIDE = 4, SKY_SIDE = 7, STREAM_LAMP = 7100, STREAM_SKY = 7000, STREAM_SHINE = 7001 };

/* Light that arrives at a vertex: from directions in the cloth's frame, each × cosine and over its density. */
typedef struct arrival {
    tsuya_vec3 wi;
    double rgb[3];
} arrival;

typedef struct vertex_frame {
    tsuya_vec3 p, x, y, n;
} vertex_frame;

static tsuya_vec3 vec(const float *f) { return (tsuya_vec3){f[0], f[1], f[2]}; }

static bool frame_of(vertex_frame *f, const tsuya_mesh *mesh, size_t v)
{
    f->p = tsuya_mesh_position(mesh, v);
    f->n = vec(mesh->normal + 3 * v);
    double length = tsuya_vec3_norm(f->n);
    if (!(length > 0.5)) {
        return false;
    }
    f->n = tsuya_vec3_scale(f->n, 1.0 / length);
    tsuya_vec3 weft = mesh->weft ? vec(mesh->weft + 3 * v) : (tsuya_vec3){0, 0, 0};
    tsuya_vec3 flat = tsuya_vec3_mad(weft, -tsuya_vec3_dot(weft, f->n), f->n);
    if (!(tsuya_vec3_norm(flat) > 1e-3)) {
        weft = fabs(f->n.x) < 0.7 ? (tsuya_vec3){1, 0, 0} : (tsuya_vec3){0, 1, 0};
        flat = tsuya_vec3_mad(weft, -tsuya_vec3_dot(weft, f->n), f->n);
    }
    f->x = tsuya_vec3_unit(flat);
    f->y = tsuya_vec3_cross(f->n, f->x);
    return true;
}

static tsuya_vec3 to_frame(const vertex_frame *f, tsuya_vec3 d) { return (tsuya_vec3){tsuya_vec3_dot(d, f->x), tsuya_vec3_dot(d, f->y), tsuya_vec3_dot(d, f->n)}; }

static tsuya_ray ray_from(const vertex_frame *f, double bias, tsuya_vec3 d, double far)
{
    tsuya_vec3 o = tsuya_vec3_mad(f->p, bias, f->n);
    return (tsuya_ray){{(float)o.x, (float)o.y, (float)o.z}, {(float)d.x, (float)d.y, (float)d.z}, 0.0f, (float)far};
}

static int from_lamp(arrival *to, const tsuya_dye_room *room, const vertex_frame *f, const tsuya_light *lamp, int number, size_t v, uint64_t seed)
{
    int side = lamp->kind == TSUYA_LIGHT_POINT || lamp->kind == TSUYA_LIGHT_SPOT || lamp->kind == TSUYA_LIGHT_DIRECTIONAL ? 1 : LAMP_SIDE, count = 0;
    for (int k = 0; k < side * side; k++) {
        uint64_t stream = (uint64_t)(STREAM_LAMP + number), counter = 2 * (v * LAMP_SIDE * LAMP_SIDE + (uint64_t)k);
        double u[2] = {(k % side + tsuya_random_uniform(seed, stream, counter)) / side, (k / side + tsuya_random_uniform(seed, stream, counter + 1)) / side};
        tsuya_light_sample s;
        if (!tsuya_light_sample_at(lamp, f->p, f->n, u, &s)) {
            continue;
        }
        arrival a = {.wi = to_frame(f, s.wi)};
        tsuya_ray ray = ray_from(f, room->bias, s.wi, s.distance_m * (1.0 - 1e-4));
        if (a.wi.z > 0.0 && !tsuya_ray_scene_occluded(room->rays, &ray)) {
            for (int c = 0; c < 3; c++) {
                a.rgb[c] = s.rgb[c] * a.wi.z / (s.pdf * side * side);
            }
            to[count++] = a;
        }
    }
    return count;
}

/* Even surroundings where a ray leaves the cloth alone, the cloth's own light where it does not. */
static void look_around(double rgb[3], const tsuya_dye_room *room, const vertex_frame *f, tsuya_vec3 wi, const float *sent)
{
    tsuya_vec3 d = tsuya_vec3_mad(tsuya_vec3_mad(tsuya_vec3_scale(f->x, wi.x), wi.y, f->y), wi.z, f->n);
    tsuya_ray ray = ray_from(f, room->bias, d, INFINITY);
    tsuya_ray_hit hit;
    memset(rgb, 0, 3 * sizeof *rgb);
    if (tsuya_ray_scene_intersect(room->rays, &ray, &hit)) {
        const uint32_t *t = room->mesh->triangle + 3 * (size_t)hit.triangle;
        uint32_t near = hit.u > 0.5f ? t[1] : hit.v > 0.5f ? t[2] : t[0];
        for (size_t c = 0; sent && c < 3; c++) {
            rgb[c] = (double)sent[3 * (size_t)near + c];
        }
        return;
    }
    for (int l = 0; l < room->lights->count; l++) {
        const tsuya_light *lamp = &room->lights->light[l];
        for (int c = 0; lamp->kind == TSUYA_LIGHT_ENVIRONMENT && !lamp->map && c < 3; c++) {
            rgb[c] += lamp->rgb[c];
        }
    }
}

static int from_around(arrival *to, const tsuya_dye_room *room, const vertex_frame *f, const float *sent, size_t v, uint64_t seed)
{
    int count = 0;
    for (int k = 0; k < SKY_SIDE * SKY_SIDE; k++) {
        uint64_t counter = 2 * (v * SKY_SIDE * SKY_SIDE + (uint64_t)k);
        double r = sqrt((k % SKY_SIDE + tsuya_random_uniform(seed, STREAM_SKY, counter)) / SKY_SIDE);
        double phi = 2.0 * M_PI * (k / SKY_SIDE + tsuya_random_uniform(seed, STREAM_SKY, counter + 1)) / SKY_SIDE;
        arrival a = {.wi = {r * cos(phi), r * sin(phi), sqrt(fmax(0.0, 1.0 - r * r))}};
        look_around(a.rgb, room, f, a.wi, sent);
        for (int c = 0; c < 3; c++) {
            a.rgb[c] *= M_PI / (SKY_SIDE * SKY_SIDE);
        }
        if (a.wi.z > 0.0 && a.rgb[0] + a.rgb[1] + a.rgb[2] > 0.0) {
            to[count++] = a;
        }
    }
    return count;
}

static double turned(double x, double by) { return x + by - floor(x + by); }

/* The k-th of n points that fill the unit cube evenly (Hammersley's, and the golden ratio), turned by chance. */
static void even_point(double u[3], int k, int n, const double by[3])
{
    double bits = 0.0, half = 0.5;
    for (int rest = k; rest > 0; rest /= 2, half *= 0.5) {
        bits += half * (rest % 2);
    }
    u[0] = turned(0.6180339887498949 * k, by[0]);
    u[1] = turned((k + 0.5) / n, by[1]);
    u[2] = turned(bits, by[2]);
}

/* Room of one thread for what arrives at a vertex and for what the material makes of it, planes of `most` numbers. */
typedef struct workplace {
    arrival *a;
    size_t most;
    float *planes; /* PLANES of them: wi, wo, then values under a black and under a white dye, three each */
} workplace;

enum { PLANES = 12 };

static float *plane(const workplace *w, size_t which) { return w->planes + which * w->most; }

static void fill(float *plane, double value, int count)
{
    for (int k = 0; k < count; k++) {
        plane[k] = (float)value;
    }
}

/* What the surface part mirrors of the surroundings, drawn by its own density: its lobes are too narrow for even rays. */
static void add_shine(double surface[3], const tsuya_dye_room *room, const vertex_frame *f, const tsuya_material *material, tsuya_vec3 wo, const float *sent,
                      uint64_t seed, uint64_t counter)
{
    enum { MOST = TSUYA_MATERIAL_LOOKS };
    float planes[PLANES][MOST], share[MOST], rest[3 * MOST], value[3 * MOST], pdf[MOST], *const wi[3] = {planes[0], planes[1], planes[2]};
    const double by[3] = {tsuya_random_uniform(seed, STREAM_SHINE, 3 * counter), tsuya_random_uniform(seed, STREAM_SHINE, 3 * counter + 1),
                          tsuya_random_uniform(seed, STREAM_SHINE, 3 * counter + 2)};
    for (int from = 0; from < room->shine; from += MOST) {
        int count = room->shine - from < MOST ? room->shine - from : MOST;
        const tsuya_material_looks l = {.material = material, .count = count, .wo = {planes[3], planes[4], planes[5]}, .share = share, .rest = rest};
        fill(planes[3], wo.x, count);
        fill(planes[4], wo.y, count);
        fill(planes[5], wo.z, count);
        for (int k = 0; k < count; k++) {
            double u[3];
            even_point(u, from + k, room->shine, by);
            for (int i = 0; i < 3; i++) {
                planes[6 + i][k] = fminf((float)u[i], 0x1.fffffep-1f);
            }
        }
        tsuya_material_look(&l);
        tsuya_material_looks_sample(&l, (const float *const[3]){planes[6], planes[7], planes[8]}, wi);
        tsuya_material_looks_eval_pdf(&l, (const float *const[3]){wi[0], wi[1], wi[2]}, value, pdf);
        for (int k = 0; k < count; k++) {
            double rgb[3];
            if (wi[2][k] > 0.0f && pdf[k] > 0.0f) {
                look_around(rgb, room, f, (tsuya_vec3){wi[0][k], wi[1][k], wi[2][k]}, sent);
                for (int c = 0; c < 3; c++) {
                    surface[c] += (double)(value[c * count + k] * wi[2][k]) * rgb[c] / (double)(pdf[k] * (float)room->shine);
                }
            }
        }
    }
}

/* Seen from one eye.  The material's own dye is black, so what a white one adds is B.  The first `lamps` of the arrivals are of lamps; their
 * directions lie in the first planes. */
static void look_at(tsuya_dye_look *look, const tsuya_dye_room *room, const vertex_frame *f, const tsuya_material *material, const workplace *w, int lamps,
                    int count, const float *sent, uint64_t seed, uint64_t counter)
{
    static const double none[3] = {0.0, 0.0, 0.0}, white[3] = {1.0, 1.0, 1.0};
    tsuya_vec3 wo = to_frame(f, tsuya_vec3_unit(tsuya_vec3_sub(room->eye[look->view], f->p)));
    const tsuya_direction_batch batch = {count, plane(w, 0), plane(w, 1), plane(w, 2), plane(w, 3), plane(w, 4), plane(w, 5)};
    const float *dark = plane(w, 6), *bright = plane(w, 9);
    double surface[3] = {0.0, 0.0, 0.0}, body[3] = {0.0, 0.0, 0.0};
    fill(plane(w, 3), wo.x, count);
    fill(plane(w, 4), wo.y, count);
    fill(plane(w, 5), wo.z, count);
    tsuya_material_eval_batch(material, none, &batch, plane(w, 6));
    tsuya_material_eval_batch(material, white, &batch, plane(w, 9));
    for (int c = 0; c < 3; c++) {
        for (int k = 0; k < count; k++, dark++, bright++) {
            surface[c] += k < lamps ? (double)*dark * w->a[k].rgb[c] : 0.0;
            body[c] += (double)fmaxf(0.0f, *bright - *dark) * w->a[k].rgb[c];
        }
    }
    add_shine(surface, room, f, material, wo, sent, seed, counter);
    for (int c = 0; c < 3; c++) {
        look->surface[c] = (float)surface[c];
        look->white[c] = (float)body[c];
    }
}

static void light_vertex(float *irradiance, tsuya_dye_looks *looks, const workplace *w, const tsuya_dye_room *room, const float *sent, size_t v, uint64_t seed)
{
    vertex_frame f;
    arrival *a = w->a;
    int count = 0;
    memset(irradiance + 3 * v, 0, 3 * sizeof *irradiance);
    if (!frame_of(&f, room->mesh, v)) {
        return;
    }
    for (int l = 0; l < room->lights->count; l++) {
        const tsuya_light *lamp = &room->lights->light[l];
        if (lamp->kind != TSUYA_LIGHT_ENVIRONMENT || lamp->map) {
            count += from_lamp(a + count, room, &f, lamp, l, v, seed);
        }
    }
    int lamps = count;
    count += from_around(a + count, room, &f, sent, v, seed);
    for (int k = 0; k < count; k++) {
        plane(w, 0)[k] = (float)a[k].wi.x;
        plane(w, 1)[k] = (float)a[k].wi.y;
        plane(w, 2)[k] = (float)a[k].wi.z;
        for (size_t c = 0; c < 3; c++) {
            irradiance[3 * v + c] += (float)a[k].rgb[c];
        }
    }
    int index = room->mesh->material && room->material_count > 1 ? room->mesh->material[v] : 0;
    for (size_t k = looks ? looks->first[v] : 0; looks && k < looks->first[v + 1]; k++) {
        look_at(&looks->look[k], room, &f, room->material[index], w, lamps, count, sent, seed, k);
    }
}

tsuya_status tsuya_dye_light(float *irradiance, tsuya_dye_looks *looks, const tsuya_dye_room *room, const float *sent, const tsuya_context *context)
{
    tsuya_status status = TSUYA_OK;
    arrival *a = NULL;
    float *planes = NULL;
    size_t vertices = room->mesh->vertex_count, most = (size_t)room->lights->count * LAMP_SIDE * LAMP_SIDE + SKY_SIDE * SKY_SIDE;
    const size_t slice = 4096; /* between looks at the wish to stop */
    TSUYA_NEW(status, a, most * (size_t)context->threads);
    TSUYA_NEW(status, planes, PLANES * most * (size_t)context->threads);
    for (size_t low = 0; low < vertices; low += slice) {
        size_t high = low + slice < vertices ? low + slice : vertices;
        TSUYA_GOTO_DONE(status, tsuya_check_interrupt());
        tsuya_progress_update(context, "light on the cloth", (double)low, (double)vertices, NULL);
#pragma omp parallel for schedule(dynamic, 64) num_threads(context->threads)
        for (size_t v = low; v < high; v++) {
            size_t thread = (size_t)omp_get_thread_num();
            const workplace w = {a + most * thread, most, planes + PLANES * most * thread};
            light_vertex(irradiance, looks, &w, room, sent, v, context->seed);
        }
    }
done:
    tsuya_free(a);
    tsuya_free(planes);
    return status;
}
