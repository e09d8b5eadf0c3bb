/* Cloth that falls: where a sewn sheet comes to rest under its weight on bodies and on itself.
 *
 * Membrane: orthotropic Saint Venant-Kirchhoff triangles in the yarns' coordinates (u weft, v warp).
 * Bending: the second derivatives of a triangle from the jumps of the gradient over its three edges (rotation-free plate,
 * E. Onate, F. Zarate, IJNME 47, 2000), squared with a rigidity for each yarn direction; quadratic in the positions as in
 * M. Bergou et al., "A Quadratic Bending Model for Inextensible Surfaces", SGP 2006.  Energy per area (Bu κu² + Bv κv² + T τ²) / 2,
 * κu = ∂²z/∂u², τ = ∂²z/∂u∂v: T = Bu + Bv makes equal rigidities an isotropic plate without Poisson's effect.
 * Time: backward Euler as the minimum of an incremental potential, found by Newton steps on positive definite parts with a
 * line search.  Contact and friction: smooth barrier on distances and lagged friction (M. Li et al., "Incremental Potential
 * Contact", SIGGRAPH 2020); steps are cut by additive continuous collision detection (M. Li et al., "Codimensional
 * Incremental Potential Contact", SIGGRAPH 2021), so that a sheet that starts without intersections never gets one.
 *
 * Frame: z up, metres, seconds, kilograms.  Results do not depend on the number of threads. */
#ifndef TSUYA_CAPTURE_DRAPE_H
#define TSUYA_CAPTURE_DRAPE_H

#include "core/context.h"
#include "core/geometry.h"
#include "core/mesh.h"

typedef struct tsuya_drape_fabric {
    double mass_kg_m2;
    double stretch_weft_n_m, stretch_warp_n_m; /* force per width at unit strain */
    double shear_n_m;                          /* force per width at unit shear angle */
    double bend_weft_nm, bend_warp_nm;         /* moment per width at unit curvature of the weft, of the warp */
    double twist_nm;                           /* torsional rigidity of the yarns of both directions, per width: T above */
    double thickness_m;                        /* layers keep about this distance */
    double friction;                           /* Coulomb's coefficient, on itself and on bodies */
} tsuya_drape_fabric;
/* From the units of the KES-F sheets (S. Kawabata, "The Standardization and Analysis of Hand Evaluation", 2nd ed., 1980):
 * W mg/cm², EM % at 500 gf/cm with linearity LT, G gf/(cm·deg), B gf·cm²/cm, T mm, MIU.  Twist over both bending rigidities together,
 * T / (Bu + Bv), is not on the sheets.  A strip cut on the bias tells it (weft, warp and one other direction describe how cloth bends: J. Cooper,
 * "The stiffness of woven textiles", J. Text. Inst. 51, 1960, T317): (Bu + Bv + T) / 4 where it bends to a cylinder, 4 / (1/Bu + 1/Bv + 4/T)
 * where it twists as it likes.
 * Of a hundred fabrics in the table of X. Feng et al., "Learning-Based Bending Stiffness Parameter Estimation by a Drape Tester",
 * SIGGRAPH Asia 2022 (cantilevers along weft, warp and bias), the middle one has 0.91 of (Bu + Bv) / 2 on the bias, a twist of 0.82 by the
 * one and 0.94 by the other; a quarter of them have less than 0.60 of it, 0.19 and 0.52. */
typedef struct tsuya_drape_kes { double w, lt, em_weft, em_warp, g, b_weft, b_warp, t, miu, twist; } tsuya_drape_kes;
TSUYA_API tsuya_drape_fabric tsuya_drape_fabric_from_kes(const tsuya_drape_kes *kes);
/* "karaori", "silk", "cotton", "wool"; false for other names. */
TSUYA_API bool tsuya_drape_fabric_named(tsuya_drape_fabric *fabric, const char *name);

/* Flat pieces sewn together.  Pieces share the vertices of their seams; every corner has its own material coordinates. */
typedef struct tsuya_drape_sheet {
    size_t vertex_count, triangle_count;
    double *position;   /* 3 × vertex_count, where it starts (or lies) */
    uint32_t *triangle; /* 3 × triangle_count */
    double *uv;         /* 6 × triangle_count: u v of each corner, metres in the flat cloth */
    uint8_t *fixed;     /* vertex_count: held in place */
} tsuya_drape_sheet;
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_drape_sheet_create(tsuya_drape_sheet *sheet, size_t vertices, size_t triangles);
TSUYA_API void tsuya_drape_sheet_free(tsuya_drape_sheet *sheet);
/* columns × rows cells in the plane z = 0 from (u0, v0); position = (u, v, 0). */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_drape_sheet_grid(tsuya_drape_sheet *sheet, double u0_m, double v0_m, double spacing_m,
                                                               int columns, int rows);
