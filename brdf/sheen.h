/* The cloth's own model: two yarns, and what they leave, as NURBS in the half vector.  Models yarn, ndf and nurbs3.
 *
 *   f_c(wi, wo) = [ Σ_y (s_yc + g_y (Fη(wi·h)/Fη(0) − 1)) A_y(ψ along yarn y) C_y(ψ across it) + m_c ] · exp(S_c(φh, θh, θd)) / (2 (cosθi + cosθo))
 *
 * h is the half vector, ψt = atan2(h·weft, h·n), ψb = atan2(h·warp, h·n).  The warp runs along b, so its A is a curve over ψb and
 * its C one over ψt; for the weft they change places.  A and C are exponentials of cubic B-splines, shared by the channels; s and m
 * are strengths per channel.  g_y is how much of a yarn's strength is its fibres' surface, which is the same in every channel and follows
 * the dielectric's Fresnel term Fη; the rest has been in the fibres.
 *
 * S, the logarithm of what the two yarns leave, is a sum of at most TSUYA_SHEEN_TERMS products of curves,
 *
 *   S_c = Σ_r t_rc R_r(φh) T_r(θh) D_r(θd)        (D only in nurbs3)
 *
 * cubic B-splines too: R periodic, T signed in θh so that S passes the pole smoothly (S(φ, −θ) = S(φ + π, θ)).  It is fitted as a
 * tensor B-spline per channel and then taken apart (tsuya_sheen_separate): what that leaves is below the fit's own error, and a
 * direction costs some 12 numbers a term instead of 64 a channel.
 *
 * κ, the slants, multiply the squares of the light's difference along and across each yarn; one that raises the yarn does so no
 * further than `reach`, the largest difference that was measured.
 *
 * 1/(2 (cosθi + cosθo)) is G2/(4 cosθi cosθo) of the height-correlated Smith masking of facets that point everywhere, as the
 * facets of round fibres do.  Every factor is symmetric in wi and wo, so f is reciprocal. */
#ifndef TSUYA_BRDF_SHEEN_H
#define TSUYA_BRDF_SHEEN_H

#include "brdf/model.h"

enum { TSUYA_SHEEN_CURVES = 4, TSUYA_SHEEN_TERMS = 8 };

/* Curves, in this order. */
enum { TSUYA_SHEEN_WARP_ALONG, TSUYA_SHEEN_WARP_ACROSS, TSUYA_SHEEN_WEFT_ALONG, TSUYA_SHEEN_WEFT_ACROSS };

/* Factors of S, in this order. */
enum { TSUYA_SHEEN_DEEP, TSUYA_SHEEN_ROUND, TSUYA_SHEEN_TILT, TSUYA_SHEEN_TINT, TSUYA_SHEEN_FACTORS };

typedef struct tsuya_sheen {
    int channels;
    int spans;                          /* of each curve, uniform over ψ in [−π/2, π/2]; spans + 3 control values */
    double *curve[TSUYA_SHEEN_CURVES];  /* logarithms */
    double slant[2][2];                 /* κ: of each yarn, for the light's difference along and across it */
    double reach[2];                    /* largest dt2 and db2 up to which a slant may raise */
    double eta, lowest_cosine;          /* refractive index of the fibres (1: without Fη), and wi·h below which Fη is held */
    double gloss[2];                    /* g: warp, weft */
    double *strength[2];                /* per channel: warp, weft */
    double *matte;                      /* m, per channel */
    int nu, nv, nd;                     /* S: nu functions round φ, nv intervals of θh in [0, π/2], nd of θd (0: none); nu = 0: no S */
    int line;                           /* channels rounded up to a multiple of four */
    float *net;                         /* while S is fitted: ((d * nu + u) * (nv + 3) + v) * line + c; v counts from one step before the pole */
    int terms;
    double *factor[TSUYA_SHEEN_FACTORS]; /* of S, [term][control value] */
    int level_terms;                    /* of them, the first so many do not change with φh */
    float *fast, *wide;                 /* for batches (brdf/sheen_tables.h) */
    struct tsuya_half_table *half;      /* for sampling */
} tsuya_sheen;

