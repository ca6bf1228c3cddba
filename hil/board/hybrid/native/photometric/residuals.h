/* The pixels of a patch that a pose moves: photometric.py (photo_step, _weights). */
#ifndef FLYAROUND_RESIDUALS_H
#define FLYAROUND_RESIDUALS_H

#include "photometric/image_jacobian.h"

/* Pixels that the pose moves, in the order of the picture: n of them, room for all. */
struct rows {
    float *d;       /* (n, WIDE) derivatives and residual */
    float *slope;   /* (n,) of what is shown by brightness */
    float *edge;    /* (n,) squared slope of the drawn picture [1 / px^2] */
    float *weight;  /* (n,) */
    int32_t *x;     /* (n,) */
    uint8_t *craft; /* (n,) whether a face is in its middle */
    int32_t *first; /* (h w + 1,) the first at or after each pixel of the patch */
    int64_t n;
};

/* How a step looks at the pictures: see fly_normal_equations. */
struct residual_images {
    const float *drawn, *slope, *gray; /* (h, w) */
    const uint8_t *centre;
    struct gaussian optics;
    float least_x, least_y; /* derivatives by a shift across and down from which a pixel counts */
};

/* The first place at or after this one that a line of numbers fills a register from. */
float *fly_aligned(float *a);

/* All pixels that the pose moves, row by row, so that what is blurred stays near; -1 where there is no memory. */
int fly_residual_rows(const struct pose_motion *m, struct drawing d, const struct residual_images *v, struct rows *out);

/* Weight of each residual: from its noise, how far borders may still be off (squared, slack), and Tukey's bound
 * (squared, tukey). sample (n,) is scratch. Returns the sum.
 */
double fly_robust_weights(struct rows *rows, double noise, double slack, double tukey, float *sample);

#endif
