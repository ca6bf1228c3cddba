/* The pixels of a patch that a pose moves, their blurred derivatives and weights: see residuals.h. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "photometric/residuals.h"

/* Median of the size of normal noise of unit deviation, inverted (photometric.py, _weights). */
#define ROBUST 1.4826

/* A row blurred across: cells (w, WIDE), and where hit (w,) they are not zero. */
struct across {
    float *cell;
    uint8_t *hit;
};

float *fly_aligned(float *a)
{
    const uintptr_t bytes = WIDE * sizeof *a;

    return (float *)(((uintptr_t)a + bytes - 1) / bytes * bytes);
}

/* A row of derivatives blurred across: few pixels have any, so each is spread to where it reaches. */
static void spread(const float *cell, const uint8_t *any, int64_t w, struct gaussian g, struct across out)
{
    const int64_t r = g.reach;
    int64_t p, x;

    memset(out.cell, 0, (size_t)(WIDE * w) * sizeof *out.cell);
    memset(out.hit, 0, (size_t)w);
    for (p = -r; p < w + r; p++) {
        const int64_t from = p >= 0 && p < w ? p : fly_reflect_101(p, w);
        const int64_t low = p - r > 0 ? p - r : 0, high = p + r < w - 1 ? p + r : w - 1;
        if (!any[from])
            continue;
        const lanes own = *(const lanes *)(const void *)(cell + WIDE * from);
        lanes *to = (lanes *)(void *)out.cell;
        memset(out.hit + low, 1, (size_t)(high + 1 - low));
        for (x = low; x <= high; x++)
            to[x] += g.taps[r + x - p] * own;
    }
}

/* Squared slope of a picture at a pixel by Sobel's masks. */
static float edge(const float *a, int64_t h, int64_t w, int64_t x, int64_t y)
{
    const int64_t above = y > 0 ? y - 1 : fly_reflect_101(-1, h), under = y + 1 < h ? y + 1 : fly_reflect_101(h, h);
    const int64_t l = x > 0 ? x - 1 : fly_reflect_101(-1, w), r = x + 1 < w ? x + 1 : fly_reflect_101(w, w);
    const float *up = a + above * w, *at = a + y * w, *down = a + under * w;
    const float gx = 0.125f * ((up[r] - up[l]) + 2.0f * (at[r] - at[l]) + (down[r] - down[l]));
    const float gy = 0.125f * ((down[l] - up[l]) + 2.0f * (down[x] - up[x]) + (down[r] - up[r]));

    return gx * gx + gy * gy;
}

/* A pixel that the pose moves, its blurred derivatives in a. */
static inline void take(const struct residual_images *v, struct drawing d, int64_t x, int64_t y, const lanes *a,
                        struct rows *out)
{
    const int64_t at = y * d.w + x, n = out->n++;
    lanes *to = (lanes *)(void *)(out->d + WIDE * n);

    *to = *a;
    (*to)[6] = v->gray[at] - v->drawn[at];
    out->slope[n] = v->slope == NULL ? 1.0f : v->slope[at];
    out->edge[n] = edge(v->drawn, d.h, d.w, x, y);
    out->craft[n] = v->centre[at] > 0;
    out->x[n] = (int32_t)x;
}

static inline void join(uint8_t *restrict to, const uint8_t *restrict from, int64_t n)
{
    int64_t x;

    for (x = 0; x < n; x++)
        to[x] |= from[x];
}

/* What the taps give of n rows' cells at one place. */
static inline void weigh(const lanes *const *cell, int64_t x, const float *taps, const int n, lanes *sum)
{
    int j;

    for (j = 0; j < n; j++)
        *sum += taps[j] * cell[j][x];
}

