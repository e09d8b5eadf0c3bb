/* tsuya brdf eval MATERIAL.json */
#include "app/brdf_arguments.h"
#include "app/command.h"
#include "brdf/material.h"
#include "core/file.h"
#include "core/table.h"

#include <stdio.h>
#include <string.h>

enum { KEY_COLOR = 1 };

typedef struct eval_input {
    const char *material;
    const char *color;
    double linear_rgb[3];
} eval_input;

static const char *const angle_names[] = {"theta_i_deg", "phi_i_deg", "theta_o_deg", "phi_o_deg", NULL};

static const struct argp_option eval_options[] = {
    {"color", KEY_COLOR, "COLOR", 0, "Dye the cloth: \"#rrggbb\", or \"r,g,b\" in linear light", 0},
    {0},
};

static error_t parse_eval(int key, char *arg, struct argp_state *state)
{
    eval_input *input = state->input;
    switch (key) {
    case KEY_COLOR:
        input->color = arg;
        tsuya_brdf_parse_color(input->linear_rgb, "--color", arg, state);
        return 0;
    default: return tsuya_brdf_parse_material(&input->material, key, arg, state);
    }
}

static const tsuya_syntax eval_syntax = {
    .arguments = "MATERIAL.json",
    .example = "printf 'theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg\\n30,0,30,180\\n' | tsuya brdf eval demo/brdf/default-silk.json",
    .doc = "Reads a table of directions on stdin (columns theta_i_deg, phi_i_deg, theta_o_deg, phi_o_deg in any order) and "
           "writes the rows with the material's BRDF in 1/sr behind them. Directions below the surface give 0.",
    .options = eval_options,
    .parse = parse_eval,
};

/* All of stdin; refused above 1 GiB. */
static tsuya_status read_input(char **text)
{
    enum { STEP = 1 << 16 };
    const size_t limit = (size_t)1 << 30;
    size_t size = 0, capacity = 0;
    char *bytes = NULL;
    for (;;) {
        if (capacity - size < STEP) {
            capacity = capacity ? 2 * capacity : 2 * STEP;
            char *grown = capacity <= limit ? tsuya_realloc(bytes, capacity, 1) : NULL;
            if (!grown) {
                tsuya_free(bytes);
                return capacity > limit ? tsuya_fail(TSUYA_ERROR_INPUT, "stdin: more than 1 GiB") : TSUYA_ERROR_MEMORY;
            }
            bytes = grown;
        }
        size_t got = fread(bytes + size, 1, STEP - 1, stdin);
        size += got;
        if (got == 0) {
            break;
        }
    }
    if (ferror(stdin) || memchr(bytes, '\0', size)) {
        tsuya_free(bytes);
        return tsuya_fail(TSUYA_ERROR_INPUT, "stdin: cannot be read as text");
    }
    bytes[size] = '\0';
    *text = bytes;
    return TSUYA_OK;
}

static tsuya_vec3 direction(double theta_deg, double phi_deg)
{
    double t = tsuya_rad_from_deg(theta_deg), p = tsuya_rad_from_deg(phi_deg);
    return (tsuya_vec3){sin(t) * cos(p), sin(t) * sin(p), cos(t)};
}

static void write_rows(const tsuya_table *table, const tsuya_material *material)
{
    tsuya_material_info info = tsuya_material_get_info(material);
    int column[4];
    for (int i = 0; i < 4; i++) {
        column[i] = tsuya_table_column(table, angle_names[i]);
    }
    if (info.relative) {
        tsuya_warn("material '%s' is relative: its values are known up to one common factor", info.name);
    }
    for (int c = 0; c < table->column_count; c++) {
        printf("%s,", table->column[c]);
    }
    for (int c = 0; c < info.channel_count; c++) {
        printf("%s%s", c ? "," : "", info.channel[c]);
    }
    printf("\n");
    for (size_t row = 0; row < table->row_count; row++) {
        double value[TSUYA_MATERIAL_MAX_CHANNELS], a[4];
        for (int i = 0; i < 4; i++) {
            a[i] = tsuya_table_at(table, row, column[i]);
        }
        tsuya_material_eval(material, NULL, direction(a[0], a[1]), direction(a[2], a[3]), value);
        for (int c = 0; c < table->column_count; c++) {
            printf("%.10g,", tsuya_table_at(table, row, c));
        }
        for (int c = 0; c < info.channel_count; c++) {
            printf("%s%.9g", c ? "," : "", value[c]);
        }
        printf("\n");
    }
}

static void write_json(tsuya_json *figures, const tsuya_table *table, const tsuya_material *material)
{
    tsuya_material_info info = tsuya_material_get_info(material);
    tsuya_json_set_text(figures, "material", info.name);
    tsuya_json_set_text(figures, "model", info.model);
    tsuya_json_set_bool(figures, "default", info.is_default);
    tsuya_json_set_number(figures, "rows", (double)table->row_count);
}

static tsuya_status evaluate(const eval_input *input, const tsuya_common *common)
{
    tsuya_table_options options = {.required = angle_names, .known = angle_names};
    tsuya_table table = {0};
    tsuya_material *material = NULL;
    tsuya_json *figures = NULL;
    char *text = NULL;
    tsuya_status status;
    TSUYA_GOTO_DONE(status, tsuya_material_load(&material, input->material));
    if (input->color) {
        TSUYA_GOTO_DONE(status, tsuya_material_set_dye(material, input->linear_rgb));
    }
    TSUYA_GOTO_DONE(status, read_input(&text));
    TSUYA_GOTO_DONE(status, tsuya_table_parse(&table, text, "stdin", &options));
    write_rows(&table, material);
    if (fflush(stdout) != 0) {
        status = tsuya_fail_errno("stdout", "write");
        goto done;
    }
    if (common->json_path) {
        figures = tsuya_json_create_object();
        status = figures ? TSUYA_OK : TSUYA_ERROR_MEMORY;
        if (figures) {
            write_json(figures, &table, material);
            status = tsuya_json_save(figures, common->json_path);
        }
    }
done:
    tsuya_json_free(figures);
    tsuya_table_free(&table);
    tsuya_material_free(material);
    tsuya_free(text);
    return status;
}

int tsuya_command_brdf_eval(int argc, char **argv)
{
    tsuya_common common;
    eval_input input = {0};
    tsuya_command_parse(&eval_syntax, &common, &input, argc, argv);
    if (common.json_path && strcmp(common.json_path, "-") == 0) {
        return tsuya_command_failed(tsuya_fail(TSUYA_ERROR_INPUT, "--json -: stdout holds the table; give a file"));
    }
    tsuya_status status = evaluate(&input, &common);
    return status == TSUYA_OK ? TSUYA_EXIT_OK : tsuya_command_failed(status);
}
