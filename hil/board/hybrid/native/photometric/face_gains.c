/* Brightness of the craft's faces, taken from the picture, and the picture drawn with it: face_gains.py (shade). */
#include <stdlib.h>
#include <string.h>

#include "photometric/robust_means.h"
#include "photometric/image_formation.h"

/* Groups with fewer pixels well inside are thin (face_gains.py, shade). */
#define THIN 3

/* Place of a drawn pixel's face in tables of faces + 1 entries. */
static inline int64_t held(int32_t face, int64_t faces) { return face < 0 ? 0 : face > faces ? faces : face; }

/* Drawn pixels side by side with one face and one shadow: the first of them, and their place in tables
 * (2, faces + 1), those in light first. They end where the next ones begin.
 */
struct stretch {
    int32_t start, place;
};

/* Pixels whose borders are found together. */
#define TOGETHER 512

/* What differs from the pixel before it, 1, to edge (n,). */
static void edges(const int32_t *seen, const uint8_t *dark, int64_t n, uint8_t *restrict edge)
{
    int64_t i;

    for (i = 0; i < n; i++)
        edge[i] = seen[i] != seen[i - 1];
    if (dark != NULL)
        for (i = 0; i < n; i++)
            edge[i] |= dark[i] != dark[i - 1];
}

/* Stretches of the drawn pixels, room for one each, and one more that begins after the last; how many. */
static int64_t stretches(const int32_t *seen, const uint8_t *dark, int64_t pixels, int64_t faces, struct stretch *out)
{
    uint8_t edge[TOGETHER];
    int64_t i, k, j, n = 0;

    out[n++].start = 0;
    for (i = 1; i < pixels; i += TOGETHER) {
        const int64_t some = pixels - i < TOGETHER ? pixels - i : TOGETHER;
        edges(seen + i, dark == NULL ? NULL : dark + i, some, edge);
        memset(edge + some, 0, (size_t)(TOGETHER - some));
        for (k = 0; k < some; k += 8) {
            uint64_t eight;
            memcpy(&eight, edge + k, 8);
            if (eight == 0)
                continue;
            /* what begins none is written over: nobody can tell beforehand which of them do */
            for (j = k; j < k + 8; j++) {
                out[n].start = (int32_t)(i + j);
                n += edge[j];
            }
        }
    }
    for (k = 0; k < n; k++) {
        const int32_t at = out[k].start;
        out[k].place = (int32_t)((dark != NULL && dark[at] ? faces + 1 : 0) + held(seen[at], faces));
    }
    out[n].start = (int32_t)pixels;
    return n;
}

/* Group of each face in light and in shadow, to (2, faces + 1); how many groups there are, 0 where a byte holds too
 * few. Where shadows are cast, or a byte would not hold all, those that are seen are numbered anew (face_gains.py,
 * _divided). new (2, groups) is scratch.
 */
static int64_t number(const struct stretch *stretch, int64_t stretches, int shadows, const uint16_t *labels,
                      int64_t faces, int64_t groups, uint8_t *new, uint8_t *to)
{
    int64_t i, n = 1;

    if (!shadows && groups <= LABELS) {
        for (i = 0; i <= faces; i++)
            to[i] = to[faces + 1 + i] = (uint8_t)labels[i];
        return groups;
    }
    memset(to, 0, (size_t)(2 * (faces + 1)));
    for (i = 0; i < stretches; i++)
        to[stretch[i].place] = 1;
    memset(new, 0, (size_t)(2 * groups));
    for (i = 0; i < 2 * (faces + 1); i++) {
        const int64_t label = labels[i <= faces ? i : i - faces - 1];
        if (to[i] && label > 0 && label < groups)
            new[(i <= faces ? 0 : groups) + label] = 1;
    }
    for (i = 0; i < 2 * groups; i++)
        n += new[i];
    if (n > LABELS)
        return 0;
    for (i = 0, n = 1; i < 2 * groups; i++)
        if (new[i])
            new[i] = (uint8_t)n++;
    for (i = 0; i < 2 * (faces + 1); i++) {
        const int64_t label = labels[i <= faces ? i : i - faces - 1];
        to[i] = label < groups ? new[(i <= faces ? 0 : groups) + label] : 0;
    }
    return n;
}

/* Groups (pixels,) of drawn pixels. */
static void relabel(const struct stretch *stretch, int64_t stretches, const uint8_t *to, int64_t pixels, uint8_t *group)
{
    int64_t i, k;

    for (k = 0; k < stretches; k++) {
        const uint8_t own = to[stretch[k].place];
        const uint64_t eight = 0x0101010101010101u * own;
        const int64_t end = stretch[k + 1].start;
        /* what is written beyond the end is written anew by the next */
        for (i = stretch[k].start; i < end && i + 8 <= pixels; i += 8)
            memcpy(group + i, &eight, 8);
        for (; i < end; i++)
            group[i] = own;
    }
}

