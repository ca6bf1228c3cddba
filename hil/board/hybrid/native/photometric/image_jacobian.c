/* What a pose does to the drawn picture, where groups of faces meet: motion_images.py (motion_images). */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "photometric/image_jacobian.h"

static void planes(const struct pose_motion *m, float *near)
{
    int64_t k;
    int j;

    memset(near, 0, 4 * sizeof *near);
    for (k = 0; k < m->faces; k++) {
        const double *n = m->normal + 3 * k;
        double c[3], d = m->offset[k];
        for (j = 0; j < 3; j++) {
            c[j] = n[0] * m->R[3 * j] + n[1] * m->R[3 * j + 1] + n[2] * m->R[3 * j + 2];
            d += c[j] * m->t[j];
        }
        for (j = 0; j < 3; j++)
            near[4 * (k + 1) + j] = fabs(d) > 1e-6 ? (float)(c[j] / d) : 0.0f;
        near[4 * (k + 1) + 3] = 0.0f;
    }
}

static inline const float *plane_of(const struct pose_motion *m, const struct rays *r, int32_t face)
{
    return r->near + 4 * (face < 0 ? 0 : face > m->faces ? m->faces : face);
}

static inline float depth_of(const float *n, float x, float y) { return n[0] * x + n[1] * y + n[2]; }

/* A border's derivatives, between two groups that meet across or down, at a ray. Numbers, not an array: what is
 * stored one by one is slow to read in one piece.
 */
struct part {
    float turn_x, turn_y, turn_z, x, y, z;
    int some; /* whether there are any */
};

static inline struct part moved(const struct pose_motion *m, const struct rays *r, const int across, float x, float y,
                                int32_t a, int32_t b, double change)
{
    const float *na = plane_of(m, r, a), *nb = plane_of(m, r, b);
    const float da = depth_of(na, x, y), db = depth_of(nb, x, y), inverse = da > db ? da : db;
    const float tx = (float)m->t[0], ty = (float)m->t[1], tz = (float)m->t[2];
    const float k = (float)(change * (double)inverse), own = across ? x : y;
    const float depth = 1.0f / inverse, X = x * depth - tx, Y = y * depth - ty, Z = depth - tz;
    struct part p;

    p.turn_x = (-own * Y - (across ? 0.0f : Z)) * k;
    p.turn_y = (own * X + (across ? Z : 0.0f)) * k;
    p.turn_z = (across ? -Y : X) * k;
    p.x = across ? k : 0.0f;
    p.y = across ? 0.0f : k;
    p.z = -own * k;
    /* faces seen from the edge have no depth that can be trusted */
    p.some = inverse > r->least && inverse < r->most;
    return p;
}

static inline void put(struct part p, float *cell)
{
    cell[0] += p.turn_x;
    cell[1] += p.turn_y;
    cell[2] += p.turn_z;
    cell[3] += p.x;
    cell[4] += p.y;
    cell[5] += p.z;
}

/* Whether eight drawn pixels from x on have the group of those on their right and below them. */
static int alike(const uint8_t *row, const uint8_t *below, int64_t x)
{
    uint64_t here, right, down;

    memcpy(&here, row + x, 8);
    memcpy(&right, row + x + 1, 8);
    memcpy(&down, below + x, 8);
    return here == right && here == down;
}

/* Brightness of a group where the background differs from its level by ground. */
static inline double light(const struct pose_motion *m, uint8_t group, double ground)
{
    return m->level[group] + (group == 0 ? ground : 0.0);
}

/* What a border on the right of drawn pixel x of a row makes, at the coordinate y of its ray. */
static void put_right(const struct pose_motion *m, const struct rays *r, const uint8_t *row, const int32_t *face,
                      int64_t x, float y, double ground, float *cell, uint8_t *any)
{
    const int64_t c = r->column[x];
    const int shared = r->end[x];
    const double change = light(m, row[x], ground) - light(m, row[x + 1], ground);
    const struct part part = moved(m, r, 1, r->between[x], y, face[x], face[x + 1],
                                   change * (shared ? 0.5 * r->across : r->across));

    if (!part.some)
        return;
    put(part, cell + WIDE * c);
    any[c] = 1;
    if (shared) {
        /* along the side of a patch pixel it lies half in the next one */
        put(part, cell + WIDE * (c + 1));
        any[c + 1] = 1;
    }
}

