/* Colours as people give them: by name, as sRGB, as linear numbers, as Lab, or as a measured reflectance. */
#include "render/setup.h"

#include "core/color.h"
#include "core/image.h"
#include "core/spectrum.h"
#include "core/table.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

/* The names of CSS Color Module Level 4, sRGB. */
static const struct { const char *name; uint32_t srgb; } named[] = {
    {"aliceblue", 0xf0f8ff}, {"antiquewhite", 0xfaebd7}, {"aqua", 0x00ffff}, {"aquamarine", 0x7fffd4}, {"azure", 0xf0ffff},
    {"beige", 0xf5f5dc}, {"bisque", 0xffe4c4}, {"black", 0x000000}, {"blanchedalmond", 0xffebcd}, {"blue", 0x0000ff},
    {"blueviolet", 0x8a2be2}, {"brown", 0xa52a2a}, {"burlywood", 0xdeb887}, {"cadetblue", 0x5f9ea0}, {"chartreuse", 0x7fff00},
    {"chocolate", 0xd2691e}, {"coral", 0xff7f50}, {"cornflowerblue", 0x6495ed}, {"cornsilk", 0xfff8dc}, {"crimson", 0xdc143c},
    {"cyan", 0x00ffff}, {"darkblue", 0x00008b}, {"darkcyan", 0x008b8b}, {"darkgoldenrod", 0xb8860b}, {"darkgray", 0xa9a9a9},
    {"darkgreen", 0x006400}, {"darkgrey", 0xa9a9a9}, {"darkkhaki", 0xbdb76b}, {"darkmagenta", 0x8b008b}, {"darkolivegreen", 0x556b2f},
    {"darkorange", 0xff8c00}, {"darkorchid", 0x9932cc}, {"darkred", 0x8b0000}, {"darksalmon", 0xe9967a}, {"darkseagreen", 0x8fbc8f},
    {"darkslateblue", 0x483d8b}, {"darkslategray", 0x2f4f4f}, {"darkslategrey", 0x2f4f4f}, {"darkturquoise", 0x00ced1},
    {"darkviolet", 0x9400d3}, {"deeppink", 0xff1493}, {"deepskyblue", 0x00bfff}, {"dimgray", 0x696969}, {"dimgrey", 0x696969},
    {"dodgerblue", 0x1e90ff}, {"firebrick", 0xb22222}, {"floralwhite", 0xfffaf0}, {"forestgreen", 0x228b22}, {"fuchsia", 0xff00ff},
    {"gainsboro", 0xdcdcdc}, {"ghostwhite", 0xf8f8ff}, {"gold", 0xffd700}, {"goldenrod", 0xdaa520}, {"gray", 0x808080},
    {"green", 0x008000}, {"greenyellow", 0xadff2f}, {"grey", 0x808080}, {"honeydew", 0xf0fff0}, {"hotpink", 0xff69b4},
    {"indianred", 0xcd5c5c}, {"indigo", 0x4b0082}, {"ivory", 0xfffff0}, {"khaki", 0xf0e68c}, {"lavender", 0xe6e6fa},
    {"lavenderblush", 0xfff0f5}, {"lawngreen", 0x7cfc00}, {"lemonchiffon", 0xfffacd}, {"lightblue", 0xadd8e6}, {"lightcoral", 0xf08080},
    {"lightcyan", 0xe0ffff}, {"lightgoldenrodyellow", 0xfafad2}, {"lightgray", 0xd3d3d3}, {"lightgreen", 0x90ee90},
    {"lightgrey", 0xd3d3d3}, {"lightpink", 0xffb6c1}, {"lightsalmon", 0xffa07a}, {"lightseagreen", 0x20b2aa}, {"lightskyblue", 0x87cefa},
    {"lightslategray", 0x778899}, {"lightslategrey", 0x778899}, {"lightsteelblue", 0xb0c4de}, {"lightyellow", 0xffffe0},
    {"lime", 0x00ff00}, {"limegreen", 0x32cd32}, {"linen", 0xfaf0e6}, {"magenta", 0xff00ff}, {"maroon", 0x800000},
    {"mediumaquamarine", 0x66cdaa}, {"mediumblue", 0x0000cd}, {"mediumorchid", 0xba55d3}, {"mediumpurple", 0x9370db},
    {"mediumseagreen", 0x3cb371}, {"mediumslateblue", 0x7b68ee}, {"mediumspringgreen", 0x00fa9a}, {"mediumturquoise", 0x48d1cc},
    {"mediumvioletred", 0xc71585}, {"midnightblue", 0x191970}, {"mintcream", 0xf5fffa}, {"mistyrose", 0xffe4e1}, {"moccasin", 0xffe4b5},
    {"navajowhite", 0xffdead}, {"navy", 0x000080}, {"oldlace", 0xfdf5e6}, {"olive", 0x808000}, {"olivedrab", 0x6b8e23},
    {"orange", 0xffa500}, {"orangered", 0xff4500}, {"orchid", 0xda70d6}, {"palegoldenrod", 0xeee8aa}, {"palegreen", 0x98fb98},
    {"paleturquoise", 0xafeeee}, {"palevioletred", 0xdb7093}, {"papayawhip", 0xffefd5}, {"peachpuff", 0xffdab9}, {"peru", 0xcd853f},
    {"pink", 0xffc0cb}, {"plum", 0xdda0dd}, {"powderblue", 0xb0e0e6}, {"purple", 0x800080}, {"rebeccapurple", 0x663399},
    {"red", 0xff0000}, {"rosybrown", 0xbc8f8f}, {"royalblue", 0x4169e1}, {"saddlebrown", 0x8b4513}, {"salmon", 0xfa8072},
    {"sandybrown", 0xf4a460}, {"seagreen", 0x2e8b57}, {"seashell", 0xfff5ee}, {"sienna", 0xa0522d}, {"silver", 0xc0c0c0},
    {"skyblue", 0x87ceeb}, {"slateblue", 0x6a5acd}, {"slategray", 0x708090}, {"slategrey", 0x708090}, {"snow", 0xfffafa},
    {"springgreen", 0x00ff7f}, {"steelblue", 0x4682b4}, {"tan", 0xd2b48c}, {"teal", 0x008080}, {"thistle", 0xd8bfd8},
    {"tomato", 0xff6347}, {"turquoise", 0x40e0d0}, {"violet", 0xee82ee}, {"wheat", 0xf5deb3}, {"white", 0xffffff},
    {"whitesmoke", 0xf5f5f5}, {"yellow", 0xffff00}, {"yellowgreen", 0x9acd32},
};
enum { NAMES = sizeof named / sizeof named[0], MOST_BANDS = 2048 };

