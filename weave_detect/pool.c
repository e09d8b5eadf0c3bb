/* Neighbouring windows show the same cloth: its threads, their periods, its shear.  What they believe is each window's prior. */
#include "weave_detect/detector.h"

#include "core/memory.h"

#include <math.h>

enum { REACH = 2 };
static const double ALIKE_RAD = 8.0 * M_PI / 180.0, ALIKE_PERIOD = 0.15;
static const double STRANGER = 0.08; /* the weight of an alternative that no neighbour has */

static bool is_alike(const tsuya_alternative *a, int i, const tsuya_alternative *b, int j)
{
    return fabs(a->length[i] - b->length[j]) < ALIKE_PERIOD * b->length[j] && tsuya_line_difference(a->angle_rad[i], b->angle_rad[j]) < ALIKE_RAD;
}

static double support(const tsuya_alternative *a, const tsuya_finding *other)
{
    double sum = 0.0;
    for (int k = 0; k < other->count; k++) {
        const tsuya_alternative *b = &other->alternative[k];
        bool alike = (is_alike(a, 0, b, 0) && is_alike(a, 1, b, 1)) || (is_alike(a, 0, b, 1) && is_alike(a, 1, b, 0));
        sum += alike ? (double)b->probability : 0.0;
    }
    return sum;
}

static void weigh(float *probability, const tsuya_finding *list, int columns, int rows, int column, int row)
{
    const tsuya_finding *own = &list[row * columns + column];
    double sum[TSUYA_ALTERNATIVES] = {0.0}, neighbours = 0.0, all = (double)own->none_probability;
    for (int j = -REACH; j <= REACH; j++) {
        for (int i = -REACH; i <= REACH; i++) {
            int x = column + i, y = row + j;
            if ((i == 0 && j == 0) || x < 0 || y < 0 || x >= columns || y >= rows || list[y * columns + x].empty) {
                continue;
            }
            double weight = 1.0 / (i * i + j * j);
            neighbours += weight;
            for (int k = 0; k < own->count; k++) {
                sum[k] += weight * support(&own->alternative[k], &list[y * columns + x]);
            }
        }
    }
    double trust = neighbours / (neighbours + 1.0), typical = 0.0;
    for (int k = 0; k < own->count; k++) {
        typical = fmax(typical, neighbours > 0.0 ? sum[k] / neighbours : 0.0);
    }
    for (int k = 0; k < own->count; k++) {
        double prior = neighbours > 0.0 ? 1.0 - trust * typical + trust * sum[k] / neighbours : 1.0;
        probability[k] = own->alternative[k].probability * (float)fmax(prior, STRANGER);
        all += (double)probability[k];
    }
    probability[TSUYA_ALTERNATIVES] = (float)((double)own->none_probability / all);
    for (int k = 0; k < own->count; k++) {
        probability[k] = (float)((double)probability[k] / all);
    }
}

static void sort(tsuya_finding *f)
{
    for (int k = 1; k < f->count; k++) {
        for (int i = k; i > 0 && f->alternative[i - 1].probability < f->alternative[i].probability; i--) {
            tsuya_alternative swap = f->alternative[i];
            f->alternative[i] = f->alternative[i - 1];
            f->alternative[i - 1] = swap;
        }
    }
}

tsuya_status tsuya_findings_pool(tsuya_finding *list, int columns, int rows)
{
    enum { ROW = TSUYA_ALTERNATIVES + 1 };
    float *probability = tsuya_calloc((size_t)columns * (size_t)rows * ROW, sizeof *probability);
    if (!probability) {
        return TSUYA_ERROR_MEMORY;
    }
    for (int i = 0; i < columns * rows; i++) {
        weigh(probability + ROW * i, list, columns, rows, i % columns, i / columns);
    }
    for (int i = 0; i < columns * rows; i++) {
        for (int k = 0; k < list[i].count; k++) {
            list[i].alternative[k].probability = probability[ROW * i + k];
        }
        list[i].none_probability = probability[ROW * i + TSUYA_ALTERNATIVES];
        sort(&list[i]);
        tsuya_finding_believe(&list[i]);
    }
    tsuya_free(probability);
    return TSUYA_OK;
}
