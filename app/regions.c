#include "app/regions.h"

#include "core/image.h"
#include "core/memory.h"
#include "core/raster.h"

#include <math.h>

enum { LONGEST_SIDE = 1600, REGIONS = 256 };

typedef struct tally { float seen, inside; } tally;

typedef struct ballot {
    tally *of[REGIONS]; /* vertex_count each; NULL: no mask speaks of this material */
    float *weight;      /* of each vertex in the view at hand; 0: not seen */
    tsuya_vec2 *pixel;
    double edge;        /* mean length of the mesh's edges */
} ballot;

static tsuya_camera reduced(const tsuya_camera *camera)
{
    int longest = camera->width_px > camera->height_px ? camera->width_px : camera->height_px;
    double scale = longest > LONGEST_SIDE ? (double)LONGEST_SIDE / longest : 1.0;
    return tsuya_camera_scaled(camera, (int)fmax(1.0, round(scale * camera->width_px)), (int)fmax(1.0, round(scale * camera->height_px)));
}

/* Cosine of view of a vertex that the raster shows, else 0; and its pixel. */
static float weigh(tsuya_vec2 *pixel, const tsuya_mesh *mesh, size_t v, const tsuya_raster *raster, const tsuya_camera *camera,
                   tsuya_pose camera_from_world, double edge)
{
    tsuya_vec3 p = tsuya_pose_apply(camera_from_world, tsuya_mesh_position(mesh, v));
    if (!tsuya_camera_project(camera, p, pixel) || !(pixel->x > -0.5 && pixel->x < camera->width_px - 0.5) ||
        !(pixel->y > -0.5 && pixel->y < camera->height_px - 0.5)) {
        return 0.0f;
    }
    double depth = raster->depth[(size_t)lround(pixel->y) * (size_t)raster->width_px + (size_t)lround(pixel->x)];
    double cosine = 1.0;
    if (mesh->normal) {
        tsuya_vec3 n = {mesh->normal[3 * v], mesh->normal[3 * v + 1], mesh->normal[3 * v + 2]};
        cosine = fabs(tsuya_vec3_dot(tsuya_mat3_apply(camera_from_world.rotation, n), tsuya_vec3_unit(p)));
    }
    /* a pixel's width, seen aslant, and the triangles' own size */
    double slack = 2.0 * edge + 1.5 * p.z / camera->fx_px / fmax(cosine, 0.2);
    return depth > 0.0 && p.z <= depth + slack && cosine > 0.1 ? (float)cosine : 0.0f;
}

static tsuya_status look(ballot *b, const tsuya_mesh *mesh, const tsuya_view *view, const tsuya_camera *camera,
                         const tsuya_context *context)
{
    tsuya_raster raster = {0};
    tsuya_status status;
    TSUYA_GOTO_DONE(status, tsuya_raster_create(&raster, camera->width_px, camera->height_px));
    TSUYA_GOTO_DONE(status, tsuya_raster_draw(&raster, mesh, camera, view->camera_from_world, context));
#pragma omp parallel for schedule(static) num_threads(context->threads)
    for (size_t v = 0; v < mesh->vertex_count; ++v) {
        b->weight[v] = weigh(&b->pixel[v], mesh, v, &raster, camera, view->camera_from_world, b->edge);
    }
done:
    tsuya_raster_free(&raster);
    return status;
}

