#include "reconstruct/match_steps.h"

#include "core/match_chance.h"
#include "core/memory.h"
#include "reconstruct/digest.h"
#include "reconstruct/pairs.h"
#include "reconstruct/verify.h"

#include <stdlib.h>
#include <string.h>

enum {
    LEAST_MATCHES = 15, /* of a pair that counts as verified, as COLMAP's own verification wants */
    /* Mean features of a photograph up to which the verified geometry leads to more matches.  Where they are few they link
     * views far apart; where there are many the less distinct ones pull the lens: on the demo's 24 photographs (6000 features)
     * the focal length was 0.34 % off without them, 1.25 % with. */
    GUIDED_FEATURES_MOST = 4000,
};
static const double MOST_OFF_PX = 4.0; /* from the epipolar line, as COLMAP's own verification wants */

typedef struct matcher {
    tsuya_reconstruction *r;
    const char *base;
    const tsuya_pairs *pairs;
    uint8_t *done; /* photo_count × photo_count: matched by an earlier round */
    const tsuya_database *database;
    tsuya_sparse_model posed; /* of given poses; no views where there are none */
    tsuya_two_view *found;
    int found_count, pair_count, seen, by_chance;
} matcher;

static const tsuya_database_image *image_of(const matcher *o, int photo)
{
    for (int i = 0; i < o->database->image_count; i++) {
        if (strcmp(o->database->image[i].name, o->r->photos.photo[photo].name) == 0) {
            return &o->database->image[i];
        }
    }
    return NULL;
}

static int posed_view(const matcher *o, uint32_t image_id)
{
    for (int v = 0; v < o->posed.view_count; v++) {
        if (o->posed.view[v].image_id == image_id) {
            return v;
        }
    }
    return -1;
}

typedef tsuya_status (*pair_work)(matcher *o, const tsuya_sift *a, const tsuya_sift *b, uint32_t image_a, uint32_t image_b);

/* Calls `work` for each chosen pair that no earlier round saw, images in the order of their numbers. */
static tsuya_status each_pair(matcher *o, const char *label, pair_work work)
{
    const int n = o->pairs->photo_count;
    tsuya_sift a = {0}, b = {0};
    tsuya_status status = TSUYA_OK;
    o->seen = 0;
    for (int i = 0; i < n; i++) {
        const tsuya_database_image *first = image_of(o, i);
        bool loaded = false;
        for (int j = i + 1; j < n; j++) {
            const tsuya_database_image *second = image_of(o, j);
            if (!o->pairs->chosen[i * n + j] || o->done[i * n + j] || !first || !second) {
                continue;
            }
            if (!loaded) {
                TSUYA_GOTO_DONE(status, tsuya_sift_load(&a, o->base, first->image_id));
                loaded = true;
            }
            TSUYA_GOTO_DONE(status, tsuya_check_interrupt());
            TSUYA_GOTO_DONE(status, tsuya_sift_load(&b, o->base, second->image_id));
            TSUYA_GOTO_DONE(status, work(o, &a, &b, first->image_id, second->image_id));
            tsuya_sift_free(&b);
            tsuya_progress_update(o->r->context, label, ++o->seen, o->pair_count, NULL);
        }
        tsuya_sift_free(&a);
    }
done:
    tsuya_sift_free(&a);
    tsuya_sift_free(&b);
    return status;
}

static tsuya_two_view *next_found(matcher *o, uint32_t image_a, uint32_t image_b)
{
    tsuya_two_view *pair = &o->found[o->found_count++];
    *pair = (tsuya_two_view){.image_a = image_a, .image_b = image_b};
    return pair;
}

static tsuya_status match_freely(matcher *o, const tsuya_sift *a, const tsuya_sift *b, uint32_t image_a, uint32_t image_b)
{
    tsuya_two_view *pair = next_found(o, image_a, image_b);
    pair->chance = fmax(tsuya_match_chance(a, MOST_OFF_PX), tsuya_match_chance(b, MOST_OFF_PX));
    return tsuya_match_features(&pair->match, &pair->match_count, a, b, NULL, o->r->context->threads);
}

