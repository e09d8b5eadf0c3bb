/* What the sections of the report share. */
#ifndef TSUYA_APP_REPORT_PARTS_H
#define TSUYA_APP_REPORT_PARTS_H

#include "app/html.h"
#include "app/shade.h"
#include "app/report.h"
#include "core/camera.h"
#include "core/mesh.h"

typedef struct tsuya_report {
    tsuya_html html;
    const tsuya_job *job;
    const tsuya_state *state;
    const tsuya_context *context;
    tsuya_sparse_model sparse, dense; /* empty where the job has none yet */
    tsuya_mesh mesh;                  /* weave.ply, else mesh.ply, else empty */
    tsuya_vec3 up, center;            /* of the mesh, else of the sparse points, world frame */
    double radius;
    tsuya_json *demo;                 /* demo.json, or NULL */
} tsuya_report;

extern const char tsuya_report_style[];

/* Sections; each writes nothing where its stage has not run. */
void tsuya_report_summary(tsuya_report *report);
void tsuya_report_warnings(tsuya_report *report);
void tsuya_report_truth(tsuya_report *report);
void tsuya_report_times(tsuya_report *report);
void tsuya_report_capture(tsuya_report *report);
void tsuya_report_cameras(tsuya_report *report);
void tsuya_report_depth(tsuya_report *report);
void tsuya_report_silhouettes(tsuya_report *report);
void tsuya_report_surface(tsuya_report *report);
void tsuya_report_weave(tsuya_report *report);
void tsuya_report_material(tsuya_report *report);
void tsuya_report_renders(tsuya_report *report);
void tsuya_report_versions(tsuya_report *report);

/* Figures of a finished stage, NULL where there is none. */
const tsuya_json *tsuya_report_figures(const tsuya_report *report, const char *stage);
/* Opens <section>; `lead` explains in a sentence or two, may be NULL. */
void tsuya_report_open(tsuya_report *report, const char *id, const char *title, const char *lead);
void tsuya_report_close(tsuya_report *report);
/* Keeps the first failure in the html. */
void tsuya_report_check(tsuya_report *report, tsuya_status status);
/* The mesh from four sides with a number per vertex, drawn from low to high. */
void tsuya_report_values(tsuya_report *report, const float *value, const char *title, double low, double high);
/* At most `limit` indices spread evenly over [0, count). */
int tsuya_report_spread(int *index, int limit, int count);
/* Longest side `side_px`; smaller pictures stay as they are.  8 bits, sRGB. */
TSUYA_MUST_CHECK tsuya_status tsuya_report_reduce(tsuya_image *out, const tsuya_image *in, int side_px);

#endif
