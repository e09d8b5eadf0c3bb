/* JOB.yaml: what a job is made of (docs/job.md). */
#ifndef TSUYA_APP_JOB_H
#define TSUYA_APP_JOB_H

#include "core/photo.h"
#include "core/yaml.h"

typedef struct tsuya_job_camera {
    const char *board, *photos; /* a board and photographs of it, or */
    const char *model;          /* a ready .cameramodel */
} tsuya_job_camera;

typedef struct tsuya_job_scale {
    const char *board;
    tsuya_yaml_list distances; /* of lists of texts, as written */
} tsuya_job_scale;

typedef struct tsuya_job_material {
    const char *name, *samples, *model;
    const char *where; /* folder of masks named after photographs, or one such mask; NULL: what the others leave */
} tsuya_job_material;

typedef struct tsuya_job_render {
    const char *name, *color, *like;
    const char *lights, *model; /* of this entry alone; NULL: the job's own */
    double elevation_deg, exposure_ev; /* NaN: the stage's own; not of `like` */
    double tolerance; /* of the cheapest model that will do (tsuya_render_options); NaN: each material's own */
    int views; /* 0: through the cameras of `like` */
    tsuya_yaml_list size;
    int width_px, height_px;
} tsuya_job_render;

typedef struct tsuya_job {
    const char *name, *photos, *masks, *poses, *lights, *tolerance;
    double tolerance_units; /* 0: none */
    bool tolerance_in_metres;
    bool has_camera, has_scale;
    tsuya_job_camera camera;
    tsuya_job_scale scale;
    tsuya_yaml_list materials; /* of tsuya_job_material */
    tsuya_yaml_list render;    /* of tsuya_job_render; one turntable of 12 views when the file has none */
    tsuya_yaml_list hold_out;  /* of const char *, file names of photographs */

    const char *path, *source_folder, *folder; /* JOB.yaml, the folder it is in, the job folder */
    tsuya_photo_set photo;                     /* of `photos` */
    tsuya_arena *arena;
} tsuya_job;

/* Reads and validates; paths of the file become paths from the current folder.  `folder`: the job folder, NULL for the
 * file's own.  Fails, naming file, key and value, on unknown keys, missing files, names that are no photograph, photographs
 * that cannot be read or are of mixed size, and on parts of the interface that this version lacks. */
TSUYA_MUST_CHECK tsuya_status tsuya_job_load(tsuya_job *job, const char *path, const char *folder);
void tsuya_job_free(tsuya_job *job);

/* "0.5mm", "1cm", "0.0005m" in metres, or a bare number; above 0. */
bool tsuya_parse_length(double *length, bool *in_metres, const char *text);

/* A path inside the job folder (arena; NULL when memory is short). */
char *tsuya_job_path(const tsuya_job *job, const char *format, ...) TSUYA_PRINTF(2, 3);

/* The mask of a photograph that says where a material is (arena); NULL where there is none. */
TSUYA_MUST_CHECK tsuya_status tsuya_job_region_mask(const char **path, const tsuya_job *job, int material, int photo);

static inline const tsuya_job_material *tsuya_job_material_at(const tsuya_job *job, int i)
{
    return (const tsuya_job_material *)job->materials.item + i;
}
static inline const tsuya_job_render *tsuya_job_render_at(const tsuya_job *job, int i)
{
    return (const tsuya_job_render *)job->render.item + i;
}
static inline const char *tsuya_job_hold_out_at(const tsuya_job *job, int i)
{
    return ((const char *const *)job->hold_out.item)[i];
}
/* A photograph of hold_out. */
bool tsuya_job_holds_out(const tsuya_job *job, const char *name);

#endif
