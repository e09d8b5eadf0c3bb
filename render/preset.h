/* Lamps by name, around a subject. */
#ifndef TSUYA_RENDER_PRESET_H
#define TSUYA_RENDER_PRESET_H

#include "render/light.h"

typedef enum tsuya_light_preset { TSUYA_PRESET_NONE, TSUYA_PRESET_DAYLIGHT, TSUYA_PRESET_TORCH, TSUYA_PRESET_HALOGEN, TSUYA_PRESET_LED } tsuya_light_preset;

/* "daylight", "torch", "halogen", "led"; TSUYA_PRESET_NONE for any other name. */
TSUYA_API tsuya_light_preset tsuya_light_preset_find(const char *name);

/* The name; "" for TSUYA_PRESET_NONE. */
TSUYA_API const char *tsuya_light_preset_name(tsuya_light_preset preset);
/* The studio's lamps, with a spectrum. */
TSUYA_API bool tsuya_light_preset_is_studio(tsuya_light_preset preset);

/* Daylight: the sun 42° high (5400 K, 500 W m⁻² facing it) in a clear sky (CIE S 011, type 12; 12000 K, 100 W m⁻² on the ground)
 * over a floor that reflects a fifth.
 * Torch: a Noh stage by firelight.  Four fire baskets on poles, their flames above the subject's shoulders (1900 K): two in front at
 * its left and right, two half as strong behind; boards and a roof that send some of it back, and a night sky between; each flame rises, falls and sways with `frame` (25 a second) as `seed` has it.
 * Both stand in the world, not with the camera, and have spectra (the sky and the stage, maps and dim, have colours alone).
 * Halogen and led are the studio's lamps with a spectrum: tsuya_light_set_studio and tsuya_light_set_give_spectrum by
 * tsuya_light_preset_name; here they fail. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_light_set_preset(tsuya_light_set *set, tsuya_light_preset preset, tsuya_vec3 center,
                                                               double radius_m, tsuya_vec3 up, uint64_t seed, int frame);

#endif
