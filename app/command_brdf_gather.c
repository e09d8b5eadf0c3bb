/* tsuya brdf gather PHOTOS --poses MODEL --surface MESH.ply --lights LIGHTS.json */
#include "app/command.h"
#include "app/gather_input.h"
#include "app/terminal.h"
#include "core/file.h"

#include <math.h>
#include <stdio.h>

enum { KEY_POSES = 1, KEY_SURFACE, KEY_LIGHTS, KEY_WITH_CAMERA, KEY_MASKS, KEY_REFERENCE, KEY_CELL, KEY_ONE_DYE, KEY_WISHES, WISHES_MOST = 64 };

typedef struct gather_input {
    tsuya_gather_paths paths;
    const char *output;
    double cell_deg;
    bool one_dye;
    int wishes;
} gather_input;

static const struct argp_option gather_options[] = {
    {"poses", KEY_POSES, "MODEL", 0, "Folder of a COLMAP model with the photographs' cameras, metres", 0},
    {"surface", KEY_SURFACE, "MESH.ply", 0, "The surface with normals and weft (of `tsuya weave mesh`)", 0},
    {"lights", KEY_LIGHTS, "LIGHTS.json", 0, "The lamps in the same frame", 0},
    {"lamps-with-camera", KEY_WITH_CAMERA, NULL, 0, "The lamps stand in the camera's frame: a stage turns the cloth before both", 0},
    {"masks", KEY_MASKS, "FOLDER", 0, "NAME.png or NAME.jpg.png; black is ignored", 0},
    {"reference", KEY_REFERENCE, "FILE.csv", 0, "Matt patches of known reflectance, x_m,y_m,z_m[,nx,ny,nz],r,g,b[,size_m]; without them the table is relative", 0},
    {"cell-deg", KEY_CELL, "D", 0, "Directions this close are averaged (default 3)", 0},
    {"one-dye", KEY_ONE_DYE, NULL, 0, "The cloth has no pattern to separate", 0},
    {"wishes", KEY_WISHES, "N", 0, "Photographs to wish for (default 8)", 0},
    {"output", 'o', "PATH", 0, "SAMPLES.csv, or a folder (default: the current one)", 0},
    {0},
};

