#include "core/file.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

static char *format_path(const char *format, const char *a, const char *b)
{
    int length = snprintf(NULL, 0, format, a, b);
    char *path = tsuya_calloc((size_t)length + 1, 1);
    if (path) {
        snprintf(path, (size_t)length + 1, format, a, b);
    }
    return path;
}

const char *tsuya_path_name(const char *path)
{
    const char *slash = strrchr(path, '/');
    return slash ? slash + 1 : path;
}

const char *tsuya_path_extension(const char *path)
{
    const char *name = tsuya_path_name(path), *dot = strrchr(name, '.');
    return dot && dot != name ? dot : name + strlen(name);
}

char *tsuya_path_join(const char *folder, const char *name)
{
    if (name[0] == '/' || folder[0] == '\0') {
        return tsuya_strdup(name);
    }
    return format_path(folder[strlen(folder) - 1] == '/' ? "%s%s" : "%s/%s", folder, name);
}

char *tsuya_path_folder(const char *path)
{
    const char *slash = strrchr(path, '/');
    char *folder = tsuya_strdup(slash ? path : ".");
    if (folder && slash) {
        folder[slash == path ? 1 : slash - path] = '\0';
    }
    return folder;
}

bool tsuya_path_exists(const char *path)
{
    struct stat status;
    return stat(path, &status) == 0;
}

bool tsuya_path_is_folder(const char *path)
{
    struct stat status;
    return stat(path, &status) == 0 && S_ISDIR(status.st_mode);
}

/* Hidden, so that what a killed program leaves is no entry of a folder of photographs. */
tsuya_status tsuya_file_temporary_name(char **temporary, const char *path)
{
    char name[NAME_MAX + 1];
    snprintf(name, sizeof name, ".%.200s.tmp-%ld%.24s", tsuya_path_name(path), (long)getpid(), tsuya_path_extension(path));
    char *folder = tsuya_path_folder(path);
    *temporary = folder ? tsuya_path_join(folder, name) : NULL;
    tsuya_free(folder);
    return *temporary ? TSUYA_OK : TSUYA_ERROR_MEMORY;
}

tsuya_status tsuya_file_rename_into_place(const char *temporary, const char *path)
{
    int descriptor = open(temporary, O_RDONLY | O_CLOEXEC);
    bool synced = descriptor >= 0 && fsync(descriptor) == 0;
    int number = errno;
    if (descriptor >= 0) {
        close(descriptor);
    }
    if (!synced) {
        unlink(temporary);
        errno = number;
        return tsuya_fail_errno(path, "cannot write");
    }
    if (rename(temporary, path) != 0) {
        number = errno;
        unlink(temporary);
        errno = number;
        return tsuya_fail_errno(path, "cannot write");
    }
    return TSUYA_OK;
}

tsuya_status tsuya_file_begin(tsuya_file_writer *writer, const char *path)
{
    *writer = (tsuya_file_writer){0};
    tsuya_status status = tsuya_file_temporary_name(&writer->temporary, path);
    if (status == TSUYA_OK && !(writer->path = tsuya_strdup(path))) {
        status = TSUYA_ERROR_MEMORY;
    }
    if (status == TSUYA_OK && !(writer->stream = fopen(writer->temporary, "wbe"))) {
        status = tsuya_fail_errno(path, "cannot write");
    }
    if (status != TSUYA_OK) {
        tsuya_file_abort(writer);
    }
    return status;
}

tsuya_status tsuya_file_commit(tsuya_file_writer *writer)
{
    tsuya_status status = TSUYA_OK;
    bool failed = ferror(writer->stream) != 0;
    if (fflush(writer->stream) != 0 || failed) {
        if (failed && errno == 0) {
            errno = EIO;
        }
        status = tsuya_fail_errno(writer->path, "cannot write");
    }
    if (fclose(writer->stream) != 0 && status == TSUYA_OK) {
        status = tsuya_fail_errno(writer->path, "cannot write");
    }
    writer->stream = NULL;
    if (status == TSUYA_OK) {
        status = tsuya_file_rename_into_place(writer->temporary, writer->path);
    }
    tsuya_file_abort(writer);
    return status;
}

void tsuya_file_abort(tsuya_file_writer *writer)
{
    if (writer->stream) {
        fclose(writer->stream);
    }
    if (writer->temporary) {
        unlink(writer->temporary); /* gone already after a commit */
    }
    tsuya_free(writer->temporary);
    tsuya_free(writer->path);
    *writer = (tsuya_file_writer){0};
}

