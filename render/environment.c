#include "render/environment.h"

#include "core/color.h"
#include "core/memory.h"

#include <string.h>

struct tsuya_environment {
    int width, height;
    tsuya_mat3 world_from_map; /* columns: direction, right (seen from inside), up */
    float *rgb;
    double *row_cdf;           /* height + 1, ends at 1 */
    double *column_cdf;        /* (width + 1) per row, each ends at 1 */
    double *density;           /* per pixel, sr⁻¹ */
    double mean;
};

static tsuya_status copy_pixels(tsuya_environment *e, const tsuya_image *image, const char *name)
{
    for (int y = 0; y < e->height; ++y) {
        for (int x = 0; x < e->width; ++x) {
            const float *pixel = tsuya_image_f32(image, x, y);
            for (int c = 0; c < 3; ++c) {
                if (!(pixel[c] >= 0.0f && isfinite(pixel[c]))) {
                    return tsuya_fail(TSUYA_ERROR_INPUT, "%s: pixel (%d, %d), channel %d is %g; expected a finite radiance ≥ 0", name,
                                      x, y, c, (double)pixel[c]);
                }
                e->rgb[3 * ((size_t)y * (size_t)e->width + (size_t)x) + (size_t)c] = pixel[c];
            }
        }
    }
    return TSUYA_OK;
}

/* Solid angle of a pixel of row y. */
static double pixel_solid_angle(const tsuya_environment *e, int y)
{
    return 2.0 * M_PI / e->width * (cos(M_PI * y / e->height) - cos(M_PI * (y + 1) / e->height));
}

/* Power of each pixel, summed along the rows and down the image.  Returns the whole. */
static double accumulate(tsuya_environment *e)
{
    double total = 0.0;
    for (int y = 0; y < e->height; ++y) {
        double *cdf = e->column_cdf + (size_t)y * (size_t)(e->width + 1), row = 0.0, omega = pixel_solid_angle(e, y);
        for (int x = 0; x < e->width; ++x) {
            size_t k = (size_t)y * (size_t)e->width + (size_t)x;
            const float *rgb = e->rgb + 3 * k;
            /* every pixel that sends anything is sampled, also where its luminance alone would be lost */
            double power = omega * fmax(tsuya_rgb_luminance_f32(rgb), 0.05 * fmax(rgb[0], fmax(rgb[1], rgb[2])));
            e->density[k] = power / omega;
            row += power;
            cdf[x + 1] = row;
        }
        for (int x = 0; x <= e->width; ++x) {
            cdf[x] = row > 0.0 ? cdf[x] / row : (double)x / e->width;
        }
        total += row;
        e->row_cdf[y + 1] = total;
    }
    return total;
}

tsuya_status tsuya_environment_create(tsuya_environment **environment, const tsuya_image *image, tsuya_vec3 direction, tsuya_vec3 up,
                                      const char *name)
{
    tsuya_status status = TSUYA_OK;
    tsuya_environment *e = NULL;
    *environment = NULL;
    if (image->channels < 3 || image->sample != TSUYA_SAMPLE_F32) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: %d channels; an environment is a float image with red, green and blue", name,
                          image->channels);
    }
    size_t pixels = (size_t)image->width_px * (size_t)image->height_px;
    TSUYA_NEW(status, e, 1);
    e->width = image->width_px;
    e->height = image->height_px;
    TSUYA_NEW(status, e->rgb, 3 * pixels);
    TSUYA_NEW(status, e->density, pixels);
    TSUYA_NEW(status, e->row_cdf, (size_t)e->height + 1);
    TSUYA_NEW(status, e->column_cdf, ((size_t)e->width + 1) * (size_t)e->height);
    TSUYA_GOTO_DONE(status, copy_pixels(e, image, name));
    tsuya_vec3 z = tsuya_vec3_unit(up), x = tsuya_vec3_tangent(direction, z), y = tsuya_vec3_cross(x, z);
    e->world_from_map = (tsuya_mat3){{{x.x, y.x, z.x}, {x.y, y.y, z.y}, {x.z, y.z, z.z}}};
    double total = accumulate(e);
    if (!(total > 0.0)) {
        TSUYA_GOTO_DONE(status, tsuya_fail(TSUYA_ERROR_INPUT, "%s: black all over; an environment must send some light", name));
    }
    for (int k = 0; k <= e->height; ++k) {
        e->row_cdf[k] /= total;
    }
    for (size_t k = 0; k < pixels; ++k) {
        e->density[k] /= total;
    }
    e->mean = total / (4.0 * M_PI);
    *environment = e;
    return TSUYA_OK;
done:
    tsuya_environment_free(e);
    return status;
}

void tsuya_environment_free(tsuya_environment *environment)
{
    if (environment) {
        tsuya_free(environment->rgb);
        tsuya_free(environment->density);
        tsuya_free(environment->row_cdf);
        tsuya_free(environment->column_cdf);
        tsuya_free(environment);
    }
}

static size_t pixel_of(const tsuya_environment *e, tsuya_vec3 direction)
{
    tsuya_vec3 d = tsuya_mat3_apply_transposed(e->world_from_map, direction);
    double v = acos(fmin(1.0, fmax(-1.0, d.z))) / M_PI, u = 0.5 + atan2(d.y, d.x) / (2.0 * M_PI);
    int x = (int)fmin(u * e->width, e->width - 1), y = (int)fmin(v * e->height, e->height - 1);
    return (size_t)y * (size_t)e->width + (size_t)x;
}

void tsuya_environment_radiance(const tsuya_environment *environment, tsuya_vec3 direction, double rgb[3])
{
    const float *pixel = environment->rgb + 3 * pixel_of(environment, direction);
    for (int c = 0; c < 3; ++c) {
        rgb[c] = pixel[c];
    }
}

double tsuya_environment_pdf(const tsuya_environment *environment, tsuya_vec3 direction)
{
    return environment->density[pixel_of(environment, direction)];
}

/* The cell of a cumulative table that holds u, and where in it (0 … 1). */
static int find_cell(const double *cdf, int cells, double u, double *inside)
{
    int low = 0, high = cells;
    while (high - low > 1) {
        int middle = (low + high) / 2;
        if (cdf[middle] <= u) {
            low = middle;
        } else {
            high = middle;
        }
    }
    double width = cdf[low + 1] - cdf[low];
    *inside = width > 0.0 ? fmin(1.0, fmax(0.0, (u - cdf[low]) / width)) : 0.5;
    return low;
}

tsuya_vec3 tsuya_environment_sample(const tsuya_environment *e, const double u[2])
{
    double inside_x, inside_y;
    int y = find_cell(e->row_cdf, e->height, u[1], &inside_y);
    int x = find_cell(e->column_cdf + (size_t)y * (size_t)(e->width + 1), e->width, u[0], &inside_x);
    /* uniform in solid angle inside the pixel: linear in cosθ */
    double z = (1.0 - inside_y) * cos(M_PI * y / e->height) + inside_y * cos(M_PI * (y + 1) / e->height);
    double phi = 2.0 * M_PI * ((x + inside_x) / e->width - 0.5), r = sqrt(fmax(0.0, 1.0 - z * z));
    return tsuya_mat3_apply(e->world_from_map, (tsuya_vec3){r * cos(phi), r * sin(phi), z});
}

double tsuya_environment_mean(const tsuya_environment *environment)
{
    return environment->mean;
}

const void *tsuya_environment_bytes(const tsuya_environment *environment, size_t *bytes)
{
    *bytes = 3 * (size_t)environment->width * (size_t)environment->height * sizeof *environment->rgb;
    return environment->rgb;
}