/* Group at each pixel's middle, and whether its corners have the same; both (h, w). */
static void middles(struct drawing d, uint8_t *centre, uint8_t *solid)
{
    const int64_t wide = d.w * d.f, f = d.f, m = f / 2;
    int64_t x, y;

    for (y = 0; y < d.h; y++) {
        const uint8_t *top = d.group + y * f * wide, *end = top + (f - 1) * wide, *at = top + m * wide + m;
        uint8_t *c = centre + y * d.w, *s = solid + y * d.w;
        if (f == 2) {
            for (x = 0; x < d.w; x++) {
                const uint8_t g = end[2 * x + 1];
                c[x] = g;
                s[x] = (top[2 * x] == g) & (top[2 * x + 1] == g) & (end[2 * x] == g);
            }
            continue;
        }
        for (x = 0; x < d.w; x++) {
            const uint8_t g = at[x * f];
            const int64_t left = x * f, right = left + f - 1;
            c[x] = g;
            s[x] = (top[left] == g) & (top[right] == g) & (end[left] == g) & (end[right] == g);
        }
    }
}

/* Solid pixels with no border of groups on their right or below, and only such about them (3 x 3): core. What a pixel
 * counts for its face's brightness: kind, first it is scratch. All (h, w).
 */
static void cores(const uint8_t *centre, const uint8_t *solid, int64_t h, int64_t w, uint8_t *kind, uint8_t *core)
{
    int64_t x, y;

    for (y = 0; y < h; y++) {
        const uint8_t *c = centre + y * w, *below = y + 1 < h ? c + w : c, *s = solid + y * w;
        uint8_t *in = kind + y * w;
        for (x = 0; x + 1 < w; x++)
            in[x] = s[x] & (c[x] == c[x + 1]) & (c[x] == below[x]);
        in[w - 1] = s[w - 1] & (c[w - 1] == below[w - 1]);
    }
    for (y = 0; y < h; y++) {
        const uint8_t *b = kind + y * w, *a = y > 0 ? b - w : b, *c = y + 1 < h ? b + w : b;
        uint8_t *out = core + y * w;
        out[0] = a[0] & b[0] & c[0];
        for (x = 1; x < w; x++)
            out[x] = a[x] & b[x] & c[x] & a[x - 1] & b[x - 1] & c[x - 1];
        for (x = 0; x + 1 < w; x++)
            out[x] &= a[x + 1] & b[x + 1] & c[x + 1];
    }
    for (x = 0; x < h * w; x++)
        kind[x] = (uint8_t)(2 - solid[x] - core[x]);
}

/* A drawn pixel of a thin group: its group, and its patch pixel's place among those that hold any. */
struct piece {
    int32_t at;
    uint8_t own;
};

/* Canvas pixels (h w,) that hold pieces of thin groups, and the pieces; room for all. */
struct pieces {
    struct piece *piece;
    int32_t *cell;
    int64_t n, cells;
};

/* Picture (h, w) drawn with levels (256,): mean over each pixel's drawn ones; and the pieces of thin groups. */
static void paint(struct drawing d, const uint8_t *centre, const uint8_t *solid, const float *level,
                  const uint8_t *thin, float *picture, struct pieces *p)
{
    const int64_t f = d.f, wide = d.w * f;
    const float part = 1.0f / (float)(f * f);
    int64_t x, y, a, b;

    for (y = 0; y < d.h; y++) {
        const uint8_t *c = centre + y * d.w, *s = solid + y * d.w;
        for (x = 0; x < d.w; x++) {
            const uint8_t *from = d.group + y * f * wide + x * f;
            int some = 0;
            if (s[x] && f == 2) {
                picture[y * d.w + x] = level[c[x]];
                some = thin[c[x]];
            } else {
                float sum = 0.0f;
                for (b = 0; b < f; b++)
                    for (a = 0; a < f; a++) {
                        const uint8_t g = from[b * wide + a];
                        sum += level[g];
                        some |= thin[g];
                    }
                picture[y * d.w + x] = sum * part;
            }
            if (!some)
                continue;
            for (b = 0; b < f; b++)
                for (a = 0; a < f; a++)
                    if (thin[from[b * wide + a]]) {
                        p->piece[p->n].at = (int32_t)p->cells;
                        p->piece[p->n++].own = from[b * wide + a];
                    }
            p->cell[p->cells++] = (int32_t)(y * d.w + x);
        }
    }
}

/* Brightness of groups that fill no pixel: what is left of the picture there, over what they cover
 * (face_gains.py, _thin_levels). work (5 cells,) is scratch.
 */