/* The pair's geometry, as its free matches gave it to COLMAP, leads to more. */
static tsuya_status match_guided(matcher *o, const tsuya_sift *a, const tsuya_sift *b, uint32_t image_a, uint32_t image_b)
{
    tsuya_two_view pair;
    TSUYA_TRY(tsuya_two_view_load(&pair, o->base, image_a, image_b));
    if (pair.kind < TSUYA_TWO_VIEW_CALIBRATED || pair.kind > TSUYA_TWO_VIEW_PLANAR_OR_PANORAMIC) {
        return TSUYA_OK;
    }
    bool flat = pair.kind >= TSUYA_TWO_VIEW_PLANAR;
    tsuya_guide guide = {.kind = flat ? TSUYA_GUIDE_HOMOGRAPHY : TSUYA_GUIDE_EPIPOLAR, .most = MOST_OFF_PX};
    memcpy(guide.matrix, flat ? pair.homography : pair.fundamental, sizeof guide.matrix);
    int before = pair.match_count;
    TSUYA_TRY(tsuya_match_features(&pair.match, &pair.match_count, a, b, &guide, o->r->context->threads));
    if (pair.match_count > before) {
        o->found[o->found_count++] = pair;
    } else {
        tsuya_free(pair.match);
    }
    return TSUYA_OK;
}

static tsuya_status copy_undistorted(tsuya_sift *out, const tsuya_sift *f, const tsuya_camera *camera)
{
    *out = *f;
    out->position = tsuya_calloc((size_t)(f->count > 0 ? f->count : 1), sizeof *out->position);
    if (!out->position) {
        return TSUYA_ERROR_MEMORY;
    }
    memcpy(out->position, f->position, (size_t)f->count * sizeof *out->position);
    tsuya_sift_undistort(out, camera);
    return TSUYA_OK;
}

/* Given poses are the pair's geometry. */
static tsuya_status match_posed(matcher *o, const tsuya_sift *a, const tsuya_sift *b, uint32_t image_a, uint32_t image_b)
{
    int va = posed_view(o, image_a), vb = posed_view(o, image_b);
    if (va < 0 || vb < 0) {
        return TSUYA_OK;
    }
    const tsuya_view *first = &o->posed.view[va], *second = &o->posed.view[vb];
    const tsuya_camera *ca = &o->posed.camera[first->camera], *cb = &o->posed.camera[second->camera];
    tsuya_guide guide = tsuya_guide_of_poses(first->camera_from_world, second->camera_from_world, MOST_OFF_PX / fmin(ca->fx_px, cb->fx_px));
    tsuya_sift plane_a = {0}, plane_b = {0};
    tsuya_status status = copy_undistorted(&plane_a, a, ca);
    status = status == TSUYA_OK ? copy_undistorted(&plane_b, b, cb) : status;
    tsuya_two_view *pair = next_found(o, image_a, image_b);
    if (status == TSUYA_OK) {
        status = tsuya_match_features(&pair->match, &pair->match_count, &plane_a, &plane_b, &guide, o->r->context->threads);
    }
    pair->kind = TSUYA_TWO_VIEW_CALIBRATED;
    memcpy(pair->essential, guide.matrix, sizeof pair->essential);
    tsuya_free(plane_a.position);
    tsuya_free(plane_b.position);
    return status;
}

static void drop_found(matcher *o, int least)
{
    int kept = 0;
    for (int i = 0; i < o->found_count; i++) {
        if (o->found[i].match_count >= least) {
            o->found[kept++] = o->found[i];
        } else {
            tsuya_free(o->found[i].match);
        }
    }
    o->found_count = kept;
}

static double mean_features(const tsuya_database *database)
{
    double sum = 0.0;
    for (int i = 0; i < database->image_count; i++) {
        sum += database->image[i].features;
    }
    return database->image_count > 0 ? sum / database->image_count : 0.0;
}

/* One round over the chosen pairs that are not yet matched. */
static tsuya_status match_round(matcher *o)
{
    const int n = o->pairs->photo_count;
    tsuya_status status;
    int dropped;
    o->pair_count = 0;
    for (int i = 0; i < n; i++) {
        for (int j = i + 1; j < n; j++) {
            o->pair_count += o->pairs->chosen[i * n + j] && !o->done[i * n + j];
        }
    }
    o->found = tsuya_calloc((size_t)o->pair_count + 1, sizeof *o->found);
    if (!o->found) {
        return TSUYA_ERROR_MEMORY;
    }
    if (o->posed.view_count > 0) {
        TSUYA_GOTO_DONE(status, each_pair(o, "matching", match_posed));
        drop_found(o, LEAST_MATCHES);
    } else {
        TSUYA_GOTO_DONE(status, each_pair(o, "matching", match_freely));
        drop_found(o, LEAST_MATCHES);
        TSUYA_GOTO_DONE(status, tsuya_verify(&o->r->colmap, &dropped, o->database, o->found, o->found_count));
        o->by_chance += dropped;
        drop_found(o, INT32_MAX);
        if (mean_features(o->database) <= GUIDED_FEATURES_MOST) {
            TSUYA_GOTO_DONE(status, each_pair(o, "matching along lines", match_guided));
            drop_found(o, LEAST_MATCHES);
        }
    }
    status = tsuya_two_views_save(o->base, o->found, o->found_count);
    for (int i = 0; i < n * n; i++) {
        o->done[i] |= o->pairs->chosen[i];
    }
done:
    drop_found(o, INT32_MAX);
    tsuya_free(o->found);
    o->found = NULL;
    return status;
}

