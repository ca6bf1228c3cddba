/* Faces painted over each other, the farthest first: shade.py. */
#include <math.h>
#include <stdlib.h>

#include "kernels.h"

/* shade.py's BORDER_PX and NARROW_PX [px], and where coordinates end [px] */
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
static int64_t nearest(double x)
{
    const double shift = 6755399441055744.0; /* 1.5 * 2^52 */
    double sum = x + shift;
    return (int64_t)(sum - shift);
}

static double greater(double a, double b) { return a > b ? a : b; }

static double magnitude(int64_t a) { return a < 0 ? -(double)a : (double)a; }

static int64_t within(int64_t a, int64_t low, int64_t high) { return a < low ? low : a > high ? high : a; }

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

/* shade.py's ``shortened`` for one polygon p (4, 2): what is narrower than a pixel gets its true area. */
static void shorten(double p[4][2])
{
    double ax = p[2][0] - p[0][0], ay = p[2][1] - p[0][1], bx = p[3][0] - p[1][0], by = p[3][1] - p[1][1];
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
        along[k] = p[k][0] * ux + p[k][1] * uy;
    middle = 0.25 * (along[0] + along[1] + along[2] + along[3]);
    for (k = 0; k < 4; k++) {
        double away = share * (along[k] - middle);
        p[k][0] += away * ux;
        p[k][1] += away * uy;
    }
}

/* shade.py's ``inset`` for one polygon p (4, 2): smaller by what its filled border adds. */
static void draw_in(double p[4][2])
{
    double ax[4], ay[4], bx[4], by[4], squared[4], around = 0.0, twice, far;
    double d1x = p[2][0] - p[0][0], d1y = p[2][1] - p[0][1], d2x = p[3][0] - p[1][0], d2y = p[3][1] - p[1][1];
    int k;

    for (k = 0; k < 4; k++) {
        double ex = p[(k + 1) & 3][0] - p[k][0], ey = p[(k + 1) & 3][1] - p[k][1], length, scale;
        squared[k] = ex * ex + ey * ey;
        length = sqrt(squared[k]);
        scale = 1.0 / greater(length, 1e-9);
        around += length;
        ax[k] = -ey * scale;
        ay[k] = ex * scale;
    }
    for (k = 0; k < 4; k++) {
        bx[k] = ax[(k + 3) & 3];
        by[k] = ay[(k + 3) & 3];
    }
    if (squared[2] < 1e-12) {
        /* a triangle's last corner is there twice: its two sides are the ones before and after both */
        bx[3] = ax[1], by[3] = ay[1];
        ax[2] = ax[3], ay[2] = ay[3];
    }
    twice = d1x * d2y - d1y * d2x;
    far = 0.4 * fabs(twice) / greater(around, 1e-9);
    far = BORDER < far ? BORDER : far;
    far = twice < 0.0 ? -far : twice > 0.0 ? far : 0.0;
    for (k = 0; k < 4; k++) {
        double share = far / greater(1.0 + ax[k] * bx[k] + ay[k] * by[k], 0.3);
        p[k][0] += (ax[k] + bx[k]) * share;
        p[k][1] += (ay[k] + by[k]) * share;
    }
}

/* One polygon p (4, 2) [drawn px] of more than ``least`` [px^2], as shade.py's fill_faces paints it. */
static void paint(const struct picture *out, double p[4][2], double least, int exact, int32_t number)
{
    struct point v[4];
    double d1x = p[2][0] - p[0][0], d1y = p[2][1] - p[0][1], d2x = p[3][0] - p[1][0], d2y = p[3][1] - p[1][1];
    int k;

    if (!(fabs(d1x * d2y - d1y * d2x) > 2.0 * least))
        return;
    if (exact)
        shorten(p);
    draw_in(p);
    for (k = 0; k < 4; k++) {
        /* comparisons that NaN fails */
        if (!(p[k][0] == p[k][0] && p[k][1] == p[k][1]))
            return;
        v[k].x = within(nearest(16.0 * (p[k][0] < -FAR_PX ? -FAR_PX : p[k][0] > FAR_PX ? FAR_PX : p[k][0])),
                        (int64_t)(-FINER * FAR_PX), (int64_t)(FINER * FAR_PX));
        v[k].y = within(nearest(16.0 * (p[k][1] < -FAR_PX ? -FAR_PX : p[k][1] > FAR_PX ? FAR_PX : p[k][1])),
                        (int64_t)(-FINER * FAR_PX), (int64_t)(FINER * FAR_PX));
    }
    fill(out, v, number);
}

/* shade.py's fill_faces: polygons p (n, 4, 2) into seen (h, w), which holds zeros, as order (n,) + 1. */
void fly_fill_faces(const double *p, const int64_t *order, int64_t n, double least, int exact, int32_t *seen,
                    int64_t h, int64_t w)
{
    struct picture out = {seen, h, w};
    int64_t i;
    int k;

    for (i = 0; i < n; i++) {
        double q[4][2];
        for (k = 0; k < 8; k++)
            q[k / 2][k % 2] = p[8 * i + k];
        paint(&out, q, least, exact, (int32_t)(order[i] + 1));
    }
}

/* shade.py's draw_faces: faces order (n,) seen by a pinhole at R (3, 3), t (3,) into seen (h, w), which holds
 * zeros. Depth is kept away from zero as model.py's ``pixels`` does.
 */
void fly_draw_faces(const struct faces *f, const int64_t *order, int64_t n, const double *R, const double *t,
                    const struct view *view, double least, int exact, int32_t *seen, int64_t h, int64_t w)
{
    struct picture out = {seen, h, w};
    int64_t i;
    int k;

    for (i = 0; i < n; i++) {
        double q[4][2];
        const double *c;
        if (order[i] < 0 || order[i] >= f->faces)
            continue;
        c = f->corners + 12 * order[i];
        for (k = 0; k < 4; k++, c += 3) {
            double x = R[0] * c[0] + R[1] * c[1] + R[2] * c[2] + t[0];
            double y = R[3] * c[0] + R[4] * c[1] + R[5] * c[2] + t[1];
            double z = R[6] * c[0] + R[7] * c[1] + R[8] * c[2] + t[2];
            z = z < 1e-3 ? 1e-3 : z;
            q[k][0] = (view->fx * (x / z) + view->cx - view->x0 + 0.5) * view->across - 0.5;
            q[k][1] = (view->fy * (y / z) + view->cy - view->y0 + 0.5) * view->down - 0.5;
        }
        paint(&out, q, least, exact, (int32_t)(order[i] + 1));
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

/* shade.py's Faces.order: faces that look at C (3,) [m], the farthest first, into out (M,).
 *
 * Fuchs, Kedem and Naylor (1980): from any place everything behind a node's plane is farther than what is on it.
 * Returns how many; -1 where memory is short.
 */
int64_t fly_order(const struct faces *f, const double *C, int64_t *out)
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
