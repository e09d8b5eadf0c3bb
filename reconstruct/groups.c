#include "reconstruct/groups.h"

#include <stdio.h>
#include <string.h>

static int photo_index(const tsuya_photo_set *photos, const char *name)
{
    for (int i = 0; i < photos->count; i++) {
        if (strcmp(photos->photo[i].name, name) == 0) {
            return i;
        }
    }
    return -1;
}

static int verified(const tsuya_database *database, const char *a, const char *b)
{
    for (int p = 0; p < database->pair_count; p++) {
        const char *first = database->image[database->pair[p].a].name, *second = database->image[database->pair[p].b].name;
        if ((strcmp(first, a) == 0 && strcmp(second, b) == 0) || (strcmp(first, b) == 0 && strcmp(second, a) == 0)) {
            return database->pair[p].inliers;
        }
    }
    return 0;
}

bool tsuya_groups_bridge(tsuya_bridge *bridge, const tsuya_sparse_model *a, const tsuya_sparse_model *b, const tsuya_database *database,
                         const tsuya_pairs *pairs, const tsuya_photo_set *photos)
{
    *bridge = (tsuya_bridge){.matches = -1};
    for (int i = 0; i < a->view_count; i++) {
        const char *from = a->view[i].name;
        const int ia = photo_index(photos, from);
        for (int j = 0; j < b->view_count && ia >= 0 && tsuya_sparse_model_find(b, from) < 0; j++) {
            const char *to = b->view[j].name;
            const int ib = photo_index(photos, to);
            if (ib < 0 || tsuya_sparse_model_find(a, to) >= 0) {
                continue;
            }
            const int matches = verified(database, from, to);
            const float likeness = pairs->likeness[ia * pairs->photo_count + ib];
            if (matches > bridge->matches || (matches == bridge->matches && likeness > bridge->likeness)) {
                *bridge = (tsuya_bridge){from, to, matches, likeness};
            }
        }
    }
    return bridge->from != NULL;
}

static void report_one(tsuya_json *entry, const tsuya_sparse_model *group, const tsuya_bridge *bridge)
{
    char names[256] = "", by[512] = "";
    tsuya_json *list = tsuya_json_set_array(entry, "photos");
    for (int v = 0; v < group->view_count; v++) {
        tsuya_json_add_text(list, group->view[v].name);
        size_t used = strlen(names);
        snprintf(names + used, sizeof names - used, "%s%s", used ? ", " : "", group->view[v].name);
    }
    if (!bridge) {
        tsuya_json_set_null(entry, "join");
        tsuya_warn("the set falls apart: %d photographs stand in a group of their own (%s)", group->view_count, names);
        return;
    }
    tsuya_json *join = tsuya_json_set_object(entry, "join");
    tsuya_json_set_text(join, "from", bridge->from);
    tsuya_json_set_text(join, "to", bridge->to);
    tsuya_json_set_number(join, "matches", bridge->matches);
    if (bridge->matches > 0) {
        snprintf(by, sizeof by, "which share %d matches", bridge->matches);
    } else {
        snprintf(by, sizeof by, "which look most alike");
    }
    tsuya_warn("the set falls apart: %d photographs stand in a group of their own (%s); further ones taken between %s and %s, %s, would "
               "join it to the largest", group->view_count, names, bridge->from, bridge->to, by);
}

tsuya_status tsuya_groups_report(tsuya_json *array, const tsuya_sparse_model *model, int model_count, int kept,
                                 const tsuya_database *database, const tsuya_photo_set *photos, const tsuya_context *context)
{
    tsuya_pairs pairs = {0};
    const tsuya_pairs_options options = tsuya_pairs_options_default();
    TSUYA_TRY(tsuya_pairs_create(&pairs, photos, &options, context));
    for (int m = 0; m < model_count; m++) {
        tsuya_bridge bridge;
        if (m != kept) {
            bool found = tsuya_groups_bridge(&bridge, &model[kept], &model[m], database, &pairs, photos);
            report_one(tsuya_json_add_object(array), &model[m], found ? &bridge : NULL);
        }
    }
    tsuya_pairs_free(&pairs);
    return TSUYA_OK;
}
