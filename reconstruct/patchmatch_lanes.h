/* The PatchMatch kernels over LANES pixels at a time.  Included by patchmatch_portable.c, patchmatch_sse42.c,
 * patchmatch_avx2.c and patchmatch_avx512.c, which define LANES, KERNEL (the public function's name) and the operations that gcc's vector
 * extensions lack: lane_sqrt, lane_max, lane_min, lane_madd16, lane_quads.
 *
 * Every operation is lane-wise IEEE arithmetic without contraction, so that all widths give the same bits. */
#include "reconstruct/patchmatch_sweep.h"

#include <string.h>

enum {
    NEIGHBOURS = 8,   /* candidates of the adaptive checkerboard */
    NEAR = 4,         /* of them in the V-shaped areas; two vertical and two horizontal strips follow */
    START_PLANES = 8,
};

typedef struct lane_plane { vf w, wx, wy; } lane_plane;

/* What a window needs from the reference, and each source's share of the homography that no plane changes. */
typedef struct lane_batch {
    int x[LANES], y, count;
    vf px, py, ray_x, ray_y;
    vf weight[PATCH_SAMPLES];  /* bilateral, sum 1 */
    vf ramp[2][PATCH_SAMPLES]; /* weight · orthonormal ramps */
    vf detail[PATCH_SAMPLES];  /* weight · (reference − its mean − its ramp) */
    vf contrast;               /* variance of the detail, in quad units */
    vf base[TSUYA_STEREO_MAX_SOURCES][3]; /* forward·(x, y, 1) */
} lane_batch;

INLINE vf splat(float a) { return a - (vf){}; }
INLINE vi splat_int(int32_t a) { return a - (vi){}; }
INLINE vf select_f(vi mask, vf a, vf b) { return (vf)((mask & (vi)a) | (~mask & (vi)b)); }
INLINE vf to_float(vi a) { return __builtin_convertvector(a, vf); }
INLINE vf lane_abs(vf a) { return (vf)((vi)a & 0x7fffffff); }
INLINE vi to_int(vf a) { return __builtin_convertvector(a, vi); }

/* e^x for x ≤ 0: 2^round · polynomial on [−½, ½] (Cephes' expf coefficients), relative error 2e-7. */
INLINE vf lane_exp(vf x)
{
    x = lane_max(x, splat(-86.0f));
    vf t = x * 1.44269504f;
    vi n = to_int(t - 0.5f);
    vf f = x - to_float(n) * 0.693359375f;
    f = f + to_float(n) * 2.12194440e-4f;
    vf p = splat(1.9875691500e-4f);
    p = p * f + 1.3981999507e-3f;
    p = p * f + 8.3334519073e-3f;
    p = p * f + 4.1665795894e-2f;
    p = p * f + 1.6666665459e-1f;
    p = p * f + 5.0000001201e-1f;
    p = p * f * f + f + 1.0f;
    return p * (vf)((n + 127) << 23);
}

/* Three uniform numbers in [0, 1) from a pixel, a turn and a draw: pcg3d of Jarzynski and Olano, JCGT 9(3), 2020. */
INLINE void lane_random(vf out[3], const patch_level *level, const lane_batch *b, const patch_pass *pass, int draw)
{
    vu x, y = (vu)splat_int(b->y), z;
    memcpy(&x, b->x, sizeof x);
    z = (vu){} + (level->seed ^ (pass->turn * 0x9E3779B9u + (uint32_t)draw));
    x = x * 1664525u + 1013904223u;
    y = y * 1664525u + 1013904223u;
    z = z * 1664525u + 1013904223u;
    x += y * z, y += z * x, z += x * y;
    x ^= x >> 16, y ^= y >> 16, z ^= z >> 16;
    x += y * z, y += z * x, z += x * y;
    out[0] = to_float((vi)(x >> 8)) * 0x1.0p-24f;
    out[1] = to_float((vi)(y >> 8)) * 0x1.0p-24f;
    out[2] = to_float((vi)(z >> 8)) * 0x1.0p-24f;
}

