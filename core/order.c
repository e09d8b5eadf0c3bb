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
