/* The craft as the Sun sees it, and the shadows that it casts on itself: shadow_map.py. */
#include <float.h>
#include <stdlib.h>
#include <string.h>

#include "raster/shadow_map.h"

void fly_shadow_map_polygons(const struct faces *f, const int64_t *order, int64_t n, const double *axes, int64_t side,
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

int fly_shadow_map_heights(const struct faces *f, const double *axes, const double *at, const int32_t *seen,
                           int64_t side,
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

int64_t fly_mean_pixel(const int32_t *seen, int64_t h, int64_t w, double *out)
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