/* Two functions that are weighted-orthonormal and span the linear ramps over the window (times the weight). */
INLINE void batch_ramps(lane_batch *b)
{
    vf sx = {}, sy = {}, sxx = {}, sxy = {}, syy = {};
    for (int k = 0; k < PATCH_SAMPLES; k++) {
        const float dx = (float)(PATCH_STEP * (k % PATCH_SIDE) - PATCH_RADIUS);
        const float dy = (float)(PATCH_STEP * (k / PATCH_SIDE) - PATCH_RADIUS);
        vf w = b->weight[k];
        sx += w * dx, sy += w * dy;
        sxx += w * (dx * dx), sxy += w * (dx * dy), syy += w * (dy * dy);
    }
    sxx = lane_max(sxx - sx * sx, splat(1e-3f)), sxy -= sx * sy, syy -= sy * sy;
    vf lean = sxy / sxx;
    vf across = 1.0f / lane_sqrt(sxx), down = 1.0f / lane_sqrt(lane_max(syy - lean * sxy, splat(1e-3f)));
    for (int k = 0; k < PATCH_SAMPLES; k++) {
        vf dx = (float)(PATCH_STEP * (k % PATCH_SIDE) - PATCH_RADIUS) - sx;
        vf dy = (float)(PATCH_STEP * (k / PATCH_SIDE) - PATCH_RADIUS) - sy;
        b->ramp[0][k] = b->weight[k] * dx * across;
        b->ramp[1][k] = b->weight[k] * (dy - lean * dx) * down;
    }
}

/* Bilateral weights (Schönberger et al. 2016, eq. 4-6) and the reference's moments. */
INLINE void batch_weights(lane_batch *b, const patch_level *level)
{
    vf value[PATCH_SAMPLES], centre, sum = {}, first = {}, slope[2] = {{}, {}};
    for (int l = 0; l < LANES; l++) {
        centre[l] = level->grey[(ptrdiff_t)(b->y + TSUYA_STEREO_PAD) * level->stride + TSUYA_STEREO_PAD + b->x[l]];
    }
    for (int k = 0; k < PATCH_SAMPLES; k++) {
        int dx = PATCH_STEP * (k % PATCH_SIDE) - PATCH_RADIUS, dy = PATCH_STEP * (k / PATCH_SIDE) - PATCH_RADIUS;
        ptrdiff_t row = (ptrdiff_t)(b->y + dy + TSUYA_STEREO_PAD) * level->stride + TSUYA_STEREO_PAD + dx;
        vf keep;
        for (int l = 0; l < LANES; l++) {
            value[k][l] = level->grey[row + b->x[l]];
            keep[l] = level->keep ? level->keep[row + b->x[l]] : 1.0f;
        }
        vf d = value[k] - centre;
        b->weight[k] = lane_exp(d * d * level->color_factor) * level->spatial[k] * keep;
        value[k] = (value[k] - 0.5f) * QUAD_SCALE;
        sum += b->weight[k];
        first += b->weight[k] * value[k];
    }
    vf inverse = 1.0f / lane_max(sum, splat(1e-6f));
    vf mean = first * inverse;
    for (int k = 0; k < PATCH_SAMPLES; k++) {
        b->weight[k] = b->weight[k] * inverse;
    }
    batch_ramps(b);
    for (int k = 0; k < PATCH_SAMPLES; k++) {
        value[k] = value[k] - mean;
        slope[0] += b->ramp[0][k] * value[k];
        slope[1] += b->ramp[1][k] * value[k];
    }
    b->contrast = (vf){};
    for (int k = 0; k < PATCH_SAMPLES; k++) {
        b->detail[k] = b->weight[k] * value[k] - slope[0] * b->ramp[0][k] - slope[1] * b->ramp[1][k];
        b->contrast += b->detail[k] * value[k];
    }
    b->contrast = lane_max(b->contrast, (vf){});
}

/* x[0 … count) are set; the other lanes repeat the last pixel. */
INLINE void batch_begin(lane_batch *b, const patch_level *level)
{
    for (int l = b->count; l < LANES; l++) {
        b->x[l] = b->x[b->count - 1];
    }
    vi x;
    memcpy(&x, b->x, sizeof x);
    b->px = to_float(x);
    b->py = splat((float)b->y);
    b->ray_x = (b->px - level->cx_px) / level->fx_px;
    b->ray_y = (b->py - level->cy_px) / level->fy_px;
    batch_weights(b, level);
    for (int s = 0; s < level->source_count; s++) {
        for (int r = 0; r < 3; r++) {
            const float *f = level->source[s].forward[r];
            b->base[s][r] = f[0] * b->px + f[1] * b->py + f[2];
        }
    }
}

