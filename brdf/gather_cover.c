/* The drape as a goniometer: which azimuths and tilts of the half vector the folds reach, and which photographs would add others.
 *
 * A wish is found by trying: the surface is drawn small from places around it, every pixel that sees its whole lamp says which cell it would
 * fill; the place with most new cells is taken, then the next. */
#include "brdf/gather_parts.h"

#include "core/memory.h"

#include <math.h>
#include <string.h>

enum { AZIMUTHS = 24, ELEVATIONS = 8, CANDIDATES = AZIMUTHS * ELEVATIONS, SIDE = 96, FEWEST = 3, CELLS = TSUYA_GATHER_SECTORS * TSUYA_GATHER_TILTS };
static const double TILT_STEP_DEG = 6.0;

bool tsuya_gather_cell(int *sector, int *tilt, tsuya_vec3 wi, tsuya_vec3 wo)
{
    tsuya_vec3 h = tsuya_vec3_unit(tsuya_vec3_add(wi, wo));
    double theta = tsuya_deg_from_rad(acos(fmin(1.0, h.z))), phi = tsuya_deg_from_rad(atan2(h.y, h.x));
    *sector = ((int)floor((phi + 22.5) / 45.0) % TSUYA_GATHER_SECTORS + TSUYA_GATHER_SECTORS) % TSUYA_GATHER_SECTORS;
    *tilt = (int)floor(theta / TILT_STEP_DEG);
    return *tilt < TSUYA_GATHER_TILTS;
}

static void candidate(tsuya_gather_wish *wish, tsuya_vec3 *way, int k)
{
    wish->azimuth_deg = 360.0 / AZIMUTHS * (k % AZIMUTHS);
    wish->elevation_deg = 5.0 + 11.0 * (k / AZIMUTHS);
    double a = tsuya_rad_from_deg(wish->azimuth_deg), e = tsuya_rad_from_deg(wish->elevation_deg);
    *way = (tsuya_vec3){cos(e) * cos(a), cos(e) * sin(a), sin(e)};
}

/* Pixels in each cell from one place. */
static tsuya_status try_place(int cells[CELLS], const tsuya_gather *g, const tsuya_gather_lamps *lamps, const gather_shadow *shadow, tsuya_vec3 way,
                              double distance_m, const tsuya_context *context)
{
    tsuya_raster raster;
    double half = asin(fmin(0.95, g->radius_m / distance_m)), focal = 0.49 * SIDE / tan(half), low = sin(tsuya_rad_from_deg(g->options.grazing_deg));
    tsuya_camera camera = {.lens = TSUYA_LENS_PINHOLE, .width_px = SIDE, .height_px = SIDE, .fx_px = focal, .fy_px = focal, .cx_px = 0.5 * (SIDE - 1),
                           .cy_px = 0.5 * (SIDE - 1)};
    tsuya_vec3 eye = tsuya_vec3_mad(g->middle, distance_m, way);
    tsuya_pose pose = tsuya_pose_look_at(eye, g->middle, fabs(way.z) > 0.99 ? (tsuya_vec3){0, 1, 0} : (tsuya_vec3){0, 0, 1});
    memset(cells, 0, CELLS * sizeof *cells);
    TSUYA_TRY(tsuya_raster_create(&raster, SIDE, SIDE));
    tsuya_status status = tsuya_raster_draw(&raster, g->mesh, &camera, pose, context);
    for (int k = 0; k < SIDE * SIDE && status == TSUYA_OK; k++) {
        gather_place at;
        int sector, tilt;
        if (!tsuya_gather_place(&at, g, &raster, &camera, pose, k % SIDE, k / SIDE)) {
            continue;
        }
        gather_light light = tsuya_gather_light(g, lamps, shadow, at.p, at.n);
        tsuya_vec3 wi = gather_local(&at, light.wi), wo = gather_local(&at, tsuya_vec3_unit(tsuya_vec3_sub(eye, at.p)));
        if (light.whole && light.share >= g->options.alone && wi.z > low && wo.z > low && tsuya_gather_cell(&sector, &tilt, wi, wo)) {
            cells[sector * TSUYA_GATHER_TILTS + tilt]++;
        }
    }
    tsuya_raster_free(&raster);
    return status;
}

static int gain_of(const int *cells, const bool *filled)
{
    int gain = 0;
    for (int k = 0; k < CELLS; k++) {
        gain += !filled[k] && cells[k] >= FEWEST;
    }
    return gain;
}

tsuya_status tsuya_gather_wishes(tsuya_gather_wish *wish, int *count, int room, const tsuya_gather *g, const tsuya_gathered *gathered,
                                 const tsuya_gather_lamps *lamps, double distance_m, const tsuya_context *context)
{
    tsuya_status status;
    gather_shadow *shadow = NULL;
    int *cells = NULL;
    bool filled[CELLS];
    tsuya_vec3 way;
    *count = 0;
    for (int k = 0; k < CELLS; k++) {
        filled[k] = gathered->covered[k / TSUYA_GATHER_TILTS][k % TSUYA_GATHER_TILTS] > 0;
    }
    distance_m = fmax(distance_m, 1.3 * g->radius_m);
    TSUYA_GOTO_DONE(status, tsuya_gather_shadows(&shadow, g, lamps, context));
    TSUYA_NEW(status, cells, (size_t)CANDIDATES * CELLS);
    for (int k = 0; k < CANDIDATES; k++) {
        tsuya_gather_wish own;
        candidate(&own, &way, k);
        TSUYA_GOTO_DONE(status, try_place(cells + (size_t)k * CELLS, g, lamps, shadow, way, distance_m, context));
    }
    while (*count < room) {
        int best = 0, chosen = -1;
        for (int k = 0; k < CANDIDATES; k++) {
            int gain = gain_of(cells + (size_t)k * CELLS, filled);
            chosen = gain > best ? k : chosen;
            best = gain > best ? gain : best;
        }
        if (chosen < 0) {
            break;
        }
        candidate(&wish[*count], &way, chosen);
        wish[(*count)++].cells = best;
        for (int k = 0; k < CELLS; k++) {
            filled[k] = filled[k] || cells[(size_t)chosen * CELLS + (size_t)k] >= FEWEST;
        }
    }
done:
    tsuya_gather_shadows_free(shadow, lamps->count);
    tsuya_free(cells);
    return status;
}
