/* The stage `render`: pictures of a mesh with its weft and materials, under lamps, through cameras. */
#ifndef TSUYA_RENDER_RENDER_H
#define TSUYA_RENDER_RENDER_H

#include "core/camera.h"
#include "core/context.h"
#include "core/geometry.h"
#include "core/json.h"

typedef struct tsuya_render_options {
    const char *mesh_path;           /* weave.ply or mesh.ply */
    bool without_weft;               /* the mesh's weft is no finding: reflectances are averaged over the azimuth */
    const char *const *material_path; /* by the mesh's material index; a single one serves every index */
    int material_count;              /* 0: the built-in silk, which is said in a warning and in render.json */
    const char *lights_path;         /* a file, "daylight" or "torch" (render/preset.h); NULL: a soft studio that stands with the camera */
    int views;                       /* of the turntable, where no camera is given */
    int width_px, height_px;         /* of the turntable's pictures; capture cameras bring their own size */
    double elevation_deg, field_deg; /* of the turntable's camera: height over the table's plane, narrower angle of view */
    tsuya_vec3 up;                   /* axis of the turntable; zero: +z */
    const char *const *camera_path;  /* mrcal .cameramodel files, extrinsics are the pose */
    int camera_count;
    /* Further cameras, from a reconstruction: one picture each, named after the photograph; may be NULL. */
    const tsuya_sparse_model *model;
    const int *model_view;           /* indices into the model's views */
    int model_view_count;            /* −1: every view */
    int longest_side_px;             /* pictures of these cameras are made smaller to fit; 0: full size */
    /* Photographs to hold the pictures against, by picture (cameras first, then the model's views): all arrays NULL, or one
     * entry a picture; see render/compare.h.  An entry without a photograph is not compared. */
    const char *const *photo_path, *const *mask_path;
    const bool *held_out;            /* figures of these apart; NULL: none is */
    double gain[3];                  /* exposure and white balance of the comparison; NaN: fitted to each photograph */
    const char *color;               /* see tsuya_render_check_color; NULL: see below */
    double vertex_dye_scale;         /* factor on the mesh's colours where they are the dye; NaN: 0.8, for colours that are not dyes */
    double transmission[3];          /* share of the light that thin cloth lets through, diffusely; 0 0 0: none */
    int spp;                         /* samples per pixel; with `noise` the most that a pixel gets */
    double noise;                    /* > 0: relative standard error that a pixel aims at; see render/path.h */
    int bounces;                     /* reflections along a path; 1: lamps only */
    double detail_px;                /* triangles smaller than half a pixel may be left out as far as no vertex is off by more than this, see render/detail.h; 0: never */
    double tolerance;                /* > 0: the cheapest reflectance model that at the size of a pixel is off by no more, see render/reflectance.h; 0: the materials' own */
    double exposure_ev;              /* of the PNGs; NaN: from a white card in the first picture, see render/film.h; of a coloured white, unless adapted to, the strongest channel reaches display white */
    bool adapt_to_lamps;             /* PNGs as an eye sees them that has adapted to the lamps' white; false: to D65 */
    const char *reference_path;      /* linear EXR to compare the first picture with; NULL: none */
    const char *output_folder;       /* JOB/render */
    const char *name;                /* subfolder; NULL: output_folder itself */
} tsuya_render_options;

/* 1 view of 1280 × 960 at 15° elevation and 30° field, 64 spp, 4 bounces, detail within 0.1 px, automatic exposure. */
TSUYA_API tsuya_render_options tsuya_render_options_default(void);

/* Means over photographs; ΔE00 over all their pixels together. */
typedef struct tsuya_render_like {
    int photos;
    double psnr_db, ssim, de00_mean, de00_median, de00_p95;
    double compared; /* share of the mask that could be compared */
} tsuya_render_like;

typedef struct tsuya_render_info {
    int width_px, height_px, frames, frames_reused;
    double spp;             /* mean over all pixels of the frames rendered */
    uint64_t rays;
    double seconds;         /* whole stage */
    double trace_seconds;   /* inside the path tracer */
    double mrays_per_s;     /* rays over trace_seconds */
    double noise;           /* median relative standard error of pixels on the cloth, worst frame */
    double rmse_vs_reference; /* NaN without a reference */
    double exposure_ev, peak_mb;
    bool default_material, has_weft;
    size_t triangles, triangles_rendered; /* the latter without those that no picture shows, see detail_px */
    tsuya_render_like like, like_held_out; /* photos 0 where nothing was compared */
} tsuya_render_info;

/* Writes OUTPUT/NAME/frame_000.{png,exr} … and render.json, whose "pictures" record a stamp of everything that a picture
 * depends on: a picture whose stamp is unchanged and whose files are there is passed over, so that an interrupted
 * sequence goes on where it stopped.  Beside a photograph also FRAME.compare.png, and "like" in the picture's record.
 *
 * Colour: `color` becomes the dye under the measured surface part.  "photographs": the mesh's vertex colours do, and so they do
 * without `color` where the mesh has some.  "material": what was measured stays.
 *
 * Where a material's channels are wavelengths the picture is rendered at all of them (render/bands.h); colours are then what the
 * 2° observer sees, as linear Rec.709, without adaptation: a white lit by D65 is 1, 1, 1, one lit by halogen is orange.
 *
 * Fails on unreadable inputs (named), NaN vertices (index named), a mesh without vertices, materials whose channels are neither
 * r, g, b nor wavelengths from 430 to 670 nm. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_render(tsuya_render_info *info, const tsuya_render_options *options,
                                                     const tsuya_context *context);
TSUYA_API void tsuya_render_info_to_json(tsuya_json *object, const tsuya_render_info *info);

/* What `color` may be: "photographs", "material", or a colour. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_render_check_color(const char *text);
/* What `lights_path` may be: the name of a preset, or a file of lamps or with a preset. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_render_check_lights(const char *path);
/* A colour as a linear Rec.709 reflectance: a name of CSS, "#7a1f2b" (sRGB), "r,g,b" (linear reflectances in [0, 1]), "lab(L,a,b)"
 * (CIELAB under D65) or a file NAME.csv with the columns nm,reflectance (seen under D65).  Fails on colours outside the gamut. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_render_parse_color(double rgb[3], const char *text);

#endif
