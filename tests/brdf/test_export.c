/* Exported files through readers that know nothing of the writer: the lookup of a renderer written from the publication, the program's reader
 * of RGL tensors, which inverts the warp of any file, and the index arithmetic of MERL's paper. */
#include "brdf/export.h"
#include "brdf/fit.h"
#include "brdf/measured_bsdf.h"
#include "brdf/samples.h"
#include "core/context.h"
#include "core/json.h"
#include "core/memory.h"
#include "support.h"

static tsuya_material *surface(double weft, double warp, const double strength[3])
{
    static const double dye[3] = {0.1, 0.2, 0.3};
    tsuya_material *m;
    assert_ok(tsuya_material_ggx(&m, weft, warp, strength, 1.5, dye));
    return m;
}

static tsuya_material *cloth(double weft, double warp) { return surface(weft, warp, (const double[3]){0.3, 0.2, 0.1}); }

static void test_rgl(void **state)
{
    (void)state;
    tsuya_material *m = cloth(0.5, 0.25);
    tsuya_export_loss loss;
    tsuya_samples s;
    assert_ok(tsuya_export_rgl(&loss, test_path("a.bsdf"), m));
    assert_ok(tsuya_samples_load(&s, test_path("a.bsdf")));
    assert_true(s.count > 100000 && s.channel_count == 3);
    double *g = tsuya_calloc((size_t)s.count * 3, sizeof *g);
    assert_non_null(g);
    tsuya_material_predict(g, m, &s);
    double nodes = tsuya_samples_error(&s, g, -1).cbrt;
    print_message("RGL: nodes %.2e, between them %.4f, CIEDE2000 %.3f / %.3f\n", nodes, loss.cbrt, loss.de00_median, loss.de00_p95);
    assert_true(nodes < 1e-4);      /* every node is the material's value */
    assert_true(loss.cbrt < 0.02 && loss.de00_p95 < 2.0);
    tsuya_free(g);
    tsuya_samples_free(&s);
    tsuya_material_free(m);
}

static tsuya_vec3 to_75_degrees(uint64_t stream, uint64_t k)
{
    double z = 0.26 + 0.74 * tsuya_random_uniform(21, stream, 2 * k), r = sqrt(1.0 - z * z), phi = 2.0 * M_PI * tsuya_random_uniform(21, stream, 2 * k + 1);
    return (tsuya_vec3){r * cos(phi), r * sin(phi), z};
}

/* What a renderer sees of a file, against the material: e_cbrt over random pairs of directions. */
static double seen_error(const measured_bsdf *b, const tsuya_material *m)
{
    enum { PAIRS = 2000 };
    tsuya_samples s;
    tsuya_material_info info = tsuya_material_get_info(m);
    assert_ok(tsuya_samples_create(&s, PAIRS, info.channel_count, info.channel));
    double *seen = tsuya_calloc((size_t)PAIRS * (size_t)info.channel_count, sizeof *seen);
    assert_non_null(seen);
    for (int k = 0; k < PAIRS; ++k) {
        s.wi[k] = to_75_degrees(1, (uint64_t)k);
        s.wo[k] = to_75_degrees(2, (uint64_t)k);
        tsuya_material_eval(m, NULL, s.wi[k], s.wo[k], s.value + k * info.channel_count);
        measured_bsdf_eval(seen + k * info.channel_count, b, s.wi[k], s.wo[k]);
    }
    double e = tsuya_samples_error(&s, seen, -1).cbrt;
    tsuya_free(seen);
    tsuya_samples_free(&s);
    return e;
}

/* The lookup itself, on a real file: two readers that share no line agree at every node of a table whose warp is not the identity. */
static void test_lookup_on_a_real_file(void **state)
{
    (void)state;
    const char *path = test_data("brdf/rgl_container_example.bsdf");
    if (!path) {
        skip();
    }
    tsuya_samples s;
    measured_bsdf *b = measured_bsdf_open(path);
    assert_non_null(b);
    assert_ok(tsuya_samples_load(&s, path));
    double *seen = tsuya_calloc((size_t)s.count * 3, sizeof *seen);
    assert_non_null(seen);
    for (int k = 0; k < s.count; ++k) {
        measured_bsdf_eval(seen + 3 * k, b, s.wi[k], s.wo[k]);
        for (int c = 0; c < 3 && s.wi[k].z > 0.99999; ++c) { /* light along the normal has no azimuth to count from */
            s.value[3 * k + c] = NAN;
        }
    }
    double e = tsuya_samples_error(&s, seen, -1).cbrt;
    print_message("a real file, read twice: e_cbrt %.2e over %d nodes\n", e, s.count);
    assert_true(e < 1e-3);
    tsuya_free(seen);
    tsuya_samples_free(&s);
    measured_bsdf_close(b);
}

