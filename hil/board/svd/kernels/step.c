/* One Gauss-Newton step's normal equations: photometric.py (photo_step, _weights), levels.py (coverage). */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "motion.h"

/* Most groups with a brightness of their own, the background's among them, and those in so many middles or fewer
 * have none (levels.py, coverage).
 */
#define MOST 63
#define FEW 3

/* Least derivative that counts (photometric.py, photo_step). */
#define LEAST 1e-6f

/* Median of the size of normal noise of unit deviation, inverted (photometric.py, _weights). */
#define ROBUST 1.4826

/* Pixels whose products are summed in single precision, and what is summed side by side. */
#define BLOCK 512

/* Pixels that the pose moves, in the order of the picture: n of them, room for all. */
struct rows {
    float *d;       /* (n, WIDE) derivatives and residual */
    float *slope;   /* (n,) of what is shown by brightness */
    float *edge;    /* (n,) squared slope of the drawn picture [1 / px^2] */
    float *weight;  /* (n,) */
    int32_t *x;     /* (n,) */
    uint8_t *craft; /* (n,) whether a face is in its middle */
    int32_t *first; /* (h w + 1,) the first at or after each pixel of the canvas */
    int64_t n;
};

/* A row blurred across: cells (w, WIDE), and where hit (w,) they are not zero. */
struct across {
    float *cell;
    uint8_t *hit;
};

/* How a step looks at the pictures: see fly_step. */
struct look {
    const float *drawn, *slope, *gray; /* (h, w) */
    const uint8_t *centre;
    struct gauss optics;
};

/* The first place at or after this one that a line of numbers fills a register from. */
static float *aligned(float *a)
{
    const uintptr_t bytes = WIDE * sizeof *a;

    return (float *)(((uintptr_t)a + bytes - 1) / bytes * bytes);
}

static inline void add(float *restrict to, const float *restrict from, float k)
{
    int j;

    for (j = 0; j < WIDE; j++)
        to[j] += k * from[j];
}

/* A row of derivatives blurred across: few pixels have any, so each is spread to where it reaches. */
static void spread(const float *cell, const uint8_t *any, int64_t w, struct gauss g, struct across out)
{
    const int64_t r = g.reach;
    int64_t p, x;

    memset(out.cell, 0, (size_t)(WIDE * w) * sizeof *out.cell);
    memset(out.hit, 0, (size_t)w);
    for (p = -r; p < w + r; p++) {
        const int64_t from = p >= 0 && p < w ? p : fly_mirrored(p, w);
        const int64_t low = p - r > 0 ? p - r : 0, high = p + r < w - 1 ? p + r : w - 1;
        if (!any[from])
            continue;
        memset(out.hit + low, 1, (size_t)(high + 1 - low));
        for (x = low; x <= high; x++)
            add(out.cell + WIDE * x, cell + WIDE * from, g.taps[r + x - p]);
    }
}

/* Squared slope of a picture at a pixel by Sobel's masks. */
static float edge(const float *a, int64_t h, int64_t w, int64_t x, int64_t y)
{
    const float *up = a + fly_mirrored(y - 1, h) * w, *at = a + y * w, *down = a + fly_mirrored(y + 1, h) * w;
    const int64_t l = fly_mirrored(x - 1, w), r = fly_mirrored(x + 1, w);
    const float gx = 0.125f * ((up[r] - up[l]) + 2.0f * (at[r] - at[l]) + (down[r] - down[l]));
    const float gy = 0.125f * ((down[l] - up[l]) + 2.0f * (down[x] - up[x]) + (down[r] - up[r]));

    return gx * gx + gy * gy;
}

static inline float larger(float a, float b) { return a > b ? a : b; }

