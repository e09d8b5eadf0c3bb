#include "render/preset.h"

#include "core/context.h"

#include "core/spectrum.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { SKY_WIDTH = 512, SKY_HEIGHT = 256, PRESETS = TSUYA_PRESET_LED + 1 };

static const char *const preset_names[PRESETS] = {"", "daylight", "torch", "halogen", "led"};

tsuya_light_preset tsuya_light_preset_find(const char *name)
{
    for (int k = TSUYA_PRESET_NONE + 1; k < PRESETS; ++k) {
        if (strcmp(preset_names[k], name) == 0) {
            return (tsuya_light_preset)k;
        }
    }
    return TSUYA_PRESET_NONE;
}

const char *tsuya_light_preset_name(tsuya_light_preset preset) { return preset_names[preset]; }

bool tsuya_light_preset_is_studio(tsuya_light_preset preset) { return preset == TSUYA_PRESET_HALOGEN || preset == TSUYA_PRESET_LED; }

/* The turntable's first camera looks from here (render/views.c). */
static tsuya_vec3 front_of(tsuya_vec3 up)
{
    tsuya_vec3 front = tsuya_vec3_tangent((tsuya_vec3){0, -1, 0}, up);
    return tsuya_vec3_norm(front) > 0.5 ? front : tsuya_vec3_tangent((tsuya_vec3){0, 0, 1}, up);
}

static void set_rgb(tsuya_light *light, tsuya_vec3 rgb, double luminance)
{
    light->rgb[0] = rgb.x * luminance;
    light->rgb[1] = rgb.y * luminance;
    light->rgb[2] = rgb.z * luminance;
}

/* Relative luminance of CIE S 011's clear sky, type 12; height: sine of the elevation. */
static double clear_sky(double height, double cos_to_sun)
{
    double angle = acos(fmin(1.0, fmax(-1.0, cos_to_sun)));
    double gradation = 1.0 - exp(-0.32 / fmax(height, 0.01));
    return gradation * (1.0 + 10.0 * (exp(-3.0 * angle) - exp(-1.5 * M_PI)) + 0.45 * cos_to_sun * cos_to_sun);
}

static tsuya_vec3 sky_direction(int column, int row)
{
    double theta = M_PI * (row + 0.5) / SKY_HEIGHT, phi = 2.0 * M_PI * ((column + 0.5) / SKY_WIDTH - 0.5);
    return (tsuya_vec3){sin(theta) * cos(phi), sin(theta) * sin(phi), cos(theta)}; /* ahead, right, up */
}

static double row_solid_angle(int row)
{
    return 2.0 * M_PI / SKY_WIDTH * (cos(M_PI * row / SKY_HEIGHT) - cos(M_PI * (row + 1) / SKY_HEIGHT));
}

/* `sun` in the map's frame; the sky alone gives `horizontal` on the ground, and the floor sends back `floor` everywhere. */
static void paint_sky(tsuya_image *image, tsuya_vec3 sun, double horizontal, double floor_radiance)
{
    double sum = 0.0;
    tsuya_vec3 blue = tsuya_rgb_of_daylight(12000.0);
    for (int pass = 0; pass < 2; ++pass) {
        for (int k = 0; k < SKY_WIDTH * SKY_HEIGHT; ++k) {
            tsuya_vec3 d = sky_direction(k % SKY_WIDTH, k / SKY_WIDTH);
            float *pixel = tsuya_image_f32(image, k % SKY_WIDTH, k / SKY_WIDTH);
            double sky = d.z > 0.0 ? clear_sky(d.z, tsuya_vec3_dot(d, sun)) : 0.0;
            if (pass == 0) {
                sum += sky * fmax(0.0, d.z) * row_solid_angle(k / SKY_WIDTH);
            } else if (d.z > 0.0) {
                double l = sky * horizontal / sum;
                pixel[0] = (float)(blue.x * l);
                pixel[1] = (float)(blue.y * l);
                pixel[2] = (float)(blue.z * l);
            } else {
                pixel[0] = pixel[1] = pixel[2] = (float)floor_radiance;
            }
        }
    }
}

