#include "support.h"

#include "core/memory.h"
#include "core/shapes.h"

static char path[TEST_PATH];

static int make_path(void **state)
{
    (void)state;
    strcpy(path, test_path("mesh.ply"));
    return 0;
}

static tsuya_status load_bytes(tsuya_mesh *mesh, const void *bytes, size_t size)
{
    unlink(path); /* ext4 would wait for the disk when a file is cut and written again */
    FILE *f = fopen(path, "wb");
    assert_non_null(f);
    assert_int_equal(fwrite(bytes, 1, size, f), size);
    assert_int_equal(fclose(f), 0);
    return tsuya_ply_load(mesh, path);
}

/* A body being put together in one of the three formats. */
typedef struct body {
    char bytes[2048];
    size_t size;
    int format; /* 0 ASCII, 1 little, 2 big */
} body;

static void put(body *b, const void *value, size_t size, const char *text)
{
    if (b->format == 0) {
        b->size += (size_t)sprintf(b->bytes + b->size, "%s ", text);
        return;
    }
    for (size_t k = 0; k < size; k++) {
        b->bytes[b->size++] = ((const char *)value)[b->format == 1 ? k : size - 1 - k];
    }
}
static void put_f(body *b, float v) { char t[32]; sprintf(t, "%.9g", (double)v); put(b, &v, sizeof v, t); }
static void put_d(body *b, double v) { char t[32]; sprintf(t, "%.17g", v); put(b, &v, sizeof v, t); }
static void put_u8(body *b, uint8_t v) { char t[8]; sprintf(t, "%d", v); put(b, &v, sizeof v, t); }
static void put_i16(body *b, int16_t v) { char t[8]; sprintf(t, "%d", v); put(b, &v, sizeof v, t); }
static void put_i32(body *b, int32_t v) { char t[16]; sprintf(t, "%d", v); put(b, &v, sizeof v, t); }
static void put_line(body *b)
{
    if (b->format == 0) {
        b->bytes[b->size - 1] = '\n';
    }
}
static void put_text(body *b, const char *text) { b->size += (size_t)sprintf(b->bytes + b->size, "%s", text); }

/* Foreign elements, lists among the vertices' properties, shuffled and mixed types, faces before vertices, a quad. */
static body odd_file(int format)
{
    static const char *const names[] = {"ascii", "binary_little_endian", "binary_big_endian"};
    body b = {.format = format};
    put_text(&b, "ply\r\nformat ");
    put_text(&b, names[format]);
    put_text(&b, " 1.0\r\ncomment by hand\nobj_info x\nelement camera 2\nproperty float64 f\n"
                 "property list uchar short w\nelement face 2\nproperty uint8 flag\nproperty list uint8 int32 vertex_index\n"
                 "element vertex 4\nproperty uchar red\nproperty float z\nproperty list int float rays\nproperty double x\n"
                 "property uchar green\nproperty uchar blue\nproperty short quality\nproperty float32 y\nproperty float nx\n"
                 "end_header\n");
    for (int c = 0; c < 2; c++) {
        put_d(&b, 1.5);
        put_u8(&b, (uint8_t)c);
        for (int k = 0; k < c; k++) {
            put_i16(&b, -3);
        }
        put_line(&b);
    }
    const int32_t face[2][4] = {{0, 1, 2, 3}, {3, 1, 0, 0}};
    for (int f = 0; f < 2; f++) {
        put_u8(&b, 7);
        put_u8(&b, (uint8_t)(4 - f));
        for (int k = 0; k < 4 - f; k++) {
            put_i32(&b, face[f][k]);
        }
        put_line(&b);
    }
    for (int v = 0; v < 4; v++) {
        put_u8(&b, (uint8_t)(10 * v));
        put_f(&b, 0.1f * (float)v);
        put_i32(&b, v == 2 ? 2 : 0);
        for (int k = 0; k < (v == 2 ? 2 : 0); k++) {
            put_f(&b, 8.5f);
        }
        put_d(&b, 1.0 / 3.0 + v);
        put_u8(&b, 1);
        put_u8(&b, 2);
        put_i16(&b, -1);
        put_f(&b, (float)-v);
        put_f(&b, 3.0f);
        put_line(&b);
    }
    return b;
}