/* A renderer draws by the file's luminance: f cosθo over that density is the albedo, give or take the table's steps. */
static void assert_sampling_follows(const measured_bsdf *b)
{
    double sum = 0.0, square = 0.0;
    int n = 0;
    tsuya_vec3 wi = to_75_degrees(3, 1);
    for (uint64_t k = 0; k < 200; ++k) {
        double value[3];
        tsuya_vec3 wo = to_75_degrees(4, k);
        measured_bsdf_eval(value, b, wi, wo);
        double weight = (value[0] + value[1] + value[2]) * wo.z / measured_bsdf_pdf(b, wi, wo);
        sum += weight;
        square += weight * weight;
        n++;
    }
    double mean = sum / n, spread = sqrt(fmax(square / n - mean * mean, 0.0)) / mean;
    print_message("sampling: mean weight %.3f, spread %.3f of it\n", mean, spread);
    assert_true(spread < 0.1);
}

static void test_rgl_as_a_renderer_reads_it(void **state)
{
    (void)state;
    tsuya_material *m = cloth(0.5, 0.25);
    tsuya_export_loss loss;
    assert_ok(tsuya_export_rgl(&loss, test_path("b.bsdf"), m));
    measured_bsdf *b = measured_bsdf_open(test_path("b.bsdf"));
    assert_non_null(b);
    assert_int_equal(measured_bsdf_channels(b), 3);
    assert_null(measured_bsdf_wavelengths(b));
    double e = seen_error(b, m);
    print_message("RGL: a renderer sees e_cbrt %.4f, stated %.4f\n", e, loss.cbrt);
    assert_true(e < 1.5 * loss.cbrt + 1e-4);
    assert_sampling_follows(b);
    measured_bsdf_close(b);
    tsuya_material_free(m);
}

/* One channel without a wavelength, as a Klems matrix has: a level spectrum for renderers that know nothing else. */
static void test_rgl_of_one_channel(void **state)
{
    (void)state;
    static const char grey[] = "{\"format\": \"tsuya material\", \"version\": \"1.0\", \"name\": \"grey\", \"model\": \"lambert\", \"channels\": [\"visible\"], "
                               "\"dye\": {\"reflectance\": [0.3], \"coupling\": \"lambert\"}, \"parameters\": {}}";
    tsuya_material *m;
    tsuya_export_loss loss;
    assert_ok(tsuya_material_parse(&m, grey, "grey"));
    assert_ok(tsuya_export_rgl(&loss, test_path("c.bsdf"), m));
    assert_true(loss.cbrt < 0.01);
    measured_bsdf *b = measured_bsdf_open(test_path("c.bsdf"));
    assert_non_null(b);
    assert_int_equal(measured_bsdf_channels(b), 2);
    assert_true(measured_bsdf_wavelengths(b)[0] <= 380.0f && measured_bsdf_wavelengths(b)[1] >= 780.0f);
    for (uint64_t k = 0; k < 100; ++k) {
        double value[2];
        measured_bsdf_eval(value, b, to_75_degrees(5, k), to_75_degrees(6, k));
        assert_near(value[0], 0.3 / M_PI, 0.02 * 0.3 / M_PI);
        assert_near(value[1], value[0], 1e-12);
    }
    assert_fails(tsuya_export_gltf(&loss, test_path("c.gltf"), m), "the material's first channel is visible");
    measured_bsdf_close(b);
    tsuya_material_free(m);
}

static double merl_at(const char *bytes, double th, double td, double pd)
{
    double value;
    int i = (int)sqrt(th * 90.0 * 90.0), j = (int)(td), k = (int)pd; /* th in quarter turns, td and pd in degrees */
    memcpy(&value, bytes + 12 + 8 * (size_t)(((i * 90) + j) * 180 + k), 8);
    return value / 1500.0;
}

