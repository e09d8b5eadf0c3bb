#include "calib/detect.h"

#include "calib/apriltag_adapter.h"
#include "calib/guided.h"
#include "calib/planar.h"
#include "core/file.h"
#include "core/order.h"

#include <omp.h>
#include <stdlib.h>
#include <string.h>

enum { NEIGHBOURS = 6, TONE_PHOTOS = 6 };
/* Above this size quads are looked for at half resolution; the refinement makes good for it. */
static const double DECIMATE_FROM_PX = 0.8e6;

typedef struct candidate {
    tsuya_tag_sighting seen;
    int tag;          /* index in the board */
    tsuya_mat3 image_from_plate;
    tsuya_vec2 middle_px, middle_m;
    double size_px;
    double votes;
    bool kept;
} candidate;

static tsuya_vec2 mean4(const tsuya_vec2 p[4])
{
    return (tsuya_vec2){0.25 * (p[0].x + p[1].x + p[2].x + p[3].x), 0.25 * (p[0].y + p[1].y + p[2].y + p[3].y)};
}

/* Known ids with a homography each. */
static int take_known(candidate *out, const tsuya_tag_sighting *seen, int count, const tsuya_board *board, tsuya_detect_counts *rejected)
{
    int n = 0;
    for (int i = 0; i < count; i++) {
        candidate c = {.seen = seen[i], .tag = tsuya_board_find(board, seen[i].id), .kept = true};
        if (c.tag < 0) {
            rejected->foreign++;
            continue;
        }
        const tsuya_board_tag *tag = &board->tag[c.tag];
        if (!tsuya_homography_fit(&c.image_from_plate, tag->corner_m, seen[i].corner_px, 4)) {
            rejected->misplaced++;
            continue;
        }
        c.middle_px = mean4(seen[i].corner_px);
        c.middle_m = mean4(tag->corner_m);
        c.size_px = hypot(seen[i].corner_px[2].x - seen[i].corner_px[0].x, seen[i].corner_px[2].y - seen[i].corner_px[0].y) / M_SQRT2;
        out[n++] = c;
    }
    return n;
}

/* Does tag a, carried on by its own homography, say where b is?  The farther, the less. */
static bool agrees(const candidate *a, const candidate *b, double tag_m)
{
    double apart_tags = hypot(a->middle_m.x - b->middle_m.x, a->middle_m.y - b->middle_m.y) / tag_m;
    tsuya_vec2 p = tsuya_homography_apply(a->image_from_plate, b->middle_m);
    return hypot(p.x - b->middle_px.x, p.y - b->middle_px.y) < 0.35 * apart_tags * a->size_px;
}

/* Share of the nearest tags of the same plate that agree. */
static double vote(const candidate *all, int n, int self, const tsuya_board *board)
{
    const candidate *me = &all[self];
    const tsuya_board_tag *tag = &board->tag[me->tag];
    double tag_m = tag->corner_m[1].x - tag->corner_m[0].x, nearest[NEIGHBOURS];
    int index[NEIGHBOURS], count = 0, fine = 0;
    for (int i = 0; i < n; i++) {
        if (!all[i].kept || all[i].tag == me->tag || board->tag[all[i].tag].plate != tag->plate) {
            continue;
        }
        double d = hypot(all[i].middle_m.x - me->middle_m.x, all[i].middle_m.y - me->middle_m.y);
        int at = count < NEIGHBOURS ? count++ : d < nearest[NEIGHBOURS - 1] ? NEIGHBOURS - 1 : -1;
        for (; at > 0 && nearest[at - 1] > d; at--) {
            nearest[at] = nearest[at - 1];
            index[at] = index[at - 1];
        }
        if (at >= 0) {
            nearest[at] = d;
            index[at] = i;
        }
    }
    for (int k = 0; k < count; k++) {
        fine += agrees(&all[index[k]], me, tag_m) && agrees(me, &all[index[k]], tag_m);
    }
    return count ? (double)fine / count : -1.0; /* nobody to ask */
}