static tsuya_status match_all(tsuya_reconstruction *r, tsuya_json *figures)
{
    tsuya_pairs_options options = tsuya_pairs_options_default();
    tsuya_pairs pairs = {0};
    tsuya_database database = {0};
    matcher o = {.r = r, .base = tsuya_reconstruction_path(r, "database.db"), .pairs = &pairs, .database = &database};
    int added = 0, details = 0;
    tsuya_status status;
    if (r->options->poses) {
        TSUYA_GOTO_DONE(status, tsuya_sparse_model_load(&o.posed, tsuya_reconstruction_path(r, "posed")));
    }
    TSUYA_GOTO_DONE(status, tsuya_database_clear_matches(o.base));
    TSUYA_GOTO_DONE(status, tsuya_pairs_create(&pairs, &r->photos, &options, r->context));
    TSUYA_NEW(status, o.done, (size_t)pairs.photo_count * (size_t)pairs.photo_count);
    TSUYA_GOTO_DONE(status, tsuya_database_load(&database, o.base));
    TSUYA_GOTO_DONE(status, match_round(&o));
    tsuya_database_free(&database);
    TSUYA_GOTO_DONE(status, tsuya_database_load(&database, o.base));
    TSUYA_GOTO_DONE(status, tsuya_digest_pairs(&pairs, &details, &database, o.base, &r->photos, r->context));
    TSUYA_GOTO_DONE(status, tsuya_pairs_extend(&pairs, &added, &database, &r->photos, &options));
    if (added + details > 0) {
        TSUYA_GOTO_DONE(status, match_round(&o));
        tsuya_database_free(&database);
        TSUYA_GOTO_DONE(status, tsuya_database_load(&database, o.base));
    }
    tsuya_json_set_number(figures, "pairs_matched", pairs.count);
    tsuya_json_set_number(figures, "pairs_possible", pairs.possible);
    tsuya_json_set_number(figures, "pairs_verified", database.pair_count);
    tsuya_json_set_number(figures, "pairs_of_chance", o.by_chance);
    tsuya_json_set_number(figures, "pairs_added_by_view_graph", added);
    tsuya_json_set_number(figures, "pairs_added_by_details", details);
    status = tsuya_pairs_save(&pairs, &r->photos, tsuya_reconstruction_path(r, "pairs.txt"));
done:
    tsuya_free(o.done);
    tsuya_pairs_free(&pairs);
    tsuya_database_free(&database);
    tsuya_sparse_model_free(&o.posed);
    return status;
}

tsuya_status tsuya_match_step(tsuya_reconstruction *r)
{
    tsuya_reconstruct_info *info = r->info;
    if (!tsuya_step_begin(&r->steps, "matching", "chance, 4000 trials", tsuya_reconstruction_path(r, "pairs.txt"))) {
        tsuya_json *figures = tsuya_json_create_object();
        tsuya_status status = match_all(r, figures);
        status = status == TSUYA_OK ? tsuya_reconstruction_end_step(r, figures) : status;
        tsuya_json_free(figures);
        TSUYA_TRY(status);
    }
    const tsuya_json *figures = tsuya_step_figures(&r->steps, "matching");
    info->pairs_matched = (int)tsuya_json_number_or(tsuya_json_member(figures, "pairs_matched"), 0);
    info->pairs_possible = (int)tsuya_json_number_or(tsuya_json_member(figures, "pairs_possible"), 0);
    info->pairs_verified = (int)tsuya_json_number_or(tsuya_json_member(figures, "pairs_verified"), 0);
    return TSUYA_OK;
}
