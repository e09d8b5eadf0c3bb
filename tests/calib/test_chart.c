/* Colour from a 24-patch chart and flat cards.  Charts are drawn by ray through a homography; the camera that sees them has
 * spectral sensitivities of its own (no matrix is exact for them), cos⁴ vignetting, a light that falls off across the chart,
 * photon noise and 16 bits, none of which the fitted model is made of. */
#include "support.h"

#include "calib/color.h"
#include "core/context.h"
#include "core/spectrum.h"

enum { W = 1200, H = 900 };

typedef struct view {
    double angle, scale;     /* of the chart in the picture; px from patch to patch */
    double full_field;       /* tan of the half diagonal's angle: vignetting */
    double gradient;         /* of the light, across the picture */
    double exposure, noise;
    double tone;             /* exponent of a tone curve; 1: linear */
    bool spectral;
} view;

static view usual(void) { return (view){0.15, 110, 0.0, 0.0, 0.8, 0.002, 1.0, false}; }

/* A patch's reflectance: smooth, through the three cones' bands, so that its colour is near the reference's. */
static double reflectance(tsuya_vec3 rgb, double nm)
{
    double b = exp(-pow((nm - 430.0) / 65.0, 4.0)), r = nm > 630.0 ? 1.0 : exp(-pow((nm - 630.0) / 48.0, 4.0)), g = exp(-pow((nm - 540.0) / 55.0, 4.0));
    double v = (fmax(rgb.x, 0.01) * r + fmax(rgb.y, 0.01) * g + fmax(rgb.z, 0.01) * b) / (r + g + b);
    return fmin(v, 1.0);
}

static void spectrum(double nm[41], double value[41], tsuya_vec3 rgb)
{
    for (int i = 0; i < 41; i++) {
        nm[i] = 380 + 10 * i;
        value[i] = reflectance(rgb, nm[i]);
    }
}

static double bell(double nm, double at, double width) { return exp(-0.5 * pow((nm - at) / width, 2.0)); }

/* What the camera's channels make of a patch, white = 1 in green. */
static tsuya_vec3 seen(tsuya_lab lab_d50, const view *v)
{
    tsuya_vec3 rgb = tsuya_rgb_from_xyz(tsuya_chart_xyz_d65(lab_d50));
    if (!v->spectral) { /* a camera that is a matrix away from Rec.709 */
        return (tsuya_vec3){0.45 * rgb.x + 0.12 * rgb.y + 0.02 * rgb.z, 0.10 * rgb.x + 0.80 * rgb.y + 0.10 * rgb.z, 0.01 * rgb.x + 0.16 * rgb.y + 0.50 * rgb.z};
    }
    double nm[41], value[41], sum[3] = {0}, white = 0.0;
    spectrum(nm, value, rgb);
    for (int i = 0; i < 41; i++) {
        double light = tsuya_daylight_power(nm[i], 6504);
        sum[0] += light * value[i] * 0.7 * bell(nm[i], 600, 36);
        sum[1] += light * value[i] * bell(nm[i], 540, 42);
        sum[2] += light * value[i] * 0.8 * bell(nm[i], 458, 30);
        white += light * bell(nm[i], 540, 42);
    }
    return (tsuya_vec3){sum[0] / white, sum[1] / white, sum[2] / white};
}

static double light_at(const view *v, int x, int y)
{
    double u = (x - 0.5 * (W - 1)) / (0.5 * hypot(W, H)), w = (y - 0.5 * (H - 1)) / (0.5 * hypot(W, H));
    double t = v->full_field * v->full_field * (u * u + w * w);
    return (1.0 + v->gradient * u - 0.5 * v->gradient * w) / ((1.0 + t) * (1.0 + t));
}

static void put(tsuya_image *image, int x, int y, tsuya_vec3 rgb, const view *v, uint64_t seed)
{
    double c[3] = {rgb.x, rgb.y, rgb.z};
    for (int k = 0; k < 3; k++) {
        double value = v->exposure * light_at(v, x, y) * c[k];
        value += v->noise * sqrt(fmax(value, 0.01)) * tsuya_random_normal(seed, (uint64_t)k, (uint64_t)(y * W + x));
        value = pow(fmin(fmax(value, 0.0), 1.0), v->tone);
        tsuya_image_u16(image, x, y)[k] = (uint16_t)lround(65535.0 * value);
    }
}