static void test_merl(void **state)
{
    (void)state;
    tsuya_material *round = cloth(0.4, 0.4), *long_one = cloth(0.6, 0.15);
    tsuya_export_loss loss;
    char *bytes;
    size_t size;
    assert_ok(tsuya_export_merl(&loss, test_path("a.binary"), round));
    assert_true(loss.cbrt < 0.03);
    assert_ok(tsuya_file_load(&bytes, &size, test_path("a.binary"), (size_t)1 << 30));
    assert_int_equal(size, 12 + 8 * 3 * 90 * 90 * 180);
    static const int32_t sides[3] = {90, 90, 180};
    assert_memory_equal(bytes, sides, 12);
    /* light at 40° on the weft, viewer opposite at 20°: the half vector leans by 10°, both lie 30° from it, in one plane */
    tsuya_vec3 wi = tsuya_goniometer_direction(40, 0, 0, 0), wo = tsuya_goniometer_direction(20, 180, 0, 0);
    double value[3];
    tsuya_material_eval(round, NULL, wi, wo, value);
    assert_near(merl_at(bytes, 10.0 / 90.0, 30.4, 0.4), value[0], 0.05 * value[0]);
    tsuya_free(bytes);
    assert_ok(tsuya_export_merl(&loss, test_path("a.binary"), long_one));
    assert_true(loss.cbrt > 0.05); /* anisotropy is lost, and the loss says so */
    tsuya_material_free(round);
    tsuya_material_free(long_one);
}

static const tsuya_json *extension(const tsuya_json *root, const char *name)
{
    return tsuya_json_member(tsuya_json_member(tsuya_json_element(tsuya_json_member(root, "materials"), 0), "extensions"), name);
}

/* GGX fibres of refractive index 1.5 are within what glTF can say: both roughnesses come back, and the rougher axis. */
static void test_gltf(void **state)
{
    (void)state;
    static const double alphas[][2] = {{0.5, 0.2}, {0.2, 0.5}, {0.35, 0.35}};
    for (int k = 0; k < 3; ++k) {
        tsuya_material *m = surface(alphas[k][0], alphas[k][1], (const double[3]){0.04, 0.04, 0.04});
        tsuya_export_loss loss;
        tsuya_json *root;
        assert_ok(tsuya_export_gltf(&loss, test_path("a.gltf"), m));
        assert_ok(tsuya_json_load(&root, test_path("a.gltf")));
        const tsuya_json *pbr = tsuya_json_member(tsuya_json_element(tsuya_json_member(root, "materials"), 0), "pbrMetallicRoughness"), *a = extension(root, "KHR_materials_anisotropy");
        double roughness = tsuya_json_number_or(tsuya_json_member(pbr, "roughnessFactor"), NAN), strength = tsuya_json_number_or(tsuya_json_member(a, "anisotropyStrength"), NAN);
        double rotation = tsuya_json_number_or(tsuya_json_member(a, "anisotropyRotation"), NAN);
        double low = roughness * roughness, high = low + (1.0 - low) * strength * strength;
        print_message("glTF: %.3f and %.3f turned by %.3f; e_cbrt %.4f, CIEDE2000 %.2f / %.2f\n", low, high, rotation, loss.cbrt, loss.de00_median, loss.de00_p95);
        assert_non_null(extension(root, "KHR_materials_sheen"));
        assert_near(low, fmin(alphas[k][0], alphas[k][1]), 0.05);
        assert_near(high, fmax(alphas[k][0], alphas[k][1]), 0.05);
        assert_true(k == 2 || fabs(remainder(rotation - 0.5 * M_PI * k, M_PI)) < 0.03);
        assert_true(loss.cbrt < 0.05 && loss.bytes > 500.0);
        tsuya_json_free(root);
        tsuya_material_free(m);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_rgl), cmocka_unit_test(test_lookup_on_a_real_file), cmocka_unit_test(test_rgl_as_a_renderer_reads_it),
                                       cmocka_unit_test(test_rgl_of_one_channel), cmocka_unit_test(test_merl), cmocka_unit_test(test_gltf)};
    return cmocka_run_group_tests(tests, NULL, test_folder_tear_down);
}
