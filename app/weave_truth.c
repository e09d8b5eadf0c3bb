#include "app/weave_truth.h"

#include "core/memory.h"
#include "core/order.h"
#include "reconstruct/mesh_distance.h"

#include <math.h>

static tsuya_vec3 vector(const float *v) { return (tsuya_vec3){(double)v[0], (double)v[1], (double)v[2]}; }

/* The truth's weft on a triangle: the mean of its corners, which agree but for their sign. */
static tsuya_vec3 true_weft(const tsuya_mesh *truth, uint32_t triangle)
{
    const uint32_t *v = truth->triangle + 3 * (size_t)triangle;
    tsuya_vec3 first = vector(truth->weft + 3 * (size_t)v[0]), sum = first;
    for (int k = 1; k < 3; k++) {
        tsuya_vec3 w = vector(truth->weft + 3 * (size_t)v[k]);
        sum = tsuya_vec3_mad(sum, tsuya_vec3_dot(w, first) < 0.0 ? -1.0 : 1.0, w);
    }
    return sum;
}

static size_t errors(double *error, const tsuya_mesh *mesh, const tsuya_mesh *truth, const tsuya_mesh_tree *tree)
{
    size_t count = 0;
    double reach = 20.0 * tsuya_mesh_mean_edge(mesh);
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        if (mesh->weave_confidence[v] < 0.5f) {
            continue;
        }
        tsuya_mesh_hit hit = tsuya_mesh_tree_closest(tree, tsuya_mesh_position(mesh, v), reach);
        if (hit.triangle != UINT32_MAX) {
            tsuya_vec3 normal = vector(mesh->normal + 3 * v), weft = vector(mesh->weft + 3 * v);
            tsuya_vec3 want = tsuya_vec3_tangent(true_weft(truth, hit.triangle), normal);
            error[count++] = tsuya_deg_from_rad(acos(fmin(fabs(tsuya_vec3_dot(weft, want)), 1.0)));
        }
    }
    return count;
}

tsuya_status tsuya_weave_truth(tsuya_json *figures, const tsuya_mesh *mesh, const char *truth_path)
{
    tsuya_mesh truth = {0};
    tsuya_mesh_tree *tree = NULL;
    double *error = NULL;
    tsuya_status status;
    TSUYA_GOTO_DONE(status, tsuya_ply_load(&truth, truth_path));
    if (!truth.weft || truth.triangle_count == 0) {
        status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: no weft_x weft_y weft_z on a surface", truth_path);
        goto done;
    }
    TSUYA_GOTO_DONE(status, tsuya_mesh_tree_create(&tree, &truth));
    TSUYA_NEW(status, error, mesh->vertex_count);
    size_t count = errors(error, mesh, &truth, tree), wrong = 0;
    for (size_t i = 0; i < count; i++) {
        wrong += error[i] > 45.0;
    }
    tsuya_sort_doubles(error, count);
    tsuya_json *object = tsuya_json_set_object(figures, "angle_error_deg");
    tsuya_json_set_number(object, "median", count > 0 ? error[count / 2] : NAN);
    tsuya_json_set_number(object, "p90", count > 0 ? error[(size_t)(0.9 * (double)(count - 1))] : NAN);
    tsuya_json_set_number(figures, "wrong_family", count > 0 ? (double)wrong / (double)count : NAN);
done:
    tsuya_mesh_tree_free(tree);
    tsuya_free(error);
    tsuya_mesh_free(&truth);
    return status;
}
