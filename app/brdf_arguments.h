/* Arguments that several commands `tsuya brdf …` take. */
#ifndef TSUYA_APP_BRDF_ARGUMENTS_H
#define TSUYA_APP_BRDF_ARGUMENTS_H

#include <argp.h>

/* The one MATERIAL.json of a command: for `default:` of its parser.  Usage errors where it is missing or there are two. */
error_t tsuya_brdf_parse_material(const char **material, int key, char *arg, struct argp_state *state);
/* "#rrggbb" or "r,g,b" in linear light; a usage error otherwise, which names the option. */
void tsuya_brdf_parse_color(double rgb[3], const char *option, const char *text, struct argp_state *state);

#endif
