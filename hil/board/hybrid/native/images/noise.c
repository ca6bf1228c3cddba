/* Noise of a picture of bytes by Immerkaer's mask: noise.py (noise_sigma). */
#include <stdlib.h>
#include <string.h>

#include "kernels.h"

/* Values of the mask: from zero to four times twice the scale; and counts that run side by side, for many pixels beside
 * each other are the same. */
#define VALUES 2048
#define BESIDE 4

/* The mask's size (w - 2,) and the sum of nine pixels over a strip of three rows, at a. */
static void masked(const uint8_t *a, int64_t stride, int64_t w, int16_t *restrict down, uint16_t *restrict three,
                   uint16_t *restrict mask, uint16_t *restrict total)
{
    const uint8_t *restrict b = a + stride, *restrict c = b + stride;
    int64_t x;

    for (x = 0; x < w; x++) {
        down[x] = (int16_t)(a[x] - 2 * b[x] + c[x]);
        three[x] = (uint16_t)(a[x] + b[x] + c[x]);
    }
    for (x = 0; x < w - 2; x++) {
        const int16_t v = (int16_t)(down[x] - 2 * down[x + 1] + down[x + 2]);
        mask[x] = (uint16_t)(v < 0 ? -v : v);
        total[x] = (uint16_t)(three[x] + three[x + 1] + three[x + 2]);
    }
}

/* Median of values counted n times together: the mean of the two in the middle. */
static double median(const int64_t *count, int64_t n)
{
    int64_t below = 0, low = -1, v;

    for (v = 0; v < VALUES; v++) {
        below += count[v];
        if (low < 0 && below > (n - 1) / 2)
            low = v;
        if (below > n / 2)
            return 0.5 * (double)(low + v);
    }
    return 0.0;
}

int64_t fly_noise(const void *pixels, int64_t bytes, int64_t stride, int64_t h, int64_t w, int64_t step,
                  double full_scale, double *out)
{
    const uint8_t *image = pixels;
    const int64_t wide = w - 2, strips = (h - 3) / (3 * step) + 1, n = strips * wide;
    uint32_t some[BESIDE][VALUES] = {{0}};
    int64_t count[VALUES], k, i, inside = 0;
    uint16_t *mask = malloc((size_t)(2 * n + w) * sizeof *mask), *total = mask + n, *three = total + n;
    int16_t *down = malloc((size_t)w * sizeof *down);
    double low, high;

    (void)bytes;
    if (mask == NULL || down == NULL) {
        free(mask);
        free(down);
        return -1;
    }
    for (k = 0; k < strips; k++)
        masked(image + 3 * step * k * stride, stride, w, down, three, mask + k * wide, total + k * wide);
    for (i = 0; i < n; i++)
        some[i % BESIDE][mask[i]]++;
    for (k = 0; k < VALUES; k++)
        count[k] = (int64_t)some[0][k] + some[1][k] + some[2][k] + some[3][k];
    out[0] = median(count, n);
    low = 9 * (4 * (out[0] / 6.0 * 1.4826) + 0.02 * full_scale);
    high = 9 * 0.85 * full_scale;
    memset(count, 0, sizeof count);
    for (i = 0; i < n; i++)
        if ((double)total[i] > low && (double)total[i] < high) {
            count[mask[i]]++;
            inside++;
        }
    out[1] = (double)inside;
    out[2] = median(count, inside);
    free(mask);
    free(down);
    return 0;
}
