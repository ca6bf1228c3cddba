/* What a pose does to the drawn picture: motion_images.py. Camera axes: x right, y down, z forward. */
#ifndef FLYAROUND_IMAGE_JACOBIAN_H
#define FLYAROUND_IMAGE_JACOBIAN_H

#include "photometric/image_formation.h"

/* Numbers kept of a pixel: six derivatives, the residual, and one that fills the line. */
#define WIDE 8

/* All of them at once; each rounds as it does alone. */
typedef float lanes __attribute__((vector_size(4 * WIDE), may_alias));

/* What the row of a patch is made from: inverse depth n / d of each face's plane, zero first; the rays' coordinates
 * at drawn columns and half-way to the next ones, the patch pixel that each lies in, and whether it is its last.
 */
struct rays {
    float *near;           /* (faces + 1, 4) */
    float *x, *between;    /* (w f,) */
    int32_t *column, *end; /* (w f,) */
    double across, down;   /* of a border's brightness, per drawn pixel [1 / px] */
    double least, most;    /* inverse depths that can be trusted [1 / m] */
};

/* The rays of a patch; one piece of memory, to be freed, NULL where there is none. */
float *fly_patch_rays(const struct pose_motion *m, struct drawing d, struct rays *r);

/* Derivatives cell (w, WIDE) of row y of the patch, by turn about the target's origin and shift, added to what is
 * there, the last two left alone; any (w,) : becomes 1 where there are some.
 */
void fly_jacobian_row(const struct pose_motion *m, const struct rays *r, struct drawing d, int64_t y, float *cell,
                    uint8_t *any);

#endif
