#include "core/matching.h"

#include "core/clones.h"
#include "core/memory.h"

#include <math.h>
#include <string.h>
#ifdef __x86_64__
#include <immintrin.h>
#endif

enum {
    LENGTH = TSUYA_DESCRIPTOR_LENGTH,
    PAIRS = LENGTH / 2, QUADS = LENGTH / 4, /* of a descriptor's numbers, multiplied and added by one instruction */
    ROWS = 6,    /* of a, at once in registers */
    LANES = 16,  /* columns (features of b) at once in registers */
    CHUNK = 512, /* columns at once in the cache */
};
static const double MOST_ANGLE_RAD = 0.7, MOST_RATIO = 0.8;
/* Descriptors have this length squared, up to rounding. */
static const double LENGTH_SQUARED = 512.0 * 512.0;

/* The two greatest products seen, and whose the greatest is. */
typedef struct nearest {
    int32_t best, second;
    int index;
} nearest;

static void nearest_see(nearest *n, int32_t product, int index)
{
    if (product > n->best) {
        *n = (nearest){product, n->best, index};
    } else if (product > n->second) {
        n->second = product;
    }
}

static void nearest_join(nearest *n, const nearest *later)
{
    if (later->index >= 0) {
        int32_t second = later->second;
        nearest_see(n, later->best, later->index);
        n->second = second > n->second ? second : n->second;
    }
}

static bool is_distinct(const nearest *n)
{
    if (n->index < 0) {
        return false;
    }
    double best = acos(fmin((double)n->best / LENGTH_SQUARED, 1.0)), second = acos(fmin(fmax((double)n->second, 0.0) / LENGTH_SQUARED, 1.0));
    return best <= MOST_ANGLE_RAD && best < MOST_RATIO * second;
}

/* out[row][CHUNK] = start + Σ row column.  `row`: [groups][ROWS], the numbers of a group of a descriptor each.  Groups are pairs of 16 bits
 * or quads of bytes: there columns are less 128, for one factor has a sign, and start[row] is 128 times the sum of its numbers. */
typedef void products(int32_t *restrict out, const int32_t *restrict row, const int32_t start[ROWS], const void *restrict columns);
typedef struct kernel { products *run; bool bytes; } kernel;

/* What both sides need, laid out for the products. */
typedef struct comparison {
    const tsuya_sift *a, *b;
    const tsuya_guide *guide;
    void *column;  /* [chunks of LANES features of b][groups][LANES][numbers of a group], filled up with zeros */
    float *line;   /* Mᵀ x_b of the epipolar guide: [2][columns] */
    float *x, *y;  /* positions in b, not a number beyond its features */
    int columns;   /* a multiple of CHUNK */
    kernel kernel;
} comparison;

static void products_portable(int32_t *restrict out, const int32_t *restrict row, const int32_t start[ROWS], const void *restrict columns)
{
    const int16_t *column = columns;
    (void)start;
    for (int j = 0; j < CHUNK; j += LANES) {
        int32_t sum[ROWS][LANES] = {{0}};
        for (int k = 0; k < PAIRS; k++) {
            const int16_t *c = &column[(j * PAIRS + k * LANES) * 2];
            for (int i = 0; i < ROWS; i++) {
                int32_t low = row[k * ROWS + i] & 0xffff, high = row[k * ROWS + i] >> 16;
                for (int l = 0; l < LANES; l++) {
                    sum[i][l] += c[2 * l] * low + c[2 * l + 1] * high;
                }
            }
        }
        for (int i = 0; i < ROWS; i++) {
            memcpy(&out[i * CHUNK + j], sum[i], sizeof sum[i]);
        }
    }
}