static void draw_chart(tsuya_image *image, const view *v, const tsuya_lab reference[24])
{
    tsuya_vec3 color[24];
    for (int i = 0; i < 24; i++) {
        color[i] = seen(reference[i], v);
    }
    tsuya_vec3 frame = seen((tsuya_lab){12, 0, 0}, v), table = seen((tsuya_lab){45, 2, 6}, v);
    assert_ok(tsuya_image_create(image, W, H, 3, TSUYA_SAMPLE_U16, TSUYA_ENCODING_LINEAR));
    double cs = cos(v->angle), sn = sin(v->angle);
    for (int y = 0; y < H; y++) {
        for (int x = 0; x < W; x++) {
            double dx = x - 610.0, dy = y - 440.0, w = 1.0 + 1e-4 * dx - 5e-5 * dy;
            double a = (cs * dx + sn * dy) / (v->scale * w) + 2.5, b = (-sn * dx + cs * dy) / (v->scale * w) + 1.5;
            int i = (int)floor(a + 0.5), j = (int)floor(b + 0.5);
            bool on = i >= 0 && i < 6 && j >= 0 && j < 4 && fabs(a - i) < 0.45 && fabs(b - j) < 0.45;
            bool inside = a > -0.75 && a < 5.75 && b > -0.75 && b < 3.75;
            put(image, x, y, on ? color[6 * j + i] : inside ? frame : table, v, 7);
        }
    }
}

static tsuya_color fit(const view *v, const tsuya_lab *reference, const tsuya_vignetting *vignetting, const char *what)
{
    tsuya_image image;
    tsuya_chart chart;
    tsuya_color color;
    draw_chart(&image, v, reference);
    assert_ok(tsuya_chart_find(&chart, &image, "chart.tif", NULL, 1));
    assert_ok(tsuya_color_fit(&color, &chart, reference, vignetting, "chart.tif"));
    printf("%s: %d patches fitted to %.2f px; difference mean %.2f max %.2f, dark %.2f max %.2f, held out %.2f; gamma %.3f, worst grey %+.1f %% (patch %d)\n", what,
           chart.fitted, chart.fit_px, color.light.mean, color.light.max, color.dark.mean, color.dark.max, color.heldout.mean, color.gamma,
           100 * color.grey_deviation, color.grey_worst + 1);
    tsuya_image_free(&image);
    return color;
}

/* A camera that a matrix describes: the matrix comes back. */
static void test_matrix(void **state)
{
    (void)state;
    static const double angles[] = {0.15, -0.6, 2.9};
    tsuya_lab reference[24];
    tsuya_chart_reference(reference);
    for (int k = 0; k < 3; k++) {
        view v = usual();
        v.angle = angles[k];
        v.scale = k == 1 ? 70 : 110;
        tsuya_color c = fit(&v, reference, NULL, "matrix camera");
        assert_true(c.light.mean < 0.3 && c.dark.mean < 0.5 && c.heldout.mean < 0.5);
        assert_near(c.gamma, 1.0, 0.01);
        tsuya_vec3 white = tsuya_color_apply(&c, (double[]){0.8 * 0.59, 0.8 * 1.0, 0.8 * 0.67}, 600, 450);
        assert_near(white.x, 1.0, 0.02);
        assert_near(white.y, 1.0, 0.02);
        assert_near(white.z, 1.0, 0.02);
    }
}

