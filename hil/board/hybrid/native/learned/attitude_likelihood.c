/* Likelihood of the learned proposal's attitudes: view_subspaces.py (likelihoods). */
#include <stdlib.h>
#include <string.h>

#include "kernels.h"

/* Sums that run side by side, so that a compiler may use what adds several numbers at once. */
#define LANES 8

/* Quarter turns of a look, and harmonics of a bump's value as a function of the turn (attitude_basis.py, POWER / 2). */
#define QUARTERS 4
#define HARMONICS 10

typedef float lanes __attribute__((vector_size(4 * LANES)));

/* Real and imaginary parts of one harmonic. */
struct wave {
    float re, im;
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

/* Sums over the anchors (n,) of size exp(-i m angle) times what the four looks say, for each harmonic m.
 *
 * size, cosine, sine (n,) : of the bumps seen from one direction. said (4, n) : the sum of all looks, even ones less
 * odd ones, the first less the third, the second less the fourth. A quarter turn is a factor of -i to the power of m.
 * x, y (n,) are scratch.
 */
static void waves(const float *size, const float *cosine, const float *sine, const float *said, int64_t n,
                  float *x, float *y, struct wave out[HARMONICS + 1])
{
    lanes re = {0};
    int64_t i;
    int m;

    for (i = 0; i < n; i += LANES) {
        const lanes here = taken(size + i), none = {0};
        re += here * taken(said + i);
        memcpy(x + i, &here, sizeof here);
        memcpy(y + i, &none, sizeof none);
    }
    out[0].re = sum_of(re);
    out[0].im = 0.0f;
    /* an odd one and an even one at a time: all at once would leave the registers */
    for (m = 1; m < HARMONICS; m += 2) {
        const float *even = said + (m + 1) / 2 % 2 * n, sign = m % 4 == 1 ? 1.0f : -1.0f;
        lanes odd_re = {0}, odd_im = {0}, even_re = {0}, even_im = {0};
        for (i = 0; i < n; i += LANES) {
            const lanes c = taken(cosine + i), s = taken(sine + i), u = taken(x + i), v = taken(y + i);
            const lanes a = taken(said + 2 * n + i), b = sign * taken(said + 3 * n + i), e = taken(even + i);
            const lanes p = u * c + v * s, q = v * c - u * s, next = p * c + q * s, then = q * c - p * s;
            odd_re += p * a + q * b;
            odd_im += q * a - p * b;
            even_re += next * e;
            even_im += then * e;
            memcpy(x + i, &next, sizeof next);
            memcpy(y + i, &then, sizeof then);
        }
        out[m].re = sum_of(odd_re);
        out[m].im = sum_of(odd_im);
        out[m + 1].re = sum_of(even_re);
        out[m + 1].im = sum_of(even_im);
    }
}

int64_t fly_attitude_likelihood(const float *bumps, const float *said, const float *harmonics, const float *circle,
                       int64_t views, int64_t turns, int64_t n, float *out)
{
    float *x = malloc((size_t)(2 * n + 2 * (HARMONICS + 1) * turns) * sizeof *x), *c = x + 2 * n;
    float *s = c + (HARMONICS + 1) * turns;
    int64_t v, turn;
    int m;

    if (x == NULL)
        return -1;
    for (m = 0; m <= HARMONICS; m++)
        for (turn = 0; turn < turns; turn++) {
            c[m * turns + turn] = harmonics[m] * circle[2 * (m * turn % turns)];
            s[m * turns + turn] = harmonics[m] * circle[2 * (m * turn % turns) + 1];
        }
    for (v = 0; v < views; v++) {
        const float *own = bumps + v * n;
        float *restrict sum = out + v * turns;
        struct wave w[HARMONICS + 1];
        waves(own, own + views * n, own + 2 * views * n, said, n, x, x + n, w);
        for (turn = 0; turn < turns; turn++)
            sum[turn] = 0.0f;
        /* real part of wave times exp(i m turn) */
        for (m = 0; m <= HARMONICS; m++)
            for (turn = 0; turn < turns; turn++)
                sum[turn] += w[m].re * c[m * turns + turn] - w[m].im * s[m * turns + turn];
    }
    free(x);
    return 0;
}
