#include "core/memory.h"

#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { ALIGNMENT = 64 };

/* Before every block: its usable size, so that realloc knows what to keep.  One alignment unit, so the block stays aligned. */
typedef struct block_header {
    size_t bytes;
} block_header;

static atomic_uint_fast64_t allocation_count;
static atomic_uint_fast64_t failing_allocation;

static bool must_fail(void)
{
    uint64_t number = atomic_fetch_add(&allocation_count, 1) + 1;
    uint64_t failing = atomic_load(&failing_allocation);
    return failing != 0 && number == failing;
}

uint64_t tsuya_memory_fail_at(uint64_t n)
{
    uint64_t made = atomic_exchange(&allocation_count, 0);
    atomic_store(&failing_allocation, n);
    return made;
}

static block_header *header_of(void *memory)
{
    return (block_header *)((char *)memory - ALIGNMENT);
}

static void *allocate(size_t count, size_t size, bool zero)
{
    size_t bytes;
    if (__builtin_mul_overflow(count, size, &bytes) || bytes > SIZE_MAX / 2) {
        (void)tsuya_fail(TSUYA_ERROR_MEMORY, "%zu items of %zu bytes do not fit into memory", count, size);
        return NULL;
    }
    size_t padded = (bytes + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT + ALIGNMENT;
    char *block = must_fail() ? NULL : aligned_alloc(ALIGNMENT, padded);
    if (!block) {
        (void)tsuya_fail(TSUYA_ERROR_MEMORY, "out of memory: %zu bytes wanted", bytes);
        return NULL;
    }
    memset(block, 0, zero ? padded : ALIGNMENT);
    ((block_header *)block)->bytes = bytes;
    return block + ALIGNMENT;
}

void *tsuya_calloc(size_t count, size_t size)
{
    return allocate(count, size, true);
}

void *tsuya_realloc(void *memory, size_t count, size_t size)
{
    void *grown = allocate(count, size, false);
    if (!grown || !memory) {
        return grown;
    }
    size_t kept = header_of(memory)->bytes, bytes = header_of(grown)->bytes;
    memcpy(grown, memory, kept < bytes ? kept : bytes);
    tsuya_free(memory);
    return grown;
}

void tsuya_free(void *memory)
{
    if (memory) {
        free(header_of(memory));
    }
}

char *tsuya_strdup(const char *text)
{
    size_t bytes = strlen(text) + 1;
    char *copy = tsuya_calloc(bytes, 1);
    if (copy) {
        memcpy(copy, text, bytes);
    }
    return copy;
}

typedef struct arena_block {
    struct arena_block *next; /* later */
    size_t capacity;
    char *bytes;
} arena_block;

struct tsuya_arena {
    arena_block *first, *current;
    size_t used; /* of the current block */
};

static arena_block *block_create(size_t capacity)
{
    arena_block *block = tsuya_calloc(1, sizeof *block);
    if (!block) {
        return NULL;
    }
    block->capacity = capacity;
    block->bytes = tsuya_calloc(capacity, 1);
    if (!block->bytes) {
        tsuya_free(block);
        return NULL;
    }
    return block;
}

tsuya_status tsuya_arena_create(tsuya_arena **arena, size_t first_block_bytes)
{
    *arena = NULL;
    tsuya_arena *made = tsuya_calloc(1, sizeof *made);
    if (!made) {
        return TSUYA_ERROR_MEMORY;
    }
    made->first = made->current = block_create(first_block_bytes < 1024 ? 1024 : first_block_bytes);
    if (!made->first) {
        tsuya_free(made);
        return TSUYA_ERROR_MEMORY;
    }
    *arena = made;
    return TSUYA_OK;
}

static void free_blocks(arena_block *block)
{
    while (block) {
        arena_block *next = block->next;
        tsuya_free(block->bytes);
        tsuya_free(block);
        block = next;
    }
}

void tsuya_arena_free(tsuya_arena *arena)
{
    if (arena) {
        free_blocks(arena->first);
        tsuya_free(arena);
    }
}

void *tsuya_arena_alloc(tsuya_arena *arena, size_t count, size_t size)
{
    size_t bytes;
    if (__builtin_mul_overflow(count, size, &bytes) || bytes > SIZE_MAX / 4) {
        (void)tsuya_fail(TSUYA_ERROR_MEMORY, "%zu items of %zu bytes do not fit into memory", count, size);
        return NULL;
    }
    bytes = (bytes + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT;
    if (bytes == 0) {
        bytes = ALIGNMENT;
    }
    if (bytes > arena->current->capacity - arena->used) {
        size_t capacity = arena->current->capacity * 2;
        arena_block *block = block_create(bytes > capacity ? bytes : capacity);
        if (!block) {
            return NULL;
        }
        arena->current->next = block;
        arena->current = block;
        arena->used = 0;
    }
    void *memory = arena->current->bytes + arena->used;
    arena->used += bytes;
    memset(memory, 0, bytes); /* a reset leaves old contents behind */
    return memory;
}

char *tsuya_arena_printf(tsuya_arena *arena, const char *format, ...)
{
    va_list arguments, again;
    va_start(arguments, format);
    va_copy(again, arguments);
    int length = vsnprintf(NULL, 0, format, arguments);
    va_end(arguments);
    char *text = length < 0 ? NULL : tsuya_arena_alloc(arena, (size_t)length + 1, 1);
    if (text) {
        vsnprintf(text, (size_t)length + 1, format, again);
    }
    va_end(again);
    return text;
}

tsuya_arena_mark tsuya_arena_get_mark(const tsuya_arena *arena)
{
    return (tsuya_arena_mark){arena->current, arena->used};
}

void tsuya_arena_reset(tsuya_arena *arena, tsuya_arena_mark mark)
{
    arena_block *block = mark.block;
    free_blocks(block->next);
    block->next = NULL;
    arena->current = block;
    arena->used = mark.used;
}
