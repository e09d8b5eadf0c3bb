/* Spectral pictures against integrals over the wavelength, done here at every quarter of a nm. */
#include "support.h"

#include "core/color.h"
#include "core/file.h"
#include "core/image.h"
#include "core/memory.h"
#include "core/spectrum.h"
#include "core/table.h"

#include "render/bands.h"
#include "render/preset.h"
#include "render/render.h"

#include "render_scenes.h"

#include <string.h>

typedef double (*curve)(double nm);

/* --- lamps and cloths as formulas --- */

static double planck_3000(double nm) { return pow(560.0 / nm, 5.0) / expm1(1.438777e7 / (nm * 3000.0)); }

/* Mercury-like lines over a weak floor, as corners joined by straight lines. */
static const double line_nm[] = {380, 400, 434, 436, 438, 475, 510, 544, 546, 548, 578, 609, 611, 613, 650, 690, 780};
static const double line_power[] = {0.1, 0.2, 0.3, 9.0, 0.3, 0.5, 0.4, 0.3, 12.0, 0.3, 0.4, 0.3, 10.0, 0.3, 0.3, 0.2, 0.1};
enum { LINES = sizeof line_nm / sizeof line_nm[0] };

static double lines(double nm)
{
    int k = 0;
    while (k + 2 < LINES && line_nm[k + 1] < nm) {
        ++k;
    }
    return line_power[k] + (nm - line_nm[k]) / (line_nm[k + 1] - line_nm[k]) * (line_power[k + 1] - line_power[k]);
}

/* A red dye with a bump in the blue, and a green with a narrow dip, as textile dyes have them. */
static double madder(double nm) { return 0.05 + 0.65 / (1.0 + exp(-(nm - 590.0) / 14.0)) + 0.18 * exp(-pow((nm - 430.0) / 30.0, 2.0)); }
static double moss(double nm) { return 0.08 + 0.3 * exp(-pow((nm - 540.0) / 55.0, 2.0)) - 0.15 * exp(-pow((nm - 565.0) / 12.0, 2.0)) + 0.2 / (1.0 + exp(-(nm - 690.0) / 12.0)); }

/* As measured every `step` nm from `first` on, and joined by straight lines, held at the ends. */
typedef struct measured { curve of; int first, step, count; } measured;

static double measured_at(measured m, double nm)
{
    double at = fmin(m.count - 1, fmax(0.0, (nm - m.first) / m.step));
    int k = (int)fmin(at, m.count - 2);
    double low = m.of(m.first + k * m.step), high = m.of(m.first + (k + 1) * m.step);
    return low + (at - k) * (high - low);
}

/* Linear Rec.709 of `light` times `kept`, at luminance 1 of the light itself, for the fitted observer or CIE's own table. */
static tsuya_vec3 integral(curve light, double (*kept)(const void *user, double nm), const void *user, const tsuya_table *cie)
{
    tsuya_vec3 sum = {0, 0, 0}, d65 = {0, 0, 0}, white = tsuya_white_d65();
    double luminance = 0.0;
    for (double nm = 380.0; nm <= 780.0; nm += 0.25) {
        tsuya_vec3 o = tsuya_observer(nm);
        if (cie) {
            size_t row = (size_t)fmin(nm - 360.0, 418.0);
            double t = nm - 360.0 - (double)row, v[3];
            for (int c = 0; c < 3; ++c) {
                v[c] = (1.0 - t) * tsuya_table_at(cie, row, c + 1) + t * tsuya_table_at(cie, row + 1, c + 1);
            }
            o = (tsuya_vec3){v[0], v[1], v[2]};
        }
        double power = light(nm);
        sum = tsuya_vec3_mad(sum, power * kept(user, nm), o);
        d65 = tsuya_vec3_mad(d65, tsuya_daylight_power(nm, 6504.0), o);
        luminance += power * o.y;
    }
    double scale = 1.0 / luminance;
    return tsuya_rgb_from_xyz((tsuya_vec3){sum.x * scale * white.x * d65.y / d65.x, sum.y * scale, sum.z * scale * white.z * d65.y / d65.z});
}

static double once(const void *user, double nm) { return measured_at(*(const measured *)user, nm); }

/* --- materials and pictures --- */

