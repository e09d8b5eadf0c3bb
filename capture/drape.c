#include "capture/drape_parts.h"

#include "core/memory.h"

#include <math.h>
#include <string.h>

enum { LINE_SEARCH = 14 };

tsuya_drape_options tsuya_drape_options_default(void)
{
    return (tsuya_drape_options){.gravity_m_s2 = 9.81, .step_s = 0.01, .step_most_s = 1.0, .inertia = 0.0, .steps_most = 250,
                                 .newton_most = 4, .rest_m_s = 2e-5, .self_contact = true};
}

tsuya_drape_fabric tsuya_drape_fabric_from_kes(const tsuya_drape_kes *k)
{
    const double gf_n = 9.80665e-3, force_n_m = 500.0 * gf_n * 100.0; /* 500 gf/cm */
    const double shear = k->g * gf_n * 100.0 * 180.0 / M_PI, bend = gf_n * 1e-2;
    /* a straight line with the curve's work: LT · F · EM / 2 = K EM² / 2 */
    return (tsuya_drape_fabric){.mass_kg_m2 = 0.01 * k->w, .stretch_weft_n_m = k->lt * force_n_m / (0.01 * k->em_weft),
                                .stretch_warp_n_m = k->lt * force_n_m / (0.01 * k->em_warp), .shear_n_m = shear,
                                .bend_weft_nm = bend * k->b_weft, .bend_warp_nm = bend * k->b_warp,
                                .twist_nm = k->twist * (bend * k->b_weft + bend * k->b_warp), .thickness_m = 1e-3 * k->t, .friction = k->miu};
}

/* Typical of their kind on the KES-F sheets, not one measured cloth each.  Twist: drape.h. */
bool tsuya_drape_fabric_named(tsuya_drape_fabric *fabric, const char *name)
{
    static const struct { const char *name; tsuya_drape_kes kes; } known[] = {
        {"karaori", {.w = 35.0, .lt = 0.70, .em_weft = 3.0, .em_warp = 4.0, .g = 1.2, .b_weft = 0.60, .b_warp = 0.25, .t = 1.2, .miu = 0.20, .twist = 1.0}},
        {"silk", {.w = 7.0, .lt = 0.65, .em_weft = 4.0, .em_warp = 3.0, .g = 0.30, .b_weft = 0.03, .b_warp = 0.05, .t = 0.30, .miu = 0.16, .twist = 1.0}},
        {"cotton", {.w = 13.0, .lt = 0.75, .em_weft = 5.0, .em_warp = 3.0, .g = 1.0, .b_weft = 0.06, .b_warp = 0.09, .t = 0.50, .miu = 0.19, .twist = 1.0}},
        {"wool", {.w = 20.0, .lt = 0.62, .em_weft = 6.0, .em_warp = 5.0, .g = 0.70, .b_weft = 0.09, .b_warp = 0.11, .t = 0.70, .miu = 0.20, .twist = 1.0}},
    };
    for (size_t k = 0; k < sizeof known / sizeof known[0]; k++) {
        if (strcmp(known[k].name, name) == 0) {
            *fabric = tsuya_drape_fabric_from_kes(&known[k].kes);
            return true;
        }
    }
    return false;
}

static void close_state(drape_state *s)
{
    void *const owned[] = {s->element, s->edge, s->mass, s->x, s->x_step, s->x_free, s->velocity, s->step, s->trial, s->g, s->limit,
                           s->pairs.pair, s->toi, s->touches.touch, s->friction.touch};
    for (size_t k = 0; k < sizeof owned / sizeof owned[0]; k++) {
        tsuya_free(owned[k]);
    }
    tsuya_drape_matrix_free(&s->matrix);
    tsuya_drape_solver_free(s->solver);
}

static void weigh(drape_state *s)
{
    double total = 0.0;
    for (size_t t = 0; t < s->sheet->triangle_count; t++) {
        for (int i = 0; i < 3; i++) {
            s->mass[s->element[t].v[i]] += s->fabric->mass_kg_m2 * s->element[t].area / 3.0;
        }
        total += s->fabric->mass_kg_m2 * s->element[t].area;
    }
    s->mean_edge_m = 0.0;
    for (size_t e = 0; e < s->edge_count; e++) {
        s->mean_edge_m += tsuya_vec3_norm(tsuya_vec3_sub(drape_at(s->x, s->edge[2 * e]), drape_at(s->x, s->edge[2 * e + 1]))) / (double)s->edge_count;
    }
    s->near_m = s->fabric->thickness_m;
    s->stiffness_n_m = 30.0 * total / (double)s->n * 9.81 / s->near_m;
}

