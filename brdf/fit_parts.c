#include "brdf/fit_parts.h"

#include "brdf/sheen.h"
#include "core/context.h"
#include "core/memory.h"
#include "core/order.h"

#include <string.h>

/* Groups are whole tenths of a degree: finer differences are the bench's own scatter. */
static int tenths(double rad) { return (int)lround(tsuya_deg_from_rad(rad) * 10.0); }

/* Rank of every key among the different keys; returns how many there are. */
static tsuya_status rank_keys(int *rank, int *groups, const int *key, int count)
{
    int *sorted = tsuya_calloc((size_t)count, sizeof *sorted), unique = 0;
    if (!sorted) {
        return TSUYA_ERROR_MEMORY;
    }
    memcpy(sorted, key, (size_t)count * sizeof *sorted);
    tsuya_sort_ints(sorted, (size_t)count);
    for (int k = 0; k < count; ++k) {
        if (k == 0 || sorted[k] != sorted[unique - 1]) {
            sorted[unique++] = sorted[k];
        }
    }
    for (int k = 0; k < count; ++k) {
        rank[k] = (int)tsuya_rank_of_int(sorted, (size_t)unique, key[k]);
    }
    *groups = unique;
    tsuya_free(sorted);
    return TSUYA_OK;
}

static void half_keys(int *ring, int *azimuth, const tsuya_samples *s)
{
    for (int k = 0; k < s->count; ++k) {
        tsuya_half_angles a = tsuya_half_angles_of(s->wi[k], s->wo[k]);
        ring[k] = tenths(a.theta_h);
        int t = tenths(a.phi_h);
        azimuth[k] = ring[k] < 5 ? -1 : (t % 1800 + 1800) % 1800; /* the pole belongs to every azimuth */
        azimuth[k] = s->azimuth_deg ? (int)lround(fmod(fmod(s->azimuth_deg[k], 180.0) + 180.0, 180.0) * 10.0) % 1800 : azimuth[k];
    }
}

tsuya_status tsuya_fit_part(unsigned char *mask, int *count, const tsuya_samples *s, tsuya_fit_part_kind kind)
{
    int groups, *key = tsuya_calloc((size_t)s->count * 3, sizeof *key);
    if (!key) {
        return TSUYA_ERROR_MEMORY;
    }
    int *ring = key, *azimuth = key + s->count, *rank = azimuth + s->count;
    half_keys(ring, azimuth, s);
    tsuya_status status = rank_keys(rank, &groups, kind == TSUYA_FIT_AZIMUTH ? azimuth : ring, s->count);
    *count = 0;
    int kept = 0;
    for (int k = 0; k < s->count && status == TSUYA_OK; ++k) {
        bool left_out = kind == TSUYA_FIT_AZIMUTH ? rank[k] == groups - 1 : rank[k] % 5 == 2;
        mask[k] = groups >= 3 && (kind != TSUYA_FIT_AZIMUTH || groups <= 64) && left_out;
        *count += mask[k];
        kept += !mask[k];
    }
    if (kept < 4) {
        *count = 0;
    }
    tsuya_free(key);
    return status;
}

tsuya_status tsuya_samples_draw(tsuya_samples *part, const tsuya_samples *samples, int count)
{
    unsigned char *keep = tsuya_calloc((size_t)samples->count, 1);
    if (!keep) {
        return TSUYA_ERROR_MEMORY;
    }
    double share = (double)count / samples->count;
    for (int k = 0; k < samples->count; ++k) {
        keep[k] = share >= 1.0 || tsuya_random_uniform(17, 3, (uint64_t)k) < share;
    }
    tsuya_status status = tsuya_samples_copy(part, samples, keep);
    tsuya_free(keep);
    return status;
}
