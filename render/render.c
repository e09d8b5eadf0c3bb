#include "render/render.h"

#include "core/file.h"

#include "render/film.h"
#include "render/like.h"
#include "render/setup.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* Raised when the pictures of unchanged inputs change. */
static const char stage_version[] = "render 9";

tsuya_render_options tsuya_render_options_default(void)
{
    return (tsuya_render_options){.views = 1, .width_px = 1280, .height_px = 960, .elevation_deg = 15.0, .field_deg = 30.0,
                                  .model_view_count = -1, .gain = {NAN, NAN, NAN}, .vertex_dye_scale = NAN, .spp = 64, .bounces = 4, .detail_px = 0.1, .exposure_ev = NAN};
}

static void like_to_json(tsuya_json *object, const char *key, const tsuya_render_like *like)
{
    if (like->photos == 0) {
        return;
    }
    tsuya_json *group = tsuya_json_set_object(object, key);
    tsuya_json_set_number(group, "photos", like->photos);
    tsuya_json_set_number(group, "psnr_db", like->psnr_db);
    tsuya_json_set_number(group, "ssim", like->ssim);
    tsuya_json *de00 = tsuya_json_set_object(group, "de00");
    tsuya_json_set_number(de00, "mean", like->de00_mean);
    tsuya_json_set_number(de00, "median", like->de00_median);
    tsuya_json_set_number(de00, "p95", like->de00_p95);
    tsuya_json_set_number(group, "compared", like->compared);
}

void tsuya_render_info_to_json(tsuya_json *object, const tsuya_render_info *info)
{
    tsuya_json_set_number(object, "width", info->width_px);
    tsuya_json_set_number(object, "height", info->height_px);
    tsuya_json_set_number(object, "frames", info->frames);
    tsuya_json_set_number(object, "frames_reused", info->frames_reused);
    tsuya_json_set_number(object, "spp", info->spp);
    tsuya_json_set_number(object, "rays", (double)info->rays);
    tsuya_json_set_number(object, "seconds", info->seconds);
    tsuya_json_set_number(object, "mrays_per_s", info->mrays_per_s);
    tsuya_json_set_number(object, "noise", info->noise);
    if (!isnan(info->rmse_vs_reference)) {
        tsuya_json_set_number(object, "rmse_vs_reference", info->rmse_vs_reference);
    }
    tsuya_json_set_number(object, "exposure_ev", info->exposure_ev);
    tsuya_json_set_bool(object, "default_material", info->default_material);
    tsuya_json_set_bool(object, "has_weft", info->has_weft);
    tsuya_json_set_number(object, "triangles", (double)info->triangles);
    tsuya_json_set_number(object, "triangles_rendered", (double)info->triangles_rendered);
    tsuya_json_set_number(object, "peak_mb", info->peak_mb);
    if (info->like.photos + info->like_held_out.photos > 0) {
        tsuya_json *like = tsuya_json_set_object(object, "like");
        like_to_json(like, "hold_out", &info->like_held_out);
        like_to_json(like, "others", &info->like);
    }
}

typedef struct stage {
    tsuya_render_info *info;
    const tsuya_render_options *options;
    const tsuya_context *context;
    tsuya_render_setup setup;
    tsuya_path_options path;
    char *folder, *json_path;
    tsuya_json *document, *old; /* what is written now; what an earlier run left (NULL: nothing) */
    tsuya_json *pictures;       /* array inside document */
    tsuya_hash inputs;          /* all that every picture depends on */
    double exposure_ev, white[3]; /* white: of the lamps on a white card */
    tsuya_mat3 adapt;             /* of the PNGs, where they are adapted */
    int frame;                  /* for progress */
    tsuya_like_sum *like;       /* [0] photographs that the reconstruction used, [1] held out */
} stage;

/* The sequence as one progress bar. */
static void report_progress(void *user, const char *label, double done, double total, const char *detail)
{
    const stage *s = user;
    char text[128];
    snprintf(text, sizeof text, "picture %d of %d%s%.60s", s->frame + 1, s->setup.frame_count, detail ? ", " : "", detail ? detail : "");
    s->context->progress(s->context->progress_user, label, s->frame + done / total, s->setup.frame_count, text);
}

static tsuya_context inner_context(stage *s)
{
    tsuya_context context = *s->context;
    if (context.progress) {
        context.progress = report_progress;
        context.progress_user = s;
    }
    return context;
}

/* --- stamps --- */