/* A pixel that the pose moves, its blurred derivatives in a (WIDE,). */
static inline void take(const struct look *v, struct drawing d, int64_t x, int64_t y, const float *a, struct rows *out)
{
    const int64_t at = y * d.w + x, n = out->n++;
    float *to = out->d + WIDE * n;
    int j;

    for (j = 0; j < WIDE; j++)
        to[j] = a[j];
    to[6] = v->gray[at] - v->drawn[at];
    out->slope[n] = v->slope == NULL ? 1.0f : v->slope[at];
    out->edge[n] = edge(v->drawn, d.h, d.w, x, y);
    out->craft[n] = v->centre[at] > 0;
    out->x[n] = (int32_t)x;
}

static inline void join(uint8_t *restrict to, const uint8_t *restrict from, int64_t n)
{
    int64_t x;

    for (x = 0; x < n; x++)
        to[x] |= from[x];
}

/* What the taps give of n rows' cells at one place. */
static inline void weigh(const float *const *cell, int64_t at, const float *taps, const int n, float *sum)
{
    int j, l;

    for (j = 0; j < n; j++)
        for (l = 0; l < WIDE; l++)
            sum[l] += taps[j] * cell[j][at + l];
}

/* Row y from the rows about it, blurred across already: its pixels whose derivatives count. hit (w,) is scratch. */
static void blurred_row(const struct across *ring, int64_t size, const struct look *v, struct drawing d,
                               int64_t y, uint8_t *hit, struct rows *out)
{
    const int64_t r = v->optics.reach;
    const float *cell[2 * WIDEST + 1];
    int64_t j, x;

    memset(hit, 0, (size_t)d.w);
    for (j = -r; j <= r; j++) {
        const struct across *row = ring + fly_mirrored(y + j, d.h) % size;
        cell[r + j] = row->cell;
        join(hit, row->hit, d.w);
    }
    for (x = 0; x < d.w; x++) {
        float sum[WIDE] = {0};
        out->first[y * d.w + x] = (int32_t)out->n;
        if (!hit[x])
            continue;
        /* a constant number of taps spares the ends of loops */
        if (r == 2)
            weigh(cell, WIDE * x, v->optics.taps, 5, sum);
        else if (r == 3)
            weigh(cell, WIDE * x, v->optics.taps, 7, sum);
        else if (r == 5)
            weigh(cell, WIDE * x, v->optics.taps, 11, sum);
        else
            weigh(cell, WIDE * x, v->optics.taps, (int)(2 * r + 1), sum);
        if (larger(larger(fabsf(sum[0]), fabsf(sum[1])), fabsf(sum[2])) > LEAST)
            take(v, d, x, y, sum, out);
    }
    out->first[(y + 1) * d.w] = (int32_t)out->n;
}

/* All pixels that the pose moves, row by row, so that what is blurred stays near; -1 where there is no memory. */
static int pixels_moved(const struct moving *m, struct drawing d, const struct look *v, struct rows *out)
{
    const int64_t r = v->optics.reach, size = d.h < 2 * r + 1 ? d.h : 2 * r + 1, line = WIDE * d.w;
    struct rays rays;
    float *block = fly_rays_of(m, d, &rays), *cells = malloc((size_t)(line * (size + 1) + WIDE) * sizeof *cells);
    uint8_t *any = malloc((size_t)((size + 2) * d.w)), *const hit = any + d.w;
    struct across *ring = malloc((size_t)size * sizeof *ring);
    const int ready = block != NULL && cells != NULL && ring != NULL && any != NULL;
    float *const own = aligned(cells);
    int64_t y, done = 0;

    for (y = 0; ready && y < size; y++) {
        ring[y].cell = own + line * (y + 1);
        ring[y].hit = hit + d.w * (y + 1);
    }
    for (y = 0; ready && y < d.h; y++) {
        memset(own, 0, (size_t)line * sizeof *own);
        memset(any, 0, (size_t)d.w);
        fly_moving_row(m, &rays, d, y, own, any);
        spread(own, any, d.w, v->optics, ring[y % size]);
        for (; done < d.h && (done + r <= y || y == d.h - 1); done++)
            blurred_row(ring, size, v, d, done, hit, out);
    }
    free(block);
    free(cells);
    free(any);
    free(ring);
    return ready ? 0 : -1;
}

