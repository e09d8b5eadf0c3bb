/* OpenEXR's C core behind core/image_adapters.h: one part, scanlines, channels R G B (A) or Y, half or float. */
#include "core/image_adapters.h"

#include "core/memory.h"

#include <openexr.h>
#include <string.h>

enum { MOST_CHANNELS = 4 };

static void be_silent(exr_const_context_t context, int code, const char *message)
{
    (void)context;
    (void)code;
    (void)message;
}

static exr_context_initializer_t initializer(void)
{
    exr_context_initializer_t init = EXR_DEFAULT_CONTEXT_INITIALIZER;
    init.error_handler_fn = be_silent;
    return init;
}

static tsuya_status fail_exr(tsuya_status status, const char *path, exr_result_t code)
{
    return tsuya_fail(code == EXR_ERR_OUT_OF_MEMORY ? TSUYA_ERROR_MEMORY : status, "%s: EXR: %s", path, exr_get_default_error_message(code));
}

static tsuya_status open_exr(exr_context_t *file, exr_attr_box2i_t *window, const char *path)
{
    exr_context_initializer_t init = initializer();
    exr_result_t code = exr_start_read(file, path, &init);
    if (code == EXR_ERR_SUCCESS && (code = exr_get_data_window(*file, 0, window)) != EXR_ERR_SUCCESS) {
        exr_finish(file);
    }
    return code == EXR_ERR_SUCCESS ? TSUYA_OK : fail_exr(TSUYA_ERROR_INPUT, path, code);
}

tsuya_status tsuya_exr_probe(int *width_px, int *height_px, const char *path)
{
    exr_context_t file;
    exr_attr_box2i_t window;
    TSUYA_TRY(open_exr(&file, &window, path));
    long long width = (long long)window.max.x - window.min.x + 1, height = (long long)window.max.y - window.min.y + 1;
    exr_finish(&file);
    if (width < 1 || height < 1 || width > 65535 || height > 65535 || width * height > 400000000) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: %lld x %lld pixels; 1 … 65535 a side and 400 megapixels are accepted", path, width, height);
    }
    *width_px = (int)width;
    *height_px = (int)height;
    return TSUYA_OK;
}

/* Index of a channel among R G B A (or Y as the first); −1 for others. */
static int place_of(const char *name)
{
    static const char *const NAME[] = {"R", "G", "B", "A"};
    for (int i = 0; i < MOST_CHANNELS; i++) {
        if (strcmp(name, NAME[i]) == 0) {
            return i;
        }
    }
    return strcmp(name, "Y") == 0 ? 0 : -1;
}

static tsuya_status channel_count(int *count, const exr_attr_chlist_t *list, const char *path)
{
    unsigned found = 0;
    for (int i = 0; i < list->num_channels; i++) {
        int place = place_of(list->entries[i].name.str);
        if (place >= 0 && list->entries[i].x_sampling == 1 && list->entries[i].y_sampling == 1 && list->entries[i].pixel_type != EXR_PIXEL_UINT) {
            found |= 1u << place;
        }
    }
    *count = found == 15 ? 4 : found == 7 ? 3 : found == 1 ? 1 : 0;
    return *count ? TSUYA_OK
                  : tsuya_fail(TSUYA_ERROR_INPUT, "%s: EXR channels R G B, R G B A or Y (half or float, not subsampled) are accepted", path);
}

/* A chunk's channels one after the other.  OpenEXR 3.1.5 swaps the channels of half files when it is asked to interleave them
 * (its fast path for R G B A), so it gets planes. */
typedef struct chunk_planes {
    float *value; /* MOST_CHANNELS planes of `size` */
    size_t size;
} chunk_planes;

static exr_result_t reserve_planes(chunk_planes *planes, const exr_chunk_info_t *chunk)
{
    size_t size = (size_t)chunk->width * (size_t)chunk->height;
    if (size > planes->size) {
        tsuya_free(planes->value);
        planes->value = tsuya_calloc(MOST_CHANNELS * size, sizeof *planes->value);
        planes->size = planes->value ? size : 0;
    }
    return planes->value ? EXR_ERR_SUCCESS : EXR_ERR_OUT_OF_MEMORY;
}

static void aim_decoder(exr_decode_pipeline_t *decoder, const exr_chunk_info_t *chunk, const chunk_planes *planes, int channels)
{
    for (int c = 0; c < decoder->channel_count; c++) {
        exr_coding_channel_info_t *channel = &decoder->channels[c];
        int place = place_of(channel->channel_name);
        channel->decode_to_ptr = NULL;
        if (place >= 0 && place < channels) {
            channel->decode_to_ptr = (uint8_t *)(planes->value + (size_t)place * planes->size);
            channel->user_pixel_stride = (int)sizeof(float);
            channel->user_line_stride = chunk->width * (int)sizeof(float);
            channel->user_bytes_per_element = sizeof(float);
            channel->user_data_type = EXR_PIXEL_FLOAT;
        }
    }
}

