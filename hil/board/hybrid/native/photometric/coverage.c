/* What share of a pixel each group of faces covers: see coverage.h. */
#include <stdlib.h>
#include <string.h>

#include "photometric/coverage.h"

/* Groups in so many middles or fewer have no brightness of their own (face_gains.py, coverage). */
#define FEW 3

/* Shares that are no more are none (face_gains.py, coverage). */
#define LITTLE 2e-4f

/* Columns of a patch's row, from one to before another: none where they are in no order. */
struct span {
    int32_t from, to;
};

static const struct span NONE = {INT32_MAX, 0};

/* The first place after i whose byte is another, n where there is none. */
static int64_t alike(const uint8_t *a, int64_t i, int64_t n)
{
    const uint8_t own = a[i];
    const uint64_t same = 0x0101010101010101u * own;
    uint64_t eight;

    for (i++; i + 8 <= n && (memcpy(&eight, a + i, 8), eight == same); i += 8)
        continue;
    while (i < n && a[i] == own)
        i++;
    return i;
}

/* Columns (n, h) of each patch row in which the chosen groups are. */
static void spans(struct drawing d, const uint8_t *chosen, int64_t n, struct span *span)
{
    const int64_t wide = d.w * d.f;
    struct span *of[256] = {NULL};
    int64_t x, y, k, start;

    for (k = 0; k < n * d.h; k++)
        span[k] = NONE;
    for (k = 0; k < n; k++)
        of[chosen[k]] = span + k * d.h;
    for (y = 0; y < d.h * d.f; y++) {
        const uint8_t *row = d.group + y * wide;
        for (x = 0; x < wide;) {
            struct span *s = of[row[x]];
            start = x;
            x = alike(row, x, wide);
            if (s == NULL)
                continue;
            /* drawn pixels */
            s += y / d.f;
            s->from = start < s->from ? (int32_t)start : s->from;
            s->to = x > s->to ? (int32_t)x : s->to;
        }
    }
    for (k = 0; k < n * d.h; k++) {
        span[k].from = span[k].from == INT32_MAX ? INT32_MAX : span[k].from / (int32_t)d.f;
        span[k].to = (span[k].to + (int32_t)d.f - 1) / (int32_t)d.f;
    }
}

int64_t fly_choose_groups(const uint8_t *centre, int64_t pixels, int64_t most, uint8_t *chosen)
{
    int64_t count[256] = {0}, i, start, n = 1;
    int some[256], labels = 0, g, best;

    for (i = 0; i < pixels;) {
        start = i;
        i = alike(centre, i, pixels);
        count[centre[start]] += i - start;
    }
    for (g = 1; g < 256; g++)
        if (count[g] > FEW)
            some[labels++] = g;
    chosen[0] = 0;
    for (; n <= most && n < MOST && n <= labels; n++) {
        for (g = 0, best = 0; g < labels; g++)
            best = count[some[g]] > count[some[best]] ? g : best;
        count[some[best]] = 0;
        chosen[n] = (uint8_t)some[best];
    }
    return n;
}

static inline struct span both(struct span a, struct span b)
{
    return (struct span){a.from > b.from ? a.from : b.from, a.to < b.to ? a.to : b.to};
}

/* out (h,) from row top to before end = what the spans of rows there no farther than reach cover with all between.
 * work (h + 2 reach,) is scratch: what covers some rows from each on covers twice as many with what begins after them.
 */
static void about(const struct span *in, int64_t top, int64_t end, int64_t reach, struct span *work, struct span *out)
{
    const int64_t n = end - top + 2 * reach;
    int64_t k, some, more;

    for (k = 0; k < reach; k++)
        work[k] = work[n - 1 - k] = NONE;
    memcpy(work + reach, in + top, (size_t)(end - top) * sizeof *work);
    for (some = 1; some < 2 * reach + 1; some += more) {
        more = some < 2 * reach + 1 - some ? some : 2 * reach + 1 - some;
        for (k = 0; k + more < n; k++) {
            const struct span next = work[k + more];
            work[k].from = next.from < work[k].from ? next.from : work[k].from;
            work[k].to = next.to > work[k].to ? next.to : work[k].to;
        }
    }
    memcpy(out + top, work, (size_t)(end - top) * sizeof *work);
}

