/* Pictures on a patch, and what is done to all of them: face_gains.py (blurred), response.py. Rows first, (h, w);
 * numbers are the picture's own units [grey levels] unless said otherwise.
 */
#ifndef FLYAROUND_IMAGE_FORMATION_H
#define FLYAROUND_IMAGE_FORMATION_H

#include <stdlib.h>

#include "kernels.h"

/* Brightness groups that a byte holds (face_gains.py, LABELS). */
#define LABELS 255

/* Widest blur that a kernel takes [px]; the caller sees to it. */
#define WIDEST 64

/* Drawn pixels of a patch. */
struct drawing {
    const uint8_t *group; /* (h f, w f) */
    int64_t h, w, f;      /* patch pixels, and drawn ones in each, each way: 15 at most */
};

/* Place i on a line of n, mirrored at its ends without repeating them (BORDER_REFLECT_101). */
int64_t fly_reflect_101(int64_t i, int64_t n);

/* out (n,) = what the taps give of the lines p[0 .. 2 reach], of which out is none. */
void fly_convolve_lines(const float *const *p, const struct gaussian *g, float *out, int64_t n);

/* The picture src (h, w) blurred into dst, which may not be src; part (h, w) and line (w + 2 reach) are scratch. */
void fly_blur_with(const float *src, int64_t h, int64_t w, struct gaussian g, float *dst, float *part, float *line);

/* The same with scratch of its own; -1 where there is no memory. */
int fly_blur(const float *src, int64_t h, int64_t w, const struct gaussian *g, float *dst);

/* Share (h, w) of each pixel that faces cover (craft 1), or that none does (0). */
void fly_pixel_share(struct drawing d, int craft, float *share);

/* Mean value shown of n brightnesses x, and its derivative where slope is not NULL (Response.of); x may be mean. */
void fly_response(const struct response *r, const float *x, int64_t n, float *mean, float *slope);

/* Brightness that has this mean (Response.brightness). */
double fly_brightness(const struct response *r, double mean);

/* The same of n differences from a mean, as differences from a level; out may be away. */
void fly_brightness_differences(const struct response *r, const float *away, int64_t n, double mean, double level,
                                float *out);

#endif
