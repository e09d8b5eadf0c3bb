#include "render/scene.h"

#include "core/image.h"
#include "core/memory.h"

#include "render/surface.h"

#include <math.h>
#include <string.h>

typedef struct scene_vertex { /* one cache line */
    float position[3], normal[3], weft[3], dye[3];
    uint32_t material;
    uint32_t unused[3];
} scene_vertex;

struct tsuya_scene {
    tsuya_ray_scene *rays;
    scene_vertex *vertex;
    uint32_t *triangle;
    tsuya_shader *shader;
    int shader_count;
    tsuya_dye_source dye;
    const tsuya_bands *bands;
    const double *dye_of_bands;
    tsuya_vec3 low, high;
    double bias; /* distance that a float ray needs to clear the surface it leaves */
};

static double material_eval_pdf(const void *user, const double *dye, tsuya_vec3 wi, tsuya_vec3 wo, double value[3])
{
    return tsuya_material_eval_pdf(user, dye, wi, wo, value);
}

static bool material_sample(const void *user, const double *dye, tsuya_vec3 wo, const double u[3], tsuya_vec3 *wi)
{
    return tsuya_material_sample(user, dye, wo, u, wi);
}

tsuya_status tsuya_shader_from_material(tsuya_shader *shader, const tsuya_material *material)
{
    tsuya_material_info info = tsuya_material_get_info(material);
    bool spectral;
    TSUYA_TRY(tsuya_bands_check(&spectral, info.channel, info.channel_count, info.name));
    *shader = (tsuya_shader){.user = material, .eval_pdf = material_eval_pdf, .sample = material_sample, .material = material, .spectral = spectral};
    return TSUYA_OK;
}

tsuya_scene_options tsuya_scene_options_default(void)
{
    return (tsuya_scene_options){.dye = TSUYA_DYE_OF_MATERIAL, .vertex_dye_scale = 0.8};
}

static tsuya_vec3 vec3_from(const float *v)
{
    return (tsuya_vec3){v[0], v[1], v[2]};
}

/* Unit, or zero where the input is zero or not finite. */
static void store_direction(float *out, const float *in)
{
    tsuya_vec3 v = vec3_from(in), u = tsuya_vec3_unit(v);
    bool good = isfinite(u.x) && isfinite(u.y) && isfinite(u.z);
    out[0] = good ? (float)u.x : 0.0f;
    out[1] = good ? (float)u.y : 0.0f;
    out[2] = good ? (float)u.z : 0.0f;
}

static tsuya_status check_options(const tsuya_mesh *mesh, const tsuya_scene_options *o)
{
    if (o->shader_count < 1) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "scene: no material; at least one is needed");
    }
    for (size_t v = 0; mesh->material && o->shader_count > 1 && v < mesh->vertex_count; ++v) {
        if (mesh->material[v] >= o->shader_count) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "mesh: vertex %zu: material %d; %d materials are given", v, mesh->material[v],
                              o->shader_count);
        }
    }
    for (int k = 0; k < o->shader_count; ++k) {
        if (o->shader[k].spectral && !(o->bands && tsuya_bands_match(o->bands, o->shader[k].material))) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: other wavelengths than the first spectral material; materials of one picture need the same ones, "
                              "or r, g, b", tsuya_material_get_info(o->shader[k].material).name);
        }
    }
    for (int k = 0; k < 3 * o->shader_count; ++k) {
        double t = o->shader[k / 3].transmittance[k % 3];
        if (!(t >= 0.0 && t <= 1.0)) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "transmission: %g; expected shares in [0, 1]", t);
        }
    }
    for (int c = 0; o->dye == TSUYA_DYE_OF_COLOR && c < 3; ++c) {
        if (!(o->dye_rgb[c] >= 0.0 && o->dye_rgb[c] <= 1.0)) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "colour: %g; expected linear reflectances in [0, 1]", o->dye_rgb[c]);
        }
    }
    if (o->dye == TSUYA_DYE_OF_VERTICES && !mesh->color) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "mesh: no vertex colours to take the dye from");
    }
    return TSUYA_OK;
}

