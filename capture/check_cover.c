/* From which sides is the object photographed, and from which not yet?
 *
 * Every matched pair tells how its cameras are turned to each other.  A spanning tree over the pairs with most features gives each
 * photograph a rotation; then each becomes the mean of what its neighbours say of it, pairs that contradict counting less (single
 * rotation averaging in turn, robust: Hartley, Trumpf, Dai, Li, "Rotation averaging", IJCV 103, 2013).  Nobody needs to know where the
 * cameras stand: the object lies where they look, so their axes are the directions that it is seen from.  Up is what the pictures' rows
 * have in common.
 *
 * A surface that faces some direction is covered when FEWEST good photographs see it within REACH_DEG of its normal.  Missing views
 * are chosen one after the other, each the one that covers most (the share counts every photograph up to FEWEST, so it is submodular and the
 * greedy choice is within 1 − 1/e of the best). */
#include "capture/check_photo.h"

#include "core/memory.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { NORMALS = 1500, FEWEST = 3, TURNS_SWEEPS = 200, AZIMUTHS = 36, ELEVATIONS = 5, FEWEST_TURNED = 12 };
static const double REACH_DEG = 45.0, LOWEST_DEG = -20.0, DOUBT_DEG = 4.0, ENOUGH_GAIN = 0.004, APART_DEG = 7.0;

typedef struct placement {
    int count;
    bool *placed;
    tsuya_mat3 *camera_from_common;
    tsuya_vec3 *from; /* unit, from the object to the camera; z up, azimuth 0 at the first */
} placement;

/* The largest part of the session that hangs together, along the strongest pairs (Prim). */
static void span_from(placement *p, const tsuya_check_relation *relations, int root)
{
    for (int i = 0; i < p->count; i++) {
        p->placed[i] = i == root;
    }
    p->camera_from_common[root] = tsuya_mat3_identity();
    for (;;) {
        int best = FEWEST_TURNED - 1, from = -1, to = -1;
        for (int i = 0; i < p->count; i++) {
            for (int j = 0; p->placed[i] && j < p->count; j++) {
                const tsuya_check_relation *r = &relations[i * p->count + j];
                if (!p->placed[j] && r->used && r->turned > best) {
                    best = r->turned;
                    from = i;
                    to = j;
                }
            }
        }
        if (to < 0) {
            return;
        }
        p->placed[to] = true;
        p->camera_from_common[to] = tsuya_mat3_multiply(relations[from * p->count + to].turn, p->camera_from_common[from]);
    }
}

static int placed_count(const placement *p)
{
    int n = 0;
    for (int i = 0; i < p->count; i++) {
        n += p->placed[i];
    }
    return n;
}

static void span(placement *p, const tsuya_check_relation *relations)
{
    int best = 0, root = 0;
    for (int i = 0; i < p->count; i++) {
        span_from(p, relations, i);
        int n = placed_count(p);
        root = n > best ? i : root;
        best = n > best ? n : best;
    }
    if (p->count > 0) {
        span_from(p, relations, root);
    }
}

/* One photograph's rotation out of its neighbours', on the tangent space of the old one. */
static void average(placement *p, const tsuya_check_relation *relations, int i)
{
    tsuya_vec3 step = {0, 0, 0};
    double sum = 0.0, doubt = tsuya_rad_from_deg(DOUBT_DEG);
    for (int j = 0; j < p->count; j++) {
        const tsuya_check_relation *r = &relations[j * p->count + i]; /* i_from_j */
        if (j == i || !p->placed[j] || !r->used || r->turned < FEWEST_TURNED) {
            continue;
        }
        tsuya_mat3 said = tsuya_mat3_multiply(r->turn, p->camera_from_common[j]);
        tsuya_vec3 off = tsuya_rodrigues_from_mat3(tsuya_mat3_multiply(said, tsuya_mat3_transpose(p->camera_from_common[i])));
        double angle = tsuya_vec3_norm(off), weight = r->turned / (1.0 + angle * angle / (doubt * doubt));
        step = tsuya_vec3_mad(step, weight, off);
        sum += weight;
    }
    if (sum > 0.0) {
        tsuya_mat3 by = tsuya_mat3_from_rodrigues(tsuya_vec3_scale(step, 1.0 / sum));
        p->camera_from_common[i] = tsuya_mat3_multiply(by, p->camera_from_common[i]);
    }
}

/* The picture's right and up in the camera frame, as EXIF says that it is to be held. */
static void held(tsuya_vec3 *right, tsuya_vec3 *up, int orientation)
{
    static const tsuya_vec3 rights[] = {{1, 0, 0}, {-1, 0, 0}, {0, -1, 0}, {0, 1, 0}}, ups[] = {{0, -1, 0}, {0, 1, 0}, {-1, 0, 0}, {1, 0, 0}};
    int k = orientation == 3 || orientation == 4 ? 1 : orientation == 5 || orientation == 6 ? 2 : orientation >= 7 ? 3 : 0;
    *right = rights[k];
    *up = ups[k];
}

