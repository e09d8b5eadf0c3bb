/* Photographs that are spoilt on purpose, in the test's own folder. */
#ifndef TSUYA_TESTS_CAPTURE_FAULTS_H
#define TSUYA_TESTS_CAPTURE_FAULTS_H

#include "capture/check.h"

/* Links (copies where linking fails) every image of a folder into another. */
void faults_take_all(const char *to_folder, const char *from_folder);
/* TO becomes FROM spoilt; written as an image by TO's extension, without EXIF. */
void fault_gaussian(const char *to, const char *from, double sigma_px);
void fault_motion(const char *to, const char *from, int length_px);
/* Linear light times a gain for each channel. */
void fault_gain(const char *to, const char *from, double red, double green, double blue);
/* The same picture, encoded again. */
void fault_again(const char *to, const char *from);
/* Another picture at this size, so that size does not tell. */
void fault_foreign(const char *to, const char *from, int width_px, int height_px);
/* The same place through a lens zoomed by this factor: the middle, enlarged (bilinear). */
void fault_zoom(const char *to, const char *from, double factor);

/* The photograph of a name; fails the test where there is none. */
const tsuya_checked_photo *checked(const tsuya_check *check, const char *name);
/* Fails the test unless the photograph is accused in words that contain `part`. */
void assert_accused(const tsuya_check *check, const char *name, const char *part);

#endif
