/* A rendered picture as files: linear float EXR and a PNG through a stated view transform. */
#ifndef TSUYA_RENDER_FILM_H
#define TSUYA_RENDER_FILM_H

#include "core/image.h"

#include "render/path.h"

/* What a picture's header says of it. */
typedef struct tsuya_film_note {
    int count;
    const char *name[16], *value[16];
} tsuya_film_note;

/* Radiance, linear Rec.709, half floats, ZIP, channels R G B A; A is the cloth's coverage. Values beyond half's range are held at it. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_film_save_exr(const tsuya_film *film, const char *path, const tsuya_film_note *note);
/* View transform: adapt · linear · 2^exposure_ev (adapt NULL: nothing), clipped to [0, 1], sRGB curve, 8 bits. No tone curve beside. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_film_save_png(const tsuya_film *film, const char *path, double exposure_ev,
                                                            const tsuya_mat3 *adapt);
/* What an eye that has adapted to a white (linear Rec.709, not black) sees as D65: tsuya_xyz_adapt, as a matrix. */
TSUYA_API tsuya_mat3 tsuya_film_adaptation(const double white[3]);
/* Exposure from a picture of the same scene with a white card for its cloth, lit by lamps alone: the median of the
 * card becomes display white, so that a dyed cloth in good light shows its dye; 0 EV without cloth or light.  white: the card's mean
 * colour at luminance 1 (1, 1, 1 without cloth or light). */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_film_card_exposure(double *exposure_ev, double white[3], const tsuya_film *card);
/* Root mean square difference of the linear channels to an image of the same size; fails on another size. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_film_rmse(double *rmse, const tsuya_film *film, const char *reference_path);

#endif