/* The k-th of values (n,), least first, which it moves about. */
static float ranked(float *a, int64_t n, int64_t k)
{
    int64_t low = 0, high = n - 1;

    while (low < high) {
        const float pivot = a[low + (high - low) / 2];
        int64_t i = low, j = high;
        while (i <= j) {
            while (i <= high && a[i] < pivot)
                i++;
            while (j >= low && pivot < a[j])
                j--;
            if (i <= j) {
                const float swap = a[i];
                a[i++] = a[j];
                a[j--] = swap;
            }
        }
        if (k <= j)
            high = j;
        else if (k >= i)
            low = i;
        else
            break;
    }
    return a[k];
}

/* Weight of each residual: from its noise, how far borders may still be off (squared, slack), and Tukey's bound
 * (squared, tukey). sample (n,) is scratch. Returns the sum.
 */
static double weigh_rows(struct rows *rows, double noise, double slack, double tukey, float *sample)
{
    const float per_edge = (float)slack, quiet = (float)(noise * noise);
    float spread[2];
    double sum = 0;
    int64_t i, n;
    int part;

    for (part = 0; part < 2; part++) {
        int64_t taken = 0;
        n = 0;
        for (i = 0; i < rows->n; i++)
            if (rows->craft[i] == part && per_edge * rows->edge[i] < quiet) {
                /* every other one says enough */
                sample[n] = fabsf(rows->d[WIDE * i + 6]);
                n += !(taken++ & 1);
            }
        const double middle = n > 0 ? ROBUST * (double)ranked(sample, n, n / 2) : 0.0;
        const double deviation = middle > noise ? middle : noise;
        spread[part] = (float)(deviation * deviation);
    }
    for (i = 0; i < rows->n; i++) {
        const float e = rows->d[WIDE * i + 6], variance = spread[rows->craft[i]] + per_edge * rows->edge[i];
        const float inside = 1.0f - e * e / ((float)tukey * variance);
        rows->weight[i] = inside > 0 ? inside * inside / variance : 0.0f;
        sum += (double)rows->weight[i];
    }
    return sum;
}

/* Canvas pixels that hold a group: from (x0, y0), to before (x1, y1). */
struct box {
    int64_t x0, y0, x1, y1;
};

/* Where each group is (256,). */
static void boxes_of(struct drawing d, struct box *box)
{
    const int64_t wide = d.w * d.f;
    int64_t x, y, start;
    int g;

    for (g = 0; g < 256; g++)
        box[g] = (struct box){d.w, d.h, 0, 0};
    for (y = 0; y < d.h * d.f; y++) {
        const uint8_t *row = d.group + y * wide;
        for (x = 0; x < wide;) {
            const uint64_t same = 0x0101010101010101u * row[x];
            struct box *b = box + row[x];
            uint64_t eight;
            start = x++;
            while (x + 8 <= wide && (memcpy(&eight, row + x, 8), eight == same))
                x += 8;
            while (x < wide && row[x] == row[start])
                x++;
            b->x0 = start / d.f < b->x0 ? start / d.f : b->x0;
            b->x1 = (x - 1) / d.f + 1 > b->x1 ? (x - 1) / d.f + 1 : b->x1;
            b->y0 = y / d.f < b->y0 ? y / d.f : b->y0;
            b->y1 = y / d.f + 1;
        }
    }
}

/* The background and the groups that most middles have, at most most: their labels chosen (MOST,), how many. */
static int64_t choose(const uint8_t *centre, int64_t pixels, int64_t most, uint8_t *chosen)
{
    int64_t count[256] = {0}, i, start, n = 1;
    int g, best;

    for (i = 0; i < pixels;) {
        for (start = i++; i < pixels && centre[i] == centre[start]; i++)
            continue;
        count[centre[start]] += i - start;
    }
    chosen[0] = 0;
    while (n <= most && n < MOST) {
        for (g = 1, best = 0; g < 256; g++)
            if (count[g] > FEW && (best == 0 || count[g] > count[best]))
                best = g;
        if (best == 0)
            break;
        count[best] = 0;
        chosen[n++] = (uint8_t)best;
    }
    return n;
}

