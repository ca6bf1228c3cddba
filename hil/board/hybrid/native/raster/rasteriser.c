/* Faces painted over each other, the farthest first: rasteriser.py. */
#include <math.h>
#include <stdlib.h>

#include "kernels.h"

/* rasteriser.py's BORDER_PX and NARROW_PX [px], and where coordinates end [px] */
#define BORDER 0.48
#define NARROW 1.2
#define FAR_PX 3000.0

/* Sixteenths of a pixel per pixel, and the 16 binary places that OpenCV walks with. */
#define FINER 16
#define ONE 65536

struct picture {
    int32_t *seen; /* (h, w) */
    int64_t h, w;
};

struct point {
    int64_t x, y;
};

/* Quotient towards zero; exact for |a| < 2^53, and a third of the time of a whole division. */
static int64_t ratio(int64_t a, int64_t b)
{
    return (int64_t)((double)a / (double)b);
}

/* Nearest whole number, halves to even as numpy's rint, for |x| < 2^51. */
static double nearest(double x)
{
    const double shift = 6755399441055744.0; /* 1.5 * 2^52 */
    double sum = x + shift;
    return sum - shift;
}

static double greater(double a, double b) { return a > b ? a : b; }

static double magnitude(int64_t a) { return a < 0 ? -(double)a : (double)a; }

/* Which sides of the picture a point lies beyond: left 1, right 2, above 4, below 8. */
static int beyond(struct point p, int64_t right, int64_t bottom)
{
    return (p.x < 0) + (p.x > right) * 2 + (p.y < 0) * 4 + (p.y > bottom) * 8;
}

/* A line's ends moved to the picture's border, rows first as OpenCV does; 0 where nothing is left of it. */
static int clipped(struct point *a, struct point *b, int64_t right, int64_t bottom)
{
    int ca = beyond(*a, right, bottom), cb = beyond(*b, right, bottom);
    struct point *ends[2] = {a, b};
    int codes[2] = {ca, cb};
    int k;

    if ((ca & cb) != 0)
        return 0;
    for (k = 0; k < 2; k++) {
        struct point *p = ends[k];
        if (codes[k] & 12) {
            int64_t y = codes[k] < 8 ? 0 : bottom;
            p->x += (int64_t)((double)(y - p->y) * (double)(b->x - a->x) / (double)(b->y - a->y));
            p->y = y;
            codes[k] = (p->x < 0) + (p->x > right) * 2;
        }
    }
    if ((codes[0] & codes[1]) != 0)
        return 0;
    for (k = 0; k < 2; k++) {
        struct point *p = ends[k];
        if (codes[k]) {
            int64_t x = codes[k] == 1 ? 0 : right;
            p->y += (int64_t)((double)(x - p->x) * (double)(b->y - a->y) / (double)(b->x - a->x));
            p->x = x;
        }
    }
    return 1;
}

static void put(const struct picture *out, int64_t x, int64_t y, int32_t number)
{
    if (x >= 0 && x < out->w && y >= 0 && y < out->h)
        out->seen[y * out->w + x] = number;
}

/* A line one pixel wide between points of 16 binary places: the pixels that OpenCV fills on a polygon's border.
 *
 * inside : whether all of it lies a pixel within the picture, so that nothing needs to be asked.
 */
static void line(const struct picture *out, struct point a, struct point b, int inside, int32_t number)
{
    int64_t dx, dy, step, count, along, aside;
    int flat;

    if (!inside && !clipped(&a, &b, out->w * ONE - 1, out->h * ONE - 1))
        return;
    dx = b.x - a.x;
    dy = b.y - a.y;
    flat = magnitude(dx) > magnitude(dy);
    if ((flat ? dx : dy) < 0) {
        struct point swapped = a;
        a = b, b = swapped;
        dx = -dx, dy = -dy;
    }
    step = flat ? ratio(dy * ONE, dx | 1) : ratio(dx * ONE, dy | 1);
    count = (flat ? dx : dy) >> 16;
    along = ((flat ? a.x : a.y) + ONE / 2) >> 16;
    aside = (flat ? a.y : a.x) + ONE / 2;
    put(out, (b.x + ONE / 2) >> 16, (b.y + ONE / 2) >> 16, number);
    if (inside) {
        int32_t *at = out->seen + (flat ? along : along * out->w);
        if (flat)
            for (; count >= 0; count--, at++, aside += step)
                at[(aside >> 16) * out->w] = number;
        else
            for (; count >= 0; count--, at += out->w, aside += step)
                at[aside >> 16] = number;
        return;
    }
    for (; count >= 0; count--, along++, aside += step)
        put(out, flat ? along : aside >> 16, flat ? aside >> 16 : along, number);
}

