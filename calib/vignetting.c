#include "calib/color.h"

#include "core/dense.h"
#include "core/memory.h"
#include "core/order.h"

#include <string.h>

enum { RADIAL = 3, CARD_UNKNOWNS = 5, MOST = RADIAL + CARD_UNKNOWNS * TSUYA_COLOR_CARDS, ROUNDS = 8 };

/* Medians of one cell's channels. */
static void read_cell(double rgb[3], float *value, const tsuya_image *photo, int column, int row)
{
    int x0 = (int)((long long)column * photo->width_px / TSUYA_FLAT_COLS), x1 = (int)((long long)(column + 1) * photo->width_px / TSUYA_FLAT_COLS);
    int y0 = (int)((long long)row * photo->height_px / TSUYA_FLAT_ROWS), y1 = (int)((long long)(row + 1) * photo->height_px / TSUYA_FLAT_ROWS);
    for (int c = 0; c < 3; c++) {
        int n = 0, clipped = 0;
        for (int y = y0; y < y1; y++) {
            for (int x = x0; x < x1; x++) {
                value[n++] = tsuya_image_get(photo, x, y, photo->channels >= 3 ? c : 0);
                clipped += value[n - 1] >= 0.998f;
            }
        }
        tsuya_sort_floats(value, (size_t)n);
        float m = value[n / 2];
        m = photo->encoding == TSUYA_ENCODING_SRGB ? tsuya_srgb_decode(m) : m;
        rgb[c] = 10 * clipped > n || !(m > 0.0f) ? NAN : (double)m;
    }
}

tsuya_status tsuya_flat_card_read(tsuya_flat_card *card, const tsuya_image *photo, const char *name)
{
    *card = (tsuya_flat_card){.width_px = photo->width_px, .height_px = photo->height_px};
    if (photo->width_px < 4 * TSUYA_FLAT_COLS || photo->height_px < 4 * TSUYA_FLAT_ROWS) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: %d x %d px; a card of at least %d x %d is expected", name, photo->width_px, photo->height_px,
                          4 * TSUYA_FLAT_COLS, 4 * TSUYA_FLAT_ROWS);
    }
    float *value = tsuya_calloc((size_t)(photo->width_px / TSUYA_FLAT_COLS + 2) * (size_t)(photo->height_px / TSUYA_FLAT_ROWS + 2), sizeof *value);
    int lost = 0;
    if (!value) {
        return TSUYA_ERROR_MEMORY;
    }
    for (int row = 0; row < TSUYA_FLAT_ROWS; row++) {
        for (int column = 0; column < TSUYA_FLAT_COLS; column++) {
            double *rgb = card->rgb[row][column];
            read_cell(rgb, value, photo, column, row);
            lost += !(rgb[0] > 0.0 && rgb[1] > 0.0 && rgb[2] > 0.0);
        }
    }
    tsuya_free(value);
    if (2 * lost > TSUYA_FLAT_COLS * TSUYA_FLAT_ROWS) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: half of the card is clipped or black; expose it to the middle of the range", name);
    }
    return TSUYA_OK;
}

static double radius2(int width, int height, double x, double y)
{
    double u = x - 0.5 * (width - 1), v = y - 0.5 * (height - 1);
    return 4.0 * (u * u + v * v) / ((double)width * width + (double)height * height);
}

double tsuya_vignetting_at(const tsuya_vignetting *v, double x_px, double y_px)
{
    if (v->width_px == 0) {
        return 1.0;
    }
    double r2 = radius2(v->width_px, v->height_px, x_px, y_px);
    return exp(r2 * (v->k[0] + r2 * (v->k[1] + r2 * v->k[2])));
}

/* Derivatives of a cell's logarithm; the columns of its card begin at `first`. */
static void derivatives(double *row, int n, int first, const tsuya_flat_card *card, int column, int line, int channel)
{
    double x = (column + 0.5) * card->width_px / TSUYA_FLAT_COLS - 0.5, y = (line + 0.5) * card->height_px / TSUYA_FLAT_ROWS - 0.5;
    double r2 = radius2(card->width_px, card->height_px, x, y);
    memset(row, 0, (size_t)n * sizeof *row);
    row[0] = r2;
    row[1] = r2 * r2;
    row[2] = r2 * r2 * r2;
    row[first + channel] = 1.0;
    row[first + 3] = 2.0 * (column + 0.5) / TSUYA_FLAT_COLS - 1.0;
    row[first + 4] = 2.0 * (line + 0.5) / TSUYA_FLAT_ROWS - 1.0;
}