/* The solver's order is good for the vertices that share an equation: bending reaches over a triangle's edges. */
static tsuya_status open_solver(drape_state *s)
{
    enum { PAIRS = 15 }; /* of six vertices */
    tsuya_status status;
    uint32_t *pair = NULL;
    size_t count = 0;
    TSUYA_NEW(status, pair, 2 * PAIRS * s->sheet->triangle_count);
    for (size_t t = 0; t < s->sheet->triangle_count; t++) {
        const uint32_t *v = s->element[t].v;
        for (int i = 1; i < 6; i++) {
            for (int j = 0; j < i; j++) {
                if (v[i] != v[j]) {
                    pair[2 * count] = v[i] < v[j] ? v[j] : v[i];
                    pair[2 * count++ + 1] = v[i] < v[j] ? v[i] : v[j];
                }
            }
        }
    }
    status = tsuya_drape_solver_create(&s->solver, s->n, pair, count);
done:
    tsuya_free(pair);
    return status;
}

static tsuya_status open_state(drape_state *s)
{
    tsuya_status status;
    s->n = s->sheet->vertex_count;
    TSUYA_GOTO_DONE(status, tsuya_drape_elements_create(&s->element, &s->edge, &s->edge_count, s->sheet));
    double **const vectors[] = {&s->x, &s->x_step, &s->x_free, &s->velocity, &s->step, &s->trial, &s->g};
    for (size_t k = 0; k < sizeof vectors / sizeof vectors[0]; k++) {
        TSUYA_NEW(status, *vectors[k], 3 * s->n);
    }
    TSUYA_NEW(status, s->mass, s->n);
    TSUYA_NEW(status, s->limit, s->n);
    memcpy(s->x, s->sheet->position, 3 * s->n * sizeof *s->x);
    weigh(s);
    status = open_solver(s);
done:
    return status;
}

static double potential(const drape_state *s, const double *x)
{
    double sum = 0.0;
    for (size_t v = 0; v < s->n; v++) {
        sum += s->mass[v] * s->options->gravity_m_s2 * x[3 * v + 2];
    }
    return sum + tsuya_drape_stretch_energy(s, x) + tsuya_drape_bend_energy(s, x) + tsuya_drape_contact_energy(s, x);
}

static double incremental(const drape_state *s, const double *x)
{
    double sum = 0.0;
    for (size_t v = 0; v < s->n; v++) {
        tsuya_vec3 d = tsuya_vec3_sub(drape_at(x, (uint32_t)v), drape_at(s->x_free, (uint32_t)v));
        sum += 0.5 * s->mass[v] * tsuya_vec3_dot(d, d) / (s->h_s * s->h_s);
    }
    return sum + potential(s, x) + tsuya_drape_friction_energy(s, x);
}

static tsuya_status assemble(drape_state *s)
{
    memset(s->g, 0, 3 * s->n * sizeof *s->g);
    s->matrix.count = 0;
    TSUYA_TRY(tsuya_drape_find_touches(&s->touches, s, s->x));
    TSUYA_TRY(tsuya_drape_elastic_hessian(s, s->x));
    TSUYA_TRY(tsuya_drape_contact_hessian(s, s->x));
    tsuya_drape_elastic_gradient(s, s->x, s->g);
    tsuya_drape_contact_gradient(s, s->g);
    tsuya_drape_friction_gradient(s, s->x, s->g);
    TSUYA_TRY(tsuya_drape_matrix_reserve(&s->matrix, 9 * s->n));
    drape_matrix *m = &s->matrix;
    for (size_t v = 0; v < s->n; v++) {
        double k = s->mass[v] / (s->h_s * s->h_s);
        for (size_t i = 3 * v; i < 3 * v + 3; i++) {
            s->g[i] += k * (s->x[i] - s->x_free[i]) + (i == 3 * v + 2 ? s->mass[v] * s->options->gravity_m_s2 : 0.0);
        }
        tsuya_drape_matrix_add(m, (uint32_t)v, (uint32_t)v, (const double[3][3]){{k, 0, 0}, {0, k, 0}, {0, 0, k}});
    }
    for (size_t k = 0; k < m->count; k++) { /* held vertices: rows of the unit matrix */
        if (s->sheet->fixed[m->row[k] / 3] || s->sheet->fixed[m->column[k] / 3]) {
            m->value[k] = m->row[k] == m->column[k] ? 1.0 : 0.0;
        }
    }
    for (size_t i = 0; i < 3 * s->n; i++) {
        s->g[i] = s->sheet->fixed[i / 3] ? 0.0 : -s->g[i];
    }
    return TSUYA_OK;
}