/* One of the two sides that a convex polygon is filled between. */
struct side {
    int at, turn;  /* corner that it comes from, and how to the next */
    int64_t x, dx; /* [2^-16 px], and per row */
    int64_t until; /* row where its next corner is reached */
};

/* A convex polygon filled with its border, to the pixel as cv2.fillConvexPoly(..., LINE_8, shift=4).
 *
 * v : (4,) corners [px / 16].
 */
static void fill(const struct picture *out, const struct point *v, int32_t number)
{
    struct side side[2];
    int64_t top, bottom, left, right, y;
    int k, i, highest = 0, edges = 4, inside;

    left = right = v[0].x;
    top = bottom = v[0].y;
    for (k = 1; k < 4; k++) {
        if (v[k].y < top)
            top = v[k].y, highest = k;
        bottom = v[k].y > bottom ? v[k].y : bottom;
        left = v[k].x < left ? v[k].x : left;
        right = v[k].x > right ? v[k].x : right;
    }
    /* whatever lies beside the picture is seen in no pixel of it */
    if (right + 2 * FINER < 0 || bottom + 2 * FINER < 0 || left > (out->w + 1) * FINER ||
        top > (out->h + 1) * FINER)
        return;
    inside = left >= FINER && top >= FINER && right < (out->w - 1) * FINER && bottom < (out->h - 1) * FINER;
    for (k = 0; k < 4; k++) {
        struct point a = {v[(k + 3) & 3].x * (ONE / FINER), v[(k + 3) & 3].y * (ONE / FINER)};
        struct point b = {v[k].x * (ONE / FINER), v[k].y * (ONE / FINER)};
        /* a corner that is there twice is drawn by the lines that meet in it */
        if (k == 0 || a.x != b.x || a.y != b.y)
            line(out, a, b, inside, number);
    }
    left = (left + FINER / 2) >> 4;
    right = (right + FINER / 2) >> 4;
    top = (top + FINER / 2) >> 4;
    bottom = (bottom + FINER / 2) >> 4;
    if (right < 0 || bottom < 0 || left >= out->w || top >= out->h)
        return;
    bottom = bottom < out->h - 1 ? bottom : out->h - 1;
    for (i = 0; i < 2; i++) {
        side[i].at = highest;
        side[i].turn = i == 0 ? 1 : 3;
        side[i].x = -ONE;
        side[i].dx = 0;
        side[i].until = top;
    }
    for (y = top; y <= bottom; y++) {
        for (i = 0; i < 2; i++) {
            struct side *s = &side[i];
            int from = s->at, to = (s->at + s->turn) & 3;
            if (y < s->until)
                continue;
            while (edges > 0) {
                int64_t row = (v[to].y + FINER / 2) >> 4;
                edges--;
                if (row > y) {
                    s->until = row;
                    s->x = v[from].x * (ONE / FINER);
                    s->dx = ratio((v[to].x - v[from].x) * (2 * ONE / FINER) + (row - y), 2 * (row - y));
                    s->at = to;
                    break;
                }
                from = to;
                to = (to + s->turn) & 3;
            }
            /* no corner is left: the border has been drawn */
            if (y >= s->until)
                return;
        }
        if (y >= 0) {
            int64_t x0 = side[0].x < side[1].x ? side[0].x : side[1].x;
            int64_t x1 = side[0].x < side[1].x ? side[1].x : side[0].x;
            int32_t *row = out->seen + y * out->w;
            x0 = (x0 + ONE / 2) >> 16;
            x1 = (x1 + ONE / 2) >> 16;
            x0 = x0 > 0 ? x0 : 0;
            x1 = x1 < out->w ? x1 : out->w - 1;
            for (; x0 <= x1; x0++)
                row[x0] = number;
        }
        side[0].x += side[0].dx;
        side[1].x += side[1].dx;
    }
}

