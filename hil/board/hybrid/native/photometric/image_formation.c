/* Blur and response of pictures: face_gains.py (blurred), response.py. */
#include <stdlib.h>
#include <string.h>

#include "photometric/image_formation.h"

/* response.py's REACH and STEPS */
#define REACH 4
#define STEPS 64

/* Pixels of a row that are counted together. */
#define STRIP 256

int64_t fly_reflect_101(int64_t i, int64_t n)
{
    if (n < 2)
        return 0;
    while (i < 0 || i >= n)
        i = i < 0 ? -i : 2 * (n - 1) - i;
    return i;
}

/* out (n,) = lines p[0 .. 2r] summed with weights, those at like distance from the middle together. */
static inline void weigh(const float *const *p, const float *taps, const int r, float *restrict out, int64_t n)
{
    int64_t x;
    int j;

    for (x = 0; x < n; x++) {
        float sum = taps[r] * p[r][x];
        for (j = 1; j <= r; j++)
            sum += taps[r + j] * (p[r - j][x] + p[r + j][x]);
        out[x] = sum;
    }
}

/* Numbers side by side, wherever they lie: each of them rounds as it does alone. */
#define LINE 8
typedef float line __attribute__((vector_size(4 * LINE), aligned(4), may_alias));

static inline line at(const float *a) { return *(const line *)(const void *)a; }

/* The same for reaches that are no constant. */
static void weigh_far(const float *const *p, const float *taps, int64_t r, float *out, int64_t n)
{
    int64_t x, j;

    for (x = 0; x + LINE <= n; x += LINE) {
        line sum = taps[r] * at(p[r] + x);
        for (j = 1; j <= r; j++)
            sum += taps[r + j] * (at(p[r - j] + x) + at(p[r + j] + x));
        *(line *)(void *)(out + x) = sum;
    }
    for (; x < n; x++) {
        float sum = taps[r] * p[r][x];
        for (j = 1; j <= r; j++)
            sum += taps[r + j] * (p[r - j][x] + p[r + j][x]);
        out[x] = sum;
    }
}

void fly_convolve_lines(const float *const *p, const struct gaussian *g, float *out, int64_t n)
{
    /* a constant reach keeps the sums in registers */
    switch (g->reach) {
    case 1: weigh(p, g->taps, 1, out, n); break;
    case 2: weigh(p, g->taps, 2, out, n); break;
    case 3: weigh(p, g->taps, 3, out, n); break;
    case 4: weigh(p, g->taps, 4, out, n); break;
    case 5: weigh(p, g->taps, 5, out, n); break;
    case 6: weigh(p, g->taps, 6, out, n); break;
    case 7: weigh(p, g->taps, 7, out, n); break;
    case 8: weigh(p, g->taps, 8, out, n); break;
    default: weigh_far(p, g->taps, g->reach, out, n);
    }
}

void fly_blur_with(const float *src, int64_t h, int64_t w, struct gaussian g, float *dst, float *part, float *line)
{
    const float *p[2 * WIDEST + 1];
    const int64_t r = g.reach;
    int64_t x, y, j;

    if (r == 0) {
        memcpy(dst, src, (size_t)(h * w) * sizeof *dst);
        return;
    }
    for (j = 0; j <= 2 * r; j++)
        p[j] = line + j;
    for (y = 0; y < h; y++) {
        const float *row = src + y * w;
        memcpy(line + r, row, (size_t)w * sizeof *line);
        for (x = 1; x <= r; x++) {
            line[r - x] = row[fly_reflect_101(-x, w)];
            line[r + w - 1 + x] = row[fly_reflect_101(w - 1 + x, w)];
        }
        fly_convolve_lines(p, &g, part + y * w, w);
    }
    for (y = 0; y < h; y++) {
        for (j = -r; j <= r; j++)
            p[r + j] = part + fly_reflect_101(y + j, h) * w;
        fly_convolve_lines(p, &g, dst + y * w, w);
    }
}

int fly_blur(const float *src, int64_t h, int64_t w, const struct gaussian *g, float *dst)
{
    float *part = malloc((size_t)(h * w + w + 2 * g->reach + 1) * sizeof *part);

    if (part == NULL)
        return -1;
    fly_blur_with(src, h, w, *g, dst, part, part + h * w);
    free(part);
    return 0;
}

/* Nearest whole number, halves to even, of 0 <= x < 2^22. */
static float nearest(float x)
{
    const float shift = 12582912.0f; /* 1.5 * 2^23 */
    return (x + shift) - shift;
}

static float between(float x, float low, float high) { return x < low ? low : x > high ? high : x; }