#ifdef __x86_64__
__attribute__((target("avx2"))) static void products_avx2(int32_t *restrict out, const int32_t *restrict row, const int32_t start[ROWS], const void *restrict columns)
{
    const int16_t *column = columns;
    (void)start;
    for (int j = 0; j < CHUNK; j += LANES) {
        __m256i low[ROWS], high[ROWS];
        for (int i = 0; i < ROWS; i++) {
            low[i] = high[i] = _mm256_setzero_si256();
        }
        for (int k = 0; k < PAIRS; k++) {
            const __m256i *c = (const __m256i *)(const void *)&column[(j * PAIRS + k * LANES) * 2];
            __m256i c_low = _mm256_loadu_si256(c), c_high = _mm256_loadu_si256(c + 1);
            for (int i = 0; i < ROWS; i++) {
                __m256i r = _mm256_set1_epi32(row[k * ROWS + i]);
                low[i] = _mm256_add_epi32(low[i], _mm256_madd_epi16(c_low, r));
                high[i] = _mm256_add_epi32(high[i], _mm256_madd_epi16(c_high, r));
            }
        }
        for (int i = 0; i < ROWS; i++) {
            _mm256_storeu_si256((__m256i *)(void *)&out[i * CHUNK + j], low[i]);
            _mm256_storeu_si256((__m256i *)(void *)&out[i * CHUNK + j + LANES / 2], high[i]);
        }
    }
}

__attribute__((target("avx512f,avx512vnni"))) static void
products_avx512(int32_t *restrict out, const int32_t *restrict row, const int32_t start[ROWS], const void *restrict columns)
{
    const int8_t *column = columns;
    for (int j = 0; j < CHUNK; j += 2 * LANES) {
        __m512i low[ROWS], high[ROWS];
        for (int i = 0; i < ROWS; i++) {
            low[i] = high[i] = _mm512_set1_epi32(start[i]);
        }
        for (int k = 0; k < QUADS; k++) {
            __m512i c_low = _mm512_loadu_si512(&column[(j * QUADS + k * LANES) * 4]);
            __m512i c_high = _mm512_loadu_si512(&column[((j + LANES) * QUADS + k * LANES) * 4]);
            for (int i = 0; i < ROWS; i++) {
                __m512i r = _mm512_set1_epi32(row[k * ROWS + i]);
                low[i] = _mm512_dpbusd_epi32(low[i], r, c_low);
                high[i] = _mm512_dpbusd_epi32(high[i], r, c_high);
            }
        }
        for (int i = 0; i < ROWS; i++) {
            _mm512_storeu_si512(&out[i * CHUNK + j], low[i]);
            _mm512_storeu_si512(&out[i * CHUNK + j + LANES], high[i]);
        }
    }
}
#endif

static kernel fastest_kernel(void)
{
#ifdef __x86_64__
    if (__builtin_cpu_supports("avx512vnni")) {
        return (kernel){products_avx512, true};
    }
    if (__builtin_cpu_supports("avx2")) {
        return (kernel){products_avx2, false};
    }
#endif
    return (kernel){products_portable, false};
}

/* Products of matches the guide forbids become −1. */
static void forbid(int32_t *product, const comparison *job, int row, int first)
{
    const double *m = job->guide->matrix;
    float ax = job->a->position[row].x, ay = job->a->position[row].y;
    float l[3];
    for (int i = 0; i < 3; i++) {
        l[i] = (float)(m[3 * i] * (double)ax + m[3 * i + 1] * (double)ay + m[3 * i + 2]);
    }
    const float most = (float)(job->guide->most * job->guide->most), own = l[0] * l[0] + l[1] * l[1];
    const float *x = job->x + first, *y = job->y + first, *lx = job->line + first, *ly = job->line + job->columns + first;
    if (job->guide->kind == TSUYA_GUIDE_EPIPOLAR) {
        for (int j = 0; j < CHUNK; j++) {
            float off = l[0] * x[j] + l[1] * y[j] + l[2];
            product[j] = off * off <= most * (own + lx[j] * lx[j] + ly[j] * ly[j]) ? product[j] : -1;
        }
    } else {
        for (int j = 0; j < CHUNK; j++) {
            float dx = l[0] / l[2] - x[j], dy = l[1] / l[2] - y[j];
            product[j] = dx * dx + dy * dy <= most ? product[j] : -1;
        }
    }
}

/* Whether any of LANES products is among the greatest two of its row or its column. */
TSUYA_CLONES("arch=x86-64-v3", "default") static bool any_counts(const int32_t *restrict product, const int32_t *restrict second_b, int32_t second_a)
{
    int32_t any = 0;
    for (int l = 0; l < LANES; l++) {
        any |= (product[l] > second_a) | (product[l] > second_b[l]);
    }
    return any;
}

/* Of one feature of b. */
static size_t column_bytes(const kernel *k) { return k->bytes ? LENGTH : LENGTH * sizeof(int16_t); }

typedef struct packed_rows { int32_t group[ROWS * PAIRS], start[ROWS]; } packed_rows;