/* Whole lines of numbers about a span, on rows w wide. */
static struct span lines(struct span s, int64_t w)
{
    const int32_t to = (s.to + WIDE - 1) / WIDE * WIDE;

    return (struct span){s.from / WIDE * WIDE, to < w ? to : (int32_t)w};
}

/* Drawn pixels of a group in the patch pixels s of row y, into out (w,). count (w,) is scratch. */
static void counted(struct drawing d, uint8_t group, int64_t y, struct span s, uint8_t *restrict count,
                    float *restrict out)
{
    const int64_t wide = d.w * d.f, n = s.to - s.from;
    const uint8_t *row = d.group + y * d.f * wide + s.from * d.f, *next = row + wide;
    int64_t x, k, j;

    if (d.f == 2)
        for (x = 0; x < n; x++)
            count[x] = (uint8_t)((row[2 * x] == group) + (row[2 * x + 1] == group) + (next[2 * x] == group)
                                 + (next[2 * x + 1] == group));
    else
        for (x = 0; x < n; x++)
            for (count[x] = 0, k = 0; k < d.f; k++)
                for (j = 0; j < d.f; j++)
                    count[x] = (uint8_t)(count[x] + (row[k * wide + d.f * x + j] == group));
    for (x = 0; x < n; x++)
        out[s.from + x] = (float)count[x];
}

/* Scratch of a group's shares: see fly_coverage_rows. */
struct scratch {
    struct span *hold, *reached, *asked, *needed; /* (h,) */
    struct span *work;                            /* (h + 2 reach,) */
    float *part;                                  /* (h, w) blurred across */
    float *line, *nothing, *row;                  /* (w + 2 reach,), of zeros (w,), (w,) */
    uint8_t *count;                               /* (w,) */
};

/* A share of row, noted while they are group by group. */
struct noted {
    float value;
    int32_t row;
};

/* Row y of a group blurred across: columns to of part, where the group is in those of hold. */
static void across(struct drawing d, uint8_t group, int64_t y, struct span hold, struct span to,
                   const struct gaussian *g,
                   const struct scratch *s)
{
    const int64_t r = g->reach, w = d.w;
    const float *p[2 * WIDEST + 1];
    float *own = s->line + r;
    int64_t x;

    memset(s->line, 0, (size_t)(w + 2 * r) * sizeof *s->line);
    counted(d, group, y, hold, s->count, own);
    for (x = 1; x <= r && hold.from <= r; x++)
        own[-x] = own[fly_reflect_101(-x, w)];
    for (x = 1; x <= r && hold.to >= w - r; x++)
        own[w - 1 + x] = own[fly_reflect_101(w - 1 + x, w)];
    for (x = 0; x <= 2 * r; x++)
        p[x] = s->line + to.from + x;
    fly_convolve_lines(p, g, s->part + y * w + to.from, to.to - to.from);
}

/* Shares of a group, which is in the columns span of each row, noted; where no row of pixels is, none is worked out. */
static struct noted *note(struct drawing d, uint8_t group, const struct span *span, const struct gaussian *g,
                          const struct rows *rows, const struct scratch *s, int32_t *count, struct noted *to)
{
    const float part = 1.0f / (float)(d.f * d.f);
    const int64_t r = g->reach, w = d.w;
    const float *p[2 * WIDEST + 1];
    struct span all = NONE;
    int64_t top = 0, end = d.h, y, j, i;

    while (top < end && span[top].from >= span[top].to)
        top++;
    while (top < end && span[end - 1].from >= span[end - 1].to)
        end--;
    if (top == end)
        return to;
    top = top > r ? top - r : 0;
    end = end + r < d.h ? end + r : d.h;
    for (y = top; y < end; y++) {
        const struct span h = span[y];
        s->hold[y] = NONE;
        if (h.from < h.to) {
            s->hold[y].from = h.from > r ? h.from - (int32_t)r : 0;
            s->hold[y].to = h.to + r < w ? h.to + (int32_t)r : (int32_t)w;
        }
        all.from = s->hold[y].from < all.from ? s->hold[y].from : all.from;
        all.to = s->hold[y].to > all.to ? s->hold[y].to : all.to;
    }
    about(s->hold, top, end, r, s->work, s->reached);
    for (y = top; y < end; y++) {
        const int32_t first = rows->first[y * w], last = rows->first[(y + 1) * w];
        s->asked[y] = NONE;
        if (first < last)
            s->asked[y] = both((struct span){rows->x[first], rows->x[last - 1] + 1}, s->reached[y]);
        if (s->asked[y].from >= s->asked[y].to)
            s->asked[y] = NONE;
    }
    about(s->asked, top, end, r, s->work, s->needed);
    all = lines(all, w);
    for (y = top; y < end; y++) {
        const struct span here = both(s->hold[y], s->needed[y]);
        s->needed[y] = here;
        if (here.from >= here.to)
            continue;
        memset(s->part + y * w + all.from, 0, (size_t)(all.to - all.from) * sizeof *s->part);
        across(d, group, y, span[y], lines(here, w), g, s);
    }
    for (y = top; y < end; y++) {
        const struct span a = s->asked[y];
        if (a.from >= a.to)
            continue;
        const struct span all_of = lines(a, w);
        for (j = -r; j <= r; j++) {
            const int64_t from = y + j >= 0 && y + j < d.h ? y + j : fly_reflect_101(y + j, d.h);
            const int some = from >= top && from < end && s->needed[from].from < s->needed[from].to;
            p[r + j] = some ? s->part + from * w + all_of.from : s->nothing;
        }
        fly_convolve_lines(p, g, s->row + all_of.from, all_of.to - all_of.from);
        for (i = rows->first[y * w + a.from]; i < rows->first[y * w + a.to]; i++) {
            const float v = s->row[rows->x[i]] * part;
            const int counts = v > LITTLE;
            /* what does not count is written over */
            *to = (struct noted){v, (int32_t)i};
            to += counts;
            count[i] += counts;
        }
    }
    return to;
}