/* Leaves out what its neighbours do not know, worst first; then the weaker of two tags with one id. */
static void check_places(candidate *all, int n, const tsuya_board *board, tsuya_detect_counts *rejected)
{
    for (;;) {
        int worst = -1;
        for (int i = 0; i < n; i++) {
            all[i].votes = all[i].kept ? vote(all, n, i, board) : 1.0;
            if (all[i].kept && all[i].votes >= 0.0 && all[i].votes < 0.5 && (worst < 0 || all[i].votes < all[worst].votes)) {
                worst = i;
            }
        }
        if (worst < 0) {
            break;
        }
        all[worst].kept = false;
        rejected->misplaced++;
    }
    for (int i = 0; i < n; i++) {
        for (int k = i + 1; k < n; k++) {
            if (all[i].kept && all[k].kept && all[i].tag == all[k].tag) {
                bool both = all[i].votes == all[k].votes;
                all[i].kept = !both && all[i].votes > all[k].votes;
                all[k].kept = !both && !all[i].kept;
                rejected->twice += both ? 2 : 1;
            }
        }
    }
}

/* What is found in one photograph, before refinement. */
typedef struct found {
    tsuya_tag_sighting *seen;
    int count, cells;
    tsuya_image grey; /* float */
    tsuya_detect_counts rejected;
    double seconds;
} found;

static void found_free(found *f)
{
    tsuya_free(f->seen);
    tsuya_image_free(&f->grey);
    *f = (found){0};
}

static tsuya_status keep_trusted(found *f, const tsuya_board *board)
{
    candidate *all = tsuya_calloc((size_t)f->count, sizeof *all);
    if (!all) {
        return TSUYA_ERROR_MEMORY;
    }
    int n = take_known(all, f->seen, f->count, board, &f->rejected);
    check_places(all, n, board, &f->rejected);
    tsuya_tag_sighting *kept = tsuya_calloc((size_t)board->tag_count, sizeof *kept);
    f->count = 0;
    for (int i = 0; kept && i < n; i++) {
        if (all[i].kept) {
            kept[f->count++] = all[i].seen;
        }
    }
    tsuya_free(f->seen);
    f->seen = kept;
    tsuya_free(all);
    return kept ? TSUYA_OK : TSUYA_ERROR_MEMORY;
}

static tsuya_status make_detector(tsuya_tag_detector **detector, const tsuya_board *board)
{
    return tsuya_tag_detector_create(detector, &(tsuya_tag_detector_options){board->family, board->border_bits, 1.0});
}

/* What the image shows of the board, before refinement; `f` is empty. */
static tsuya_status look(found *f, tsuya_tag_detector *detector, const tsuya_board *board, const tsuya_image *image)
{
    tsuya_image grey8 = {0};
    tsuya_status status;
    tsuya_tag_detector_decimate(detector, (double)image->width_px * image->height_px > DECIMATE_FROM_PX ? 2.0 : 1.0);
    TSUYA_GOTO_DONE(status, tsuya_image_grey(&grey8, image, TSUYA_SAMPLE_U8));
    TSUYA_GOTO_DONE(status, tsuya_tag_detect(&f->seen, &f->count, detector, &grey8));
    tsuya_image_free(&grey8);
    TSUYA_GOTO_DONE(status, keep_trusted(f, board));
    TSUYA_GOTO_DONE(status, tsuya_guided_search(f->seen, &f->count, board, &f->grey));
done:
    tsuya_image_free(&grey8);
    return status;
}

/* `before`: what a first look at the same image found, or NULL; it is taken over. */
static tsuya_status find_tags(found *f, found *before, tsuya_tag_detector *detector, const tsuya_board *board, const tsuya_image *image)
{
    *f = (found){.cells = tsuya_tag_detector_cells(detector)};
    tsuya_status status = tsuya_image_grey(&f->grey, image, TSUYA_SAMPLE_F32);
    if (status == TSUYA_OK && before && before->seen) {
        f->seen = before->seen;
        f->count = before->count;
        f->rejected = before->rejected;
        *before = (found){0};
    } else if (status == TSUYA_OK) {
        status = look(f, detector, board, image);
    }
    if (status != TSUYA_OK) {
        found_free(f);
    }
    return status;
}

