#include "app/brdf_arguments.h"

#include "render/render.h"

error_t tsuya_brdf_parse_material(const char **material, int key, char *arg, struct argp_state *state)
{
    switch (key) {
    case ARGP_KEY_ARG:
        if (*material) {
            argp_error(state, "'%s': one MATERIAL.json only", arg);
        }
        *material = arg;
        return 0;
    case ARGP_KEY_END:
        if (!*material) {
            argp_error(state, "MATERIAL.json is missing");
        }
        return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

void tsuya_brdf_parse_color(double rgb[3], const char *option, const char *text, struct argp_state *state)
{
    if (tsuya_render_parse_color(rgb, text) != TSUYA_OK) {
        argp_error(state, "%s: %s", option, tsuya_reason());
    }
}