/* A disc in the plane z = 0 in rings of near-equilateral triangles; held inside `clamp_m` (0: nothing is), which runs
 * midway between two rings: both are held, so that the sheet leaves the plane there. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_drape_sheet_disc(tsuya_drape_sheet *sheet, double radius_m, double clamp_m,
                                                               double spacing_m);
/* A Noh karaori, front and back in one piece that is folded at the shoulders (v = 0; front v > 0), sleeves along ±u, open in front
 * with a neck, its sides not sewn, as it hangs on a rack to be shown: `width_m` from sleeve to sleeve, 2.1 times that from hem to hem. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_drape_sheet_karaori(tsuya_drape_sheet *sheet, double width_m, double spacing_m);
/* A curtain hung up by its heading, which is held: `width_m` from end to end along x in so many pleats, waves to either side of y = 0; the flat
 * cloth is `fullness` times as wide (1.02 to 4, at least 8 cells a pleat), weft along the width.  The heading lies in z = 0, the rest hangs
 * from it. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_drape_sheet_curtain(tsuya_drape_sheet *sheet, double width_m, double drop_m, double fullness,
                                                                  int pleats, double spacing_m);
/* The sheet as a mesh with normals and weft (unit tangents along u), and, where asked for, 3 × vertex_count unit tangents
 * along v (tsuya_free), and 2 × vertex_count material coordinates.  At a seam the weft is the pieces' mean. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_drape_sheet_mesh(tsuya_mesh *mesh, float **warp, float **uv, const tsuya_drape_sheet *sheet);

/* Each triangle into four; the surface stays as it is, or is smoothed by Loop's rules. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_drape_sheet_subdivide(tsuya_drape_sheet *fine, const tsuya_drape_sheet *coarse, bool smooth);

typedef enum tsuya_drape_shape {
    TSUYA_DRAPE_FLOOR, /* below z = a.z */
    TSUYA_DRAPE_BAR,   /* round, from a to b */
    TSUYA_DRAPE_DISC,  /* upright cylinder: top's centre at b, its bottom's at a; rim rounded by round_m */
    TSUYA_DRAPE_BOX,   /* corners a and b (a table), edges rounded by round_m */
    TSUYA_DRAPE_FORM,  /* round cone: radius_m at a, radius_b_m at b */
} tsuya_drape_shape;
typedef struct tsuya_drape_body {
    tsuya_drape_shape shape;
    tsuya_vec3 a, b;
    double radius_m, radius_b_m, round_m;
} tsuya_drape_body;
/* Signed distance, and the unit gradient where asked for. */
TSUYA_API double tsuya_drape_body_distance(const tsuya_drape_body *body, tsuya_vec3 p, tsuya_vec3 *gradient);

typedef struct tsuya_drape_options {
    double gravity_m_s2;
    double step_s, step_most_s; /* the step grows from one to the other as the cloth comes to rest */
    double inertia;             /* share of the velocity that a step keeps; 0: slow creeping down the energy */
    int steps_most, newton_most;
    double rest_m_s;            /* at rest when no vertex moves faster, at the longest step */
    bool self_contact;
} tsuya_drape_options;
TSUYA_API tsuya_drape_options tsuya_drape_options_default(void);

typedef struct tsuya_drape_info {
    int steps, newton_steps, contacts; /* contacts: pairs nearer than the thickness, at the end */
    double energy_j, kinetic_j;        /* stretch, bending, weight, contact; of motion */
    double energy_rise_j;              /* largest rise of their sum in a step: 0 where the way down was monotone */
    double speed_m_s;                  /* of the fastest vertex, in the last step */
    bool at_rest;
} tsuya_drape_info;

/* Called after every step (NULL: never). */
typedef void (*tsuya_drape_watch)(void *user, int step, const double *position, double energy_j);

/* Moves sheet->position to rest.  Fails when the sheet starts through a body or through itself nearer than a tenth of the
 * thickness, and on senseless numbers; a sheet that is still moving after steps_most is no failure (info->at_rest). */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_drape_run(tsuya_drape_info *info, tsuya_drape_sheet *sheet, const tsuya_drape_fabric *fabric,
                                                        const tsuya_drape_body *body, int body_count, const tsuya_drape_options *options,
                                                        tsuya_drape_watch watch, void *watch_user, const tsuya_context *context);

/* The same from coarse to fine: at rest, each triangle into four, to rest again, `levels` times; the sheet grows.  Steps add up; the
 * energy's rise is the largest of all levels.  Fails where a finer sheet would stick in a body or cross itself. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_drape_settle(tsuya_drape_info *info, tsuya_drape_sheet *sheet, const tsuya_drape_fabric *fabric,
                                                           const tsuya_drape_body *body, int body_count, const tsuya_drape_options *options,
                                                           int levels, const tsuya_context *context);

/* Edges of the sheet that pierce a triangle they share no vertex with (brute force behind a grid; for tests). */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_drape_intersections(size_t *count, const tsuya_drape_sheet *sheet);
/* Elastic energy (stretch and bending, J) of a sheet as it stands. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_drape_elastic_energy(double *stretch_j, double *bend_j, const tsuya_drape_sheet *sheet,
                                                                   const tsuya_drape_fabric *fabric);

#endif
