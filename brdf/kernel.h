/* Elementary functions in float that vectorise. */
#ifndef TSUYA_BRDF_KERNEL_H
#define TSUYA_BRDF_KERNEL_H

static const float half_pi = 1.57079632679f, quarter_pi = 0.785398163397f, two_pi = 6.28318530718f;

/* atan of x ≥ 0 to 2e-7: two reductions and an odd polynomial (S. Moshier, Cephes). */
static inline float arc_tangent(float x)
{
    float big = x > 2.41421356f ? 1.0f : 0.0f, middle = x > 0.414213562f && x <= 2.41421356f ? 1.0f : 0.0f;
    float top = big > 0.0f ? -1.0f : middle > 0.0f ? x - 1.0f : x, bottom = big > 0.0f ? x : middle > 0.0f ? x + 1.0f : 1.0f;
    float t = top / bottom, z = t * t;
    float p = (((8.05374449538e-2f * z - 1.38776856032e-1f) * z + 1.99777106478e-1f) * z - 3.33329491539e-1f) * z * t + t;
    return p + big * half_pi + middle * quarter_pi;
}

/* exp for |x| < 80. */
static inline float exponential(float x)
{
    x = x < -80.0f ? -80.0f : x > 80.0f ? 80.0f : x;
    float k = x * 1.44269504089f;
    int n = (int)(k + (k >= 0.0f ? 0.5f : -0.5f));
    float r = (x - (float)n * 0.693359375f) + (float)n * 2.12194440e-4f;
    float p = 1.0f + r * (1.0f + r * (0.5f + r * (1.6666665e-1f + r * (4.1665795e-2f + r * (8.3334519e-3f + r * 1.3981999e-3f)))));
    union {
        int i;
        float f;
    } power = {(n + 127) << 23};
    return p * power.f;
}

/* Azimuth of (x, y) in [0, 2π]; 0 for the origin. */
static inline float azimuth_of(float x, float y)
{
    float tx = x < 0.0f ? -x : x, ty = y < 0.0f ? -y : y, wide = tx > ty ? tx : ty, thin = tx > ty ? ty : tx;
    float phi = arc_tangent(thin / (wide > 1e-30f ? wide : 1e-30f));
    phi = ty > tx ? half_pi - phi : phi;
    phi = x < 0.0f ? 2.0f * half_pi - phi : phi;
    return y < 0.0f ? two_pi - phi : phi;
}

#endif
