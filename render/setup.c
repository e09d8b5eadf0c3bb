#include "render/setup.h"

#include "core/file.h"
#include "core/json.h"

#include "render/path.h"
#include "render/views.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

/* A triangle costs 0.8 us to be left out or not, and a sample is 0.13 us cheaper without those that went (docs/render.md). */
static const double DETAIL_SAMPLES = 6.0;

static tsuya_status load_materials(tsuya_render_setup *s, const tsuya_render_options *o)
{
    s->material_count = o->material_count > 0 ? o->material_count : 1;
    s->material = tsuya_calloc((size_t)s->material_count, sizeof *s->material);
    if (!s->material) {
        return TSUYA_ERROR_MEMORY;
    }
    if (o->material_count == 0) {
        tsuya_warn("no material was given: the built-in silk is used, which nobody measured");
        s->default_material = true;
        return tsuya_material_default_silk(&s->material[0]);
    }
    for (int k = 0; k < o->material_count; ++k) {
        TSUYA_TRY(tsuya_material_load(&s->material[k], o->material_path[k]));
        s->default_material |= tsuya_material_get_info(s->material[k]).is_default;
    }
    return TSUYA_OK;
}

static bool is_csv(const char *text)
{
    size_t length = strlen(text);
    return length > 4 && strcasecmp(text + length - 4, ".csv") == 0;
}

/* The colour's spectrum: measured, or made up for it. */
static tsuya_status spread_dye(tsuya_render_setup *s, const char *color)
{
    s->dye_of_bands = tsuya_arena_alloc(s->arena, (size_t)s->bands->count, sizeof *s->dye_of_bands);
    if (!s->dye_of_bands) {
        return TSUYA_ERROR_MEMORY;
    }
    tsuya_bands_spread(s->dye_of_bands, s->bands, s->dye_rgb);
    return is_csv(color) ? tsuya_render_load_reflectance(s->dye_of_bands, s->bands->nm, s->bands->count, color) : TSUYA_OK;
}

/* The wavelengths of the first spectral material; all others have the same ones (tsuya_scene_create). */
static tsuya_status find_bands(tsuya_render_setup *s, const tsuya_shader *shader)
{
    for (int k = 0; k < s->material_count && !s->bands; ++k) {
        if (shader[k].spectral) {
            s->bands = tsuya_arena_alloc(s->arena, 1, sizeof *s->bands);
            return s->bands ? tsuya_bands_of_material(s->bands, s->material[k]) : TSUYA_ERROR_MEMORY;
        }
    }
    return TSUYA_OK;
}

static tsuya_status set_dye(tsuya_render_setup *s, const tsuya_shader *shader, int k)
{
    double dye[TSUYA_MATERIAL_MAX_CHANNELS];
    if (s->dye == TSUYA_DYE_OF_MATERIAL) {
        return TSUYA_OK;
    }
    if (!shader[k].spectral || !tsuya_bands_match(s->bands, s->material[k])) {
        return shader[k].spectral ? TSUYA_OK : tsuya_material_set_dye(s->material[k], s->dye_rgb);
    }
    tsuya_bands_spread(dye, s->bands, s->dye_rgb);
    return tsuya_material_set_channel_dye(s->material[k], s->dye_of_bands ? s->dye_of_bands : dye);
}

static tsuya_status choose_dye(tsuya_render_setup *s, const tsuya_render_options *o)
{
    bool photographs = o->color && strcmp(o->color, "photographs") == 0, material = o->color && strcmp(o->color, "material") == 0;
    if (photographs && !s->mesh.color) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: no vertex colours; \"photographs\" needs a mesh that was coloured from them", o->mesh_path);
    }
    if (o->color && !photographs && !material) {
        s->dye = TSUYA_DYE_OF_COLOR;
        return tsuya_render_parse_color(s->dye_rgb, o->color);
    }
    s->dye = s->mesh.color && !material ? TSUYA_DYE_OF_VERTICES : TSUYA_DYE_OF_MATERIAL;
    return TSUYA_OK;
}

