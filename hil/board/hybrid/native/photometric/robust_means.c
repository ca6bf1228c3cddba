/* Mean brightness of each group of faces: see robust_means.h. */
#include <math.h>
#include <string.h>

#include "photometric/robust_means.h"

/* Kinds of pixels: well inside, beside a border, elsewhere; and what each counts (face_gains.py, _levels). */
#define KINDS 3
static const double TRUST[KINDS] = {1.051, 0.051, 0.001};

/* Deviations from a mean beyond which a pixel is left out (face_gains.py, _levels). */
#define FAR 2.5

/* Values of one group and kind, side by side. */
struct stretch {
    const float *value;
    int64_t n;
};

/* Sums side by side: one after the other each waits for the last. */
#define SIDES 4

typedef double doubles __attribute__((vector_size(8 * SIDES)));
typedef int64_t wholes __attribute__((vector_size(8 * SIDES)));

static inline double sum_of(doubles a) { return (a[0] + a[1]) + (a[2] + a[3]); }

/* Four values from the i-th on; beyond the end they are beside. */
static inline doubles values(struct stretch s, int64_t i, float beside)
{
    float v[SIDES] = {beside, beside, beside, beside};

    if (i + SIDES <= s.n)
        memcpy(v, s.value + i, sizeof v);
    else
        memcpy(v, s.value + i, (size_t)(s.n - i) * sizeof *v);
    return (doubles){(double)v[0], (double)v[1], (double)v[2], (double)v[3]};
}

static double total(struct stretch s)
{
    doubles sum = {0};
    int64_t i;

    for (i = 0; i < s.n; i += SIDES)
        sum += values(s, i, 0.0f);
    return sum_of(sum);
}

/* Number and sum of values nearer to a mean than a bound, and the sum of their distances from another mean. */
struct kept {
    double number, sum, away;
};

static struct kept near(struct stretch s, double mean, double bound, double other)
{
    const doubles one = {1.0, 1.0, 1.0, 1.0};
    const wholes size = (wholes){0} + INT64_MAX;
    doubles number = {0}, sum = {0}, away = {0};
    int64_t i;

    for (i = 0; i < s.n; i += SIDES) {
        const doubles v = values(s, i, INFINITY);
        const wholes in = (doubles)((wholes)(v - mean) & size) < bound;
        number += (doubles)((wholes)one & in);
        sum += (doubles)((wholes)v & in);
        away += (doubles)((wholes)(v - other) & size & in);
    }
    return (struct kept){sum_of(number), sum_of(sum), sum_of(away)};
}

/* The same over all kinds of one group, each by its trust. */
static struct kept near_all(const struct stretch *s, double mean, double bound, double other)
{
    struct kept out = {0, 0, 0};
    int k;

    for (k = 0; k < KINDS; k++) {
        const struct kept part = near(s[k], mean, bound, other);
        out.number += TRUST[k] * part.number;
        out.sum += TRUST[k] * part.sum;
        out.away += TRUST[k] * part.away;
    }
    return out;
}

static double at_least(double a, double least) { return a > least ? a : least; }

/* Mean of one group's values without what lies far off it, trimmed twice. */
static double mean_of(const struct stretch *s, double sigma)
{
    double weight = 0, sum = 0;
    int k;

    for (k = 0; k < KINDS; k++) {
        weight += TRUST[k] * (double)s[k].n;
        sum += TRUST[k] * total(s[k]);
    }
    weight = at_least(weight, 1e-9);
    const double first = sum / weight;
    const double wide = FAR * near_all(s, first, INFINITY, first).away / weight + sigma;
    struct kept some = near_all(s, first, wide, first);
    const double second = some.sum / at_least(some.number, 1e-9);
    some = near_all(s, first, wide, second);
    const double narrow = FAR * some.away / at_least(some.number, 1e-9) + sigma;
    some = near_all(s, second, narrow, second);
    return some.sum / at_least(some.number, 1e-9);
}

/* Pixels whose borders are found together. */
#define TOGETHER 512

/* Runs of pixels that count, at most one each; how many. */
static int64_t runs_of(const uint8_t *centre, const uint8_t *kind, int64_t pixels, struct run *run)
{
    uint8_t edge[TOGETHER];
    int64_t i, j, k, all = 0, n = 0;

    run[all++].start = 0;
    for (i = 1; i < pixels; i += TOGETHER) {
        const int64_t some = pixels - i < TOGETHER ? pixels - i : TOGETHER;
        const uint8_t *c = centre + i, *l = kind + i;
        for (j = 0; j < some; j++)
            edge[j] = (c[j] != c[j - 1]) | (l[j] != l[j - 1]);
        memset(edge + some, 0, (size_t)(TOGETHER - some));
        for (j = 0; j < some; j += 8) {
            uint64_t eight;
            memcpy(&eight, edge + j, 8);
            if (eight == 0)
                continue;
            /* what begins none is written over: nobody can tell beforehand which of them do */
            for (k = j; k < j + 8 && k < some; k++) {
                run[all].start = (int32_t)(i + k);
                all += edge[k];
            }
        }
    }
    for (i = 0; i < all; i++) {
        const int32_t start = run[i].start, end = i + 1 < all ? run[i + 1].start : (int32_t)pixels;
        const uint8_t c = centre[start], l = kind[start];
        run[n] = (struct run){start, end - start, KINDS * c + l};
        n += (c > 0) | (l < 2);
    }
    return n;
}

void fly_robust_means(const uint8_t *centre, const uint8_t *kind, const float *gray, int64_t pixels, int64_t groups,
               double sigma, double *level, int64_t *area, float *value, struct run *run)
{
    const int64_t runs = runs_of(centre, kind, pixels, run);
    int64_t first[KINDS * 256 + 1] = {0}, next[KINDS * 256];
    int64_t i, j, g;
    int k;

    /* sorted by group and kind: first how many there are, then each to its place */
    for (i = 0; i < runs; i++)
        first[run[i].key + 1] += run[i].n;
    for (g = 0; g < KINDS * 256; g++) {
        first[g + 1] += first[g];
        next[g] = first[g];
    }
    for (i = 0; i < runs; i++) {
        const float *from = gray + run[i].start;
        float *to = value + next[run[i].key];
        for (j = 0; j < run[i].n; j++)
            to[j] = from[j];
        next[run[i].key] += run[i].n;
    }
    for (g = 0; g < groups; g++) {
        struct stretch s[KINDS];
        for (k = 0; k < KINDS; k++) {
            const int64_t at = first[KINDS * g + k];
            s[k].value = value + at;
            s[k].n = first[KINDS * g + k + 1] - at;
        }
        area[g] = s[0].n;
        level[g] = s[0].n + s[1].n + s[2].n > 0 ? mean_of(s, sigma) : 0.0;
    }
}