/* Polygons that are worked on together, corner by corner, so that a compiler may use what computes several at once. */
#define BLOCK 64

struct block {
    double x[4][BLOCK], y[4][BLOCK]; /* [drawn px] */
    int32_t number[BLOCK];
    int64_t n;
};

/* Those of more than ``least`` [px^2] alone, in their order. */
static void keep_worth(struct block *b, double least)
{
    uint8_t worth[BLOCK];
    int64_t i, n = 0;
    int k;

    for (i = 0; i < b->n; i++) {
        double d1x = b->x[2][i] - b->x[0][i], d1y = b->y[2][i] - b->y[0][i];
        double d2x = b->x[3][i] - b->x[1][i], d2y = b->y[3][i] - b->y[1][i];
        worth[i] = fabs(d1x * d2y - d1y * d2x) > 2.0 * least;
    }
    for (i = 0; i < b->n; i++) {
        if (!worth[i])
            continue;
        for (k = 0; k < 4; k++) {
            b->x[k][n] = b->x[k][i];
            b->y[k][n] = b->y[k][i];
        }
        b->number[n++] = b->number[i];
    }
    b->n = n;
}

/* rasteriser.py's ``shortened`` for polygon i: what is narrower than a pixel gets its true area. */
static void shorten(struct block *b, int64_t i)
{
    double ax = b->x[2][i] - b->x[0][i], ay = b->y[2][i] - b->y[0][i];
    double bx = b->x[3][i] - b->x[1][i], by = b->y[3][i] - b->y[1][i];
    double first = ax * ax + ay * ay, second = bx * bx + by * by;
    double squared = greater(greater(first, second), 1e-12);
    double area = 0.5 * fabs(ax * by - ay * bx);
    double length, width, ux, uy, share, along[4], middle;
    int k;

    if (!(area * area < NARROW * NARROW * squared))
        return;
    length = sqrt(squared);
    width = area / length;
    ux = (first > second ? ax : bx) / length;
    uy = (first > second ? ay : by) / length;
    share = width / (0.98 + 0.19 * width) - 1.0;
    for (k = 0; k < 4; k++)
        along[k] = b->x[k][i] * ux + b->y[k][i] * uy;
    middle = 0.25 * (along[0] + along[1] + along[2] + along[3]);
    for (k = 0; k < 4; k++) {
        double away = share * (along[k] - middle);
        b->x[k][i] += away * ux;
        b->y[k][i] += away * uy;
    }
}