/* What is reflected and what comes through, together, cannot exceed what falls in (to the albedo's own accuracy). */
static tsuya_status check_energy(const tsuya_render_setup *s, const tsuya_render_options *o)
{
    for (int k = 0; k < s->material_count * 9; ++k) {
        const tsuya_material *m = s->material[k / 9];
        double theta = tsuya_rad_from_deg(8.0 + 9.0 * (k % 9)), albedo[TSUYA_MATERIAL_MAX_CHANNELS], brightest[TSUYA_MATERIAL_MAX_CHANNELS];
        int channels = tsuya_material_get_info(m).channel_count;
        for (int c = 0; c < channels; ++c) {
            brightest[c] = s->vertex_dye_scale;
        }
        const double *dye = s->dye == TSUYA_DYE_OF_VERTICES ? brightest : NULL; /* of one colour: the material has it */
        tsuya_material_albedo(m, dye, (tsuya_vec3){sin(theta), 0.0, cos(theta)}, albedo);
        double most = fmax(o->transmission[0], fmax(o->transmission[1], o->transmission[2]));
        for (int c = 0; c < channels; ++c) {
            double through = channels == 3 ? o->transmission[c] : most;
            if (through > 0.0 && albedo[c] + through > 1.005) {
                return tsuya_fail(TSUYA_ERROR_INPUT, "transmission: %g; \"%s\" reflects up to %.3f, so at most %.3f can come through",
                                  through, tsuya_material_get_info(m).name, albedo[c], fmax(0.0, 1.0 - albedo[c]));
            }
        }
    }
    return TSUYA_OK;
}

static tsuya_status make_scene(tsuya_render_setup *s, const tsuya_render_options *o)
{
    tsuya_scene_options options = tsuya_scene_options_default();
    tsuya_shader *shader = tsuya_arena_alloc(s->arena, (size_t)s->material_count, sizeof *shader);
    if (!shader) {
        return TSUYA_ERROR_MEMORY;
    }
    TSUYA_TRY(choose_dye(s, o));
    options.vertex_dye_scale = s->vertex_dye_scale = isnan(o->vertex_dye_scale) ? options.vertex_dye_scale : o->vertex_dye_scale;
    for (int k = 0; k < s->material_count; ++k) {
        TSUYA_TRY(tsuya_shader_from_material(&shader[k], s->material[k]));
    }
    TSUYA_TRY(find_bands(s, shader));
    TSUYA_TRY(s->bands && s->dye == TSUYA_DYE_OF_COLOR ? spread_dye(s, o->color) : TSUYA_OK);
    for (int k = 0; k < s->material_count; ++k) {
        memcpy(shader[k].transmittance, o->transmission, sizeof shader[k].transmittance);
        /* a dye laid over a measured one lies under the surface part, whatever the fit assumed of its own */
        TSUYA_TRY(set_dye(s, shader, k));
    }
    TSUYA_TRY(check_energy(s, o));
    options.shader = shader;
    options.shader_count = s->material_count;
    options.dye = s->dye;
    memcpy(options.dye_rgb, s->dye_rgb, sizeof options.dye_rgb);
    options.bands = s->bands;
    options.dye_of_bands = s->dye_of_bands;
    return tsuya_scene_create(&s->scene, s->coarse.vertex_count > 0 ? &s->coarse : &s->mesh, &options);
}

static tsuya_render_frame *add_frame(tsuya_render_setup *s, const char *name, const char *source)
{
    tsuya_render_frame *frame = &s->frame[s->frame_count];
    frame->index = s->frame_count++;
    frame->name = name;
    frame->source = source;
    return name && source ? frame : NULL;
}

static tsuya_status add_turntable(tsuya_render_setup *s, const tsuya_render_options *o)
{
    tsuya_turntable table = {.up = s->up, .elevation_rad = tsuya_rad_from_deg(o->elevation_deg),
                             .field_rad = tsuya_rad_from_deg(o->field_deg), .width_px = o->width_px, .height_px = o->height_px};
    TSUYA_TRY(tsuya_turntable_fit(&table, &s->mesh));
    for (int k = 0; k < o->views; ++k) {
        tsuya_render_frame *frame = add_frame(s, tsuya_arena_printf(s->arena, "frame_%03d", k),
                                              tsuya_arena_printf(s->arena, "turntable %d of %d", k, o->views));
        if (!frame) {
            return TSUYA_ERROR_MEMORY;
        }
        tsuya_turntable_view(&table, k, o->views, &frame->camera, &frame->camera_from_world);
    }
    return TSUYA_OK;
}