static tsuya_status summarise(tsuya_detect_report *report, const tsuya_refined_tag *tag, int count)
{
    double *blur = tsuya_calloc(4 * (size_t)count, sizeof *blur);
    if (!blur) {
        return TSUYA_ERROR_MEMORY;
    }
    int n = 0;
    for (int i = 0; i < 4 * count; i++) {
        if (isfinite(tag[i / 4].blur_px[i % 4])) {
            blur[n++] = tag[i / 4].blur_px[i % 4];
        }
    }
    if (n) {
        tsuya_sort_doubles(blur, (size_t)n);
    }
    report->blur_px = n ? blur[n / 2] : NAN;
    report->blur_high_px = n ? blur[n * 9 / 10] : NAN;
    tsuya_free(blur);
    return TSUYA_OK;
}

/* Refined corners of one photograph, appended. */
static tsuya_status refine(tsuya_corner_set *corners, tsuya_detect_report *report, const found *f, const tsuya_board *board, int photo,
                           const tsuya_edge_look *look)
{
    tsuya_refined_tag *tag = tsuya_calloc((size_t)f->count, sizeof *tag);
    tsuya_refine_options options = {f->cells, board->border_bits, *look, 0.8};
    tsuya_refine_info info;
    tsuya_status status = tag ? tsuya_refine_tags(tag, &info, &f->grey, f->seen, f->count, &options) : TSUYA_ERROR_MEMORY;
    report->rejected = f->rejected;
    for (int i = 0; status == TSUYA_OK && i < f->count; i++) {
        int fine = 0;
        for (int c = 0; c < 4 && status == TSUYA_OK; c++) {
            if (isfinite(tag[i].sigma_px[c])) {
                fine++;
                tsuya_corner corner = {photo, f->seen[i].id, c, tag[i].corner_px[c].x, tag[i].corner_px[c].y, tag[i].sigma_px[c],
                                       tag[i].spread_px[c].x, tag[i].spread_px[c].y};
                status = tsuya_corner_set_add(corners, corner);
            }
            report->rejected.edges += tag[i].edge[c] != TSUYA_REFINE_FINE;
        }
        report->tags += fine > 0;
        report->corners += fine;
    }
    if (status == TSUYA_OK) {
        status = summarise(report, tag, f->count);
    }
    tsuya_free(tag);
    return status;
}

static tsuya_status detect_image(tsuya_corner_set *corners, tsuya_detect_report *report, tsuya_tag_detector *detector, found *before, const tsuya_board *board,
                                 const tsuya_image *image, int photo, const tsuya_edge_look *look)
{
    found f;
    tsuya_edge_look own;
    double start_s = tsuya_clock_s();
    *report = (tsuya_detect_report){0};
    TSUYA_TRY(find_tags(&f, before, detector, board, image));
    if (!look) {
        tsuya_refine_tone tone = tsuya_refine_estimate_tone(&f.grey, f.seen, f.count, f.cells, board->border_bits);
        own = tsuya_refine_common_look(&tone, 1);
        look = &own;
    }
    tsuya_status status = refine(corners, report, &f, board, photo, look);
    found_free(&f);
    report->seconds = tsuya_clock_s() - start_s;
    return status;
}

tsuya_status tsuya_detect_image(tsuya_corner_set *corners, tsuya_detect_report *report, const tsuya_board *board, const tsuya_image *image,
                                int photo, const tsuya_edge_look *look)
{
    tsuya_tag_detector *detector;
    TSUYA_TRY(make_detector(&detector, board));
    tsuya_status status = detect_image(corners, report, detector, NULL, board, image, photo, look);
    tsuya_tag_detector_free(detector);
    return status;
}

/* The loop over photographs. */
typedef struct work {
    const tsuya_board *board;
    const char *const *paths;
    int count;
    tsuya_corner_set *part; /* one a photograph */
    tsuya_detect_report *report;
    int *width_px, *height_px;
    double *read_s;
    found *first;                  /* one a photograph: what the look for the tone found, without its image */
    tsuya_tag_detector **detector; /* one a thread, made when it is needed */
    int threads;
    tsuya_edge_look look;
} work;

