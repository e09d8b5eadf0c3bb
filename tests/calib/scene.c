#include "scene.h"

#include "support.h"

#include "calib/apriltag_adapter.h"

enum { SAMPLES = 20 };

scene_look scene_look_default(void)
{
    return (scene_look){.blur_px = 0.6, .black = 0.12, .white = 0.85, .background = 0.5, .noise = 2.0 / 255.0,
                        .sample = TSUYA_SAMPLE_U8, .row_gain = 1.0, .seed = 1};
}

void scene_begin(tsuya_image *image, int width_px, int height_px, const scene_look *look)
{
    assert_ok(tsuya_image_create(image, width_px, height_px, 1, TSUYA_SAMPLE_F32, TSUYA_ENCODING_LINEAR));
    for (int y = 0; y < height_px; y++) {
        for (int x = 0; x < width_px; x++) {
            *tsuya_image_f32(image, x, y) = (float)look->background;
        }
    }
}

tsuya_vec2 scene_corner(const tsuya_board *board, int tag, int corner, const tsuya_camera *camera, tsuya_pose pose)
{
    tsuya_vec2 pixel;
    assert_true(tsuya_camera_project(camera, tsuya_pose_apply(pose, tsuya_board_corner(board, tag, corner)), &pixel));
    return pixel;
}

typedef struct print {
    tsuya_tag_pattern *pattern; /* of the plate's tags */
    const tsuya_board *board;
    const tsuya_board_plate *plate;
    double left, bottom, right, top, margin; /* of the paper, metres */
    const scene_look *look;
} print;

/* Reflectance at a place of the plate; negative beside the paper. */
static double ink(const print *p, double x, double y)
{
    if (x < p->left || x > p->right || y < p->bottom || y > p->top) {
        return -1.0;
    }
    int first = 0, last = p->plate->tag_count - 1;
    if (p->plate->cols > 0) { /* of a grid only the tag whose square it is */
        double pitch = p->plate->tag_m + p->plate->gap_m;
        int column = (int)floor((x + 0.5 * p->plate->gap_m) / pitch), row = (int)floor((y + 0.5 * p->plate->gap_m) / pitch);
        column = column < 0 ? 0 : column < p->plate->cols ? column : p->plate->cols - 1;
        row = row < 0 ? 0 : row < p->plate->rows ? row : p->plate->rows - 1;
        first = last = row * p->plate->cols + column;
    }
    for (int i = first; i <= last; i++) {
        const tsuya_board_tag *tag = &p->board->tag[p->plate->first_tag + i];
        double size = tag->corner_m[1].x - tag->corner_m[0].x;
        const tsuya_tag_pattern *pattern = &p->pattern[i];
        double cell = size / pattern->border_width, rim = 0.5 * (pattern->width - pattern->border_width);
        int column = (int)floor((x - tag->corner_m[0].x) / cell + rim), row = (int)floor((tag->corner_m[3].y - y) / cell + rim);
        if (column >= 0 && row >= 0 && column < pattern->width && row < pattern->width) {
            return pattern->white[row * pattern->width + column] ? p->look->white : p->look->black;
        }
    }
    return p->look->white;
}

static double uniform(uint64_t seed, uint64_t stream, uint64_t counter) { return tsuya_random_uniform(seed, stream, counter); }

/* Inverse of the normal distribution (Acklam's rational form is not needed: bisection on erf is exact and quick enough). */
static const double *normal_quantiles(void)
{
    static double table[4096];
    static bool made;
    if (!made) {
        for (int i = 0; i < 4096; i++) {
            double target = (i + 0.5) / 4096.0, low = -6.0, high = 6.0;
            for (int k = 0; k < 60; k++) {
                double middle = 0.5 * (low + high);
                *(0.5 * erfc(-middle * M_SQRT1_2) < target ? &low : &high) = middle;
            }
            table[i] = 0.5 * (low + high);
        }
        made = true;
    }
    return table;
}