/* A share of a pixel that a chosen group covers, and the place of the pixel's share before, -1 where there is none. */
struct share {
    float value;
    int32_t before, slot;
};

/* Shares of all pixels (n,) by their last one's place. */
struct cover {
    struct share *share;
    int32_t *last; /* (n,) */
    int64_t n;
};

/* Drawn pixels of a group in each canvas pixel of a box, out (box's w wide). line (w,) is scratch. */
static void counted(struct drawing d, uint8_t group, struct box b, uint8_t *line, float *out)
{
    const int64_t wide = d.w * d.f, w = b.x1 - b.x0;
    int64_t x, y, k, j;

    for (y = b.y0; y < b.y1; y++, out += w) {
        memset(line, 0, (size_t)w);
        for (k = 0; k < d.f; k++) {
            const uint8_t *row = d.group + (y * d.f + k) * wide + b.x0 * d.f;
            if (d.f == 2)
                for (x = 0; x < w; x++)
                    line[x] = (uint8_t)(line[x] + (row[2 * x] == group) + (row[2 * x + 1] == group));
            else
                for (x = 0; x < w; x++)
                    for (j = 0; j < d.f; j++)
                        line[x] = (uint8_t)(line[x] + (row[d.f * x + j] == group));
        }
        for (x = 0; x < w; x++)
            out[x] = (float)line[x];
    }
}

/* A box wider by reach on all sides within the canvas, in whole lines of pixels where there is room. */
static struct box wider(struct box b, int64_t reach, struct drawing d)
{
    int64_t more;

    b.x0 = b.x0 > reach ? b.x0 - reach : 0;
    b.y0 = b.y0 > reach ? b.y0 - reach : 0;
    b.x1 = b.x1 + reach < d.w ? b.x1 + reach : d.w;
    b.y1 = b.y1 + reach < d.h ? b.y1 + reach : d.h;
    more = (WIDE - (b.x1 - b.x0) % WIDE) % WIDE;
    if (b.x1 + more <= d.w)
        b.x1 += more;
    else if (b.x0 >= more)
        b.x0 -= more;
    return b;
}

/* Shares of a group, the canvas's within a box (box's w wide), noted. */
static void note(const struct rows *rows, int64_t w, struct box b, const float *share, float part, int64_t slot, struct cover *c)
{
    int64_t y, i;

    for (y = b.y0; y < b.y1; y++) {
        const float *row = share + (y - b.y0) * (b.x1 - b.x0);
        for (i = rows->first[y * w + b.x0]; i < rows->first[y * w + b.x1]; i++) {
            const float v = row[rows->x[i] - b.x0] * part;
            if (v > 0) {
                c->share[c->n] = (struct share){v, c->last[i], (int32_t)slot};
                c->last[i] = (int32_t)c->n++;
            }
        }
    }
}

/* Shares of the chosen groups, blurred, each within its own box; -1 where there is no memory. */
static int cover_rows(struct drawing d, const uint8_t *chosen, int64_t n, struct gauss g, const struct rows *rows,
                      struct cover *c)
{
    /* one more than the blur reaches: what it mirrors at the box's edge is empty then */
    const int64_t reach = g.reach + 1, size = d.h * d.w;
    float *own = malloc((size_t)(3 * size + 2 * d.w + 2 * reach) * sizeof *own);
    float *blurred = own + size, *scratch = blurred + size, *line = scratch + size;
    struct box box[256];
    int64_t k, most = 0;