static void json_of(char *text, size_t size, measured m)
{
    size_t n = (size_t)snprintf(text, size, "{\"format\": \"tsuya material\", \"version\": \"1.0\", \"name\": \"cloth\", \"model\": \"lambert\", \"channels\": [");
    for (int k = 0; k < m.count; ++k) {
        n += (size_t)snprintf(text + n, size - n, "%s\"nm%d\"", k ? ", " : "", m.first + k * m.step);
    }
    n += (size_t)snprintf(text + n, size - n, "], \"dye\": {\"coupling\": \"lambert\", \"reflectance\": [");
    for (int k = 0; k < m.count; ++k) {
        n += (size_t)snprintf(text + n, size - n, "%s%.9g", k ? ", " : "", m.of(m.first + k * m.step));
    }
    snprintf(text + n, size - n, "]}, \"parameters\": {}}");
}

static tsuya_material *cloth(measured m)
{
    char text[16384];
    tsuya_material *material;
    json_of(text, sizeof text, m);
    assert_ok(tsuya_material_parse(&material, text, "cloth.json"));
    return material;
}

static tsuya_film look(const tsuya_mesh *mesh, const tsuya_shader *shader, const tsuya_bands *bands, const tsuya_light_set *lights,
                       tsuya_vec3 eye, tsuya_vec3 target, double field_deg, int side, tsuya_path_options options, int threads)
{
    tsuya_camera camera;
    tsuya_pose pose;
    scene_camera(&camera, &pose, eye, target, field_deg, side, side);
    return scene_render_bands(mesh, shader, bands, lights, &camera, pose, &options, threads);
}

/* What a plane shows of a lamp that gives it the irradiance 1, times π: the integral over its reflectance. */
static tsuya_vec3 plane_color(const tsuya_material *material, const char *spectrum, const char *folder)
{
    tsuya_mesh mesh;
    tsuya_light_set lights = {0};
    tsuya_shader shader;
    tsuya_bands bands;
    tsuya_light lamp = {.kind = TSUYA_LIGHT_DIRECTIONAL, .direction = {0, 0, -1}, .rgb = {1, 1, 1}};
    assert_ok(tsuya_shader_from_material(&shader, material));
    assert_true(shader.spectral);
    assert_ok(tsuya_bands_of_material(&bands, material));
    if (spectrum) {
        assert_ok(tsuya_light_take_spectrum(&lamp, spectrum, folder));
    }
    add_light(&lights, lamp);
    scene_plane(&mesh, 4.0, 4);
    tsuya_film film = look(&mesh, &shader, &bands, &lights, (tsuya_vec3){2, -1, 1.5}, (tsuya_vec3){0, 0, 0}, 0.05, 2, options_of(4, 2), 1);
    tsuya_vec3 color = tsuya_vec3_scale((tsuya_vec3){film_mean(&film, 0), film_mean(&film, 1), film_mean(&film, 2)}, M_PI);
    tsuya_film_free(&film);
    tsuya_light_set_free(&lights);
    tsuya_mesh_free(&mesh);
    return color;
}

static double difference(tsuya_vec3 a, tsuya_vec3 b)
{
    return fmax(fabs(a.x - b.x), fmax(fabs(a.y - b.y), fabs(a.z - b.z)));
}

static double appearance(tsuya_vec3 a, tsuya_vec3 b) { return tsuya_color_difference(tsuya_lab_from_rgb(a), tsuya_lab_from_rgb(b)); }

static void write_lines(void)
{
    FILE *file = fopen(test_path("lines.csv"), "w");
    assert_non_null(file);
    fprintf(file, "nm,power\n");
    for (int k = 0; k < LINES; ++k) {
        fprintf(file, "%g,%g\n", line_nm[k], line_power[k]);
    }
    assert_int_equal(fclose(file), 0);
}

