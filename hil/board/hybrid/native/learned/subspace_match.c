/* How well each attitude explains a small picture with faces of any brightness: view_subspaces.py (_explained). */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "kernels.h"

#ifdef __AVX2__
#include <immintrin.h>
#endif

/* view_subspaces.py's SIDE_PX, SHIFTS_PX, SHAPES and the number of its SIZES. */
#define SIDE 24
#define SHIFTS 3
#define SHAPES 8
#define SIZES 3
#define WIDE (SIDE + SHIFTS - 1)
#define MOVES (SIZES * SHIFTS * SHIFTS)

/* Shapes whose sums run side by side; numbers of a shape, as of so many rows of the picture; those of the picture, with
 * what the last sums read beyond it; the largest of its numbers (network.py's LARGEST). */
#define TOGETHER 2
#define NUMBERS (SIDE * WIDE)
#define PICTURE (WIDE * WIDE + WIDE)
#define LARGEST 4095.0f

/* Numbers of a row that are worked on: WIDE and zeros, so that none is left over where eight are taken at once. */
#define ROW 32

/* The picture turned back at one size, without wide structures, in whole numbers; what one is worth. */
struct small {
    int16_t at[PICTURE];
    float worth;
};

/* Place between pixels, on the picture. */
static double on(double v, int64_t n)
{
    return v > 0.0 ? (v < (double)(n - 1) ? v : (double)(n - 1)) : 0.0;
}

/* The picture (n, n) turned and reduced by an affine map (size cosine, size sine about the middles). */
static void turned(const float *picture, int64_t n, double c, double s, float out[WIDE][ROW])
{
    const double to = 0.5 * (WIDE - 1), middle = 0.5 * (double)(n - 1) - 0.5;
    int x, y;

    for (y = 0; y < WIDE; y++)
        for (x = 0; x < WIDE; x++) {
            const double u = on(c * (x - to) - s * (y - to) + middle, n);
            const double v = on(s * (x - to) + c * (y - to) + middle, n);
            const int64_t i = (int64_t)u < n - 2 ? (int64_t)u : n - 2, j = (int64_t)v < n - 2 ? (int64_t)v : n - 2;
            const float a = (float)(u - (double)i), b = (float)(v - (double)j);
            const float *p = picture + j * n + i;
            out[y][x] = (1.0f - b) * ((1.0f - a) * p[0] + a * p[1]) + b * ((1.0f - a) * p[n] + a * p[n + 1]);
        }
}

/* Without what a blur leaves of it; wide (WIDE, WIDE) : the blur of one line, borders and all, beside is it with rows
 * and columns swapped. */
static void narrowed(float p[WIDE][ROW], const float *wide, float beside[WIDE][ROW])
{
    float down[WIDE][ROW];
    int x, y, k;

    for (y = 0; y < WIDE; y++) {
        float sum[ROW] = {0};
        for (k = 0; k < WIDE; k++)
            for (x = 0; x < ROW; x++)
                sum[x] += wide[y * WIDE + k] * p[k][x];
        memcpy(down[y], sum, sizeof sum);
    }
    for (y = 0; y < WIDE; y++) {
        float sum[ROW] = {0};
        for (k = 0; k < WIDE; k++)
            for (x = 0; x < ROW; x++)
                sum[x] += beside[k][x] * down[y][k];
        for (x = 0; x < ROW; x++)
            p[y][x] -= sum[x];
    }
}

/* The picture in whole numbers. */
static void whole(float p[WIDE][ROW], struct small *out)
{
    float most = 0.0f;
    int x, y;

    memset(out, 0, sizeof *out);
    for (y = 0; y < WIDE; y++)
        for (x = 0; x < WIDE; x++) {
            const float size = fabsf(p[y][x]);
            most = size > most ? size : most;
        }
    /* of what is no number, or of nothing, nothing is left */
    if (!(most > 1e-30f && most < 1e30f))
        return;
    out->worth = most / LARGEST;
    for (y = 0; y < WIDE; y++)
        for (x = 0; x < WIDE; x++) {
            float n = p[y][x] * (LARGEST / most);
            n = n < LARGEST ? (n > -LARGEST ? n : -LARGEST) : LARGEST;
            out->at[y * WIDE + x] = (int16_t)(n < 0.0f ? n - 0.5f : n + 0.5f);
        }
}

/* Sums over the window of TOGETHER shapes (NUMBERS,) times the picture from p on, shifted sideways by 0, 1 ... */
#ifdef __AVX2__
static inline __m256i sixteen(const int16_t *p)
{
    return _mm256_loadu_si256((const __m256i *)p);
}

static int32_t sum_of(__m256i v)
{
    __m128i a = _mm_add_epi32(_mm256_castsi256_si128(v), _mm256_extracti128_si256(v, 1));
    a = _mm_add_epi32(a, _mm_shuffle_epi32(a, 0x4e));
    return _mm_cvtsi128_si32(_mm_add_epi32(a, _mm_shuffle_epi32(a, 0xb1)));
}