static void interleave(tsuya_image *image, const chunk_planes *planes, const exr_chunk_info_t *chunk, int row, int column)
{
    for (int y = 0; y < chunk->height && row + y < image->height_px; y++) {
        for (int x = 0; x < chunk->width && column + x < image->width_px; x++) {
            float *pixel = tsuya_image_f32(image, column + x, row + y);
            for (int c = 0; c < image->channels; c++) {
                pixel[c] = planes->value[(size_t)c * planes->size + (size_t)y * (size_t)chunk->width + (size_t)x];
            }
        }
    }
}

static exr_result_t decode_chunk(exr_context_t file, exr_decode_pipeline_t *decoder, const exr_chunk_info_t *chunk, bool first,
                                 tsuya_image *image, chunk_planes *planes, int row, int column)
{
    exr_result_t code = reserve_planes(planes, chunk);
    if (code == EXR_ERR_SUCCESS) {
        code = first ? exr_decoding_initialize(file, 0, chunk, decoder) : exr_decoding_update(file, 0, chunk, decoder);
    }
    if (code == EXR_ERR_SUCCESS) {
        aim_decoder(decoder, chunk, planes, image->channels);
        code = first ? exr_decoding_choose_default_routines(file, 0, decoder) : EXR_ERR_SUCCESS;
    }
    if (code == EXR_ERR_SUCCESS) {
        code = exr_decoding_run(file, 0, decoder);
    }
    if (code == EXR_ERR_SUCCESS) {
        interleave(image, planes, chunk, row, column);
    }
    return code;
}

static exr_result_t read_scanlines(exr_context_t file, tsuya_image *image, const exr_attr_box2i_t *window)
{
    int32_t lines = 1;
    exr_decode_pipeline_t decoder = EXR_DECODE_PIPELINE_INITIALIZER;
    chunk_planes planes = {0};
    exr_result_t code = exr_get_scanlines_per_chunk(file, 0, &lines);
    for (int y = window->min.y; code == EXR_ERR_SUCCESS && y <= window->max.y; y += lines) {
        exr_chunk_info_t chunk;
        code = exr_read_scanline_chunk_info(file, 0, y, &chunk);
        if (code == EXR_ERR_SUCCESS) {
            code = decode_chunk(file, &decoder, &chunk, y == window->min.y, image, &planes, y - window->min.y, 0);
        }
    }
    exr_decoding_destroy(file, &decoder);
    tsuya_free(planes.value);
    return code;
}

static exr_result_t read_tiles(exr_context_t file, tsuya_image *image)
{
    uint32_t tile_width, tile_height;
    exr_tile_level_mode_t level;
    exr_tile_round_mode_t round;
    exr_decode_pipeline_t decoder = EXR_DECODE_PIPELINE_INITIALIZER;
    chunk_planes planes = {0};
    exr_result_t code = exr_get_tile_descriptor(file, 0, &tile_width, &tile_height, &level, &round);
    bool first = true;
    for (int y = 0; code == EXR_ERR_SUCCESS && y < image->height_px; y += (int)tile_height) {
        for (int x = 0; code == EXR_ERR_SUCCESS && x < image->width_px; x += (int)tile_width) {
            exr_chunk_info_t chunk;
            code = exr_read_tile_chunk_info(file, 0, x / (int)tile_width, y / (int)tile_height, 0, 0, &chunk);
            if (code == EXR_ERR_SUCCESS) {
                code = decode_chunk(file, &decoder, &chunk, first, image, &planes, y, x);
                first = false;
            }
        }
    }
    exr_decoding_destroy(file, &decoder);
    tsuya_free(planes.value);
    return code;
}

tsuya_status tsuya_exr_load(tsuya_image *image, const char *path)
{
    exr_context_t file;
    exr_attr_box2i_t window;
    int width, height, channels;
    TSUYA_TRY(tsuya_exr_probe(&width, &height, path));
    TSUYA_TRY(open_exr(&file, &window, path));
    const exr_attr_chlist_t *list;
    exr_storage_t storage;
    tsuya_status status = TSUYA_OK;
    exr_result_t code = exr_get_channels(file, 0, &list);
    if (code == EXR_ERR_SUCCESS) {
        code = exr_get_storage(file, 0, &storage);
    }
    if (code != EXR_ERR_SUCCESS) {
        status = fail_exr(TSUYA_ERROR_INPUT, path, code);
        goto done;
    }
    if (storage != EXR_STORAGE_SCANLINE && storage != EXR_STORAGE_TILED) {
        status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: deep EXR cannot be used", path);
        goto done;
    }
    TSUYA_GOTO_DONE(status, channel_count(&channels, list, path));
    TSUYA_GOTO_DONE(status, tsuya_image_create(image, width, height, channels, TSUYA_SAMPLE_F32, TSUYA_ENCODING_LINEAR));
    code = storage == EXR_STORAGE_TILED ? read_tiles(file, image) : read_scanlines(file, image, &window);
    if (code != EXR_ERR_SUCCESS) {
        tsuya_image_free(image);
        status = fail_exr(TSUYA_ERROR_INPUT, path, code);
    }
done:
    exr_finish(&file);
    return status;
}

