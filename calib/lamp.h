/* A lamp from photographs of a matte plate with tags, or of mirror balls on one.
 *
 * Matte plate.  White places of its tags, whose pose the corners give, are a light meter: the linear value at x is
 *
 *     value = gain · white · I · (a · −v̂)^falloff · (n · v̂) / |v|^distance_exponent + ambient,      v = lamp − x
 *
 * (near-field Lambert; the lobe about the main direction a as in Quéau et al. 2018, "LED-based photometric stereo", eq. 9).  `white`
 * is the reflectance over π, each further plate has one of its own; `gain` is a photograph's own exposure, held near 1 as far as
 * photographs agree, with a small gradient across the plate of its own (0.3 %): paper is not quite matte.  The lamp is carried as direction and inverse distance from the readings' middle, so that a lamp far away is no
 * special case.  Levenberg–Marquardt from many places, Cauchy weights on relative residuals.
 *
 * Mirror ball.  A ball of known diameter that lies at a known place on the plate shows the lamp as a highlight where the normal
 * halves the angle between camera and lamp.  Lamp and the balls' true places (within a millimetre of what was measured) are
 * estimated from all highlights.
 *
 * Both.  Highlights beside readings are rows of the same least squares: balls say where the lamp is, white how it shines.
 *
 * World frame: the first plate's.  Values are in the camera's unit: 1 is full scale, so that intensity is what makes `tsuya render`
 * give the photographs' own numbers. */
#ifndef TSUYA_CALIB_LAMP_H
#define TSUYA_CALIB_LAMP_H

#include "calib/color.h"
#include "calib/solve.h"
#include "core/json.h"

enum { TSUYA_LAMP_BALLS = 16, TSUYA_LAMPS_MOST = 4 };

/* One tag's white in one photograph. */
typedef struct tsuya_lamp_reading {
    int photo, plate;
    tsuya_vec3 position_m, normal; /* world */
    tsuya_vec2 place_m;            /* on the plate */
    tsuya_vec2 pixel;
    tsuya_vec2 outline_px[4];      /* the tag's corners */
    double size_px;                /* its shortest edge */
    double radius2;                /* of the pixel, 1 at half the image's diagonal */
    double rgb[3];                 /* linear, exposure divided out */
    double expected[3];            /* by the fit */
    bool outlier;
} tsuya_lamp_reading;

typedef struct tsuya_lamp_readings {
    tsuya_lamp_reading *reading; /* by photograph and tag; owned */
    int count, capacity;
    int photos, plates;
    int clipped, small;          /* tags that were left out: clipped white, cells of fewer than 6 px */
} tsuya_lamp_readings;
TSUYA_API void tsuya_lamp_readings_free(tsuya_lamp_readings *readings);

/* White of the tags that one view of a solve saw.  `color` may be NULL; `exposure` divides the values. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_lamp_read(tsuya_lamp_readings *readings, const tsuya_image *photo, const tsuya_solve *solve, int view,
                                                        tsuya_pose world_from_plate, const tsuya_color *color, double exposure);

typedef struct tsuya_lamp {
    bool far_away;                 /* only the direction is known: rgb is irradiance on a facing surface */
    bool has_intensity;            /* false from balls */
    tsuya_vec3 position_m, to_lamp;/* to_lamp: unit, from the readings' middle */
    double position_cov_m2[9];     /* row by row */
    double distance_m, distance_sigma_m, to_lamp_sigma_deg;
    tsuya_vec3 direction;          /* where it shines to; unit */
    double direction_sigma_deg;    /* infinite where the lobe is round */
    double falloff, falloff_sigma; /* exponent of the lobe: 0 a bare point, 1 an even disk */
    double distance_exponent, distance_exponent_sigma; /* freed in a fit of its own: 2 for a small lamp */
    double rgb[3], rgb_sigma_rel;
    double ambient[3];             /* radiance of white where the lamp does not reach */
    double vignetting;             /* log of what is left in the corners, where no color.json told it */
    double rms;                    /* relative, robust */
    double gain_sigma;             /* scatter of the photographs' exposures, relative */
    double cos_least, cos_most;    /* of the angle about the main direction, over the readings */
    int readings, outliers, photos;
    double rms_px;                 /* balls: of the highlights, per coordinate */
    int highlights;                /* 0 without balls */
} tsuya_lamp;

typedef struct tsuya_lamp_ball { double x_m, y_m, diameter_m; } tsuya_lamp_ball; /* it touches the plate at (x, y) */
typedef struct tsuya_lamp_highlight {
    int ball, photo;
    tsuya_vec2 pixel, residual_px;
    tsuya_pose camera_from_world;
} tsuya_lamp_highlight;
/* Balls and their highlights, as the fits take them; both are borrowed. */
typedef struct tsuya_lamp_balls {
    tsuya_lamp_ball *ball;           /* moved to where they fit */
    tsuya_lamp_highlight *highlight; /* `residual_px` is filled */
    int balls, highlights;
    const tsuya_camera *camera;
} tsuya_lamp_balls;

typedef struct tsuya_lamp_options {
    double reflectance;   /* of the first plate's white */
    bool vignetting_known;
    tsuya_lamp_balls *balls; /* seen beside the plate; NULL: none */
} tsuya_lamp_options;
TSUYA_API tsuya_lamp_options tsuya_lamp_options_default(void);

/* Fills the readings' `expected` and `outlier`, and what tsuya_lamp_ball_fit fills.  Fails with one line where the plate lies alike in
 * all photographs and no ball is there, where it is not lit, or stands in the lamp's plane. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_lamp_fit(tsuya_lamp *lamp, tsuya_lamp_readings *readings, const tsuya_lamp_options *options);

/* The brightest spots within the ball's outline, one for each of the lamps that shine at once (1 to TSUYA_LAMPS_MOST), the largest first; `name`
 * is for messages.  Fails where the ball lies outside the image, where fewer spots stand out, and where more do. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_lamp_ball_find(tsuya_lamp_highlight *highlight, int lamps, const tsuya_image *photo, const char *name,
                                                             const tsuya_camera *camera, tsuya_pose camera_from_world, const tsuya_lamp_ball *ball);
/* Tells which highlight is whose: those of one ball in one photograph come together, `lamps` each, in any order.  They leave lamp by lamp, each in
 * the order that they had: first by the mirrored directions, then by what the lamps' fits expect.  The lamps must stand farther apart, as the
 * balls see them, than one of them moves from ball to ball. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_lamp_balls_sort(tsuya_lamp_balls *balls, int lamps);
/* Moves the balls to where they fit.  Fails on highlights that give a direction only. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_lamp_ball_fit(tsuya_lamp *lamp, tsuya_lamp_balls *balls);

/* What tsuya render reads ("lights": lamps that together shine like this one), and the lamp as it was found. */
TSUYA_API void tsuya_lamp_to_json(tsuya_json *object, const tsuya_lamp *lamp);
/* The same in two parts, for several lamps in one file: lights are added to a list, the lamp becomes an object's members. */
TSUYA_API void tsuya_lamp_add_lights(tsuya_json *list, const tsuya_lamp *lamp);
TSUYA_API void tsuya_lamp_describe(tsuya_json *object, const tsuya_lamp *lamp);

#endif