static void test_direct_light(void **state)
{
    (void)state;
    static const struct { const char *spectrum; curve power; } lamp[] = {{"halogen", planck_3000}, {"lines.csv", lines}};
    static const curve dye[] = {madder, moss};
    const char *path = test_data("spectral/cie1931_2deg_xyz_1nm.csv");
    tsuya_table cie;
    write_lines();
    assert_ok(path ? tsuya_table_load(&cie, path, NULL) : TSUYA_OK);
    for (int k = 0; k < 8; ++k) {
        measured m = k & 4 ? (measured){dye[k & 1], 390, 10, 35} : (measured){dye[k & 1], 380, 5, 81};
        tsuya_material *material = cloth(m);
        tsuya_vec3 seen = plane_color(material, lamp[k >> 1 & 1].spectrum, test_folder());
        tsuya_vec3 expected = integral(lamp[k >> 1 & 1].power, once, &m, NULL);
        if (!(difference(seen, expected) < 1e-3)) {
            fail_msg("%s, cloth %d: %.5f %.5f %.5f; by integral %.5f %.5f %.5f", lamp[k >> 1 & 1].spectrum, k & 1, seen.x, seen.y, seen.z, expected.x,
                     expected.y, expected.z);
        }
        if (path) { /* the observer is a fit */
            assert_true(appearance(seen, integral(lamp[k >> 1 & 1].power, once, &m, &cie)) < 2.0);
        }
        tsuya_material_free(material);
    }
    if (path) {
        tsuya_table_free(&cie);
    }
}

static double in_box(const void *user, double nm)
{
    double rho = measured_at(*(const measured *)user, nm);
    return rho / (1.0 - rho) / 6.0;
}

/* The closed box of test_path.c, at every wavelength: reflected light is coloured again and again. */
static void test_interreflection(void **state)
{
    (void)state;
    const measured m = {madder, 390, 10, 35};
    tsuya_mesh mesh;
    tsuya_light_set lights = {0};
    tsuya_shader shader;
    tsuya_bands bands;
    tsuya_material *material = cloth(m);
    tsuya_light lamp = {.kind = TSUYA_LIGHT_POINT, .rgb = {1, 1, 1}};
    assert_ok(tsuya_shader_from_material(&shader, material));
    assert_ok(tsuya_bands_of_material(&bands, material));
    assert_ok(tsuya_light_take_spectrum(&lamp, "halogen", "."));
    add_light(&lights, lamp);
    scene_cube(&mesh);
    tsuya_film film = look(&mesh, &shader, &bands, &lights, (tsuya_vec3){0, 0, 0}, (tsuya_vec3){1, 0, 0}, 90.0, 24, options_of(1024, 64), 2);
    tsuya_film again = look(&mesh, &shader, &bands, &lights, (tsuya_vec3){0, 0, 0}, (tsuya_vec3){1, 0, 0}, 90.0, 24, options_of(1024, 64), 1);
    assert_memory_equal(film.rgb, again.rgb, 3 * 24 * 24 * sizeof *film.rgb);
    tsuya_vec3 seen = {film_mean(&film, 0), film_mean(&film, 1), film_mean(&film, 2)};
    tsuya_vec3 expected = integral(planck_3000, in_box, &m, NULL);
    if (!(difference(seen, expected) < 6e-3 * expected.x)) {
        fail_msg("box: %.5f %.5f %.5f; by integral %.5f %.5f %.5f", seen.x, seen.y, seen.z, expected.x, expected.y, expected.z);
    }
    tsuya_film_free(&film);
    tsuya_film_free(&again);
    tsuya_material_free(material);
    tsuya_light_set_free(&lights);
    tsuya_mesh_free(&mesh);
}

/* --- colours that have no spectrum --- */

static tsuya_bands twin_bands;
static double twin_rgb[3];

static double twin(double nm)
{
    double r[TSUYA_MATERIAL_MAX_CHANNELS];
    int k = (int)lround((nm - twin_bands.nm[0]) / (twin_bands.nm[1] - twin_bands.nm[0]));
    tsuya_bands_spread(r, &twin_bands, twin_rgb);
    return r[k];
}

/* A dye and the made-up spectrum of its colour look alike by daylight, and as the integrals have it by halogen and by a lamp of lines:
 * no longer alike there. */