static void hash_numbers(tsuya_hasher *hasher, const double *numbers, int count)
{
    tsuya_hasher_add(hasher, numbers, (size_t)count * sizeof *numbers);
}

static void hash_vec3(tsuya_hasher *hasher, tsuya_vec3 v)
{
    hash_numbers(hasher, (const double[3]){v.x, v.y, v.z}, 3);
}

static tsuya_status hash_material(tsuya_hasher *hasher, const tsuya_material *material)
{
    tsuya_json *root;
    char *text = NULL;
    TSUYA_TRY(tsuya_material_to_json(&root, material));
    tsuya_status status = tsuya_json_print(&text, root);
    if (status == TSUYA_OK) {
        tsuya_hasher_add_text(hasher, text);
    }
    tsuya_free(text);
    tsuya_json_free(root);
    return status;
}

static void hash_lights(tsuya_hasher *hasher, const tsuya_light_set *set)
{
    for (int k = 0; k < set->count; ++k) {
        const tsuya_light *l = &set->light[k];
        size_t bytes = 0;
        const void *map = l->map ? tsuya_environment_bytes(l->map, &bytes) : NULL;
        hash_numbers(hasher, (const double[2]){l->kind, (double)bytes}, 2);
        hash_vec3(hasher, l->position_m);
        hash_vec3(hasher, l->direction);
        hash_vec3(hasher, l->up);
        hash_numbers(hasher, l->size_m, 2);
        hash_numbers(hasher, l->cone_rad, 2);
        hash_numbers(hasher, l->rgb, 3);
        if (l->spectrum) {
            hash_numbers(hasher, l->spectrum->power, TSUYA_SPECTRUM_COUNT);
        }
        if (map) {
            tsuya_hasher_add(hasher, map, bytes);
        }
    }
}

static tsuya_status hash_inputs(stage *s)
{
    tsuya_hasher *hasher;
    TSUYA_TRY(tsuya_hasher_create(&hasher));
    tsuya_hasher_add_text(hasher, stage_version);
    tsuya_status status = tsuya_hasher_add_file(hasher, s->options->mesh_path);
    for (int k = 0; status == TSUYA_OK && k < s->setup.material_count; ++k) {
        status = hash_material(hasher, s->setup.material[k]);
    }
    hash_lights(hasher, &s->setup.lights);
    hash_numbers(hasher, (const double[]){s->setup.dye, s->setup.studio, s->path.spp, s->path.noise, s->path.bounces, s->setup.vertex_dye_scale, s->options->without_weft, s->options->detail_px}, 8);
    hash_numbers(hasher, s->setup.dye_rgb, 3);
    if (s->setup.dye_of_bands) {
        hash_numbers(hasher, s->setup.dye_of_bands, s->setup.bands->count);
    }
    hash_numbers(hasher, (const double[]){s->options->adapt_to_lamps}, 1);
    hash_numbers(hasher, s->options->transmission, 3);
    hash_numbers(hasher, (const double[]){s->setup.preset}, 1);
    hash_vec3(hasher, s->setup.up);
    /* which triangles were left out depends on all pictures of the run */
    hash_numbers(hasher, (const double[]){(double)s->setup.coarse.triangle_count}, 1);
    tsuya_hasher_add(hasher, s->setup.coarse.triangle, 3 * s->setup.coarse.triangle_count * sizeof *s->setup.coarse.triangle);
    tsuya_hasher_add(hasher, s->setup.coarse.position, 3 * s->setup.coarse.vertex_count * sizeof *s->setup.coarse.position);
    for (int k = 0; k < s->setup.material_count; ++k) { /* and so does what stands for a material */
        tsuya_hasher_add_text(hasher, s->setup.choice[k].model);
    }
    tsuya_hasher_add(hasher, &s->context->seed, sizeof s->context->seed);
    s->inputs = tsuya_hasher_end(hasher);
    return status;
}

static tsuya_status frame_stamp(tsuya_hash *stamp, const stage *s, const tsuya_render_frame *f)
{
    tsuya_hasher *hasher;
    TSUYA_TRY(tsuya_hasher_create(&hasher));
    const tsuya_camera *c = &f->camera;
    tsuya_hasher_add_text(hasher, s->inputs.hex);
    hash_numbers(hasher, (const double[]){c->lens, c->width_px, c->height_px, c->fx_px, c->fy_px, c->cx_px, c->cy_px, s->exposure_ev}, 8);
    hash_numbers(hasher, c->distortion, 12);
    if (c->lens == TSUYA_LENS_SPLINED_STEREOGRAPHIC) {
        hash_numbers(hasher, (const double[]){c->spline.nx, c->spline.ny, c->spline.fov_x_deg}, 3);
        hash_numbers(hasher, c->spline.point, 2 * c->spline.nx * c->spline.ny);
    }
    hash_numbers(hasher, &f->camera_from_world.rotation.e[0][0], 9);
    hash_vec3(hasher, f->camera_from_world.translation);
    hash_numbers(hasher, (const double[]){s->setup.preset == TSUYA_PRESET_TORCH ? f->index : 0}, 1);
    *stamp = tsuya_hasher_end(hasher);
    return TSUYA_OK;
}