static error_t parse_gather(int key, char *arg, struct argp_state *state)
{
    gather_input *input = state->input;
    tsuya_gather_paths *p = &input->paths;
    switch (key) {
    case KEY_POSES: p->poses = arg; return 0;
    case KEY_SURFACE: p->surface = arg; return 0;
    case KEY_LIGHTS: p->lights = arg; return 0;
    case KEY_WITH_CAMERA: p->lamps_with_camera = true; return 0;
    case KEY_MASKS: p->masks = arg; return 0;
    case KEY_REFERENCE: p->reference = arg; return 0;
    case KEY_CELL: input->cell_deg = tsuya_argument_number(state, "--cell-deg", arg, 0.2, 20.0); return 0;
    case KEY_ONE_DYE: input->one_dye = true; return 0;
    case KEY_WISHES: input->wishes = tsuya_argument_int(state, "--wishes", arg, 0, WISHES_MOST); return 0;
    case 'o': input->output = arg; return 0;
    case ARGP_KEY_ARG:
        if (p->photos) {
            argp_error(state, "'%s': one folder of photographs only", arg);
        }
        p->photos = arg;
        return 0;
    case ARGP_KEY_END:
        if (!p->photos || !p->poses || !p->surface || !p->lights) {
            argp_error(state, "%s is missing", !p->photos ? "PHOTOS" : !p->poses ? "--poses" : !p->surface ? "--surface" : "--lights");
        }
        return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const tsuya_syntax gather_syntax = {
    .arguments = "PHOTOS",
    .example = "tsuya brdf gather simulated/swatch --poses simulated/truth/swatch --surface simulated/truth/swatch.ply --lights simulated/swatch/lights.json "
               "--lamps-with-camera --reference simulated/swatch/reference.csv --one-dye -o swatch.csv",
    .doc = "Photographs of a swatch or a garment become a table of reflectance for `tsuya brdf fit`: shadows, clipped pixels and silhouettes are left out, "
           "a dyed pattern is told from the surface part, the mean dye stays. Says which azimuths and tilts of the half vector are covered and "
           "which photographs would fill the rest.\vOne lamp at a time gives the cleanest table. Rows: directions, brdf, and sigma, the relative "
           "uncertainty of a row.",
    .options = gather_options,
    .parse = parse_gather,
};

static double polar_deg(tsuya_vec3 w) { return tsuya_deg_from_rad(acos(fmin(1.0, fmax(-1.0, w.z)))); }

static double azimuth_deg(tsuya_vec3 w)
{
    double phi = tsuya_deg_from_rad(atan2(w.y, w.x));
    return phi < 0.0 ? phi + 360.0 : phi;
}

static tsuya_status save_table(const tsuya_gathered *gathered, bool relative, const char *path)
{
    const tsuya_samples *s = &gathered->samples;
    tsuya_file_writer w;
    TSUYA_TRY(tsuya_file_begin(&w, path));
    fprintf(w.stream, relative ? "# quantity=radiance\n" : "# quantity=brdf\n");
    fprintf(w.stream, "theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,r,g,b,sigma\n");
    for (int k = 0; k < s->count; k++) {
        double factor = relative ? s->wi[k].z : 1.0; /* radiance under one irradiance */
        fprintf(w.stream, "%.4f,%.4f,%.4f,%.4f,%.7g,%.7g,%.7g,%.4g\n", polar_deg(s->wi[k]), azimuth_deg(s->wi[k]), polar_deg(s->wo[k]), azimuth_deg(s->wo[k]),
                factor * s->value[3 * k], factor * s->value[3 * k + 1], factor * s->value[3 * k + 2], gathered->sigma[k]);
    }
    return tsuya_file_commit(&w);
}

static void fill(tsuya_json *figures, const tsuya_gathered *g, const tsuya_gather_session *session, const tsuya_gather_wish *wish, int wishes)
{
    const tsuya_gather_counts *c = &session->counts;
    int covered = 0;
    tsuya_json_set_number(figures, "photos", session->photos);
    tsuya_json_set_number(figures, "samples", g->samples.count);
    tsuya_json_set_bool(figures, "relative", session->relative);
    tsuya_json *pixels = tsuya_json_set_object(figures, "pixels");
    tsuya_json_set_number(pixels, "seen", (double)c->seen);
    tsuya_json_set_number(pixels, "used", (double)c->used);
    tsuya_json_set_number(pixels, "border", (double)c->border);
    tsuya_json_set_number(pixels, "clipped", (double)c->clipped);
    tsuya_json_set_number(pixels, "grazing", (double)c->grazing);
    tsuya_json_set_number(pixels, "shadowed", (double)c->shadowed);
    tsuya_json_set_number(pixels, "several_lamps", (double)c->shared);
    tsuya_json_set_numbers(figures, "pattern_spread", g->pattern_spread, 3);
    tsuya_json_set_numbers(figures, "median_brdf", g->mean_reflectance, 3);
    tsuya_json *rows = tsuya_json_set_array(figures, "half_vector_cells"); /* azimuth 0, 45, … by tilt 0–6, 6–12, … degrees */
    for (int a = 0; a < TSUYA_GATHER_SECTORS; a++) {
        tsuya_json *row = tsuya_json_add_array(rows);
        for (int t = 0; t < TSUYA_GATHER_TILTS; t++) {
            tsuya_json_add_number(row, g->covered[a][t]);
            covered += g->covered[a][t] > 0;
        }
    }
    tsuya_json_set_number(figures, "covered", (double)covered / (TSUYA_GATHER_SECTORS * TSUYA_GATHER_TILTS));
    tsuya_json *wanted = tsuya_json_set_array(figures, "photographs_to_add");
    for (int k = 0; k < wishes; k++) {
        tsuya_json *one = tsuya_json_add_object(wanted);
        tsuya_json_set_number(one, "azimuth_deg", wish[k].azimuth_deg);
        tsuya_json_set_number(one, "elevation_deg", wish[k].elevation_deg);
        tsuya_json_set_number(one, "cells", wish[k].cells);
    }
}

static tsuya_status gather(const gather_input *input, const tsuya_common *common)
{
    tsuya_context context = tsuya_command_context(common);
    tsuya_gather_options options = tsuya_gather_options_default();
    tsuya_gather_session session = {0};
    tsuya_gathered gathered = {0};
    tsuya_gather_wish wish[WISHES_MOST];
    tsuya_json *figures = NULL;
    char *folder = NULL, *file = NULL;
    int wishes = 0;
    double start_s = tsuya_clock_s();
    tsuya_status status;
    options.cell = tsuya_rad_from_deg(input->cell_deg);
    options.pattern = !input->one_dye;
    TSUYA_GOTO_DONE(status, tsuya_command_output(&folder, &file, input->output, ".csv", "samples.csv"));
    TSUYA_GOTO_DONE(status, tsuya_gather_photos(&session, &input->paths, &options, &context));
    TSUYA_GOTO_DONE(status, tsuya_gather_finish(&gathered, session.gather));
    if (input->wishes > 0) {
        TSUYA_GOTO_DONE(status, tsuya_gather_wishes(wish, &wishes, input->wishes, session.gather, &gathered, &session.lamps, session.distance_m, &context));
    }
    TSUYA_GOTO_DONE(status, save_table(&gathered, session.relative, file));
    figures = tsuya_json_create_object();
    if (!figures) {
        TSUYA_GOTO_DONE(status, TSUYA_ERROR_MEMORY);
    }
    fill(figures, &gathered, &session, wish, wishes);
    tsuya_json_set_number(figures, "seconds", tsuya_clock_s() - start_s);
    status = tsuya_command_figures(common, figures);
done:
    tsuya_json_free(figures);
    tsuya_gathered_free(&gathered);
    tsuya_gather_session_free(&session);
    tsuya_free(folder);
    tsuya_free(file);
    return status;
}

int tsuya_command_brdf_gather(int argc, char **argv)
{
    tsuya_common common;
    gather_input input = {.cell_deg = 3.0, .wishes = 8};
    tsuya_command_parse(&gather_syntax, &common, &input, argc, argv);
    tsuya_status status = gather(&input, &common);
    return status == TSUYA_OK ? TSUYA_EXIT_OK : tsuya_command_failed(status);
}
