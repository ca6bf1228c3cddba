/* One Gauss-Newton step's normal equations: photometric.py (photo_step, projected). */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cover.h"

/* Pixels whose products are summed in single precision, and what is summed side by side. */
#define BLOCK 512

/* Sums of products: of the six of the pose and the residual, of each brightness with these, of two brightnesses, of
 * which the first has the larger number.
 */
struct sums {
    float own[WIDE][WIDE], mixed[MOST][WIDE], levels[MOST][MOST + 1];
};

/* Products of the weighted rows from one to before another. Single numbers that a wide load would wait for are not
 * stored beside each other.
 */
static void add_rows(const struct rows *rows, const struct cover *c, int64_t from, int64_t to, struct sums *sum)
{
    static const float pose[WIDE] = {1, 1, 1, 1, 1, 1, 0, 0}, left[WIDE] = {0, 0, 0, 0, 0, 0, 1, 0};
    float own[7][WIDE] = {{0}}, share[MOST];
    int32_t slot[MOST], s;
    int64_t i;
    int j, k, m;

    for (i = from; i < to; i++) {
        const float *d = rows->d + WIDE * i, root = sqrtf(rows->weight[i]), scaled = root * rows->slope[i];
        float z[WIDE];
        if (!(rows->weight[i] > 0))
            continue;
        for (j = 0; j < WIDE; j++)
            z[j] = d[j] * (pose[j] * scaled + left[j] * root);
        for (k = 0; k < 7; k++) {
            const float one = d[k] * (k < 6 ? scaled : root);
            for (j = 0; j < WIDE; j++)
                own[k][j] += one * z[j];
        }
        for (s = c->last[i], k = 0; s >= 0; s = c->share[s].before, k++) {
            const float one = c->share[s].value * scaled;
            const int32_t at = c->share[s].slot;
            share[k] = one;
            slot[k] = at;
            for (j = 0; j < WIDE; j++)
                sum->mixed[at][j] += one * z[j];
            for (m = 0; m <= k; m++)
                sum->levels[slot[m]][at] += share[m] * one;
        }
    }
    memcpy(sum->own, own, sizeof own);
}

/* Products G (n + 7, n + 7) of the weighted rows: brightnesses, pose, residual; sum is scratch. */
static void products(const struct rows *rows, const struct cover *c, int64_t n, struct sums *sum, double *G)
{
    const int64_t side = n + 7;
    int64_t i, j, start;

    memset(G, 0, (size_t)(side * side) * sizeof *G);
    for (start = 0; start < rows->n; start += BLOCK) {
        const int64_t end = start + BLOCK < rows->n ? start + BLOCK : rows->n;
        memset(sum, 0, sizeof *sum);
        add_rows(rows, c, start, end, sum);
        for (i = 0; i < n; i++) {
            for (j = 0; j <= i; j++)
                G[i * side + j] += (double)sum->levels[i][j];
            for (j = 0; j < 7; j++)
                G[(n + j) * side + i] += (double)sum->mixed[i][j];
        }
        for (i = 0; i < 7; i++)
            for (j = 0; j <= i; j++)
                G[(n + i) * side + n + j] += (double)sum->own[i][j];
    }
    for (i = 0; i < side; i++)
        for (j = i + 1; j < side; j++)
            G[i * side + j] = G[j * side + i];
}

/* Memory of a step, freed whole. */
struct memory {
    struct rows rows;
    struct cover cover;
    struct sums *sums;
    float *shown, *slope, *drawn, *sample;
    void *block;
};

static int laid_out(int64_t h, int64_t w, struct memory *m)
{
    /* whole lines of each */
    const size_t n = ((size_t)(h * w) + WIDE - 1) / WIDE * WIDE, floats = (WIDE + 3 + 3 + 4) * n + 2 * WIDE;
    const size_t sums = sizeof(struct sums);
    uint8_t *block = malloc(floats * sizeof(float) + sums + n);
    float *at;

    m->block = block;
    m->cover.share = NULL;
    m->cover.n = m->rows.n = 0;
    if (block == NULL)
        return -1;
    m->rows.d = at = fly_aligned((float *)(void *)block);
    m->rows.slope = at += WIDE * n;
    m->rows.edge = at += n;
    m->rows.weight = at += n;
    m->rows.x = (int32_t *)(void *)(at += n);
    m->cover.last = (int32_t *)(void *)(at += n);
    m->rows.first = (int32_t *)(void *)(at += n);
    m->shown = at += n + WIDE;
    m->slope = at += n;
    m->drawn = at += n;
    m->sample = at += n;
    m->sums = (struct sums *)(void *)(at + n);
    m->rows.craft = (uint8_t *)(m->sums + 1);
    return 0;
}

/* Normal matrix of a step's rows: brightnesses of groups, the six of the pose, and the residual.
 *
 * d's arrays : the craft drawn at the pose, m what moves it, centre (h, w) groups at middles, picture (h, w) drawn.
 * gray : (h, w) the picture through blur. optics : blur of the optics; both : it and blur together. noise : of gray
 * where it is blurred. slack, tukey : see fly_weigh_rows. most : groups whose brightness is found.
 * Out: G (n + 7, n + 7) with room for MOST + 7, and sum of the weights.
 * Returns n + 1000 times the rows that count, -1 where there is no memory.
 */
int64_t fly_step(const struct moving *m, const uint8_t *group, const uint8_t *centre, const float *picture,
                 const float *gray, int64_t h, int64_t w, int64_t f, const struct response *r,
                 const struct gauss *optics, const struct gauss *blur, const struct gauss *both, double noise,
                 double slack, double tukey, int64_t most, double *G, double *weights)
{
    const struct drawing d = {group, h, w, f};
    struct memory s;
    uint8_t chosen[MOST];
    int64_t out = -1, n, i, counts = 0;

    *weights = 0;
    if (h < 1 || w < 1 || f < 1) {
        memset(G, 0, 49 * sizeof *G);
        return 0;
    }
    if (laid_out(h, w, &s) != 0)
        return -1;
    const int flat = !(r->sigma > 0);
    struct look v = {s.drawn, flat ? NULL : s.sample, gray, centre, *both};
    if (fly_blur(picture, h, w, optics, s.drawn) != 0)
        goto end;
    fly_shown(r, s.drawn, h * w, s.shown, flat ? NULL : s.slope);
    if (fly_blur(s.shown, h, w, blur, s.drawn) != 0 || (!flat && fly_blur(s.slope, h, w, blur, s.sample) != 0))
        goto end;
    if (fly_pixels_moved(m, d, &v, &s.rows) != 0)
        goto end;
    *weights = fly_weigh_rows(&s.rows, noise, slack, tukey, s.shown);
    for (i = 0; i < s.rows.n; i++)
        counts += s.rows.weight[i] > 0;
    n = fly_choose(centre, h * w, most, chosen);
    if (fly_cover_rows(d, chosen, n, *both, &s.rows, &s.cover) != 0)
        goto end;
    products(&s.rows, &s.cover, n, s.sums, G);
    out = n + 1000 * counts;
end:
    free(s.cover.share);
    free(s.block);
    return out;
}