static void thin_levels(const struct pieces *p, const float *gray, int64_t f, const struct response *r,
                        int64_t groups, double *level, float *picture, float *work)
{
    const double part = 1.0 / (double)(f * f);
    float *drawn = work, *shown = drawn + p->cells, *here = shown + p->cells;
    double covered[256] = {0}, step[256], change[256], *more = (double *)(void *)(here + p->cells + (p->cells & 1));
    int64_t i, g;
    int round;

    for (i = 0; i < p->cells; i++) {
        more[i] = 0;
        here[i] = gray[p->cell[i]];
        drawn[i] = picture[p->cell[i]];
    }
    for (i = 0; i < p->n; i++)
        more[p->piece[i].at] += part;
    for (i = 0; i < p->n; i++)
        covered[p->piece[i].own] += more[p->piece[i].at];
    for (round = 0; round < 2; round++) {
        memset(step, 0, sizeof step);
        fly_response(r, drawn, p->cells, shown, NULL);
        for (i = 0; i < p->n; i++) {
            const int64_t at = p->piece[i].at;
            step[p->piece[i].own] += (double)(here[at] - shown[at]);
        }
        for (g = 0; g < groups; g++) {
            /* what is not thin has no piece */
            const double after = level[g] + step[g] / (covered[g] + 2.0), top = 1.5 * r->full;
            const double new = after < 0 ? 0 : after > top ? top : after;
            change[g] = new - level[g];
            level[g] = new;
        }
        for (i = 0; i < p->cells; i++)
            more[i] = 0;
        for (i = 0; i < p->n; i++)
            more[p->piece[i].at] += change[p->piece[i].own];
        for (i = 0; i < p->cells; i++)
            drawn[i] += (float)(more[i] * part);
    }
    for (i = 0; i < p->cells; i++)
        picture[p->cell[i]] = drawn[i];
}

/* Scratch of fly_face_gains, one piece of memory. */
struct scratch {
    uint8_t *new, *to, *solid, *kind;
    float *value, *work;
    struct pieces pieces;
    struct stretch *stretch; /* where the pieces are later */
};

static void *laid_out(int64_t faces, int64_t groups, int64_t h, int64_t w, int64_t f, struct scratch *s)
{
    const size_t cells = (size_t)(h * w), to = (2 * (size_t)(faces + 1) + 7) & ~(size_t)7;
    const size_t wide = (cells + 8) * sizeof(double), drawn = (cells * (size_t)(f * f) + 1) * sizeof(struct piece);
    uint8_t *at = malloc(4 * wide + drawn + 2 * (size_t)groups + to + 2 * cells), *const block = at;

    if (at == NULL)
        return NULL;
    s->work = (float *)(void *)at;
    s->value = (float *)(void *)(at += 3 * wide);
    s->pieces.cell = (int32_t *)(void *)(at += wide / 2);
    s->pieces.piece = (struct piece *)(void *)(at += wide / 2);
    s->stretch = (struct stretch *)(void *)s->pieces.piece;
    s->pieces.n = s->pieces.cells = 0;
    s->new = at += drawn;
    s->to = at += 2 * groups;
    s->solid = at += to;
    s->kind = at + cells;
    return block;
}

int64_t fly_face_gains(const int32_t *seen, const uint8_t *dark, const uint16_t *labels, int64_t faces, int64_t groups,
                  const float *gray, int64_t h, int64_t w, int64_t f, double sigma, const struct response *r,
                  uint8_t *group, uint8_t *centre, uint8_t *core, float *picture, double *level, int64_t *area,
                  double *shown, float *empty)
{
    const struct drawing d = {group, h, w, f};
    struct scratch s;
    float single[256] = {0};
    uint8_t thin[256] = {0};
    void *block = laid_out(faces, groups, h, w, f, &s);
    int64_t n, g, count;

    if (block == NULL)
        return -1;
    if (h < 1 || w < 1 || f < 1) {
        free(block);
        return 0;
    }
    count = stretches(seen, dark, h * w * f * f, faces, s.stretch);
    n = number(s.stretch, count, dark != NULL, labels, faces, groups, s.new, s.to);
    if (n > 0) {
        relabel(s.stretch, count, s.to, h * w * f * f, group);
        middles(d, centre, s.solid);
        cores(centre, s.solid, h, w, s.kind, core);
        fly_robust_means(centre, s.kind, gray, h * w, n, sigma, level, area, s.value, (struct run *)(void *)s.work);
        *shown = level[0];
        for (g = 0; g < n; g++) {
            level[g] = fly_brightness(r, level[g]);
            single[g] = (float)level[g];
            thin[g] = area[g] < THIN;
        }
        paint(d, centre, s.solid, single, thin, picture, &s.pieces);
        if (s.pieces.n > 0)
            thin_levels(&s.pieces, gray, f, r, n, level, picture, s.work);
        if (empty != NULL)
            fly_pixel_share(d, 0, empty);
    }
    free(block);
    return n;
}
