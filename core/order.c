#include "core/order.h"

#include <stdlib.h>

#define COMPARE(name, type)                                         \
    static int name(const void *a, const void *b)                   \
    {                                                               \
        type x = *(const type *)a, y = *(const type *)b;            \
        return (x > y) - (x < y);                                   \
    }

COMPARE(compare_doubles, double)
COMPARE(compare_floats, float)
COMPARE(compare_ints, int)

void tsuya_sort_doubles(double *value, size_t count) { qsort(value, count, sizeof *value, compare_doubles); }
void tsuya_sort_floats(float *value, size_t count) { qsort(value, count, sizeof *value, compare_floats); }
void tsuya_sort_ints(int *value, size_t count) { qsort(value, count, sizeof *value, compare_ints); }

/* Hoare's: what lies left of `from` is no larger, what lies right of `to` no smaller than all between. */
float tsuya_select_float(float *value, size_t count, size_t place)
{
    size_t from = 0, to = count - 1;
    while (from < to) {
        float middle = value[from + (to - from) / 2];
        size_t i = from, j = to;
        for (;;) {
            while (value[i] < middle) {
                ++i;
            }
            while (middle < value[j]) {
                --j;
            }
            if (i >= j) {
                break;
            }
            float swap = value[i];
            value[i++] = value[j];
            value[j--] = swap;
        }
        if (place <= j) {
            to = j;
        } else {
            from = j + 1;
        }
    }
    return value[place];
}

size_t tsuya_rank_of_int(const int *sorted, size_t count, int value)
{
    size_t low = 0, high = count;
    while (low < high) {
        size_t middle = low + (high - low) / 2;
        if (sorted[middle] < value) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    return low;
}
