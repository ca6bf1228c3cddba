/* Regions of a picture reduced by area averaging: edge_field.py (shrink), as OpenCV's INTER_AREA does it. */
#ifndef FLYAROUND_AREA_AVERAGE_H
#define FLYAROUND_AREA_AVERAGE_H

#include "kernels.h"

/* A picture or a region of one: its first pixel, whose type is told by its size in bytes (1 and 2 unsigned whole
 * numbers, 4 float), its rows and columns, and pixels from one row to the next. */
struct region {
    const void *first;
    int64_t bytes, h, w, stride;
};

/* The region reduced to (h, w), neither larger than its own, into out, rounded where its pixels are whole numbers; -1
 * where there is no memory. */
int fly_downsample(const struct region *r, int64_t h, int64_t w, float *out);

/* A value of the region. */
float fly_pixel(const struct region *r, int64_t y, int64_t x);

/* Part of a region: h rows and w columns from (y, x) on. */
struct region fly_part(const struct region *r, int64_t y, int64_t x, int64_t h, int64_t w);

#endif