static void beside(const int16_t *shapes, const int16_t *p, int32_t out[TOGETHER][SHIFTS])
{
    __m256i sum[TOGETHER][SHIFTS];
    int i, j, k;

    for (j = 0; j < TOGETHER; j++)
        for (k = 0; k < SHIFTS; k++)
            sum[j][k] = _mm256_setzero_si256();
    for (i = 0; i < NUMBERS; i += 16) {
        const __m256i a = sixteen(p + i), b = sixteen(p + i + 1), c = sixteen(p + i + 2);
        for (j = 0; j < TOGETHER; j++) {
            const __m256i shape = sixteen(shapes + j * NUMBERS + i);
            sum[j][0] = _mm256_add_epi32(sum[j][0], _mm256_madd_epi16(shape, a));
            sum[j][1] = _mm256_add_epi32(sum[j][1], _mm256_madd_epi16(shape, b));
            sum[j][2] = _mm256_add_epi32(sum[j][2], _mm256_madd_epi16(shape, c));
        }
    }
    for (j = 0; j < TOGETHER; j++)
        for (k = 0; k < SHIFTS; k++)
            out[j][k] = sum_of(sum[j][k]);
}
#else
static void beside(const int16_t *shapes, const int16_t *p, int32_t out[TOGETHER][SHIFTS])
{
    int i, j, k;

    for (j = 0; j < TOGETHER; j++)
        for (k = 0; k < SHIFTS; k++) {
            int32_t sum = 0;
            for (i = 0; i < NUMBERS; i++)
                sum += shapes[j * NUMBERS + i] * p[i + k];
            out[j][k] = sum;
        }
}
#endif

/* Energy of the picture in the window, whose square is the weight, at every shift. */
static void energies(const float *weight, const struct small *p, float out[SHIFTS * SHIFTS])
{
    float square[WIDE * WIDE];
    int x, y, i, k;

    for (i = 0; i < WIDE * WIDE; i++)
        square[i] = p->worth * p->at[i] * (p->worth * p->at[i]);
    for (k = 0; k < SHIFTS * SHIFTS; k++) {
        /* columns beside each other are summed apart */
        float sum[SIDE] = {0}, total = 0.0f;
        for (y = 0; y < SIDE; y++)
            for (x = 0; x < SIDE; x++)
                sum[x] += weight[y * SIDE + x] * square[(y + k / SHIFTS) * WIDE + x + k % SHIFTS];
        for (x = 0; x < SIDE; x++)
            total += sum[x];
        out[k] = total;
    }
}

/* Energy (MOVES,) of the picture that SHAPES shapes hold at every size and shift; worth (SHAPES,) of their numbers. */
static void held_by(const int16_t *shapes, const float *worth, const struct small *seen, float found[MOVES])
{
    int32_t one[TOGETHER][SHIFTS];
    int m, group, size, shift, j, k;

    for (m = 0; m < MOVES; m++)
        found[m] = 0.0f;
    for (group = 0; group < SHAPES; group += TOGETHER)
        for (size = 0; size < SIZES; size++)
            for (shift = 0; shift < SHIFTS; shift++) {
                float *f = found + (size * SHIFTS + shift) * SHIFTS;
                beside(shapes + group * NUMBERS, seen[size].at + shift * WIDE, one);
                for (j = 0; j < TOGETHER; j++)
                    for (k = 0; k < SHIFTS; k++) {
                        const float held = (float)one[j][k] * (worth[group + j] * seen[size].worth);
                        f[k] += held * held;
                    }
            }
}

void fly_subspace_match(const float *picture, int64_t side, const int64_t *view, const int64_t *turn, int64_t n,
                   const double *circle, const double *sizes, const float *wide, const int16_t *basis,
                   const float *worth, const float *weight, const double *taken_up, double *share, int64_t *move)
{
    struct small seen[SIZES];
    float energy[MOVES], found[MOVES], raw[WIDE][ROW] = {{0}}, beside_it[WIDE][ROW] = {{0}};
    int64_t i, now = -1;
    int k, m;

    for (k = 0; k < WIDE; k++)
        memcpy(beside_it[k], wide + WIDE * WIDE + k * WIDE, WIDE * sizeof **beside_it);
    for (i = 0; i < n; i++) {
        if (turn[i] != now) {
            now = turn[i];
            for (k = 0; k < SIZES; k++) {
                const double size = 2.0 * sizes[k];
                turned(picture, side, size * circle[2 * now], size * circle[2 * now + 1], raw);
                narrowed(raw, wide, beside_it);
                whole(raw, &seen[k]);
                energies(weight, &seen[k], energy + k * SHIFTS * SHIFTS);
            }
        }
        held_by(basis + view[i] * SHAPES * NUMBERS, worth + view[i] * SHAPES, seen, found);
        share[i] = -1.0;
        for (m = 0; m < MOVES; m++) {
            const double part = found[m] / (energy[m] + 1e-9f);
            double clear = (part - taken_up[view[i]]) / (1.0 - taken_up[view[i]]);
            clear = clear > 0.0 ? (clear < 0.99 ? clear : 0.99) : 0.0;
            if (clear > share[i]) {
                share[i] = clear;
                move[i] = m;
            }
        }
    }
}
