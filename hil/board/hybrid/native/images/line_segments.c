/* Straight segments by the line segment detector, as OpenCV's with its own settings: line_segments.py (lsd_stream).
 *
 * Grompone von Gioi, Jakubowicz, Morel, Randall (2012), LSD: a line segment detector, IPOL 2, without its last test
 * (of meaning). Directions are unit vectors here, so that no pixel asks for an angle; edges of one strength are begun
 * with in the order of rows, where OpenCV's order is any.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "kernels.h"

/* Cosine of the tolerance of directions, 22.5 deg, and the chance that a direction lies within it; share of a
 * rectangle that its pixels
 * must fill; bins of strength. */
#define COSINE 0.92387953251128674
#define CHANCE (22.5 / 180.0)
#define DENSITY 0.7
#define BINS 1024

/* Direction of a level line, a unit vector. */
struct way {
    float along, down;
};

/* The picture's level lines: direction and strength of each pixel, what is used or has none, and the region that
 * grows. */
struct field {
    int64_t h, w;
    struct way *way;
    float *strength;
    uint8_t *used;
    int32_t *region;
    int64_t n;
    double along_sum, down_sum; /* direction of the region, of any length */
};

/* A rectangle about a region: its ends and its width. */
struct rectangle {
    double x1, y1, x2, y2, width;
};

static double distance(double x1, double y1, double x2, double y2)
{
    return sqrt((x2 - x1) * (x2 - x1) + (y2 - y1) * (y2 - y1));
}

/* Strengths and directions of the picture (h, w); the largest strength. */
static float differentiate(const uint8_t *picture, struct field *f, float least)
{
    float top = 0.0f;
    int64_t x, y;

    memset(f->used, 1, (size_t)(f->h * f->w));
    for (y = 0; y + 1 < f->h; y++)
        for (x = 0; x + 1 < f->w; x++) {
            const uint8_t *p = picture + y * f->w + x;
            const int a = p[f->w + 1] - p[0], b = p[1] - p[f->w], gx = a + b, gy = a - b;
            const float norm = sqrtf((float)(gx * gx + gy * gy)), strength = 0.5f * norm;
            const int64_t at = y * f->w + x;
            if (strength <= least)
                continue;
            f->strength[at] = strength;
            f->way[at].along = -(float)gy / norm;
            f->way[at].down = (float)gx / norm;
            f->used[at] = 0;
            top = strength > top ? strength : top;
        }
    return top;
}

/* Pixels with a direction, the strongest first, into order; how many. */
static int64_t ordered(const struct field *f, float top, int32_t *order)
{
    const float scale = top > 0.0f ? (float)(BINS - 1) / top : 0.0f;
    int64_t first[BINS + 1] = {0}, at, n = f->h * f->w;
    int k;

    for (at = 0; at < n; at++)
        if (!f->used[at])
            first[BINS - 1 - (int)(f->strength[at] * scale) + 1]++;
    for (k = 0; k < BINS; k++)
        first[k + 1] += first[k];
    n = first[BINS];
    for (at = 0; at < f->h * f->w; at++)
        if (!f->used[at])
            order[first[BINS - 1 - (int)(f->strength[at] * scale)]++] = (int32_t)at;
    return n;
}

/* Take a pixel into the region. */
static void take(struct field *f, int64_t at)
{
    f->used[at] = 1;
    f->region[f->n++] = (int32_t)at;
    f->along_sum += f->way[at].along;
    f->down_sum += f->way[at].down;
}

/* The region that grows from a pixel over neighbours whose direction is the region's to a least cosine. */
static void grow(struct field *f, int64_t seed, double least)
{
    const struct way *way = f->way;
    const uint8_t *used = f->used;
    const int64_t h = f->h, w = f->w;
    double x = way[seed].along, y = way[seed].down, enough = least;
    int64_t i;

    f->n = 0;
    f->along_sum = f->down_sum = 0.0;
    take(f, seed);
    for (i = 0; i < f->n; i++) {
        const int64_t row = f->region[i] / (int32_t)w, column = f->region[i] % (int32_t)w;
        const int64_t top = row > 0 ? row - 1 : 0, bottom = row + 1 < h ? row + 1 : row;
        const int64_t left = column > 0 ? column - 1 : 0, right = column + 1 < w ? column + 1 : column;
        int64_t j, k;
        for (j = top; j <= bottom; j++)
            for (k = left; k <= right; k++) {
                const int64_t at = j * w + k;
                if (!used[at] && x * way[at].along + y * way[at].down >= enough) {
                    take(f, at);
                    x = f->along_sum;
                    y = f->down_sum;
                    enough = least * sqrt(x * x + y * y);
                }
            }
    }
}

/* The rectangle about the region along its axis of least inertia. */
static struct rectangle about(const struct field *f)
{
    double x = 0.0, y = 0.0, sum = 0.0, xx = 0.0, yy = 0.0, xy = 0.0, theta, dx, dy, least, length;
    double low = 0.0, high = 0.0, left = 0.0, right = 0.0;
    struct rectangle r;
    int64_t i;