static void fill_vertices(tsuya_scene *s, const tsuya_mesh *mesh, const float *normal, const tsuya_scene_options *o)
{
    float linear[256];
    for (int k = 0; k < 256; ++k) {
        linear[k] = tsuya_srgb_decode((float)k / 255.0f) * (float)o->vertex_dye_scale;
    }
    for (size_t v = 0; v < mesh->vertex_count; ++v) {
        scene_vertex *out = &s->vertex[v];
        memcpy(out->position, mesh->position + 3 * v, sizeof out->position);
        store_direction(out->normal, normal + 3 * v);
        bool known = mesh->weft && !(mesh->weave_confidence && !(mesh->weave_confidence[v] > 0.0f));
        if (known) {
            store_direction(out->weft, mesh->weft + 3 * v);
        }
        for (int c = 0; c < 3; ++c) {
            out->dye[c] = o->dye == TSUYA_DYE_OF_VERTICES ? linear[mesh->color[3 * v + (size_t)c]] : (float)o->dye_rgb[c];
        }
        out->material = mesh->material && o->shader_count > 1 ? mesh->material[v] : 0;
    }
}

static tsuya_status fill(tsuya_scene *s, const tsuya_mesh *mesh, const tsuya_scene_options *o)
{
    tsuya_status status = TSUYA_OK;
    tsuya_mesh with_normals = {0};
    const float *normal = mesh->normal;
    TSUYA_NEW(status, s->vertex, mesh->vertex_count);
    TSUYA_NEW(status, s->triangle, 3 * mesh->triangle_count);
    TSUYA_NEW(status, s->shader, (size_t)o->shader_count);
    memcpy(s->triangle, mesh->triangle, 3 * mesh->triangle_count * sizeof *s->triangle);
    memcpy(s->shader, o->shader, (size_t)o->shader_count * sizeof *s->shader);
    s->shader_count = o->shader_count;
    s->dye = o->dye;
    s->bands = o->bands;
    s->dye_of_bands = o->dye == TSUYA_DYE_OF_COLOR ? o->dye_of_bands : NULL;
    if (!normal) {
        TSUYA_GOTO_DONE(status, tsuya_mesh_create(&with_normals, mesh->vertex_count, mesh->triangle_count, TSUYA_MESH_NORMAL));
        memcpy(with_normals.position, mesh->position, 3 * mesh->vertex_count * sizeof *mesh->position);
        memcpy(with_normals.triangle, mesh->triangle, 3 * mesh->triangle_count * sizeof *mesh->triangle);
        TSUYA_GOTO_DONE(status, tsuya_mesh_compute_normals(&with_normals));
        normal = with_normals.normal;
    }
    fill_vertices(s, mesh, normal, o);
    tsuya_mesh_bounds(mesh, &s->low, &s->high);
    double reach = 0.0;
    const double corner[6] = {s->low.x, s->low.y, s->low.z, s->high.x, s->high.y, s->high.z};
    for (int k = 0; k < 6 && mesh->vertex_count > 0; ++k) {
        reach = fmax(reach, fabs(corner[k]));
    }
    s->bias = 8.0 * 0x1.0p-24 * reach;
done:
    tsuya_mesh_free(&with_normals);
    return status;
}

tsuya_status tsuya_scene_create(tsuya_scene **scene, const tsuya_mesh *mesh, const tsuya_scene_options *options)
{
    tsuya_status status = TSUYA_OK;
    tsuya_scene *s = NULL;
    *scene = NULL;
    TSUYA_TRY(check_options(mesh, options));
    TSUYA_NEW(status, s, 1);
    TSUYA_GOTO_DONE(status, tsuya_ray_scene_create(&s->rays, mesh));
    TSUYA_GOTO_DONE(status, fill(s, mesh, options));
    if (!mesh->weft && mesh->triangle_count > 0) {
        tsuya_warn("mesh: no weft; the reflectance is averaged over the azimuth, so the sheen has no direction");
    }
    *scene = s;
    return TSUYA_OK;
done:
    tsuya_scene_free(s);
    return status;
}

void tsuya_scene_free(tsuya_scene *scene)
{
    if (scene) {
        tsuya_ray_scene_free(scene->rays);
        tsuya_free(scene->vertex);
        tsuya_free(scene->triangle);
        tsuya_free(scene->shader);
        tsuya_free(scene);
    }
}

bool tsuya_scene_intersect(const tsuya_scene *scene, const tsuya_ray *ray, tsuya_ray_hit *hit)
{
    return tsuya_ray_scene_intersect(scene->rays, ray, hit);
}

