/* Plain numbers in ascending order.  NaN has no place among them.  Cost: n log n. */
#ifndef TSUYA_CORE_ORDER_H
#define TSUYA_CORE_ORDER_H

#include <stddef.h>

void tsuya_sort_doubles(double *value, size_t count);
void tsuya_sort_floats(float *value, size_t count);
void tsuya_sort_ints(int *value, size_t count);

/* The value that would stand at `place` if they were in order (place < count); they end up in another order.  Cost: n, most often. */
float tsuya_select_float(float *value, size_t count, size_t place);

/* How many of the sorted numbers are less than `value`: its index where it is among them. */
size_t tsuya_rank_of_int(const int *sorted, size_t count, int value);

#endif
