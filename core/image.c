#include "core/image.h"

#include "core/memory.h"

#include <math.h>
#include <string.h>

enum { LARGEST_SIDE = 65535, MOST_CHANNELS = 64 };

static size_t sample_bytes(tsuya_sample sample)
{
    return sample == TSUYA_SAMPLE_U8 ? 1 : sample == TSUYA_SAMPLE_U16 ? 2 : 4;
}

tsuya_status tsuya_image_create(tsuya_image *image, int width_px, int height_px, int channels, tsuya_sample sample,
                                tsuya_encoding encoding)
{
    *image = (tsuya_image){0};
    if (width_px < 1 || height_px < 1 || width_px > LARGEST_SIDE || height_px > LARGEST_SIDE || channels < 1 || channels > MOST_CHANNELS) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "an image of %d x %d pixels with %d channels; 1 … %d pixels a side and 1 … %d channels are accepted",
                          width_px, height_px, channels, LARGEST_SIDE, MOST_CHANNELS);
    }
    size_t row_bytes = (size_t)width_px * (size_t)channels * sample_bytes(sample);
    void *data = tsuya_calloc((size_t)height_px, row_bytes);
    if (!data) {
        return TSUYA_ERROR_MEMORY;
    }
    *image = (tsuya_image){.width_px = width_px, .height_px = height_px, .channels = channels, .sample = sample,
                           .encoding = encoding, .row_bytes = row_bytes, .data = data};
    return TSUYA_OK;
}

tsuya_status tsuya_image_copy(tsuya_image *copy, const tsuya_image *image)
{
    TSUYA_TRY(tsuya_image_create(copy, image->width_px, image->height_px, image->channels, image->sample, image->encoding));
    for (int y = 0; y < image->height_px; y++) {
        memcpy((char *)copy->data + (size_t)y * copy->row_bytes, (const char *)image->data + (size_t)y * image->row_bytes, copy->row_bytes);
    }
    return TSUYA_OK;
}

void tsuya_image_free(tsuya_image *image)
{
    tsuya_free(image->data);
    *image = (tsuya_image){0};
}

float tsuya_srgb_encode(float linear)
{
    if (!(linear > 0.0f)) {
        return 0.0f;
    }
    if (linear >= 1.0f) {
        return 1.0f;
    }
    return linear <= 0.0031308f ? 12.92f * linear : (float)(1.055 * pow((double)linear, 1.0 / 2.4) - 0.055);
}

float tsuya_srgb_decode(float encoded)
{
    if (!(encoded > 0.0f)) {
        return 0.0f;
    }
    return encoded <= 0.04045f ? encoded / 12.92f : (float)pow(((double)encoded + 0.055) / 1.055, 2.4);
}

static float get_sample(const tsuya_image *image, int x, int y, int channel)
{
    switch (image->sample) {
    case TSUYA_SAMPLE_U8: return (float)tsuya_image_u8(image, x, y)[channel] / 255.0f;
    case TSUYA_SAMPLE_U16: return (float)tsuya_image_u16(image, x, y)[channel] / 65535.0f;
    default: return tsuya_image_f32(image, x, y)[channel];
    }
}

float tsuya_image_get(const tsuya_image *image, int x, int y, int channel)
{
    return get_sample(image, x, y, channel);
}

static void set_sample(tsuya_image *image, int x, int y, int channel, float value)
{
    if (image->sample == TSUYA_SAMPLE_F32) {
        tsuya_image_f32(image, x, y)[channel] = value;
        return;
    }
    float clamped = value >= 1.0f ? 1.0f : value > 0.0f ? value : 0.0f; /* NaN gives 0 */
    if (image->sample == TSUYA_SAMPLE_U8) {
        tsuya_image_u8(image, x, y)[channel] = (uint8_t)(clamped * 255.0f + 0.5f);
    } else {
        tsuya_image_u16(image, x, y)[channel] = (uint16_t)(clamped * 65535.0f + 0.5f);
    }
}

/* Decoded values of the 256 or 65536 codes of an sRGB image, so that a conversion costs no power per sample. */
static tsuya_status decoding_table(float **table, const tsuya_image *in)
{
    *table = NULL;
    if (in->sample == TSUYA_SAMPLE_F32) {
        return TSUYA_OK;
    }
    int codes = in->sample == TSUYA_SAMPLE_U8 ? 256 : 65536;
    *table = tsuya_calloc((size_t)codes, sizeof **table);
    if (!*table) {
        return TSUYA_ERROR_MEMORY;
    }
    for (int i = 0; i < codes; i++) {
        (*table)[i] = tsuya_srgb_decode((float)i / (float)(codes - 1));
    }
    return TSUYA_OK;
}