static double longest(const double *d, size_t n)
{
    double most = 0.0;
    for (size_t v = 0; v < n; v++) {
        most = fmax(most, tsuya_vec3_norm(drape_at(d, (uint32_t)v)));
    }
    return most;
}

/* Goes along the step, each vertex by its own limit, as far as the energy falls; false where it does not. */
static bool descend(drape_state *s, double before, double *moved)
{
    double share = 1.0;
    for (int k = 0; k < LINE_SEARCH; k++, share *= 0.5) {
        for (size_t i = 0; i < 3 * s->n; i++) {
            s->trial[i] = s->x[i] + share * s->limit[i / 3] * s->step[i];
        }
        if (incremental(s, s->trial) < before) {
            for (size_t v = 0; v < s->n; v++) {
                *moved = fmax(*moved, share * s->limit[v] * tsuya_vec3_norm(drape_at(s->step, (uint32_t)v)));
            }
            memcpy(s->x, s->trial, 3 * s->n * sizeof *s->x);
            return true;
        }
    }
    return false;
}

/* One Newton step; *moved: the longest way that a vertex went. */
static tsuya_status newton(drape_state *s, double *moved)
{
    bool definite;
    *moved = 0.0;
    TSUYA_TRY(assemble(s));
    TSUYA_TRY(tsuya_drape_solver_solve(s->step, &definite, s->solver, &s->matrix, s->g));
    if (!definite) {
        return tsuya_fail(TSUYA_ERROR_NUMERIC, "drape: the equations of %zu vertices have no unique solution; masses and stiffnesses within a "
                          "factor of 1e12 of each other are accepted", s->n);
    }
    double most = longest(s->step, s->n), scale = fmin(1.0, s->mean_edge_m / fmax(most, 1e-300)), before = incremental(s, s->x);
    for (size_t i = 0; i < 3 * s->n; i++) {
        s->step[i] *= scale;
        s->trial[i] = s->x[i] + s->step[i];
        s->limit[i / 3] = 1.0;
    }
    TSUYA_TRY(tsuya_drape_find_pairs(s, s->x, s->trial));
    TSUYA_TRY(tsuya_drape_limit_step(s));
    if (!descend(s, before, moved)) { /* cutting some ways may have turned the step uphill: all are cut alike */
        double least = 1.0;
        for (size_t v = 0; v < s->n; v++) {
            least = fmin(least, s->limit[v]);
        }
        for (size_t v = 0; v < s->n; v++) {
            s->limit[v] = least;
        }
        descend(s, before, moved);
    }
    return TSUYA_OK;
}

/* One step of time. */
static tsuya_status advance(drape_state *s, tsuya_drape_info *info, int *taken)
{
    double moved = 0.0;
    memcpy(s->x_step, s->x, 3 * s->n * sizeof *s->x);
    TSUYA_TRY(tsuya_drape_find_touches(&s->friction, s, s->x));
    for (size_t i = 0; i < 3 * s->n; i++) {
        s->x_free[i] = s->x[i] + s->h_s * s->options->inertia * s->velocity[i];
    }
    for (*taken = 0; *taken < s->options->newton_most;) {
        TSUYA_TRY(tsuya_check_interrupt());
        TSUYA_TRY(newton(s, &moved));
        ++*taken;
        if (moved < 0.2 * s->h_s * s->options->rest_m_s || moved == 0.0) {
            break;
        }
    }
    info->kinetic_j = 0.0;
    for (size_t i = 0; i < 3 * s->n; i++) {
        s->velocity[i] = (s->x[i] - s->x_step[i]) / s->h_s;
        info->kinetic_j += 0.5 * s->mass[i / 3] * s->velocity[i] * s->velocity[i];
    }
    info->newton_steps += *taken;
    info->speed_m_s = longest(s->velocity, s->n);
    return TSUYA_OK;
}

