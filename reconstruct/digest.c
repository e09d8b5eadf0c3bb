#include "reconstruct/digest.h"

#include "core/matching.h"
#include "core/memory.h"

#include <string.h>

enum {
    SURE = 50,      /* verified matches of a pair that hangs together: threads, all alike, give up to 45 by chance */
    DIGEST = 500,   /* features */
    LEAST = 10,     /* matches of a digest that are worth a look */
    PARTNERS = 4,   /* of a photograph at most */
};

typedef struct digest {
    tsuya_pairs *pairs;
    const tsuya_database *database;
    const char *base;
    const tsuya_context *context;
    int *image, *part, *count; /* of the database, −1: none; by photograph; matches, photo_count × photo_count */
    int largest;
} digest;

static int part_of(const int *part, int i)
{
    while (part[i] != i) {
        i = part[i];
    }
    return i;
}

/* Parts by sure pairs, named by their first photograph; the largest, of equals the first. */
static void find_parts(digest *d, const int *photo_of_image)
{
    const int n = d->pairs->photo_count;
    int most = 0;
    for (int i = 0; i < n; i++) {
        d->part[i] = i;
    }
    for (int k = 0; k < d->database->pair_count; k++) {
        int a = photo_of_image[d->database->pair[k].a], b = photo_of_image[d->database->pair[k].b];
        if (a >= 0 && b >= 0 && d->database->pair[k].inliers >= SURE) {
            a = part_of(d->part, a);
            b = part_of(d->part, b);
            d->part[a > b ? a : b] = a > b ? b : a;
        }
    }
    for (int i = 0; i < n; i++) {
        d->part[i] = part_of(d->part, i);
    }
    for (int i = 0; i < n; i++) {
        int size = 0;
        for (int j = 0; j < n; j++) {
            size += d->part[j] == i;
        }
        d->largest = size > most ? i : d->largest;
        most = size > most ? size : most;
    }
}

/* COLMAP lists features from the smallest to the largest. */
static tsuya_sift largest_of(const tsuya_sift *f)
{
    int from = f->count > DIGEST ? f->count - DIGEST : 0;
    return (tsuya_sift){f->count - from, f->position + from, f->descriptor + (size_t)from * TSUYA_DESCRIPTOR_LENGTH};
}

static tsuya_status compare(int *count, const tsuya_sift *a, const tsuya_sift *b, int threads)
{
    tsuya_match *match = NULL;
    tsuya_sift of_a = largest_of(a), of_b = largest_of(b);
    int back;
    TSUYA_TRY(tsuya_match_features(&match, count, &of_a, b, NULL, threads));
    tsuya_free(match);
    TSUYA_TRY(tsuya_match_features(&match, &back, a, &of_b, NULL, threads));
    tsuya_free(match);
    *count = back > *count ? back : *count;
    return TSUYA_OK;
}

/* One photograph against all that it does not hang together with. */
static tsuya_status look_from(digest *d, int i)
{
    const int n = d->pairs->photo_count;
    tsuya_sift own = {0}, other = {0};
    tsuya_status status;
    TSUYA_GOTO_DONE(status, tsuya_sift_load(&own, d->base, d->database->image[d->image[i]].image_id));
    for (int j = 0; j < n; j++) {
        bool seen = j < i && d->part[j] != d->largest; /* from there */
        if (d->part[j] == d->part[i] || d->pairs->chosen[i * n + j] || d->image[j] < 0 || seen) {
            continue;
        }
        TSUYA_GOTO_DONE(status, tsuya_check_interrupt());
        TSUYA_GOTO_DONE(status, tsuya_sift_load(&other, d->base, d->database->image[d->image[j]].image_id));
        TSUYA_GOTO_DONE(status, compare(&d->count[i * n + j], &own, &other, d->context->threads));
        d->count[j * n + i] = d->count[i * n + j];
        tsuya_sift_free(&other);
    }
done:
    tsuya_sift_free(&own);
    tsuya_sift_free(&other);
    return status;
}

static void choose_for(digest *d, int i)
{
    const int n = d->pairs->photo_count;
    for (int k = 0; k < PARTNERS; k++) {
        int best = -1, most = LEAST - 1;
        for (int j = 0; j < n; j++) {
            if (d->count[i * n + j] > most && !d->pairs->chosen[i * n + j]) {
                most = d->count[i * n + j];
                best = j;
            }
        }
        if (best < 0) {
            return;
        }
        d->pairs->chosen[i * n + best] = d->pairs->chosen[best * n + i] = 1;
        d->pairs->count++;
    }
}

tsuya_status tsuya_digest_pairs(tsuya_pairs *pairs, int *added, const tsuya_database *database, const char *base, const tsuya_photo_set *photos,
                                const tsuya_context *context)
{
    const int n = pairs->photo_count, before = pairs->count;
    digest d = {.pairs = pairs, .database = database, .base = base, .context = context};
    tsuya_status status = TSUYA_OK;
    int *photo_of_image = NULL;
    TSUYA_NEW(status, photo_of_image, (size_t)database->image_count + 1);
    TSUYA_NEW(status, d.image, (size_t)n);
    TSUYA_NEW(status, d.part, (size_t)n);
    TSUYA_NEW(status, d.count, (size_t)n * (size_t)n);
    for (int i = 0; i < n; i++) {
        d.image[i] = -1;
    }
    for (int k = 0; k < database->image_count; k++) {
        photo_of_image[k] = -1;
        for (int i = 0; i < n; i++) {
            if (strcmp(database->image[k].name, photos->photo[i].name) == 0) {
                photo_of_image[k] = i;
                d.image[i] = k;
            }
        }
    }
    find_parts(&d, photo_of_image);
    for (int i = 0; i < n; i++) {
        tsuya_progress_update(context, "details", i, n, photos->photo[i].name);
        if (d.part[i] != d.largest && d.image[i] >= 0) {
            TSUYA_GOTO_DONE(status, look_from(&d, i));
        }
    }
    for (int i = 0; i < n; i++) {
        if (d.part[i] != d.largest && d.image[i] >= 0) {
            choose_for(&d, i);
        }
    }
    *added = pairs->count - before;
done:
    tsuya_free(photo_of_image);
    tsuya_free(d.image);
    tsuya_free(d.part);
    tsuya_free(d.count);
    return status;
}
