/* Which samples of the wireframe a camera sees: visibility.py. */
#include <math.h>
#include <stdlib.h>

#include "kernels.h"

/* visibility.py's SKIN_M [m], and the least cosine at which a face counts as seen */
#define SKIN 0.006
#define SEEN 0.02

/* Triangles that are looked at before it is asked whether one of them was hit. */
#define BLOCK 32

static double dot(const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static void cross(const double *a, const double *b, double *out)
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

/* Where the outline of sample i lies from C: off a round member's axis, across the ray (EdgeSamples.outline). */
static void outline_at(const struct samples *s, int64_t i, const double *C, double *X)
{
    const double *P = s->points + 3 * i;
    double ray[3] = {P[0] - C[0], P[1] - C[1], P[2] - C[2]}, across[3], length;
    int k;

    cross(s->tangents + 3 * i, ray, across);
    length = sqrt(dot(across, across));
    length = length > 1e-9 ? length : 1e-9;
    for (k = 0; k < 3; k++)
        X[k] = P[k] + (s->radius[i] != 0.0 ? across[k] / length * s->radius[i] : 0.0);
}

/* Faces beside sample i at X that look at C. */
static int facing(const struct samples *s, int64_t i, const double *C, const double *X)
{
    double d[3] = {C[0] - X[0], C[1] - X[1], C[2] - X[2]}, length = sqrt(dot(d, d));
    int k, seen = 0;

    length = length > 1e-9 ? length : 1e-9;
    for (k = 0; k < 3; k++)
        d[k] /= length;
    for (k = 0; k < 2; k++)
        seen += dot(s->normals + 6 * i + 3 * k, d) > SEEN;
    return seen;
}

/* Triangles that look at C, prepared: ten rows of ``room`` numbers. Their triple products are products with a ray. */
static int64_t prepared(const struct occluders *o, const double *C, int64_t room, float *rows)
{
    int64_t i, n = 0;
    int k;

    for (i = 0; i < o->triangles; i++) {
        const double *e1 = o->e1 + 3 * i, *e2 = o->e2 + 3 * i, *normal = o->n + 3 * i, *v0 = o->v0 + 3 * i;
        double T[3] = {C[0] - v0[0], C[1] - v0[1], C[2] - v0[2]}, q[3], p[3];
        /* a closed mesh hides with its near side: back faces need no test */
        if (!(dot(T, normal) > 0.0))
            continue;
        cross(T, e1, q);
        cross(e2, T, p);
        for (k = 0; k < 3; k++) {
            rows[k * room + n] = (float)-normal[k];
            rows[(3 + k) * room + n] = (float)p[k];
            rows[(6 + k) * room + n] = (float)q[k];
        }
        rows[9 * room + n] = (float)dot(e2, q);
        n++;
    }
    /* those that fill the last block are never hit */
    for (i = n; i < room; i++)
        for (k = 0; k < 10; k++)
            rows[k * room + i] = 0.0f;
    return n;
}

/* Whether a ray D (3,) meets one of n triangles before its end: Moeller and Trumbore's test (1997). */
static int hit(const float *restrict rows, int64_t room, int64_t n, const float D[3], float limit)
{
    const float x = D[0], y = D[1], z = D[2];
    int64_t i, j;

    for (i = 0; i < n; i += BLOCK) {
        const float *r = rows + i;
        int32_t any = 0;
        for (j = 0; j < BLOCK; j++) {
            float det = r[j] * x + r[room + j] * y + r[2 * room + j] * z;
            float u = r[3 * room + j] * x + r[4 * room + j] * y + r[5 * room + j] * z;
            float v = r[6 * room + j] * x + r[7 * room + j] * y + r[8 * room + j] * z;
            any |= (det > 1e-12f) & (u >= 0.0f) & (v >= 0.0f) & (u + v <= det) & (r[9 * room + j] < det * limit);
        }
        if (any)
            return 1;
    }
    return 0;
}

int fly_visible_samples(const struct samples *s, const struct occluders *o, const double *C, uint8_t *visible,
                uint8_t *outline)
{
    int64_t room = (o->triangles + BLOCK) / BLOCK * BLOCK, n, i;
    float *rows = malloc((size_t)(10 * room) * sizeof *rows);

    if (rows == NULL)
        return -1;
    n = prepared(o, C, room, rows);
    for (i = 0; i < s->n; i++) {
        double X[3];
        float D[3], length;
        int seen, k;
        outline_at(s, i, C, X);
        seen = facing(s, i, C, X);
        visible[i] = seen > 0 || s->faces[i] == 0;
        outline[i] = s->faces[i] == 0 || (s->faces[i] == 2 && seen == 1);
        if (!visible[i])
            continue;
        for (k = 0; k < 3; k++)
            D[k] = (float)(X[k] - C[k]);
        length = sqrtf(D[0] * D[0] + D[1] * D[1] + D[2] * D[2]);
        length = length > 1e-6f ? length : 1e-6f;
        /* a round member's own skin is as thick as itself */
        visible[i] = !hit(rows, room, n, D, (float)(1.0 - (SKIN + 1.5 * fabs(s->radius[i])) / (double)length));
    }
    free(rows);
    return 0;
}