static tsuya_status add_daylight(tsuya_light_set *set, tsuya_vec3 up)
{
    const double elevation = tsuya_rad_from_deg(42.0), azimuth = tsuya_rad_from_deg(-40.0), direct = 500.0, sky = 100.0;
    tsuya_vec3 front = front_of(up), right = tsuya_vec3_cross(up, front); /* the viewer's right, who looks along −front */
    tsuya_vec3 level = tsuya_vec3_mad(tsuya_vec3_scale(front, cos(azimuth)), sin(azimuth), right);
    tsuya_vec3 to_sun = tsuya_vec3_mad(tsuya_vec3_scale(level, cos(elevation)), sin(elevation), up);
    tsuya_light sun = {.kind = TSUYA_LIGHT_DIRECTIONAL, .direction = tsuya_vec3_scale(to_sun, -1.0)};
    tsuya_light dome = {.kind = TSUYA_LIGHT_ENVIRONMENT, .direction = front, .up = up, .rgb = {1, 1, 1}};
    tsuya_image image;
    set_rgb(&sun, (tsuya_vec3){1, 1, 1}, direct);
    TSUYA_TRY(tsuya_light_take_spectrum(&sun, "D5400K", "."));
    TSUYA_TRY(tsuya_light_set_add(set, &sun, "daylight"));
    TSUYA_TRY(tsuya_image_create(&image, SKY_WIDTH, SKY_HEIGHT, 3, TSUYA_SAMPLE_F32, TSUYA_ENCODING_LINEAR));
    tsuya_vec3 map_right = tsuya_vec3_cross(front, up);
    tsuya_vec3 seen = {tsuya_vec3_dot(to_sun, front), tsuya_vec3_dot(to_sun, map_right), tsuya_vec3_dot(to_sun, up)};
    paint_sky(&image, seen, sky, 0.2 / M_PI * (sky + direct * sin(elevation)));
    tsuya_status status = tsuya_environment_create(&dome.map, &image, front, up, "daylight");
    tsuya_image_free(&image);
    return status == TSUYA_OK ? tsuya_light_set_add(set, &dome, "daylight") : status;
}

/* Smooth noise in [−1, 1] of about one swing a unit of time. */
static double sway(uint64_t seed, uint64_t stream, double time)
{
    double cell = floor(time), t = time - cell, s = t * t * (3.0 - 2.0 * t);
    double a = tsuya_random_uniform(seed, stream, (uint64_t)cell), b = tsuya_random_uniform(seed, stream, (uint64_t)cell + 1);
    return 2.0 * (a + s * (b - a)) - 1.0;
}

/* Three octaves, 1.5 to 6 swings a second: the puffing of an open fire lies between. */
static double flicker(uint64_t seed, uint64_t stream, double seconds)
{
    double sum = 0.0;
    for (int octave = 0; octave < 3; ++octave) {
        sum += sway(seed, stream * 8 + (uint64_t)octave, 1.5 * (1 << octave) * seconds) / (1 << octave);
    }
    return sum / 1.75;
}

static const double fire_kelvin = 1900.0;

/* A flame over its basket.  irradiance: at the subject, W m⁻². */
static tsuya_status add_fire(tsuya_light_set *set, tsuya_vec3 base, tsuya_vec3 center, tsuya_vec3 up, tsuya_vec3 right, double radius,
                             double irradiance, uint64_t seed, uint64_t which, double seconds)
{
    double strength = 1.0 + 0.3 * flicker(seed, 40 + 4 * which, seconds);
    double lift = 0.03 * flicker(seed, 41 + 4 * which, seconds), lean = 0.03 * flicker(seed, 42 + 4 * which, seconds);
    tsuya_light fire = {.kind = TSUYA_LIGHT_DISK, .size_m = {0.22 * radius, 0.22 * radius}, .up = up};
    fire.position_m = tsuya_vec3_mad(tsuya_vec3_mad(base, lift * radius, up), lean * radius, right);
    fire.direction = tsuya_vec3_sub(center, fire.position_m);
    double r = tsuya_vec3_norm(fire.direction), area = M_PI / 4.0 * fire.size_m[0] * fire.size_m[0];
    char kelvin[32];
    snprintf(kelvin, sizeof kelvin, "%.1fK", fire_kelvin + 60.0 * (strength - 1.0));
    set_rgb(&fire, (tsuya_vec3){1, 1, 1}, irradiance * strength * r * r / area);
    TSUYA_TRY(tsuya_light_take_spectrum(&fire, kelvin, "."));
    return tsuya_light_set_add(set, &fire, "torch");
}