static void from_srgb(double rgb[3], uint32_t srgb)
{
    for (int c = 0; c < 3; ++c) {
        rgb[c] = tsuya_srgb_decode((float)(srgb >> (16 - 8 * c) & 255) / 255.0f);
    }
}

static bool parse_hex(double rgb[3], const char *text)
{
    if (text[0] != '#' || strlen(text) != 7 || strspn(text + 1, "0123456789abcdefABCDEF") != 6) {
        return false;
    }
    unsigned srgb = 0;
    if (sscanf(text + 1, "%6x", &srgb) != 1) {
        return false;
    }
    from_srgb(rgb, srgb);
    return true;
}

static bool parse_name(double rgb[3], const char *text)
{
    for (int k = 0; k < NAMES; ++k) {
        if (strcasecmp(named[k].name, text) == 0) {
            from_srgb(rgb, named[k].srgb);
            return true;
        }
    }
    return false;
}

/* "a,b,c", whole. */
static bool three_numbers(double number[3], const char *text)
{
    char part[3][32];
    int used = 0;
    if (sscanf(text, " %31[^, )] , %31[^, )] , %31[^, )]%n", part[0], part[1], part[2], &used) != 3 || text[used] != '\0') {
        return false;
    }
    return tsuya_parse_number(&number[0], part[0]) && tsuya_parse_number(&number[1], part[1]) && tsuya_parse_number(&number[2], part[2]);
}

/* Held at the gamut's border when it lies outside by rounding; a colour farther out is no reflectance that these three can show. */
static tsuya_status take_rgb(double rgb[3], tsuya_vec3 color, const char *text)
{
    const double v[3] = {color.x, color.y, color.z};
    for (int c = 0; c < 3; ++c) {
        if (!(v[c] > -0.02 && v[c] < 1.02)) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "colour \"%.60s\": linear Rec.709 %.3f, %.3f, %.3f; expected a colour inside its gamut, each in [0, 1]",
                              text, v[0], v[1], v[2]);
        }
        rgb[c] = fmin(1.0, fmax(0.0, v[c]));
    }
    return TSUYA_OK;
}

