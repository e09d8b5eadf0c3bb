/* Colours: linear Rec.709, CIE XYZ, CIELAB, and how far two colours lie apart.
 *
 * XYZ of the 2° observer with Y = 1 for white; Rec.709 primaries and white point D65 (ITU-R BT.709-6).  Lab refers to a white
 * that the caller gives, or to D65 for the rgb pair.  Nothing here clips: values outside [0, 1] go through. */
#ifndef TSUYA_CORE_COLOR_H
#define TSUYA_CORE_COLOR_H

#include "core/geometry.h"

typedef struct tsuya_lab { double l, a, b; } tsuya_lab; /* L* 0 … 100, a*, b* */

/* XYZ of rgb = (1, 1, 1). */
TSUYA_API tsuya_vec3 tsuya_white_d65(void);
TSUYA_API tsuya_vec3 tsuya_xyz_from_rgb(tsuya_vec3 rgb);
TSUYA_API tsuya_vec3 tsuya_rgb_from_xyz(tsuya_vec3 xyz);
/* What an eye that has adapted to the white `from` sees as one that has adapted to `to`: Bradford's cone responses (Lam 1985), complete, as in
 * the ICC's profile specification. */
TSUYA_API tsuya_vec3 tsuya_xyz_adapt(tsuya_vec3 xyz, tsuya_vec3 from, tsuya_vec3 to);
/* Y of linear rgb. */
static inline double tsuya_rgb_luminance(const double rgb[3]) { return 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]; }
static inline double tsuya_rgb_luminance_f32(const float rgb[3])
{
    return tsuya_rgb_luminance((const double[3]){(double)rgb[0], (double)rgb[1], (double)rgb[2]});
}
TSUYA_API tsuya_lab tsuya_lab_from_xyz(tsuya_vec3 xyz, tsuya_vec3 white);
TSUYA_API tsuya_vec3 tsuya_xyz_from_lab(tsuya_lab lab, tsuya_vec3 white);
/* Under D65. */
TSUYA_API tsuya_lab tsuya_lab_from_rgb(tsuya_vec3 rgb);
TSUYA_API tsuya_vec3 tsuya_rgb_from_lab(tsuya_lab lab);
/* CIEDE2000 with kL = kC = kH = 1 (CIE 142-2001; Sharma, Wu, Dalal, "The CIEDE2000 color-difference formula: implementation
 * notes, supplementary test data, and mathematical observations", Color Research & Application 30(1), 2005). */
TSUYA_API double tsuya_color_difference(tsuya_lab a, tsuya_lab b);

#endif
