/* tsuya calib color */
#include "app/command.h"
#include "calib/color.h"
#include "core/file.h"

#include <stdlib.h>
#include <string.h>

enum { KEY_FLAT = 1, KEY_REFERENCE, KEY_CORNERS, KEY_LINEAR, PICTURE_PATCH = 80 };

typedef struct color_input {
    const char *chart, *reference, *output, *flat[TSUYA_COLOR_CARDS + 1];
    bool has_corners, linear;
    tsuya_vec2 corner[4];
} color_input;

static const struct argp_option options[] = {
    {"flat", KEY_FLAT, "PHOTO", 0, "A flat grey card that fills the picture: vignetting, and white balance without a chart; repeatable", 0},
    {"reference", KEY_REFERENCE, "FILE.csv", 0, "Lab (D50) of the chart's patches: columns patch,l,a,b (default: the maker's, since November 2014)", 0},
    {"corners", KEY_CORNERS, "TEXT", 0, "Middles of the patches dark skin, bluish green, black, white: \"x,y x,y x,y x,y\" (default: looked for)", 0},
    {"linear", KEY_LINEAR, NULL, 0, "Integer files hold linear light (default: sRGB, but camera raw, whose light is linear as it is)", 0},
    {"output", 'o', "PATH", 0, "Folder, or FILE.json (default: color.json); a picture goes beside it", 0},
    {0},
};

static void parse_corners(struct argp_state *state, color_input *input, const char *text)
{
    tsuya_vec2 *c = input->corner;
    char rest;
    if (sscanf(text, " %lf,%lf %lf,%lf %lf,%lf %lf,%lf %c", &c[0].x, &c[0].y, &c[1].x, &c[1].y, &c[2].x, &c[2].y, &c[3].x, &c[3].y, &rest) != 8) {
        argp_error(state, "--corners: '%s' is not four points \"x,y x,y x,y x,y\"", text);
    }
    input->has_corners = true;
}

