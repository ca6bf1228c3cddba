/* What the background is about the craft where it has a texture: face_gains.py (shade, _wide_mean). */
#include <math.h>
#include <stdlib.h>

#include "images/area_average.h"
#include "photometric/image_formation.h"

/* Pixels, each way, that are averaged before the blur, and what little of the background counts (face_gains.py). */
#define REDUCED 4
#define LITTLE 0.02f

/* Two neighbours on a line, the first of them and the second one's share. */
struct pair {
    int64_t first;
    float second;
};

/* Between which of m points pixel i of n lies (OpenCV's INTER_LINEAR). */
static struct pair pair_of(int64_t i, int64_t n, int64_t m)
{
    const float at = (float)(((double)i + 0.5) * ((double)m / (double)n) - 0.5);
    const int64_t first = (int64_t)floorf(at);

    if (first < 0)
        return (struct pair){0, 0.0f};
    if (first >= m - 1)
        return (struct pair){m - 1, 0.0f};
    return (struct pair){first, at - (float)first};
}

/* small (sh, sw) enlarged to (h, w); rows (sh, w) is scratch. */
static void enlarge(const float *small, int64_t sh, int64_t sw, int64_t h, int64_t w, float *rows, float *out)
{
    int64_t x, y;

    for (x = 0; x < w; x++) {
        const struct pair p = pair_of(x, w, sw);
        const int64_t next = p.first + (p.first + 1 < sw);
        for (y = 0; y < sh; y++)
            rows[y * w + x] = small[y * sw + p.first] * (1.0f - p.second) + small[y * sw + next] * p.second;
    }
    for (y = 0; y < h; y++) {
        const struct pair p = pair_of(y, h, sh);
        const float *restrict a = rows + p.first * w, *restrict b = a + (p.first + 1 < sh ? w : 0);
        float *restrict to = out + y * w;
        for (x = 0; x < w; x++)
            to[x] = a[x] * (1.0f - p.second) + b[x] * p.second;
    }
}

int64_t fly_background(const float *gray, const uint8_t *core, const uint8_t *centre, int64_t h, int64_t w,
                       double shown, double level, const struct response *r, const struct gaussian *blur,
                       const float *empty, float *behind, float *picture)
{
    const int64_t sh = h / REDUCED > 2 ? h / REDUCED : 2, sw = w / REDUCED > 2 ? w / REDUCED : 2, n = h * w;
    float *own = malloc((size_t)(2 * n + 4 * sh * sw + sh * w) * sizeof *own), *value = own + n;
    float *small = value + n, *part = small + sh * sw, *num = part + sh * sw, *den = num + sh * sw;
    float *rows = den + sh * sw;
    const struct region a = {value, 4, h, w, w}, b = {own, 4, h, w, w};
    const float mean = (float)shown;
    int64_t i, done = -1;

    if (own == NULL)
        return -1;
    for (i = 0; i < n; i++) {
        own[i] = (float)(core[i] & (centre[i] == 0));
        value[i] = own[i] * (gray[i] - mean);
    }
    if (fly_downsample(&a, sh, sw, small) == 0 && fly_downsample(&b, sh, sw, part) == 0
        && fly_blur(small, sh, sw, blur, num) == 0 && fly_blur(part, sh, sw, blur, den) == 0) {
        for (i = 0; i < sh * sw; i++)
            num[i] /= den[i] + LITTLE;
        enlarge(num, sh, sw, h, w, rows, behind);
        if (r->sigma > 0)
            fly_brightness_differences(r, behind, n, shown, level, behind);
        for (i = 0; i < n; i++)
            picture[i] += empty[i] * behind[i];
        done = 0;
    }
    free(own);
    return done;
}