static tsuya_status add_model_views(tsuya_render_setup *s, const tsuya_render_options *o, int count)
{
    for (int k = 0; k < count; ++k) {
        int index = o->model_view_count < 0 ? k : o->model_view[k];
        if (index < 0 || index >= o->model->view_count) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "render: view %d; the model has %d", index, o->model->view_count);
        }
        const tsuya_view *view = &o->model->view[index];
        const char *name = tsuya_path_name(view->name);
        int stem = (int)(strlen(name) - strlen(tsuya_path_extension(name)));
        tsuya_render_frame *frame = add_frame(s, tsuya_arena_printf(s->arena, "%.*s", stem, name),
                                              tsuya_arena_printf(s->arena, "%s", view->name));
        if (!frame) {
            return TSUYA_ERROR_MEMORY;
        }
        frame->camera = o->model->camera[view->camera];
        frame->camera_from_world = view->camera_from_world;
    }
    return TSUYA_OK;
}

/* Smaller pictures of capture cameras, and the photographs that belong to them. */
static void finish_given_frames(tsuya_render_setup *s, const tsuya_render_options *o)
{
    for (int k = 0; k < s->frame_count; ++k) {
        tsuya_render_frame *f = &s->frame[k];
        int longest = f->camera.width_px > f->camera.height_px ? f->camera.width_px : f->camera.height_px;
        if (o->longest_side_px > 0 && longest > o->longest_side_px) {
            double scale = (double)o->longest_side_px / longest;
            f->camera = tsuya_camera_scaled(&f->camera, (int)fmax(1.0, round(scale * f->camera.width_px)),
                                            (int)fmax(1.0, round(scale * f->camera.height_px)));
        }
        f->photo = o->photo_path ? o->photo_path[k] : NULL;
        f->mask = o->mask_path ? o->mask_path[k] : NULL;
        f->held_out = o->held_out && o->held_out[k];
    }
}

static tsuya_status list_frames(tsuya_render_setup *s, const tsuya_render_options *o)
{
    int from_model = o->model ? (o->model_view_count < 0 ? o->model->view_count : o->model_view_count) : 0;
    int given = o->camera_count + from_model, count = given > 0 ? given : o->views;
    if (count < 1 || count > 100000) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "render: %d views; expected 1 to 100000", count);
    }
    s->frame = tsuya_arena_alloc(s->arena, (size_t)count, sizeof *s->frame);
    if (!s->frame) {
        return TSUYA_ERROR_MEMORY;
    }
    if (given == 0) {
        return add_turntable(s, o);
    }
    for (int k = 0; k < o->camera_count; ++k) {
        tsuya_render_frame *frame = add_frame(s, tsuya_arena_printf(s->arena, "frame_%03d", k),
                                              tsuya_arena_printf(s->arena, "%s", o->camera_path[k]));
        if (!frame) {
            return TSUYA_ERROR_MEMORY;
        }
        TSUYA_TRY(tsuya_cameramodel_load(&frame->camera, &frame->camera_from_world, o->camera_path[k]));
    }
    TSUYA_TRY(add_model_views(s, o, from_model));
    finish_given_frames(s, o);
    return TSUYA_OK;
}

/* Samples that the pictures get at least: with an error asked for, those of the pilots. */
static double samples_ahead(const tsuya_render_setup *s, const tsuya_render_options *o)
{
    double pixels = 0.0;
    for (int k = 0; k < s->frame_count; ++k) {
        pixels += (double)s->frame[k].camera.width_px * s->frame[k].camera.height_px;
    }
    return pixels * (o->noise > 0.0 && o->spp > TSUYA_PATH_PILOT_SPP ? TSUYA_PATH_PILOT_SPP : o->spp);
}

