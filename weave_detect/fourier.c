#include "weave_detect/fourier.h"

#include "core/clones.h"
#include "core/memory.h"

#include <math.h>
#include <stddef.h>

tsuya_status tsuya_fourier_create(tsuya_fourier *f, int size)
{
    tsuya_status status = TSUYA_OK;
    *f = (tsuya_fourier){.size = size, .stride = (size / 2 + 1 + 7) / 8 * 8};
    size_t area = (size_t)size * (size_t)f->stride;
    TSUYA_NEW(status, f->re, area);
    TSUYA_NEW(status, f->im, area);
    TSUYA_NEW(status, f->other_re, area);
    TSUYA_NEW(status, f->other_im, area);
    TSUYA_NEW(status, f->cosine, (size_t)size / 2);
    TSUYA_NEW(status, f->sine, (size_t)size / 2);
    for (int k = 0; k < size / 2; k++) {
        f->cosine[k] = (float)cos(2.0 * M_PI * k / size);
        f->sine[k] = (float)-sin(2.0 * M_PI * k / size);
    }
done:
    if (status != TSUYA_OK) {
        tsuya_fourier_free(f);
    }
    return status;
}

void tsuya_fourier_free(tsuya_fourier *f)
{
    tsuya_free(f->re);
    tsuya_free(f->im);
    tsuya_free(f->other_re);
    tsuya_free(f->other_im);
    tsuya_free(f->cosine);
    tsuya_free(f->sine);
    *f = (tsuya_fourier){0};
}

typedef struct lines {
    float *re, *im;
} lines;

/* One butterfly of rows of `width` numbers: sum, and difference turned by w. */
TSUYA_CLONES("avx2", "default") static void butterfly(float *restrict sum_re, float *restrict sum_im,
                                                                        float *restrict turned_re, float *restrict turned_im,
                                                                        const float *restrict a_re, const float *restrict a_im,
                                                                        const float *restrict b_re, const float *restrict b_im,
                                                                        float w_re, float w_im, int width)
{
    for (int i = 0; i < width; i++) {
        float dr = a_re[i] - b_re[i], di = a_im[i] - b_im[i];
        sum_re[i] = a_re[i] + b_re[i];
        sum_im[i] = a_im[i] + b_im[i];
        turned_re[i] = dr * w_re - di * w_im;
        turned_im[i] = dr * w_im + di * w_re;
    }
}

/* Transforms along the rows' index; `width` columns are used of each row of `stride`.  The result is in `x`. */
static void transform(const tsuya_fourier *f, lines *x, lines *y, int width)
{
    size_t stride = (size_t)f->stride;
    int half = f->size / 2;
    for (int l = half, m = 1; l >= 1; l /= 2, m *= 2) {
        for (int j = 0; j < l; j++) {
            float w_re = f->cosine[j * m], w_im = f->sine[j * m];
            for (int k = 0; k < m; k++) {
                size_t a = (size_t)(k + j * m) * stride, b = (size_t)(k + j * m + half) * stride;
                size_t s = (size_t)(k + 2 * j * m) * stride, d = s + (size_t)m * stride;
                butterfly(y->re + s, y->im + s, y->re + d, y->im + d, x->re + a, x->im + a, x->re + b, x->im + b, w_re, w_im, width);
            }
        }
        lines swap = *x;
        *x = *y;
        *y = swap;
    }
}

/* Takes the two real columns that travelled as one apart, and turns rows into columns: out at x · stride + ky. */
static void separate(const tsuya_fourier *f, const lines *z, lines *out)
{
    int size = f->size, half = size / 2;
    size_t stride = (size_t)f->stride;
    for (int ky = 0; ky <= half; ky++) {
        const float *re = z->re + (size_t)ky * stride, *im = z->im + (size_t)ky * stride;
        const float *mirror_re = z->re + (size_t)((size - ky) % size) * stride, *mirror_im = z->im + (size_t)((size - ky) % size) * stride;
        for (int c = 0; c < half; c++) {
            size_t first = (size_t)c * stride + (size_t)ky, second = (size_t)(c + half) * stride + (size_t)ky;
            out->re[first] = 0.5f * (re[c] + mirror_re[c]);
            out->im[first] = 0.5f * (im[c] - mirror_im[c]);
            out->re[second] = 0.5f * (im[c] + mirror_im[c]);
            out->im[second] = 0.5f * (mirror_re[c] - re[c]);
        }
    }
}

void tsuya_fourier_run(tsuya_fourier *f, const float *values)
{
    int size = f->size, half = size / 2;
    lines x = {f->re, f->im}, y = {f->other_re, f->other_im};
    for (int row = 0; row < size; row++) {
        const float *v = values + (size_t)row * (size_t)size;
        float *re = x.re + (size_t)row * (size_t)f->stride, *im = x.im + (size_t)row * (size_t)f->stride;
        for (int c = 0; c < half; c++) {
            re[c] = v[c];
            im[c] = v[c + half];
        }
    }
    transform(f, &x, &y, half);
    separate(f, &x, &y);
    transform(f, &y, &x, half + 1);
    f->re = y.re;
    f->im = y.im;
    f->other_re = x.re;
    f->other_im = x.im;
}