void fly_response(const struct response *r, const float *x, int64_t n, float *mean, float *slope)
{
    const float full = (float)r->full, sigma = (float)r->sigma;
    int64_t i;

    if (!(r->sigma > 0)) {
        for (i = 0; i < n; i++) {
            mean[i] = x[i] < full ? x[i] : x[i] >= full ? full : x[i];
            if (slope != NULL)
                slope[i] = 1.0f;
        }
        return;
    }
    const float step = (float)(STEPS / r->sigma), last = 2 * REACH * STEPS;
    for (i = 0; i < n; i++) {
        /* beyond their ends the tables stay as they are; what is no number is held at their first entry */
        const float at = x[i] * step + (float)(REACH * STEPS);
        const int low = (int)nearest(between(at == at ? at : 0.0f, 0.0f, 4194303.0f));
        const int k = low < (int)last ? low : (int)last;
        float lift = r->lift[k], share = r->share[k];
        if (low > r->end) {
            const int64_t over = low - r->end, top = over < (int)last ? over : (int)last;
            lift -= r->lift[top];
            share -= r->share[top];
        }
        mean[i] = lift * sigma + (x[i] == x[i] ? between(x[i], 0.0f, full) : x[i]);
        if (slope != NULL)
            slope[i] = share;
    }
}

/* Straight lines between points (x, y) of ascending x, ends held (numpy.interp); at least two points. */
static double between_points(double at, const double *x, const double *y, int64_t n)
{
    int64_t low = 0, high = n - 1;

    if (!(at > x[0]))
        return at == at ? y[0] : at;
    if (at >= x[high])
        return y[high];
    while (high - low > 1) {
        const int64_t middle = (low + high) / 2;
        if (x[middle] <= at)
            low = middle;
        else
            high = middle;
    }
    return y[low] + (y[high] - y[low]) / (x[high] - x[low]) * (at - x[low]);
}

double fly_brightness(const struct response *r, double mean)
{
    if (!(r->sigma > 0))
        return mean;
    const double end = r->below[r->entries - 1];
    if (mean > r->full - end)
        return r->full - between_points(r->full - mean, r->below, r->x, r->entries);
    return mean < end ? between_points(mean, r->below, r->x, r->entries) : mean;
}

/* Stretches of like length that a table's points are found by. */
#define CELLS 256

void fly_brightness_differences(const struct response *r, const float *away, int64_t n, double mean, double level,
                                float *out)
{
    const int64_t last = r->entries - 1;
    const double low = r->below[0], end = r->below[last], per = CELLS / (end - low);
    int32_t first[CELLS + 1];
    int64_t i, k = 0;

    for (i = 0; i <= CELLS; i++) {
        while (k + 1 < last && r->below[k + 1] <= low + (double)i / per)
            k++;
        first[i] = (int32_t)k;
    }
    for (i = 0; i < n; i++) {
        const double at = (double)(away[i] + (float)mean);
        if (r->sigma > 0 && at > low && at < end && at <= r->full - end) {
            const double *x = r->below, *y = r->x;
            for (k = first[(int)((at - low) * per)]; k > 0 && x[k] > at; k--)
                continue;
            for (; x[k + 1] <= at; k++)
                continue;
            out[i] = (float)(y[k] + (y[k + 1] - y[k]) / (x[k + 1] - x[k]) * (at - x[k])) - (float)level;
        } else {
            out[i] = (float)fly_brightness(r, at) - (float)level;
        }
    }
}

/* Shares of a row of patch pixels of two drawn ones each way. count (w,) is scratch. */
static void shared(const uint8_t *restrict top, const uint8_t *restrict end, int64_t w, uint8_t craft,
                   uint8_t *restrict count, float *restrict share)
{
    int64_t x;

    for (x = 0; x < w; x++)
        count[x] = (uint8_t)((top[2 * x] != 0) + (top[2 * x + 1] != 0) + (end[2 * x] != 0) + (end[2 * x + 1] != 0));
    for (x = 0; x < w; x++)
        share[x] = (float)(craft ? count[x] : 4 - count[x]) * 0.25f;
}

void fly_pixel_share(struct drawing d, int craft, float *share)
{
    const int64_t wide = d.w * d.f;
    int64_t x, y, a, b;

    for (y = 0; y < d.h; y++) {
        const uint8_t *top = d.group + y * d.f * wide;
        uint8_t count[STRIP];
        for (x = 0; d.f == 2 && x < d.w; x += STRIP)
            shared(top + 2 * x, top + wide + 2 * x, d.w - x < STRIP ? d.w - x : STRIP, craft != 0, count,
                   share + y * d.w + x);
        for (x = 0; d.f != 2 && x < d.w; x++) {
            const uint8_t *from = top + x * d.f;
            int64_t sum = 0;
            for (b = 0; b < d.f; b++)
                for (a = 0; a < d.f; a++)
                    sum += (from[b * wide + a] != 0) == craft;
            share[y * d.w + x] = (float)sum * (1.0f / (float)(d.f * d.f));
        }
    }
}
