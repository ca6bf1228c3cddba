/* Likelihood of the first look's attitudes, and the small pictures that they are compared with: look/subspaces.py. */
#include <string.h>

#include "kernels.h"

/* Sums that run side by side, so that a compiler may use what adds several numbers at once. */
#define LANES 8

/* Quarter turns of a look. */
#define QUARTERS 4

typedef float lanes __attribute__((vector_size(4 * LANES)));

/* A bump of one, in steps. */
#define STEPS 65535.0f

/* Products of a row of bumps (n,) with four rows of coefficients (4, n), n a multiple of LANES. */
static void products(const uint16_t *restrict bumps, const float *restrict coefficients, int64_t n, float out[QUARTERS])
{
    const float *c0 = coefficients, *c1 = c0 + n, *c2 = c1 + n, *c3 = c2 + n;
    lanes a0 = {0}, a1 = {0}, a2 = {0}, a3 = {0};
    int64_t i;
    int k;

    for (i = 0; i < n; i += LANES) {
        lanes b, c;
        for (k = 0; k < LANES; k++)
            b[k] = (float)bumps[i + k];
        memcpy(&c, c0 + i, sizeof c);
        a0 += b * c;
        memcpy(&c, c1 + i, sizeof c);
        a1 += b * c;
        memcpy(&c, c2 + i, sizeof c);
        a2 += b * c;
        memcpy(&c, c3 + i, sizeof c);
        a3 += b * c;
    }
    for (k = 0; k < QUARTERS; k++)
        out[k] = 0.0f;
    for (k = 0; k < LANES; k++) {
        out[0] += a0[k];
        out[1] += a1[k];
        out[2] += a2[k];
        out[3] += a3[k];
    }
}

/* look/subspaces.py's Subspaces.likelihood: into out (V * turns,).
 *
 * bumps : (V * turns, n) in steps of 1 / 65535. coefficients : (4, n) of looks turned by quarters, n a multiple of 8,
 * turns of four.
 */
void fly_likelihood(const uint16_t *bumps, const float *coefficients, int64_t views, int64_t turns, int64_t n,
                    float *out)
{
    int64_t v, turn;
    int k;

    for (v = 0; v < views * turns; v++)
        out[v] = 0.0f;
    for (v = 0; v < views; v++)
        for (turn = 0; turn < turns; turn++) {
            float each[QUARTERS];
            products(bumps + (v * turns + turn) * n, coefficients, n, each);
            /* a look turned by a quarter sees another turn of the same direction */
            for (k = 0; k < QUARTERS; k++)
                out[v * turns + (turn + k * turns / QUARTERS) % turns] += each[k] * (1.0f / (QUARTERS * STEPS));
        }
}
