/* The craft as the Sun sees it, the shadows that it casts on itself, and where the Sun stands: sunlight.py. */
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "kernels.h"

/* sunlight.py's SKIN_M [m], GRAZING, SPREAD and BOUND */
#define SKIN 0.006
#define GRAZING 0.03
#define SPREAD 0.15
#define BOUND 4.0f

/* Nearest whole number 0 .. n - 1, halves to even as numpy's rint; 0 for NaN. */
static int32_t cell(float x, float n)
{
    const float shift = 12582912.0f; /* 1.5 * 2^23 */
    float a = x > 0.0f ? x : 0.0f, sum;
    a = a < n - 1.0f ? a : n - 1.0f;
    sum = a + shift;
    return (int32_t)(sum - shift);
}

static double dot(const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

/* out = M x of M (3, 3). */
static void times(const double *M, const double *x, double *out)
{
    out[0] = dot(M, x), out[1] = dot(M + 3, x), out[2] = dot(M + 6, x);
}

/* out = M' x of M (3, 3). */
static void times_transposed(const double *M, const double *x, double *out)
{
    int k;
    for (k = 0; k < 3; k++)
        out[k] = M[k] * x[0] + M[3 + k] * x[1] + M[6 + k] * x[2];
}

/* Inverse depth of a face's plane along a ray (u, v, 1): sum of inverse[k] times the ray (rays_to_faces). */
static void inverse_depth(const struct faces *f, int64_t face, const double *R, const double *t, float inverse[3])
{
    double n[3], d;
    int k;

    times(R, f->normals + 3 * face, n);
    d = f->offset[face] + dot(n, t);
    d = fabs(d) > 1e-9 ? d : 1e-9;
    for (k = 0; k < 3; k++)
        inverse[k] = (float)(n[k] / d);
}

/* Normalised coordinate of drawn pixel k: shade.py's Canvas.rays, across or down. */
static float ray(int64_t k, double scale, double corner, double centre, double focal)
{
    return (float)((((double)k + 0.5) / scale - 0.5 + corner - centre) / focal);
}

/* Least inverse depth: nothing is farther than five times the craft. */
static float least_inverse(const double *t) { return (float)(0.2 / (t[2] > 1e-3 ? t[2] : 1e-3)); }

/* sunlight.py's Sunlight.of but for its order: polygons p (n, 4, 2) of faces order (n,) on the Sun's picture of
 * side^2 pixels, with where it begins, its pixels and their first middle [m].
 *
 * axes : (3, 3) of the picture and the direction to the Sun. out : origin (2,), then pitch [m].
 */
void fly_sun_polygons(const struct faces *f, const int64_t *order, int64_t n, const double *axes, int64_t side,
                      double *p, double *out)
{
    double low[2] = {DBL_MAX, DBL_MAX}, high[2] = {-DBL_MAX, -DBL_MAX}, wide, tall, pitch;
    int64_t i;
    int k, a;

    for (i = 0; i < n; i++)
        for (k = 0; k < 4; k++)
            for (a = 0; a < 2; a++) {
                double x = dot(f->corners + 12 * order[i] + 3 * k, axes + 3 * a);
                p[8 * i + 2 * k + a] = x;
                low[a] = x < low[a] ? x : low[a];
                high[a] = x > high[a] ? x : high[a];
            }
    wide = high[0] - low[0];
    tall = high[1] - low[1];
    pitch = (wide > tall ? wide : tall) / (double)(side - 4);
    out[0] = low[0] - 1.5 * pitch;
    out[1] = low[1] - 1.5 * pitch;
    out[2] = pitch;
    for (i = 0; i < 8 * n; i++)
        p[i] = (p[i] - out[i & 1]) / pitch;
}

/* Heights (side, side) [m] along the Sun's direction of what it sees (side, side); -1000 where that is nothing.
 *
 * at : origin (2,), then pitch [m]. Returns 0; -1 where memory is short.
 */
int fly_sun_heights(const struct faces *f, const double *axes, const double *at, const int32_t *seen, int64_t side,
                    float *height)
{
    float *plane = malloc((size_t)(3 * f->faces + 3) * sizeof *plane), *x = malloc((size_t)(side + 1) * sizeof *x);
    int64_t i, j;

    if (plane == NULL || x == NULL) {
        free(plane);
        free(x);
        return -1;
    }
    plane[0] = -1e3f;
    plane[1] = plane[2] = 0.0f;
    for (i = 0; i < f->faces; i++) {
        /* the plane n.X = d at X = axes' point + height * s */
        const double *n = f->normals + 3 * i;
        double slope = dot(n, axes + 6);
        int away = !(slope > 1e-3);
        plane[3 * i + 3] = away ? 0.0f : (float)(f->offset[i] / slope);
        plane[3 * i + 4] = away ? 0.0f : (float)(-dot(n, axes) / slope);
        plane[3 * i + 5] = away ? 0.0f : (float)(-dot(n, axes + 3) / slope);
    }
    for (i = 0; i < side; i++)
        x[i] = (float)(at[0] + at[2] * (double)i);
    for (j = 0; j < side; j++) {
        float y = (float)(at[1] + at[2] * (double)j);
        for (i = 0; i < side; i++) {
            int32_t face = seen[j * side + i];
            const float *k = plane + 3 * (face > 0 && face <= f->faces ? face : 0);
            height[j * side + i] = k[0] + k[1] * x[i] + k[2] * y;
        }
    }
    free(plane);
    free(x);
    return 0;
}

/* The Sun's picture. */
struct sun {
    const double *axes;  /* (3, 3) of the picture and the direction to the Sun, target frame */
    const double *at;    /* origin (2,), then pitch [m] */
    const float *height; /* (side, side) [m] */
    const void *seen;    /* (side, side) face + 1: uint16 or int32 */
    int64_t side, bytes; /* of each of ``seen`` */
};

/* What a face is to a Sun and a pose. */
struct facing {
    float inverse[3]; /* depth along a ray */
    int lit;          /* whether it looks at the Sun */
};

static int32_t seen_by_sun(const struct sun *sun, int64_t at)
{
    return sun->bytes == 2 ? ((const uint16_t *)sun->seen)[at] : ((const int32_t *)sun->seen)[at];
}

/* Where the Sun's picture shows the points of one face along a row, and their heights there [m].
 *
 * inverse : the face's. along : rows of the Sun's axes in the camera's frame. from : the camera's centre on them.
 * u : (n,) and v of the rays. at, above : (n,) pixel and height.
 */
static void behind(const struct sun *sun, const float inverse[3], float along[3][3], const float from[3], float least,
                   const float *restrict u, float v, int64_t n, int32_t *restrict at, float *restrict above)
{
    float pitch = (float)sun->at[2], side = (float)sun->side, q0 = inverse[0], q1 = inverse[1] * v, q2 = inverse[2];
    float a0 = along[0][0], a1 = along[0][1] * v, a2 = along[0][2], fa = from[0];
    float b0 = along[1][0], b1 = along[1][1] * v, b2 = along[1][2], fb = from[1];
    float c0 = along[2][0], c1 = along[2][1] * v, c2 = along[2][2], fc = from[2];
    int32_t wide = (int32_t)sun->side;
    int64_t i;

    for (i = 0; i < n; i++) {
        float near = q0 * u[i] + q1 + q2, z = 1.0f / (near > least ? near : least);
        at[i] = cell(((b0 * u[i] + b1 + b2) * z + fb) / pitch, side) * wide +
                cell(((a0 * u[i] + a1 + a2) * z + fa) / pitch, side);
        above[i] = (c0 * u[i] + c1 + c2) * z + fc;
    }
}

/* sunlight.py's Sunlight.shadows: drawn pixels (h, w) that look at the Sun but lie behind something, into dark (h, w),
 * which holds zeros.
 *
 * seen : (h, w) face + 1 at the pose R (3, 3), t (3,). Returns 0; -1 where memory is short.
 */
int fly_shadows(const struct faces *f, const struct sun *sun, const struct view *view, const double *R,
                const double *t, const int32_t *seen, int64_t h, int64_t w, uint8_t *dark)
{
    struct facing *facing = malloc((size_t)(f->faces + 1) * sizeof *facing);
    float *u = malloc((size_t)(w + 1) * sizeof *u);
    float *above = malloc((size_t)(w + 1) * sizeof *above);
    int32_t *at = malloc((size_t)(w + 1) * sizeof *at);
    float along[3][3], from[3], least = least_inverse(t);
    float over = (float)(SKIN + 2.0 * sun->at[2]);
    double C[3], start[3];
    int64_t i, j;
    int k;

    if (facing == NULL || u == NULL || above == NULL || at == NULL) {
        free(facing);
        free(u);
        free(above);
        free(at);
        return -1;
    }
    for (i = 0; i < f->faces; i++) {
        facing[i].lit = dot(f->normals + 3 * i, sun->axes + 6) > GRAZING;
        inverse_depth(f, i, R, t, facing[i].inverse);
    }
    for (i = 0; i < w; i++)
        u[i] = ray(i, view->across, view->x0, view->cx, view->fx);
    times_transposed(R, t, C);
    for (k = 0; k < 3; k++)
        C[k] = -C[k];
    times(sun->axes, C, start);
    for (k = 0; k < 3; k++) {
        double row[3];
        times(R, sun->axes + 3 * k, row);
        for (i = 0; i < 3; i++)
            along[k][i] = (float)row[i];
        from[k] = (float)(k < 2 ? start[k] - sun->at[k] : start[k]);
    }
    for (j = 0; j < h; j++) {
        float v = ray(j, view->down, view->y0, view->cy, view->fy);
        const int32_t *row = seen + j * w;
        for (i = 0; i < w;) {
            int32_t face = row[i];
            int64_t end = i + 1;
            if (face <= 0 || face > f->faces || !facing[face - 1].lit) {
                i++;
                continue;
            }
            while (end < w && row[end] == face)
                end++;
            behind(sun, facing[face - 1].inverse, along, from, least, u + i, v, end - i, at, above);
            for (k = 0; i < end; i++, k++)
                if (sun->height[at[k]] - above[k] > over)
                    dark[j * w + i] = seen_by_sun(sun, at[k]) != face;
        }
    }
    free(facing);
    free(u);
    free(above);
    free(at);
    return 0;
}

/* sunlight.py's SunTable: pictures from S directions. */
struct sun_table {
    const double *frames; /* (3, S, 3) axes of each picture and its direction */
    const double *origin; /* (S, 2) [m] */
    const double *pitch;  /* (S,) [m] */
    const float *height;  /* (S, side, side) [m] */
    int64_t directions, side;
};

/* The drawn craft and the picture, for the Sun's search. */
struct looked_at {
    const int32_t *seen;   /* (h * fine, w * fine) face + 1 */
    const void *centre;    /* (h, w) label at a canvas pixel's middle: uint8 or uint16 */
    const uint8_t *good;   /* (labels,) whether pixels of it may be looked at */
    const float *gray;     /* (h, w) */
    const int64_t *group;  /* (T,) of each face */
    int64_t h, w, fine, groups, labels, bytes; /* of each of ``centre`` */
    float darkest;         /* least of ``gray`` */
};

static int may(const struct looked_at *p, int64_t at)
{
    int64_t label = p->bytes == 1 ? ((const uint8_t *)p->centre)[at] : ((const uint16_t *)p->centre)[at];
    return label < p->labels && p->good[label];
}

/* Points on the craft, at most ``most`` of them. */
struct points {
    float *x, *y, *z, *value; /* target frame [m]; root of the light */
    float *over;              /* height of the Sun's picture above each */
    int32_t *at;              /* and its pixel there */
    int32_t *own;             /* group, numbered anew from 0 */
    int32_t *face;            /* and face, numbered anew */
    int32_t *faced;           /* (faces,) face of each new number */
    uint8_t *facing;          /* (faces,) whether it looks at the Sun */
    uint8_t *lit;
    int64_t n, groups, faces;
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

/* Points that are looked at, evenly of all that may be: SunTable.find.
 *
 * numbers : (groups + faces,) scratch. inside : (h * w,) scratch.
 */
static void gather(const struct faces *f, const struct looked_at *p, const struct view *view, const double *R,
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

/* Which of the points lie in the light of direction d: SunTable._lit. */
static void light(const struct faces *f, const struct sun_table *table, int64_t d, struct points *p)
{
    const double *e0 = table->frames + 3 * d, *e1 = table->frames + 3 * (table->directions + d);
    const double *s = table->frames + 3 * (2 * table->directions + d);
    float ax = (float)e0[0], ay = (float)e0[1], az = (float)e0[2];
    float bx = (float)e1[0], by = (float)e1[1], bz = (float)e1[2];
    float sx = (float)s[0], sy = (float)s[1], sz = (float)s[2];
    float x0 = (float)table->origin[2 * d], y0 = (float)table->origin[2 * d + 1], pitch = (float)table->pitch[d];
    float side = (float)table->side, most = (float)(SKIN + 2.0 * table->pitch[d]);
    const float *height = table->height + d * table->side * table->side;
    const float *restrict x = p->x, *restrict y = p->y, *restrict z = p->z;
    float *restrict over = p->over;
    int32_t *restrict at = p->at, wide = (int32_t)table->side;
    int64_t i, n = p->n;

    for (i = 0; i < n; i++) {
        int32_t column = cell((ax * x[i] + ay * y[i] + az * z[i] - x0) / pitch, side);
        int32_t row = cell((bx * x[i] + by * y[i] + bz * z[i] - y0) / pitch, side);
        at[i] = row * wide + column;
        over[i] = -(sx * x[i] + sy * y[i] + sz * z[i]);
    }
    for (i = 0; i < p->faces; i++)
        p->facing[i] = dot(f->normals + 3 * p->faced[i], s) > GRAZING;
    for (i = 0; i < n; i++)
        p->lit[i] = (height[at[i]] + over[i] < most) & p->facing[p->face[i]];
}

/* What two levels for each group leave of the values: sunlight.py's _cost of one direction.
 *
 * level : (6, groups) scratch; its first two rows hold each group's number and sum of values.
 */
static double cost(const struct points *p, float lowest, float scale, float *level)
{
    const float *all_number = level, *all_total = level + p->groups;
    float *number = level + 2 * p->groups, *total = level + 3 * p->groups;
    float *bright = level + 4 * p->groups, *dark = level + 5 * p->groups;
    double left = 0.0;
    int64_t i;

    for (i = 0; i < 2 * p->groups; i++)
        number[i] = 0.0f;
    for (i = 0; i < p->n; i++)
        if (p->lit[i]) {
            number[p->own[i]] += 1.0f;
            total[p->own[i]] += p->value[i];
        }
    for (i = 0; i < p->groups; i++) {
        float b = total[i] / (number[i] > 1.0f ? number[i] : 1.0f);
        float d = (all_total[i] - total[i] + lowest) / (all_number[i] - number[i] + 1.0f);
        float mean = all_total[i] / all_number[i];
        /* a shadow brighter than the light is none */
        int wrong = number[i] > 0.0f && number[i] < all_number[i] && b < d;
        bright[i] = wrong ? mean : b > lowest ? b : lowest;
        dark[i] = wrong ? mean : d;
    }
    for (i = 0; i < p->n; i++) {
        float away = (p->value[i] - (p->lit[i] ? bright[p->own[i]] : dark[p->own[i]])) * scale;
        left += away * away < BOUND ? away * away : BOUND;
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

/* sunlight.py's SunTable.find but for the choice: what is left by each of the directions some (n,), into costs (n,).
 *
 * dim : brightness that is as good as none. most : points that are looked at. Returns how many were, whose costs
 * stand where they are 40; -1 where memory is short.
 */
int64_t fly_sun_costs(const struct faces *f, const struct sun_table *table, const struct looked_at *picture,
                      const struct view *view, const double *R, const double *t, double dim, int64_t most,
                      const int64_t *some, int64_t n, double *costs)
{
    /* one piece of memory: ten of ``most`` each and two of bytes, then the groups', faces' and pixels' */
    size_t each = (size_t)(most > 0 ? most : 0) + 1, groups = (size_t)picture->groups + 1, faces = (size_t)f->faces;
    size_t pixels = (size_t)(picture->h * picture->w) + 1;
    float *memory, *level, lowest, scale;
    struct points p;
    int64_t i;

    if (picture->h < 1 || picture->w < 1 || most < 2)
        return 0;
    memory = malloc((12 * each + 7 * groups + faces + pixels) * sizeof *memory);
    if (memory == NULL)
        return -1;
    p.x = memory;
    p.y = memory + each;
    p.z = memory + 2 * each;
    p.value = memory + 3 * each;
    p.over = memory + 4 * each;
    p.at = (int32_t *)(memory + 5 * each);
    p.own = (int32_t *)(memory + 6 * each);
    p.face = (int32_t *)(memory + 7 * each);
    p.faced = (int32_t *)(memory + 8 * each);
    p.facing = (uint8_t *)(memory + 10 * each);
    p.lit = (uint8_t *)(memory + 11 * each);
    level = memory + 12 * each;
    gather(f, picture, view, R, t, dim, most, (int32_t *)(level + 6 * groups), (int32_t *)(level + 7 * groups + faces),
           &p);
    if (p.n >= 40) {
        spread(&p, memory + 9 * each, &lowest, &scale);
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
            light(f, table, some[i], &p);
            costs[i] = cost(&p, lowest, scale, level);
        }
    }
    free(memory);
    return p.n;
}

/* course.py's _middle: mean column and row of the pixels of seen (h, w) that show the craft; returns how many. */
int64_t fly_middle(const int32_t *seen, int64_t h, int64_t w, double *out)
{
    int64_t columns = 0, rows = 0, n = 0, x, y;

    for (y = 0; y < h; y++) {
        int64_t here = 0, across = 0;
        for (x = 0; x < w; x++) {
            here += seen[y * w + x] != 0;
            across += seen[y * w + x] != 0 ? x : 0;
        }
        n += here;
        rows += here * y;
        columns += across;
    }
    out[0] = n > 0 ? (double)columns / (double)n : 0.0;
    out[1] = n > 0 ? (double)rows / (double)n : 0.0;
    return n;
}