static void pack_row(packed_rows *packed, int i, const uint8_t *d, bool bytes)
{
    int32_t sum = 0;
    if (!bytes) {
        for (int k = 0; k < PAIRS; k++) {
            packed->group[k * ROWS + i] = d[2 * k] | d[2 * k + 1] << 16;
        }
        return;
    }
    for (int k = 0; k < QUADS; k++) {
        memcpy(&packed->group[k * ROWS + i], d + 4 * k, 4);
    }
    for (int k = 0; k < LENGTH; k++) {
        sum += d[k];
    }
    packed->start[i] = 128 * sum;
}

/* Rows [row, row + ROWS) of a against one chunk of b.  `second`: in_b's, so that most products cost one comparison of many. */
static void compare_chunk(nearest *in_a, nearest *in_b, int32_t *second, const packed_rows *packed, const comparison *job, int row, int chunk, int last_row)
{
    int32_t product[ROWS * CHUNK];
    int end = job->b->count - chunk < CHUNK ? job->b->count - chunk : CHUNK;
    job->kernel.run(product, packed->group, packed->start, (const char *)job->column + (size_t)chunk * column_bytes(&job->kernel));
    for (int i = 0; i < ROWS && row + i < last_row; i++) {
        int32_t *p = product + i * CHUNK;
        nearest *own = &in_a[row + i];
        if (job->guide) {
            forbid(p, job, row + i, chunk);
        }
        for (int from = 0; from < end; from += LANES) {
            if (!any_counts(p + from, second + chunk + from, own->second)) {
                continue;
            }
            for (int j = from; j < from + LANES && j < end; j++) {
                if (p[j] > own->second) {
                    nearest_see(own, p[j], chunk + j);
                }
                if (p[j] > second[chunk + j]) {
                    nearest_see(&in_b[chunk + j], p[j], row + i);
                    second[chunk + j] = in_b[chunk + j].second;
                }
            }
        }
    }
}

static void compare_rows(nearest *in_a, nearest *in_b, int32_t *second, const comparison *job, int first, int last)
{
    for (int chunk = 0; chunk < job->columns; chunk += CHUNK) {
        for (int row = first; row < last; row += ROWS) {
            packed_rows packed = {{0}, {0}};
            for (int i = 0; i < ROWS && row + i < last; i++) {
                pack_row(&packed, i, &job->a->descriptor[(size_t)(row + i) * LENGTH], job->kernel.bytes);
            }
            compare_chunk(in_a, in_b, second, &packed, job, row, chunk, last);
        }
    }
}

static void place_column(comparison *job, int j, const uint8_t *d)
{
    const size_t first = (size_t)(j / LANES * LANES) * LENGTH;
    for (int k = 0; k < LENGTH; k++) {
        if (job->kernel.bytes) {
            ((int8_t *)job->column)[first + (size_t)((k / 4 * LANES + j % LANES) * 4 + k % 4)] = (int8_t)(d[k] - 128);
        } else {
            ((int16_t *)job->column)[first + (size_t)((k / 2 * LANES + j % LANES) * 2 + k % 2)] = d[k];
        }
    }
}

static tsuya_status job_create(comparison *job, const tsuya_sift *a, const tsuya_sift *b, const tsuya_guide *guide)
{
    int columns = (b->count + CHUNK - 1) / CHUNK * CHUNK;
    *job = (comparison){.a = a, .b = b, .guide = guide && guide->kind != TSUYA_GUIDE_NONE ? guide : NULL, .columns = columns, .kernel = fastest_kernel()};
    job->column = tsuya_calloc((size_t)columns, column_bytes(&job->kernel));
    job->x = tsuya_calloc((size_t)columns * 4, sizeof *job->x);
    if (!job->column || !job->x) {
        return TSUYA_ERROR_MEMORY;
    }
    job->y = job->x + columns;
    job->line = job->y + columns;
    for (int j = 0; j < columns; j++) {
        bool real = j < b->count;
        job->x[j] = real ? b->position[j].x : NAN;
        job->y[j] = real ? b->position[j].y : NAN;
        if (real) {
            place_column(job, j, &b->descriptor[(size_t)j * LENGTH]);
        }
        for (int i = 0; job->guide && i < 2; i++) {
            const double *m = guide->matrix;
            job->line[i * columns + j] = (float)(m[i] * (double)job->x[j] + m[3 + i] * (double)job->y[j] + m[6 + i]);
        }
    }
    return TSUYA_OK;
}

