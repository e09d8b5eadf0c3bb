/* The paper's pictures of a material and of readings, on a bench whose lamp and camera stand still:
 *   figure 8, the reflected intensity f·cosθi (1/sr) against the stage's tilt, a curve an azimuth;
 *   figure 9, the same as a surface over the plane of the half vector;
 *   figure 10, the same as polar diagrams, one an azimuth.
 * Lines and surfaces are the material's, points are measured. */
#ifndef TSUYA_APP_BRDF_PLOT_H
#define TSUYA_APP_BRDF_PLOT_H

#include "brdf/material.h"
#include "brdf/samples.h"

typedef struct tsuya_plot_bench {
    double light_deg[2], view_deg[2]; /* polar angle and azimuth in the lab */
} tsuya_plot_bench;

typedef struct tsuya_brdf_picture {
    const tsuya_material *material; /* NULL: none */
    const tsuya_samples *samples;   /* NULL: none */
    tsuya_plot_bench bench;
    const char *channel;            /* of both; NULL: g, or the middle one */
    const char *title;
    double scale, body;             /* drawn of the material: scale · f + body/π */
} tsuya_brdf_picture;

/* Lamp 30, 0 and camera 30, 180. */
tsuya_plot_bench tsuya_plot_bench_default(void);
/* The bench of a goniometer's table, from its first row; false for tables of directions. */
bool tsuya_plot_bench_of(tsuya_plot_bench *bench, const tsuya_samples *samples);

enum { TSUYA_PLOT_AZIMUTHS = 8 };

/* A reading as the bench's stage would have made it. */
typedef struct tsuya_plot_point {
    double azimuth_deg, tilt_deg, intensity; /* azimuth in [0, 180) */
} tsuya_plot_point;

/* What a picture is made of; tsuya_plot_data_free. */
typedef struct tsuya_plot_data {
    int count, left_out;     /* points; usable samples that no position of the bench would have made (beyond 2°) */
    tsuya_plot_point *point;
    int azimuths;            /* of the curves: those of the points (at most eight, spread evenly), else 0 45 90 135 */
    double azimuth_deg[TSUYA_PLOT_AZIMUTHS];
    double tilt_deg[2];      /* range */
    int material_channel, sample_channel; /* −1: none of that name */
    const char *channel;
} tsuya_plot_data;
/* Fails when neither has the channel. */
TSUYA_MUST_CHECK tsuya_status tsuya_plot_data_create(tsuya_plot_data *data, const tsuya_brdf_picture *picture);
void tsuya_plot_data_free(tsuya_plot_data *data);

TSUYA_MUST_CHECK tsuya_status tsuya_plot_curves(const char *path, const tsuya_brdf_picture *picture, const tsuya_plot_data *data);
TSUYA_MUST_CHECK tsuya_status tsuya_plot_surface(const char *path, const tsuya_brdf_picture *picture, const tsuya_plot_data *data);
TSUYA_MUST_CHECK tsuya_status tsuya_plot_polar(const char *path, const tsuya_brdf_picture *picture, const tsuya_plot_data *data);
/* Figure 6 beside figure 8: a predicted material at the picture's scale over its body, and the readings. */
TSUYA_MUST_CHECK tsuya_status tsuya_plot_pair(const char *path, const tsuya_brdf_picture *picture, const tsuya_plot_data *data);

/* Errors of several models as bars, one group a model; value[model * series + s], NaN where there is none; and nanoseconds. */
typedef struct tsuya_plot_bars {
    int models, series;
    const char *const *model, *const *name;
    const double *value, *eval_ns;
} tsuya_plot_bars;
TSUYA_MUST_CHECK tsuya_status tsuya_plot_errors(const char *path, const tsuya_plot_bars *bars);

#endif