/* The Lab under D50 of the spectrum that is drawn for a colour: Newton on the adapted XYZ. */
static tsuya_lab lab_of_spectrum(tsuya_lab nominal)
{
    double nm[41], value[41];
    tsuya_lab lab = nominal;
    spectrum(nm, value, tsuya_rgb_from_xyz(tsuya_chart_xyz_d65(nominal)));
    tsuya_vec3 want = tsuya_xyz_of_reflectance(nm, value, 41);
    for (int step = 0; step < 40; step++) { /* the Lab whose adapted XYZ it is */
        tsuya_lab h[3] = {lab, lab, lab};
        tsuya_vec3 at = tsuya_chart_xyz_d65(lab);
        h[0].l += 0.01, h[1].a += 0.01, h[2].b += 0.01;
        double e[3] = {want.x - at.x, want.y - at.y, want.z - at.z}, j[3][3];
        for (int c = 0; c < 3; c++) {
            tsuya_vec3 q = tsuya_chart_xyz_d65(h[c]);
            j[0][c] = (q.x - at.x) / 0.01, j[1][c] = (q.y - at.y) / 0.01, j[2][c] = (q.z - at.z) / 0.01;
        }
        tsuya_mat3 m = {{{j[0][0], j[0][1], j[0][2]}, {j[1][0], j[1][1], j[1][2]}, {j[2][0], j[2][1], j[2][2]}}};
        double det = tsuya_mat3_determinant(m), d[3];
        for (int c = 0; c < 3; c++) {
            tsuya_mat3 n = m;
            for (int r = 0; r < 3; r++) {
                n.e[r][c] = e[r];
            }
            d[c] = tsuya_mat3_determinant(n) / det;
        }
        lab.l += d[0], lab.a += d[1], lab.b += d[2];
    }
    return lab;
}

/* Spectra through sensitivities that are no mixture of the observer's, uneven light, vignetting known from a card. */
static void test_spectral_camera(void **state)
{
    (void)state;
    tsuya_lab nominal[24], reference[24];
    tsuya_chart_reference(nominal);
    view v = usual();
    v.spectral = true;
    for (int i = 0; i < 24; i++) {
        reference[i] = lab_of_spectrum(nominal[i]);
    }
    tsuya_lab drawn[24];
    memcpy(drawn, nominal, sizeof drawn); /* `seen` draws the spectra of the nominal colours */
    v.gradient = 0.12;
    v.full_field = 0.45;
    view card = v;
    card.gradient = 0.05;
    tsuya_image image;
    tsuya_flat_card flat;
    tsuya_vignetting vignetting;
    double balance[3];
    assert_ok(tsuya_image_create(&image, W, H, 3, TSUYA_SAMPLE_U16, TSUYA_ENCODING_LINEAR));
    tsuya_vec3 grey = seen((tsuya_lab){70, 0, 0}, &card);
    for (int i = 0; i < W * H; i++) {
        put(&image, i % W, i / W, grey, &card, 11);
    }
    assert_ok(tsuya_flat_card_read(&flat, &image, "card.tif"));
    assert_ok(tsuya_vignetting_fit(&vignetting, balance, &flat, 1));
    double worst = 0.0, t = v.full_field * v.full_field;
    for (int k = 0; k <= 20; k++) {
        double x = 0.5 * (W - 1) * (1 + k / 20.0), y = 0.5 * (H - 1) * (1 + k / 20.0), r = k / 20.0;
        worst = fmax(worst, fabs(tsuya_vignetting_at(&vignetting, x, y) * (1 + t * r * r) * (1 + t * r * r) - 1.0));
    }
    printf("vignetting: %.3f left in the corners (%.3f true), off by %.2f %% at most\n", vignetting.corner, 1 / ((1 + t) * (1 + t)), 100 * worst);
    assert_true(worst < 0.006);
    tsuya_image_free(&image);
    tsuya_chart chart;
    tsuya_color c, without;
    draw_chart(&image, &v, drawn);
    assert_ok(tsuya_chart_find(&chart, &image, "chart.tif", NULL, 1));
    assert_ok(tsuya_color_fit(&c, &chart, reference, &vignetting, "chart.tif"));
    assert_ok(tsuya_color_fit(&without, &chart, reference, NULL, "chart.tif"));
    tsuya_image_free(&image);
    printf("spectral camera: difference mean %.2f max %.2f, dark %.2f max %.2f, held out %.2f (without vignetting %.2f, %.2f), light %+.3f %+.3f\n", c.light.mean,
           c.light.max, c.dark.mean, c.dark.max, c.heldout.mean, without.light.mean, without.dark.mean, c.light_gradient[0], c.light_gradient[1]);
    assert_true(c.light.mean < 2.0 && c.heldout.mean < 3.0);
    assert_near(c.gamma, 1.0, 0.02);
}

