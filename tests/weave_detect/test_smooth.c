/* Directions on a mesh: transport along edges, smoothing, choices along the surest edges. */
#include "support.h"

#include "core/memory.h"
#include "weave_detect/field_figures.h"
#include "weave_detect/smooth.h"
#include "weave_detect/spanning.h"
#include "weave_detect/votes.h"
#include "weave_detect/weft_hints.h"

#include <math.h>

enum { SIDE = 24 };

/* A sheet of SIDE × SIDE vertices rolled onto a cylinder of `turn` radians (0: flat). */
static void make_sheet(tsuya_mesh *mesh, double turn)
{
    assert_ok(tsuya_mesh_create(mesh, SIDE * SIDE, 2 * (SIDE - 1) * (SIDE - 1), 0));
    double radius = turn > 0.0 ? (SIDE - 1) / turn : 0.0;
    for (int j = 0; j < SIDE; j++) {
        for (int i = 0; i < SIDE; i++) {
            float *p = mesh->position + 3 * (j * SIDE + i);
            p[0] = (float)(turn > 0.0 ? radius * sin(i / radius) : i);
            p[1] = (float)j;
            p[2] = (float)(turn > 0.0 ? radius * cos(i / radius) : 0.0);
        }
    }
    uint32_t *t = mesh->triangle;
    for (uint32_t j = 0; j + 1 < SIDE; j++) {
        for (uint32_t i = 0; i + 1 < SIDE; i++) {
            uint32_t v = j * SIDE + i;
            const uint32_t six[6] = {v, v + 1, v + SIDE, v + 1, v + SIDE + 1, v + SIDE};
            memcpy(t, six, sizeof six);
            t += 6;
        }
    }
    assert_ok(tsuya_mesh_compute_normals(mesh));
}

static double angle_of(const tsuya_mesh *mesh, size_t v, tsuya_vec3 direction)
{
    const float *n = mesh->normal + 3 * v;
    tsuya_vec3 first, second;
    tsuya_tangent_basis(&first, &second, (tsuya_vec3){(double)n[0], (double)n[1], (double)n[2]});
    return atan2(tsuya_vec3_dot(direction, second), tsuya_vec3_dot(direction, first));
}

static void test_transport_keeps_a_parallel_field(void **state)
{
    (void)state;
    tsuya_mesh mesh;
    tsuya_mesh_graph graph;
    make_sheet(&mesh, 2.0);
    assert_ok(tsuya_mesh_graph_create(&graph, &mesh));
    for (uint32_t v = 0; v < graph.vertex_count; v++) { /* along the cylinder's axis everywhere */
        for (uint32_t e = graph.start[v]; e < graph.start[v + 1]; e++) {
            double here = angle_of(&mesh, v, (tsuya_vec3){0, 1, 0}), there = angle_of(&mesh, graph.neighbour[e], (tsuya_vec3){0, 1, 0});
            assert_true(fabs(remainder(there + (double)graph.turn_rad[e] - here, 2.0 * M_PI)) < 1e-4);
            uint32_t back = tsuya_mesh_graph_find(&graph, graph.neighbour[e], v);
            assert_true(back != UINT32_MAX);
            assert_true(fabs(remainder((double)graph.turn_rad[e] + (double)graph.turn_rad[back], 2.0 * M_PI)) < 1e-4);
            assert_float_equal(graph.weight[e], graph.weight[back], 1e-4);
        }
    }
    int rim = 0;
    for (uint32_t v = 0; v < graph.vertex_count; v++) {
        rim += graph.rim[v];
    }
    assert_int_equal(rim, 4 * (SIDE - 1));
    tsuya_mesh_graph_free(&graph);
    tsuya_mesh_free(&mesh);
}