/* --- pictures --- */

static tsuya_status render_frame(stage *s, const tsuya_render_frame *f, const tsuya_camera *camera, const tsuya_path_options *path,
                                 tsuya_film *film, tsuya_path_info *info, const tsuya_context *context)
{
    tsuya_light_set lights;
    TSUYA_TRY(tsuya_render_setup_lights(&lights, &s->setup, f));
    tsuya_status status = tsuya_path_render(film, info, s->setup.scene, &lights, camera, f->camera_from_world, path, context);
    tsuya_render_setup_lights_free(&lights, &s->setup);
    return status;
}

static tsuya_status render_card(stage *s, const tsuya_render_frame *f, const tsuya_shader *white)
{
    int width = f->camera.width_px < 160 ? f->camera.width_px : 160;
    int height = (int)fmax(1.0, round((double)width * f->camera.height_px / f->camera.width_px));
    tsuya_camera small = tsuya_camera_scaled(&f->camera, width, height);
    tsuya_path_options path = s->path;
    tsuya_context context = *s->context;
    tsuya_film film;
    tsuya_path_info info;
    path.spp = 16;
    path.noise = 0.0;
    path.bounces = 1;
    path.card = white;
    context.progress = NULL;
    TSUYA_TRY(render_frame(s, f, &small, &path, &film, &info, &context));
    tsuya_status status = tsuya_film_card_exposure(&s->exposure_ev, s->white, &film);
    s->adapt = tsuya_film_adaptation(s->white);
    if (!s->options->adapt_to_lamps) { /* of a coloured white, the strongest channel is what clips */
        s->exposure_ev -= log2(fmax(1.0, fmax(s->white[0], fmax(s->white[1], s->white[2]))));
    }
    tsuya_film_free(&film);
    return status;
}

/* Fixed before the first picture, so that the sequence does not flicker. */
static tsuya_status choose_exposure(stage *s)
{
    const double one[3] = {1.0, 1.0, 1.0};
    tsuya_material *card = NULL;
    tsuya_shader white;
    s->exposure_ev = s->options->exposure_ev;
    if (!isnan(s->exposure_ev) && !s->options->adapt_to_lamps) {
        return TSUYA_OK;
    }
    tsuya_status status;
    TSUYA_GOTO_DONE(status, tsuya_material_lambert(&card, one));
    TSUYA_GOTO_DONE(status, tsuya_shader_from_material(&white, card));
    TSUYA_GOTO_DONE(status, render_card(s, &s->setup.frame[0], &white));
    s->exposure_ev = isnan(s->options->exposure_ev) ? s->exposure_ev : s->options->exposure_ev;
done:
    tsuya_material_free(card);
    return status;
}

static tsuya_status frame_path(char **path, const stage *s, const tsuya_render_frame *f, const char *extension)
{
    char name[512];
    snprintf(name, sizeof name, "%.400s%s", f->name, extension);
    *path = tsuya_path_join(s->folder, name);
    return *path ? TSUYA_OK : TSUYA_ERROR_MEMORY;
}

/* The record of an earlier run for this picture, if it still holds. */
static const tsuya_json *find_finished(const stage *s, const tsuya_render_frame *f, tsuya_hash stamp, const char *exr, const char *png)
{
    const tsuya_json *array = s->old ? tsuya_json_member(s->old, "pictures") : NULL;
    for (const tsuya_json *item = tsuya_json_first(array); item; item = tsuya_json_next(item)) {
        if (strcmp(tsuya_json_text_or(tsuya_json_member(item, "name"), ""), f->name) == 0 &&
            strcmp(tsuya_json_text_or(tsuya_json_member(item, "stamp"), ""), stamp.hex) == 0 && tsuya_path_exists(exr) &&
            tsuya_path_exists(png)) {
            return item;
        }
    }
    return NULL;
}

