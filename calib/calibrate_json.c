#include "calib/calibrate.h"

#include <math.h>

static void set_stats(tsuya_json *object, const char *key, const tsuya_projection_stats *s)
{
    tsuya_json *o = tsuya_json_set_object(object, key);
    tsuya_json_set_number(o, "mean", s->mean);
    tsuya_json_set_number(o, "p90", s->p90);
    tsuya_json_set_number(o, "max", s->max);
}

static void set_uncertainty(tsuya_json *object, const char *key, const tsuya_projection_map *map)
{
    int which;
    tsuya_json *o = tsuya_json_set_object(object, key);
    tsuya_json_set_number(o, "center", tsuya_projection_center(map));
    tsuya_json_set_number(o, "corner", tsuya_projection_corner(&which, map));
}

static void set_plates(tsuya_json *object, const tsuya_calibration *c)
{
    tsuya_json *plates = tsuya_json_set_array(object, "plates");
    for (int i = 0; i < c->plates; i++) {
        const tsuya_calibrate_plate *p = &c->plate[i];
        tsuya_json *o = tsuya_json_add_object(plates);
        tsuya_json_set_text(o, "name", p->name);
        tsuya_json_set_text(o, "reference", p->reference);
        tsuya_json_set_number(o, "angle_deg", p->angle_deg);
        tsuya_json_set_number(o, "distance_m", p->distance_m);
        tsuya_json_set_number(o, "angle_sd_deg", p->angle_sd_deg);
        tsuya_json_set_number(o, "distance_sd_m", p->distance_sd_m);
        tsuya_json_set_number(o, "photos", p->photos);
        tsuya_json_set_bool(o, "rigid", p->rigid);
    }
}

/* How the plates differ from their file. */
static void set_shapes(tsuya_json *object, const tsuya_solve *s)
{
    tsuya_json *shapes = tsuya_json_set_array(object, "plate_shapes");
    for (int p = 0; p < s->board->plate_count; p++) {
        tsuya_json *o = tsuya_json_add_object(shapes);
        tsuya_json_set_text(o, "name", s->board->plate[p].name);
        tsuya_json_set_number(o, "tag_growth", s->shape[p].growth);
        tsuya_json_set_numbers(o, "bend_m", s->shape[p].bend_m, TSUYA_BENDS);
    }
}

static void set_trials(tsuya_json *object, const tsuya_calibration *c)
{
    tsuya_json *lenses = tsuya_json_set_array(object, "lenses");
    for (int i = 0; i < c->trials; i++) {
        const tsuya_calibrate_trial *t = &c->trial[i];
        tsuya_json *o = tsuya_json_add_object(lenses);
        tsuya_json_set_text(o, "model", tsuya_lens_name(t->lens));
        if (t->nx) {
            tsuya_json_set_numbers(o, "control_points", (const double[]){t->nx, t->ny}, 2);
        }
        tsuya_json_set_bool(o, "bent_plates", t->bent);
        tsuya_json_set_number(o, "rms_px", t->rms_px);
        tsuya_json_set_number(o, "heldout_px", t->heldout_px);
        tsuya_json_set_number(o, "heldout_near_px", t->heldout_near_px);
        tsuya_json_set_number(o, "cross_validation_p90_px", t->cross.p90);
    }
}

/* One sigma of where the camera stood against the first plate that the photograph shows: in the worst direction of three. */
static void set_pose_sigma(tsuya_json *object, const tsuya_calibration *c, int photo)
{
    for (int v = 0; v < c->solve.view_count; v++) {
        if (c->solve.view[v].photo != photo) {
            continue;
        }
        double values[2][3];
        for (int part = 0; part < 2; part++) {
            tsuya_mat3 block;
            for (int i = 0; i < 9; i++) {
                block.e[i / 3][i % 3] = c->covariance.pose[(v * 6 + 3 * part + i / 3) * 6 + 3 * part + i % 3];
            }
            tsuya_mat3_eigen_symmetric(block, values[part], &(tsuya_mat3){0});
        }
        tsuya_json_set_number(object, "rotation_sigma_deg", tsuya_deg_from_rad(sqrt(fmax(values[0][2], 0.0))));
        tsuya_json_set_number(object, "position_sigma_m", sqrt(fmax(values[1][2], 0.0)));
        return;
    }
}