/* Scratch in one piece of memory, to be freed. */
static void *laid_out(struct drawing d, int64_t reach, struct scratch *s)
{
    const size_t h = (size_t)d.h, w = (size_t)d.w, floats = h * w + (w + 2 * (size_t)reach) + 2 * w;
    void *block = malloc((5 * h + 2 * (size_t)reach) * sizeof *s->hold + floats * sizeof(float) + w);

    if (block == NULL)
        return NULL;
    s->hold = block;
    s->reached = s->hold + h;
    s->asked = s->reached + h;
    s->needed = s->asked + h;
    s->work = s->needed + h;
    s->part = (float *)(void *)(s->work + h + 2 * reach);
    s->line = s->part + h * w;
    s->nothing = s->line + w + 2 * reach;
    s->row = s->nothing + w;
    s->count = (uint8_t *)(void *)(s->row + w);
    memset(s->nothing, 0, w * sizeof *s->nothing);
    return block;
}

int fly_coverage_rows(struct drawing d, const uint8_t *chosen, int64_t n, struct gaussian g, const struct rows *rows,
                   struct group_coverage *c)
{
    struct scratch s;
    void *block = laid_out(d, g.reach, &s);
    struct span *span = malloc((size_t)(n * d.h) * sizeof *span);
    /* no more than all groups in all rows, of which few are ever written */
    struct noted *noted = malloc((size_t)(n * rows->n + 1) * sizeof *noted), *end = noted;
    int64_t i, k, sum = 0, ends[MOST] = {0};

    c->share = NULL;
    if (block == NULL || span == NULL || noted == NULL || n * rows->n > INT32_MAX)
        goto end;
    spans(d, chosen, n, span);
    memset(c->first, 0, (size_t)(rows->n + 1) * sizeof *c->first);
    for (k = 0; k < n; k++) {
        end = note(d, chosen[k], span + k * d.h, &g, rows, &s, c->first, end);
        ends[k] = end - noted;
    }
    c->share = malloc((size_t)(end - noted + 1) * sizeof *c->share);
    if (c->share == NULL)
        goto end;
    /* row by row: where each begins, which moves to where it ends while it is filled */
    for (i = 0; i <= rows->n; i++) {
        const int32_t some = i < rows->n ? c->first[i] : 0;
        c->first[i] = (int32_t)sum;
        sum += some;
    }
    for (i = 0, k = 0; k < n; k++)
        for (; i < ends[k]; i++)
            c->share[c->first[noted[i].row]++] = (struct share){noted[i].value, (int32_t)k};
    for (i = rows->n; i > 0; i--)
        c->first[i] = c->first[i - 1];
    c->first[0] = 0;
end:
    free(block);
    free(span);
    free(noted);
    return c->share == NULL ? -1 : 0;
}