/* The direction that no picture's row has a part in; of a session from one side alone, near the mean of the pictures' ups. */
static tsuya_vec3 common_up(const placement *p, const tsuya_check *check)
{
    tsuya_mat3 spread = {{{0}}}, vectors;
    tsuya_vec3 mean = {0, 0, 0};
    double values[3], n = fmax(1.0, placed_count(p));
    for (int i = 0; i < p->count; i++) {
        tsuya_vec3 right, up;
        if (!p->placed[i]) {
            continue;
        }
        held(&right, &up, check->photo[i].photo.orientation);
        right = tsuya_mat3_apply_transposed(p->camera_from_common[i], right);
        mean = tsuya_vec3_add(mean, tsuya_mat3_apply_transposed(p->camera_from_common[i], up));
        const double r[3] = {right.x, right.y, right.z};
        for (int a = 0; a < 9; a++) {
            spread.e[a / 3][a % 3] += r[a / 3] * r[a % 3] / n;
        }
    }
    mean = tsuya_vec3_unit(mean);
    const double m[3] = {mean.x, mean.y, mean.z};
    for (int a = 0; a < 9; a++) {
        spread.e[a / 3][a % 3] -= 0.1 * m[a / 3] * m[a % 3];
    }
    tsuya_mat3_eigen_symmetric(spread, values, &vectors);
    tsuya_vec3 up = {vectors.e[0][0], vectors.e[1][0], vectors.e[2][0]};
    return tsuya_vec3_dot(up, mean) < 0.0 ? tsuya_vec3_scale(up, -1.0) : up;
}

static void set_directions(placement *p, tsuya_check *check, const tsuya_check_sight *sight)
{
    tsuya_vec3 up = common_up(p, check), east = {0, 0, 0};
    for (int i = 0; i < p->count; i++) {
        tsuya_checked_photo *photo = &check->photo[i];
        photo->azimuth_deg = photo->elevation_deg = NAN;
        if (!p->placed[i]) {
            continue;
        }
        tsuya_vec3 out = tsuya_vec3_scale(tsuya_mat3_apply_transposed(p->camera_from_common[i], sight[i].towards), -1.0);
        if (tsuya_vec3_norm(east) == 0.0) {
            east = tsuya_vec3_tangent(out, up);
        }
        p->from[i] = (tsuya_vec3){tsuya_vec3_dot(out, east), tsuya_vec3_dot(out, tsuya_vec3_cross(up, east)), tsuya_vec3_dot(out, up)};
        photo->azimuth_deg = tsuya_deg_from_rad(atan2(p->from[i].y, p->from[i].x));
        photo->azimuth_deg += photo->azimuth_deg < 0.0 ? 360.0 : 0.0;
        photo->azimuth_deg = photo->azimuth_deg < 360.0 ? photo->azimuth_deg : 0.0; /* a hair below 0 rounds to 360 */
        photo->elevation_deg = tsuya_deg_from_rad(asin(fmax(-1.0, fmin(1.0, p->from[i].z))));
        check->focal_assumed += sight[i].assumed;
    }
    check->placed = placed_count(p);
    check->focal_assumed /= check->placed > 0 ? check->placed : 1;
}

/* Directions spread evenly over the sphere above LOWEST_DEG (Fibonacci's spiral); where surfaces that stand on a floor may face. */
static tsuya_vec3 normal_at(int k)
{
    double low = sin(tsuya_rad_from_deg(LOWEST_DEG)), z = low + (1.0 - low) * (k + 0.5) / NORMALS, r = sqrt(1.0 - z * z);
    double angle = k * M_PI * (3.0 - sqrt(5.0));
    return (tsuya_vec3){r * cos(angle), r * sin(angle), z};
}

static void see_from(uint8_t *seen, tsuya_vec3 view)
{
    double reach = cos(tsuya_rad_from_deg(REACH_DEG));
    for (int k = 0; k < NORMALS; k++) {
        seen[k] = (uint8_t)(seen[k] + (seen[k] < FEWEST && tsuya_vec3_dot(normal_at(k), view) >= reach));
    }
}

static double gain_of(const uint8_t *seen, tsuya_vec3 view)
{
    double reach = cos(tsuya_rad_from_deg(REACH_DEG)), gain = 0.0;
    for (int k = 0; k < NORMALS; k++) {
        gain += seen[k] < FEWEST && tsuya_vec3_dot(normal_at(k), view) >= reach ? 1.0 : 0.0;
    }
    return gain / (FEWEST * NORMALS);
}

static tsuya_vec3 candidate(int k, double *azimuth_deg, double *elevation_deg)
{
    *azimuth_deg = 360.0 / AZIMUTHS * (k % AZIMUTHS);
    *elevation_deg = 5.0 + 15.0 * (k / AZIMUTHS);
    double a = tsuya_rad_from_deg(*azimuth_deg), e = tsuya_rad_from_deg(*elevation_deg);
    return (tsuya_vec3){cos(e) * cos(a), cos(e) * sin(a), sin(e)};
}

