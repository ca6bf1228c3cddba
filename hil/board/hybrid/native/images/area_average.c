/* Regions of a picture reduced by area averaging: edge_field.py (shrink), as OpenCV's INTER_AREA does it. */
#include <math.h>
#include <stdlib.h>

#include "images/area_average.h"

/* Pixels that one reduced pixel covers along one axis: n whole ones from first on, and shares of those beside. */
struct group_coverage {
    int64_t first, n;
    float before, whole, after; /* weights; of none where it is zero */
};

/* What the reduced pixel i of m covers of n pixels. */
static struct group_coverage covered(int64_t i, int64_t n, int64_t m)
{
    const double scale = (double)n / (double)m, low = (double)i * scale, high = low + scale;
    const double cell = fmin(scale, (double)n - low);
    int64_t first = (int64_t)ceil(low), end = (int64_t)floor(high);
    struct group_coverage c;

    end = end < n - 1 ? end : n - 1;
    first = first < end ? first : end;
    c.first = first;
    c.n = end - first;
    /* shares this small are rounding */
    c.before = (double)first - low > 1e-3 ? (float)(((double)first - low) / cell) : 0.0f;
    c.after = high - (double)end > 1e-3 ? (float)(fmin(fmin(high - (double)end, 1.0), cell) / cell) : 0.0f;
    c.whole = (float)(1.0 / cell);
    return c;
}

/* The nearest whole number, the even one of two, of what is less than 2^22. */
static inline float nearest(float v)
{
    return v + 12582912.0f - 12582912.0f;
}

struct region fly_part(const struct region *r, int64_t y, int64_t x, int64_t h, int64_t w)
{
    struct region p = *r;
    p.first = (const char *)r->first + (y * r->stride + x) * r->bytes;
    p.h = h;
    p.w = w;
    return p;
}

float fly_pixel(const struct region *r, int64_t y, int64_t x)
{
    const int64_t at = y * r->stride + x;
    switch (r->bytes) {
    case 1: return (float)((const uint8_t *)r->first)[at];
    case 2: return (float)((const uint16_t *)r->first)[at];
    default: return ((const float *)r->first)[at];
    }
}

/* sum (w,) += weight times the row y of a region. */
static void add_row(const struct region *r, int64_t y, float weight, float *restrict sum)
{
    const struct region row = fly_part(r, y, 0, 1, r->w);
    const uint8_t *restrict a = row.first;
    const uint16_t *restrict b = row.first;
    const float *restrict c = row.first;
    int64_t x;

    switch (r->bytes) {
    case 1:
        for (x = 0; x < r->w; x++)
            sum[x] += weight * (float)a[x];
        break;
    case 2:
        for (x = 0; x < r->w; x++)
            sum[x] += weight * (float)b[x];
        break;
    default:
        for (x = 0; x < r->w; x++)
            sum[x] += weight * c[x];
    }
}

/* sum (w,) of n whole rows from y on. */
static void sum_rows(const struct region *r, int64_t y, int64_t n, float *restrict sum)
{
    int64_t x, k = 0;

    for (x = 0; x < r->w; x++)
        sum[x] = 0.0f;
    /* four rows of bytes at a time: as whole numbers they are exact in any order */
    for (; r->bytes == 1 && k + 4 <= n; k += 4) {
        const uint8_t *restrict a = (const uint8_t *)r->first + (y + k) * r->stride;
        const uint8_t *restrict b = a + r->stride, *restrict c = b + r->stride, *restrict d = c + r->stride;
        for (x = 0; x < r->w; x++)
            sum[x] += (float)(uint16_t)(a[x] + b[x] + c[x] + d[x]);
    }
    for (; k < n; k++)
        add_row(r, y + k, 1.0f, sum);
}

int fly_downsample(const struct region *r, int64_t h, int64_t w, float *out)
{
    struct group_coverage *across = malloc((size_t)w * sizeof *across);
    float *sum = malloc((size_t)r->w * sizeof *sum);
    int64_t x, y, k;

    if (across == NULL || sum == NULL) {
        free(across);
        free(sum);
        return -1;
    }
    for (x = 0; x < w; x++)
        across[x] = covered(x, r->w, w);
    for (y = 0; y < h; y++) {
        const struct group_coverage c = covered(y, r->h, h);
        sum_rows(r, c.first, c.n, sum);
        for (x = 0; x < r->w; x++)
            sum[x] *= c.whole;
        if (c.before > 0.0f)
            add_row(r, c.first - 1, c.before, sum);
        if (c.after > 0.0f)
            add_row(r, c.first + c.n, c.after, sum);
        /* the estimator's own reduction */
        if (r->w == 4 * w) {
            for (x = 0; x < w; x++) {
                const float *s = sum + 4 * x;
                out[y * w + x] = 0.25f * (s[0] + s[1] + s[2] + s[3]);
            }
            continue;
        }
        for (x = 0; x < w; x++) {
            const struct group_coverage *a = across + x;
            const float *s = sum + a->first;
            float total = 0.0f;
            for (k = 0; k < a->n; k++)
                total += s[k];
            total *= a->whole;
            if (a->before > 0.0f)
                total += a->before * s[-1];
            if (a->after > 0.0f)
                total += a->after * s[a->n];
            out[y * w + x] = total;
        }
    }
    /* whole numbers stay whole */
    for (x = 0; x < h * w && r->bytes < 4; x++)
        out[x] = nearest(out[x]);
    free(across);
    free(sum);
    return 0;
}

int64_t fly_area_average(const void *pixels, int64_t bytes, int64_t stride, int64_t h, int64_t w, int64_t high,
                         int64_t wide,
                   float *out)
{
    const struct region r = {pixels, bytes, h, w, stride};
    return fly_downsample(&r, high, wide, out);
}
