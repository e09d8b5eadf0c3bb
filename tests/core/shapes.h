/* Meshes with a known shape, for tests. */
#ifndef TSUYA_TESTS_SHAPES_H
#define TSUYA_TESTS_SHAPES_H

#include "core/mesh.h"

/* Sphere of `rings` × `sectors` quads (two triangles each, degenerate ones at the poles), outward. */
static inline tsuya_status shape_sphere(tsuya_mesh *mesh, tsuya_vec3 center, double radius, int rings, int sectors)
{
    TSUYA_TRY(tsuya_mesh_create(mesh, (size_t)(rings + 1) * (size_t)sectors, 2 * (size_t)rings * (size_t)sectors, 0));
    uint32_t *t = mesh->triangle;
    for (int r = 0; r <= rings; r++) {
        for (int s = 0; s < sectors; s++) {
            double theta = M_PI * r / rings, phi = 2.0 * M_PI * s / sectors;
            float *p = mesh->position + 3 * ((size_t)r * (size_t)sectors + (size_t)s);
            p[0] = (float)(center.x + radius * sin(theta) * cos(phi));
            p[1] = (float)(center.y + radius * sin(theta) * sin(phi));
            p[2] = (float)(center.z + radius * cos(theta));
            if (r < rings) {
                uint32_t a = (uint32_t)(r * sectors + s), b = (uint32_t)(r * sectors + (s + 1) % sectors);
                uint32_t c = a + (uint32_t)sectors, d = b + (uint32_t)sectors;
                const uint32_t quad[6] = {a, c, b, b, c, d};
                for (int k = 0; k < 6; k++) {
                    *t++ = quad[k];
                }
            }
        }
    }
    return TSUYA_OK;
}

/* Sheet z = height(x, y) over [x0, x1] × [y0, y1], nx × ny quads, normals up. */
static inline tsuya_status shape_sheet(tsuya_mesh *mesh, double x0, double x1, double y0, double y1, int nx, int ny,
                                       double (*height)(double x, double y))
{
    TSUYA_TRY(tsuya_mesh_create(mesh, (size_t)(nx + 1) * (size_t)(ny + 1), 2 * (size_t)nx * (size_t)ny, 0));
    uint32_t *t = mesh->triangle;
    for (int j = 0; j <= ny; j++) {
        for (int i = 0; i <= nx; i++) {
            double x = x0 + (x1 - x0) * i / nx, y = y0 + (y1 - y0) * j / ny;
            float *p = mesh->position + 3 * ((size_t)j * (size_t)(nx + 1) + (size_t)i);
            p[0] = (float)x;
            p[1] = (float)y;
            p[2] = (float)height(x, y);
            if (i < nx && j < ny) {
                uint32_t a = (uint32_t)(j * (nx + 1) + i), b = a + 1, c = a + (uint32_t)(nx + 1), d = c + 1;
                const uint32_t quad[6] = {a, b, d, a, d, c};
                for (int k = 0; k < 6; k++) {
                    *t++ = quad[k];
                }
            }
        }
    }
    return TSUYA_OK;
}

#endif
