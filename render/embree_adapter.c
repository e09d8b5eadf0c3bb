#include "render/embree_adapter.h"

#include "core/memory.h"

#include <embree3/rtcore.h>

#include <math.h>
#include <string.h>

struct tsuya_ray_scene {
    RTCDevice device;
    RTCScene scene;
};

static tsuya_status check_mesh(const tsuya_mesh *mesh)
{
    for (size_t k = 0; k < 3 * mesh->vertex_count; ++k) {
        if (!isfinite(mesh->position[k])) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "mesh: vertex %zu: %c is %g; expected finite coordinates", k / 3, "xyz"[k % 3],
                              (double)mesh->position[k]);
        }
    }
    for (size_t k = 0; k < 3 * mesh->triangle_count; ++k) {
        if (mesh->triangle[k] >= mesh->vertex_count) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "mesh: triangle %zu: vertex index %u; the mesh has %zu vertices", k / 3,
                              mesh->triangle[k], mesh->vertex_count);
        }
    }
    if (mesh->vertex_count > UINT32_MAX - 1 || mesh->triangle_count > UINT32_MAX - 1) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "mesh: %zu triangles; at most 2^32 − 2 can be rendered", mesh->triangle_count);
    }
    return TSUYA_OK;
}

static tsuya_status check_device(RTCDevice device, const char *what)
{
    enum RTCError error = rtcGetDeviceError(device);
    if (error == RTC_ERROR_NONE) {
        return TSUYA_OK;
    }
    return tsuya_fail(error == RTC_ERROR_OUT_OF_MEMORY ? TSUYA_ERROR_MEMORY : TSUYA_ERROR_UNAVAILABLE, "Embree: %s: error %d%s", what,
                      (int)error, error == RTC_ERROR_OUT_OF_MEMORY ? " (out of memory)" : "");
}

static tsuya_status attach(tsuya_ray_scene *s, const tsuya_mesh *mesh)
{
    RTCGeometry geometry = rtcNewGeometry(s->device, RTC_GEOMETRY_TYPE_TRIANGLE);
    if (!geometry) {
        return check_device(s->device, "geometry");
    }
    float *position = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float),
                                              mesh->vertex_count);
    uint32_t *triangle = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(uint32_t),
                                                 mesh->triangle_count);
    tsuya_status status = TSUYA_OK;
    if (position && triangle) {
        memcpy(position, mesh->position, 3 * mesh->vertex_count * sizeof *position);
        memcpy(triangle, mesh->triangle, 3 * mesh->triangle_count * sizeof *triangle);
        rtcCommitGeometry(geometry);
        rtcAttachGeometry(s->scene, geometry);
    }
    status = check_device(s->device, "mesh buffers");
    rtcReleaseGeometry(geometry);
    return status;
}

tsuya_status tsuya_ray_scene_create(tsuya_ray_scene **scene, const tsuya_mesh *mesh)
{
    tsuya_status status = TSUYA_OK;
    tsuya_ray_scene *s = NULL;
    *scene = NULL;
    TSUYA_TRY(check_mesh(mesh));
    TSUYA_NEW(status, s, 1);
    s->device = rtcNewDevice("threads=1");
    if (!s->device) {
        TSUYA_GOTO_DONE(status, tsuya_fail(TSUYA_ERROR_UNAVAILABLE, "Embree: no device (error %d)", (int)rtcGetDeviceError(NULL)));
    }
    s->scene = rtcNewScene(s->device);
    TSUYA_GOTO_DONE(status, check_device(s->device, "scene"));
    rtcSetSceneFlags(s->scene, RTC_SCENE_FLAG_ROBUST);
    rtcSetSceneBuildQuality(s->scene, RTC_BUILD_QUALITY_HIGH);
    if (mesh->triangle_count > 0) {
        TSUYA_GOTO_DONE(status, attach(s, mesh));
    }
    rtcCommitScene(s->scene);
    TSUYA_GOTO_DONE(status, check_device(s->device, "tree"));
    *scene = s;
    return TSUYA_OK;
done:
    tsuya_ray_scene_free(s);
    return status;
}

