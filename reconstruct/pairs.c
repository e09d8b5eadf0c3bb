#include "reconstruct/pairs.h"

#include "core/file.h"
#include "core/image.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { SIDE = 64, CELLS = 8, ORIENTATIONS = 8, LENGTH = CELLS * CELLS * ORIENTATIONS };

tsuya_pairs_options tsuya_pairs_options_default(void)
{
    return (tsuya_pairs_options){.sequence = 4, .look_alike = 6, .all_up_to = 12, .verified_least = 4};
}

typedef struct box { int left, top, right, bottom; } box; /* right and bottom exclusive */

static box bounds_of(const tsuya_image *mask)
{
    box b = {mask->width_px, mask->height_px, 0, 0};
    for (int y = 0; y < mask->height_px; y++) {
        for (int x = 0; x < mask->width_px; x++) {
            if (tsuya_image_get(mask, x, y, 0) > 0.5f) {
                b = (box){x < b.left ? x : b.left, y < b.top ? y : b.top, x >= b.right ? x + 1 : b.right, y >= b.bottom ? y + 1 : b.bottom};
            }
        }
    }
    return b.right > b.left ? b : (box){0, 0, mask->width_px, mask->height_px};
}

/* SIDE × SIDE grey values of the box, outside the mask at the mean, by area averages. */
static tsuya_status thumbnail(float grey[SIDE][SIDE], const tsuya_photo *photo)
{
    tsuya_image image = {0}, small = {0}, mask = {0};
    tsuya_status status;
    enum { MIDDLE = 320 }; /* the longer side of what is cut from */
    TSUYA_GOTO_DONE(status, tsuya_image_load(&image, photo->path));
    int longer = image.width_px > image.height_px ? image.width_px : image.height_px;
    double scale = longer > MIDDLE ? (double)MIDDLE / longer : 1.0;
    int width = (int)fmax(1.0, image.width_px * scale), height = (int)fmax(1.0, image.height_px * scale);
    TSUYA_GOTO_DONE(status, tsuya_image_resize(&small, &image, width, height));
    box b = {0, 0, width, height};
    if (photo->mask_path) {
        tsuya_image_free(&image);
        TSUYA_GOTO_DONE(status, tsuya_image_load(&image, photo->mask_path));
        TSUYA_GOTO_DONE(status, tsuya_image_resize(&mask, &image, width, height));
        b = bounds_of(&mask);
    }
    double sum = 0.0;
    int inside = 0;
    for (int pass = 0; pass < 2; pass++) { /* the mean first: what is outside takes it */
        for (int j = 0; j < SIDE; j++) {
            for (int i = 0; i < SIDE; i++) {
                double x = b.left + (i + 0.5) * (b.right - b.left) / SIDE - 0.5, y = b.top + (j + 0.5) * (b.bottom - b.top) / SIDE - 0.5;
                float pixel[64], keep[64] = {1.0f};
                tsuya_image_sample_bilinear(&small, x, y, pixel);
                if (mask.data) {
                    tsuya_image_sample_bilinear(&mask, x, y, keep);
                }
                float value = small.channels >= 3 ? 0.2126f * pixel[0] + 0.7152f * pixel[1] + 0.0722f * pixel[2] : pixel[0];
                if (pass == 0 && keep[0] > 0.5f) {
                    sum += (double)value;
                    inside++;
                }
                grey[j][i] = keep[0] > 0.5f ? value : (float)(sum / (inside > 0 ? inside : 1));
            }
        }
    }
done:
    tsuya_image_free(&image);
    tsuya_image_free(&small);
    tsuya_image_free(&mask);
    return status;
}

static void normalise(float *v)
{
    double sum = 1e-12;
    for (int i = 0; i < LENGTH; i++) {
        sum += (double)(v[i] * v[i]);
    }
    for (int i = 0; i < LENGTH; i++) {
        v[i] = (float)((double)v[i] / sqrt(sum));
    }
}