static bool place(tsuya_vec2 *on_plate, const print *p, const tsuya_camera *camera, tsuya_pose pose, double x, double y)
{
    tsuya_vec3 ray;
    if (!tsuya_camera_unproject(camera, (tsuya_vec2){x, y}, &ray)) {
        return false;
    }
    tsuya_vec3 direction = tsuya_mat3_apply_transposed(pose.rotation, ray), eye = tsuya_pose_center(pose);
    double height = 0.0;
    for (int i = 0; i < 8; i++) {
        double s = (height - eye.z) / direction.z;
        on_plate->x = eye.x + s * direction.x;
        on_plate->y = eye.y + s * direction.y;
        double u = (2.0 * on_plate->x - p->left - p->right) / (p->right - p->left), v = (2.0 * on_plate->y - p->bottom - p->top) / (p->top - p->bottom);
        height = p->look->bulge_m * (1.0 - 0.5 * (u * u + v * v));
        if (p->look->bulge_m == 0.0) {
            return s > 0.0;
        }
    }
    return true;
}

static double average(const print *p, tsuya_vec2 at, const double jacobian[4], double background, uint64_t pixel)
{
    const double *quantile = normal_quantiles();
    const scene_look *look = p->look;
    double sum = 0.0;
    for (int i = 0; i < SAMPLES * SAMPLES; i++) {
        double a = (i % SAMPLES + uniform(look->seed, pixel, 3 * i)) / SAMPLES, b = (i / SAMPLES + uniform(look->seed, pixel, 3 * i + 1)) / SAMPLES;
        double t = look->motion_px[0] != 0.0 || look->motion_px[1] != 0.0 ? uniform(look->seed, pixel, 3 * i + 2) - 0.5 : 0.0;
        double dx = look->blur_px * quantile[(int)(a * 4096.0)] + t * look->motion_px[0], dy = look->blur_px * quantile[(int)(b * 4096.0)] + t * look->motion_px[1];
        double value = ink(p, at.x + jacobian[0] * dx + jacobian[1] * dy, at.y + jacobian[2] * dx + jacobian[3] * dy);
        sum += value < 0.0 ? background : value;
    }
    return sum / (SAMPLES * SAMPLES);
}

/* True where a square of the blur's reach sees one ink only. */
static bool even(double *value, const print *p, tsuya_vec2 at, const double jacobian[4])
{
    double reach = 3.2 * p->look->blur_px + 0.5 * (fabs(p->look->motion_px[0]) + fabs(p->look->motion_px[1]));
    *value = ink(p, at.x, at.y);
    for (int i = 0; i < 49; i++) {
        double dx = reach * (i % 7 - 3) / 3.0, dy = reach * (i / 7 - 3) / 3.0;
        if (ink(p, at.x + jacobian[0] * dx + jacobian[1] * dy, at.y + jacobian[2] * dx + jacobian[3] * dy) != *value) {
            return false;
        }
    }
    return true;
}

static void draw_pixel(tsuya_image *image, const print *p, const tsuya_camera *camera, tsuya_pose pose, int x, int y)
{
    tsuya_vec2 at, right, below;
    if (!place(&at, p, camera, pose, x, y) || !place(&right, p, camera, pose, x + 0.5, y) || !place(&below, p, camera, pose, x, y + 0.5)) {
        return;
    }
    double jacobian[4] = {2.0 * (right.x - at.x), 2.0 * (below.x - at.x), 2.0 * (right.y - at.y), 2.0 * (below.y - at.y)}, value;
    float *out = tsuya_image_f32(image, x, y);
    double light = p->look->light ? p->look->light(p->look->light_user, at.x, at.y) : 1.0;
    if (even(&value, p, at, jacobian)) {
        *out = value < 0.0 ? *out : (float)(value * light);
    } else {
        *out = (float)(light * average(p, at, jacobian, (double)*out / light, (uint64_t)y * 65536u + (uint64_t)x));
    }
}