typedef struct fit {
    double x[MOST], a[MOST * MOST], b[MOST];
    int n, far;
    double sum, cells, scale; /* of the residuals */
} fit;

static void add_cell(fit *f, const tsuya_flat_card *card, int first, int column, int line, int channel)
{
    double row[MOST], r = log(card->rgb[line][column][channel]);
    derivatives(row, f->n, first, card, column, line, channel);
    for (int i = 0; i < f->n; i++) {
        r -= row[i] * f->x[i];
    }
    double weight = f->scale > 0.0 ? 1.0 / (1.0 + r * r / (4.0 * f->scale * f->scale)) : 1.0; /* Cauchy */
    f->far += fabs(r) > 0.05;
    f->sum += weight * r * r;
    f->cells += weight;
    for (int i = 0; i < f->n; i++) {
        for (int j = 0; j < f->n && row[i] != 0.0; j++) {
            f->a[i * f->n + j] += weight * row[i] * row[j];
        }
        f->b[i] += weight * row[i] * r;
    }
}

static bool one_round(fit *f, const tsuya_flat_card *card, int count)
{
    memset(f->a, 0, sizeof f->a);
    memset(f->b, 0, sizeof f->b);
    f->sum = f->cells = 0.0;
    f->far = 0;
    for (int k = 0; k < count; k++) {
        for (int cell = 0; cell < TSUYA_FLAT_COLS * TSUYA_FLAT_ROWS; cell++) {
            int column = cell % TSUYA_FLAT_COLS, line = cell / TSUYA_FLAT_COLS;
            for (int c = 0; c < 3; c++) {
                if (card[k].rgb[line][column][c] > 0.0) {
                    add_cell(f, &card[k], RADIAL + CARD_UNKNOWNS * k, column, line, c);
                }
            }
        }
    }
    f->scale = f->cells > 0.0 ? sqrt(f->sum / f->cells) + 1e-9 : 0.0;
    if (!tsuya_dense_cholesky(f->a, f->n)) {
        return false;
    }
    tsuya_dense_forward(f->a, f->b, f->n, 1);
    tsuya_dense_backward(f->a, f->b, f->n, 1);
    for (int i = 0; i < f->n; i++) {
        f->x[i] += f->b[i];
    }
    return true;
}

static void take(tsuya_vignetting *v, double balance[3], const fit *f, int count)
{
    double level[3] = {0, 0, 0};
    for (int i = 0; i < RADIAL; i++) {
        v->k[i] = f->x[i];
    }
    v->corner = exp(v->k[0] + v->k[1] + v->k[2]);
    v->residual = f->scale;
    for (int k = 0; k < count; k++) {
        for (int c = 0; c < 3; c++) {
            level[c] += f->x[RADIAL + CARD_UNKNOWNS * k + c] / count;
        }
        v->gradient[k][0] = f->x[RADIAL + CARD_UNKNOWNS * k + 3];
        v->gradient[k][1] = f->x[RADIAL + CARD_UNKNOWNS * k + 4];
    }
    for (int c = 0; balance && c < 3; c++) {
        balance[c] = exp(level[1] - level[c]);
    }
}

tsuya_status tsuya_vignetting_fit(tsuya_vignetting *v, double balance[3], const tsuya_flat_card *card, int count)
{
    *v = (tsuya_vignetting){.width_px = card[0].width_px, .height_px = card[0].height_px};
    fit *f = tsuya_calloc(1, sizeof *f);
    bool fine = true;
    if (!f) {
        return TSUYA_ERROR_MEMORY;
    }
    f->n = RADIAL + CARD_UNKNOWNS * count;
    for (int round = 0; round < ROUNDS && fine; round++) {
        fine = one_round(f, card, count);
    }
    int far = f->far, cells = (int)f->cells + f->far;
    if (fine) {
        take(v, balance, f, count);
    }
    tsuya_free(f);
    if (!fine || 4 * far > cells) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "the card is not flat (%d %% of it lies more than 5 %% off); one even card that fills the picture, out of focus, "
                          "in even light is expected", cells ? 100 * far / cells : 100);
    }
    return TSUYA_OK;
}