static tsuya_status save_film(const stage *s, const tsuya_render_frame *f, const tsuya_film *film, const tsuya_path_info *info,
                              const char *exr, const char *png)
{
    char seed[32], samples[32], bounces[32], camera[256];
    const tsuya_camera *c = &f->camera;
    snprintf(seed, sizeof seed, "%llu", (unsigned long long)s->context->seed);
    snprintf(samples, sizeof samples, "%.6g", info->spp_mean);
    snprintf(bounces, sizeof bounces, "%d", s->path.bounces);
    snprintf(camera, sizeof camera, "%.120s; fx %.6f fy %.6f cx %.6f cy %.6f", f->source, c->fx_px, c->fy_px, c->cx_px, c->cy_px);
    char wavelengths[32], detail[160], model[128];
    const tsuya_material_info first = tsuya_material_get_info(s->setup.material[0]);
    snprintf(model, sizeof model, "%.60s; rendered as %.20s (off by %.3g)", first.name, s->setup.choice[0].model, s->setup.choice[0].error);
    const tsuya_detail_info *d = &s->setup.detail;
    snprintf(detail, sizeof detail, "%zu of %zu triangles; vertices off by up to %.3f px, normals %.2f, weft %.2f degrees, colour %.1f of 255", d->triangles_after,
             d->triangles_before, d->distance_px, d->normal_deg, d->weft_deg, d->color);
    snprintf(wavelengths, sizeof wavelengths, "%d", s->setup.bands ? s->setup.bands->count : 0);
    tsuya_film_note note = {.count = s->setup.bands ? 10 : 8,
                            .name = {"software", "camera", "model", "seed", "samples", "bounces", "colorSpace", "detail", "wavelengths", "adaptation"},
                            .value = {"tsuya " TSUYA_VERSION, camera, model, seed, samples,
                                      bounces, "linear Rec.709", detail, wavelengths, "none (D65)"}};
    TSUYA_TRY(tsuya_film_save_exr(film, exr, &note));
    return tsuya_film_save_png(film, png, s->exposure_ev, s->options->adapt_to_lamps ? &s->adapt : NULL);
}

static tsuya_json *record_frame(stage *s, const tsuya_render_frame *f, tsuya_hash stamp, const tsuya_path_info *info)
{
    tsuya_json *record = tsuya_json_add_object(s->pictures);
    tsuya_json_set_text(record, "name", f->name);
    tsuya_json_set_text(record, "camera", f->source);
    tsuya_json_set_text(record, "stamp", stamp.hex);
    tsuya_json_set_number(record, "width", f->camera.width_px);
    tsuya_json_set_number(record, "height", f->camera.height_px);
    tsuya_json_set_number(record, "spp", info->spp_mean);
    tsuya_json_set_number(record, "rays", (double)info->rays);
    tsuya_json_set_number(record, "trace_seconds", info->seconds);
    tsuya_json_set_number(record, "noise", info->noise_median);
    return record;
}

static void take_record(tsuya_path_info *info, const tsuya_json *record)
{
    *info = (tsuya_path_info){
        .seconds = tsuya_json_number_or(tsuya_json_member(record, "trace_seconds"), 0.0),
        .spp_mean = tsuya_json_number_or(tsuya_json_member(record, "spp"), 0.0),
        .rays = (uint64_t)fmax(0.0, tsuya_json_number_or(tsuya_json_member(record, "rays"), 0.0)),
        .noise_median = tsuya_json_number_or(tsuya_json_member(record, "noise"), 0.0),
    };
}

static void add_figures(stage *s, const tsuya_path_info *frame)
{
    tsuya_render_info *info = s->info;
    info->spp += (frame->spp_mean - info->spp) / (s->frame + 1);
    info->rays += frame->rays;
    info->trace_seconds += frame->seconds;
    info->noise = fmax(info->noise, frame->noise_median);
    info->mrays_per_s = info->trace_seconds > 0.0 ? (double)info->rays / info->trace_seconds * 1e-6 : 0.0;
}

static tsuya_status save_document(stage *s, double start)
{
    s->info->seconds = tsuya_clock_s() - start;
    s->info->peak_mb = tsuya_peak_memory_mb();
    tsuya_render_info_to_json(s->document, s->info);
    return tsuya_json_save(s->document, s->json_path);
}