/* What a border below drawn pixel x of a row makes, at the coordinate y of its ray, of which share is asked for. */
static void put_below(const struct pose_motion *m, const struct rays *r, const uint8_t *row, const uint8_t *below,
                      const int32_t *face, const int32_t *face_below, int64_t x, float y, double share, double ground,
                      float *cell, uint8_t *any)
{
    const int64_t c = r->column[x];
    const double change = light(m, row[x], ground) - light(m, below[x], ground);
    const struct part part = moved(m, r, 0, r->x[x], y, face[x], face_below[x], change * share * r->down);

    if (!part.some)
        return;
    put(part, cell + WIDE * c);
    any[c] = 1;
}

void fly_jacobian_row(const struct pose_motion *m, const struct rays *r, struct drawing d, int64_t y, float *cell,
                    uint8_t *any)
{
    const int64_t wide = d.w * d.f, high = d.h * d.f, above = y * d.f - 1, last = (y + 1) * d.f - 1;
    int64_t x, k;

    /* from the row above, half of what lies along its lower side */
    for (k = above < 0 ? 0 : above; k <= last; k++) {
        const int64_t under = k + 1 < high ? wide : 0;
        const uint8_t *row = d.group + k * wide, *below = row + under;
        const int32_t *face = m->seen + k * wide;
        const float *behind = m->behind == NULL ? NULL : m->behind + (k == above ? y - 1 : y) * d.w;
        const float ray = (float)(m->v + m->step_v * (double)k);
        const float between = (float)(m->v + m->step_v * ((double)k + 0.5));
        const double share = k == above || k == last ? 0.5 : 1.0;
        for (x = 0; x < wide; x++) {
            while (x + 9 <= wide && alike(row, below, x))
                x += 8;
            if (x >= wide)
                break;
            const double ground = behind == NULL ? 0.0 : (double)behind[r->column[x]];
            if (k != above && x + 1 < wide && row[x] != row[x + 1])
                put_right(m, r, row, face, x, ray, ground, cell, any);
            if (row[x] != below[x])
                put_below(m, r, row, below, face, face + under, x, between, share, ground, cell, any);
        }
    }
}

float *fly_patch_rays(const struct pose_motion *m, struct drawing d, struct rays *r)
{
    const int64_t wide = d.w * d.f;
    float *block = malloc((size_t)(4 * (m->faces + 1) + 4 * wide) * sizeof *block);
    int64_t x;

    if (block == NULL)
        return NULL;
    r->near = block;
    r->x = block + 4 * (m->faces + 1);
    r->between = r->x + wide;
    r->column = (int32_t *)(void *)(r->between + wide);
    r->end = r->column + wide;
    r->across = 1.0 / ((double)(d.f * d.f) * m->step_u);
    r->down = 1.0 / ((double)(d.f * d.f) * m->step_v);
    r->least = 0.2 / m->t[2];
    r->most = 5.0 / m->t[2];
    planes(m, r->near);
    for (x = 0; x < wide; x++) {
        r->x[x] = (float)(m->u + m->step_u * (double)x);
        r->between[x] = (float)(m->u + m->step_u * ((double)x + 0.5));
        r->column[x] = (int32_t)(x / d.f);
        r->end[x] = (x + 1) % d.f == 0;
    }
    return block;
}

int64_t fly_image_jacobian(const struct pose_motion *m, const uint8_t *group, int64_t h, int64_t w, int64_t f,
                           float *out)
{
    const struct drawing d = {group, h, w, f};
    struct rays r;
    float *block = fly_patch_rays(m, d, &r), *cell = malloc((size_t)(WIDE * w) * sizeof *cell);
    uint8_t *any = calloc((size_t)w, 1);
    const int64_t done = block != NULL && cell != NULL && any != NULL ? 0 : -1;
    int64_t x, y, j;

    for (y = 0; done == 0 && y < h; y++) {
        memset(cell, 0, (size_t)(WIDE * w) * sizeof *cell);
        fly_jacobian_row(m, &r, d, y, cell, any);
        for (j = 0; j < 6; j++)
            for (x = 0; x < w; x++)
                out[(j * h + y) * w + x] = cell[WIDE * x + j];
    }
    free(block);
    free(cell);
    free(any);
    return done;
}