bool tsuya_scene_occluded(const tsuya_scene *scene, const tsuya_ray *ray)
{
    return tsuya_ray_scene_occluded(scene->rays, ray);
}

void tsuya_scene_intersect_packet(const tsuya_scene *scene, const tsuya_ray *ray, int count, tsuya_ray_hit *hit, bool *met)
{
    tsuya_ray_scene_intersect_packet(scene->rays, ray, count, hit, met);
}

void tsuya_scene_occluded_packet(const tsuya_scene *scene, const tsuya_ray *ray, int count, bool *occluded)
{
    tsuya_ray_scene_occluded_packet(scene->rays, ray, count, occluded);
}

const tsuya_shader *tsuya_scene_shader(const tsuya_scene *scene, int index) { return &scene->shader[index]; }

void tsuya_scene_set_shader(tsuya_scene *scene, int index, const tsuya_shader *shader) { scene->shader[index] = *shader; }

const tsuya_bands *tsuya_scene_bands(const tsuya_scene *scene) { return scene->bands; }

const double *tsuya_scene_dye_of_bands(const tsuya_scene *scene) { return scene->dye_of_bands; }

void tsuya_scene_bounds(const tsuya_scene *scene, tsuya_vec3 *low, tsuya_vec3 *high)
{
    *low = scene->low;
    *high = scene->high;
}

void tsuya_scene_prefetch_triangle(const tsuya_scene *scene, const tsuya_ray_hit *hit)
{
    __builtin_prefetch(scene->triangle + 3 * (size_t)hit->triangle);
    __builtin_prefetch(scene->triangle + 3 * (size_t)hit->triangle + 2);
}

void tsuya_scene_prefetch_vertices(const tsuya_scene *scene, const tsuya_ray_hit *hit)
{
    for (size_t c = 0; c < 3; ++c) {
        __builtin_prefetch(&scene->vertex[scene->triangle[3 * (size_t)hit->triangle + c]]);
    }
}

static void take_corner(tsuya_corners *c, int corner, int k, const scene_vertex *v)
{
    const float *from[3] = {v->position, v->normal, v->weft};
    tsuya_planes3 *to[3] = {&c->position[corner], &c->normal[corner], &c->weft[corner]};
    for (int i = 0; i < 3; ++i) {
        to[i]->x[k] = from[i][0];
        to[i]->y[k] = from[i][1];
        to[i]->z[k] = from[i][2];
    }
}

static void take_dye(tsuya_corners *c, int corner, int k, const scene_vertex *v)
{
    for (int i = 0; i < 3; ++i) {
        c->dye[corner][i][k] = v->dye[i];
    }
}

void tsuya_scene_surfaces(const tsuya_scene *scene, const tsuya_ray_hit *hit, int count, const tsuya_planes3 *wo, const tsuya_shader *shader,
                          tsuya_corners *room, tsuya_surfaces *s)
{
    s->count = tsuya_lanes_padded(count);
    s->bias = (float)scene->bias;
    s->dyed = scene->dye != TSUYA_DYE_OF_MATERIAL;
    for (int k = 0; k < s->count; ++k) {
        const tsuya_ray_hit *h = &hit[k < count ? k : 0];
        const uint32_t *index = scene->triangle + 3 * (size_t)h->triangle;
        room->u[k] = h->u;
        room->v[k] = h->v;
        for (int corner = 0; corner < 3; ++corner) {
            take_corner(room, corner, k, &scene->vertex[index[corner]]);
            if (s->dyed) {
                take_dye(room, corner, k, &scene->vertex[index[corner]]);
            }
        }
    }
    tsuya_surfaces_make(s, room, wo, shader->under);
}

const tsuya_shader *tsuya_scene_shader_at(const tsuya_scene *scene, const tsuya_ray_hit *hit)
{
    if (scene->shader_count == 1) {
        return scene->shader;
    }
    const uint32_t *index = scene->triangle + 3 * (size_t)hit->triangle;
    const double b[3] = {1.0 - hit->u - hit->v, hit->u, hit->v};
    int nearest = b[1] > b[0] ? (b[2] > b[1] ? 2 : 1) : (b[2] > b[0] ? 2 : 0);
    return &scene->shader[scene->vertex[index[nearest]].material];
}