/* A homography over the window: value at the centre and slopes, for each homogeneous coordinate. */
typedef struct lane_warp { vf at[3], dx[3], dy[3]; } lane_warp;

INLINE lane_warp warp_of(const patch_source *s, const vf base[3], lane_plane p)
{
    lane_warp h;
    for (int r = 0; r < 3; r++) {
        h.at[r] = base[r] + s->shift[r] * p.w;
        h.dx[r] = s->forward[r][0] + s->shift[r] * p.wx;
        h.dy[r] = s->forward[r][1] + s->shift[r] * p.wy;
    }
    return h;
}

/* Lanes whose window lies inside the padded source and whose centre lies inside the source itself.  The image of the
 * window is the convex hull of its corners' images as long as these are in front of the camera. */
INLINE vi warp_inside(const lane_warp *h, const patch_source *s)
{
    const float pad = (float)TSUYA_STEREO_PAD;
    vf z = h->at[2];
    vi inside = (z > 0.0f) & (h->at[0] >= (pad - 0.5f) * z) & (h->at[1] >= (pad - 0.5f) * z) &
                (h->at[0] <= ((float)s->width_px + pad - 0.5f) * z) & (h->at[1] <= ((float)s->height_px + pad - 0.5f) * z);
    const float right = (float)s->width_px + 2.0f * pad - 2.0f, bottom = (float)s->height_px + 2.0f * pad - 2.0f;
    for (int corner = 0; corner < 4; corner++) {
        const float cx = corner & 1 ? PATCH_RADIUS : -PATCH_RADIUS, cy = corner & 2 ? PATCH_RADIUS : -PATCH_RADIUS;
        vf cz = z + cx * h->dx[2] + cy * h->dy[2];
        vf u = h->at[0] + cx * h->dx[0] + cy * h->dy[0];
        vf v = h->at[1] + cx * h->dx[1] + cy * h->dy[1];
        inside &= (cz > 0.0f) & (u >= cz) & (v >= cz) & (u <= right * cz) & (v <= bottom * cz);
    }
    return inside;
}

INLINE bool none(vi mask)
{
    int32_t any = 0;
    for (int l = 0; l < LANES; l++) {
        any |= mask[l];
    }
    return any == 0;
}

/* A source coordinate over the window to second order: with N/D and D = z (1 + α·dx + β·dy), the quotient's derivatives are
 * q_x = N_x/z − q α, q_xx = −2 α q_x, q_xy = −(α q_y + β q_x), q_yy = −2 β q_y.  α and β are about the surface's slope over
 * the focal length in pixels.  What is left out is at most |q_x dx + q_y dy| ε²/(1 − ε), ε = |α dx| + |β dy|. */
typedef struct lane_curve { vf at, x, y, xx, xy, yy; } lane_curve; /* xx and yy: half the second derivative */

/* `sound` loses the lanes where the window is too large for 16 bits or more than half a pixel is left out. */
INLINE lane_curve curve_of(const lane_warp *h, int r, vf inverse, vi *sound)
{
    vf alpha = h->dx[2] * inverse, beta = h->dy[2] * inverse;
    lane_curve c;
    c.at = h->at[r] * inverse;
    c.x = h->dx[r] * inverse - c.at * alpha;
    c.y = h->dy[r] * inverse - c.at * beta;
    c.xx = -alpha * c.x;
    c.yy = -beta * c.y;
    c.xy = -(alpha * c.y + beta * c.x);
    vf reach = PATCH_RADIUS * (lane_abs(c.x) + lane_abs(c.y)), bend = PATCH_RADIUS * (lane_abs(alpha) + lane_abs(beta));
    *sound &= (reach <= 28.0f) & (bend <= 0.5f) & (reach * bend * bend <= 0.25f);
    return c;
}

/* Two numbers of −32 … 32 as 6.10-bit fixed point in the halves of a lane; `low` and `high` come with PACK_BIAS added, which
 * makes rounding out of truncation and goes with the bits above the sixteenth. */
