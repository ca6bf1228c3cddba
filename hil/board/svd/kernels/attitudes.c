/* How well each attitude explains a small picture with faces of any brightness: look/subspaces.py (_explained). */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "kernels.h"

/* subspaces.py's SIDE_PX, SHIFTS_PX, SHAPES and the number of its SIZES. */
#define SIDE 24
#define SHIFTS 3
#define SHAPES 8
#define SIZES 3
#define WIDE (SIDE + SHIFTS - 1)
#define MOVES (SIZES * SHIFTS * SHIFTS)

#define LANES 8

/* Shapes whose sums run side by side. */
#define TOGETHER 4

typedef float lanes __attribute__((vector_size(4 * LANES)));

/* The picture turned back at one size, without wide structures; rows end in zeros that nothing is multiplied with. */
struct small {
    float at[WIDE][WIDE + LANES];
};

static float sum_of(lanes a)
{
    float sum = 0.0f;
    int k;

    for (k = 0; k < LANES; k++)
        sum += a[k];
    return sum;
}

static lanes taken(const float *p)
{
    lanes a;
    memcpy(&a, p, sizeof a);
    return a;
}

/* Place between pixels, on the picture. */
static double on(double v, int64_t n)
{
    return v > 0.0 ? (v < (double)(n - 1) ? v : (double)(n - 1)) : 0.0;
}

/* The picture (n, n) turned and reduced by an affine map (size cosine, size sine about the middles). */
static void turned(const float *picture, int64_t n, double c, double s, float out[WIDE][WIDE])
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

/* Without what a blur leaves of it; wide (WIDE, WIDE) : the blur of one line, borders and all. */
static void narrowed(float p[WIDE][WIDE], const float *wide, struct small *out)
{
    float down[WIDE][WIDE];
    int x, y, k;

    memset(out, 0, sizeof *out);
    memset(down, 0, sizeof down);
    for (y = 0; y < WIDE; y++)
        for (k = 0; k < WIDE; k++)
            for (x = 0; x < WIDE; x++)
                down[y][x] += wide[y * WIDE + k] * p[k][x];
    /* the blur is the same both ways, and symmetric but for the borders: its columns are taken as rows */
    for (y = 0; y < WIDE; y++) {
        float *row = out->at[y];
        for (k = 0; k < WIDE; k++)
            for (x = 0; x < WIDE; x++)
                row[x] -= wide[WIDE * WIDE + k * WIDE + x] * down[y][k];
        for (x = 0; x < WIDE; x++)
            row[x] += p[y][x];
    }
}

/* Sums over the window (SIDE, SIDE) of TOGETHER shapes times the picture, shifted sideways by 0, 1 ... : few enough
 * that all sums and what they are made of stay in registers. p : where the picture's window begins.
 */
static void beside(const float *shapes, const float *p, float out[TOGETHER][SHIFTS])
{
    lanes sum[TOGETHER][SHIFTS] = {{{0}}};
    int x, y, j, k;

    for (y = 0; y < SIDE; y++, p += WIDE + LANES, shapes += SIDE)
        for (x = 0; x < SIDE; x += LANES) {
            const lanes a = taken(p + x), b = taken(p + x + 1), c = taken(p + x + 2);
            for (j = 0; j < TOGETHER; j++) {
                const lanes shape = taken(shapes + j * SIDE * SIDE + x);
                sum[j][0] += shape * a;
                sum[j][1] += shape * b;
                sum[j][2] += shape * c;
            }
        }
    for (j = 0; j < TOGETHER; j++)
        for (k = 0; k < SHIFTS; k++)
            out[j][k] = sum_of(sum[j][k]);
}

/* Energy of the picture in the window at every shift. */
static void energies(const float *weight, const struct small *p, float out[SHIFTS * SHIFTS])
{
    int x, y, k;

    for (k = 0; k < SHIFTS * SHIFTS; k++) {
        lanes sum = {0};
        for (y = 0; y < SIDE; y++)
            for (x = 0; x < SIDE; x += LANES) {
                const lanes a = taken(&p->at[y + k / SHIFTS][x + k % SHIFTS]);
                sum += taken(weight + y * SIDE + x) * (a * a);
            }
        out[k] = sum_of(sum);
    }
}

/* Energy (MOVES,) of the picture that SHAPES shapes hold at every size and shift. */
static void held_by(const float *shapes, const struct small *seen, float found[MOVES])
{
    float one[TOGETHER][SHIFTS];
    int m, group, size, shift, j, k;

    for (m = 0; m < MOVES; m++)
        found[m] = 0.0f;
    for (group = 0; group < SHAPES; group += TOGETHER)
        for (size = 0; size < SIZES; size++)
            for (shift = 0; shift < SHIFTS; shift++) {
                float *f = found + (size * SHIFTS + shift) * SHIFTS;
                beside(shapes + group * SIDE * SIDE, seen[size].at[shift], one);
                for (j = 0; j < TOGETHER; j++)
                    for (k = 0; k < SHIFTS; k++)
                        f[k] += one[j][k] * one[j][k];
            }
}

/* Share (n,) of the picture that each of n attitudes explains where it does best, and which move (n,) that is.
 *
 * picture : (side, side), side at least two. view, turn : (n,) of the attitudes, those of one turn together. circle :
 * (turns, 2) cosine and sine of each. sizes : (SIZES,). wide : (2, WIDE, WIDE) a blur, and it with rows and columns
 * swapped. basis : (views, SHAPES, SIDE, SIDE) times the window. weight : (SIDE, SIDE) the window's square. taken_up :
 * (views,) share that as many shapes explain of noise.
 */
void fly_attitudes(const float *picture, int64_t side, const int64_t *view, const int64_t *turn, int64_t n,
                   const double *circle, const double *sizes, const float *wide, const float *basis,
                   const float *weight, const double *taken_up, double *share, int64_t *move)
{
    struct small seen[SIZES];
    float energy[MOVES], found[MOVES], raw[WIDE][WIDE];
    int64_t i, now = -1;
    int k, m;

    for (i = 0; i < n; i++) {
        if (turn[i] != now) {
            now = turn[i];
            for (k = 0; k < SIZES; k++) {
                const double size = 2.0 * sizes[k];
                turned(picture, side, size * circle[2 * now], size * circle[2 * now + 1], raw);
                narrowed(raw, wide, &seen[k]);
                energies(weight, &seen[k], energy + k * SHIFTS * SHIFTS);
            }
        }
        held_by(basis + view[i] * SHAPES * SIDE * SIDE, seen, found);
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
