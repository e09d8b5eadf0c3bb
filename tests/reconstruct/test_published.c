/* Real photographs with published cameras, from photographs to mesh: the dinosaur of Middlebury's sparse ring (Seitz, Curless,
 * Diebel, Scharstein, Szeliski, CVPR 2006).  Held against its outline in the photographs and its published box.  Once the outlines
 * are given as masks, too: they keep what is outside out, but what fills them has to come from stereo.  Once nothing is given. */
#include "support.h"

#include "core/image.h"
#include "core/order.h"
#include "core/process.h"
#include "core/raster.h"
#include "published.h"
#include "reconstruct/reconstruct.h"

enum { WIDTH = 640, HEIGHT = 480, MOST_VIEWS = 64 };

static const char *const FOLDER = "mvs/dino_sparse_ring";

/* The data's README grows the outline by three pixels (below), so that a mask surely holds the object; a mesh ends where the object does. */
enum { DILATE_PX = 10, ERODE_PX = 7 };

static void grow(uint8_t *mask, int radius, uint8_t value)
{
    static uint8_t out[WIDTH * HEIGHT];
    memset(out, value ? 0 : 255, sizeof out);
    for (int y = 0; y < HEIGHT; y++) {
        for (int x = 0; x < WIDTH; x++) {
            for (int dy = -radius; mask[y * WIDTH + x] == value && dy <= radius; dy++) {
                for (int dx = -radius; dx <= radius; dx++) {
                    int nx = x + dx, ny = y + dy;
                    if (dx * dx + dy * dy <= radius * radius && nx >= 0 && ny >= 0 && nx < WIDTH && ny < HEIGHT) {
                        out[ny * WIDTH + nx] = value;
                    }
                }
            }
        }
    }
    memcpy(mask, out, sizeof out);
}

/* Pixels above 0.19, dilated and eroded: by 10 and 7, as the data's README asks, or by as much as they were dilated. */
static void outline(uint8_t *mask, const char *photo, int erode_px)
{
    tsuya_image image;
    assert_ok(tsuya_image_load(&image, photo));
    assert_int_equal(image.width_px, WIDTH);
    assert_int_equal(image.height_px, HEIGHT);
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        float most = 0.0f;
        for (int c = 0; c < image.channels && c < 3; c++) {
            most = fmaxf(most, tsuya_image_get(&image, i % WIDTH, i / WIDTH, c));
        }
        mask[i] = most > 0.19f ? 255 : 0;
    }
    grow(mask, DILATE_PX, 255);
    grow(mask, erode_px, 0);
    tsuya_image_free(&image);
}

static void write_masks(const tsuya_sparse_model *model)
{
    static uint8_t mask[WIDTH * HEIGHT];
    char path[TEST_PATH];
    tsuya_image image;
    assert_ok(tsuya_folder_make(test_path("outlines")));
    assert_ok(tsuya_image_create(&image, WIDTH, HEIGHT, 1, TSUYA_SAMPLE_U8, TSUYA_ENCODING_DATA));
    for (int v = 0; v < model->view_count; v++) {
        snprintf(path, sizeof path, "%s/%s", FOLDER, model->view[v].name);
        outline(mask, test_data(path), ERODE_PX);
        for (int i = 0; i < WIDTH * HEIGHT; i++) {
            *tsuya_image_u8(&image, i % WIDTH, i / WIDTH) = mask[i];
        }
        snprintf(path, sizeof path, "outlines/%s", model->view[v].name);
        assert_ok(tsuya_image_save(&image, test_path(path), NULL));
    }
    tsuya_image_free(&image);
}

static double overlap(const uint8_t *mask, const tsuya_raster *raster)
{
    size_t both = 0, either = 0;
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        bool drawn = raster->triangle[i] != UINT32_MAX;
        both += drawn && mask[i];
        either += drawn || mask[i];
    }
    return either ? (double)both / (double)either : 1.0;
}