#define PACK_BIAS 65536.5f
INLINE vi pack(vf low, vf high) { return (to_int(low) & 0xffff) | (to_int(high) << 16); }
INLINE vi add_halves(vi a, vi b) { return (vi)((vs)a + (vs)b); }

/* Forward differences of both coordinates over the window; whole pixels of the centre are in `base`. */
typedef struct lane_walk {
    vi base, bend;
    vf at[2], step[2];                /* of the row to come, with the bias */
    vf at_step[2], at_bend[2], cross[2];
} lane_walk;

INLINE lane_walk walk_begin(const lane_curve c[2], vi sound, int stride)
{
    const float one = (float)(1 << PATCH_FRACTION_BITS), r = -PATCH_RADIUS, d = PATCH_STEP;
    lane_walk w;
    vf bend[2];
    vi whole[2];
    for (int k = 0; k < 2; k++) {
        whole[k] = to_int(select_f(sound, c[k].at, splat((float)TSUYA_STEREO_PAD)));
        vf at = c[k].at - to_float(whole[k]);
        w.at[k] = (at + r * (c[k].x + c[k].y) + r * r * (c[k].xx + c[k].xy + c[k].yy)) * one;
        w.step[k] = (d * c[k].x + (2.0f * r * d + d * d) * c[k].xx + r * d * c[k].xy) * one;
        w.at_step[k] = (d * c[k].y + (2.0f * r * d + d * d) * c[k].yy + r * d * c[k].xy) * one;
        w.at_bend[k] = 2.0f * d * d * one * c[k].yy;
        w.cross[k] = d * d * one * c[k].xy;
        bend[k] = select_f(sound, 2.0f * d * d * one * c[k].xx, (vf){}) + PACK_BIAS;
        w.at[k] = select_f(sound, w.at[k], (vf){}) + PACK_BIAS;
        w.step[k] = select_f(sound, w.step[k], (vf){}) + PACK_BIAS;
        w.at_step[k] = select_f(sound, w.at_step[k], (vf){});
        w.at_bend[k] = select_f(sound, w.at_bend[k], (vf){});
        w.cross[k] = select_f(sound, w.cross[k], (vf){});
    }
    w.base = whole[1] * stride + whole[0];
    w.bend = pack(bend[0], bend[1]);
    return w;
}

INLINE void walk_row(lane_walk *w, vi *at, vi *step)
{
    *at = pack(w->at[0], w->at[1]);
    *step = pack(w->step[0], w->step[1]);
    for (int k = 0; k < 2; k++) {
        w->at[k] += w->at_step[k];
        w->at_step[k] += w->at_bend[k];
        w->step[k] += w->cross[k];
    }
}

/* Bilinear sample of the quads, times 2^PATCH_FRACTION_BITS: horizontally by the 16-bit dot product, vertically in float. */
INLINE vf sample_quads(const uint64_t *quad, vi base, vi stride_and_one, vi at)
{
    const int32_t one = 1 << PATCH_FRACTION_BITS;
    vi top, bottom;
    lane_quads(&top, &bottom, quad, base + lane_madd16((vi)((vs)at >> PATCH_FRACTION_BITS), stride_and_one));
    vi fx = at & (one - 1);
    vi across = (fx << 16) - fx + one; /* (one − f) | f << 16 */
    vf t = to_float(lane_madd16(top, across));
    vf down = to_float(at & ((one - 1) << 16)) * (0x1p-16f / (float)one);
    return t + (to_float(lane_madd16(bottom, across)) - t) * down;
}

/* 1 − bilaterally weighted NCC of the reference window and its image in source `s` under the plane, of what linear ramps
 * leave of both.  NCC cannot tell where along a ramp it is, and the flanks of a highlight on bare satin are ramps that
 * move with the view: without them a window must show texture to correlate. */
