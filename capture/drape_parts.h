/* Inside the drape: the energy's parts, and the pairs that touch. */
#ifndef TSUYA_CAPTURE_DRAPE_PARTS_H
#define TSUYA_CAPTURE_DRAPE_PARTS_H

#include "capture/cholmod_adapter.h"
#include "capture/drape.h"

/* Membrane and bending of one triangle. */
typedef struct drape_element {
    uint32_t v[6];          /* corners, then the vertices across the edges (the corner itself where there is none) */
    double gradient[3][2];  /* of the corners' shape functions */
    double second[6][3];    /* coefficients of ∂uu, ∂vv, ∂uv */
    double area;
} drape_element;

/* Something near something: d = |Σ w x|. */
typedef struct drape_pair {
    uint32_t v[4];
    uint8_t is_edges;       /* 1: edge v0 v1 against edge v2 v3; 0: vertex v0 against triangle v1 v2 v3 */
} drape_pair;
typedef struct drape_touch {
    uint32_t v[4];
    double w[4];
    tsuya_vec3 normal;
    double distance_m, force_n; /* force_n: of friction's lagged normal force */
} drape_touch;

typedef struct drape_list { drape_pair *pair; size_t count, room; } drape_list;
typedef struct drape_touches { drape_touch *touch; size_t count, room; } drape_touches;

typedef struct drape_state {
    const tsuya_drape_sheet *sheet;
    const tsuya_drape_fabric *fabric;
    const tsuya_drape_body *body;
    int body_count;
    const tsuya_drape_options *options;
    const tsuya_context *context;
    size_t n;
    drape_element *element;
    uint32_t *edge;          /* 2 × edge_count */
    size_t edge_count;
    double *mass, *x, *x_step, *x_free, *velocity, *step, *trial, *g; /* 3 n each, mass n */
    double *limit;
    double mean_edge_m, near_m, stiffness_n_m; /* barrier's reach and stiffness */
    drape_list pairs;
    double *toi;
    size_t toi_room;
    drape_touches touches, friction;
    drape_matrix matrix;
    drape_solver *solver;
    double h_s;
} drape_state;

/* drape_elastic.c */
TSUYA_MUST_CHECK tsuya_status tsuya_drape_elements_create(drape_element **element, uint32_t **edge, size_t *edge_count,
                                                    const tsuya_drape_sheet *sheet);
double tsuya_drape_stretch_energy(const drape_state *s, const double *x);
double tsuya_drape_bend_energy(const drape_state *s, const double *x);
void tsuya_drape_elastic_gradient(const drape_state *s, const double *x, double *g);
TSUYA_MUST_CHECK tsuya_status tsuya_drape_elastic_hessian(drape_state *s, const double *x);

/* drape_contact.c */
TSUYA_MUST_CHECK tsuya_status tsuya_drape_find_pairs(drape_state *s, const double *from, const double *to);
TSUYA_MUST_CHECK tsuya_status tsuya_drape_find_touches(drape_touches *touches, const drape_state *s, const double *x);
TSUYA_MUST_CHECK tsuya_status tsuya_drape_limit_step(drape_state *s);
double tsuya_drape_contact_energy(const drape_state *s, const double *x);
double tsuya_drape_friction_energy(const drape_state *s, const double *x);
void tsuya_drape_contact_gradient(const drape_state *s, double *g);
void tsuya_drape_friction_gradient(const drape_state *s, const double *x, double *g);
TSUYA_MUST_CHECK tsuya_status tsuya_drape_contact_hessian(drape_state *s, const double *x);
double tsuya_drape_barrier_slope(double d, double near_m);
/* drape_distance.c */
double tsuya_drape_pair_distance(const double p[12], bool is_edges, double w[4]);

static inline tsuya_vec3 drape_at(const double *x, uint32_t v) { return (tsuya_vec3){x[3 * v], x[3 * v + 1], x[3 * v + 2]}; }
static inline void drape_add(double *x, uint32_t v, double k, tsuya_vec3 d)
{
    x[3 * v] += k * d.x;
    x[3 * v + 1] += k * d.y;
    x[3 * v + 2] += k * d.z;
}

#endif
