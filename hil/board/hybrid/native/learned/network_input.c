/* What the learned proposal is shown of a picture: network_input.py (crop_image, look) and network.py (contrast). */
#include <math.h>
#include <stdlib.h>

#include "images/area_average.h"

/* Side of the neighbourhood of the contrast channel [px], and the brightest of so many pixels, which set the level. */
#define CONTRAST 13
#define BRIGHT 200

/* A camera without distortion, its pictures, and the side of what is seen [px]. */
struct camera {
    double fx, fy, cx, cy;
    struct region image, reduced; /* the second without pixels where there is none */
    int64_t side;
    double sphere; /* [px] diameter of the craft's sphere in what is seen */
};

/* A direction (unit vector, camera axes) and the diameter of the craft's sphere there [px]. */
struct crop {
    double x, y, z, diameter;
};

/* The library's fmax is a call each. */
static double larger(double a, double b)
{
    return a > b ? a : b;
}

static double clipped(double v, double low, double high)
{
    /* what is no number is taken for low */
    return v > low ? (v < high ? v : high) : low;
}

/* The value between four pixels; beyond the border as on it. */
static float between(const float *p, int64_t h, int64_t w, double u, double v)
{
    const double x = clipped(u, 0.0, (double)(w - 1)), y = clipped(v, 0.0, (double)(h - 1));
    const int64_t i = (int64_t)x < w - 2 ? (int64_t)x : (w > 1 ? w - 2 : 0);
    const int64_t j = (int64_t)y < h - 2 ? (int64_t)y : (h > 1 ? h - 2 : 0);
    const int64_t right = w > 1, below = h > 1 ? w : 0;
    const float a = (float)(x - (double)i), b = (float)(y - (double)j);
    const float *q = p + j * w + i;

    return (1.0f - b) * ((1.0f - a) * q[0] + a * q[right]) + b * ((1.0f - a) * q[below] + a * q[below + right]);
}

/* The part of a region that takes in the places (side, side, 2) with a margin, and where it begins. */
static struct region about(const struct region *r, const double *place, int64_t side, double margin, int64_t corner[2])
{
    const int64_t size[2] = {r->w, r->h};
    int64_t end[2], i;
    int k;

    for (k = 0; k < 2; k++) {
        double low = place[k], high = place[k];
        /* a pinhole has what is farthest out on its rim */
        for (i = 0; i < side * side; i += i < side || i >= side * (side - 1) || (i + 1) % side == 0 ? 1 : side - 1) {
            const double here = place[2 * i + k];
            low = here < low ? here : low;
            high = here > high ? here : high;
        }
        corner[k] = (int64_t)clipped(floor(low) - margin, 0.0, (double)(size[k] - 2));
        end[k] = (int64_t)clipped(ceil(high) + margin, (double)(corner[k] + 2), (double)size[k]);
    }
    return fly_part(r, corner[1], corner[0], end[1] - corner[1], end[0] - corner[0]);
}

/* Pixels of the picture that a small camera along a crop has on its own, (side, side, 2). */
static void places(const struct camera *c, struct crop g, double *place)
{
    const double f = 0.5 * (c->fx + c->fy), factor = g.diameter / c->sphere;
    const double k = 1.0 / (1.0 + larger(g.z, -0.99)), middle = 0.5 * (double)(c->side - 1);
    int64_t i, j;

    for (j = 0; j < c->side; j++)
        for (i = 0; i < c->side; i++) {
            const double x = ((double)i - middle) * factor / f, y = ((double)j - middle) * factor / f;
            /* the shortest turn of the boresight to the crop */
            const double X = (1.0 - g.x * g.x * k) * x - g.x * g.y * k * y + g.x;
            const double Y = -g.x * g.y * k * x + (1.0 - g.y * g.y * k) * y + g.y;
            const double Z = larger(-g.x * x - g.y * y + g.z, 1e-3);
            *place++ = c->fx * (X / Z) + c->cx;
            *place++ = c->fy * (Y / Z) + c->cy;
        }
}

/* network_input.py's crop_image into out (side, side); -1 where there is no memory. */
static int crop_image(const struct camera *c, struct crop g, double *place, float *out)
{
    const int64_t n = c->side * c->side;
    double factor = g.diameter / c->sphere, across, down;
    struct region from = c->image, part;
    int64_t corner[2], high, wide, i;
    float *small;

    places(c, g, place);
    if (c->reduced.first != NULL) {
        const double sx = (double)c->image.w / (double)c->reduced.w, sy = (double)c->image.h / (double)c->reduced.h;
        if (factor > 2.0 * larger(sx, sy)) {
            from = c->reduced;
            factor /= larger(sx, sy);
            for (i = 0; i < n; i++) {
                place[2 * i] = (place[2 * i] + 0.5) / sx - 0.5;
                place[2 * i + 1] = (place[2 * i + 1] + 0.5) / sy - 0.5;
            }
        }
    }
    part = about(&from, place, c->side, factor, corner);
    high = part.h;
    wide = part.w;
    if (factor > 1.0) {
        high = (int64_t)larger(2.0, nearbyint((double)part.h / factor));
        wide = (int64_t)larger(2.0, nearbyint((double)part.w / factor));
    }
    small = malloc((size_t)(high * wide) * sizeof *small);
    if (small == NULL || fly_downsample(&part, high, wide, small)) {
        free(small);
        return -1;
    }
    across = (double)wide / (double)part.w;
    down = (double)high / (double)part.h;
    for (i = 0; i < n; i++)
        out[i] = between(small, high, wide, (place[2 * i] - (double)corner[0] + 0.5) * across - 0.5,
                         (place[2 * i + 1] - (double)corner[1] + 0.5) * down - 0.5);
    free(small);
    return 0;
}