void scene_plate(tsuya_image *image, const tsuya_board *board, int plate, const tsuya_camera *camera, tsuya_pose pose, const scene_look *look)
{
    print p = {.board = board, .plate = &board->plate[plate], .look = look, .left = 1e9, .bottom = 1e9, .right = -1e9, .top = -1e9};
    p.pattern = calloc((size_t)p.plate->tag_count, sizeof *p.pattern);
    for (int i = 0; i < p.plate->tag_count; i++) {
        const tsuya_board_tag *tag = &board->tag[p.plate->first_tag + i];
        assert_ok(tsuya_tag_pattern_create(&p.pattern[i], board->family, board->border_bits, tag->id));
        double margin = 0.3 * (tag->corner_m[1].x - tag->corner_m[0].x);
        p.left = fmin(p.left, tag->corner_m[0].x - margin);
        p.bottom = fmin(p.bottom, tag->corner_m[0].y - margin);
        p.right = fmax(p.right, tag->corner_m[2].x + margin);
        p.top = fmax(p.top, tag->corner_m[2].y + margin);
    }
    (void)normal_quantiles();
    double low[2] = {1e9, 1e9}, high[2] = {-1e9, -1e9};
    for (int i = 0; i <= 64; i++) {
        double t = i % 17 / 16.0, x = i % 4 < 2 ? (i % 4 == 0 ? p.left : p.right) : p.left + t * (p.right - p.left);
        double y = i % 4 < 2 ? p.bottom + t * (p.top - p.bottom) : i % 4 == 2 ? p.bottom : p.top;
        tsuya_vec2 q;
        if (tsuya_camera_project(camera, tsuya_pose_apply(pose, (tsuya_vec3){x, y, 0}), &q)) {
            low[0] = fmin(low[0], q.x), low[1] = fmin(low[1], q.y), high[0] = fmax(high[0], q.x), high[1] = fmax(high[1], q.y);
        }
    }
    int y0 = (int)fmax(0, low[1] - 12), y1 = (int)fmin(image->height_px - 1, high[1] + 12);
    int x0 = (int)fmax(0, low[0] - 12), x1 = (int)fmin(image->width_px - 1, high[0] + 12);
#pragma omp parallel for schedule(dynamic, 4)
    for (int y = y0; y <= y1; y++) {
        for (int x = x0; x <= x1; x++) {
            draw_pixel(image, &p, camera, pose, x, y);
        }
    }
    for (int i = 0; i < p.plate->tag_count; i++) {
        tsuya_tag_pattern_free(&p.pattern[i]);
    }
    free(p.pattern);
}

void scene_end(tsuya_image *photo, tsuya_image *image, const scene_look *look)
{
    double full = look->sample == TSUYA_SAMPLE_U8 ? 255.0 : 65535.0;
    assert_ok(tsuya_image_create(photo, image->width_px, image->height_px, 1, look->sample, look->srgb ? TSUYA_ENCODING_SRGB : TSUYA_ENCODING_LINEAR));
    for (int y = 0; y < image->height_px; y++) {
        double gain = 1.0 + (look->row_gain - 1.0) * y / image->height_px;
        for (int x = 0; x < image->width_px; x++) {
            double value = gain * (double)*tsuya_image_f32(image, x, y);
            value = look->srgb ? (double)tsuya_srgb_encode((float)value) : value;
            value += look->noise * tsuya_random_normal(look->seed, 77, (uint64_t)y * 65536u + (uint64_t)x);
            value = fmin(fmax(rint(value * full), 0.0), full);
            if (look->sample == TSUYA_SAMPLE_U8) {
                *tsuya_image_u8(photo, x, y) = (uint8_t)value;
            } else {
                *tsuya_image_u16(photo, x, y) = (uint16_t)value;
            }
        }
    }
    tsuya_image_free(image);
}