INLINE vf ncc_cost(const lane_batch *b, const patch_source *s, const vf base[3], lane_plane p)
{
    const float unit = (float)(1 << PATCH_FRACTION_BITS);
    lane_warp h = warp_of(s, base, p);
    vi inside = warp_inside(&h, s);
    if (none(inside)) {
        return splat(PATCH_COST_UNSEEN);
    }
    vf inverse = 1.0f / select_f(inside, h.at[2], splat(1.0f));
    lane_curve curve[2] = {curve_of(&h, 0, inverse, &inside), curve_of(&h, 1, inverse, &inside)};
    lane_walk walk = walk_begin(curve, inside, s->stride);
    vi stride_and_one = splat_int(1 | s->stride << 16);
    vf first = {}, second = {}, mixed = {}, slope_x = {}, slope_y = {};
    for (int j = 0; j < PATCH_SIDE; j++) {
        vi at, step;
        walk_row(&walk, &at, &step);
        for (int i = 0; i < PATCH_SIDE; i++) {
            int k = j * PATCH_SIDE + i;
            vf value = sample_quads(s->quad, walk.base, stride_and_one, at);
            vf weighted = b->weight[k] * value;
            first += weighted;
            second += weighted * value;
            mixed += b->detail[k] * value;
            slope_x += b->ramp[0][k] * value;
            slope_y += b->ramp[1][k] * value;
            at = add_halves(at, step);
            step = add_halves(step, walk.bend);
        }
    }
    const float noise = NOISE_VARIANCE * unit * unit;
    vf variance = lane_max(second - first * first - slope_x * slope_x - slope_y * slope_y, (vf){}) + noise;
    vf correlation = mixed / lane_sqrt(variance * (b->contrast + NOISE_VARIANCE));
    return select_f(inside, 1.0f - correlation, splat(PATCH_COST_UNSEEN));
}

/* Forward-backward reprojection error in pixels, at most 3 (Xu and Tao 2019, eq. 9): the plane's point seen in the
 * source, the source's own depth there, and back. */
INLINE vf geometric_error(const lane_batch *b, const patch_source *s, const vf base[3], lane_plane p)
{
    const float most = 3.0f;
    vf z = base[2] + s->shift[2] * p.w;
    vf u = (base[0] + s->shift[0] * p.w) / z - (float)TSUYA_STEREO_PAD;
    vf v = (base[1] + s->shift[1] * p.w) / z - (float)TSUYA_STEREO_PAD;
    vi inside = (z > 0.0f) & (u >= 0.0f) & (v >= 0.0f) & (u <= (float)(s->width_px - 1)) &
                (v <= (float)(s->height_px - 1));
    vi column = to_int(select_f(inside, u, (vf){}) + 0.5f), row = to_int(select_f(inside, v, (vf){}) + 0.5f);
    vi index = row * s->width_px + column;
    vf depth;
    for (int l = 0; l < LANES; l++) {
        depth[l] = s->depth[index[l]];
    }
    inside &= depth > 0.0f;
    /* The source's depth belongs to its pixel's centre; along its ray the plane's own point is what is compared. */
    vf x = u * depth, y = v * depth;
    vf bz = s->back[2][0] * x + s->back[2][1] * y + s->back[2][2] * depth + s->back_shift[2];
    vf bx = s->back[0][0] * x + s->back[0][1] * y + s->back[0][2] * depth + s->back_shift[0];
    vf by = s->back[1][0] * x + s->back[1][1] * y + s->back[1][2] * depth + s->back_shift[1];
    vf ex = bx / bz - b->px, ey = by / bz - b->py;
    vf error = lane_min(lane_sqrt(ex * ex + ey * ey), splat(most));
    return select_f(inside & (bz > 0.0f), error, splat(most));
}

/* Planes in the depth range that face the camera by more than 5 degrees. */
INLINE vi possible(const lane_batch *b, const patch_level *level, lane_plane p)
{
    vf nx = p.wx * level->fx_px, ny = p.wy * level->fy_px, nz = p.w - nx * b->ray_x - ny * b->ray_y;
    vf cosine2 = p.w * p.w, norm2 = nx * nx + ny * ny + nz * nz;
    vf ray2 = b->ray_x * b->ray_x + b->ray_y * b->ray_y + 1.0f;
    return (p.w >= level->w_min) & (p.w <= level->w_max) & (cosine2 > 0.0076f * norm2 * ray2);
}

INLINE lane_plane plane_with_normal(const lane_batch *b, const patch_level *level, vf w, vf nx, vf ny, vf nz)
{
    vf k = w / (nx * b->ray_x + ny * b->ray_y + nz);
    return (lane_plane){w, k * nx / level->fx_px, k * ny / level->fy_px};
}