/* Cheap beside the tracing, so done again for pictures of an earlier run too. */
static tsuya_status compare_frame(stage *s, const tsuya_render_frame *f, tsuya_json *record, const char *exr)
{
    char *picture;
    TSUYA_TRY(frame_path(&picture, s, f, ".compare.png"));
    tsuya_status status = tsuya_like_compare(&s->like[f->held_out], record, f, s->options->gain, exr, picture, s->context);
    tsuya_free(picture);
    s->info->like = tsuya_like_mean(&s->like[0]);
    s->info->like_held_out = tsuya_like_mean(&s->like[1]);
    return status;
}

static tsuya_status do_frame(stage *s, const tsuya_render_frame *f, const char *exr, const char *png)
{
    tsuya_hash stamp;
    tsuya_path_info info;
    tsuya_film film;
    TSUYA_TRY(frame_stamp(&stamp, s, f));
    const tsuya_json *finished = find_finished(s, f, stamp, exr, png);
    bool compared = s->frame == 0 && s->options->reference_path;
    if (finished && !compared) {
        take_record(&info, finished);
        s->info->frames_reused++;
    } else {
        tsuya_context context = inner_context(s);
        TSUYA_TRY(render_frame(s, f, &f->camera, &s->path, &film, &info, &context));
        tsuya_status status = save_film(s, f, &film, &info, exr, png);
        if (status == TSUYA_OK && compared) {
            status = tsuya_film_rmse(&s->info->rmse_vs_reference, &film, s->options->reference_path);
        }
        tsuya_film_free(&film);
        TSUYA_TRY(status);
    }
    tsuya_json *record = record_frame(s, f, stamp, &info);
    add_figures(s, &info);
    return f->photo ? compare_frame(s, f, record, exr) : TSUYA_OK;
}

static tsuya_status render_sequence(stage *s, double start)
{
    for (s->frame = 0; s->frame < s->setup.frame_count; ++s->frame) {
        const tsuya_render_frame *f = &s->setup.frame[s->frame];
        char *exr = NULL, *png = NULL;
        tsuya_status status = frame_path(&exr, s, f, ".exr");
        if (status == TSUYA_OK) {
            status = frame_path(&png, s, f, ".png");
        }
        if (status == TSUYA_OK) {
            status = do_frame(s, f, exr, png);
        }
        tsuya_free(exr);
        tsuya_free(png);
        TSUYA_TRY(status);
        TSUYA_TRY(save_document(s, start));
    }
    return TSUYA_OK;
}

static void describe_bands(stage *s)
{
    const tsuya_bands *b = s->setup.bands;
    if (b) {
        tsuya_json *spectral = tsuya_json_set_object(s->document, "spectral");
        tsuya_json_set_number(spectral, "wavelengths", b->count);
        tsuya_json_set_numbers(spectral, "range_nm", (const double[]){b->nm[0], b->nm[b->count - 1]}, 2);
        tsuya_json_set_text(spectral, "observer", "CIE 1931 2° (fit of 2013), no adaptation in the EXR");
    }
}

/* What was left out, and by how much a vertex is off at most. */
static void describe_detail(stage *s)
{
    const tsuya_detail_info *d = &s->setup.detail;
    tsuya_json *detail = tsuya_json_set_object(s->document, "detail");
    tsuya_json_set_number(detail, "asked_px", s->options->detail_px);
    tsuya_json_set_number(detail, "distance_px", d->distance_px);
    tsuya_json_set_number(detail, "normal_deg", d->normal_deg);
    tsuya_json_set_number(detail, "weft_deg", d->weft_deg);
    tsuya_json_set_number(detail, "color_of_255", d->color);
}

/* The model that the pictures were rendered with, and what cheaper ones are off by. */
static void describe_choice(tsuya_json *material, const tsuya_reflectance_choice *choice, double tolerance)
{
    tsuya_json *entry = tsuya_json_set_object(material, "rendered_as");
    tsuya_json_set_text(entry, "model", choice->model);
    tsuya_json_set_number(entry, "tolerance", tolerance);
    tsuya_json_set_number(entry, "error", choice->error);
    tsuya_json_set_number(entry, "pixels", choice->pixels);
    tsuya_json *tried = tsuya_json_set_array(entry, "tried");
    for (int k = 0; k < choice->tried; ++k) {
        tsuya_json *one = tsuya_json_add_object(tried);
        tsuya_json_set_text(one, "model", choice->candidate[k]);
        tsuya_json_set_number(one, "error", choice->candidate_error[k]);
    }
}