static void describe(tsuya_check_missing *m, const placement *p, const tsuya_check *check, tsuya_vec3 view)
{
    double best = -2.0;
    for (int i = 0; i < p->count; i++) {
        double c = p->placed[i] ? tsuya_vec3_dot(p->from[i], view) : -2.0;
        if (c > best) {
            best = c;
            m->nearest = i;
        }
    }
    m->right_deg = remainder(m->azimuth_deg - check->photo[m->nearest].azimuth_deg, 360.0);
    m->up_deg = m->elevation_deg - check->photo[m->nearest].elevation_deg;
}

/* A second photograph from the same place shows no depth. */
static bool is_taken(const placement *p, const tsuya_check *check, tsuya_vec3 view)
{
    double near = cos(tsuya_rad_from_deg(APART_DEG)), azimuth, elevation;
    for (int i = 0; i < p->count; i++) {
        if (p->placed[i] && check->photo[i].fault_count == 0 && tsuya_vec3_dot(p->from[i], view) > near) {
            return true;
        }
    }
    for (int k = 0; k < check->missing_count; k++) {
        int number = (int)lround(check->missing[k].azimuth_deg / (360.0 / AZIMUTHS)) + AZIMUTHS * (int)lround((check->missing[k].elevation_deg - 5.0) / 15.0);
        if (tsuya_vec3_dot(candidate(number, &azimuth, &elevation), view) > near) {
            return true;
        }
    }
    return false;
}

static void find_missing(tsuya_check *check, uint8_t *seen, const placement *p)
{
    while (check->missing_count < TSUYA_CHECK_MISSING) {
        tsuya_check_missing *m = &check->missing[check->missing_count], own = {0};
        tsuya_vec3 chosen = {0, 0, 1};
        for (int k = 0; k < AZIMUTHS * ELEVATIONS; k++) {
            tsuya_vec3 view = candidate(k, &own.azimuth_deg, &own.elevation_deg);
            own.gain = is_taken(p, check, view) ? 0.0 : gain_of(seen, view);
            if (k == 0 || own.gain > m->gain) {
                *m = own;
                chosen = view;
            }
        }
        if (m->gain < ENOUGH_GAIN) {
            return;
        }
        describe(m, p, check, chosen);
        see_from(seen, chosen);
        check->missing_count++;
    }
}

tsuya_status tsuya_check_cover(tsuya_check *check, const tsuya_check_relation *relations, const tsuya_check_sight *sight,
                               const tsuya_check_options *options)
{
    tsuya_status status = TSUYA_OK;
    placement p = {.count = check->count};
    uint8_t *seen = NULL;
    size_t n = (size_t)check->count, covered = 0;
    (void)options;
    check->placed = check->missing_count = 0;
    check->covered = NAN;
    check->focal_assumed = 0.0;
    TSUYA_NEW(status, p.placed, n);
    TSUYA_NEW(status, p.camera_from_common, n);
    TSUYA_NEW(status, p.from, n);
    TSUYA_NEW(status, seen, NORMALS);
    span(&p, relations);
    for (int sweep = 0; sweep < TURNS_SWEEPS; sweep++) {
        for (int i = 0; i < p.count; i++) {
            if (p.placed[i]) {
                average(&p, relations, i);
            }
        }
    }
    if (placed_count(&p) < 2) {
        memset(p.placed, 0, n * sizeof *p.placed); /* a single photograph says nothing about its place */
    }
    set_directions(&p, check, sight);
    if (check->placed == 0) {
        goto done;
    }
    for (int i = 0; i < p.count; i++) {
        if (p.placed[i] && check->photo[i].fault_count == 0) {
            see_from(seen, p.from[i]);
        }
    }
    for (int k = 0; k < NORMALS; k++) {
        covered += seen[k] >= FEWEST;
    }
    check->covered = (double)covered / NORMALS;
    find_missing(check, seen, &p);
done:
    tsuya_free(p.placed);
    tsuya_free(p.camera_from_common);
    tsuya_free(p.from);
    tsuya_free(seen);
    return status;
}

void tsuya_check_missing_text(char *text, size_t size, const tsuya_check *check, const tsuya_check_missing *m)
{
    char aside[64] = "", above[64] = "";
    if (fabs(m->right_deg) >= 3.0) {
        snprintf(aside, sizeof aside, "%.0f degrees to the %s of ", fabs(m->right_deg), m->right_deg > 0.0 ? "right" : "left");
    }
    if (fabs(m->up_deg) >= 3.0) {
        snprintf(above, sizeof above, "%s%.0f degrees %s%s", aside[0] ? ", " : "", fabs(m->up_deg), m->up_deg > 0.0 ? "higher" : "lower", aside[0] ? "" : " than ");
    }
    snprintf(text, size, "%s%s%.160s%s", aside[0] ? aside : above, aside[0] || above[0] ? "" : "beside ", check->photo[m->nearest].photo.name, aside[0] ? above : "");
}