    boxes_of(d, box);
    for (k = 0; k < n; k++) {
        const struct box b = wider(box[chosen[k]], reach, d);
        if (b.y0 < b.y1)
            most += rows->first[b.y1 * d.w] - rows->first[b.y0 * d.w];
    }
    c->share = malloc((size_t)(most + 1) * sizeof *c->share);
    if (own == NULL || c->share == NULL || most > INT32_MAX) {
        free(own);
        return -1;
    }
    for (k = 0; k < rows->n; k++)
        c->last[k] = -1;
    for (k = 0; k < n; k++) {
        const struct box all = box[chosen[k]], b = wider(all, reach, d);
        const int64_t w = b.x1 - b.x0, h = b.y1 - b.y0;
        if (all.x0 >= all.x1 || rows->first[b.y0 * d.w] == rows->first[b.y1 * d.w])
            continue;
        const struct box full = {b.x0, all.y0, b.x1, all.y1};
        memset(own, 0, (size_t)(h * w) * sizeof *own);
        counted(d, chosen[k], full, (uint8_t *)line, own + (all.y0 - b.y0) * w);
        fly_blur_some(own, h, w, all.y0 - b.y0, all.y1 - b.y0, g, blurred, scratch, line);
        note(rows, d.w, b, blurred, 1.0f / (float)(d.f * d.f), k, c);
    }
    free(own);
    return 0;
}

/* Sums of products: of the six of the pose and the residual, of each brightness with these, of two brightnesses, of
 * which the first has the larger number.
 */
struct sums {
    float own[WIDE][WIDE], mixed[MOST][WIDE], levels[MOST][MOST + 1];
};

/* Products of the weighted rows from one to before another. Single numbers that a wide load would wait for are not
 * stored beside each other.
 */
static void add_rows(const struct rows *rows, const struct cover *c, int64_t from, int64_t to, struct sums *sum)
{
    static const float pose[WIDE] = {1, 1, 1, 1, 1, 1, 0, 0}, left[WIDE] = {0, 0, 0, 0, 0, 0, 1, 0};
    float own[7][WIDE] = {{0}}, share[MOST];
    int32_t slot[MOST], s;
    int64_t i;
    int j, k, m;

    for (i = from; i < to; i++) {
        const float *d = rows->d + WIDE * i, root = sqrtf(rows->weight[i]), scaled = root * rows->slope[i];
        float z[WIDE];
        if (!(rows->weight[i] > 0))
            continue;
        for (j = 0; j < WIDE; j++)
            z[j] = d[j] * (pose[j] * scaled + left[j] * root);
        for (k = 0; k < 7; k++) {
            const float one = d[k] * (k < 6 ? scaled : root);
            for (j = 0; j < WIDE; j++)
                own[k][j] += one * z[j];
        }
        for (s = c->last[i], k = 0; s >= 0; s = c->share[s].before, k++) {
            const float one = c->share[s].value * scaled;
            const int32_t at = c->share[s].slot;
            share[k] = one;
            slot[k] = at;
            for (j = 0; j < WIDE; j++)
                sum->mixed[at][j] += one * z[j];
            for (m = 0; m <= k; m++)
                sum->levels[slot[m]][at] += share[m] * one;
        }
    }
    memcpy(sum->own, own, sizeof own);
}

/* Products G (n + 7, n + 7) of the weighted rows: brightnesses, pose, residual; sum is scratch. */
static void products(const struct rows *rows, const struct cover *c, int64_t n, struct sums *sum, double *G)
{
    const int64_t side = n + 7;
    int64_t i, j, start;

    memset(G, 0, (size_t)(side * side) * sizeof *G);
    for (start = 0; start < rows->n; start += BLOCK) {
        const int64_t end = start + BLOCK < rows->n ? start + BLOCK : rows->n;
        memset(sum, 0, sizeof *sum);
        add_rows(rows, c, start, end, sum);
        for (i = 0; i < n; i++) {
            for (j = 0; j <= i; j++)
                G[i * side + j] += (double)sum->levels[i][j];
            for (j = 0; j < 7; j++)
                G[(n + j) * side + i] += (double)sum->mixed[i][j];
        }
        for (i = 0; i < 7; i++)
            for (j = 0; j <= i; j++)
                G[(n + i) * side + n + j] += (double)sum->own[i][j];
    }
    for (i = 0; i < side; i++)
        for (j = i + 1; j < side; j++)
            G[i * side + j] = G[j * side + i];
}