static tsuya_status parse_lab(double rgb[3], const char *text)
{
    double lab[3];
    char inner[96];
    snprintf(inner, sizeof inner, "%.90s", text + 4);
    size_t length = strlen(inner);
    bool closed = length > 0 && inner[length - 1] == ')';
    if (closed) {
        inner[length - 1] = '\0';
    }
    if (!closed || !three_numbers(lab, inner)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "colour \"%.60s\": expected \"lab(L,a,b)\"", text);
    }
    return take_rgb(rgb, tsuya_rgb_from_lab((tsuya_lab){lab[0], lab[1], lab[2]}), text);
}

static tsuya_status load_table(double *nm, double *reflectance, int *rows, const char *path)
{
    static const char *const columns[] = {"nm", "reflectance", NULL};
    const tsuya_table_options options = {.required = columns, .known = columns};
    tsuya_table table;
    TSUYA_TRY(tsuya_table_load(&table, path, &options));
    int count = *rows = (int)(table.row_count < MOST_BANDS ? table.row_count : MOST_BANDS);
    tsuya_status status = count > 0 && table.row_count <= MOST_BANDS
                              ? TSUYA_OK
                              : tsuya_fail(TSUYA_ERROR_INPUT, "%s: %zu rows; expected 1 to %d wavelengths", path, table.row_count, MOST_BANDS);
    for (int k = 0; status == TSUYA_OK && k < count; ++k) {
        nm[k] = tsuya_table_at(&table, (size_t)k, tsuya_table_column(&table, "nm"));
        reflectance[k] = tsuya_table_at(&table, (size_t)k, tsuya_table_column(&table, "reflectance"));
        if (!(reflectance[k] >= 0.0 && reflectance[k] <= 1.0) || (k > 0 && !(nm[k] > nm[k - 1]))) {
            status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d: %g nm, reflectance %g; expected ascending wavelengths and reflectances in [0, 1]",
                                path, table.line[k], nm[k], reflectance[k]);
        }
    }
    tsuya_table_free(&table);
    return status;
}

static tsuya_status load_spectrum(double rgb[3], const char *path)
{
    double nm[MOST_BANDS], reflectance[MOST_BANDS];
    int rows;
    TSUYA_TRY(load_table(nm, reflectance, &rows, path));
    return take_rgb(rgb, tsuya_rgb_of_reflectance(nm, reflectance, rows), path);
}

tsuya_status tsuya_render_load_reflectance(double *at, const double *wanted_nm, int count, const char *path)
{
    double nm[MOST_BANDS], reflectance[MOST_BANDS];
    int rows, k = 0;
    TSUYA_TRY(load_table(nm, reflectance, &rows, path));
    for (int c = 0; c < count; ++c) {
        while (k + 2 < rows && nm[k + 1] < wanted_nm[c]) {
            ++k;
        }
        double t = rows > 1 ? fmin(1.0, fmax(0.0, (wanted_nm[c] - nm[k]) / (nm[k + 1] - nm[k]))) : 0.0;
        at[c] = rows > 1 ? (1.0 - t) * reflectance[k] + t * reflectance[k + 1] : reflectance[0];
    }
    return TSUYA_OK;
}

tsuya_status tsuya_render_check_color(const char *text)
{
    double rgb[3];
    return strcmp(text, "photographs") == 0 || strcmp(text, "material") == 0 ? TSUYA_OK : tsuya_render_parse_color(rgb, text);
}

tsuya_status tsuya_render_parse_color(double rgb[3], const char *text)
{
    const char *names[NAMES + 1];
    size_t length = strlen(text);
    if (parse_hex(rgb, text) || parse_name(rgb, text)) {
        return TSUYA_OK;
    }
    if (three_numbers(rgb, text) && fmin(rgb[0], fmin(rgb[1], rgb[2])) >= 0.0 && fmax(rgb[0], fmax(rgb[1], rgb[2])) <= 1.0) {
        return TSUYA_OK;
    }
    if (strncasecmp(text, "lab(", 4) == 0) {
        return parse_lab(rgb, text);
    }
    if (length > 4 && strcasecmp(text + length - 4, ".csv") == 0) {
        return load_spectrum(rgb, text);
    }
    for (int k = 0; k < NAMES; ++k) {
        names[k] = named[k].name;
    }
    names[NAMES] = NULL;
    const char *nearest = tsuya_nearest_name(text, names);
    return tsuya_fail(TSUYA_ERROR_INPUT,
                      "colour \"%.60s\": expected a name (%s), \"#rrggbb\" (sRGB), \"r,g,b\" (linear, each in [0, 1]), \"lab(L,a,b)\" (D65) a "
                      "SPECTRUM.csv with nm,reflectance, \"photographs\" or \"material\"", text, nearest ? nearest : "indigo");
}