tsuya_status tsuya_file_write(const char *path, const void *bytes, size_t size)
{
    tsuya_file_writer writer;
    TSUYA_TRY(tsuya_file_begin(&writer, path));
    if (fwrite(bytes, 1, size, writer.stream) != size) {
        tsuya_status status = tsuya_fail_errno(path, "cannot write");
        tsuya_file_abort(&writer);
        return status;
    }
    return tsuya_file_commit(&writer);
}

tsuya_status tsuya_file_load(char **bytes, size_t *size, const char *path, size_t limit)
{
    tsuya_status status = TSUYA_OK;
    char *memory = NULL;
    size_t used = 0, capacity = 1 << 16;
    *bytes = NULL;
    *size = 0;
    FILE *file = fopen(path, "rbe");
    if (!file) {
        return tsuya_fail_errno(path, "cannot read");
    }
    struct stat about;
    if (fstat(fileno(file), &about) == 0 && S_ISREG(about.st_mode)) {
        if ((unsigned long long)about.st_size > limit) {
            status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: %lld bytes, at most %zu are accepted", path, (long long)about.st_size, limit);
            goto done;
        }
        capacity = (size_t)about.st_size + 1;
    }
    TSUYA_NEW(status, memory, capacity);
    for (;;) { /* a file may grow, and pipes have no size */
        size_t got = fread(memory + used, 1, capacity - used, file);
        used += got;
        if (got == 0) {
            break;
        }
        if (used > limit) {
            status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: more than %zu bytes, which is what is accepted", path, limit);
            goto done;
        }
        if (used == capacity) {
            char *grown = tsuya_realloc(memory, capacity * 2, 1);
            if (!grown) {
                status = TSUYA_ERROR_MEMORY;
                goto done;
            }
            memory = grown;
            capacity *= 2;
        }
    }
    if (ferror(file)) {
        status = tsuya_fail_errno(path, "cannot read");
        goto done;
    }
    memory[used] = '\0'; /* used < capacity after the loop */
    *bytes = memory;
    *size = used;
    memory = NULL;
done:
    tsuya_free(memory);
    fclose(file);
    return status;
}

tsuya_status tsuya_folder_make(const char *path)
{
    tsuya_status status = TSUYA_OK;
    char *part = tsuya_strdup(path);
    if (!part) {
        return TSUYA_ERROR_MEMORY;
    }
    for (char *p = part + 1; status == TSUYA_OK && part[0]; p++) {
        if (*p == '/' || *p == '\0') {
            char kept = *p;
            *p = '\0';
            if (mkdir(part, 0777) != 0 && !(errno == EEXIST && tsuya_path_is_folder(part))) {
                status = tsuya_fail_errno(part, "cannot make the folder");
            }
            *p = kept;
            if (!kept) {
                break;
            }
        }
    }
    tsuya_free(part);
    return status;
}