/* What boards and roof send back of the fires' light on the ground (boards a tenth of it: it falls off around the baskets; the roof a
 * quarter of that), and little of the night sky between. */
static tsuya_status add_stage(tsuya_light_set *set, tsuya_vec3 front, tsuya_vec3 up, double horizontal)
{
    enum { WIDTH = 32, HEIGHT = 32 };
    const double floor_share = 0.1, roof_share = 0.25, night = 0.02;
    tsuya_vec3 fire = tsuya_lamp_spectrum_rgb(set->light[0].spectrum), sky = tsuya_rgb_of_daylight(9000.0);
    tsuya_light room = {.kind = TSUYA_LIGHT_ENVIRONMENT, .direction = front, .up = up, .rgb = {1, 1, 1}};
    tsuya_image image;
    TSUYA_TRY(tsuya_image_create(&image, WIDTH, HEIGHT, 3, TSUYA_SAMPLE_F32, TSUYA_ENCODING_LINEAR));
    for (int k = 0; k < WIDTH * HEIGHT; ++k) {
        int row = k / WIDTH; /* top to bottom: roof within 50 degrees of the zenith, night, boards */
        double share = row >= HEIGHT / 2 ? floor_share : row < HEIGHT * 50 / 180 ? roof_share * floor_share : 0.0;
        tsuya_vec3 l = tsuya_vec3_mad(tsuya_vec3_scale(sky, share > 0.0 ? 0.0 : night), share * horizontal / M_PI, fire);
        float *pixel = tsuya_image_f32(&image, k % WIDTH, row);
        pixel[0] = (float)fmax(0.0, l.x);
        pixel[1] = (float)fmax(0.0, l.y);
        pixel[2] = (float)fmax(0.0, l.z);
    }
    tsuya_status status = tsuya_environment_create(&room.map, &image, front, up, "torch");
    tsuya_image_free(&image);
    return status == TSUYA_OK ? tsuya_light_set_add(set, &room, "torch") : status;
}

/* Iron baskets on poles, their flames above the shoulders: two before the stage, two weaker ones behind its corners. */
static tsuya_status add_torch(tsuya_light_set *set, tsuya_vec3 center, double radius, tsuya_vec3 up, uint64_t seed, int frame)
{
    static const struct { double front, right, up, irradiance; } basket[] = {
        {1.7, -1.5, 0.9, 10.0}, {1.7, 1.5, 0.9, 10.0}, {-1.4, -1.6, 1.1, 5.0}, {-1.4, 1.6, 1.1, 5.0},
    };
    tsuya_vec3 front = front_of(up), right = tsuya_vec3_cross(up, front);
    double seconds = frame / 25.0, horizontal = 0.0;
    for (uint64_t k = 0; k < sizeof basket / sizeof *basket; ++k) {
        double length = sqrt(basket[k].front * basket[k].front + basket[k].right * basket[k].right + basket[k].up * basket[k].up);
        tsuya_vec3 base = tsuya_vec3_mad(center, basket[k].front * radius, front);
        base = tsuya_vec3_mad(tsuya_vec3_mad(base, basket[k].right * radius, right), basket[k].up * radius, up);
        TSUYA_TRY(add_fire(set, base, center, up, right, radius, basket[k].irradiance, seed, k, seconds));
        horizontal += basket[k].irradiance * basket[k].up / length;
    }
    return add_stage(set, front, up, horizontal);
}

tsuya_status tsuya_light_set_preset(tsuya_light_set *set, tsuya_light_preset preset, tsuya_vec3 center, double radius_m, tsuya_vec3 up,
                                    uint64_t seed, int frame)
{
    *set = (tsuya_light_set){0};
    if (preset == TSUYA_PRESET_NONE || tsuya_light_preset_is_studio(preset)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "preset \"%s\": stands with the camera", preset_names[preset]);
    }
    tsuya_status status = preset == TSUYA_PRESET_DAYLIGHT ? add_daylight(set, up) : add_torch(set, center, radius_m, up, seed, frame);
    if (status != TSUYA_OK) {
        tsuya_light_set_free(set);
    }
    return status;
}
