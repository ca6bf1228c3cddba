/* Prints a checksum of what some functions of the library answer, the same on every processor. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "kernels.h"

static uint32_t state = 7;

/* A whole number below n. */
static uint32_t draw(uint32_t n)
{
    state = state * 1664525u + 1013904223u;
    return (state >> 8) % n;
}

static void show(const char *name, const void *data, size_t bytes)
{
    const unsigned char *p = data;
    uint64_t sum = 14695981039346656037u;
    size_t i;

    for (i = 0; i < bytes; i++)
        sum = (sum ^ p[i]) * 1099511628211u;
    printf("%s %016llx\n", name, (unsigned long long)sum);
}

int main(void)
{
    enum { H = 90, W = 120, N = 64, POLYGONS = 40 };
    static uint8_t image[H * W];
    static float small[30 * 40], square[N * N], looks[N * N * 2], features[32 * 32 * 16], bias[16], worth[16];
    static float bumps[3 * 6 * 16], said[4 * 16], waves[11], circle[32 * 2], likely[6 * 32];
    static int16_t weights[5 * 5 * 2 * 16];
    static double noise[3], polygons[POLYGONS * 8], middle[2], lines[400 * 4];
    static int32_t seen[H * W];
    static int64_t order[POLYGONS], shape[4] = {5, 2, 2, 16};
    const float sigma = 2.0f;
    int64_t i, k, found;

    for (i = 0; i < H * W; i++)
        image[i] = (uint8_t)(draw(24) + (i % W > 40 && i / W > 30 ? 120 : 20));
    fly_area_average(image, 1, W, H, W, 30, 40, small);
    show("area_average", small, sizeof small);
    fly_noise(image, 1, W, H, W, 1, 255.0, noise);
    show("noise", noise, sizeof noise);
    for (i = 0; i < POLYGONS; i++) {
        const double x = draw(W), y = draw(H), wide = 1 + draw(30), tall = 0.3 + draw(20);
        const double corner[8] = {x, y, x + wide, y + 1, x + wide, y + tall, x - 2, y + tall};
        memcpy(polygons + 8 * i, corner, sizeof corner);
        order[i] = i;
    }
    fly_fill_faces(polygons, order, POLYGONS, 0.5, 1, seen, H, W);
    show("fill_faces", seen, sizeof seen);
    fly_mean_pixel(seen, H, W, middle);
    show("mean_pixel", middle, sizeof middle);
    found = fly_line_segments(image, H, W, 5.0, 400, lines);
    show("line_segments", &found, sizeof found);
    for (i = 0; i < N * N; i++)
        square[i] = (float)image[(i / N) * W + i % N];
    fly_contrast(square, &sigma, 1, N, looks);
    show("contrast", looks, sizeof looks);
    for (i = 0; i < (int64_t)(sizeof weights / sizeof *weights); i++)
        weights[i] = (int16_t)((int)draw(4000) - 2000);
    for (k = 0; k < 16; k++)
        worth[k] = 0.001f, bias[k] = 0.1f * (float)k;
    fly_convolutions(looks, 1, N, shape, 1, weights, worth, bias, features);
    show("convolutions", features, sizeof features);
    for (i = 0; i < (int64_t)(sizeof bumps / sizeof *bumps); i++)
        bumps[i] = (float)draw(1000) / 999.0f;
    for (i = 0; i < 64; i++)
        said[i] = (float)draw(1000) / 500.0f - 1.0f, circle[i] = (float)draw(1000) / 500.0f - 1.0f;
    for (i = 0; i < 11; i++)
        waves[i] = 1.0f / (float)(1 + i);
    fly_attitude_likelihood(bumps, said, waves, circle, 6, 32, 16, likely);
    show("attitude_likelihood", likely, sizeof likely);
    return 0;
}