tsuya_status tsuya_image_convert(tsuya_image *out, const tsuya_image *in, tsuya_sample sample, tsuya_encoding encoding)
{
    bool decode = in->encoding == TSUYA_ENCODING_SRGB && encoding == TSUYA_ENCODING_LINEAR;
    bool encode = in->encoding == TSUYA_ENCODING_LINEAR && encoding == TSUYA_ENCODING_SRGB;
    float *table = NULL;
    TSUYA_TRY(tsuya_image_create(out, in->width_px, in->height_px, in->channels, sample, encoding));
    if (decode && decoding_table(&table, in) != TSUYA_OK) {
        tsuya_image_free(out);
        return TSUYA_ERROR_MEMORY;
    }
    int light = in->channels == 4 || in->channels == 2 ? in->channels - 1 : in->channels; /* alpha is no light */
#pragma omp parallel for
    for (int y = 0; y < in->height_px; y++) {
        for (int x = 0; x < in->width_px; x++) {
            for (int c = 0; c < in->channels; c++) {
                float value = get_sample(in, x, y, c);
                if (decode && c < light) {
                    value = in->sample == TSUYA_SAMPLE_U8    ? table[tsuya_image_u8(in, x, y)[c]]
                          : in->sample == TSUYA_SAMPLE_U16 ? table[tsuya_image_u16(in, x, y)[c]]
                                                             : tsuya_srgb_decode(value);
                } else if (encode && c < light) {
                    value = tsuya_srgb_encode(value);
                }
                set_sample(out, x, y, c, value);
            }
        }
    }
    tsuya_free(table);
    return TSUYA_OK;
}

/* One channel of `n` pixels from x on, and grey back: the sample's type is asked once a block, so that the loops are simple ones. */
enum { BLOCK = 256 };

static void load_block(float *restrict value, const tsuya_image *in, int x, int y, int n, int channel)
{
    int step = in->channels;
    if (in->sample == TSUYA_SAMPLE_U8) {
        const uint8_t *from = tsuya_image_u8(in, x, y) + channel;
        for (int i = 0; i < n; i++) {
            value[i] = (float)from[i * step] / 255.0f;
        }
    } else if (in->sample == TSUYA_SAMPLE_U16) {
        const uint16_t *from = tsuya_image_u16(in, x, y) + channel;
        for (int i = 0; i < n; i++) {
            value[i] = (float)from[i * step] / 65535.0f;
        }
    } else {
        const float *from = tsuya_image_f32(in, x, y) + channel;
        for (int i = 0; i < n; i++) {
            value[i] = from[i * step];
        }
    }
}

static void store_block(tsuya_image *out, const float *restrict value, int x, int y, int n)
{
    if (out->sample == TSUYA_SAMPLE_U8) {
        uint8_t *to = tsuya_image_u8(out, x, y);
        for (int i = 0; i < n; i++) {
            float clamped = value[i] >= 1.0f ? 1.0f : value[i] > 0.0f ? value[i] : 0.0f; /* NaN gives 0 */
            to[i] = (uint8_t)(int)(clamped * 255.0f + 0.5f);
        }
        return;
    }
    for (int i = 0; i < n; i++) {
        set_sample(out, x + i, y, 0, value[i]);
    }
}

static void grey_block(tsuya_image *out, const tsuya_image *in, int x, int y, int n)
{
    float value[3][BLOCK];
    int used = in->channels < 3 ? 1 : 3;
    for (int c = 0; c < used; c++) {
        load_block(value[c], in, x, y, n, c);
    }
    for (int i = 0; i < n && used == 3; i++) {
        value[0][i] = 0.2126f * value[0][i] + 0.7152f * value[1][i] + 0.0722f * value[2][i];
    }
    store_block(out, value[0], x, y, n);
}

tsuya_status tsuya_image_grey(tsuya_image *out, const tsuya_image *in, tsuya_sample sample)
{
    TSUYA_TRY(tsuya_image_create(out, in->width_px, in->height_px, 1, sample, in->encoding));
#pragma omp parallel for
    for (int y = 0; y < in->height_px; y++) {
        for (int x = 0; x < in->width_px; x += BLOCK) {
            grey_block(out, in, x, y, in->width_px - x < BLOCK ? in->width_px - x : BLOCK);
        }
    }
    return TSUYA_OK;
}