/* Triangles smaller than a pixel of every picture are left out as far as nobody can tell, where the pictures take so many samples that
 * finding them pays. */
static tsuya_status choose_detail(tsuya_render_setup *s, const tsuya_render_options *o, const tsuya_context *context)
{
    tsuya_detail_options options = tsuya_detail_options_default();
    options.distance_px = o->detail_px;
    s->detail.triangles_before = s->detail.triangles_after = s->mesh.triangle_count;
    if (!(o->detail_px > 0.0) || samples_ahead(s, o) < DETAIL_SAMPLES * (double)s->mesh.triangle_count || s->mesh.triangle_count == 0) {
        return TSUYA_OK;
    }
    tsuya_detail_view *view = tsuya_arena_alloc(s->arena, (size_t)s->frame_count, sizeof *view);
    if (!view) {
        return TSUYA_ERROR_MEMORY;
    }
    for (int k = 0; k < s->frame_count; ++k) {
        const tsuya_camera *c = &s->frame[k].camera;
        view[k] = (tsuya_detail_view){tsuya_pose_center(s->frame[k].camera_from_world), 1.0 / fmax(c->fx_px, c->fy_px)};
    }
    TSUYA_TRY(s->mesh.normal ? TSUYA_OK : tsuya_mesh_compute_normals(&s->mesh));
    return tsuya_mesh_detail(&s->coarse, &s->detail, &s->mesh, view, s->frame_count, &options, context);
}

/* Cheaper models in the place of the materials, where nobody can tell at the size of a pixel. */
static tsuya_status choose_reflectance(tsuya_render_setup *s, const tsuya_render_options *o, const tsuya_context *context)
{
    tsuya_reflectance_view *view = tsuya_arena_alloc(s->arena, (size_t)s->frame_count, sizeof *view);
    s->simple = tsuya_arena_alloc(s->arena, (size_t)s->material_count, sizeof *s->simple);
    s->choice = tsuya_arena_alloc(s->arena, (size_t)s->material_count, sizeof *s->choice);
    if (!view || !s->simple || !s->choice) {
        return TSUYA_ERROR_MEMORY;
    }
    for (int k = 0; k < s->frame_count; ++k) {
        view[k] = (tsuya_reflectance_view){&s->frame[k].camera, s->frame[k].camera_from_world};
    }
    for (int k = 0; k < s->material_count; ++k) {
        tsuya_shader shader = *tsuya_scene_shader(s->scene, k);
        TSUYA_TRY(tsuya_reflectance_choose(&s->simple[k], shader.under, &s->choice[k], s->scene, k, view, s->frame_count, o->tolerance, context));
        if (s->simple[k]) {
            shader.material = shader.user = s->simple[k];
            tsuya_scene_set_shader(s->scene, k, &shader);
        }
    }
    return TSUYA_OK;
}

/* A name, or a file whose "preset" is one; else lamps. */
static tsuya_status read_lights(tsuya_light_preset *preset, tsuya_light_set *lights, const char *path)
{
    *preset = tsuya_light_preset_find(path);
    if (*preset != TSUYA_PRESET_NONE) {
        return TSUYA_OK;
    }
    tsuya_json *root;
    TSUYA_TRY(tsuya_json_load(&root, path));
    const tsuya_json *member = tsuya_json_member(root, "preset");
    const char *name = tsuya_json_text_or(member, "");
    *preset = tsuya_light_preset_find(name);
    tsuya_status status = TSUYA_OK;
    if (member && *preset == TSUYA_PRESET_NONE) {
        status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: preset \"%.40s\": expected daylight, torch, halogen or led", path, name);
    }
    tsuya_json_free(root);
    return status == TSUYA_OK && *preset == TSUYA_PRESET_NONE ? tsuya_light_set_load(lights, path) : status;
}

tsuya_status tsuya_render_check_lights(const char *path)
{
    tsuya_light_preset preset;
    tsuya_light_set lights = {0};
    tsuya_status status = read_lights(&preset, &lights, path);
    tsuya_light_set_free(&lights);
    return status;
}