/* Memory of a step, freed whole. */
struct memory {
    struct rows rows;
    struct cover cover;
    struct sums *sums;
    float *shown, *slope, *drawn, *sample;
    void *block;
};

static int laid_out(int64_t h, int64_t w, struct memory *m)
{
    /* whole lines of each */
    const size_t n = ((size_t)(h * w) + WIDE - 1) / WIDE * WIDE, floats = (WIDE + 3 + 3 + 4) * n + 2 * WIDE;
    const size_t sums = sizeof(struct sums);
    uint8_t *block = malloc(floats * sizeof(float) + sums + n);
    float *at;

    m->block = block;
    m->cover.share = NULL;
    m->cover.n = m->rows.n = 0;
    if (block == NULL)
        return -1;
    m->rows.d = at = aligned((float *)(void *)block);
    m->rows.slope = at += WIDE * n;
    m->rows.edge = at += n;
    m->rows.weight = at += n;
    m->rows.x = (int32_t *)(void *)(at += n);
    m->cover.last = (int32_t *)(void *)(at += n);
    m->rows.first = (int32_t *)(void *)(at += n);
    m->shown = at += n + WIDE;
    m->slope = at += n;
    m->drawn = at += n;
    m->sample = at += n;
    m->sums = (struct sums *)(void *)(at + n);
    m->rows.craft = (uint8_t *)(m->sums + 1);
    return 0;
}

/* Normal matrix of a step's rows: brightnesses of groups, the six of the pose, and the residual.
 *
 * d's arrays : the craft drawn at the pose, m what moves it, centre (h, w) groups at middles, picture (h, w) drawn.
 * gray : (h, w) the picture through blur. optics : blur of the optics; both : it and blur together. noise : of gray
 * where it is blurred. slack, tukey : see weigh_rows. most : groups whose brightness is found.
 * Out: G (n + 7, n + 7) with room for MOST + 7, and sum of the weights.
 * Returns n + 1000 times the rows that count, -1 where there is no memory.
 */
int64_t fly_step(const struct moving *m, const uint8_t *group, const uint8_t *centre, const float *picture,
                 const float *gray, int64_t h, int64_t w, int64_t f, const struct response *r,
                 const struct gauss *optics, const struct gauss *blur, const struct gauss *both, double noise,
                 double slack, double tukey, int64_t most, double *G, double *weights)
{
    const struct drawing d = {group, h, w, f};
    struct memory s;
    uint8_t chosen[MOST];
    int64_t out = -1, n, i, counts = 0;

    *weights = 0;
    if (h < 1 || w < 1 || f < 1)
        return 0;
    if (laid_out(h, w, &s) != 0)
        return -1;
    const int flat = !(r->sigma > 0);
    struct look v = {s.drawn, flat ? NULL : s.sample, gray, centre, *both};
    if (fly_blur(picture, h, w, optics, s.drawn) != 0)
        goto end;
    fly_shown(r, s.drawn, h * w, s.shown, flat ? NULL : s.slope);
    if (fly_blur(s.shown, h, w, blur, s.drawn) != 0 || (!flat && fly_blur(s.slope, h, w, blur, s.sample) != 0))
        goto end;
    if (pixels_moved(m, d, &v, &s.rows) != 0)
        goto end;
    *weights = weigh_rows(&s.rows, noise, slack, tukey, s.shown);
    for (i = 0; i < s.rows.n; i++)
        counts += s.rows.weight[i] > 0;
    n = choose(centre, h * w, most, chosen);
    if (cover_rows(d, chosen, n, *both, &s.rows, &s.cover) != 0)
        goto end;
    products(&s.rows, &s.cover, n, s.sums, G);
    out = n + 1000 * counts;
end:
    free(s.cover.share);
    free(s.block);
    return out;
}
