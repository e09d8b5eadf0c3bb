/* Files: paths, atomic writes, content hashes, the lock of a folder. */
#ifndef TSUYA_CORE_FILE_H
#define TSUYA_CORE_FILE_H

#include "core/memory.h"

#include <stdint.h>
#include <stdio.h>

/* Atomic write: bytes go to the hidden .NAME.tmp-PID beside the target, which is renamed on commit (fsync before), so that a
 * file with its final name is whole.  After a failed commit, and after abort, nothing is left. */
typedef struct tsuya_file_writer {
    FILE *stream; /* write here */
    char *path, *temporary;
} tsuya_file_writer;
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_file_begin(tsuya_file_writer *writer, const char *path);
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_file_commit(tsuya_file_writer *writer); /* also says "no space left" */
TSUYA_API void tsuya_file_abort(tsuya_file_writer *writer); /* safe after commit */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_file_write(const char *path, const void *bytes, size_t size);
/* For libraries that write by name: a hidden temporary name beside PATH that keeps its extension, and the rename. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_file_temporary_name(char **temporary, const char *path);
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_file_rename_into_place(const char *temporary, const char *path);

/* The whole file, with a NUL behind it that `size` does not count.  Refused above `limit` bytes.  tsuya_free. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_file_load(char **bytes, size_t *size, const char *path, size_t limit);

/* Content hash (XXH3, 128 bits) as 32 hex digits. */
typedef struct tsuya_hash { char hex[33]; } tsuya_hash;
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_hash_file(tsuya_hash *hash, const char *path);
TSUYA_API tsuya_hash tsuya_hash_bytes(const void *bytes, size_t size);
/* Hash of the names (relative) and contents of every file under a folder, in byte order of the names. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_hash_folder(tsuya_hash *hash, const char *folder);
/* Running hash over several parts. */
typedef struct tsuya_hasher tsuya_hasher;
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_hasher_create(tsuya_hasher **hasher);
TSUYA_API void tsuya_hasher_add(tsuya_hasher *hasher, const void *bytes, size_t size);
TSUYA_API void tsuya_hasher_add_text(tsuya_hasher *hasher, const char *text); /* with its length, so parts cannot run together */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_hasher_add_file(tsuya_hasher *hasher, const char *path);
TSUYA_API tsuya_hash tsuya_hasher_end(tsuya_hasher *hasher); /* frees it */

TSUYA_API bool tsuya_path_exists(const char *path);
TSUYA_API bool tsuya_path_is_folder(const char *path);
/* mkdir -p */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_folder_make(const char *path);
/* rm -r of a folder that this program made; a missing one is fine.  Never follows symbolic links. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_folder_remove(const char *path);
/* Names of the entries (no . and ..; hidden ones left out), sorted in byte order; in the arena. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_folder_list(char ***names, int *count, const char *path, tsuya_arena *arena);
/* FOLDER/NAME in a fresh string (tsuya_free), or NAME itself when it is absolute. */
TSUYA_API char *tsuya_path_join(const char *folder, const char *name);
/* The folder part ("." when there is none) in a fresh string. */
TSUYA_API char *tsuya_path_folder(const char *path);
/* Inside `path`: the name after the last slash; the extension with its dot ("" when there is none). */
TSUYA_API const char *tsuya_path_name(const char *path);
TSUYA_API const char *tsuya_path_extension(const char *path);

/* One process at a time in a folder.  The lock is an flock on FOLDER/.tsuya.lock, which the kernel drops when its holder
 * dies, so a stale file does not block; it carries the holder's pid and start time for the message. */
typedef struct tsuya_lock { int descriptor; } tsuya_lock;
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_lock_take(tsuya_lock *lock, const char *folder);
TSUYA_API void tsuya_lock_release(tsuya_lock *lock);

#endif