static error_t parse(int key, char *arg, struct argp_state *state)
{
    color_input *input = state->input;
    switch (key) {
    case KEY_FLAT: tsuya_argument_append(state, input->flat, TSUYA_COLOR_CARDS, arg); return 0;
    case KEY_REFERENCE: input->reference = arg; return 0;
    case KEY_LINEAR: input->linear = true; return 0;
    case KEY_CORNERS: parse_corners(state, input, arg); return 0;
    case 'o': input->output = arg; return 0;
    case ARGP_KEY_ARG:
        if (input->chart) {
            argp_error(state, "'%s': one photograph of the chart only", arg);
        }
        input->chart = arg;
        return 0;
    case ARGP_KEY_END:
        if (!input->chart && !input->flat[0]) {
            argp_error(state, "CHART is missing: a photograph of a 24-patch chart, or --flat with one of a grey card");
        } else if (!input->chart && (input->reference || input->has_corners)) {
            argp_error(state, "--reference and --corners belong to a chart");
        }
        return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const tsuya_syntax syntax = {
    .arguments = "[CHART]",
    .example = "tsuya calib color chart.jpg --flat grey-card.jpg -o color.json",
    .doc = "White balance, a 3 x 3 matrix to linear Rec.709 and vignetting from a photograph of a 24-patch chart and of flat grey cards, with the colour "
           "differences that are left (CIEDE2000, dark patches apart) and a check that the camera is linear.",
    .options = options,
    .parse = parse,
};

static tsuya_status load(tsuya_image *photo, const color_input *input, const char *path)
{
    TSUYA_TRY(tsuya_image_load(photo, path));
    photo->encoding = input->linear ? TSUYA_ENCODING_LINEAR : photo->encoding;
    return TSUYA_OK;
}

static tsuya_status fit_flat(tsuya_vignetting *v, double balance[3], const color_input *input)
{
    int count = 0;
    tsuya_status status = TSUYA_OK;
    tsuya_flat_card *card = tsuya_calloc(TSUYA_COLOR_CARDS, sizeof *card);
    if (!card) {
        return TSUYA_ERROR_MEMORY;
    }
    for (; status == TSUYA_OK && input->flat[count]; count++) {
        tsuya_image photo = {0};
        status = load(&photo, input, input->flat[count]);
        if (status == TSUYA_OK) {
            status = tsuya_flat_card_read(&card[count], &photo, input->flat[count]);
        }
        if (status == TSUYA_OK && (card[count].width_px != card[0].width_px || card[count].height_px != card[0].height_px)) {
            status = tsuya_fail(TSUYA_ERROR_INPUT, "%s is %d x %d px, %s %d x %d; cards of one size are expected", input->flat[count], card[count].width_px,
                                card[count].height_px, input->flat[0], card[0].width_px, card[0].height_px);
        }
        tsuya_image_free(&photo);
    }
    if (status == TSUYA_OK) {
        status = tsuya_vignetting_fit(v, balance, card, count);
    }
    tsuya_free(card);
    return status;
}

static tsuya_status fit_chart(tsuya_color *color, const color_input *input, const tsuya_vignetting *v, const tsuya_context *context)
{
    tsuya_image photo;
    tsuya_chart chart;
    tsuya_lab reference[TSUYA_CHART_PATCHES];
    tsuya_chart_reference(reference);
    if (input->reference) {
        TSUYA_TRY(tsuya_chart_reference_load(reference, input->reference));
    }
    TSUYA_TRY(load(&photo, input, input->chart));
    tsuya_status status = TSUYA_OK;
    if (v && (v->width_px != photo.width_px || v->height_px != photo.height_px)) {
        status = tsuya_fail(TSUYA_ERROR_INPUT, "%s is %d x %d px, the flat cards %d x %d; one size is expected", input->chart, photo.width_px, photo.height_px,
                            v->width_px, v->height_px);
    }
    if (status == TSUYA_OK) {
        status = tsuya_chart_find(&chart, &photo, input->chart, input->has_corners ? input->corner : NULL, context->threads);
    }
    if (status == TSUYA_OK) {
        status = tsuya_color_fit(color, &chart, reference, v, input->chart);
    }
    tsuya_image_free(&photo);
    return status;
}

/* Each patch: the reference around, what the camera gives now in the middle; clipped ones crossed out. */
static tsuya_status save_picture(const tsuya_color *c, const char *path)
{
    tsuya_image picture;
    const int p = PICTURE_PATCH, rim = p / 4;
    TSUYA_TRY(tsuya_image_create(&picture, TSUYA_CHART_COLS * p, TSUYA_CHART_ROWS * p, 3, TSUYA_SAMPLE_U8, TSUYA_ENCODING_SRGB));
    for (int y = 0; y < picture.height_px; y++) {
        for (int x = 0; x < picture.width_px; x++) {
            int i = y / p * TSUYA_CHART_COLS + x / p, u = x % p, v = y % p;
            bool middle = u >= rim && u < p - rim && v >= rim && v < p - rim;
            tsuya_vec3 rgb = tsuya_rgb_from_lab(middle ? c->measured[i] : c->reference[i]);
            if (c->left_out[i] && (u == v || u == p - 1 - v)) {
                rgb = (tsuya_vec3){0, 0, 0};
            }
            uint8_t *out = tsuya_image_u8(&picture, x, y);
            double value[3] = {rgb.x, rgb.y, rgb.z};
            for (int k = 0; k < 3; k++) {
                out[k] = (uint8_t)lroundf(255.0f * tsuya_srgb_encode((float)value[k]));
            }
        }
    }
    tsuya_status status = tsuya_image_save(&picture, path, NULL);
    tsuya_image_free(&picture);
    return status;
}

static void warn(const tsuya_color *c, const color_input *input)
{
    for (int i = 0; i < TSUYA_CHART_PATCHES; i++) {
        if (c->left_out[i]) {
            tsuya_warn("%s: patch %d is clipped and left out; expose less", input->chart, i + 1);
        }
    }
    if (fabs(c->gamma - 1.0) > 0.04) {
        tsuya_warn("%s: greys rise with the power %.2f of their reflectance: the photograph is not linear (a tone curve); use camera raw, or a linear file with --linear",
                   input->chart, c->gamma);
    }
    if (hypot(c->light_gradient[0], c->light_gradient[1]) > 0.15) {
        tsuya_warn("%s: the light changes by %.0f %% across the chart; it is taken out, but even light is better", input->chart,
                   200.0 * hypot(c->light_gradient[0], c->light_gradient[1]));
    }
}

static tsuya_status calibrate(tsuya_json *figures, const color_input *input, const char *file, const tsuya_context *context)
{
    tsuya_vignetting v;
    tsuya_color color = {.exposure = 1.0, .matrix = tsuya_mat3_identity()};
    bool flat = input->flat[0] != NULL;
    if (flat) {
        TSUYA_TRY(fit_flat(&v, color.white_balance, input));
        color.vignetting = v;
    }
    if (input->chart) {
        TSUYA_TRY(fit_chart(&color, input, flat ? &v : NULL, context));
        warn(&color, input);
        size_t stem = strlen(file) - strlen(tsuya_path_extension(file));
        char *picture = tsuya_calloc(stem + 5, 1);
        if (!picture) {
            return TSUYA_ERROR_MEMORY;
        }
        memcpy(picture, file, stem);
        memcpy(picture + stem, ".png", 4);
        tsuya_status status = save_picture(&color, picture);
        tsuya_free(picture);
        TSUYA_TRY(status);
    }
    tsuya_color_to_json(figures, &color);
    return tsuya_json_save(figures, file);
}

int tsuya_command_calib_color(int argc, char **argv)
{
    tsuya_common common;
    color_input input = {0};
    tsuya_command_parse(&syntax, &common, &input, argc, argv);
    tsuya_context context = tsuya_command_context(&common);
    char *folder = NULL, *file = NULL;
    tsuya_json *figures = tsuya_json_create_object();
    tsuya_status status = figures ? tsuya_command_output(&folder, &file, input.output, ".json", "color.json") : TSUYA_ERROR_MEMORY;
    if (status == TSUYA_OK) {
        status = calibrate(figures, &input, file, &context);
    }
    if (status == TSUYA_OK) {
        status = tsuya_command_figures(&common, figures);
    }
    tsuya_free(folder);
    tsuya_free(file);
    tsuya_json_free(figures);
    return status == TSUYA_OK ? TSUYA_EXIT_OK : tsuya_command_failed(status);
}
