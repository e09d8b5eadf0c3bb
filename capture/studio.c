/* The studio put together. */
#include "capture/studio_light.h"

#include "core/memory.h"
#include "core/order.h"

#include <math.h>
#include <string.h>

/* One mesh of everything: the cloth, then the props. */
static tsuya_status build_mesh(tsuya_studio *s)
{
    const tsuya_mesh none = {0};
    size_t vertices = 0, triangles = 0;
    for (int k = -1; k < s->prop_count; k++) {
        const tsuya_mesh *m = k >= 0 ? &s->prop[k].mesh : s->cloth ? &s->cloth->mesh : &none;
        vertices += m->vertex_count;
        triangles += m->triangle_count;
    }
    s->cloth_vertices = s->cloth ? s->cloth->mesh.vertex_count : 0;
    s->cloth_triangles = s->cloth ? s->cloth->mesh.triangle_count : 0;
    TSUYA_TRY(tsuya_mesh_create(&s->mesh, vertices, triangles, TSUYA_MESH_NORMAL));
    vertices = triangles = 0;
    for (int k = -1; k < s->prop_count; k++) {
        const tsuya_mesh *m = k >= 0 ? &s->prop[k].mesh : s->cloth ? &s->cloth->mesh : &none;
        if (m->vertex_count > 0) {
            memcpy(s->mesh.position + 3 * vertices, m->position, 3 * m->vertex_count * sizeof(float));
            memcpy(s->mesh.normal + 3 * vertices, m->normal, 3 * m->vertex_count * sizeof(float));
        }
        for (size_t i = 0; i < 3 * m->triangle_count; i++) {
            s->mesh.triangle[3 * triangles + i] = m->triangle[i] + (uint32_t)vertices;
        }
        vertices += m->vertex_count;
        triangles += m->triangle_count;
    }
    return TSUYA_OK;
}

static tsuya_status find_lamps(tsuya_studio *s)
{
    for (int l = 0; l < s->lights->count; l++) {
        if (s->lights->light[l].kind == TSUYA_LIGHT_ENVIRONMENT) {
            continue;
        }
        if (s->lamp_count == TSUYA_STUDIO_LAMPS) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "studio: more than %d lamps", TSUYA_STUDIO_LAMPS);
        }
        s->lamp[s->lamp_count++] = l;
    }
    return TSUYA_OK;
}

tsuya_status tsuya_studio_create(tsuya_studio **studio, const tsuya_studio_cloth *cloth, const tsuya_studio_weave *weave,
                                 const tsuya_light_set *lights, const tsuya_studio_options *options, const tsuya_context *context)
{
    tsuya_status status;
    tsuya_studio *s;
    *studio = NULL;
    TSUYA_NEW(status, s, 1);
    s->cloth = cloth;
    s->weave = weave;
    s->lights = lights;
    s->prop = options->prop;
    s->prop_count = options->prop_count;
    s->gloss = cloth ? options->cloth : NULL;
    if (s->gloss) {
        tsuya_studio_measure_gloss(s);
    }
    TSUYA_GOTO_DONE(status, find_lamps(s));
    TSUYA_GOTO_DONE(status, build_mesh(s));
    size_t slots = STUDIO_SIDES * s->mesh.vertex_count;
    TSUYA_NEW(status, s->arriving, slots * (size_t)s->lamp_count);
    TSUYA_NEW(status, s->visible, slots * (size_t)s->lamp_count);
    TSUYA_NEW(status, s->ambient, 3 * slots);
    TSUYA_NEW(status, s->direct, 3 * slots);
    TSUYA_GOTO_DONE(status, tsuya_ray_scene_create(&s->rays, &s->mesh));
    TSUYA_GOTO_DONE(status, tsuya_studio_light(s, options->samples, context));
    *studio = s;
    s = NULL;
done:
    tsuya_studio_free(s);
    return status;
}

void tsuya_studio_free(tsuya_studio *s)
{
    if (!s) {
        return;
    }
    tsuya_ray_scene_free(s->rays);
    tsuya_mesh_free(&s->mesh);
    tsuya_free(s->arriving);
    tsuya_free(s->visible);
    tsuya_free(s->ambient);
    tsuya_free(s->direct);
    tsuya_free(s);
}

double tsuya_studio_white(const tsuya_studio *s, double albedo)
{
    size_t count = s->cloth_vertices > 0 ? s->cloth_vertices : s->mesh.vertex_count;
    float *irradiance = tsuya_calloc(count, sizeof *irradiance);
    double white = 1.0;
    for (size_t v = 0; irradiance && v < count; v++) {
        irradiance[v] = s->direct[3 * v + 1] + s->ambient[3 * v + 1];
    }
    if (irradiance && count > 0) {
        tsuya_sort_floats(irradiance, count);
        white = albedo * (double)irradiance[(size_t)(0.95 * (double)(count - 1))] / M_PI;
    }
    tsuya_free(irradiance);
    return white;
}
