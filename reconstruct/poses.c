#include "reconstruct/poses.h"

#include "core/file.h"
#include "core/memory.h"

#include <string.h>

static const char EXTENSION[] = ".cameramodel";

/* How long a file's name without extension is where the file is of the photograph, 0 where it is not. */
static size_t fits(const char *file, const char *photo)
{
    size_t length = strlen(file), extension = sizeof EXTENSION - 1;
    if (length <= extension || strcmp(file + length - extension, EXTENSION) != 0) {
        return 0;
    }
    length -= extension;
    return strncmp(file, photo, length) == 0 && photo[length] && strchr("-_.", photo[length]) ? length : 0;
}

static int file_of(char *const *file, int count, const char *photo)
{
    int best = -1;
    size_t longest = 0;
    for (int i = 0; i < count; i++) {
        size_t length = fits(file[i], photo);
        if (length > longest) {
            longest = length;
            best = i;
        }
    }
    return best;
}

/* The lens among those seen before, or a further one. */
static int camera_of(tsuya_sparse_model *model, const tsuya_camera *lens)
{
    for (int c = 0; c < model->camera_count; c++) {
        if (memcmp(&model->camera[c], lens, sizeof *lens) == 0) {
            return c;
        }
    }
    model->camera[model->camera_count] = *lens;
    return model->camera_count++;
}

static tsuya_status add_view(tsuya_sparse_model *model, const char *photo, const char *folder, const char *file)
{
    tsuya_camera lens;
    tsuya_view *view = &model->view[model->view_count];
    char *path = tsuya_path_join(folder, file);
    tsuya_status status = path ? TSUYA_OK : TSUYA_ERROR_MEMORY;
    memset(&lens, 0, sizeof lens); /* padding too: lenses are compared byte by byte */
    TSUYA_GOTO_DONE(status, status);
    TSUYA_GOTO_DONE(status, tsuya_cameramodel_load(&lens, &view->camera_from_world, path));
    view->name = tsuya_strdup(photo);
    TSUYA_GOTO_DONE(status, view->name ? TSUYA_OK : TSUYA_ERROR_MEMORY);
    view->camera = camera_of(model, &lens);
    model->view_count++;
done:
    tsuya_free(path);
    return status;
}

static tsuya_status check_places(const tsuya_sparse_model *model, const char *folder)
{
    double most = 0.0;
    for (int v = 1; v < model->view_count; v++) {
        most = fmax(most, tsuya_vec3_norm(tsuya_vec3_sub(tsuya_pose_center(model->view[v].camera_from_world), tsuya_pose_center(model->view[0].camera_from_world))));
    }
    return model->view_count < 2 || most > 0.0 ? TSUYA_OK
                                               : tsuya_fail(TSUYA_ERROR_INPUT, "%s: all cameras stand in one place; files with extrinsics are expected", folder);
}

static tsuya_status load_files(tsuya_sparse_model *model, const char *folder, char *const *file, int count, const tsuya_photo_set *photos)
{
    const size_t n = (size_t)photos->count;
    int without = 0;
    tsuya_status status = TSUYA_OK;
    *model = (tsuya_sparse_model){0};
    TSUYA_NEW(status, model->camera, n);
    TSUYA_NEW(status, model->camera_id, n);
    TSUYA_NEW(status, model->view, n);
    for (int i = 0; i < photos->count; i++) {
        const char *photo = photos->photo[i].name;
        int of = file_of(file, count, photo);
        if (of >= 0) {
            TSUYA_GOTO_DONE(status, add_view(model, photo, folder, file[of]));
        } else if (without++ == 0) {
            tsuya_warn("%s: no .cameramodel is of %s", folder, photo);
        }
    }
    if (without > 1) {
        tsuya_warn("%s: %d photographs have no .cameramodel and are left out", folder, without);
    }
    status = check_places(model, folder);
done:
    if (status != TSUYA_OK) {
        tsuya_sparse_model_free(model);
    }
    return status;
}

tsuya_status tsuya_poses_load(tsuya_sparse_model *model, const char *folder, const tsuya_photo_set *photos)
{
    char **file;
    int count;
    bool any = false;
    tsuya_arena *arena;
    TSUYA_TRY(tsuya_arena_create(&arena, 1 << 14));
    tsuya_status status = tsuya_folder_list(&file, &count, folder, arena);
    for (int i = 0; status == TSUYA_OK && i < count; i++) {
        size_t length = strlen(file[i]);
        any |= length >= sizeof EXTENSION && strcmp(file[i] + length - (sizeof EXTENSION - 1), EXTENSION) == 0;
    }
    if (status == TSUYA_OK) {
        status = any ? load_files(model, folder, file, count, photos) : tsuya_sparse_model_load(model, folder);
    }
    tsuya_arena_free(arena);
    return status;
}