static void test_metamers(void **state)
{
    (void)state;
    const measured m = {moss, 380, 10, 41};
    tsuya_material *first = cloth(m);
    assert_ok(tsuya_bands_of_material(&twin_bands, first));
    tsuya_vec3 day = plane_color(first, "D65", ".");
    twin_rgb[0] = day.x;
    twin_rgb[1] = day.y;
    twin_rgb[2] = day.z;
    const measured n = {twin, 380, 10, 41};
    tsuya_material *second = cloth(n);
    assert_true(appearance(plane_color(second, "D65", "."), day) < 0.1);
    assert_true(appearance(plane_color(second, NULL, "."), day) < 0.1); /* a lamp without a spectrum is D65's colour */
    write_lines();
    tsuya_vec3 a = plane_color(first, "lines.csv", test_folder()), b = plane_color(second, "lines.csv", test_folder());
    double seen = appearance(a, b), expected = appearance(integral(lines, once, &m, NULL), integral(lines, once, &n, NULL));
    print_message("metamers by daylight, ΔE00 by lines: %.2f, by integral %.2f\n", seen, expected);
    assert_true(seen > 2.0 && fabs(seen - expected) < 0.1);
    tsuya_material_free(first);
    tsuya_material_free(second);
}

/* Made-up spectra are reflectances, white's is 1, and every colour comes back. */
static void test_colors_come_back(void **state)
{
    (void)state;
    static const double colors[][3] = {{1, 1, 1}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0.8, 0.3, 0.05}, {0.02, 0.2, 0.5}, {0, 0, 0}};
    const measured grids[] = {{madder, 380, 5, 81}, {madder, 390, 10, 35}, {madder, 400, 20, 16}};
    for (int g = 0; g < 3; ++g) {
        tsuya_material *material = cloth(grids[g]);
        assert_ok(tsuya_bands_of_material(&twin_bands, material));
        for (int k = 0; k < 7; ++k) {
            double r[TSUYA_MATERIAL_MAX_CHANNELS];
            memcpy(twin_rgb, colors[k], sizeof twin_rgb);
            tsuya_bands_spread(r, &twin_bands, twin_rgb);
            for (int c = 0; c < twin_bands.count; ++c) {
                assert_true(r[c] >= 0.0 && r[c] <= 1.0 + 1e-12 && (k > 0 || fabs(r[c] - 1.0) < 1e-12));
                r[c] = fmin(1.0, r[c]);
            }
            assert_ok(tsuya_material_set_channel_dye(material, r));
            tsuya_vec3 seen = plane_color(material, "D65", "."), wanted = {colors[k][0], colors[k][1], colors[k][2]};
            if (!(difference(seen, wanted) < (g == 2 ? 2e-2 : 5e-3))) {
                fail_msg("grid %d, colour %d: %.4f %.4f %.4f", g, k, seen.x, seen.y, seen.z);
            }
        }
        tsuya_material_free(material);
    }
}

/* The built-in led: the colour of a black body near 3000 K, to half of what a binning step allows. */
static void test_led(void **state)
{
    (void)state;
    tsuya_lamp_spectrum led, hot;
    assert_ok(tsuya_lamp_spectrum_load(&led, "led", "."));
    double nearest = INFINITY, at = 0.0;
    for (double kelvin = 2500.0; kelvin <= 3600.0; kelvin += 10.0) {
        char name[16];
        double uv[2][2];
        snprintf(name, sizeof name, "%.0fK", kelvin);
        assert_ok(tsuya_lamp_spectrum_load(&hot, name, "."));
        for (int l = 0; l < 2; ++l) {
            tsuya_vec3 xyz = {0, 0, 0};
            for (int k = 0; k < TSUYA_SPECTRUM_COUNT; ++k) {
                xyz = tsuya_vec3_mad(xyz, (l ? &hot : &led)->power[k], tsuya_observer(TSUYA_SPECTRUM_FIRST_NM + k));
            }
            double s = xyz.x + 15.0 * xyz.y + 3.0 * xyz.z;
            uv[l][0] = 4.0 * xyz.x / s;
            uv[l][1] = 6.0 * xyz.y / s;
        }
        double distance = hypot(uv[0][0] - uv[1][0], uv[0][1] - uv[1][1]);
        at = distance < nearest ? kelvin : at;
        nearest = fmin(nearest, distance);
    }
    print_message("led: %.0f K, %.4f from the black body's line\n", at, nearest);
    assert_true(fabs(at - 3000.0) < 100.0 && nearest < 0.003);
}

/* --- the stage --- */