static void check_odd_mesh(const tsuya_mesh *mesh)
{
    const uint32_t triangles[9] = {0, 1, 2, 0, 2, 3, 3, 1, 0};
    assert_int_equal(mesh->vertex_count, 4);
    assert_int_equal(mesh->triangle_count, 3);
    assert_memory_equal(mesh->triangle, triangles, sizeof triangles);
    assert_null(mesh->normal); /* nx alone is no normal */
    assert_non_null(mesh->color);
    for (int v = 0; v < 4; v++) {
        assert_true(mesh->position[3 * v] == (float)(1.0 / 3.0 + v) && mesh->position[3 * v + 1] == (float)-v);
        assert_true(mesh->position[3 * v + 2] == 0.1f * (float)v);
        assert_true(mesh->color[3 * v] == 10 * v && mesh->color[3 * v + 2] == 2);
    }
}

static void all_three_formats_say_the_same(void **state)
{
    (void)state;
    for (int format = 0; format < 3; format++) {
        body b = odd_file(format);
        tsuya_mesh mesh;
        assert_int_equal(load_bytes(&mesh, b.bytes, b.size), TSUYA_OK);
        check_odd_mesh(&mesh);
        tsuya_mesh_free(&mesh);
    }
}

static void a_file_cut_anywhere_is_refused(void **state)
{
    (void)state;
    for (int format = 0; format < 3; format++) {
        body b = odd_file(format);
        /* in ASCII the last line's end may be missing */
        for (size_t size = 0; size < b.size - (format == 0); size++) {
            tsuya_mesh mesh;
            assert_int_equal(load_bytes(&mesh, b.bytes, size), TSUYA_ERROR_INPUT);
            assert_null(mesh.position);
            assert_non_null(strstr(tsuya_reason(), path));
        }
    }
}

static void no_changed_byte_does_harm(void **state)
{
    (void)state;
    static const unsigned char values[] = {0, 1, 0x7f, 0x80, 0xff, '\n', ' ', '-', '9', 'e'};
    for (int format = 0; format < 3; format++) {
        body b = odd_file(format);
        for (size_t at = 0; at < b.size; at++) {
            char old = b.bytes[at];
            for (size_t k = 0; k < sizeof values; k++) {
                tsuya_mesh mesh;
                b.bytes[at] = (char)values[k];
                tsuya_status status = load_bytes(&mesh, b.bytes, b.size);
                assert_true(status == TSUYA_OK || status == TSUYA_ERROR_INPUT);
                tsuya_mesh_free(&mesh);
            }
            b.bytes[at] = old;
        }
    }
}

#define HEAD "ply\nformat ascii 1.0\n"
#define XYZ "property float x\nproperty float y\nproperty float z\n"
#define FACES "property list uchar int vertex_indices\n"

