/* One Gauss-Newton step's normal equations: photometric.py (photo_step, projected). */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "photometric/coverage.h"

/* Pixels that a shift by a pixel of the patch changes by less, in units of the noise, are left out
 * (photometric.py, TELLS).
 */
#define TELLS 0.02

/* Pixels whose products are summed in single precision, and what is summed side by side. */
#define BLOCK 2048

/* Sums of products: of the six of the pose and the residual, of each brightness with these, of two brightnesses, of
 * which the first has the larger number.
 */
struct sums {
    lanes own[7], mixed[MOST];
    float levels[MOST][MOST + 1];
};

/* Products of the weighted rows from one to before another. */
static void add_rows(const struct rows *rows, const struct group_coverage *c, int64_t from, int64_t to,
                     struct sums *sum)
{
    const lanes pose = {1, 1, 1, 1, 1, 1, 0, 0}, left = {0, 0, 0, 0, 0, 0, 1, 0};
    lanes own[7] = {{0}};
    int64_t i;
    int k, m;

    for (i = from; i < to; i++) {
        const float root = sqrtf(rows->weight[i]), scaled = root * rows->slope[i];
        const struct share *share = c->share + c->first[i];
        const int shares = (int)(c->first[i + 1] - c->first[i]);
        float part[MOST];
        union { lanes all; float one[WIDE]; } z;
        if (!(rows->weight[i] > 0))
            continue;
        z.all = *(const lanes *)(const void *)(rows->d + WIDE * i) * (pose * scaled + left * root);
        for (k = 0; k < 7; k++)
            own[k] += z.one[k] * z.all;
        for (k = 0; k < shares; k++) {
            const int32_t at = share[k].slot;
            const float one = share[k].value * scaled;
            float *levels = sum->levels[at];
            part[k] = one;
            sum->mixed[at] += one * z.all;
            for (m = 0; m <= k; m++)
                levels[share[m].slot] += part[m] * one;
        }
    }
    memcpy(sum->own, own, sizeof own);
}

/* Products G (n + 7, n + 7) of the weighted rows: brightnesses, pose, residual; sum is scratch. */
static void products(const struct rows *rows, const struct group_coverage *c, int64_t n, struct sums *sum, double *G)
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
    struct group_coverage cover;
    struct sums *sums;
    float *shown, *slope, *drawn, *sample;
    void *block;
};

static int laid_out(int64_t h, int64_t w, struct memory *m)
{
    /* whole lines of each */
    const size_t n = ((size_t)(h * w) + WIDE - 1) / WIDE * WIDE, floats = (WIDE + 3 + 3 + 4) * n + 3 * WIDE;
    const size_t sums = sizeof(struct sums);
    uint8_t *block = malloc(floats * sizeof(float) + sums + n);
    float *at;

    m->block = block;
    m->cover.share = NULL;
    m->rows.n = 0;
    if (block == NULL)
        return -1;
    m->rows.d = at = fly_aligned((float *)(void *)block);
    m->rows.slope = at += WIDE * n;
    m->rows.edge = at += n;
    m->rows.weight = at += n;
    m->rows.x = (int32_t *)(void *)(at += n);
    m->cover.first = (int32_t *)(void *)(at += n);
    m->rows.first = (int32_t *)(void *)(at += n + WIDE);
    m->shown = at += n + WIDE;
    m->slope = at += n;
    m->drawn = at += n;
    m->sample = at += n;
    m->sums = (struct sums *)(void *)(at + n);
    m->rows.craft = (uint8_t *)(m->sums + 1);
    return 0;
}

int64_t fly_normal_equations(const struct pose_motion *m, const uint8_t *group, const uint8_t *centre,
                             const float *picture,
                 const float *gray, int64_t h, int64_t w, int64_t f, const struct response *r,
                 const struct gaussian *optics, const struct gaussian *blur, const struct gaussian *both, double noise,
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
    const double least = TELLS * noise / (fabs(m->t[2]) * (double)f);
    struct residual_images v = {s.drawn, flat ? NULL : s.sample, gray, centre, *both, (float)(least / m->step_u),
        (float)(least / m->step_v)};
    if (fly_blur(picture, h, w, optics, s.drawn) != 0)
        goto end;
    fly_response(r, s.drawn, h * w, s.shown, flat ? NULL : s.slope);
    if (fly_blur(s.shown, h, w, blur, s.drawn) != 0 || (!flat && fly_blur(s.slope, h, w, blur, s.sample) != 0))
        goto end;
    if (fly_residual_rows(m, d, &v, &s.rows) != 0)
        goto end;
    *weights = fly_robust_weights(&s.rows, noise, slack, tukey, s.shown);
    for (i = 0; i < s.rows.n; i++)
        counts += s.rows.weight[i] > 0;
    n = fly_choose_groups(centre, h * w, most, chosen);
    if (fly_coverage_rows(d, chosen, n, *both, &s.rows, &s.cover) != 0)
        goto end;
    products(&s.rows, &s.cover, n, s.sums, G);
    out = n + 1000 * counts;
end:
    free(s.cover.share);
    free(s.block);
    return out;
}
