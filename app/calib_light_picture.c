#include "app/calib_light.h"

#include "core/memory.h"

enum { PANEL_WIDE = 320, PANEL_HIGH = 240, RIM = 6, BAR = 14, CROSS = 5, LENGTHENED = 40 };
static const double MARGIN = 0.12, FEWEST_PX = 60.0;

/* Blue, white, red for −1, 0, 1. */
static void two_sided(uint8_t rgb[3], double t)
{
    static const double low[3] = {33, 102, 172}, high[3] = {178, 24, 43};
    double s = fmin(fabs(t), 1.0);
    for (int c = 0; c < 3; c++) {
        rgb[c] = (uint8_t)lround((1.0 - s) * 247.0 + s * (t < 0.0 ? low[c] : high[c]));
    }
}

static void set(tsuya_image *picture, int x, int y, const uint8_t rgb[3])
{
    for (int c = 0; c < 3 && x >= 0 && y >= 0 && x < picture->width_px && y < picture->height_px; c++) {
        tsuya_image_u8(picture, x, y)[c] = rgb[c];
    }
}

static void fill(tsuya_image *picture, int x0, int y0, int wide, int high, const uint8_t rgb[3])
{
    for (int i = 0; i < wide * high; i++) {
        set(picture, x0 + i % wide, y0 + i / wide, rgb);
    }
}

/* What a panel shows of its photograph. */
typedef struct panel {
    double low[2], high[2], scale;
    int x0, y0;
} panel;

static void see(panel *p, tsuya_vec2 q)
{
    p->low[0] = fmin(p->low[0], q.x), p->low[1] = fmin(p->low[1], q.y);
    p->high[0] = fmax(p->high[0], q.x), p->high[1] = fmax(p->high[1], q.y);
}

static tsuya_vec2 place(const panel *p, tsuya_vec2 q)
{
    return (tsuya_vec2){p->x0 + 0.5 * PANEL_WIDE + p->scale * (q.x - 0.5 * (p->low[0] + p->high[0])),
                        p->y0 + 0.5 * PANEL_HIGH + p->scale * (q.y - 0.5 * (p->low[1] + p->high[1]))};
}

static void lay_out(panel *p, int photos, int cols, const tsuya_lamp_readings *r, const tsuya_lamp_balls *b)
{
    for (int k = 0; k < photos; k++) {
        p[k] = (panel){{INFINITY, INFINITY}, {-INFINITY, -INFINITY}, 1.0, RIM + k % cols * (PANEL_WIDE + RIM), RIM + k / cols * (PANEL_HIGH + RIM)};
    }
    for (int i = 0; i < 4 * r->count; i++) {
        see(&p[r->reading[i / 4].photo], r->reading[i / 4].outline_px[i % 4]);
    }
    for (int i = 0; b && i < b->highlights; i++) {
        see(&p[b->highlight[i].photo], b->highlight[i].pixel);
    }
    for (int k = 0; k < photos; k++) {
        double wide = fmax(p[k].high[0] - p[k].low[0], FEWEST_PX), high = fmax(p[k].high[1] - p[k].low[1], FEWEST_PX);
        p[k].scale = (1.0 - 2.0 * MARGIN) * fmin(PANEL_WIDE / wide, PANEL_HIGH / high);
    }
}

static double residual_of(const tsuya_lamp_reading *r)
{
    double seen = r->rgb[0] + r->rgb[1] + r->rgb[2], expected = r->expected[0] + r->expected[1] + r->expected[2];
    return seen / fmax(expected, 1e-12) - 1.0;
}

/* Inside all four edges, whichever way round they run. */
static bool inside(const tsuya_vec2 q[4], double x, double y)
{
    int left = 0;
    for (int c = 0; c < 4; c++) {
        tsuya_vec2 a = q[c], b = q[(c + 1) % 4];
        left += (b.x - a.x) * (y - a.y) - (b.y - a.y) * (x - a.x) > 0.0;
    }
    return left == 0 || left == 4;
}

static void draw_tag(tsuya_image *picture, const panel *p, const tsuya_lamp_reading *r, double high)
{
    static const uint8_t none[3] = {120, 120, 120};
    uint8_t rgb[3];
    tsuya_vec2 q[4];
    panel box = {{INFINITY, INFINITY}, {-INFINITY, -INFINITY}, 1.0, 0, 0};
    two_sided(rgb, residual_of(r) / high);
    for (int c = 0; c < 4; c++) {
        q[c] = place(p, r->outline_px[c]);
        see(&box, q[c]);
    }
    for (int y = (int)box.low[1]; y <= (int)box.high[1]; y++) {
        for (int x = (int)box.low[0]; x <= (int)box.high[0]; x++) {
            if (inside(q, x, y)) {
                set(picture, x, y, r->outlier ? none : rgb);
            }
        }
    }
}

static void draw_highlight(tsuya_image *picture, const panel *p, const tsuya_lamp_highlight *h)
{
    static const uint8_t cross[3] = {250, 250, 250}, line[3] = {255, 200, 40};
    tsuya_vec2 at = place(p, h->pixel);
    for (int i = -CROSS; i <= CROSS; i++) {
        set(picture, (int)lround(at.x) + i, (int)lround(at.y), cross);
        set(picture, (int)lround(at.x), (int)lround(at.y) + i, cross);
    }
    double dx = LENGTHENED * p->scale * h->residual_px.x, dy = LENGTHENED * p->scale * h->residual_px.y, most = 0.5 * PANEL_HIGH / fmax(hypot(dx, dy), 1e-9);
    for (int i = 0; i <= PANEL_HIGH; i++) {
        double t = fmin(most, 1.0) * i / PANEL_HIGH;
        set(picture, (int)lround(at.x + t * dx), (int)lround(at.y + t * dy), line);
    }
}

tsuya_status tsuya_calib_light_picture(const char *path, const tsuya_lamp_readings *r, const tsuya_lamp_balls *balls, int photos, double high)
{
    static const uint8_t ground[3] = {40, 40, 40};
    tsuya_image picture = {0};
    int cols = (int)ceil(sqrt(photos)), rows = (photos + cols - 1) / cols, wide = cols * (PANEL_WIDE + RIM) + RIM, tall = rows * (PANEL_HIGH + RIM) + RIM;
    panel *panels = tsuya_calloc((size_t)photos, sizeof *panels);
    tsuya_status status = panels ? tsuya_image_create(&picture, wide, tall + BAR, 3, TSUYA_SAMPLE_U8, TSUYA_ENCODING_SRGB) : TSUYA_ERROR_MEMORY;
    if (status == TSUYA_OK) {
        lay_out(panels, photos, cols, r, balls);
        for (int k = 0; k < photos; k++) {
            fill(&picture, panels[k].x0, panels[k].y0, PANEL_WIDE, PANEL_HIGH, ground);
        }
        for (int i = 0; i < r->count; i++) {
            draw_tag(&picture, &panels[r->reading[i].photo], &r->reading[i], high);
        }
        for (int i = 0; balls && i < balls->highlights; i++) {
            draw_highlight(&picture, &panels[balls->highlight[i].photo], &balls->highlight[i]);
        }
        for (int x = RIM; x < wide - RIM && r->count; x++) {
            uint8_t rgb[3];
            two_sided(rgb, 2.0 * (x - RIM) / (wide - 2 * RIM - 1) - 1.0);
            fill(&picture, x, tall, 1, BAR - RIM, rgb);
        }
        status = tsuya_image_save(&picture, path, NULL);
    }
    tsuya_image_free(&picture);
    tsuya_free(panels);
    return status;
}
