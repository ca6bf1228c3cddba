/* Where the Sun stands, by the shadows on the picture: shadow_map.py (ShadowMapTable.find). */
#include <stdlib.h>
#include <string.h>

#include "raster/shadow_map.h"

/* shadow_map.py's SPREAD and BOUND */
#define SPREAD 0.15
#define BOUND 4.0f

/* Numbers side by side: each rounds as it does alone. */
#define LINE 8
typedef float line __attribute__((vector_size(4 * LINE), aligned(4), may_alias));
typedef int32_t whole __attribute__((vector_size(4 * LINE), may_alias));

static int may(const struct sun_image *p, int64_t at)
{
    int64_t label = p->bytes == 1 ? ((const uint8_t *)p->centre)[at] : ((const uint16_t *)p->centre)[at];
    return label < p->labels && p->good[label];
}

/* Points on the craft, at most ``most`` of them. */
struct points {
    float *x, *y, *z, *value; /* target frame [m]; root of the light */
    int32_t *own;             /* group, numbered anew from 0 */
    int32_t *face;            /* and face, numbered anew */
    int32_t *faced;           /* (faces,) face of each new number */
    int64_t n, groups, faces;
};

/* The same group by group, each in whole lines of numbers: what fills a line weighs nothing. */
struct sorted {
    float *x, *y, *z, *value, *weight;
    float *over;    /* height of the Sun's picture above each */
    float *lit;     /* its weight where it lies in the light, else zero */
    int32_t *at;    /* its pixel in the Sun's picture */
    int32_t *face;
    int64_t *first; /* (groups + 1,) */
    uint8_t *facing; /* (faces,) whether it looks at the Sun */
};