static void work_free(work *w)
{
    for (int i = 0; w->part && i < w->count; i++) {
        tsuya_corner_set_free(&w->part[i]);
    }
    for (int i = 0; w->first && i < w->count; i++) {
        found_free(&w->first[i]);
    }
    for (int t = 0; w->detector && t < w->threads; t++) {
        tsuya_tag_detector_free(w->detector[t]);
    }
    tsuya_free(w->first);
    tsuya_free(w->detector);
    tsuya_free(w->part);
    tsuya_free(w->width_px);
    tsuya_free(w->read_s);
}

static tsuya_status my_detector(tsuya_tag_detector **detector, work *w)
{
    tsuya_tag_detector **mine = &w->detector[omp_get_thread_num()];
    tsuya_status status = *mine ? TSUYA_OK : make_detector(mine, w->board);
    *detector = *mine;
    return status;
}

static tsuya_status load(tsuya_image *image, work *w, int i)
{
    double start_s = tsuya_clock_s();
    TSUYA_TRY(tsuya_check_interrupt());
    TSUYA_TRY(tsuya_image_load(image, w->paths[i]));
    w->read_s[i] += tsuya_clock_s() - start_s;
    w->width_px[i] = image->width_px;
    w->height_px[i] = image->height_px;
    return TSUYA_OK;
}

static tsuya_status one_tone(tsuya_refine_tone *tone, work *w, int i)
{
    tsuya_image image;
    found *f = &w->first[i];
    tsuya_tag_detector *detector;
    TSUYA_TRY(my_detector(&detector, w));
    TSUYA_TRY(load(&image, w, i));
    double start_s = tsuya_clock_s();
    tsuya_status status = find_tags(f, NULL, detector, w->board, &image);
    tsuya_image_free(&image);
    if (status == TSUYA_OK) {
        *tone = tsuya_refine_estimate_tone(&f->grey, f->seen, f->count, f->cells, w->board->border_bits);
        tsuya_image_free(&f->grey);
    }
    f->seconds = tsuya_clock_s() - start_s;
    return status;
}

static tsuya_status find_look(work *w, const tsuya_context *context)
{
    tsuya_refine_tone tone[TONE_PHOTOS];
    tsuya_failure failure = {0};
    int used = w->count < TONE_PHOTOS ? w->count : TONE_PHOTOS;
#pragma omp parallel for schedule(dynamic, 1) num_threads(context->threads)
    for (int k = 0; k < used; k++) {
        tone[k] = TSUYA_REFINE_TONE_UNKNOWN;
        tsuya_status status = one_tone(&tone[k], w, (int)((long long)k * w->count / used));
        if (status != TSUYA_OK) {
#pragma omp critical(tsuya_detect)
            tsuya_failure_keep(&failure, (size_t)k, status);
        }
    }
    TSUYA_TRY(tsuya_failure_raise(&failure));
    w->look = tsuya_refine_common_look(tone, used);
    return TSUYA_OK;
}

static tsuya_status one_photo(work *w, int i)
{
    tsuya_image image;
    tsuya_tag_detector *detector;
    double earlier_s = w->first[i].seconds;
    TSUYA_TRY(my_detector(&detector, w));
    TSUYA_TRY(load(&image, w, i));
    tsuya_status status = detect_image(&w->part[i], &w->report[i], detector, &w->first[i], w->board, &image, i, &w->look);
    w->report[i].seconds += earlier_s;
    tsuya_image_free(&image);
    return status;
}

static tsuya_status all_photos(work *w, const tsuya_context *context)
{
    tsuya_failure failure = {0};
    int done = 0;
#pragma omp parallel for schedule(dynamic, 1) num_threads(context->threads)
    for (int i = 0; i < w->count; i++) {
        tsuya_status status = one_photo(w, i);
#pragma omp critical(tsuya_detect)
        {
            if (status != TSUYA_OK) {
                tsuya_failure_keep(&failure, (size_t)i, status);
            }
            tsuya_progress_update(context, "tags", ++done, w->count, tsuya_path_name(w->paths[i]));
        }
    }
    return tsuya_failure_raise(&failure);
}