void tsuya_ray_scene_free(tsuya_ray_scene *scene)
{
    if (scene) {
        if (scene->scene) {
            rtcReleaseScene(scene->scene);
        }
        if (scene->device) {
            rtcReleaseDevice(scene->device);
        }
        tsuya_free(scene);
    }
}

static struct RTCRay ray_from(const tsuya_ray *r)
{
    return (struct RTCRay){.org_x = r->origin[0], .org_y = r->origin[1], .org_z = r->origin[2], .tnear = r->near,
                           .dir_x = r->direction[0], .dir_y = r->direction[1], .dir_z = r->direction[2], .tfar = r->far,
                           .mask = UINT32_MAX};
}

bool tsuya_ray_scene_intersect(const tsuya_ray_scene *scene, const tsuya_ray *ray, tsuya_ray_hit *hit)
{
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    struct RTCRayHit query = {.ray = ray_from(ray), .hit = {.geomID = RTC_INVALID_GEOMETRY_ID}};
    rtcIntersect1(scene->scene, &context, &query);
    if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) {
        return false;
    }
    *hit = (tsuya_ray_hit){query.ray.tfar, query.hit.u, query.hit.v, query.hit.primID};
    return true;
}

bool tsuya_ray_scene_occluded(const tsuya_ray_scene *scene, const tsuya_ray *ray)
{
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    struct RTCRay query = ray_from(ray);
    rtcOccluded1(scene->scene, &context, &query);
    return query.tfar < 0.0f;
}

static void fill_packet(struct RTCRay8 *packet, int valid[TSUYA_RAY_PACKET], const tsuya_ray *ray, int count)
{
    for (int k = 0; k < TSUYA_RAY_PACKET; ++k) {
        const tsuya_ray *r = &ray[k < count ? k : 0];
        valid[k] = k < count ? -1 : 0;
        packet->org_x[k] = r->origin[0];
        packet->org_y[k] = r->origin[1];
        packet->org_z[k] = r->origin[2];
        packet->tnear[k] = r->near;
        packet->dir_x[k] = r->direction[0];
        packet->dir_y[k] = r->direction[1];
        packet->dir_z[k] = r->direction[2];
        packet->time[k] = 0.0f;
        packet->tfar[k] = r->far;
        packet->mask[k] = UINT32_MAX;
        packet->id[k] = 0;
        packet->flags[k] = 0;
    }
}

void tsuya_ray_scene_intersect_packet(const tsuya_ray_scene *scene, const tsuya_ray *ray, int count, tsuya_ray_hit *hit, bool *met)
{
    _Alignas(32) int valid[TSUYA_RAY_PACKET];
    struct RTCRayHit8 query;
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    fill_packet(&query.ray, valid, ray, count);
    for (int k = 0; k < TSUYA_RAY_PACKET; ++k) {
        query.hit.geomID[k] = RTC_INVALID_GEOMETRY_ID;
        query.hit.instID[0][k] = RTC_INVALID_GEOMETRY_ID;
    }
    rtcIntersect8(valid, scene->scene, &context, &query);
    for (int k = 0; k < count; ++k) {
        met[k] = query.hit.geomID[k] != RTC_INVALID_GEOMETRY_ID;
        hit[k] = (tsuya_ray_hit){query.ray.tfar[k], query.hit.u[k], query.hit.v[k], query.hit.primID[k]};
    }
}

void tsuya_ray_scene_occluded_packet(const tsuya_ray_scene *scene, const tsuya_ray *ray, int count, bool *occluded)
{
    _Alignas(32) int valid[TSUYA_RAY_PACKET];
    struct RTCRay8 query;
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    fill_packet(&query, valid, ray, count);
    rtcOccluded8(valid, scene->scene, &context, &query);
    for (int k = 0; k < count; ++k) {
        occluded[k] = query.tfar[k] < 0.0f;
    }
}