    for (i = 0; i < f->n; i++) {
        const int64_t at = f->region[i];
        x += (double)(at % f->w) * f->strength[at];
        y += (double)(at / f->w) * f->strength[at];
        sum += f->strength[at];
    }
    x /= sum;
    y /= sum;
    for (i = 0; i < f->n; i++) {
        const int64_t at = f->region[i];
        const double u = (double)(at % f->w) - x, v = (double)(at / f->w) - y;
        xx += v * v * f->strength[at];
        yy += u * u * f->strength[at];
        xy -= u * v * f->strength[at];
    }
    least = 0.5 * (xx + yy - sqrt((xx - yy) * (xx - yy) + 4.0 * xy * xy));
    theta = fabs(xx) > fabs(yy) ? atan2(least - xx, xy) : atan2(xy, least - yy);
    dx = cos(theta);
    dy = sin(theta);
    length = sqrt(f->along_sum * f->along_sum + f->down_sum * f->down_sum);
    /* towards the region's own direction */
    if (dx * f->along_sum + dy * f->down_sum < COSINE * length) {
        dx = -dx;
        dy = -dy;
    }
    for (i = 0; i < f->n; i++) {
        const int64_t at = f->region[i];
        const double u = (double)(at % f->w) - x, v = (double)(at / f->w) - y;
        const double l = u * dx + v * dy, w = -u * dy + v * dx;
        low = l < low ? l : low;
        high = l > high ? l : high;
        left = w < left ? w : left;
        right = w > right ? w : right;
    }
    r.x1 = x + low * dx;
    r.y1 = y + low * dy;
    r.x2 = x + high * dx;
    r.y2 = y + high * dy;
    r.width = right - left > 1.0 ? right - left : 1.0;
    return r;
}

static double density(const struct field *f, const struct rectangle *r)
{
    return (double)f->n / (distance(r->x1, r->y1, r->x2, r->y2) * r->width);
}

/* Cosine of a tolerance by how much directions near the region's first pixel vary; its pixels are free again. */
static double narrower(struct field *f, double width)
{
    const int64_t seed = f->region[0];
    double sum = 0.0, squares = 0.0, number = 0.0, mean;
    int64_t i;

    for (i = 0; i < f->n; i++) {
        const int64_t at = f->region[i];
        f->used[at] = 0;
        if (distance((double)(seed % f->w), (double)(seed / f->w), (double)(at % f->w), (double)(at / f->w)) < width) {
            const double c = f->way[seed].along, s = f->way[seed].down;
            const double off = atan2(c * f->way[at].down - s * f->way[at].along,
                                     c * f->way[at].along + s * f->way[at].down);
            sum += off;
            squares += off * off;
            number += 1.0;
        }
    }
    mean = sum / number;
    return cos(fmin(2.0 * sqrt((squares - 2.0 * mean * sum) / number + mean * mean), 3.14159));
}

/* Without the pixels farthest from the first until the rest fill their rectangle; whether any are left. */
static int shortened(struct field *f, struct rectangle *r)
{
    const double x = (double)(f->region[0] % f->w), y = (double)(f->region[0] / f->w);
    double far = distance(x, y, r->x1, r->y1), other = distance(x, y, r->x2, r->y2);
    int64_t i;

    far = other > far ? other : far;
    while (density(f, r) < DENSITY) {
        far *= 0.75;
        for (i = 0; i < f->n; i++) {
            const int64_t at = f->region[i];
            if (distance(x, y, (double)(at % f->w), (double)(at / f->w)) > far) {
                f->used[at] = 0;
                f->along_sum -= f->way[at].along;
                f->down_sum -= f->way[at].down;
                f->region[i--] = f->region[--f->n];
            }
        }
        if (f->n < 2)
            return 0;
        *r = about(f);
    }
    return 1;
}

int64_t fly_line_segments(const uint8_t *picture, int64_t h, int64_t w, double least, int64_t most, double *out)
{
    const double tests = 2.5 * (log10((double)w) + log10((double)h)) + log10(11.0);
    const int64_t fewest = (int64_t)(-tests / log10(CHANCE)), pixels = h * w;
    struct way *way = malloc((size_t)pixels * sizeof *way);
    float *strength = malloc((size_t)pixels * sizeof *strength);
    int32_t *numbers = malloc((size_t)(2 * pixels) * sizeof *numbers);
    uint8_t *used = malloc((size_t)pixels);
    struct field f = {h, w, way, strength, used, numbers, 0, 0.0, 0.0};
    int64_t found = -1, n, k;

    if (way != NULL && strength != NULL && numbers != NULL && used != NULL) {
        n = ordered(&f, differentiate(picture, &f, (float)least), numbers + pixels);
        found = 0;
        for (k = 0; k < n && found < most; k++) {
            const int64_t seed = numbers[pixels + k];
            struct rectangle r;
            double *to = out + 4 * found;
            if (used[seed])
                continue;
            grow(&f, seed, COSINE);
            if (f.n < fewest)
                continue;
            r = about(&f);
            if (density(&f, &r) < DENSITY) {
                grow(&f, seed, narrower(&f, r.width));
                if (f.n < 2)
                    continue;
                r = about(&f);
                if (!shortened(&f, &r))
                    continue;
            }
            to[0] = r.x1 + 0.5;
            to[1] = r.y1 + 0.5;
            to[2] = r.x2 + 0.5;
            to[3] = r.y2 + 0.5;
            found++;
        }
    }
    free(way);
    free(strength);
    free(numbers);
    free(used);
    return found;
}
