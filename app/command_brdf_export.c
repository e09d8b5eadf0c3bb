/* tsuya brdf export MATERIAL.json */
#include "app/brdf_arguments.h"
#include "app/command.h"
#include "brdf/export.h"
#include "core/file.h"

#include <string.h>

typedef struct export_input {
    const char *material, *output;
} export_input;

typedef struct form {
    const char *extension, *name, *lost; /* lost: said before writing; NULL: nothing but what the figures say */
    tsuya_status (*write)(tsuya_export_loss *loss, const char *path, const tsuya_material *material);
} form;

static const form forms[] = {
    {".bsdf", "RGL", NULL, tsuya_export_rgl},
    {".binary", "MERL", "a MERL table is isotropic; the cloth's anisotropy is lost, its mean over all turns is written", tsuya_export_merl},
    {".gltf", "glTF", NULL, tsuya_export_gltf},
};

static const form *form_of(const char *path)
{
    for (size_t k = 0; k < sizeof forms / sizeof *forms; ++k) {
        if (strcmp(tsuya_path_extension(path), forms[k].extension) == 0) {
            return &forms[k];
        }
    }
    return NULL;
}

static const struct argp_option export_options[] = {
    {"output", 'o', "FILE", 0, "FILE.bsdf (RGL tensors, for Mitsuba 3 and pbrt), FILE.binary (MERL) or FILE.gltf; default: material.bsdf", 0},
    {0},
};

static error_t parse_export(int key, char *arg, struct argp_state *state)
{
    export_input *input = state->input;
    switch (key) {
    case 'o':
        if (!form_of(arg)) {
            argp_error(state, "-o %s: expected FILE.bsdf, FILE.binary or FILE.gltf", arg);
        }
        input->output = arg;
        return 0;
    default: return tsuya_brdf_parse_material(&input->material, key, arg, state);
    }
}

static const tsuya_syntax export_syntax = {
    .arguments = "MATERIAL.json",
    .example = "tsuya brdf export demo/brdf/default-silk.json -o silk.bsdf",
    .doc = "Writes a material as other renderers read it, and says what is lost: the error of cube roots and the colour difference (CIEDE2000) of "
           "what a reader of the file sees, against the material, over directions up to 80° from the normal.",
    .options = export_options,
    .parse = parse_export,
};

static tsuya_status export_material(const export_input *input, const tsuya_common *common)
{
    tsuya_material *m = NULL;
    tsuya_export_loss loss;
    char *folder = NULL, *file = NULL;
    tsuya_json *out = NULL;
    const char *path = input->output ? input->output : "material.bsdf";
    const form *f = form_of(path);
    tsuya_status status;
    TSUYA_GOTO_DONE(status, tsuya_material_load(&m, input->material));
    TSUYA_GOTO_DONE(status, tsuya_command_output(&folder, &file, path, f->extension, ""));
    if (f->lost) {
        tsuya_warn("%s: %s", file, f->lost);
    }
    TSUYA_GOTO_DONE(status, f->write(&loss, file, m));
    out = tsuya_json_create_object();
    if (!out) {
        TSUYA_GOTO_DONE(status, TSUYA_ERROR_MEMORY);
    }
    tsuya_json_set_text(out, "file", file);
    tsuya_json_set_text(out, "format", f->name);
    tsuya_json_set_number(out, "bytes", loss.bytes);
    tsuya_json_set_number(out, "error_cbrt", loss.cbrt);
    tsuya_json_set_number(out, "de00_median", loss.de00_median);
    tsuya_json_set_number(out, "de00_p95", loss.de00_p95);
    status = tsuya_command_figures(common, out);
done:
    tsuya_json_free(out);
    tsuya_material_free(m);
    tsuya_free(folder);
    tsuya_free(file);
    return status;
}

int tsuya_command_brdf_export(int argc, char **argv)
{
    tsuya_common common;
    export_input input = {0};
    tsuya_command_parse(&export_syntax, &common, &input, argc, argv);
    tsuya_command_context(&common);
    tsuya_status status = export_material(&input, &common);
    return status == TSUYA_OK ? TSUYA_EXIT_OK : tsuya_command_failed(status);
}
