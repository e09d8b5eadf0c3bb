#include "capture/check_photo.h"

#include "core/memory.h"

#include <math.h>
#include <stdio.h>

tsuya_check_options tsuya_check_options_default(void)
{
    return (tsuya_check_options){.blur_ratio = 1.5, .blur_excess_px = 0.8, .clipped_share = 0.05, .exposure_ev = 0.6, .white_balance_ev = 0.3,
                                 .shared_features = 16, .features = 4000, .features_long_side_px = 1000};
}

void tsuya_check_free(tsuya_check *check)
{
    for (int i = 0; i < check->count; i++) {
        tsuya_photo_free(&check->photo[i].photo);
    }
    tsuya_free(check->photo);
    *check = (tsuya_check){0};
}

static void photo_to_json(tsuya_json *object, const tsuya_check *check, const tsuya_checked_photo *p)
{
    tsuya_json_set_text(object, "name", p->photo.name);
    tsuya_json_set_bool(object, "again", p->fault_count > 0);
    tsuya_json_set_number(object, "blur_px", p->blur.worst_px);
    tsuya_json_set_number(object, "blur_best_px", p->blur.best_px);
    tsuya_json_set_number(object, "clipped_red", p->bright_clipped[0]);
    tsuya_json_set_number(object, "clipped_green", p->bright_clipped[1]);
    tsuya_json_set_number(object, "clipped_blue", p->bright_clipped[2]);
    tsuya_json_set_number(object, "black", fmin(p->dark_clipped[0], fmin(p->dark_clipped[1], p->dark_clipped[2])));
    tsuya_json_set_number(object, "exposure_ev", p->exposure_ev);
    tsuya_json_set_number(object, "red_ev", p->red_ev);
    tsuya_json_set_number(object, "blue_ev", p->blue_ev);
    tsuya_json_set_number(object, "focal_mm", p->photo.focal_mm > 0.0 ? p->photo.focal_mm : NAN);
    tsuya_json_set_number(object, "tags", p->tags < 0 ? NAN : (double)p->tags);
    tsuya_json_set_number(object, "tags_focal_px", p->tags_focal_px);
    tsuya_json_set_number(object, "neighbours", p->neighbours);
    tsuya_json_set_number(object, "shared_features", p->strongest);
    tsuya_json_set_number(object, "azimuth_deg", p->azimuth_deg);
    tsuya_json_set_number(object, "elevation_deg", p->elevation_deg);
    tsuya_json_set_text(object, "same_as", p->same_as >= 0 ? check->photo[p->same_as].photo.name : NULL);
    tsuya_json *why = tsuya_json_set_array(object, "why");
    for (int k = 0; k < p->fault_count; k++) {
        tsuya_json_add_text(why, p->fault[k]);
    }
}

static void missing_to_json(tsuya_json *array, const tsuya_check *check)
{
    for (int k = 0; k < check->missing_count; k++) {
        const tsuya_check_missing *m = &check->missing[k];
        tsuya_json *object = tsuya_json_add_object(array);
        char where[320];
        tsuya_check_missing_text(where, sizeof where, check, m);
        tsuya_json_set_text(object, "where", where);
        tsuya_json_set_number(object, "azimuth_deg", m->azimuth_deg);
        tsuya_json_set_number(object, "elevation_deg", m->elevation_deg);
        tsuya_json_set_number(object, "gain", m->gain);
    }
}

void tsuya_check_to_json(tsuya_json *object, const tsuya_check *check)
{
    tsuya_json_set_number(object, "photos", check->count);
    tsuya_json_set_number(object, "take_again", check->again);
    tsuya_json_set_number(object, "blur_px", check->blur_px);
    tsuya_json_set_number(object, "focal_mm", check->focal_mm > 0.0 ? check->focal_mm : NAN);
    tsuya_json_set_number(object, "tags_focal_px", check->tags_focal_px);
    tsuya_json_set_number(object, "wander_ev", check->wander_ev);
    tsuya_json_set_number(object, "placed", check->placed);
    tsuya_json_set_number(object, "covered", check->covered);
    tsuya_json_set_number(object, "seconds", check->seconds);
    tsuya_json *again = tsuya_json_set_array(object, "again");
    for (int i = 0; i < check->count; i++) {
        const tsuya_checked_photo *p = &check->photo[i];
        for (int k = 0; k < p->fault_count; k++) {
            char line[512];
            snprintf(line, sizeof line, "%s: %s", p->photo.name, p->fault[k]);
            tsuya_json_add_text(again, line);
        }
    }
    missing_to_json(tsuya_json_set_array(object, "missing"), check);
    tsuya_json *list = tsuya_json_set_array(object, "photographs");
    for (int i = 0; i < check->count; i++) {
        photo_to_json(tsuya_json_add_object(list), check, &check->photo[i]);
    }
}

const char *tsuya_check_blindness(const tsuya_check *check)
{
    int alone = 0;
    for (int i = 0; i < check->count; i++) {
        alone += check->photo[i].neighbours == 0;
    }
    return check->count > 2 && 2 * alone > check->count
               ? "most photographs share too few features with any other: brightness, colour, sameness and directions were not compared"
               : NULL;
}