static tsuya_status remove_below(int parent, const char *name, const char *path)
{
    int descriptor = openat(parent, name, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
    if (descriptor < 0) {
        return errno == ENOENT ? TSUYA_OK : tsuya_fail_errno(path, "cannot remove");
    }
    DIR *folder = fdopendir(descriptor);
    if (!folder) {
        close(descriptor);
        return tsuya_fail_errno(path, "cannot remove");
    }
    tsuya_status status = TSUYA_OK;
    struct dirent *entry;
    while (status == TSUYA_OK && (entry = readdir(folder))) {
        if (strcmp(entry->d_name, ".") == 0 || strcmp(entry->d_name, "..") == 0) {
            continue;
        }
        struct stat about;
        if (fstatat(descriptor, entry->d_name, &about, AT_SYMLINK_NOFOLLOW) == 0 && S_ISDIR(about.st_mode)) {
            status = remove_below(descriptor, entry->d_name, path);
        } else if (unlinkat(descriptor, entry->d_name, 0) != 0 && errno != ENOENT) {
            status = tsuya_fail_errno(path, "cannot remove");
        }
    }
    closedir(folder);
    if (status == TSUYA_OK && unlinkat(parent, name, AT_REMOVEDIR) != 0 && errno != ENOENT) {
        status = tsuya_fail_errno(path, "cannot remove");
    }
    return status;
}

tsuya_status tsuya_folder_remove(const char *path)
{
    return remove_below(AT_FDCWD, path, path);
}

static int compare_names(const void *a, const void *b)
{
    return strcmp(*(char *const *)a, *(char *const *)b);
}

tsuya_status tsuya_folder_list(char ***names, int *count, const char *path, tsuya_arena *arena)
{
    tsuya_status status = TSUYA_OK;
    char **list = NULL;
    int used = 0, capacity = 0;
    *names = NULL;
    *count = 0;
    DIR *folder = opendir(path);
    if (!folder) {
        return tsuya_fail_errno(path, "cannot read the folder");
    }
    struct dirent *entry;
    while ((entry = readdir(folder))) {
        if (entry->d_name[0] == '.') {
            continue;
        }
        if (used == capacity) {
            char **grown = tsuya_realloc(list, (size_t)capacity * 2 + 64, sizeof *list);
            if (!grown) {
                status = TSUYA_ERROR_MEMORY;
                goto done;
            }
            list = grown;
            capacity = capacity * 2 + 64;
        }
        if (!(list[used++] = tsuya_arena_printf(arena, "%s", entry->d_name))) {
            status = TSUYA_ERROR_MEMORY;
            goto done;
        }
    }
    char **kept = tsuya_arena_alloc(arena, (size_t)used + 1, sizeof *kept);
    if (!kept) {
        status = TSUYA_ERROR_MEMORY;
        goto done;
    }
    if (used > 0) {
        qsort(list, (size_t)used, sizeof *list, compare_names);
        memcpy(kept, list, (size_t)used * sizeof *list);
    }
    *names = kept;
    *count = used;
done:
    tsuya_free(list);
    closedir(folder);
    return status;
}

enum { LOCK_TEXT = 96 };

/* "pid 123 since 2026-01-31 10:00:00", from the lock file's text; false when it holds something else. */
static bool describe_holder(int descriptor, char *text, size_t size)
{
    char content[LOCK_TEXT] = "";
    ssize_t got = pread(descriptor, content, sizeof content - 1, 0);
    long pid = 0;
    char since[32] = "";
    if (got <= 0 || sscanf(content, "%ld %31[0-9 :T-]", &pid, since) != 2) {
        return false;
    }
    snprintf(text, size, "pid %ld since %s", pid, since);
    return true;
}

tsuya_status tsuya_lock_take(tsuya_lock *lock, const char *folder)
{
    lock->descriptor = -1;
    char *path = tsuya_path_join(folder, ".tsuya.lock"), holder[LOCK_TEXT];
    if (!path) {
        return TSUYA_ERROR_MEMORY;
    }
    tsuya_status status = TSUYA_OK;
    int descriptor = open(path, O_RDWR | O_CREAT | O_CLOEXEC, 0666);
    if (descriptor < 0) {
        status = tsuya_fail_errno(path, "cannot lock");
        goto done;
    }
    bool known = describe_holder(descriptor, holder, sizeof holder);
    if (flock(descriptor, LOCK_EX | LOCK_NB) != 0) {
        status = errno == EWOULDBLOCK
            ? tsuya_fail(TSUYA_ERROR_INPUT, "%s: another tsuya works in this folder (%s); wait for it or choose another folder",
                         folder, known ? holder : "pid unknown")
            : tsuya_fail_errno(path, "cannot lock");
        goto done;
    }
    if (known) {
        tsuya_note("%s: an earlier run (%s) ended without releasing its lock; it is taken over", folder, holder);
    }
    char text[LOCK_TEXT], when[32];
    time_t now = time(NULL);
    struct tm calendar;
    localtime_r(&now, &calendar);
    strftime(when, sizeof when, "%Y-%m-%d %H:%M:%S", &calendar);
    int length = snprintf(text, sizeof text, "%ld %s\n", (long)getpid(), when);
    if (ftruncate(descriptor, 0) != 0 || pwrite(descriptor, text, (size_t)length, 0) != length) {
        status = tsuya_fail_errno(path, "cannot lock");
        goto done;
    }
    lock->descriptor = descriptor;
    descriptor = -1;
done:
    if (descriptor >= 0) {
        close(descriptor);
    }
    tsuya_free(path);
    return status;
}

void tsuya_lock_release(tsuya_lock *lock)
{
    if (lock->descriptor >= 0) {
        (void)!ftruncate(lock->descriptor, 0); /* the file stays: removing it would race with the next holder */
        close(lock->descriptor);
        lock->descriptor = -1;
    }
}
