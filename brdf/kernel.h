/* Elementary functions in float that vectorise. */
#ifndef TSUYA_BRDF_KERNEL_H
#define TSUYA_BRDF_KERNEL_H

#include <math.h>
#include <stdbool.h>

static const float half_pi = 1.57079632679f, two_pi = 6.28318530718f;

/* atan of t in [0, 1] (Abramowitz & Stegun 4.4.49); 2e-7 in float. */
static inline float arc_tangent(float t)
{
    float z = t * t;
    float p = ((((2.8662257e-3f * z - 1.61657367e-2f) * z + 4.29096138e-2f) * z - 7.528964e-2f) * z + 1.065626393e-1f) * z;
    return t + t * z * (((p - 1.420889944e-1f) * z + 1.999355085e-1f) * z - 3.333314528e-1f);
}

/* The angle of (along, across), both at least 0, from the smaller over the larger. */
static inline float angle_from(float ratio, bool steep)
{
    float p = arc_tangent(ratio);
    return steep ? half_pi - p : p;
}

/* Sine and cosine of a turn's share in [0, 1]; 1e-7. */
static inline void sine_of_turn(float turn, float *sine, float *cosine)
{
    int quarter = (int)(4.0f * turn + 0.5f);
    float x = two_pi * (turn - 0.25f * (float)quarter), q = x * x;
    float s = x * (1.0f - q * (1.6666667e-1f - q * (8.3333333e-3f - q * (1.9841270e-4f - q * 2.7557319e-6f))));
    float c = 1.0f - q * (0.5f - q * (4.1666667e-2f - q * (1.3888889e-3f - q * 2.4801587e-5f)));
    float odd = (float)(quarter & 1), along = c + odd * (s - c), across = s + odd * (c - s);
    *cosine = along * (float)(1 - ((quarter + 1) & 2));
    *sine = across * (float)(1 - (quarter & 2));
}

/* exp of x held in [−80, 80]. */
static inline float exponential(float x)
{
    x = x > -80.0f ? x : -80.0f;
    x = x < 80.0f ? x : 80.0f;
    float n = (x * 1.44269504089f + 12582912.0f) - 12582912.0f; /* to the nearest whole number */
    float r = (x - n * 0.693359375f) + n * 2.12194440e-4f;
    float p = 1.0f + r * (1.0f + r * (0.5f + r * (1.6666665e-1f + r * (4.1665795e-2f + r * (8.3334519e-3f + r * 1.3981999e-3f)))));
    union {
        int i;
        float f;
    } power = {((int)n + 127) << 23};
    return p * power.f;
}

/* scale · Fη(c), the unpolarised dielectric Fresnel term: eta2 is η² − 1. */
static inline float fresnel_term(float c, float eta2, float scale)
{
    float root = sqrtf(eta2 + c * c), more = root + c, with = c * (root - c) + 1.0f, against = c * more - 1.0f;
    float ratio = eta2 / (more * more * with);
    return 0.5f * scale * ratio * ratio * (with * with + against * against);
}

/* Azimuth in [0, 2π] of (x, y) from the angle between (|x|, |y|) and the x axis. */
static inline float unfold_azimuth(float angle, float x, float y)
{
    angle = x < 0.0f ? 2.0f * half_pi - angle : angle;
    return y < 0.0f ? two_pi - angle : angle;
}

#endif
