/* What share of a pixel each group of faces covers: see cover.h. */
#include <stdlib.h>
#include <string.h>

#include "cover.h"

/* Groups in so many middles or fewer have no brightness of their own (levels.py, coverage). */
#define FEW 3

/* Shares that are no more are none (levels.py, coverage). */
#define LITTLE 2e-4f

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
        box[g] = (struct box){wide, d.h * d.f, 0, 0};
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
            b->x0 = start < b->x0 ? start : b->x0;
            b->x1 = x > b->x1 ? x : b->x1;
            b->y0 = y < b->y0 ? y : b->y0;
            b->y1 = y + 1;
        }
    }
    /* drawn pixels to canvas pixels */
    for (g = 0; g < 256; g++) {
        const struct box b = box[g];
        box[g] = b.y1 > 0 ? (struct box){b.x0 / d.f, b.y0 / d.f, (b.x1 - 1) / d.f + 1, (b.y1 - 1) / d.f + 1}
                          : (struct box){d.w, d.h, 0, 0};
    }
}

int64_t fly_choose(const uint8_t *centre, int64_t pixels, int64_t most, uint8_t *chosen)
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
            if (v > LITTLE) {
                c->share[c->n] = (struct share){v, c->last[i], (int32_t)slot};
                c->last[i] = (int32_t)c->n++;
            }
        }
    }
}

int fly_cover_rows(struct drawing d, const uint8_t *chosen, int64_t n, struct gauss g, const struct rows *rows,
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