static int rising(const void *a, const void *b)
{
    float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

/* New number of what had ``old``: the next one where it has none yet. */
static int32_t renumbered(int32_t *number, int64_t old, int64_t *count)
{
    if (number[old] < 0)
        number[old] = (int32_t)(*count)++;
    return number[old];
}

/* Points that are looked at, evenly of all that may be: ShadowMapTable.find.
 *
 * numbers : (groups + faces,) scratch. inside : (h * w,) scratch.
 */
static void gather(const struct faces *f, const struct sun_image *p, const struct view *view, const double *R,
                   const double *t, double dim, int64_t most, int32_t *numbers, int32_t *inside, struct points *out)
{
    int64_t n = 0, k, wide = p->w * p->fine;
    float least = least_inverse(t);
    double step;

    for (k = 0; k < p->h * p->w; k++) {
        inside[n] = (int32_t)k;
        n += may(p, k);
    }
    out->n = out->groups = out->faces = 0;
    for (k = 0; k < p->groups + f->faces; k++)
        numbers[k] = -1;
    step = n > most ? (double)(n - 1) / (double)(most > 1 ? most - 1 : 1) : 1.0;
    most = n < most ? n : most;
    for (k = 0; k < most; k++) {
        int64_t at = inside[k == most - 1 ? n - 1 : (int64_t)((double)k * step)];
        int64_t row = at / p->w, column = at - row * p->w;
        int64_t y = row * p->fine + p->fine / 2, x = column * p->fine + p->fine / 2;
        int32_t face = p->seen[y * wide + x] - 1;
        float inverse[3], u, v, near, depth;
        double X[3], Y[3];
        if (face < 0 || face >= f->faces || p->group[face] < 0 || p->group[face] >= p->groups)
            continue;
        inverse_depth(f, face, R, t, inverse);
        u = ray(x, view->across, view->x0, view->cx, view->fx);
        v = ray(y, view->down, view->y0, view->cy, view->fy);
        near = inverse[0] * u + inverse[1] * v + inverse[2];
        depth = 1.0f / (near > least ? near : least);
        X[0] = (double)(u * depth) - t[0];
        X[1] = (double)(v * depth) - t[1];
        X[2] = (double)depth - t[2];
        times_transposed(R, X, Y);
        out->x[out->n] = (float)Y[0];
        out->y[out->n] = (float)Y[1];
        out->z[out->n] = (float)Y[2];
        out->value[out->n] = sqrtf((p->gray[at] > p->darkest ? p->gray[at] - p->darkest : 0.0f) + (float)dim);
        out->face[out->n] = renumbered(numbers + p->groups, face, &out->faces);
        out->faced[out->face[out->n]] = face;
        out->own[out->n++] = renumbered(numbers, p->group[face], &out->groups);
    }
}

/* Points by group: memory to be freed, NULL where there is none. */
static void *sort(const struct points *p, struct sorted *s)
{
    const size_t n = (size_t)(p->n + LINE * p->groups), groups = (size_t)p->groups + 1;
    char *block = calloc(1, (9 * n + LINE) * sizeof(float) + groups * sizeof(int64_t) + (size_t)p->faces);
    float *at = (float *)(void *)block;
    int64_t i, g, next = 0;

    if (block == NULL)
        return NULL;
    float **const all[] = {&s->x, &s->y, &s->z, &s->value, &s->weight, &s->over, &s->lit};
    s->first = (int64_t *)(void *)block;
    at = (float *)(void *)(s->first + groups);
    for (i = 0; i < 7; i++, at += n)
        *all[i] = at;
    s->at = (int32_t *)(void *)at;
    s->face = s->at + n;
    s->facing = (uint8_t *)(s->face + n);
    for (i = 0; i < p->n; i++)
        s->first[p->own[i]]++;
    for (g = 0; g <= p->groups; g++) {
        const int64_t some = g < p->groups ? s->first[g] : 0;
        s->first[g] = next;
        next += (some + LINE - 1) / LINE * LINE;
    }
    for (i = 0; i < p->n; i++) {
        /* how many of the group are there already is kept where heights will be */
        int64_t k = s->first[p->own[i]] + (int64_t)s->over[p->own[i]]++;
        s->x[k] = p->x[i];
        s->y[k] = p->y[i];
        s->z[k] = p->z[i];
        s->value[k] = p->value[i];
        s->weight[k] = 1.0f;
        s->face[k] = p->face[i];
    }
    return block;
}

/* Which of the points lie in the light of direction d: ShadowMapTable._lit. */
static void light(const struct faces *f, const struct sun_table *table, int64_t d, const struct points *p,
                  const struct sorted *q)
{
    const double *e0 = table->frames + 3 * d, *e1 = table->frames + 3 * (table->directions + d);
    const double *s = table->frames + 3 * (2 * table->directions + d);
    float ax = (float)e0[0], ay = (float)e0[1], az = (float)e0[2];
    float bx = (float)e1[0], by = (float)e1[1], bz = (float)e1[2];
    float sx = (float)s[0], sy = (float)s[1], sz = (float)s[2];
    float x0 = (float)table->origin[2 * d], y0 = (float)table->origin[2 * d + 1], pitch = (float)table->pitch[d];
    float side = (float)table->side, most = (float)(SKIN + 2.0 * table->pitch[d]);
    const float *height = table->height + d * table->side * table->side;
    const float *restrict x = q->x, *restrict y = q->y, *restrict z = q->z;
    float *restrict over = q->over;
    int32_t *restrict at = q->at, wide = (int32_t)table->side;
    int64_t i, n = q->first[p->groups];

    for (i = 0; i < n; i++) {
        int32_t column = cell((ax * x[i] + ay * y[i] + az * z[i] - x0) / pitch, side);
        int32_t row = cell((bx * x[i] + by * y[i] + bz * z[i] - y0) / pitch, side);
        at[i] = row * wide + column;
        over[i] = -(sx * x[i] + sy * y[i] + sz * z[i]);
    }
    for (i = 0; i < p->faces; i++)
        q->facing[i] = dot(f->normals + 3 * p->faced[i], s) > GRAZING;
    for (i = 0; i < n; i++)
        q->lit[i] = (float)((height[at[i]] + over[i] < most) & q->facing[q->face[i]]) * q->weight[i];
}

static inline float sum_of(line a) { return ((a[0] + a[1]) + (a[2] + a[3])) + ((a[4] + a[5]) + (a[6] + a[7])); }

/* a where mask is set, b elsewhere. */
static inline line chosen(whole mask, line a, line b) { return (line)(((whole)a & mask) | ((whole)b & ~mask)); }

/* What two levels for each group leave of the values: shadow_map.py's _cost of one direction.
 *
 * all : (2, groups) number and sum of each group's values.
 */
static double cost(const struct points *p, const struct sorted *s, float lowest, float scale, const float *all)
{
    const line most = (line){0} + BOUND;
    double left = 0.0;
    int64_t i, g;

    for (g = 0; g < p->groups; g++) {
        const line *lit = (const line *)(const void *)(s->lit + s->first[g]);
        const line *value = (const line *)(const void *)(s->value + s->first[g]);
        const line *weight = (const line *)(const void *)(s->weight + s->first[g]);
        const int64_t lines = (s->first[g + 1] - s->first[g]) / LINE;
        line numbers = {0}, totals = {0}, part = {0};
        float number, total, bright, dark, mean;
        for (i = 0; i < lines; i++) {
            numbers += lit[i];
            totals += lit[i] * value[i];
        }
        number = sum_of(numbers);
        total = sum_of(totals);
        bright = total / (number > 1.0f ? number : 1.0f);
        dark = (all[p->groups + g] - total + lowest) / (all[g] - number + 1.0f);
        mean = all[p->groups + g] / all[g];
        /* a shadow brighter than the light is none */
        if (number > 0.0f && number < all[g] && bright < dark)
            bright = dark = mean;
        else
            bright = bright > lowest ? bright : lowest;
        for (i = 0; i < lines; i++) {
            const line away = (value[i] - chosen(lit[i] > 0.0f, (line){0} + bright, (line){0} + dark)) * scale;
            const line square = away * away;
            part += weight[i] * chosen(square < most, square, most);
            if (i % 64 == 63 || i == lines - 1) {
                left += (double)sum_of(part);
                part = (line){0};
            }
        }
    }
    return left / (double)p->n;
}

/* The value below which a tenth lies (numpy's linear quantile), and the deviation of all. */
static void spread(const struct points *p, float *scratch, float *lowest, float *scale)
{
    double sum = 0.0, squares = 0.0, place = 0.1 * (double)(p->n - 1), mean;
    int64_t i, below = (int64_t)place;

    memcpy(scratch, p->value, (size_t)p->n * sizeof *scratch);
    qsort(scratch, (size_t)p->n, sizeof *scratch, rising);
    *lowest = (float)(scratch[below] + (place - (double)below) * ((double)scratch[below + 1] - scratch[below]));
    for (i = 0; i < p->n; i++)
        sum += p->value[i];
    mean = sum / (double)p->n;
    for (i = 0; i < p->n; i++)
        squares += (p->value[i] - mean) * (p->value[i] - mean);
    *scale = (float)(1.0 / (SPREAD * sqrt(squares / (double)p->n) + 0.2));
}

int64_t fly_sun_costs(const struct faces *f, const struct sun_table *table, const struct sun_image *picture,
                      const struct view *view, const double *R, const double *t, double dim, int64_t most,
                      const int64_t *some, int64_t n, double *costs)
{
    /* one piece of memory: eight of ``most`` each, then the groups', faces' and pixels' */
    size_t each = (size_t)(most > 0 ? most : 0) + 1, groups = (size_t)picture->groups + 1, faces = (size_t)f->faces;
    size_t pixels = (size_t)(picture->h * picture->w) + 1;
    float *memory, *level, lowest, scale;
    struct points p;
    struct sorted s;
    void *block;
    int64_t i;

    if (picture->h < 1 || picture->w < 1 || most < 2)
        return 0;
    memory = malloc((8 * each + 3 * groups + faces + pixels) * sizeof *memory);
    if (memory == NULL)
        return -1;
    p.x = memory;
    p.y = memory + each;
    p.z = memory + 2 * each;
    p.value = memory + 3 * each;
    p.own = (int32_t *)(memory + 4 * each);
    p.face = (int32_t *)(memory + 5 * each);
    p.faced = (int32_t *)(memory + 6 * each);
    level = memory + 8 * each;
    gather(f, picture, view, R, t, dim, most, (int32_t *)(level + 2 * groups), (int32_t *)(level + 3 * groups + faces),
           &p);
    if (p.n >= 40) {
        block = sort(&p, &s);
        if (block == NULL) {
            free(memory);
            return -1;
        }
        spread(&p, memory + 7 * each, &lowest, &scale);
        for (i = 0; i < 2 * p.groups; i++)
            level[i] = 0.0f;
        for (i = 0; i < p.n; i++) {
            level[p.own[i]] += 1.0f;
            level[p.groups + p.own[i]] += p.value[i];
        }
        for (i = 0; i < n; i++) {
            costs[i] = 1e30;
            if (some[i] < 0 || some[i] >= table->directions)
                continue;
            light(f, table, some[i], &p, &s);
            costs[i] = cost(&p, &s, lowest, scale, level);
        }
        free(block);
    }
    free(memory);
    return p.n;
}

