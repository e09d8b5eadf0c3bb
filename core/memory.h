/* Memory: checked allocation with a failure hook for tests, and the arena for temporaries.
 *
 * Only functions named create, load or copy hand memory over.  Temporaries live in an arena that the caller owns. */
#ifndef TSUYA_CORE_MEMORY_H
#define TSUYA_CORE_MEMORY_H

#include "core/status.h"

#include <stdbool.h>
#include <stdint.h>

/* count × size bytes, zeroed, 64-byte aligned; NULL (with a reason) on overflow or exhaustion.  A count or size of 0
 * gives a valid pointer.  Free with tsuya_free. */
TSUYA_API void *tsuya_calloc(size_t count, size_t size);
/* Grows or shrinks; contents kept, the new tail is not zeroed; the old pointer stays valid on failure (NULL returned). */
TSUYA_API void *tsuya_realloc(void *memory, size_t count, size_t size);
TSUYA_API void tsuya_free(void *memory);
/* Copy of a string, NULL when memory is short. */
TSUYA_API char *tsuya_strdup(const char *text);

/* `TSUYA_NEW(status, pointer, count)` for use before `goto done`. */
#define TSUYA_NEW(status, pointer, count)                                        \
    do {                                                                         \
        (pointer) = tsuya_calloc((count), sizeof *(pointer));                    \
        if (!(pointer)) {                                                        \
            (status) = TSUYA_ERROR_MEMORY;                                       \
            goto done;                                                           \
        }                                                                        \
    } while (0)

/* Tests: the n-th allocation from now (1 = the next) fails, once; 0 switches the hook off.  Returns how many allocations
 * were made since the last call. */
TSUYA_API uint64_t tsuya_memory_fail_at(uint64_t n);

/* Arena: bump allocation in blocks, everything freed at once. */
typedef struct tsuya_arena tsuya_arena;
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_arena_create(tsuya_arena **arena, size_t first_block_bytes);
TSUYA_API void tsuya_arena_free(tsuya_arena *arena);
/* Zeroed, 64-byte aligned; NULL with a reason when memory is short. */
TSUYA_API void *tsuya_arena_alloc(tsuya_arena *arena, size_t count, size_t size);
TSUYA_API char *tsuya_arena_printf(tsuya_arena *arena, const char *format, ...) TSUYA_PRINTF(2, 3);
/* Everything allocated after a mark is given back by a reset to it. */
typedef struct tsuya_arena_mark {
    void *block;
    size_t used;
} tsuya_arena_mark;
TSUYA_API tsuya_arena_mark tsuya_arena_get_mark(const tsuya_arena *arena);
TSUYA_API void tsuya_arena_reset(tsuya_arena *arena, tsuya_arena_mark mark);

#endif