static tsuya_render_options stage_options(const char *name, const char *const *materials, int count)
{
    static tsuya_mesh mesh;
    tsuya_render_options o = tsuya_render_options_default();
    if (!tsuya_path_exists(test_path("plane.ply"))) {
        scene_sphere(&mesh, 0.5, 24, false);
        assert_ok(tsuya_ply_save(&mesh, test_path("plane.ply"), NULL));
        tsuya_mesh_free(&mesh);
    }
    o.mesh_path = test_path("plane.ply");
    o.output_folder = test_path("render");
    o.name = name;
    o.width_px = 32;
    o.height_px = 24;
    o.spp = 16;
    o.material_path = materials;
    o.material_count = count;
    return o;
}

static double evenness(tsuya_image *png)
{
    double most = 0.0;
    for (int k = 0; k < 32 * 24; ++k) {
        const uint8_t *p = tsuya_image_u8(png, k % 32, k / 32);
        most = fmax(most, fmax(abs(p[0] - p[1]), abs(p[1] - p[2])));
    }
    return most;
}

static double grey(double nm) { return 0.6 + 0.0 * nm; }

/* A grey ball by halogen is orange, and grey for who has adapted to it; figures say what was done. */
static void test_stage(void **state)
{
    (void)state;
    char text[16384], png[TEST_PATH];
    tsuya_context context = tsuya_context_default();
    tsuya_render_info info;
    tsuya_image image;
    tsuya_json *root;
    json_of(text, sizeof text, (measured){grey, 390, 10, 35});
    assert_ok(tsuya_file_write(test_path("grey.json"), text, strlen(text)));
    const char *const material[] = {test_path("grey.json")};
    tsuya_render_options o = stage_options("halogen", material, 1);
    o.lights_path = "halogen";
    for (int adapted = 0; adapted < 2; ++adapted) {
        o.adapt_to_lamps = adapted;
        assert_ok(tsuya_render(&info, &o, &context));
        snprintf(png, sizeof png, "%s", test_path("render/halogen/frame_000.png"));
        assert_ok(tsuya_image_load(&image, png));
        assert_true(adapted ? evenness(&image) <= 2.0 : evenness(&image) > 60.0);
        tsuya_image_free(&image);
    }
    assert_ok(tsuya_json_load(&root, test_path("render/halogen/render.json")));
    assert_true(tsuya_json_number_or(tsuya_json_member(tsuya_json_member(root, "spectral"), "wavelengths"), 0.0) == 35.0);
    assert_non_null(strstr(tsuya_json_text_or(tsuya_json_member(tsuya_json_member(root, "view_transform"), "adaptation"), ""), "Bradford"));
    tsuya_json_free(root);
}

/* A dye's own spectrum counts: grey cloth in it looks to the bit like cloth that was measured in it, and not like cloth in its colour alone. */
static void test_dye_by_spectrum(void **state)
{
    (void)state;
    static const char *const names[] = {"measured", "dyed", "painted"};
    const measured m = {moss, 390, 10, 35};
    char text[16384], colors[3][TEST_PATH];
    double r[TSUYA_MATERIAL_MAX_CHANNELS], nm[TSUYA_MATERIAL_MAX_CHANNELS];
    tsuya_context context = tsuya_context_default();
    tsuya_render_info info;
    tsuya_image image[3];
    size_t n = (size_t)snprintf(text, sizeof text, "nm,reflectance\n");
    for (int k = 0; k < m.count; ++k) {
        nm[k] = m.first + k * m.step;
        r[k] = m.of(nm[k]);
        n += (size_t)snprintf(text + n, sizeof text - n, "%g,%.9g\n", nm[k], r[k]);
    }
    assert_ok(tsuya_file_write(test_path("moss.csv"), text, n));
    tsuya_vec3 rgb = tsuya_rgb_of_reflectance(nm, r, m.count);
    snprintf(colors[0], TEST_PATH, "material");
    snprintf(colors[1], TEST_PATH, "%s", test_path("moss.csv"));
    snprintf(colors[2], TEST_PATH, "%.9g,%.9g,%.9g", rgb.x, rgb.y, rgb.z);
    for (int k = 0; k < 3; ++k) {
        char json[TEST_PATH];
        json_of(text, sizeof text, k ? (measured){grey, 390, 10, 35} : m);
        snprintf(json, sizeof json, "%s", test_path(k ? "grey.json" : "moss.json"));
        assert_ok(tsuya_file_write(json, text, strlen(text)));
        const char *const material[] = {json};
        tsuya_render_options o = stage_options(names[k], material, 1);
        o.lights_path = "halogen";
        o.color = colors[k];
        assert_ok(tsuya_render(&info, &o, &context));
        snprintf(text, sizeof text, "render/%s/frame_000.png", names[k]);
        assert_ok(tsuya_image_load(&image[k], test_path(text)));
    }
    assert_memory_equal(tsuya_image_u8(&image[0], 0, 0), tsuya_image_u8(&image[1], 0, 0), 3 * 32 * 24);
    assert_memory_not_equal(tsuya_image_u8(&image[0], 0, 0), tsuya_image_u8(&image[2], 0, 0), 3 * 32 * 24);
    for (int k = 0; k < 3; ++k) {
        tsuya_image_free(&image[k]);
    }
}

