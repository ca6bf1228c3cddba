/* The convolutions of the learned proposal's network in whole numbers: network.py.
 *
 * Weights and what they are multiplied with are whole numbers of 16 bits, their sums of 32: twice as many at once as
 * of float, and the same on every machine in any order. What is lost is less than the weights' file leaves out.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "kernels.h"

#ifdef __AVX2__
#include <immintrin.h>
#endif

/* Channels and pixels whose sums are made together: what the registers hold. */
#define CHANNELS 16
#define PIXELS 6

/* Largest value that anything multiplied with a weight may have (network.py's LARGEST). */
#define LARGEST 4095.0f

/* One convolution: taps each way, stride, channels in and out, weights (out / CHANNELS, taps, taps channels / 2,
 * CHANNELS, 2), what a unit of each channel's sum is worth (out,), bias (out,); out padded to a multiple of CHANNELS.
 */
struct layer {
    int64_t taps, stride, in, out;
    const int16_t *weights;
    const float *worth, *bias;
};

/* Sums of PIXELS patches, whose rows begin at at[] and are row numbers apart, with the weights of CHANNELS. */
#ifdef __AVX2__
static void sums(const int16_t *const at[PIXELS], int64_t row, int64_t taps, int64_t pairs, const int16_t *w,
                 int32_t out[PIXELS][CHANNELS])
{
    __m256i sum[PIXELS][2];
    int64_t y, i;
    int j;

    for (j = 0; j < PIXELS; j++)
        sum[j][0] = sum[j][1] = _mm256_setzero_si256();
    for (y = 0; y < taps; y++)
        for (i = 0; i < pairs; i++, w += 2 * CHANNELS) {
            const __m256i w0 = _mm256_loadu_si256((const __m256i *)w);
            const __m256i w1 = _mm256_loadu_si256((const __m256i *)(w + CHANNELS));
            for (j = 0; j < PIXELS; j++) {
                int32_t two;
                __m256i a;
                memcpy(&two, at[j] + y * row + 2 * i, sizeof two);
                a = _mm256_set1_epi32(two);
                sum[j][0] = _mm256_add_epi32(sum[j][0], _mm256_madd_epi16(a, w0));
                sum[j][1] = _mm256_add_epi32(sum[j][1], _mm256_madd_epi16(a, w1));
            }
        }
    for (j = 0; j < PIXELS; j++) {
        _mm256_storeu_si256((__m256i *)out[j], sum[j][0]);
        _mm256_storeu_si256((__m256i *)(out[j] + CHANNELS / 2), sum[j][1]);
    }
}
#else
static void sums(const int16_t *const at[PIXELS], int64_t row, int64_t taps, int64_t pairs, const int16_t *w,
                 int32_t out[PIXELS][CHANNELS])
{
    int64_t y, i;
    int j, d;

    memset(out, 0, PIXELS * sizeof *out);
    for (y = 0; y < taps; y++)
        for (i = 0; i < pairs; i++, w += 2 * CHANNELS)
            for (j = 0; j < PIXELS; j++) {
                const int16_t *two = at[j] + y * row + 2 * i;
                for (d = 0; d < CHANNELS; d++)
                    out[j][d] += two[0] * w[2 * d] + two[1] * w[2 * d + 1];
            }
}
#endif

/* A picture x (side, side, c) in whole numbers within zeros, (side + taps, side + taps, c); what one is worth. */
static float whole(const float *x, int64_t side, int64_t c, const struct layer *l, int16_t *out)
{
    const int64_t before = l->stride > 1 ? (l->taps - l->stride) / 2 : l->taps / 2, wide = (side + l->taps) * c;
    int32_t bits = 0;
    float most, scale;
    int64_t i, y;

    /* sizes of floats are in the order of their bits, taken as whole numbers */
    for (i = 0; i < side * side * c; i++) {
        int32_t size;
        memcpy(&size, x + i, sizeof size);
        size &= 0x7fffffff;
        bits = size > bits ? size : bits;
    }
    memcpy(&most, &bits, sizeof most);
    /* what is no number is nothing, and neither is infinity */
    if (!(most > 1e-30f && most < 1e30f))
        most = 0.0f;
    scale = most > 0.0f ? LARGEST / most : 0.0f;
    memset(out, 0, (size_t)((side + l->taps) * wide) * sizeof *out);
    for (y = 0; y < side; y++) {
        int16_t *row = out + (y + before) * wide + before * c;
        const float *from = x + y * side * c;
        if (most > 0.0f)
            for (i = 0; i < side * c; i++) {
                float v = from[i] * scale;
                v = v < LARGEST ? (v > -LARGEST ? v : -LARGEST) : LARGEST;
                row[i] = (int16_t)(v < 0.0f ? v - 0.5f : v + 0.5f);
            }
    }
    return most / LARGEST;
}