/* Row y from the rows about it, blurred across already: its pixels whose derivatives count. hit (w,) is scratch. */
static void blurred_row(const struct across *ring, int64_t size, const struct residual_images *v, struct drawing d,
                               int64_t y, uint8_t *hit, struct rows *out)
{
    const int64_t r = v->optics.reach;
    const lanes *cell[2 * WIDEST + 1];
    int64_t j, x;

    memset(hit, 0, (size_t)d.w);
    for (j = -r; j <= r; j++) {
        const struct across *row = ring + fly_reflect_101(y + j, d.h) % size;
        cell[r + j] = (const lanes *)(const void *)row->cell;
        join(hit, row->hit, d.w);
    }
    for (x = 0; x < d.w; x++) {
        lanes sum = {0};
        out->first[y * d.w + x] = (int32_t)out->n;
        if (!hit[x])
            continue;
        /* a constant number of taps spares the ends of loops */
        if (r == 2)
            weigh(cell, x, v->optics.taps, 5, &sum);
        else if (r == 3)
            weigh(cell, x, v->optics.taps, 7, &sum);
        else if (r == 5)
            weigh(cell, x, v->optics.taps, 11, &sum);
        else
            weigh(cell, x, v->optics.taps, (int)(2 * r + 1), &sum);
        if (fabsf(sum[3]) > v->least_x || fabsf(sum[4]) > v->least_y)
            take(v, d, x, y, &sum, out);
    }
    out->first[(y + 1) * d.w] = (int32_t)out->n;
}

int fly_residual_rows(const struct pose_motion *m, struct drawing d, const struct residual_images *v, struct rows *out)
{
    const int64_t r = v->optics.reach, size = d.h < 2 * r + 1 ? d.h : 2 * r + 1, line = WIDE * d.w;
    struct rays rays;
    float *block = fly_patch_rays(m, d, &rays), *cells = malloc((size_t)(line * (size + 1) + WIDE) * sizeof *cells);
    uint8_t *any = malloc((size_t)((size + 2) * d.w)), *const hit = any + d.w;
    struct across *ring = malloc((size_t)size * sizeof *ring);
    const int ready = block != NULL && cells != NULL && ring != NULL && any != NULL;
    float *const own = fly_aligned(cells);
    int64_t y, done = 0;

    for (y = 0; ready && y < size; y++) {
        ring[y].cell = own + line * (y + 1);
        ring[y].hit = hit + d.w * (y + 1);
    }
    for (y = 0; ready && y < d.h; y++) {
        memset(own, 0, (size_t)line * sizeof *own);
        memset(any, 0, (size_t)d.w);
        fly_jacobian_row(m, &rays, d, y, own, any);
        spread(own, any, d.w, v->optics, ring[y % size]);
        for (; done < d.h && (done + r <= y || y == d.h - 1); done++)
            blurred_row(ring, size, v, d, done, hit, out);
    }
    free(block);
    free(cells);
    free(any);
    free(ring);
    return ready ? 0 : -1;
}

/* The k-th of values (n,), least first, which it moves about. */
static float ranked(float *a, int64_t n, int64_t k)
{
    int64_t low = 0, high = n - 1;

    while (low < high) {
        const float pivot = a[low + (high - low) / 2];
        int64_t i = low, j = high;
        while (i <= j) {
            while (i <= high && a[i] < pivot)
                i++;
            while (j >= low && pivot < a[j])
                j--;
            if (i <= j) {
                const float swap = a[i];
                a[i++] = a[j];
                a[j--] = swap;
            }
        }
        if (k <= j)
            high = j;
        else if (k >= i)
            low = i;
        else
            break;
    }
    return a[k];
}

double fly_robust_weights(struct rows *rows, double noise, double slack, double tukey, float *sample)
{
    const float per_edge = (float)slack, quiet = (float)(noise * noise);
    float spread[2];
    double sum = 0;
    int64_t i, n;
    int part;

    for (part = 0; part < 2; part++) {
        int64_t taken = 0;
        n = 0;
        for (i = 0; i < rows->n; i++)
            if (rows->craft[i] == part && per_edge * rows->edge[i] < quiet) {
                /* every other one says enough */
                sample[n] = fabsf(rows->d[WIDE * i + 6]);
                n += !(taken++ & 1);
            }
        const double middle = n > 0 ? ROBUST * (double)ranked(sample, n, n / 2) : 0.0;
        const double deviation = middle > noise ? middle : noise;
        spread[part] = (float)(deviation * deviation);
    }
    for (i = 0; i < rows->n; i++) {
        const float e = rows->d[WIDE * i + 6], variance = spread[rows->craft[i]] + per_edge * rows->edge[i];
        const float inside = 1.0f - e * e / ((float)tukey * variance);
        rows->weight[i] = inside > 0 ? inside * inside / variance : 0.0f;
        sum += (double)rows->weight[i];
    }
    return sum;
}
