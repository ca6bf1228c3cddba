/* What the Sun's kernels share: shadow_map.py. */
#ifndef FLYAROUND_SHADOW_MAP_H
#define FLYAROUND_SHADOW_MAP_H

#include <math.h>

#include "kernels.h"

/* shadow_map.py's SKIN_M [m] and GRAZING */
#define SKIN 0.006
#define GRAZING 0.03

/* Nearest whole number 0 .. n - 1, halves to even as numpy's rint; 0 for NaN. */
static inline int32_t cell(float x, float n)
{
    const float shift = 12582912.0f; /* 1.5 * 2^23 */
    float a = x > 0.0f ? x : 0.0f, sum;
    a = a < n - 1.0f ? a : n - 1.0f;
    sum = a + shift;
    return (int32_t)(sum - shift);
}

static inline double dot(const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

/* out = M x of M (3, 3). */
static inline void times(const double *M, const double *x, double *out)
{
    out[0] = dot(M, x), out[1] = dot(M + 3, x), out[2] = dot(M + 6, x);
}

/* out = M' x of M (3, 3). */
static inline void times_transposed(const double *M, const double *x, double *out)
{
    int k;
    for (k = 0; k < 3; k++)
        out[k] = M[k] * x[0] + M[3 + k] * x[1] + M[6 + k] * x[2];
}

/* Inverse depth of a face's plane along a ray (u, v, 1): sum of inverse[k] times the ray (rays_to_faces). */
static inline void inverse_depth(const struct faces *f, int64_t face, const double *R, const double *t,
                                 float inverse[3])
{
    double n[3], d;
    int k;

    times(R, f->normals + 3 * face, n);
    d = f->offset[face] + dot(n, t);
    d = fabs(d) > 1e-9 ? d : 1e-9;
    for (k = 0; k < 3; k++)
        inverse[k] = (float)(n[k] / d);
}

/* Normalised coordinate of drawn pixel k: geometry/image_patch.py, ImagePatch.rays, across or down. */
static inline float ray(int64_t k, double scale, double corner, double centre, double focal)
{
    return (float)((((double)k + 0.5) / scale - 0.5 + corner - centre) / focal);
}

/* Least inverse depth: nothing is farther than five times the craft. */
static inline float least_inverse(const double *t) { return (float)(0.2 / (t[2] > 1e-3 ? t[2] : 1e-3)); }

#endif
