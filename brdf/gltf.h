/* The BRDF of glTF 2.0 with the extensions that cloth needs (Khronos Group; appendix B of glTF 2.0, KHR_materials_specular,
 * KHR_materials_anisotropy, KHR_materials_sheen): an anisotropic GGX surface over a diffuse part, a Charlie sheen above both. */
#ifndef TSUYA_BRDF_GLTF_H
#define TSUYA_BRDF_GLTF_H

#include "core/geometry.h"

enum { TSUYA_GLTF_SHEEN_NODES = 17 };

typedef struct tsuya_gltf {
    double base[3], f0[3], f90; /* diffuse reflectance; the surface's at the normal and at grazing: a metal's base colour and 1, or
                                  * 0.04 specularColorFactor · specularFactor and specularFactor */
    double roughness, anisotropy, rotation_rad; /* anisotropyStrength; direction of the rougher axis, counter-clockwise from the weft */
    double sheen[3], sheen_roughness;
    double sheen_albedo[TSUYA_GLTF_SHEEN_NODES]; /* over cosines 0 … 1: tsuya_gltf_prepare */
} tsuya_gltf;

/* After sheen_roughness was set. */
void tsuya_gltf_prepare(tsuya_gltf *g);
void tsuya_gltf_eval(double value[3], const tsuya_gltf *g, tsuya_vec3 wi, tsuya_vec3 wo);

#endif
