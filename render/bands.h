/* The wavelengths of a spectral render, carried along each path all at once.
 *
 * A path keeps, for each wavelength of the materials, the share that its reflections leave: reflectance is linear between the
 * wavelengths, lamps need not be.  What a lamp then adds to the picture is the integral of its power, the share and the observer
 * at every nm, which is one weight a wavelength and colour, made before the first ray; a lamp of narrow lines costs nothing
 * and loses nothing.
 *
 * Colours without a spectrum get one.  A reflectance is r, g, b parts of three spectra between 0 and 1 that add up to 1, have the
 * colour of the primaries under D65, and change as little as possible from wavelength to wavelength (Mallett and Yuksel, "Spectral
 * primary decomposition for rendering with sRGB reflectance", EGSR 2019; table of our own, for our observer); a lamp's colour is
 * that of such a reflectance under D65. */
#ifndef TSUYA_RENDER_BANDS_H
#define TSUYA_RENDER_BANDS_H

#include "brdf/material.h"

#include "render/lamp_spectrum.h"

typedef struct tsuya_bands {
    int count;
    double nm[TSUYA_MATERIAL_MAX_CHANNELS];             /* ascending */
    double primary[TSUYA_MATERIAL_MAX_CHANNELS][3];     /* reflectance of pure red, green, blue */
    double response[3][3][TSUYA_MATERIAL_MAX_CHANNELS]; /* [lamp's r g b][picture's r g b]: weights of what a coloured lamp adds */
} tsuya_bands;

/* From the channels of a material (called `name` in messages); fails when they are not wavelengths, do not ascend, do not reach from 430
 * to 670 nm or leave gaps above 40 nm there. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_bands_of_channels(tsuya_bands *bands, const char *const *channel, int channel_count, const char *name);
/* What can be rendered: r, g, b, or such wavelengths (spectral). */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_bands_check(bool *spectral, const char *const *channel, int channel_count, const char *name);
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_bands_of_material(tsuya_bands *bands, const tsuya_material *material);
/* true when the material's channels are these wavelengths */
TSUYA_API bool tsuya_bands_match(const tsuya_bands *bands, const tsuya_material *material);
/* Weights [picture's r g b][count] of a lamp of luminance 1. */
TSUYA_API void tsuya_bands_respond(double *weight, const tsuya_bands *bands, const tsuya_lamp_spectrum *spectrum);
/* A colour's reflectance at the wavelengths, count numbers. */
TSUYA_API void tsuya_bands_spread(double *reflectance, const tsuya_bands *bands, const double rgb[3]);

#endif