static void job_free(comparison *job)
{
    tsuya_free(job->column);
    tsuya_free(job->x);
}

static void clear(nearest *n, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        n[i] = (nearest){-1, -1, -1};
    }
}

tsuya_status tsuya_match_features(tsuya_match **match, int *count, const tsuya_sift *a, const tsuya_sift *b,
                                  const tsuya_guide *guide, int threads)
{
    *match = NULL;
    *count = 0;
    if (a->count == 0 || b->count == 0) {
        return TSUYA_OK;
    }
    comparison job;
    nearest *in_a = tsuya_calloc((size_t)a->count, sizeof *in_a);
    nearest *in_b = tsuya_calloc((size_t)b->count * (size_t)threads, sizeof *in_b);
    const size_t columns = (size_t)(b->count + CHUNK - 1) / CHUNK * CHUNK;
    int32_t *second = tsuya_calloc(columns * (size_t)threads, sizeof *second);
    *match = tsuya_calloc((size_t)a->count, sizeof **match);
    tsuya_status status = job_create(&job, a, b, guide);
    status = in_a && in_b && second && *match ? status : TSUYA_ERROR_MEMORY;
    if (status == TSUYA_OK) {
        clear(in_a, (size_t)a->count);
        clear(in_b, (size_t)b->count * (size_t)threads);
#pragma omp parallel for schedule(static, 1) num_threads(threads)
        for (int t = 0; t < threads; t++) {
            int first = (int)((int64_t)a->count * t / threads), last = (int)((int64_t)a->count * (t + 1) / threads);
            for (size_t j = 0; j < columns; j++) {
                second[(size_t)t * columns + j] = -1;
            }
            compare_rows(in_a, in_b + (size_t)t * (size_t)b->count, second + (size_t)t * columns, &job, first, last);
        }
        for (int t = 1; t < threads; t++) {
            for (int j = 0; j < b->count; j++) {
                nearest_join(&in_b[j], &in_b[(size_t)t * (size_t)b->count + (size_t)j]);
            }
        }
        for (int i = 0; i < a->count; i++) {
            if (is_distinct(&in_a[i]) && in_b[in_a[i].index].index == i && is_distinct(&in_b[in_a[i].index])) {
                (*match)[(*count)++] = (tsuya_match){(uint32_t)i, (uint32_t)in_a[i].index};
            }
        }
    } else {
        tsuya_free(*match);
        *match = NULL;
    }
    job_free(&job);
    tsuya_free(in_a);
    tsuya_free(in_b);
    tsuya_free(second);
    return status;
}

void tsuya_sift_free(tsuya_sift *features)
{
    tsuya_free(features->position);
    tsuya_free(features->descriptor);
    *features = (tsuya_sift){0};
}

void tsuya_sift_undistort(tsuya_sift *features, const tsuya_camera *camera)
{
    for (int i = 0; i < features->count; i++) {
        tsuya_vec3 ray;
        tsuya_sift_position *p = &features->position[i];
        /* COLMAP puts the centre of the first pixel at 0.5 */
        bool seen = tsuya_camera_unproject(camera, (tsuya_vec2){(double)p->x - 0.5, (double)p->y - 0.5}, &ray) && ray.z > 0.0;
        *p = seen ? (tsuya_sift_position){(float)(ray.x / ray.z), (float)(ray.y / ray.z)} : (tsuya_sift_position){NAN, NAN};
    }
}

tsuya_guide tsuya_guide_of_poses(tsuya_pose a_from_world, tsuya_pose b_from_world, double most)
{
    tsuya_pose b_from_a = tsuya_pose_compose(b_from_world, tsuya_pose_inverse(a_from_world));
    tsuya_vec3 t = b_from_a.translation;
    tsuya_mat3 cross = {{{0.0, -t.z, t.y}, {t.z, 0.0, -t.x}, {-t.y, t.x, 0.0}}};
    tsuya_mat3 essential = tsuya_mat3_multiply(cross, b_from_a.rotation);
    tsuya_guide guide = {.kind = TSUYA_GUIDE_EPIPOLAR, .most = most};
    for (int i = 0; i < 9; i++) {
        guide.matrix[i] = essential.e[i / 3][i % 3];
    }
    return guide;
}