static void describe(float *descriptor, float grey[SIDE][SIDE])
{
    memset(descriptor, 0, LENGTH * sizeof *descriptor);
    for (int y = 1; y + 1 < SIDE; y++) {
        for (int x = 1; x + 1 < SIDE; x++) {
            float dx = grey[y][x + 1] - grey[y][x - 1], dy = grey[y + 1][x] - grey[y - 1][x];
            double turn = (atan2((double)dy, (double)dx) / (2.0 * M_PI) + 1.0) * ORIENTATIONS;
            int bin = (int)turn;
            float part = (float)(turn - bin), size = hypotf(dx, dy);
            float *cell = descriptor + ((y * CELLS / SIDE) * CELLS + x * CELLS / SIDE) * ORIENTATIONS;
            cell[bin % ORIENTATIONS] += size * (1.0f - part);
            cell[(bin + 1) % ORIENTATIONS] += size * part;
        }
    }
    normalise(descriptor);
    for (int i = 0; i < LENGTH; i++) {
        descriptor[i] = fminf(descriptor[i], 0.2f); /* one strong edge must not decide */
    }
    normalise(descriptor);
}

static void choose(tsuya_pairs *p, int a, int b)
{
    if (a == b || p->chosen[a * p->photo_count + b]) {
        return;
    }
    p->chosen[a * p->photo_count + b] = p->chosen[b * p->photo_count + a] = 1;
    p->count++;
}

/* The `most` likest photographs of `a` that are not yet paired with it. */
static void choose_look_alikes(tsuya_pairs *p, int a, int most)
{
    int n = p->photo_count;
    for (int k = 0; k < most; k++) {
        int best = -1;
        for (int b = 0; b < n; b++) {
            if (b != a && !p->chosen[a * n + b] && (best < 0 || p->likeness[a * n + b] > p->likeness[a * n + best])) {
                best = b;
            }
        }
        if (best < 0) {
            return;
        }
        choose(p, a, best);
    }
}

static tsuya_status fill_likeness(tsuya_pairs *p, const tsuya_photo_set *photos, const tsuya_context *context)
{
    int n = photos->count;
    tsuya_failure failure = {0};
    int finished = 0;
    float *descriptor = tsuya_calloc((size_t)n, LENGTH * sizeof *descriptor);
    if (!descriptor) {
        return TSUYA_ERROR_MEMORY;
    }
#pragma omp parallel for schedule(dynamic) num_threads(context->threads)
    for (int i = 0; i < n; i++) {
        float grey[SIDE][SIDE];
        tsuya_status status = tsuya_interrupted() ? tsuya_check_interrupt() : thumbnail(grey, &photos->photo[i]);
        if (status == TSUYA_OK) {
            describe(descriptor + (size_t)i * LENGTH, grey);
        }
#pragma omp critical(tsuya_pairs)
        {
            tsuya_failure_keep(&failure, (size_t)i, status);
            finished++;
        }
        tsuya_progress_update(context, "pairs", finished, n, NULL);
    }
    for (int a = 0; a < n; a++) {
        for (int b = 0; b < n; b++) {
            double dot = 0.0;
            for (int k = 0; k < LENGTH; k++) {
                dot += (double)(descriptor[(size_t)a * LENGTH + k] * descriptor[(size_t)b * LENGTH + k]);
            }
            p->likeness[a * n + b] = (float)dot;
        }
    }
    tsuya_free(descriptor);
    return tsuya_failure_raise(&failure);
}

tsuya_status tsuya_pairs_create(tsuya_pairs *pairs, const tsuya_photo_set *photos, const tsuya_pairs_options *options,
                                const tsuya_context *context)
{
    int n = photos->count;
    tsuya_status status = TSUYA_OK;
    *pairs = (tsuya_pairs){.photo_count = n, .possible = n * (n - 1) / 2};
    TSUYA_NEW(status, pairs->chosen, (size_t)n * (size_t)n);
    TSUYA_NEW(status, pairs->likeness, (size_t)n * (size_t)n);
    TSUYA_GOTO_DONE(status, fill_likeness(pairs, photos, context));
    for (int a = 0; a < n; a++) {
        for (int d = 1; a + d < n; d++) {
            bool power = d > options->sequence && d <= 32 && (d & (d - 1)) == 0;
            if (n <= options->all_up_to || d <= options->sequence || power) {
                choose(pairs, a, a + d);
            }
        }
    }
    for (int a = 0; a < n; a++) {
        choose_look_alikes(pairs, a, options->look_alike);
    }
done:
    if (status != TSUYA_OK) {
        tsuya_pairs_free(pairs);
    }
    return status;
}