static void test_hostile_inputs(void **state)
{
    (void)state;
    char text[16384];
    tsuya_context context = tsuya_context_default();
    tsuya_render_info info;
    tsuya_lamp_spectrum s;
    static const struct { const char *rows, *names; } bad[] = {
        {"nm,power\n", "rows"},
        {"nm,power\n400,1\n700,nan\n", "power"},
        {"nm,power\n400,1\n390,1\n700,1\n", "line 3"},
        {"nm,power\n400,1\n500,-1\n700,1\n", "line 3"},
        {"nm,power\n400,1\n500,1\n700,1\n", "40 nm"},
        {"nm,power\n500,1\n530,1\n", "430 to 670"},
        {"nm,watts\n400,1\n", "watts"},
    };
    for (size_t k = 0; k < sizeof bad / sizeof bad[0]; ++k) {
        assert_ok(tsuya_file_write(test_path("bad.csv"), bad[k].rows, strlen(bad[k].rows)));
        assert_fails(tsuya_lamp_spectrum_load(&s, "bad.csv", test_folder()), bad[k].names);
    }
    assert_fails(tsuya_lamp_spectrum_load(&s, "neon", "."), "halogen");
    assert_fails(tsuya_lamp_spectrum_load(&s, "300K", "."), "3200K");
    tsuya_light_set set;
    assert_fails(tsuya_light_set_parse(&set, "{\"lights\": [{\"type\": \"point\", \"position_m\": [0, 0, 1], \"rgb\": [1, 1, 1], \"spectrum\": \"xenon\"}]}", "l.json", "."),
                 "l.json: lights[0]");
    assert_fails(tsuya_light_set_parse(&set, "{\"lights\": [{\"type\": \"environment\", \"file\": \"sky.exr\", \"spectrum\": \"led\"}]}", "l.json", "."), "map");
    json_of(text, sizeof text, (measured){grey, 390, 10, 35});
    assert_ok(tsuya_file_write(test_path("one.json"), text, strlen(text)));
    json_of(text, sizeof text, (measured){grey, 400, 10, 31});
    assert_ok(tsuya_file_write(test_path("other.json"), text, strlen(text)));
    json_of(text, sizeof text, (measured){grey, 500, 10, 11});
    assert_ok(tsuya_file_write(test_path("short.json"), text, strlen(text)));
    const char *const two[] = {test_path("one.json"), test_path("other.json")}, *const narrow[] = {test_path("short.json")};
    tsuya_render_options o = stage_options("bad", two, 2);
    assert_fails(tsuya_render(&info, &o, &context), "other wavelengths");
    o = stage_options("bad", narrow, 1);
    assert_fails(tsuya_render(&info, &o, &context), "500 to 600 nm");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_direct_light),     cmocka_unit_test(test_interreflection), cmocka_unit_test(test_metamers),
        cmocka_unit_test(test_colors_come_back), cmocka_unit_test(test_led),             cmocka_unit_test(test_stage),
        cmocka_unit_test(test_dye_by_spectrum),  cmocka_unit_test(test_hostile_inputs),
    };
    return cmocka_run_group_tests(tests, NULL, test_folder_tear_down);
}
