/* Time of one evaluation. */
#include "brdf/fit.h"

#include "core/memory.h"

enum { COUNT = 4096, RUNS = 12 };

static void fill(float *planes)
{
    for (int k = 0; k < COUNT; ++k) {
        for (int d = 0; d < 2; ++d) {
            double z = 0.05 + 0.95 * tsuya_random_uniform(1, 2 + (uint64_t)d, 2 * (uint64_t)k), r = sqrt(1.0 - z * z);
            double phi = 2.0 * M_PI * tsuya_random_uniform(1, 2 + (uint64_t)d, 2 * (uint64_t)k + 1);
            planes[(3 * d) * COUNT + k] = (float)(r * cos(phi));
            planes[(3 * d + 1) * COUNT + k] = (float)(r * sin(phi));
            planes[(3 * d + 2) * COUNT + k] = (float)z;
        }
    }
}

tsuya_status tsuya_material_time(double *ns, const tsuya_material *material)
{
    size_t channels = (size_t)tsuya_material_get_info(material).channel_count;
    float *planes = tsuya_calloc(COUNT * (6 + channels), sizeof *planes);
    if (!planes) {
        return TSUYA_ERROR_MEMORY;
    }
    fill(planes);
    const tsuya_direction_batch batch = {COUNT, planes, planes + COUNT, planes + 2 * COUNT, planes + 3 * COUNT, planes + 4 * COUNT, planes + 5 * COUNT};
    *ns = INFINITY;
    for (int run = 0; run < RUNS; ++run) {
        double started = tsuya_clock_s();
        tsuya_material_eval_batch(material, NULL, &batch, planes + 6 * COUNT);
        *ns = fmin(*ns, (tsuya_clock_s() - started) / COUNT * 1e9);
    }
    tsuya_free(planes);
    return TSUYA_OK;
}
