/* xxHash (XXH3, 128 bits) behind core/file.h. */
#include "core/file.h"

#include <string.h>
#include <sys/stat.h>
#include <xxhash.h>

struct tsuya_hasher {
    XXH3_state_t *state;
};

static tsuya_hash to_hex(XXH128_hash_t value)
{
    tsuya_hash hash;
    snprintf(hash.hex, sizeof hash.hex, "%016llx%016llx", (unsigned long long)value.high64, (unsigned long long)value.low64);
    return hash;
}

tsuya_hash tsuya_hash_bytes(const void *bytes, size_t size)
{
    return to_hex(XXH3_128bits(bytes, size));
}

tsuya_status tsuya_hasher_create(tsuya_hasher **hasher)
{
    *hasher = tsuya_calloc(1, sizeof **hasher);
    if (!*hasher) {
        return TSUYA_ERROR_MEMORY;
    }
    (*hasher)->state = XXH3_createState();
    if (!(*hasher)->state) {
        tsuya_free(*hasher);
        *hasher = NULL;
        return tsuya_fail(TSUYA_ERROR_MEMORY, "out of memory for a hash");
    }
    XXH3_128bits_reset((*hasher)->state);
    return TSUYA_OK;
}

void tsuya_hasher_add(tsuya_hasher *hasher, const void *bytes, size_t size)
{
    XXH3_128bits_update(hasher->state, bytes, size);
}

void tsuya_hasher_add_text(tsuya_hasher *hasher, const char *text)
{
    uint64_t length = strlen(text);
    XXH3_128bits_update(hasher->state, &length, sizeof length);
    XXH3_128bits_update(hasher->state, text, length);
}

tsuya_status tsuya_hasher_add_file(tsuya_hasher *hasher, const char *path)
{
    enum { CHUNK = 1 << 20 };
    FILE *file = fopen(path, "rbe");
    if (!file) {
        return tsuya_fail_errno(path, "cannot read");
    }
    tsuya_status status = TSUYA_OK;
    uint64_t total = 0;
    size_t got;
    char *buffer = NULL;
    TSUYA_NEW(status, buffer, CHUNK);
    while ((got = fread(buffer, 1, CHUNK, file)) > 0) {
        XXH3_128bits_update(hasher->state, buffer, got);
        total += got;
    }
    if (ferror(file)) {
        status = tsuya_fail_errno(path, "cannot read");
    }
    XXH3_128bits_update(hasher->state, &total, sizeof total);
done:
    tsuya_free(buffer);
    fclose(file);
    return status;
}

tsuya_hash tsuya_hasher_end(tsuya_hasher *hasher)
{
    tsuya_hash hash = to_hex(XXH3_128bits_digest(hasher->state));
    XXH3_freeState(hasher->state);
    tsuya_free(hasher);
    return hash;
}

tsuya_status tsuya_hash_file(tsuya_hash *hash, const char *path)
{
    tsuya_hasher *hasher;
    TSUYA_TRY(tsuya_hasher_create(&hasher));
    tsuya_status status = tsuya_hasher_add_file(hasher, path);
    *hash = tsuya_hasher_end(hasher);
    return status;
}

static tsuya_status add_folder(tsuya_hasher *hasher, const char *folder, tsuya_arena *arena)
{
    char **name;
    int count;
    TSUYA_TRY(tsuya_folder_list(&name, &count, folder, arena));
    tsuya_hasher_add(hasher, &count, sizeof count);
    for (int i = 0; i < count; i++) {
        char *path = tsuya_arena_printf(arena, "%s/%s", folder, name[i]);
        if (!path) {
            return TSUYA_ERROR_MEMORY;
        }
        tsuya_hasher_add_text(hasher, name[i]);
        if (tsuya_path_is_folder(path)) {
            TSUYA_TRY(add_folder(hasher, path, arena));
        } else {
            TSUYA_TRY(tsuya_hasher_add_file(hasher, path));
        }
    }
    return TSUYA_OK;
}

tsuya_status tsuya_hash_folder(tsuya_hash *hash, const char *folder)
{
    tsuya_arena *arena = NULL;
    tsuya_hasher *hasher = NULL;
    TSUYA_TRY(tsuya_arena_create(&arena, 1 << 16));
    tsuya_status status = tsuya_hasher_create(&hasher);
    if (status == TSUYA_OK) {
        status = add_folder(hasher, folder, arena);
        *hash = tsuya_hasher_end(hasher);
    }
    tsuya_arena_free(arena);
    return status;
}