static const char *const *channel_names(int channels)
{
    static const char *const GREY[] = {"Y"}, *const COLOR[] = {"R", "G", "B", "A"};
    return channels == 1 ? GREY : COLOR;
}

static exr_result_t write_header(exr_context_t file, const tsuya_image *image, const tsuya_image_save_options *options)
{
    int part = 0;
    exr_result_t code = exr_add_part(file, "image", EXR_STORAGE_SCANLINE, &part);
    if (code == EXR_ERR_SUCCESS) {
        code = exr_initialize_required_attr_simple(file, part, image->width_px, image->height_px, EXR_COMPRESSION_ZIP);
    }
    for (int c = 0; code == EXR_ERR_SUCCESS && c < image->channels; c++) {
        code = exr_add_channel(file, part, channel_names(image->channels)[c], options->exr_half ? EXR_PIXEL_HALF : EXR_PIXEL_FLOAT,
                               EXR_PERCEPTUALLY_LOGARITHMIC, 1, 1);
    }
    for (int a = 0; code == EXR_ERR_SUCCESS && a < options->attribute_count; a++) {
        code = exr_attr_set_string(file, part, options->attribute_name[a], options->attribute_value[a]);
    }
    return code == EXR_ERR_SUCCESS ? exr_write_header(file) : code;
}

/* One chunk's rows as the encoder wants them: the whole image is float, and the core converts to half. */
static void aim_encoder(exr_encode_pipeline_t *encoder, const tsuya_image *image, int first_row)
{
    for (int c = 0; c < encoder->channel_count; c++) {
        exr_coding_channel_info_t *channel = &encoder->channels[c];
        int place = place_of(channel->channel_name);
        channel->encode_from_ptr = (const uint8_t *)(tsuya_image_f32(image, 0, first_row) + place);
        channel->user_pixel_stride = image->channels * (int)sizeof(float);
        channel->user_line_stride = (int)image->row_bytes;
        channel->user_bytes_per_element = sizeof(float);
        channel->user_data_type = EXR_PIXEL_FLOAT;
    }
}

static exr_result_t write_pixels(exr_context_t file, const tsuya_image *image)
{
    int32_t lines = 1;
    exr_encode_pipeline_t encoder = EXR_ENCODE_PIPELINE_INITIALIZER;
    exr_result_t code = exr_get_scanlines_per_chunk(file, 0, &lines);
    for (int y = 0; code == EXR_ERR_SUCCESS && y < image->height_px; y += lines) {
        exr_chunk_info_t chunk;
        code = exr_write_scanline_chunk_info(file, 0, y, &chunk);
        if (code == EXR_ERR_SUCCESS) {
            code = y == 0 ? exr_encoding_initialize(file, 0, &chunk, &encoder) : exr_encoding_update(file, 0, &chunk, &encoder);
        }
        if (code == EXR_ERR_SUCCESS) {
            aim_encoder(&encoder, image, y);
            code = y == 0 ? exr_encoding_choose_default_routines(file, 0, &encoder) : EXR_ERR_SUCCESS;
        }
        if (code == EXR_ERR_SUCCESS) {
            code = exr_encoding_run(file, 0, &encoder);
        }
    }
    exr_encoding_destroy(file, &encoder);
    return code;
}

tsuya_status tsuya_exr_save(const tsuya_image *image, const char *path, const tsuya_image_save_options *options)
{
    exr_context_t file;
    exr_context_initializer_t init = initializer();
    exr_result_t code = exr_start_write(&file, path, EXR_WRITE_FILE_DIRECTLY, &init);
    if (code != EXR_ERR_SUCCESS) {
        return fail_exr(TSUYA_ERROR_IO, path, code);
    }
    exr_set_longname_support(file, 1);
    code = write_header(file, image, options);
    if (code == EXR_ERR_SUCCESS) {
        code = write_pixels(file, image);
    }
    exr_result_t closed = exr_finish(&file);
    code = code == EXR_ERR_SUCCESS ? closed : code;
    return code == EXR_ERR_SUCCESS ? TSUYA_OK : fail_exr(TSUYA_ERROR_IO, path, code);
}