/* rasteriser.py's ``inset``: smaller by what a filled border adds. */
static void draw_in(struct block *b)
{
    /* unit normals to the left of each side, and of the side before each corner */
    double ax[4][BLOCK], ay[4][BLOCK], bx[4][BLOCK], by[4][BLOCK], around[BLOCK] = {0}, far[BLOCK];
    int64_t i, n = b->n;
    int k;

    for (k = 0; k < 4; k++) {
        const double *x0 = b->x[k], *y0 = b->y[k], *x1 = b->x[(k + 1) & 3], *y1 = b->y[(k + 1) & 3];
        for (i = 0; i < n; i++) {
            double ex = x1[i] - x0[i], ey = y1[i] - y0[i], squared = ex * ex + ey * ey;
            double length = sqrt(squared), scale = 1.0 / greater(length, 1e-9);
            around[i] += length;
            ax[k][i] = -ey * scale;
            ay[k][i] = ex * scale;
        }
    }
    for (k = 0; k < 4; k++)
        for (i = 0; i < n; i++) {
            bx[k][i] = ax[(k + 3) & 3][i];
            by[k][i] = ay[(k + 3) & 3][i];
        }
    for (i = 0; i < n; i++) {
        /* a triangle's last corner is there twice: its two sides are the ones before and after both */
        double ex = b->x[3][i] - b->x[2][i], ey = b->y[3][i] - b->y[2][i];
        int three = ex * ex + ey * ey < 1e-12;
        double d1x = b->x[2][i] - b->x[0][i], d1y = b->y[2][i] - b->y[0][i];
        double d2x = b->x[3][i] - b->x[1][i], d2y = b->y[3][i] - b->y[1][i], twice = d1x * d2y - d1y * d2x;
        double deep = 0.4 * fabs(twice) / greater(around[i], 1e-9);
        bx[3][i] = three ? ax[1][i] : bx[3][i];
        by[3][i] = three ? ay[1][i] : by[3][i];
        ax[2][i] = three ? ax[3][i] : ax[2][i];
        ay[2][i] = three ? ay[3][i] : ay[2][i];
        deep = BORDER < deep ? BORDER : deep;
        far[i] = twice < 0.0 ? -deep : twice > 0.0 ? deep : 0.0;
    }
    for (k = 0; k < 4; k++)
        for (i = 0; i < n; i++) {
            double share = far[i] / greater(1.0 + ax[k][i] * bx[k][i] + ay[k][i] * by[k][i], 0.3);
            b->x[k][i] += (ax[k][i] + bx[k][i]) * share;
            b->y[k][i] += (ay[k][i] + by[k][i]) * share;
        }
}

/* A coordinate in sixteenths of a pixel; NaN becomes the nearest end. */
static double sixteenths(double a)
{
    a = a > -FAR_PX ? a : -FAR_PX;
    a = a < FAR_PX ? a : FAR_PX;
    return nearest(16.0 * a);
}

/* The polygons painted in their order, as rasteriser.py's fill_faces does. */
static void paint(const struct picture *out, struct block *b, double least, int exact)
{
    double u[4][BLOCK], v[4][BLOCK];
    uint8_t bad[BLOCK] = {0};
    int64_t i;
    int k;

    keep_worth(b, least);
    if (exact)
        for (i = 0; i < b->n; i++)
            shorten(b, i);
    draw_in(b);
    for (k = 0; k < 4; k++)
        for (i = 0; i < b->n; i++) {
            bad[i] |= !(b->x[k][i] == b->x[k][i] && b->y[k][i] == b->y[k][i]);
            u[k][i] = sixteenths(b->x[k][i]);
            v[k][i] = sixteenths(b->y[k][i]);
        }
    for (i = 0; i < b->n; i++) {
        struct point corner[4];
        if (bad[i])
            continue;
        for (k = 0; k < 4; k++) {
            corner[k].x = (int64_t)u[k][i];
            corner[k].y = (int64_t)v[k][i];
        }
        fill(out, corner, b->number[i]);
    }
}

void fly_fill_faces(const double *p, const int64_t *order, int64_t n, double least, int exact, int32_t *seen,
                    int64_t h, int64_t w)
{
    struct picture out = {seen, h, w};
    struct block b;
    int64_t begin, i;
    int k;

    for (begin = 0; begin < n; begin += BLOCK) {
        b.n = n - begin < BLOCK ? n - begin : BLOCK;
        for (i = 0; i < b.n; i++) {
            b.number[i] = (int32_t)(order[begin + i] + 1);
            for (k = 0; k < 4; k++) {
                b.x[k][i] = p[8 * (begin + i) + 2 * k];
                b.y[k][i] = p[8 * (begin + i) + 2 * k + 1];
            }
        }
        paint(&out, &b, least, exact);
    }
}

/* Points c (3, n) of the craft on the picture: x and y (n,) [drawn px]. Depth is kept away from zero as model.py's
 * ``pixels`` does.
 */
