/* Neighbouring windows show the same cloth: its threads, their periods, its shear.  What they believe is each window's prior. */
#include "weave_detect/detector.h"

#include "core/memory.h"

#include <math.h>

enum { REACH = 2 };
static const double ALIKE_RAD = 8.0 * M_PI / 180.0, ALIKE_PERIOD = 0.15;
static const double STRANGER = 0.08; /* the least weight, of an alternative that no neighbour has */

static bool is_alike(const tsuya_alternative *a, int i, const tsuya_alternative *b, int j)
{
    return fabs(a->length[i] - b->length[j]) < ALIKE_PERIOD * b->length[j] && tsuya_line_difference(a->angle_rad[i], b->angle_rad[j]) < ALIKE_RAD;
}

static double support_of(const tsuya_alternative *a, const tsuya_finding *other)
{
    double sum = 0.0;
    for (int k = 0; k < other->count; k++) {
        const tsuya_alternative *b = &other->alternative[k];
        bool alike = (is_alike(a, 0, b, 0) && is_alike(a, 1, b, 1)) || (is_alike(a, 0, b, 1) && is_alike(a, 1, b, 0));
        sum += alike ? (double)b->probability : 0.0;
    }
    return sum;
}

enum { NONE = TSUYA_ALTERNATIVES, EVERY }; /* a finding's alternatives, the last of them "no threads" */

static double of_alternative(const tsuya_finding *f, int k) { return (double)(k == NONE ? f->none_probability : f->alternative[k].probability); }

/* Mean over the windows around of what they believe of each alternative; the sum of their weights. */
static double support_around(double support[EVERY], const tsuya_finding *list, int columns, int rows, int column, int row)
{
    const tsuya_finding *own = &list[row * columns + column];
    double neighbours = 0.0;
    for (int j = -REACH; j <= REACH; j++) {
        for (int i = -REACH; i <= REACH; i++) {
            int x = column + i, y = row + j;
            if ((i == 0 && j == 0) || x < 0 || y < 0 || x >= columns || y >= rows || list[y * columns + x].empty) {
                continue;
            }
            const tsuya_finding *other = &list[y * columns + x];
            double weight = 1.0 / (i * i + j * j);
            neighbours += weight;
            for (int k = 0; k < own->count; k++) {
                support[k] += weight * support_of(&own->alternative[k], other);
            }
            support[NONE] += weight * (double)other->none_probability;
        }
    }
    for (int k = 0; k < EVERY; k++) {
        support[k] /= neighbours > 0.0 ? neighbours : 1.0;
    }
    return neighbours;
}

static void weigh(float *probability, const tsuya_finding *list, int columns, int rows, int column, int row)
{
    const tsuya_finding *own = &list[row * columns + column];
    double support[EVERY] = {0.0}, neighbours = support_around(support, list, columns, rows, column, row);
    double trust = neighbours / (neighbours + 1.0), typical = support[NONE], all = 0.0;
    for (int k = 0; k < own->count; k++) {
        typical = fmax(typical, support[k]);
    }
    for (int k = 0; k < EVERY; k++) {
        double prior = fmax(1.0 - trust * (typical - support[k]), STRANGER);
        probability[k] = k == NONE || k < own->count ? (float)(of_alternative(own, k) * prior) : 0.0f;
        all += (double)probability[k];
    }
    for (int k = 0; k < EVERY; k++) {
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
    float *probability = tsuya_calloc((size_t)columns * (size_t)rows * EVERY, sizeof *probability);
    if (!probability) {
        return TSUYA_ERROR_MEMORY;
    }
    for (int i = 0; i < columns * rows; i++) {
        weigh(probability + EVERY * i, list, columns, rows, i % columns, i / columns);
    }
    for (int i = 0; i < columns * rows; i++) {
        for (int k = 0; k < list[i].count; k++) {
            list[i].alternative[k].probability = probability[EVERY * i + k];
        }
        list[i].none_probability = probability[EVERY * i + NONE];
        sort(&list[i]);
        tsuya_finding_believe(&list[i]);
    }
    tsuya_free(probability);
    return TSUYA_OK;
}