/* Over the data's list of photographs whose outline can be had by a threshold. */
static double median_overlap(const tsuya_sparse_model *model, const tsuya_mesh *mesh, int erode_px, const tsuya_context *context)
{
    static uint8_t mask[WIDTH * HEIGHT];
    double iou[MOST_VIEWS];
    int count = 0;
    char name[64], path[TEST_PATH];
    tsuya_raster raster;
    snprintf(path, sizeof path, "%s/dinoSR_good_silhouette_images.txt", FOLDER);
    FILE *list = fopen(test_data(path), "r");
    assert_non_null(list);
    assert_ok(tsuya_raster_create(&raster, WIDTH, HEIGHT));
    while (count < MOST_VIEWS && fscanf(list, "%63s", name) == 1) {
        int v = tsuya_sparse_model_find(model, name);
        assert_true(v >= 0);
        snprintf(path, sizeof path, "%s/%s", FOLDER, name);
        outline(mask, test_data(path), erode_px);
        tsuya_raster_clear(&raster);
        assert_ok(tsuya_raster_draw(&raster, mesh, &model->camera[model->view[v].camera], model->view[v].camera_from_world, context));
        iou[count++] = overlap(mask, &raster);
    }
    fclose(list);
    tsuya_raster_free(&raster);
    assert_true(count >= 10);
    tsuya_sort_doubles(iou, (size_t)count);
    print_message("dino: IoU with the outline %d px wider than the object, %d photographs: median %.4f, least %.4f\n", DILATE_PX - erode_px, count,
                  iou[count / 2], iou[0]);
    return iou[count / 2];
}

/* Share of the vertices inside the published tight box, grown by `margin_m`. */
static double inside_box(const tsuya_mesh *mesh, double margin_m)
{
    static const double low[3] = {-0.061897, -0.018874, -0.057845}, high[3] = {0.010897, 0.068227, 0.015495};
    size_t inside = 0;
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        bool in = true;
        for (int k = 0; k < 3; k++) {
            double x = mesh->position[3 * v + (size_t)k];
            in &= x >= low[k] - margin_m && x <= high[k] + margin_m;
        }
        inside += in;
    }
    return (double)inside / (double)mesh->vertex_count;
}

static void assert_dinosaur(const char *name, bool masks)
{
    char path[TEST_PATH], output[TEST_PATH], photos[TEST_PATH], poses[TEST_PATH];
    tsuya_context context = tsuya_context_default();
    tsuya_sparse_model model;
    tsuya_reconstruct_info info;
    tsuya_mesh mesh;
    context.threads = 2;
    snprintf(path, sizeof path, "%s/dinoSR_par.txt", FOLDER);
    assert_ok(published_middlebury(&model, test_data(path), WIDTH, HEIGHT));
    snprintf(path, sizeof path, "%.2000s/%s", test_folder(), name);
    snprintf(photos, sizeof photos, "%.2000s/photos", path);
    snprintf(poses, sizeof poses, "%.2000s/poses", path);
    snprintf(output, sizeof output, "%.2000s/out", path);
    assert_ok(published_lay_out(&model, test_data(FOLDER), path));
    tsuya_reconstruct_options options = tsuya_reconstruct_options_default();
    options.photos = photos;
    options.poses = poses;
    options.dense_long_side_px = WIDTH / 2;
    options.output = output;
    if (masks) {
        write_masks(&model);
        options.masks = test_path("outlines");
    }
    assert_ok(tsuya_reconstruct(&info, &options, &context));
    snprintf(path, sizeof path, "%.2000s/mesh.ply", output);
    assert_ok(tsuya_ply_load(&mesh, path));
    double in = inside_box(&mesh, 0.0), near = inside_box(&mesh, 0.002);
    print_message("dino, %s: %d of %d placed, %zu triangles, in the box %.4f, within 2 mm of it %.4f\n", name, info.registered, info.photos,
                  mesh.triangle_count, in, near);
    double overlap = median_overlap(&model, &mesh, ERODE_PX, &context);
    median_overlap(&model, &mesh, DILATE_PX, &context); /* said beside it */
    assert_int_equal(info.registered, model.view_count);
    assert_true(overlap >= 0.93);
    assert_true(in >= 0.99);
    assert_true(near == 1.0);
    tsuya_mesh_free(&mesh);
    tsuya_reconstruct_info_free(&info);
    tsuya_sparse_model_free(&model);
}

static void dinosaur_with_its_outlines_as_masks(void **state)
{
    (void)state;
    assert_dinosaur("masks", true);
}

/* What stands still in the photographs is found and masked. */
static void dinosaur_without_masks(void **state)
{
    (void)state;
    assert_dinosaur("none", false);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(dinosaur_without_masks),
        cmocka_unit_test(dinosaur_with_its_outlines_as_masks),
    };
    if (!test_data(FOLDER) || !tsuya_process_available("colmap")) {
        print_message("skipped: no %s, or no colmap\n", FOLDER);
        return TEST_SKIPPED;
    }
    int failed = cmocka_run_group_tests(tests, NULL, NULL);
    test_folder_remove();
    return failed;
}