static void test_smoothing_fills_from_two_ends(void **state)
{
    (void)state;
    enum { N = SIDE * SIDE };
    static tsuya_complex z[N], target[N];
    static double pull[N];
    for (int fold = 2; fold <= 4; fold += 2) {
        tsuya_mesh mesh;
        tsuya_mesh_graph graph;
        tsuya_context context = tsuya_context_default();
        make_sheet(&mesh, 2.5);
        assert_ok(tsuya_mesh_graph_create(&graph, &mesh));
        memset(z, 0, sizeof z);
        memset(pull, 0, sizeof pull);
        for (size_t j = 0; j < SIDE; j++) { /* the axis is known at both ends of the sheet alone */
            for (size_t k = 0; k < 2; k++) {
                size_t v = j * SIDE + k * (SIDE - 1);
                double angle = angle_of(&mesh, v, (tsuya_vec3){0, 1, 0});
                target[v] = (tsuya_complex){cos(fold * angle), sin(fold * angle)};
                pull[v] = 1.0;
            }
        }
        assert_ok(tsuya_smooth_directions(z, target, pull, NULL, fold, &graph, &context));
        for (size_t v = 0; v < N; v++) {
            double want = fold * angle_of(&mesh, v, (tsuya_vec3){0, 1, 0});
            assert_true(fabs(remainder(atan2(z[v].im, z[v].re) - want, 2.0 * M_PI)) < 2e-3);
        }
        tsuya_mesh_graph_free(&graph);
        tsuya_mesh_free(&mesh);
    }
}

static void test_threads_do_not_change_the_smoothing(void **state)
{
    (void)state;
    enum { N = SIDE * SIDE };
    static tsuya_complex z[2][N], target[N];
    static double pull[N];
    tsuya_mesh mesh;
    tsuya_mesh_graph graph;
    make_sheet(&mesh, 1.0);
    assert_ok(tsuya_mesh_graph_create(&graph, &mesh));
    for (size_t v = 0; v < N; v++) {
        double angle = 6.0 * tsuya_random_uniform(1, 2, v);
        target[v] = (tsuya_complex){cos(angle), sin(angle)};
        pull[v] = tsuya_random_uniform(1, 3, v);
    }
    for (int k = 0; k < 2; k++) {
        tsuya_context context = tsuya_context_default();
        context.threads = k + 1;
        assert_ok(tsuya_smooth_directions(z[k], target, pull, NULL, 4, &graph, &context));
    }
    assert_memory_equal(z[0], z[1], sizeof z[0]);
    tsuya_mesh_graph_free(&graph);
    tsuya_mesh_free(&mesh);
}

static void test_choices_follow_the_surest_edges(void **state)
{
    (void)state;
    /* a ring of four where one edge lies: the least trusted one loses */
    tsuya_choice_edge edge[] = {{0, 1, 0.9f, 1}, {1, 2, 0.8f, 0}, {2, 3, 0.7f, 1}, {3, 0, 0.1f, 1}, {5, 6, 0.5f, 1}};
    uint8_t choice[7];
    uint32_t root[7];
    assert_ok(tsuya_spanning_choices(choice, root, edge, 5, 7));
    assert_int_equal(choice[0] ^ choice[1], 1);
    assert_int_equal(choice[1] ^ choice[2], 0);
    assert_int_equal(choice[2] ^ choice[3], 1);
    assert_int_equal(choice[5] ^ choice[6], 1);
    assert_int_equal(root[0], root[3]);
    assert_int_not_equal(root[0], root[4]);
    assert_int_not_equal(root[4], root[5]);
}