/* Label of every photograph's connected part, and the size of each part. */
static void label_parts(int *label, int *size, const uint8_t *verified, int n)
{
    for (int i = 0; i < n; i++) {
        label[i] = i;
    }
    for (bool changed = true; changed;) {
        changed = false;
        for (int a = 0; a < n; a++) {
            for (int b = 0; b < n; b++) {
                if (verified[a * n + b] && label[b] < label[a]) {
                    label[a] = label[b];
                    changed = true;
                }
            }
        }
    }
    memset(size, 0, (size_t)n * sizeof *size);
    for (int i = 0; i < n; i++) {
        size[label[i]]++;
    }
}

tsuya_status tsuya_pairs_extend(tsuya_pairs *pairs, int *added, const tsuya_database *database, const tsuya_photo_set *photos,
                                const tsuya_pairs_options *options)
{
    int n = pairs->photo_count, before = pairs->count;
    tsuya_status status = TSUYA_OK;
    uint8_t *verified = NULL;
    int *place = NULL, *label = NULL, *size = NULL;
    TSUYA_NEW(status, verified, (size_t)n * (size_t)n);
    TSUYA_NEW(status, place, (size_t)database->image_count);
    TSUYA_NEW(status, label, (size_t)n);
    TSUYA_NEW(status, size, (size_t)n);
    for (int i = 0; i < database->image_count; i++) {
        place[i] = -1;
        for (int k = 0; k < n; k++) {
            place[i] = strcmp(database->image[i].name, photos->photo[k].name) == 0 ? k : place[i];
        }
    }
    for (int i = 0; i < database->pair_count; i++) {
        int a = place[database->pair[i].a], b = place[database->pair[i].b];
        if (a >= 0 && b >= 0) {
            verified[a * n + b] = verified[b * n + a] = 1;
        }
    }
    label_parts(label, size, verified, n);
    int largest = 0;
    for (int i = 0; i < n; i++) {
        largest = size[i] > size[largest] ? i : largest;
    }
    for (int a = 0; a < n; a++) {
        int neighbours = 0;
        for (int b = 0; b < n; b++) {
            neighbours += verified[a * n + b];
        }
        if (neighbours >= options->verified_least && label[a] == largest) {
            continue;
        }
        for (int b = 0; b < n; b++) {
            for (int c = 0; verified[a * n + b] && c < n; c++) {
                if (verified[b * n + c]) {
                    choose(pairs, a, c);
                }
            }
        }
        choose_look_alikes(pairs, a, options->look_alike);
    }
    *added = pairs->count - before;
done:
    tsuya_free(verified);
    tsuya_free(place);
    tsuya_free(label);
    tsuya_free(size);
    return status;
}

tsuya_status tsuya_pairs_save(const tsuya_pairs *pairs, const tsuya_photo_set *photos, const char *path)
{
    tsuya_file_writer writer;
    TSUYA_TRY(tsuya_file_begin(&writer, path));
    for (int a = 0; a < pairs->photo_count; a++) {
        for (int b = a + 1; b < pairs->photo_count; b++) {
            if (pairs->chosen[a * pairs->photo_count + b]) {
                fprintf(writer.stream, "%s %s\n", photos->photo[a].name, photos->photo[b].name);
            }
        }
    }
    return tsuya_file_commit(&writer);
}

void tsuya_pairs_free(tsuya_pairs *pairs)
{
    tsuya_free(pairs->chosen);
    tsuya_free(pairs->likeness);
    *pairs = (tsuya_pairs){0};
}