static void test_a_tone_curve_is_seen(void **state)
{
    (void)state;
    tsuya_lab reference[24];
    tsuya_chart_reference(reference);
    view v = usual();
    v.tone = 0.8;
    tsuya_color c = fit(&v, reference, NULL, "tone curve");
    assert_near(c.gamma, 0.8, 0.02);
    assert_true(fabs(c.grey_deviation) > 0.05);
}

static void test_refusals_and_files(void **state)
{
    (void)state;
    tsuya_lab reference[24], read[24];
    tsuya_image image;
    tsuya_chart chart;
    tsuya_color c, again;
    tsuya_flat_card card;
    tsuya_vignetting vignetting;
    tsuya_chart_reference(reference);
    view v = usual();
    draw_chart(&image, &v, reference);
    assert_ok(tsuya_flat_card_read(&card, &image, "chart.tif"));
    assert_fails(tsuya_vignetting_fit(&vignetting, NULL, &card, 1), "the card is not flat");
    tsuya_vec2 upside[4] = {{900, 640}, {330, 640}, {330, 250}, {900, 250}}; /* turned by hand: the wrong way round */
    assert_ok(tsuya_chart_find(&chart, &image, "chart.tif", NULL, 1));
    for (int k = 0; k < 4; k++) {
        static const int patch[4] = {23, 18, 0, 5};
        upside[k] = chart.patch[patch[k]].center_px;
    }
    assert_ok(tsuya_color_fit(&c, &chart, reference, NULL, "chart.tif"));
    assert_ok(tsuya_chart_find(&chart, &image, "chart.tif", upside, 1));
    assert_fails(tsuya_color_fit(&again, &chart, reference, NULL, "chart.tif"), "is the chart upside down");
    tsuya_image_free(&image);
    v.exposure = 2.4;
    draw_chart(&image, &v, reference);
    assert_ok(tsuya_chart_find(&chart, &image, "chart.tif", NULL, 1));
    assert_fails(tsuya_color_fit(&again, &chart, reference, NULL, "chart.tif"), "is clipped; expose less");
    tsuya_image_free(&image);
    assert_ok(tsuya_image_create(&image, W, H, 3, TSUYA_SAMPLE_U8, TSUYA_ENCODING_SRGB));
    assert_fails(tsuya_chart_find(&chart, &image, "black.jpg", NULL, 1), "black.jpg: no 24-patch chart is found");
    tsuya_image_free(&image);
    tsuya_json *root = tsuya_json_create_object();
    tsuya_color_to_json(root, &c);
    assert_ok(tsuya_json_save(root, test_path("color.json")));
    tsuya_json_free(root);
    assert_ok(tsuya_color_load(&again, test_path("color.json")));
    tsuya_vec3 a = tsuya_color_apply(&c, (double[]){0.3, 0.2, 0.1}, 10, 20), b = tsuya_color_apply(&again, (double[]){0.3, 0.2, 0.1}, 10, 20);
    assert_near(a.x, b.x, 1e-12);
    static const char csv[] = "patch,l,a,b\n1,50,0,0\n1,40,0,0\n";
    assert_ok(tsuya_file_write(test_path("ref.csv"), csv, sizeof csv - 1));
    assert_fails(tsuya_chart_reference_load(read, test_path("ref.csv")), "line 3: patch 1");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_matrix),
        cmocka_unit_test(test_spectral_camera),
        cmocka_unit_test(test_a_tone_curve_is_seen),
        cmocka_unit_test(test_refusals_and_files),
    };
    int result = cmocka_run_group_tests(tests, NULL, NULL);
    test_folder_remove();
    return result;
}