/* Crosses that turn by a quarter (a half) around a point of a flat sheet, −1 … 1 times: found where they were put. */
static void test_singularities_are_placed(void **state)
{
    (void)state;
    enum { N = SIDE * SIDE };
    static float weft_rad[N];
    const double x0 = 11.3, y0 = 9.6;
    tsuya_mesh mesh;
    tsuya_mesh_graph graph;
    tsuya_votes votes = {0};
    static tsuya_evidence evidence[N];
    make_sheet(&mesh, 0.0);
    assert_ok(tsuya_mesh_add_arrays(&mesh, TSUYA_MESH_CONFIDENCE | TSUYA_MESH_SHEAR | TSUYA_MESH_THREADS));
    assert_ok(tsuya_mesh_graph_create(&graph, &mesh));
    for (int quarters = -2; quarters <= 2; quarters++) {
        tsuya_weave_mesh_info info;
        for (size_t v = 0; v < N; v++) {
            double angle = 0.25 * quarters * atan2((double)mesh.position[3 * v + 1] - y0, (double)mesh.position[3 * v] - x0);
            double turned = angle_of(&mesh, v, (tsuya_vec3){cos(angle), sin(angle), 0});
            weft_rad[v] = (float)(turned + 0.5 * M_PI * (double)(v % 2)); /* families may change places */
        }
        tsuya_field_view view = {&mesh, &graph, &votes, evidence, weft_rad, NULL, true, TSUYA_WEFT_UNKNOWN};
        assert_ok(tsuya_field_figures(&info, &view));
        int sum = 0;
        for (int i = 0; i < info.singularities; i++) { /* a half turn may be seen as two quarters side by side */
            sum += info.singularity[i].quarters;
            assert_true(hypot(info.singularity[i].position.x - x0, info.singularity[i].position.y - y0) < 1.5);
        }
        assert_int_equal(sum, quarters);
        assert_true(info.singularities <= abs(quarters));
        tsuya_weave_mesh_info_free(&info);
    }
    tsuya_mesh_graph_free(&graph);
    tsuya_mesh_free(&mesh);
}

/* A sheet's sides are level or upright rims, its corners none; families askew to a rim say nothing. */
static void test_rims_tell_the_weft(void **state)
{
    (void)state;
    tsuya_mesh mesh;
    tsuya_mesh_graph graph;
    const tsuya_vec3 up = {0, 1, 0};
    make_sheet(&mesh, 0.0);
    assert_ok(tsuya_mesh_graph_create(&graph, &mesh));
    for (size_t v = 0; v < SIDE * SIDE; v++) {
        tsuya_vec3 along;
        size_t i = v % SIDE, j = v / SIDE;
        bool upright = i == 0 || i == SIDE - 1, level = j == 0 || j == SIDE - 1;
        assert_true(tsuya_rim_direction(&along, &mesh, &graph, v) == (upright != level));
        if (upright != level) {
            double rim = angle_of(&mesh, v, along), first = angle_of(&mesh, v, (tsuya_vec3){1, 0, 0}); /* the first family is the level one */
            double cosine = tsuya_vec3_dot(along, up);
            assert_float_equal(tsuya_rim_hint(first - rim, cosine), 1.0, 0.0);
            assert_float_equal(tsuya_rim_hint(first - rim + 0.5 * M_PI, cosine), -1.0, 0.0);
            assert_float_equal(tsuya_rim_hint(first - rim + 0.6, cosine), 0.0, 0.0);
        }
    }
    assert_float_equal(tsuya_rim_hint(0.0, 0.6), 0.0, 0.0);
    tsuya_mesh_graph_free(&graph);
    tsuya_mesh_free(&mesh);
}

static void test_what_names_the_weft(void **state)
{
    (void)state;
    tsuya_weft_told told;
    tsuya_weft_hints h = {.count = -0.1, .count_weight = 1.0, .rim = 0.1, .rim_weight = 1.0, .level = 20.0, .user = -1.0};
    assert_false(tsuya_weft_decide(&told, &h));
    assert_int_equal(told, TSUYA_WEFT_UNKNOWN);
    h.rim = -0.8;
    assert_true(tsuya_weft_decide(&told, &h));
    assert_int_equal(told, TSUYA_WEFT_HEM);
    h.count = 0.9;
    assert_false(tsuya_weft_decide(&told, &h));
    assert_int_equal(told, TSUYA_WEFT_COUNT);
    h.has_user = true;
    assert_true(tsuya_weft_decide(&told, &h));
    assert_int_equal(told, TSUYA_WEFT_USER);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_transport_keeps_a_parallel_field), cmocka_unit_test(test_smoothing_fills_from_two_ends),
        cmocka_unit_test(test_threads_do_not_change_the_smoothing), cmocka_unit_test(test_choices_follow_the_surest_edges),
        cmocka_unit_test(test_rims_tell_the_weft), cmocka_unit_test(test_what_names_the_weft),
        cmocka_unit_test(test_singularities_are_placed),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
