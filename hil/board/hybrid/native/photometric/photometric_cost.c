/* How well a drawn craft explains the picture: photometric.py (explained). */
#include <stdlib.h>

#include "photometric/image_formation.h"

/* What the noise itself costs, which is nobody's fault (photometric.py, _bounded). */
#define FREE 1.5f

/* Sum of squared deviations e (n,), each bounded (photometric.py, _bounded); one that is no number costs the bound. */
static double bounded(const float *e, int64_t n, float bound)
{
    double sum[4] = {0, 0, 0, 0};
    int64_t i;
    int j;

    for (i = 0; i + 4 <= n; i += 4)
        for (j = 0; j < 4; j++) {
            const float square = e[i + j] * e[i + j], cost = (square < bound ? square : bound) - FREE;
            sum[j] += cost > 0 ? (double)cost : 0.0;
        }
    for (; i < n; i++) {
        const float square = e[i] * e[i], cost = (square < bound ? square : bound) - FREE;
        sum[0] += cost > 0 ? (double)cost : 0.0;
    }
    return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

double fly_photometric_cost(const float *picture, const uint8_t *group, int64_t h, int64_t w, int64_t f,
                     const struct gaussian *optics, const struct response *r, const float *gray,
                     const struct gaussian *score, double noise, double bound, const float *none,
                     const struct gaussian *cover, double covered)
{
    const struct drawing d = {group, h, w, f};
    const int64_t n = h * w;
    const int64_t most = optics->reach > score->reach ? optics->reach : score->reach;
    const int64_t reach = most > cover->reach ? most : cover->reach;
    float *block = malloc((size_t)(4 * n + w + 2 * reach + 1) * sizeof *block);
    float *a = block, *b = a + n, *share = b + n, *part = share + n, *line = part + n;
    const float scale = (float)(1.0 / noise), least = (float)covered;
    int64_t i;
    double out;

    if (block == NULL)
        return -1.0;
    fly_blur_with(picture, h, w, *optics, a, part, line);
    fly_response(r, a, n, a, NULL);
    fly_blur_with(a, h, w, *score, b, part, line);
    for (i = 0; i < n; i++)
        b[i] = (gray[i] - b[i]) * scale;
    if (none != NULL) {
        fly_pixel_share(d, 1, a);
        fly_blur_with(a, h, w, *cover, share, part, line);
        for (i = 0; i < n; i++)
            b[i] = share[i] > least ? b[i] : none[i];
    }
    out = bounded(b, n, (float)bound);
    free(block);
    return out;
}