static void hostile_files_are_refused_with_a_reason(void **state)
{
    (void)state;
    static const struct { const char *text, *reason; } cases[] = {
        {"", "not a PLY"},
        {"plyx\n", "not a PLY"},
        {"ply\nelement vertex 1\n", "line 2"},
        {"ply\nformat ascii 2.0\n", "format"},
        {"ply\nformat binary_middle_endian 1.0\n", "format"},
        {HEAD "element vertex 1000000000000000000\n" XYZ "end_header\n0 0 0\n", "counts 1000000000000000000"},
        {HEAD "element vertex 1e18\n" XYZ "end_header\n0 0 0\n", "1e18"},
        {HEAD "element vertex -1\n" XYZ "end_header\n0 0 0\n", "-1"},
        {HEAD "element vertex 99999999999999999999999\n" XYZ "end_header\n0 0 0\n", "99999999999999999999999"},
        {HEAD "element vertex 2\n" XYZ "end_header\n0 0 0\n", "counts 2"},
        {HEAD "element vertex 2\n" XYZ "end_header\n0 0 0\n1 1    \n", "ends inside vertex 1 of 2"},
        {HEAD "element vertex 1\n" XYZ "end_header\n0 zero 0\n", "line 8: zero"},
        {HEAD "element vertex 2\n" XYZ "end_header\n0 0 0\n0 nan 0\n", "vertex 1: y is nan"},
        {HEAD "element vertex 1\n" XYZ "end_header\n0 0 -inf\n", "vertex 0: z is -inf"},
        {HEAD "element vertex 1\n" XYZ "end_header\n0 0 1e300\n", "vertex 0: z is 1e+300"},
        {HEAD "element vertex 1\nproperty float x\nproperty float y\nend_header\n0 0\n", "no property z"},
        {HEAD "element vertex 1\nproperty list uchar float x\nproperty float y\nproperty float z\nend_header\n1 0 0 0\n",
         "x is a list"},
        {HEAD "element vertex 1\nproperty list float float w\n" XYZ "end_header\n1 0 0 0 0\n", "float"},
        {HEAD "element vertex 1\nproperty list int float w\n" XYZ "end_header\n4000000000 0 0 0 0\n", "ends inside"},
        {HEAD "element vertex 1\nproperty list int float w\n" XYZ "end_header\n-1 0 0 0 0\n", "length of -1"},
        {HEAD "element vertex 1\n" XYZ "property quad x\nend_header\n0 0 0 0\n", "quad is no type"},
        {HEAD "element vertex 1\n" XYZ "property float x\nend_header\n0 0 0 0\n", "twice"},
        {HEAD "element vertex 1\n" XYZ "element vertex 1\n" XYZ "end_header\n0 0 0\n0 0 0\n", "twice"},
        {HEAD "property float x\nend_header\n", "belongs to an element"},
        {HEAD "element vertex\nend_header\n", "a name and a count"},
        {HEAD "element face 1\n" FACES "end_header\n3 0 0 0\n", "no element vertex"},
        {HEAD "elephant 1\nend_header\n", "elephant"},
        {HEAD "element vertex 1\n" XYZ "0 0 0\n", "no keyword"},
        {HEAD "element vertex 1\n" XYZ, "end_header"},
        {HEAD "element vertex 1\n" XYZ "element face 1\n" FACES "end_header\n0 0 0\n3 0 0 1\n", "names vertex 1"},
        {HEAD "element vertex 1\n" XYZ "element face 1\n" FACES "end_header\n0 0 0\n3 0 0 -1\n", "names vertex -1"},
        {HEAD "element vertex 1\n" XYZ "element face 1\n" FACES "end_header\n0 0 0\n3 0 0 0.5\n", "names vertex 0.5"},
        {HEAD "element vertex 1\n" XYZ "element face 1\n" FACES "end_header\n0 0 0\n2 0 0 0\n", "2 corners"},
        {HEAD "element vertex 1\n" XYZ "element face 1\n" FACES "end_header\n0 0 0\n256 0 0 0\n", "256 corners"},
        {HEAD "element vertex 1\n" XYZ "element face 900\n" FACES "end_header\n0 0 0\n3 0 0 0\n", "face counts 900"},
        {HEAD "element vertex 1\n" XYZ "element face 1\nproperty list uchar float vertex_indices\nend_header\n0 0 0\n3 0 0 0\n",
         "whole numbers"},
        {HEAD "element vertex 1\n" XYZ "element face 1\nproperty int vertex_indices\nend_header\n0 0 0\n3\n", "list"},
    };
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        tsuya_mesh mesh;
        assert_int_equal(load_bytes(&mesh, cases[c].text, strlen(cases[c].text)), TSUYA_ERROR_INPUT);
        if (!strstr(tsuya_reason(), cases[c].reason)) {
            fail_msg("case %zu: \"%s\" does not name \"%s\"", c, tsuya_reason(), cases[c].reason);
        }
        assert_null(mesh.position);
    }
}