/* For output index i along one axis: the input cells that its footprint covers, and their weights (sum 1). */
typedef struct axis {
    int *first, *count;
    double *weight; /* `most` per output */
    int most;
} axis;

static tsuya_status axis_create(axis *a, int from, int to)
{
    *a = (axis){0};
    double step = (double)from / to;
    a->most = to <= from ? (int)ceil(step) + 2 : 2;
    tsuya_status status = TSUYA_OK;
    TSUYA_NEW(status, a->first, (size_t)to);
    TSUYA_NEW(status, a->count, (size_t)to);
    TSUYA_NEW(status, a->weight, (size_t)to * (size_t)a->most);
    for (int i = 0; i < to; i++) {
        double *w = a->weight + (size_t)i * (size_t)a->most;
        if (to <= from) { /* reduce: area of overlap */
            double low = i * step, high = (i + 1) * step;
            int first = (int)floor(low), last = (int)ceil(high) - 1;
            last = last >= from ? from - 1 : last;
            a->first[i] = first;
            a->count[i] = last - first + 1;
            double sum = 0.0;
            for (int k = first; k <= last; k++) {
                w[k - first] = fmin(high, k + 1) - fmax(low, k);
                sum += w[k - first];
            }
            for (int k = 0; k < a->count[i]; k++) {
                w[k] /= sum;
            }
        } else { /* enlarge: linear between centres, clamped */
            double at = fmin(fmax((i + 0.5) * step - 0.5, 0.0), from - 1.0);
            int first = (int)floor(at);
            a->first[i] = first;
            a->count[i] = first + 1 < from ? 2 : 1;
            w[0] = a->count[i] == 2 ? 1.0 - (at - first) : 1.0;
            w[1] = at - first;
        }
    }
done:
    return status;
}

static void axis_free(axis *a)
{
    tsuya_free(a->first);
    tsuya_free(a->count);
    tsuya_free(a->weight);
}

tsuya_status tsuya_image_resize(tsuya_image *out, const tsuya_image *in, int width_px, int height_px)
{
    axis ax = {0}, ay = {0};
    tsuya_status status = tsuya_image_create(out, width_px, height_px, in->channels, in->sample, in->encoding);
    if (status == TSUYA_OK) {
        status = axis_create(&ax, in->width_px, width_px);
    }
    if (status == TSUYA_OK) {
        status = axis_create(&ay, in->height_px, height_px);
    }
    if (status == TSUYA_OK) {
#pragma omp parallel for
        for (int y = 0; y < height_px; y++) {
            for (int x = 0; x < width_px; x++) {
                for (int c = 0; c < in->channels; c++) {
                    double sum = 0.0;
                    for (int j = 0; j < ay.count[y]; j++) {
                        double row = 0.0;
                        for (int i = 0; i < ax.count[x]; i++) {
                            row += ax.weight[(size_t)x * (size_t)ax.most + (size_t)i] * (double)get_sample(in, ax.first[x] + i, ay.first[y] + j, c);
                        }
                        sum += ay.weight[(size_t)y * (size_t)ay.most + (size_t)j] * row;
                    }
                    set_sample(out, x, y, c, (float)sum);
                }
            }
        }
    } else {
        tsuya_image_free(out);
    }
    axis_free(&ax);
    axis_free(&ay);
    return status;
}

void tsuya_image_sample_bilinear(const tsuya_image *image, double x_px, double y_px, float *out)
{
    double cx = fmin(fmax(x_px, 0.0), image->width_px - 1.0), cy = fmin(fmax(y_px, 0.0), image->height_px - 1.0);
    int x = (int)cx, y = (int)cy;
    int right = x + 1 < image->width_px ? x + 1 : x, below = y + 1 < image->height_px ? y + 1 : y;
    float fx = (float)(cx - x), fy = (float)(cy - y);
    for (int c = 0; c < image->channels; c++) {
        float top = get_sample(image, x, y, c) * (1 - fx) + get_sample(image, right, y, c) * fx;
        float bottom = get_sample(image, x, below, c) * (1 - fx) + get_sample(image, right, below, c) * fx;
        out[c] = top * (1 - fy) + bottom * fy;
    }
}