/* out (n,) = sums in units of worth, with bias, and no less than zero; n is CHANNELS at most. */
static inline void shown(const int32_t *restrict sum, const float *restrict worth, float unit,
                         const float *restrict bias, int64_t n, float *restrict out)
{
    int64_t d;

    for (d = 0; d < n; d++) {
        const float v = (float)sum[d] * (unit * worth[d]) + bias[d];
        out[d] = v > 0.0f ? v : 0.0f;
    }
}

/* A convolution of in (side, side, l->in) with bias, and no less than zero, into out (side / stride, same, l->out). */
static void convolve(const struct layer *l, const float *in, int64_t side, int16_t *numbers, float *out)
{
    const int64_t rows = side / l->stride, pixels = rows * rows, row = (side + l->taps) * l->in;
    const int64_t pairs = l->taps * l->in / 2;
    const float unit = whole(in, side, l->in, l, numbers);
    int32_t sum[PIXELS][CHANNELS];
    const int16_t *at[PIXELS];
    int64_t first, channel, j;

    for (first = 0; first < pixels; first += PIXELS) {
        const int64_t some = pixels - first < PIXELS ? pixels - first : PIXELS;
        for (j = 0; j < PIXELS; j++) {
            const int64_t p = first + (j < some ? j : some - 1);
            at[j] = numbers + l->stride * (p / rows * row + p % rows * l->in);
        }
        for (channel = 0; channel < l->out; channel += CHANNELS) {
            const float *worth = l->worth + channel, *bias = l->bias + channel;
            float *o = out + first * l->out + channel;
            sums(at, row, l->taps, pairs, l->weights + channel * l->taps * pairs * 2, sum);
            for (j = 0; j < some; j++, o += l->out)
                if (channel + CHANNELS <= l->out)
                    shown(sum[j], worth, unit, bias, CHANNELS, o);
                else
                    shown(sum[j], worth, unit, bias, l->out - channel, o);
        }
    }
}

int64_t fly_convolutions(const float *looks, int64_t count, int64_t side, const int64_t *shape, int64_t layers,
                         const int16_t *weights, const float *worth, const float *bias, float *out)
{
    int64_t most = side * side * shape[2], padded = 0, last = 0, b, k, now = side;
    float *x, *y;
    int16_t *numbers;

    for (k = 0; k < layers; k++) {
        const int64_t taps = shape[4 * k], wide = (now + taps) * (now + taps) * shape[4 * k + 2];
        padded = wide > padded ? wide : padded;
        now /= shape[4 * k + 1];
        last = now * now * shape[4 * k + 3];
        most = last > most ? last : most;
    }
    x = malloc((size_t)(2 * most) * sizeof *x);
    numbers = malloc((size_t)padded * sizeof *numbers);
    for (b = 0; b < count && x != NULL && numbers != NULL; b++) {
        int64_t w = 0, d = 0, s = side;
        const float *in = looks + b * side * side * shape[2];
        y = x;
        for (k = 0; k < layers; k++) {
            const int64_t *n = shape + 4 * k;
            const struct layer l = {n[0], n[1], n[2], n[3], weights + w, worth + d, bias + d};
            float *into = k + 1 < layers ? y : out + b * last;
            convolve(&l, in, s, numbers, into);
            s /= l.stride;
            w += (l.out + CHANNELS - 1) / CHANNELS * CHANNELS * l.taps * l.taps * l.in;
            d += l.out;
            in = into;
            y = y == x ? x + most : x;
        }
    }
    b = x == NULL || numbers == NULL ? -1 : 0;
    free(x);
    free(numbers);
    return b;
}