/* Every photograph: its corners, how they fit, and how well its pose is known. */
static void set_photos(tsuya_json *object, const tsuya_calibration *c, const tsuya_corner_set *corners)
{
    tsuya_json *photos = tsuya_json_set_array(object, "photographs");
    for (int p = 0; p < corners->photo_count; p++) {
        int used = 0, outliers = 0;
        for (int i = 0; i < c->solve.observation_count; i++) {
            const tsuya_solve_observation *o = &c->solve.observation[i];
            used += c->solve.view[o->view].photo == p;
            outliers += c->solve.view[o->view].photo == p && o->outlier;
        }
        tsuya_json *o = tsuya_json_add_object(photos);
        tsuya_json_set_text(o, "name", corners->photo[p]);
        tsuya_json_set_number(o, "corners", used);
        tsuya_json_set_number(o, "outliers", outliers);
        tsuya_json_set_number(o, "sigma_px", used ? c->solve.photo_sigma_px[p] : NAN);
        set_pose_sigma(o, c, p);
    }
}

/* Control points stand in the camera model; here is how they are laid out. */
static void set_spline(tsuya_json *object, const tsuya_lens_spline *s)
{
    tsuya_json *o = tsuya_json_set_object(object, "spline");
    tsuya_json_set_number(o, "order", 3);
    tsuya_json_set_number(o, "nx", s->nx);
    tsuya_json_set_number(o, "ny", s->ny);
    tsuya_json_set_number(o, "fov_x_deg", s->fov_x_deg);
}

static void set_camera(tsuya_json *object, const tsuya_calibration *c)
{
    const tsuya_camera *k = &c->solve.camera;
    int n = tsuya_lens_parameters(k);
    double sigma[16], focal_sigma, focal = tsuya_projection_focal(&focal_sigma, k, c->covariance.intrinsics);
    tsuya_json_set_number(object, "fx", k->fx_px);
    tsuya_json_set_number(object, "fy", k->fy_px);
    tsuya_json_set_number(object, "cx", k->cx_px);
    tsuya_json_set_number(object, "cy", k->cy_px);
    tsuya_json_set_number(object, "focal_center_px", focal);
    tsuya_json_set_number(object, "focal_center_sigma_px", focal_sigma);
    if (k->lens == TSUYA_LENS_SPLINED_STEREOGRAPHIC) {
        set_spline(object, &k->spline);
    } else {
        tsuya_json_set_numbers(object, "distortion", k->distortion, n - 4);
        for (int i = 0; i < n; i++) {
            sigma[i] = sqrt(c->covariance.intrinsics[i * n + i]);
        }
        tsuya_json_set_numbers(object, "intrinsics_sigma", sigma, n);
    }
    tsuya_json_set_number(object, "width_px", k->width_px);
    tsuya_json_set_number(object, "height_px", k->height_px);
}

void tsuya_calibration_to_json(tsuya_json *object, const tsuya_calibration *c, const tsuya_corner_set *corners)
{
    const tsuya_calibrate_trial *t = &c->trial[c->chosen];
    tsuya_json_set_text(object, "model", tsuya_lens_name(c->solve.camera.lens));
    tsuya_json_set_number(object, "rms_px", c->solve.rms_px);
    tsuya_json_set_number(object, "photos_used", c->photos_used);
    tsuya_json_set_number(object, "photos_total", corners->photo_count);
    tsuya_json_set_number(object, "corners_used", c->solve.observation_count - c->solve.outliers);
    tsuya_json_set_number(object, "corners_outlier", c->solve.outliers);
    set_stats(object, "cross_validation_px", &t->cross);
    set_uncertainty(object, "uncertainty_px", &c->sigma);
    set_stats(object, "cross_validation_px_infinity", &t->cross_infinity);
    set_uncertainty(object, "uncertainty_px_infinity", &c->sigma_infinity);
    tsuya_json *scatter = tsuya_json_set_object(object, "scatter");
    tsuya_json_set_number(scatter, "photographs", c->covariance.photo_factor);
    tsuya_json_set_number(scatter, "tags", c->covariance.tag_factor);
    set_camera(object, c);
    tsuya_json_set_number(object, "distance_m", c->distance_m);
    set_plates(object, c);
    tsuya_json_set_number(object, "edge_bias", c->solve.edge_bias);
    set_shapes(object, &c->solve);
    tsuya_json_set_text(object, "reason", c->reason);
    tsuya_json_set_number(object, "misfit", c->misfit);
    tsuya_json *advice = tsuya_json_set_array(object, "advice");
    for (int i = 0; i < c->advice_count; i++) {
        tsuya_json_add_text(advice, c->advice[i]);
    }
    set_trials(object, c);
    set_photos(object, c, corners);
}
