/* Klems matrices (LBNL WINDOW, genBSDF): reflection of the front side, full basis of 145 × 145 patches, visible band, as samples at
 * the patches' centres.
 *
 * Row = outgoing, column = incoming patch; the same index is the mirror direction, so an outgoing patch lies at (θ, φ) and the
 * light of the incoming one at (θ, φ + 180°). */
#include "brdf/samples_internal.h"

#include "core/table.h"

#include <stdlib.h>
#include <string.h>

enum { RINGS = 9, PATCHES = 145 };
static const double ring_deg[RINGS] = {0, 10, 20, 30, 40, 50, 60, 70, 82.5};
static const int ring_patches[RINGS] = {1, 8, 16, 20, 24, 24, 24, 16, 12};

static tsuya_vec3 patch_direction(int patch, double turn_deg)
{
    int ring = 0;
    while (patch >= ring_patches[ring]) {
        patch -= ring_patches[ring++];
    }
    double t = tsuya_rad_from_deg(ring_deg[ring]), p = tsuya_rad_from_deg(360.0 * patch / ring_patches[ring] + turn_deg);
    return (tsuya_vec3){sin(t) * cos(p), sin(t) * sin(p), cos(t)};
}

/* The text between <tag> and </tag> that follows `from`; NULL where there is none. */
static const char *element(const char *from, const char *open_tag)
{
    const char *at = from ? strstr(from, open_tag) : NULL;
    return at ? at + strlen(open_tag) : NULL;
}

static const char *find_matrix(const char *text)
{
    for (const char *block = element(text, "<WavelengthData>"); block; block = element(block, "<WavelengthData>")) {
        const char *end = strstr(block, "</WavelengthData>"), *visible = strstr(block, ">Visible<");
        const char *side = strstr(block, "<WavelengthDataDirection>Reflection Front<"), *data = element(block, "<ScatteringData>");
        if (end && visible && visible < end && side && side < end && data && data < end) {
            return data;
        }
    }
    return NULL;
}

tsuya_status tsuya_samples_from_klems(tsuya_samples *samples, const char *text, const char *name)
{
    static const char *const channel[] = {"visible"};
    const char *at = find_matrix(text);
    if (!at || !strstr(text, "LBNL/Klems Full")) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: no visible front reflection in the basis LBNL/Klems Full", name);
    }
    TSUYA_TRY(tsuya_samples_create(samples, PATCHES * PATCHES, 1, channel));
    for (int k = 0; k < PATCHES * PATCHES; ++k) {
        char *end;
        double value = strtod(at, &end);
        if (end == at || !isfinite(value) || value < 0.0) {
            tsuya_samples_free(samples);
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: row %d, column %d of the reflection matrix: expected a number ≥ 0", name, k / PATCHES + 1,
                              k % PATCHES + 1);
        }
        samples->wo[k] = patch_direction(k / PATCHES, 0.0);
        samples->wi[k] = patch_direction(k % PATCHES, 180.0);
        samples->value[k] = value;
        at = end + strspn(end, ", \t\r\n");
    }
    return TSUYA_OK;
}