static void project(const double c[3][BLOCK], int64_t n, const double *R, const double *t, const struct view *view,
                    double *restrict px, double *restrict py)
{
    const double r0 = R[0], r1 = R[1], r2 = R[2], r3 = R[3], r4 = R[4], r5 = R[5], r6 = R[6], r7 = R[7], r8 = R[8];
    const double t0 = t[0], t1 = t[1], t2 = t[2], fx = view->fx, fy = view->fy, cx = view->cx, cy = view->cy;
    const double x0 = view->x0, y0 = view->y0, across = view->across, down = view->down;
    int64_t i;

    for (i = 0; i < n; i++) {
        double x = r0 * c[0][i] + r1 * c[1][i] + r2 * c[2][i] + t0;
        double y = r3 * c[0][i] + r4 * c[1][i] + r5 * c[2][i] + t1;
        double z = r6 * c[0][i] + r7 * c[1][i] + r8 * c[2][i] + t2;
        z = z < 1e-3 ? 1e-3 : z;
        px[i] = (fx * (x / z) + cx - x0 + 0.5) * across - 0.5;
        py[i] = (fy * (y / z) + cy - y0 + 0.5) * down - 0.5;
    }
}

void fly_draw_faces(const struct faces *f, const int64_t *order, int64_t n, const double *R, const double *t,
                    const struct view *view, double least, int exact, int32_t *seen, int64_t h, int64_t w)
{
    struct picture out = {seen, h, w};
    struct block b;
    double c[4][3][BLOCK];
    int64_t next = 0;
    int k, a;

    while (next < n) {
        for (b.n = 0; next < n && b.n < BLOCK; next++) {
            const double *corner;
            if (order[next] < 0 || order[next] >= f->faces)
                continue;
            corner = f->corners + 12 * order[next];
            b.number[b.n] = (int32_t)(order[next] + 1);
            for (k = 0; k < 4; k++)
                for (a = 0; a < 3; a++)
                    c[k][a][b.n] = corner[3 * k + a];
            b.n++;
        }
        for (k = 0; k < 4; k++)
            project((const double(*)[BLOCK])c[k], b.n, R, t, view, b.x[k], b.y[k]);
        paint(&out, &b, least, exact);
    }
}

/* Faces out[0 .. n) with those of greater ``away`` first, equal ones as they were (insertion: nodes hold few). */
static void farthest_first(int64_t *out, double *away, int64_t n)
{
    int64_t i, j;

    for (i = 1; i < n; i++) {
        int64_t face = out[i];
        double far = away[i];
        for (j = i; j > 0 && away[j - 1] < far; j--) {
            out[j] = out[j - 1];
            away[j] = away[j - 1];
        }
        out[j] = face;
        away[j] = far;
    }
}

int64_t fly_order_faces(const struct faces *f, const double *C, int64_t *out)
{
    int64_t members = f->first[f->nodes], n = 0, held = 0, i;
    /* a node waits once for its own members and once as a child */
    int64_t *stack = malloc((size_t)(2 * f->nodes + 2) * sizeof *stack);
    double *away = malloc((size_t)(members + 1) * sizeof *away);

    if (stack == NULL || away == NULL) {
        free(stack);
        free(away);
        return -1;
    }
    stack[held++] = 0;
    while (held > 0) {
        int64_t item = stack[--held], node = item >> 1;
        if ((item & 1) == 0) {
            const double *plane = f->plane + 4 * node;
            int front = plane[0] * C[0] + plane[1] * C[1] + plane[2] * C[2] > plane[3];
            int64_t near = f->children[2 * node + (front ? 0 : 1)], far = f->children[2 * node + (front ? 1 : 0)];
            if (near >= 0)
                stack[held++] = 2 * near;
            stack[held++] = 2 * node + 1;
            if (far >= 0)
                stack[held++] = 2 * far;
        } else {
            int64_t begin = n;
            for (i = f->first[node]; i < f->first[node + 1]; i++) {
                int64_t face = f->members[i];
                const double *normal = f->normals + 3 * face, *middle = f->middles + 3 * face;
                double dx = middle[0] - C[0], dy = middle[1] - C[1], dz = middle[2] - C[2];
                if (!(normal[0] * C[0] + normal[1] * C[1] + normal[2] * C[2] > f->offset[face]))
                    continue;
                away[n] = dx * dx + dy * dy + dz * dz;
                out[n++] = face;
            }
            farthest_first(out + begin, away + begin, n - begin);
        }
    }
    free(stack);
    free(away);
    return n;
}