static void describe(stage *s)
{
    static const char *const dye_name[] = {"material", "vertex colours", "colour"};
    tsuya_json *materials = tsuya_json_set_array(s->document, "materials");
    for (int k = 0; k < s->setup.material_count; ++k) {
        tsuya_material_info m = tsuya_material_get_info(s->setup.material[k]);
        tsuya_json *entry = tsuya_json_add_object(materials);
        tsuya_json_set_text(entry, "name", m.name);
        tsuya_json_set_text(entry, "model", m.model);
        tsuya_json_set_bool(entry, "default", m.is_default);
        tsuya_json_set_text(entry, "note", m.note);
        describe_choice(entry, &s->setup.choice[k], s->options->tolerance);
    }
    tsuya_json_set_text(s->document, "mesh", s->options->mesh_path);
    tsuya_json_set_text(s->document, "lights", s->setup.studio ? "studio standing with the camera" : s->options->lights_path);
    tsuya_json_set_text(s->document, "dye", dye_name[s->setup.dye]);
    tsuya_json_set_text(s->document, "color", s->options->color);
    tsuya_json_set_number(s->document, "seed", (double)s->context->seed);
    tsuya_json_set_number(s->document, "bounces", s->path.bounces);
    tsuya_json *view = tsuya_json_set_object(s->document, "view_transform");
    tsuya_json_set_number(view, "exposure_ev", s->exposure_ev);
    tsuya_json_set_text(view, "exposure", isnan(s->options->exposure_ev)
                                              ? "the median of a white card in the place of the cloth, lit by the lamps alone, is display white in its strongest channel"
                                              : "given");
    tsuya_json_set_text(view, "curve", "linear × 2^exposure_ev, clipped to [0, 1], sRGB");
    tsuya_json_set_text(view, "adaptation", s->options->adapt_to_lamps ? "Bradford, from the white card's mean colour to D65" : "none");
    if (s->options->adapt_to_lamps) {
        tsuya_json_set_numbers(view, "white", s->white, 3);
    }
    describe_bands(s);
    describe_detail(s);
    s->pictures = tsuya_json_set_array(s->document, "pictures");
}

static tsuya_status open_folder(stage *s)
{
    const tsuya_render_options *o = s->options;
    s->folder = o->name ? tsuya_path_join(o->output_folder, o->name) : tsuya_strdup(o->output_folder);
    s->json_path = s->folder ? tsuya_path_join(s->folder, "render.json") : NULL;
    if (!s->json_path) {
        return TSUYA_ERROR_MEMORY;
    }
    TSUYA_TRY(tsuya_folder_make(s->folder));
    if (tsuya_path_exists(s->json_path) && tsuya_json_load(&s->old, s->json_path) != TSUYA_OK) {
        tsuya_warn("%s; its pictures are rendered again", tsuya_reason());
        s->old = NULL;
    }
    s->document = tsuya_json_create_object();
    return s->document ? TSUYA_OK : TSUYA_ERROR_MEMORY;
}

tsuya_status tsuya_render(tsuya_render_info *info, const tsuya_render_options *options, const tsuya_context *context)
{
    double start = tsuya_clock_s();
    tsuya_status status = TSUYA_OK;
    stage s = {.info = info, .options = options, .context = context, .path = tsuya_path_options_default()};
    *info = (tsuya_render_info){.rmse_vs_reference = NAN};
    s.path.spp = options->spp;
    s.path.noise = options->noise;
    s.path.bounces = options->bounces;
    TSUYA_NEW(status, s.like, 2);
    TSUYA_GOTO_DONE(status, open_folder(&s));
    TSUYA_GOTO_DONE(status, tsuya_render_setup_create(&s.setup, options, context));
    s.setup.seed = context->seed;
    info->frames = s.setup.frame_count;
    info->width_px = s.setup.frame[0].camera.width_px;
    info->height_px = s.setup.frame[0].camera.height_px;
    info->default_material = s.setup.default_material;
    info->has_weft = s.setup.mesh.weft != NULL;
    info->triangles = s.setup.detail.triangles_before;
    info->triangles_rendered = s.setup.detail.triangles_after;
    TSUYA_GOTO_DONE(status, hash_inputs(&s));
    TSUYA_GOTO_DONE(status, choose_exposure(&s));
    info->exposure_ev = s.exposure_ev;
    describe(&s);
    TSUYA_GOTO_DONE(status, render_sequence(&s, start));
done:
    tsuya_render_setup_free(&s.setup);
    tsuya_json_free(s.document);
    tsuya_json_free(s.old);
    tsuya_free(s.like);
    tsuya_free(s.folder);
    tsuya_free(s.json_path);
    return status;
}