static void long_names_and_many_parts_are_bounded(void **state)
{
    (void)state;
    char text[200000] = HEAD;
    size_t size = strlen(text);
    for (int e = 0; e < 100; e++) {
        size += (size_t)sprintf(text + size, "element e%d 0\n", e);
    }
    tsuya_mesh mesh;
    assert_int_equal(load_bytes(&mesh, text, size), TSUYA_ERROR_INPUT);
    size = (size_t)sprintf(text, HEAD "element vertex 0\n");
    for (int p = 0; p < 400; p++) {
        size += (size_t)sprintf(text + size, "property float p%d\n", p);
    }
    assert_int_equal(load_bytes(&mesh, text, size), TSUYA_ERROR_INPUT);
    size = (size_t)sprintf(text, HEAD "element ");
    memset(text + size, 'v', 100000);
    size += 100000;
    size += (size_t)sprintf(text + size, " 1\nend_header\n");
    assert_int_equal(load_bytes(&mesh, text, size), TSUYA_ERROR_INPUT);
    /* an element without properties takes no room, whatever it counts; a long comment is no harm */
    size = (size_t)sprintf(text, HEAD "comment ");
    memset(text + size, 'c', 100000);
    size += 100000;
    size += (size_t)sprintf(text + size, "\nelement nothing 1000000000000000000\nelement vertex 0\n" XYZ "end_header\n");
    assert_int_equal(load_bytes(&mesh, text, size), TSUYA_OK);
    assert_int_equal(mesh.vertex_count, 0);
    tsuya_mesh_free(&mesh);
}

static void missing_files_and_folders_are_named(void **state)
{
    (void)state;
    tsuya_mesh mesh;
    assert_int_equal(tsuya_ply_load(&mesh, "no/such/file.ply"), TSUYA_ERROR_IO);
    assert_non_null(strstr(tsuya_reason(), "no/such/file.ply"));
    assert_int_not_equal(tsuya_ply_load(&mesh, "."), TSUYA_OK);
}

static void colours_of_other_types_are_scaled(void **state)
{
    (void)state;
    static const char text[] = HEAD "element vertex 1\n" XYZ "property float red\nproperty ushort green\nproperty int blue\n"
                               "end_header\n0 0 0 0.5 65535 300\n";
    tsuya_mesh mesh;
    assert_int_equal(load_bytes(&mesh, text, sizeof text - 1), TSUYA_OK);
    assert_int_equal(mesh.color[0], 128);
    assert_int_equal(mesh.color[1], 255);
    assert_int_equal(mesh.color[2], 255);
    tsuya_mesh_free(&mesh);
}

static tsuya_status marked_sphere(tsuya_mesh *mesh)
{
    TSUYA_TRY(shape_sphere(mesh, (tsuya_vec3){0.1, -0.2, 0.3}, 1.0 / 3.0, 4, 5));
    tsuya_status status = tsuya_mesh_add_arrays(mesh, 0xffff);
    for (size_t v = 0; status == TSUYA_OK && v < mesh->vertex_count; v++) {
        mesh->evidence[v] = (float)v;
        mesh->sigma[v] = 1e-5f / (float)(v + 1);
        mesh->weave_confidence[v] = 1.0f / (float)(v + 1);
        mesh->material[v] = (uint8_t)(v * 3);
        mesh->color[3 * v + 1] = (uint8_t)(255 - v);
        mesh->weft[3 * v] = 1.0f;
    }
    if (status != TSUYA_OK) {
        tsuya_mesh_free(mesh);
    }
    return status;
}