static tsuya_status count_mask(ballot *b, const tsuya_mesh *mesh, const tsuya_region_mask *m, const tsuya_camera *full,
                               const tsuya_camera *camera)
{
    tsuya_image mask = {0}, grey = {0}, small = {0};
    tsuya_status status = tsuya_image_load(&mask, m->path);
    TSUYA_GOTO_DONE(status, status);
    if (mask.width_px != full->width_px || mask.height_px != full->height_px) {
        TSUYA_GOTO_DONE(status, tsuya_fail(TSUYA_ERROR_INPUT, "%s: %d × %d; its photograph has %d × %d", m->path, mask.width_px,
                                           mask.height_px, full->width_px, full->height_px));
    }
    TSUYA_GOTO_DONE(status, tsuya_image_grey(&grey, &mask, TSUYA_SAMPLE_U8));
    TSUYA_GOTO_DONE(status, tsuya_image_resize(&small, &grey, camera->width_px, camera->height_px));
    if (!b->of[m->region]) {
        TSUYA_NEW(status, b->of[m->region], mesh->vertex_count);
    }
    for (size_t v = 0; v < mesh->vertex_count; ++v) {
        if (b->weight[v] > 0.0f) {
            float inside;
            tsuya_image_sample_bilinear(&small, b->pixel[v].x, b->pixel[v].y, &inside);
            b->of[m->region][v].seen += b->weight[v];
            b->of[m->region][v].inside += inside > 0.5f ? b->weight[v] : 0.0f;
        }
    }
done:
    tsuya_image_free(&mask);
    tsuya_image_free(&grey);
    tsuya_image_free(&small);
    return status;
}

static bool decide(uint8_t *material, const ballot *b, size_t v, uint8_t rest)
{
    float best = 0.5f;
    bool seen = false;
    *material = rest;
    for (int k = 0; k < REGIONS; ++k) {
        if (b->of[k] && b->of[k][v].seen > 0.0f) {
            float share = b->of[k][v].inside / b->of[k][v].seen;
            seen = true;
            if (share > best) {
                best = share;
                *material = (uint8_t)k;
            }
        }
    }
    return seen;
}

/* Vertices that know nothing take the material of a neighbour that does, ring by ring; in each the lowest triangle speaks first. */
static void spread(tsuya_mesh *mesh, uint8_t *known)
{
    bool any = true;
    for (uint8_t ring = 2; any; ring = ring == 255 ? 2 : (uint8_t)(ring + 1)) {
        any = false;
        for (size_t t = 0; t < mesh->triangle_count; ++t) {
            const uint32_t *v = mesh->triangle + 3 * t;
            for (int k = 0; k < 9; ++k) {
                uint32_t to = v[k / 3], from = v[k % 3];
                if (!known[to] && known[from] && known[from] != ring) {
                    mesh->material[to] = mesh->material[from];
                    known[to] = ring;
                    any = true;
                }
            }
        }
        for (size_t v = 0; v < mesh->vertex_count; ++v) {
            known[v] = known[v] ? 1 : 0;
        }
    }
}

tsuya_status tsuya_regions_vote(tsuya_mesh *mesh, const tsuya_sparse_model *model, const tsuya_region_mask *masks, int mask_count,
                                uint8_t rest, const tsuya_context *context)
{
    tsuya_status status = TSUYA_OK;
    ballot b = {.edge = tsuya_mesh_mean_edge(mesh)};
    uint8_t *known = NULL;
    TSUYA_NEW(status, b.weight, mesh->vertex_count);
    TSUYA_NEW(status, b.pixel, mesh->vertex_count);
    TSUYA_NEW(status, known, mesh->vertex_count);
    TSUYA_GOTO_DONE(status, tsuya_mesh_add_arrays(mesh, TSUYA_MESH_MATERIAL));
    for (int k = 0; k < mask_count; ++k) {
        const tsuya_view *view = &model->view[masks[k].view];
        tsuya_camera camera = reduced(&model->camera[view->camera]);
        if (k == 0 || masks[k].view != masks[k - 1].view) {
            TSUYA_GOTO_DONE(status, look(&b, mesh, view, &camera, context));
        }
        TSUYA_GOTO_DONE(status, count_mask(&b, mesh, &masks[k], &model->camera[view->camera], &camera));
    }
    for (size_t v = 0; v < mesh->vertex_count; ++v) {
        known[v] = decide(&mesh->material[v], &b, v, rest);
    }
    spread(mesh, known);
done:
    for (int k = 0; k < REGIONS; ++k) {
        tsuya_free(b.of[k]);
    }
    tsuya_free(b.weight);
    tsuya_free(b.pixel);
    tsuya_free(known);
    return status;
}
