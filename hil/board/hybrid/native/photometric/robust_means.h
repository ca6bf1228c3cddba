/* Mean brightness of each group of faces, without what lies far off it: face_gains.py (_levels). */
#ifndef FLYAROUND_ROBUST_MEANS_H
#define FLYAROUND_ROBUST_MEANS_H

#include "kernels.h"

/* Pixels of one group and kind beside each other. */
struct run {
    int32_t start, n, key;
};

/* Mean (groups,) of each group's pixels and their number well inside it.
 *
 * centre (pixels,) : group. kind (pixels,) : 0 well inside, 1 beside a border, 2 elsewhere. gray (pixels,) : the
 * picture, sigma its noise. value and run (pixels,) are scratch.
 */
void fly_robust_means(const uint8_t *centre, const uint8_t *kind, const float *gray, int64_t pixels, int64_t groups,
               double sigma, double *level, int64_t *area, float *value, struct run *run);

#endif
