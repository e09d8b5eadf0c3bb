#include "reconstruct/verify.h"

#include "core/file.h"
#include "core/match_chance.h"

#include <stdlib.h>

enum {
    PARTS = 8,           /* of the pairs, whatever the number of threads */
    PAIRS_LEAST = 32,    /* fewer are one part */
    PATH_SIZE = 4096,
};
/* COLMAP's list of raw matches: two names, then a pair of indices a line, then an empty line. */
static tsuya_status save_list(const char *path, const tsuya_database *database, const tsuya_two_view *pair, int count, int part, int parts)
{
    tsuya_file_writer writer;
    TSUYA_TRY(tsuya_file_begin(&writer, path));
    for (int i = part; i < count; i += parts) {
        const char *name_a = "", *name_b = "";
        for (int k = 0; k < database->image_count; k++) {
            const tsuya_database_image *image = &database->image[k];
            name_a = image->image_id == pair[i].image_a ? image->name : name_a;
            name_b = image->image_id == pair[i].image_b ? image->name : name_b;
        }
        fprintf(writer.stream, "%s %s\n", name_a, name_b);
        for (int m = 0; m < pair[i].match_count; m++) {
            fprintf(writer.stream, "%u %u\n", pair[i].match[m].a, pair[i].match[m].b);
        }
        fputc('\n', writer.stream);
    }
    return tsuya_file_commit(&writer);
}

static tsuya_status verify_parts(tsuya_colmap *colmap, const char *base, const tsuya_database *database, const tsuya_two_view *pair, int count)
{
    const int parts = count < PAIRS_LEAST ? 1 : PARTS;
    char path[PATH_SIZE];
    for (int i = 0; i < parts; i++) {
        snprintf(path, sizeof path, "%s/verify/%d.txt", colmap->folder, i);
        TSUYA_TRY(save_list(path, database, pair, count, i, parts));
        snprintf(path, sizeof path, "%s/verify/%d.db", colmap->folder, i);
        TSUYA_TRY(tsuya_database_branch(path, base));
    }
    TSUYA_TRY(tsuya_colmap_verify(colmap, parts, count));
    for (int i = 0; i < parts; i++) {
        snprintf(path, sizeof path, "%s/verify/%d.db", colmap->folder, i);
        TSUYA_TRY(tsuya_database_merge(base, path));
    }
    return TSUYA_OK;
}

/* Of no kind any longer, as COLMAP leaves what it could not verify. */
static tsuya_status drop_chance(int *dropped, const char *base, const tsuya_two_view *pair, int count)
{
    for (int i = 0; i < count; i++) {
        tsuya_two_view found;
        TSUYA_TRY(tsuya_two_view_load(&found, base, pair[i].image_a, pair[i].image_b));
        bool free = found.kind == TSUYA_TWO_VIEW_CALIBRATED || found.kind == TSUYA_TWO_VIEW_UNCALIBRATED;
        if (free && tsuya_match_false_alarms(pair[i].match_count, found.match_count, pair[i].chance) > TSUYA_MATCH_MOST_FALSE_ALARMS) {
            tsuya_two_view none = {.image_a = found.image_a, .image_b = found.image_b};
            TSUYA_TRY(tsuya_two_views_save(base, &none, 1));
            (*dropped)++;
        }
    }
    return TSUYA_OK;
}

tsuya_status tsuya_verify(tsuya_colmap *colmap, int *dropped, const tsuya_database *database, const tsuya_two_view *pair, int count)
{
    char folder[PATH_SIZE], base[PATH_SIZE];
    snprintf(folder, sizeof folder, "%s/verify", colmap->folder);
    snprintf(base, sizeof base, "%s/database.db", colmap->folder);
    *dropped = 0;
    if (count == 0) {
        return TSUYA_OK;
    }
    TSUYA_TRY(tsuya_folder_remove(folder));
    TSUYA_TRY(tsuya_folder_make(folder));
    TSUYA_TRY(verify_parts(colmap, base, database, pair, count));
    TSUYA_TRY(tsuya_folder_remove(folder));
    return drop_chance(dropped, base, pair, count);
}
