#include "capture/studio_goniometer.h"

#include "core/file.h"

#include <math.h>

enum { STREAM_GAIN = 70, STREAM_FLOOR = 71, READINGS_MOST = 100000, FULL_CODE = 65535 };

tsuya_goniometer tsuya_goniometer_default(void)
{
    return (tsuya_goniometer){.light_theta_deg = 30.0, .light_phi_deg = 0.0, .view_theta_deg = 30.0, .view_phi_deg = 180.0,
                              .azimuth_step_deg = 45.0, .tilt_step_deg = 3.0, .tilt_most_deg = 57.0, .irradiance = 1.0,
                              .gain_noise = 0.01, .floor_noise = 1e-4};
}

/* Rz(a) · Ry(−τ) · w */
tsuya_vec3 tsuya_goniometer_on_stage(tsuya_vec3 w, double azimuth_deg, double tilt_deg)
{
    double a = tsuya_rad_from_deg(azimuth_deg), tau = tsuya_rad_from_deg(tilt_deg);
    tsuya_vec3 tilted = {cos(tau) * w.x - sin(tau) * w.z, w.y, sin(tau) * w.x + cos(tau) * w.z};
    return (tsuya_vec3){cos(a) * tilted.x - sin(a) * tilted.y, sin(a) * tilted.x + cos(a) * tilted.y, tilted.z};
}

static tsuya_vec3 on_stage(double theta_deg, double phi_deg, double azimuth_deg, double tilt_deg)
{
    double theta = tsuya_rad_from_deg(theta_deg), phi = tsuya_rad_from_deg(phi_deg);
    return tsuya_goniometer_on_stage((tsuya_vec3){sin(theta) * cos(phi), sin(theta) * sin(phi), cos(theta)}, azimuth_deg, tilt_deg);
}

typedef struct sweep {
    const tsuya_goniometer *bench;
    tsuya_reflectance reflectance;
    const void *user;
    uint64_t seed;
    int azimuths, tilts; /* tilts: on each side of 0 */
} sweep;

/* Radiance at one position of the stage; false when lamp or camera stand below the sample. */
static bool read_position(double rgb[3], const sweep *s, double azimuth_deg, double tilt_deg)
{
    const tsuya_goniometer *b = s->bench;
    tsuya_vec3 wi = on_stage(b->light_theta_deg, b->light_phi_deg, azimuth_deg, tilt_deg);
    tsuya_vec3 wo = on_stage(b->view_theta_deg, b->view_phi_deg, azimuth_deg, tilt_deg);
    if (!(wi.z > 1e-6) || !(wo.z > 1e-6)) {
        return false;
    }
    s->reflectance(s->user, wi, wo, rgb);
    for (int c = 0; c < 3; c++) {
        rgb[c] *= b->irradiance * wi.z;
    }
    return true;
}

static double azimuth_of(const sweep *s, int k) { return k * s->bench->azimuth_step_deg; }

static double brightest(const sweep *s)
{
    double most = 0.0, rgb[3];
    for (int a = 0; a < s->azimuths; a++) {
        for (int t = -s->tilts; t <= s->tilts; t++) {
            if (read_position(rgb, s, azimuth_of(s, a), t * s->bench->tilt_step_deg)) {
                most = fmax(most, fmax(rgb[0], fmax(rgb[1], rgb[2])));
            }
        }
    }
    return most;
}

/* Noise, and the camera's 16 bits. */
static double reading(const sweep *s, double radiance, double full, uint64_t counter)
{
    double noisy = radiance * (1.0 + s->bench->gain_noise * tsuya_random_normal(s->seed, STREAM_GAIN, counter)) +
                   full * s->bench->floor_noise * tsuya_random_normal(s->seed, STREAM_FLOOR, counter);
    double code = round(fmin(fmax(noisy / full, 0.0), 1.0) * FULL_CODE);
    return code / FULL_CODE * full;
}

static void write_rows(FILE *stream, const sweep *s, double full)
{
    for (int a = 0; a < s->azimuths; a++) {
        for (int t = -s->tilts; t <= s->tilts; t++) {
            double rgb[3], tilt = t * s->bench->tilt_step_deg;
            uint64_t counter = 3 * (uint64_t)(a * (2 * s->tilts + 1) + t + s->tilts);
            if (!read_position(rgb, s, azimuth_of(s, a), tilt)) {
                continue;
            }
            fprintf(stream, "%g,%g,%.9g,%.9g,%.9g\n", azimuth_of(s, a), tilt, reading(s, rgb[0], full, counter),
                    reading(s, rgb[1], full, counter + 1), reading(s, rgb[2], full, counter + 2));
        }
    }
}

tsuya_status tsuya_goniometer_write(const char *path, const tsuya_goniometer *b, tsuya_reflectance reflectance, const void *user,
                                    const tsuya_context *context)
{
    if (!(b->azimuth_step_deg > 0.0) || !(b->tilt_step_deg > 0.0) || !(b->tilt_most_deg >= 0.0 && b->tilt_most_deg < 90.0) ||
        !(b->irradiance > 0.0) || 180.0 / b->azimuth_step_deg * (2.0 * b->tilt_most_deg / b->tilt_step_deg + 1.0) > READINGS_MOST) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: goniometer: azimuth step %g, tilt step %g up to %g degrees, irradiance %g; steps and "
                          "irradiance above 0, tilts below 90 and at most %d readings are accepted", path, b->azimuth_step_deg,
                          b->tilt_step_deg, b->tilt_most_deg, b->irradiance, READINGS_MOST);
    }
    sweep s = {.bench = b, .reflectance = reflectance, .user = user, .seed = context->seed,
               .azimuths = (int)ceil(180.0 / b->azimuth_step_deg - 1e-9), .tilts = (int)floor(b->tilt_most_deg / b->tilt_step_deg + 1e-9)};
    double full = b->full_radiance > 0.0 ? b->full_radiance : 1.25 * brightest(&s);
    if (!(full > 0.0)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: goniometer: the sample is black at every position", path);
    }
    tsuya_file_writer writer;
    TSUYA_TRY(tsuya_file_begin(&writer, path));
    fprintf(writer.stream, "# quantity=radiance\n# irradiance=%.9g\n# clip=%.9g\n# light_theta_deg=%g\n# light_phi_deg=%g\n"
                           "# view_theta_deg=%g\n# view_phi_deg=%g\nazimuth_deg,tilt_deg,r,g,b\n",
            b->irradiance, full * (1.0 - 0.5 / FULL_CODE), b->light_theta_deg, b->light_phi_deg, b->view_theta_deg, b->view_phi_deg);
    write_rows(writer.stream, &s, full);
    return tsuya_file_commit(&writer);
}