static int compare_paths(const void *pa, const void *pb)
{
    return strcmp(tsuya_path_name(*(const char *const *)pa), tsuya_path_name(*(const char *const *)pb));
}

static tsuya_status check_sizes(const work *w, tsuya_detect_info *info)
{
    for (int i = 1; i < w->count; i++) {
        if (w->width_px[i] != w->width_px[0] || w->height_px[i] != w->height_px[0]) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s is %d x %d px, %s is %d x %d px; photographs of one size are expected", w->paths[0],
                              w->width_px[0], w->height_px[0], w->paths[i], w->width_px[i], w->height_px[i]);
        }
    }
    info->width_px = w->width_px[0];
    info->height_px = w->height_px[0];
    return TSUYA_OK;
}

static tsuya_status gather(tsuya_corner_set *corners, tsuya_detect_info *info, const work *w)
{
    const char **name = tsuya_calloc((size_t)w->count, sizeof *name);
    if (!name) {
        return TSUYA_ERROR_MEMORY;
    }
    tsuya_status status = TSUYA_OK;
    for (int i = 0; i < w->count; i++) {
        name[i] = tsuya_path_name(w->paths[i]);
        if (i && status == TSUYA_OK && strcmp(name[i], name[i - 1]) == 0) {
            status = tsuya_fail(TSUYA_ERROR_INPUT, "%s and %s have the same name; names of their own are expected", w->paths[i - 1], w->paths[i]);
        }
    }
    if (status == TSUYA_OK) {
        status = tsuya_corner_set_create(corners, name, w->count);
    }
    tsuya_free(name);
    for (int i = 0; i < w->count && status == TSUYA_OK; i++) {
        for (int c = 0; c < w->part[i].count && status == TSUYA_OK; c++) {
            status = tsuya_corner_set_add(corners, w->part[i].corner[c]);
        }
        info->seconds_read += w->read_s[i];
        info->seconds_detect += w->report[i].seconds;
    }
    tsuya_corner_set_sort(corners);
    return status;
}

tsuya_status tsuya_detect_photos(tsuya_corner_set *corners, tsuya_detect_info *info, const tsuya_board *board, const char *const *paths, int count,
                                 const tsuya_context *context)
{
    work w = {.board = board, .count = count, .threads = context->threads};
    tsuya_status status = TSUYA_OK;
    const char **sorted = NULL;
    *corners = (tsuya_corner_set){0};
    *info = (tsuya_detect_info){0};
    if (count < 1) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "no photographs");
    }
    TSUYA_NEW(status, sorted, (size_t)count);
    TSUYA_NEW(status, w.part, (size_t)count);
    TSUYA_NEW(status, info->report, (size_t)count);
    TSUYA_NEW(status, w.width_px, 2 * (size_t)count);
    TSUYA_NEW(status, w.read_s, (size_t)count);
    TSUYA_NEW(status, w.first, (size_t)count);
    TSUYA_NEW(status, w.detector, (size_t)w.threads);
    memcpy(sorted, paths, (size_t)count * sizeof *sorted);
    qsort(sorted, (size_t)count, sizeof *sorted, compare_paths);
    w.paths = sorted;
    w.height_px = w.width_px + count;
    w.report = info->report;
    TSUYA_GOTO_DONE(status, find_look(&w, context));
    TSUYA_GOTO_DONE(status, all_photos(&w, context));
    TSUYA_GOTO_DONE(status, check_sizes(&w, info));
    info->look = w.look;
    TSUYA_GOTO_DONE(status, gather(corners, info, &w));
done:
    work_free(&w);
    tsuya_free(sorted);
    if (status != TSUYA_OK) {
        tsuya_corner_set_free(corners);
        tsuya_detect_info_free(info);
    }
    return status;
}

void tsuya_detect_info_free(tsuya_detect_info *info)
{
    tsuya_free(info->report);
    *info = (tsuya_detect_info){0};
}