static void what_is_written_reads_back_bit_for_bit(void **state)
{
    (void)state;
    tsuya_mesh mesh, back;
    assert_int_equal(marked_sphere(&mesh), TSUYA_OK);
    assert_int_equal(tsuya_mesh_compute_normals(&mesh), TSUYA_OK);
    static const char *const comments[] = {"one", "two words"};
    for (int ascii = 0; ascii < 2; ascii++) {
        assert_int_equal(tsuya_ply_save(&mesh, path, &(tsuya_ply_save_options){ascii, 2, comments}), TSUYA_OK);
        assert_int_equal(tsuya_ply_load(&back, path), TSUYA_OK);
        size_t n = mesh.vertex_count;
        assert_int_equal(back.vertex_count, n);
        assert_int_equal(back.triangle_count, mesh.triangle_count);
        assert_memory_equal(back.position, mesh.position, 12 * n);
        assert_memory_equal(back.normal, mesh.normal, 12 * n);
        assert_memory_equal(back.color, mesh.color, 3 * n);
        assert_memory_equal(back.weft, mesh.weft, 12 * n);
        assert_memory_equal(back.weave_confidence, mesh.weave_confidence, 4 * n);
        assert_memory_equal(back.evidence, mesh.evidence, 4 * n);
        assert_memory_equal(back.sigma, mesh.sigma, 4 * n);
        assert_memory_equal(back.material, mesh.material, n);
        assert_memory_equal(back.triangle, mesh.triangle, 12 * mesh.triangle_count);
        tsuya_mesh_free(&back);
    }
    tsuya_mesh_free(&mesh);
}

static void what_cannot_be_read_back_is_not_written(void **state)
{
    (void)state;
    tsuya_mesh mesh;
    assert_int_equal(shape_sphere(&mesh, (tsuya_vec3){0, 0, 0}, 1.0, 3, 3), TSUYA_OK);
    static const char *const comments[] = {"two\nlines"};
    assert_int_equal(tsuya_ply_save(&mesh, path, &(tsuya_ply_save_options){false, 1, comments}), TSUYA_ERROR_INPUT);
    mesh.triangle[4] = 999;
    assert_int_equal(tsuya_ply_save(&mesh, path, NULL), TSUYA_ERROR_INPUT);
    mesh.triangle[4] = 0;
    mesh.position[7] = NAN;
    assert_int_equal(tsuya_ply_save(&mesh, path, NULL), TSUYA_ERROR_INPUT);
    assert_non_null(strstr(tsuya_reason(), "vertex 2"));
    mesh.position[7] = 0.0f;
    assert_int_not_equal(tsuya_ply_save(&mesh, "no/such/folder/x.ply", NULL), TSUYA_OK);
    tsuya_mesh_free(&mesh);
}

static tsuya_status save_and_load(void)
{
    tsuya_mesh mesh = {0}, back = {0};
    tsuya_status status;
    TSUYA_GOTO_DONE(status, marked_sphere(&mesh));
    TSUYA_GOTO_DONE(status, tsuya_ply_save(&mesh, path, NULL));
    TSUYA_GOTO_DONE(status, tsuya_ply_load(&back, path));
done:
    tsuya_mesh_free(&mesh);
    tsuya_mesh_free(&back);
    return status;
}

static void every_allocation_may_fail(void **state)
{
    (void)state;
    tsuya_memory_fail_at(0);
    assert_int_equal(save_and_load(), TSUYA_OK);
    uint64_t count = tsuya_memory_fail_at(0);
    assert_true(count > 10);
    for (uint64_t n = 1; n <= count; n++) {
        tsuya_memory_fail_at(n);
        assert_int_equal(save_and_load(), TSUYA_ERROR_MEMORY);
    }
    tsuya_memory_fail_at(0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(all_three_formats_say_the_same),
        cmocka_unit_test(a_file_cut_anywhere_is_refused),
        cmocka_unit_test(no_changed_byte_does_harm),
        cmocka_unit_test(hostile_files_are_refused_with_a_reason),
        cmocka_unit_test(long_names_and_many_parts_are_bounded),
        cmocka_unit_test(missing_files_and_folders_are_named),
        cmocka_unit_test(colours_of_other_types_are_scaled),
        cmocka_unit_test(what_is_written_reads_back_bit_for_bit),
        cmocka_unit_test(what_cannot_be_read_back_is_not_written),
        cmocka_unit_test(every_allocation_may_fail),
    };
    return cmocka_run_group_tests(tests, make_path, test_folder_tear_down);
}
