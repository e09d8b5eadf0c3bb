/* Orthonormal frames around a normal. */
#ifndef TSUYA_RENDER_FRAME_H
#define TSUYA_RENDER_FRAME_H

#include "core/geometry.h"

/* Two tangents that make (x, y, n) right-handed; n unit (Duff et al., "Building an orthonormal basis, revisited", JCGT 6(1),
 * 2017). */
static inline void tsuya_frame_from_normal(tsuya_vec3 n, tsuya_vec3 *x, tsuya_vec3 *y)
{
    double sign = copysign(1.0, n.z), a = -1.0 / (sign + n.z), b = n.x * n.y * a;
    *x = (tsuya_vec3){1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x};
    *y = (tsuya_vec3){b, sign + n.y * n.y * a, -n.y};
}

#endif