typedef struct tsuya_half_angles {
    double psi_t, psi_b, phi_h, theta_h, theta_d, falloff; /* falloff: 1/(2 (cosθi + cosθo)) */
    double cosine;   /* wi·h */
    double dt2, db2; /* squares of ((wi − wo)/2)·weft and ·warp */
} tsuya_half_angles;

tsuya_half_angles tsuya_half_angles_of(tsuya_vec3 wi, tsuya_vec3 wo);

/* Fη(cosine)/Fη(0) − 1; 0 for η = 1. */
double tsuya_sheen_rise(const tsuya_sheen *sheen, double cosine);
/* Whether Fresnel's term adds anything. */
static inline bool tsuya_sheen_glossy(const tsuya_sheen *s) { return s->eta > 1.0 && s->gloss[0] + s->gloss[1] > 0.0; }

/* The four weights of a uniform cubic B-spline over `spans` intervals of [low, high], and the index of the first (open: spans + 3
 * functions; periodic: spans functions). */
int tsuya_uniform_weights(double weight[4], double x, double low, double high, int spans, bool periodic);

/* Control values that S touches at these angles: weights and indices (without the channel), 16 or 64 of them. */
int tsuya_sheen_stencil(int *index, double *weight, const tsuya_half_angles *angles, int nu, int nv, int nd);

/* Everything but the net, as zeros; some kB, and 64 bytes a control value of S's factors. */
TSUYA_MUST_CHECK tsuya_status tsuya_sheen_create(tsuya_sheen **sheen, int channels, int spans, int nu, int nv, int nd);
/* A net of zeros, for S to be fitted or read. */
TSUYA_MUST_CHECK tsuya_status tsuya_sheen_create_net(tsuya_sheen *sheen);
void tsuya_sheen_free(void *sheen);
static inline int tsuya_sheen_layers(const tsuya_sheen *s) { return s->nd > 0 ? s->nd + 3 : 1; }
/* Control values of one term's curve. */
static inline int tsuya_sheen_factor_size(const tsuya_sheen *s, int factor)
{
    const int size[TSUYA_SHEEN_FACTORS] = {tsuya_sheen_layers(s), s->nu, s->nv + 3, s->channels};
    return size[factor];
}
static inline int tsuya_sheen_net_points(int nu, int nv, int nd) { return nu * (nv + 3) * (nd > 0 ? nd + 3 : 1); }

/* Logarithms of the two yarns' products, before strengths. */
void tsuya_sheen_yarns(double log_yarn[2], const tsuya_sheen *sheen, const tsuya_half_angles *angles);
/* The bracket of the formula times the falloff, without S. */
void tsuya_sheen_guide(double *value, const tsuya_sheen *sheen, const tsuya_half_angles *angles);
void tsuya_sheen_eval(const void *sheen, int channels, tsuya_vec3 wi, tsuya_vec3 wo, double *value);
/* S without the yarns, per channel. */
void tsuya_sheen_surface(double *log_value, const tsuya_sheen *sheen, const tsuya_half_angles *angles);
/* 0 where a direction is not finite or not above the surface.  Cost: two angles and four curves, with S two or three angles and as many
 * curves a term more; two powers a direction and one a channel. */
void tsuya_sheen_eval_batch(const void *sheen, int channels, const tsuya_direction_batch *batch, float *value);

/* The net as a sum of products, by least squares; the weights (nv + 3 of θh, one a layer of θd; NULL: 1) say where it matters.  The
 * net is gone afterwards.  Cost: about 0.1 s a channel. */
TSUYA_MUST_CHECK tsuya_status tsuya_sheen_separate(tsuya_sheen *sheen, const double *weight_tilt, const double *weight_deep);

/* Makes what sampling and batches need, after the numbers are in place. */
TSUYA_MUST_CHECK tsuya_status tsuya_sheen_prepare(tsuya_sheen *sheen);

#endif
