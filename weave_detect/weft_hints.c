#include "weave_detect/weft_hints.h"

#include <math.h>

static const double TOLD = 0.5;                       /* share by which one side must lead */
static const double ALONG_RAD = 10.0 * M_PI / 180.0;  /* of a family with a rim that was cut along it */
static const double LEVEL = 0.35, UPRIGHT = 0.9;      /* cosines with the vertical */
static const double STRAIGHT = 0.8;                   /* cosine between the two sides of a rim, less the sign */

bool tsuya_weft_decide(tsuya_weft_told *told, const tsuya_weft_hints *h)
{
    if (h->has_user) {
        *told = TSUYA_WEFT_USER;
        return h->user < 0.0;
    }
    if (fabs(h->count) > TOLD * h->count_weight) {
        *told = TSUYA_WEFT_COUNT;
        return h->count < 0.0;
    }
    if (fabs(h->rim) > TOLD * h->rim_weight) {
        *told = TSUYA_WEFT_HEM;
        return h->rim < 0.0;
    }
    *told = TSUYA_WEFT_UNKNOWN;
    return 10.0 * h->count + 0.1 * h->level < 0.0;
}

static tsuya_vec3 towards(const tsuya_mesh *mesh, size_t from, size_t to)
{
    return tsuya_vec3_unit(tsuya_vec3_sub(tsuya_mesh_position(mesh, to), tsuya_mesh_position(mesh, from)));
}

/* Between the two rim neighbours that lie most opposite each other: beside a corner there is a third. */
bool tsuya_rim_direction(tsuya_vec3 *along, const tsuya_mesh *mesh, const tsuya_mesh_graph *graph, size_t v)
{
    double least = -STRAIGHT;
    bool found = false;
    for (uint32_t e = graph->start[v]; graph->rim[v] && e < graph->start[v + 1]; e++) {
        for (uint32_t g = e + 1; graph->rim[graph->neighbour[e]] && g < graph->start[v + 1]; g++) {
            if (graph->rim[graph->neighbour[g]]) {
                tsuya_vec3 one = towards(mesh, v, graph->neighbour[e]), other = towards(mesh, v, graph->neighbour[g]);
                double cosine = tsuya_vec3_dot(one, other);
                if (cosine < least) {
                    least = cosine;
                    *along = tsuya_vec3_unit(tsuya_vec3_sub(other, one));
                    found = true;
                }
            }
        }
    }
    return found;
}

double tsuya_rim_hint(double angle_rad, double up_cosine)
{
    double from = tsuya_line_difference(angle_rad, 0.0), cosine = fabs(up_cosine);
    double rim = cosine < LEVEL ? 1.0 : cosine > UPRIGHT ? -1.0 : 0.0;
    return from < ALONG_RAD ? rim : from > 0.5 * M_PI - ALONG_RAD ? -rim : 0.0;
}