/* ---- which sources to trust, and the cost under that trust ---- */

typedef struct lane_trust { vf weight[TSUYA_STEREO_MAX_SOURCES], sum; } lane_trust;

/* Joint view selection from the candidates' costs (Xu and Tao 2019, eq. 4-6). */
INLINE void select_views(lane_trust *trust, const vf cost[][TSUYA_STEREO_MAX_SOURCES], int planes,
                         const patch_level *level, const patch_pass *pass, vi best_view)
{
    const float limit = pass->good_limit, bad_limit = 1.2f;
    const float factor = -1.0f / (2.0f * 0.3f * 0.3f);
    vf sum = {};
    vf fallback[TSUYA_STEREO_MAX_SOURCES], fallback_sum = {};
    for (int s = 0; s < level->source_count; s++) {
        vf confidence = {}, good = {}, bad = {}, least = splat(PATCH_COST_UNSEEN);
        for (int k = 0; k < planes; k++) {
            vf c = cost[k][s];
            vi is_good = c < limit;
            confidence += select_f(is_good, lane_exp(c * c * factor), (vf){});
            good += select_f(is_good, splat(1.0f), (vf){});
            bad += select_f(c > bad_limit, splat(1.0f), (vf){});
            least = lane_min(least, c);
        }
        vi clear = (good > 2.0f) & (bad < 3.0f);
        vf keep = select_f(best_view == s, splat(0.2f), (vf){});
        trust->weight[s] = select_f(clear, confidence / lane_max(good, splat(1.0f)), keep);
        sum += select_f(clear, trust->weight[s], (vf){});
        fallback[s] = lane_exp(least * least * factor) + 1e-3f;
        fallback_sum += fallback[s];
    }
    vi lost = sum <= 0.0f;
    trust->sum = (vf){};
    for (int s = 0; s < level->source_count; s++) {
        vf w = level->view_selection ? select_f(lost, fallback[s] / fallback_sum, trust->weight[s]) : splat(1.0f);
        trust->weight[s] = w;
        trust->sum += w;
    }
}

INLINE vf trusted_cost(const lane_trust *trust, const vf *cost, const vf *geometric, int sources)
{
    vf sum = {};
    for (int s = 0; s < sources; s++) {
        vf c = geometric ? cost[s] + 0.2f * geometric[s] : cost[s];
        sum += trust->weight[s] * c;
    }
    return sum / trust->sum;
}

/* One plane against every source. */
INLINE void plane_costs(vf *cost, vf *geometric, const lane_batch *b, const patch_level *level, lane_plane p)
{
    for (int s = 0; s < level->source_count; s++) {
        cost[s] = ncc_cost(b, &level->source[s], b->base[s], p);
        if (level->geometric) {
            geometric[s] = geometric_error(b, &level->source[s], b->base[s], p);
        }
    }
}

/* Ends early where no lane can stay below `limit` any more: what it returns then is above the limit, too.  Costs may be
 * below 0 by rounding alone, hence the margin. */
INLINE vf plane_cost_trusted(const lane_trust *trust, const lane_batch *b, const patch_level *level, lane_plane p, vf limit)
{
    vf sum = {};
    const vf enough = (limit + 1e-3f) * trust->sum;
    const vi fit = possible(b, level, p);
    for (int s = 0; s < level->source_count; s++) {
        if (none(trust->weight[s] > 0.0f)) {
            continue;
        }
        if (none(fit & (sum < enough))) {
            break;
        }
        vf c = ncc_cost(b, &level->source[s], b->base[s], p);
        if (level->geometric) {
            c += 0.2f * geometric_error(b, &level->source[s], b->base[s], p);
        }
        sum += trust->weight[s] * c;
    }
    return select_f(fit, sum / trust->sum, splat(PATCH_COST_IMPOSSIBLE));
}

INLINE void take_better(lane_plane *best, vf *best_cost, lane_plane p, vf cost)
{
    vi better = cost < *best_cost;
    *best_cost = select_f(better, cost, *best_cost);
    best->w = select_f(better, p.w, best->w);
    best->wx = select_f(better, p.wx, best->wx);
    best->wy = select_f(better, p.wy, best->wy);
}

#include "reconstruct/patchmatch_moves.h"
