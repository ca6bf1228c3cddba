/* What share of a pixel each group of faces covers: face_gains.py (coverage). */
#ifndef FLYAROUND_COVERAGE_H
#define FLYAROUND_COVERAGE_H

#include "photometric/residuals.h"

/* Most groups with a brightness of their own, the background's among them. */
#define MOST 63

/* A share of a pixel that a chosen group covers. */
struct share {
    float value;
    int32_t slot; /* the group's place among the chosen */
};

/* Shares of pixels (n,), one pixel after another: of the k-th from first[k] to before first[k + 1]. */
struct group_coverage {
    struct share *share; /* to be freed */
    int32_t *first;      /* (n + 1,) */
};

/* The background and the groups that most middles have, at most most: their labels chosen (MOST,), how many. */
int64_t fly_choose_groups(const uint8_t *centre, int64_t pixels, int64_t most, uint8_t *chosen);

/* Shares of the chosen groups, blurred, each where it is and pixels are asked for; -1 where there is no memory. */
int fly_coverage_rows(struct drawing d, const uint8_t *chosen, int64_t n, struct gaussian g, const struct rows *rows,
                   struct group_coverage *c);

#endif
