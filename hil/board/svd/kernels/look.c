/* Likelihood of the first look's attitudes: look/subspaces.py (likelihoods). */
#include <stdlib.h>
#include <string.h>

#include "kernels.h"

/* Sums that run side by side, so that a compiler may use what adds several numbers at once. */
#define LANES 8

/* Quarter turns of a look, and harmonics of a bump's value as a function of the turn (attitudes.py, POWER / 2). */
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
 */
static void waves(const float *size, const float *cosine, const float *sine, const float *said, int64_t n,
                  struct wave out[HARMONICS + 1])
{
    lanes re[HARMONICS + 1] = {{0}}, im[HARMONICS + 1] = {{0}};
    int64_t i;
    int m;

    for (i = 0; i < n; i += LANES) {
        const lanes c = taken(cosine + i), s = taken(sine + i);
        const lanes even[2] = {taken(said + i), taken(said + n + i)};
        const lanes a = taken(said + 2 * n + i), b = taken(said + 3 * n + i);
        /* size exp(-i m angle) */
        lanes x = taken(size + i), y = {0}, turned;
        re[0] += x * even[0];
#pragma GCC unroll 10
        for (m = 1; m <= HARMONICS; m++) {
            turned = x * c + y * s;
            y = y * c - x * s;
            x = turned;
            if (m % 2 == 0) {
                re[m] += x * even[m / 2 % 2];
                im[m] += y * even[m / 2 % 2];
            } else if (m % 4 == 1) {
                re[m] += x * a + y * b;
                im[m] += y * a - x * b;
            } else {
                re[m] += x * a - y * b;
                im[m] += y * a + x * b;
            }
        }
    }
    for (m = 0; m <= HARMONICS; m++) {
        out[m].re = sum_of(re[m]);
        out[m].im = sum_of(im[m]);
    }
}

/* look/subspaces.py's Subspaces.likelihoods of one place: into out (views, turns).
 *
 * bumps : (3, views, n) size, cosine and sine. said : as above, n a multiple of eight. harmonics : (HARMONICS + 1,)
 * of a bump. circle : (turns, 2) cosine and sine of a turn.
 */
void fly_likelihood(const float *bumps, const float *said, const float *harmonics, const float *circle, int64_t views,
                    int64_t turns, int64_t n, float *out)
{
    int64_t v, turn;
    int m;

    for (v = 0; v < views; v++) {
        const float *own = bumps + v * n;
        struct wave w[HARMONICS + 1];
        waves(own, own + views * n, own + 2 * views * n, said, n, w);
        for (m = 0; m <= HARMONICS; m++) {
            w[m].re *= harmonics[m];
            w[m].im *= harmonics[m];
        }
        for (turn = 0; turn < turns; turn++) {
            /* real part of the sum over m of wave times exp(i m turn) */
            float sum = w[0].re;
            for (m = 1; m <= HARMONICS; m++) {
                const float *at = circle + 2 * (m * turn % turns);
                sum += w[m].re * at[0] - w[m].im * at[1];
            }
            out[v * turns + turn] = sum;
        }
    }
}