static tsuya_status load_lights(tsuya_render_setup *s, const tsuya_render_options *o)
{
    s->studio = !o->lights_path;
    return s->studio ? TSUYA_OK : read_lights(&s->preset, &s->lights, o->lights_path);
}

static tsuya_status set_up(tsuya_render_setup *s, const tsuya_render_options *o, const tsuya_context *context)
{
    TSUYA_TRY(tsuya_arena_create(&s->arena, 1 << 16));
    TSUYA_TRY(tsuya_ply_load(&s->mesh, o->mesh_path));
    if (s->mesh.vertex_count == 0) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: no vertices; expected a mesh", o->mesh_path);
    }
    if (o->without_weft) {
        tsuya_free(s->mesh.weft);
        s->mesh.weft = NULL;
    }
    if (s->mesh.triangle_count == 0) {
        tsuya_warn("%s: no triangles; the pictures will show lamps and nothing else", o->mesh_path);
    }
    s->up = tsuya_vec3_norm(o->up) > 0.0 ? tsuya_vec3_unit(o->up) : (tsuya_vec3){0, 0, 1};
    tsuya_vec3 low, high;
    tsuya_mesh_bounds(&s->mesh, &low, &high);
    s->center = tsuya_vec3_scale(tsuya_vec3_add(low, high), 0.5);
    s->radius = fmax(0.5 * tsuya_vec3_norm(tsuya_vec3_sub(high, low)), 1e-6);
    TSUYA_TRY(load_materials(s, o));
    TSUYA_TRY(load_lights(s, o));
    TSUYA_TRY(list_frames(s, o));
    TSUYA_TRY(choose_detail(s, o, context));
    TSUYA_TRY(make_scene(s, o));
    return choose_reflectance(s, o, context);
}

tsuya_status tsuya_render_setup_create(tsuya_render_setup *setup, const tsuya_render_options *options, const tsuya_context *context)
{
    *setup = (tsuya_render_setup){0};
    tsuya_status status = set_up(setup, options, context);
    if (status != TSUYA_OK) {
        tsuya_render_setup_free(setup);
    }
    return status;
}

void tsuya_render_setup_free(tsuya_render_setup *setup)
{
    tsuya_scene_free(setup->scene);
    for (int k = 0; setup->material && k < setup->material_count; ++k) {
        tsuya_material_free(setup->material[k]);
        tsuya_material_free(setup->simple ? setup->simple[k] : NULL);
    }
    tsuya_free(setup->material);
    tsuya_light_set_free(&setup->lights);
    tsuya_mesh_free(&setup->mesh);
    tsuya_mesh_free(&setup->coarse);
    tsuya_arena_free(setup->arena);
    *setup = (tsuya_render_setup){0};
}

tsuya_status tsuya_render_setup_lights(tsuya_light_set *lights, const tsuya_render_setup *setup, const tsuya_render_frame *frame)
{
    if (setup->preset != TSUYA_PRESET_NONE && !tsuya_light_preset_is_studio(setup->preset)) {
        return tsuya_light_set_preset(lights, setup->preset, setup->center, setup->radius, setup->up, setup->seed, frame->index);
    }
    if (!setup->studio && setup->preset == TSUYA_PRESET_NONE) {
        *lights = setup->lights;
        return TSUYA_OK;
    }
    TSUYA_TRY(tsuya_light_set_studio(lights, setup->center, setup->radius, tsuya_pose_center(frame->camera_from_world), setup->up));
    if (setup->preset == TSUYA_PRESET_NONE) {
        return TSUYA_OK;
    }
    tsuya_status status = tsuya_light_set_give_spectrum(lights, tsuya_light_preset_name(setup->preset));
    if (status != TSUYA_OK) {
        tsuya_light_set_free(lights);
    }
    return status;
}

void tsuya_render_setup_lights_free(tsuya_light_set *lights, const tsuya_render_setup *setup)
{
    if (setup->studio || setup->preset != TSUYA_PRESET_NONE) {
        tsuya_light_set_free(lights);
    }
}
