#include "core/color.h"

/* Rec.709 primaries at (0.64, 0.33), (0.30, 0.60), (0.15, 0.06), white at (0.3127, 0.3290). */
static const double primaries[3][2] = {{0.64, 0.33}, {0.30, 0.60}, {0.15, 0.06}};
static const double white_xy[2] = {0.3127, 0.3290};

static tsuya_vec3 xyz_of_chromaticity(const double xy[2])
{
    return (tsuya_vec3){xy[0] / xy[1], 1.0, (1.0 - xy[0] - xy[1]) / xy[1]};
}

static tsuya_mat3 inverse(tsuya_mat3 m)
{
    const double(*e)[3] = m.e;
    tsuya_mat3 inv;
    double d = tsuya_mat3_determinant(m);
    for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) {
            int a = (j + 1) % 3, b = (j + 2) % 3, c = (i + 1) % 3, f = (i + 2) % 3;
            inv.e[i][j] = (e[a][c] * e[b][f] - e[a][f] * e[b][c]) / d;
        }
    }
    return inv;
}

/* Columns: the primaries' XYZ, each as strong as white needs it. */
static tsuya_mat3 xyz_from_rgb_matrix(void)
{
    tsuya_mat3 m;
    for (int k = 0; k < 3; ++k) {
        tsuya_vec3 p = xyz_of_chromaticity(primaries[k]);
        m.e[0][k] = p.x;
        m.e[1][k] = p.y;
        m.e[2][k] = p.z;
    }
    tsuya_vec3 s = tsuya_mat3_apply(inverse(m), xyz_of_chromaticity(white_xy));
    const double strength[3] = {s.x, s.y, s.z};
    for (int i = 0; i < 3; ++i) {
        for (int k = 0; k < 3; ++k) {
            m.e[i][k] *= strength[k];
        }
    }
    return m;
}

tsuya_vec3 tsuya_white_d65(void) { return xyz_of_chromaticity(white_xy); }

tsuya_vec3 tsuya_xyz_from_rgb(tsuya_vec3 rgb) { return tsuya_mat3_apply(xyz_from_rgb_matrix(), rgb); }

tsuya_vec3 tsuya_rgb_from_xyz(tsuya_vec3 xyz) { return tsuya_mat3_apply(inverse(xyz_from_rgb_matrix()), xyz); }

static const double knee = 6.0 / 29.0;

static double compress(double t)
{
    return t > knee * knee * knee ? cbrt(t) : t / (3.0 * knee * knee) + 4.0 / 29.0;
}

static double expand(double f) { return f > knee ? f * f * f : 3.0 * knee * knee * (f - 4.0 / 29.0); }

tsuya_vec3 tsuya_xyz_adapt(tsuya_vec3 xyz, tsuya_vec3 from, tsuya_vec3 to)
{
    static const tsuya_mat3 cones = {{{0.8951, 0.2664, -0.1614}, {-0.7502, 1.7135, 0.0367}, {0.0389, -0.0685, 1.0296}}};
    static const tsuya_mat3 back = {{{0.9869929, -0.1470543, 0.1599627}, {0.4323053, 0.5183603, 0.0492912}, {-0.0085287, 0.0400428, 0.9684867}}};
    tsuya_vec3 c = tsuya_mat3_apply(cones, xyz), a = tsuya_mat3_apply(cones, from), b = tsuya_mat3_apply(cones, to);
    return tsuya_mat3_apply(back, (tsuya_vec3){c.x * b.x / a.x, c.y * b.y / a.y, c.z * b.z / a.z});
}

tsuya_lab tsuya_lab_from_xyz(tsuya_vec3 xyz, tsuya_vec3 white)
{
    double x = compress(xyz.x / white.x), y = compress(xyz.y / white.y), z = compress(xyz.z / white.z);
    return (tsuya_lab){116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)};
}

tsuya_vec3 tsuya_xyz_from_lab(tsuya_lab lab, tsuya_vec3 white)
{
    double y = (lab.l + 16.0) / 116.0;
    return (tsuya_vec3){white.x * expand(y + lab.a / 500.0), white.y * expand(y), white.z * expand(y - lab.b / 200.0)};
}

tsuya_lab tsuya_lab_from_rgb(tsuya_vec3 rgb) { return tsuya_lab_from_xyz(tsuya_xyz_from_rgb(rgb), tsuya_white_d65()); }

tsuya_vec3 tsuya_rgb_from_lab(tsuya_lab lab) { return tsuya_rgb_from_xyz(tsuya_xyz_from_lab(lab, tsuya_white_d65())); }

static double hue_deg(double a, double b)
{
    double h = a == 0.0 && b == 0.0 ? 0.0 : tsuya_deg_from_rad(atan2(b, a));
    return h < 0.0 ? h + 360.0 : h;
}

static double power7_share(double chroma)
{
    double c7 = pow(chroma, 7.0);
    return sqrt(c7 / (c7 + 6103515625.0)); /* 25⁷ */
}

/* Mean of two hues across the shorter arc; a grey has no hue, and the other's counts. */
static double mean_hue_deg(double h1, double h2, double chroma_product)
{
    if (chroma_product == 0.0) {
        return h1 + h2;
    }
    if (fabs(h1 - h2) <= 180.0) {
        return 0.5 * (h1 + h2);
    }
    return h1 + h2 < 360.0 ? 0.5 * (h1 + h2 + 360.0) : 0.5 * (h1 + h2 - 360.0);
}

static double cos_deg(double deg) { return cos(tsuya_rad_from_deg(deg)); }

double tsuya_color_difference(tsuya_lab p, tsuya_lab q)
{
    double g = 0.5 * (1.0 - power7_share(0.5 * (hypot(p.a, p.b) + hypot(q.a, q.b))));
    double a1 = (1.0 + g) * p.a, a2 = (1.0 + g) * q.a, c1 = hypot(a1, p.b), c2 = hypot(a2, q.b);
    double h1 = hue_deg(a1, p.b), h2 = hue_deg(a2, q.b), dh = h2 - h1;
    dh = c1 * c2 == 0.0 ? 0.0 : dh > 180.0 ? dh - 360.0 : dh < -180.0 ? dh + 360.0 : dh;
    double dl = q.l - p.l, dc = c2 - c1, big_h = 2.0 * sqrt(c1 * c2) * sin(tsuya_rad_from_deg(0.5 * dh));
    double l = 0.5 * (p.l + q.l) - 50.0, c = 0.5 * (c1 + c2), h = mean_hue_deg(h1, h2, c1 * c2);
    double t = 1.0 - 0.17 * cos_deg(h - 30.0) + 0.24 * cos_deg(2.0 * h) + 0.32 * cos_deg(3.0 * h + 6.0) - 0.20 * cos_deg(4.0 * h - 63.0);
    double away = (h - 275.0) / 25.0, turn_deg = 30.0 * exp(-away * away);
    double sl = 1.0 + 0.015 * l * l / sqrt(20.0 + l * l), sc = 1.0 + 0.045 * c, sh = 1.0 + 0.015 * c * t;
    double turn = -sin(tsuya_rad_from_deg(2.0 * turn_deg)) * 2.0 * power7_share(c);
    double x = dl / sl, y = dc / sc, z = big_h / sh;
    return sqrt(fmax(0.0, x * x + y * y + z * z + turn * y * z));
}