int64_t fly_crop_images(const void *image, int64_t bytes, int64_t stride, int64_t h, int64_t w, const float *reduced,
                         int64_t reduced_h, int64_t reduced_w, const double *intrinsics, const double *crops,
                         int64_t n, int64_t side, double sphere, float *out)
{
    const struct camera c = {
        intrinsics[0], intrinsics[1], intrinsics[2], intrinsics[3],
        {image, bytes, h, w, stride}, {reduced, sizeof *reduced, reduced_h, reduced_w, reduced_w}, side, sphere};
    double *place = malloc((size_t)(2 * side * side) * sizeof *place);
    int failed = place == NULL;
    int64_t k;

    for (k = 0; k < n && !failed; k++) {
        const struct crop g = {crops[4 * k], crops[4 * k + 1], crops[4 * k + 2], crops[4 * k + 3]};
        failed = crop_image(&c, g, place, out + k * side * side);
    }
    free(place);
    return failed ? -1 : 0;
}

/* The value that one in BRIGHT of n pixels reaches; top (n / BRIGHT + 1,) is scratch. */
static float brightest(const float *p, int64_t n, float *top)
{
    const int64_t many = n / BRIGHT > 0 ? n / BRIGHT : 1;
    int64_t held = 0, i, j;

    for (i = 0; i < n; i++) {
        /* the largest so far in order, the least of them last */
        if (held == many && !(p[i] > top[many - 1]))
            continue;
        j = held < many ? held++ : many - 1;
        for (; j > 0 && p[i] > top[j - 1]; j--)
            top[j] = top[j - 1];
        top[j] = p[i];
    }
    return top[many - 1];
}

/* Place i on a line of n, mirrored at its ends without repeating them. */
static int64_t mirrored(int64_t i, int64_t n)
{
    i = i < 0 ? -i : i;
    return i < n ? i : 2 * (n - 1) - i;
}

/* Mean of p (n, n) over the neighbourhood of the contrast channel; part (n, n) and line (n + CONTRAST,) are scratch. */
static void mean_about(const float *p, int64_t n, float *out, float *part, float *line)
{
    const int64_t r = CONTRAST / 2;
    int64_t x, y, k;

    for (y = 0; y < n; y++) {
        float *restrict sum = part + y * n;
        for (x = 0; x < n; x++)
            sum[x] = 0.0f;
        for (k = -r; k <= r; k++) {
            const float *row = p + mirrored(y + k, n) * n;
            for (x = 0; x < n; x++)
                sum[x] += row[x];
        }
    }
    for (y = 0; y < n; y++) {
        float *restrict sum = out + y * n;
        for (x = 0; x < n + 2 * r; x++)
            line[x] = part[y * n + mirrored(x - r, n)];
        for (x = 0; x < n; x++)
            sum[x] = 0.0f;
        for (k = 0; k < CONTRAST; k++)
            for (x = 0; x < n; x++)
                sum[x] += line[x + k];
        for (x = 0; x < n; x++)
            sum[x] *= 1.0f / (CONTRAST * CONTRAST);
    }
}

int64_t fly_contrast(const float *pictures, const float *noise, int64_t count, int64_t n, float *looks)
{
    const int64_t pixels = n * n;
    float *away = malloc((size_t)(3 * pixels + n + CONTRAST + pixels / BRIGHT + 1) * sizeof *away);
    float *mean, *part, *line, *top;
    int64_t k, i;

    if (away == NULL)
        return -1;
    mean = away + pixels;
    part = mean + pixels;
    line = part + pixels;
    top = line + n + CONTRAST;
    for (k = 0; k < count; k++) {
        const float *p = pictures + k * pixels;
        float *out = looks + 2 * k * pixels;
        const float bright =
            (float)larger(larger(brightest(p, pixels, top), 6.0f * noise[k]), 1e-9f);
        const float least = (2.0f * noise[k] + 0.004f * bright) * (2.0f * noise[k] + 0.004f * bright);
        mean_about(p, n, mean, part, line);
        for (i = 0; i < pixels; i++) {
            mean[i] = p[i] - mean[i];
            away[i] = mean[i] * mean[i];
        }
        for (i = 0; i < pixels; i++) {
            const float level = p[i] / bright;
            out[2 * i] = sqrtf(level > 0.0f ? (level < 1.2f ? level : 1.2f) : 0.0f) - 0.3f;
            out[2 * i + 1] = mean[i];
        }
        mean_about(away, n, mean, part, line);
        for (i = 0; i < pixels; i++) {
            const float steep = out[2 * i + 1] / sqrtf(mean[i] + least);
            out[2 * i + 1] = 0.5f * (steep > -3.0f ? (steep < 3.0f ? steep : 3.0f) : -3.0f);
        }
    }
    free(away);
    return 0;
}