static tsuya_status fall(drape_state *s, tsuya_drape_info *info, tsuya_drape_sheet *sheet, tsuya_drape_watch watch, void *user)
{
    const tsuya_drape_options *o = s->options;
    TSUYA_TRY(tsuya_drape_find_pairs(s, s->x, s->x));
    info->energy_j = potential(s, s->x);
    if (!isfinite(info->energy_j)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "drape: the sheet starts inside a body or touching itself; a start without contact is accepted");
    }
    s->h_s = o->step_s;
    while (info->steps < o->steps_most && !info->at_rest) {
        int taken;
        double before = info->energy_j + (o->inertia > 0.0 ? info->kinetic_j : 0.0);
        TSUYA_TRY(advance(s, info, &taken));
        info->energy_j = potential(s, s->x);
        info->energy_rise_j = fmax(info->energy_rise_j, info->energy_j + (o->inertia > 0.0 ? info->kinetic_j : 0.0) - before);
        info->steps++;
        info->at_rest = info->speed_m_s < o->rest_m_s && s->h_s >= o->step_most_s;
        s->h_s = fmin(o->step_most_s, 1.25 * s->h_s);
        tsuya_progress_update(s->context, "drape", info->steps, o->steps_most, NULL);
        if (watch) {
            watch(user, info->steps, s->x, info->energy_j);
        }
    }
    TSUYA_TRY(tsuya_drape_find_touches(&s->touches, s, s->x));
    info->contacts = (int)s->touches.count;
    memcpy(sheet->position, s->x, 3 * s->n * sizeof *s->x);
    return TSUYA_OK;
}

static tsuya_status check(const tsuya_drape_sheet *sheet, const tsuya_drape_fabric *f, const tsuya_drape_options *o)
{
    const double positive[] = {f->mass_kg_m2, f->stretch_weft_n_m, f->stretch_warp_n_m, f->shear_n_m, f->bend_weft_nm, f->bend_warp_nm,
                               f->twist_nm, f->thickness_m, o->step_s};
    static const char *const name[] = {"mass", "weft stiffness", "warp stiffness", "shear stiffness", "weft rigidity", "warp rigidity",
                                       "twist rigidity", "thickness", "step"};
    for (size_t k = 0; k < sizeof positive / sizeof positive[0]; k++) {
        if (!(positive[k] > 0.0) || !isfinite(positive[k])) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "drape: %s %g; a number above 0 is accepted", name[k], positive[k]);
        }
    }
    if (!(f->friction >= 0.0) || !(o->inertia >= 0.0 && o->inertia <= 1.0) || o->step_most_s < o->step_s || sheet->triangle_count == 0) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "drape: friction %g, inertia %g, longest step %g s, %zu triangles; friction from 0, inertia from 0 "
                          "to 1, a longest step from the first on and triangles are accepted", f->friction, o->inertia, o->step_most_s,
                          sheet->triangle_count);
    }
    return TSUYA_OK;
}

tsuya_status tsuya_drape_run(tsuya_drape_info *info, tsuya_drape_sheet *sheet, const tsuya_drape_fabric *fabric, const tsuya_drape_body *body,
                             int body_count, const tsuya_drape_options *options, tsuya_drape_watch watch, void *watch_user,
                             const tsuya_context *context)
{
    drape_state s = {.sheet = sheet, .fabric = fabric, .body = body, .body_count = body_count, .options = options, .context = context};
    *info = (tsuya_drape_info){0};
    TSUYA_TRY(check(sheet, fabric, options));
    tsuya_status status = open_state(&s);
    if (status == TSUYA_OK) {
        status = fall(&s, info, sheet, watch, watch_user);
    }
    close_state(&s);
    return status;
}

tsuya_status tsuya_drape_elastic_energy(double *stretch_j, double *bend_j, const tsuya_drape_sheet *sheet, const tsuya_drape_fabric *fabric)
{
    drape_state s = {.sheet = sheet, .fabric = fabric};
    tsuya_status status = tsuya_drape_elements_create(&s.element, &s.edge, &s.edge_count, sheet);
    if (status == TSUYA_OK) {
        *stretch_j = tsuya_drape_stretch_energy(&s, sheet->position);
        *bend_j = tsuya_drape_bend_energy(&s, sheet->position);
    }
    tsuya_free(s.element);
    tsuya_free(s.edge);
    return status;
}
