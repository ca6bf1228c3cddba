/* The library's interface: every function that Python calls, and every structure that it passes.
 *
 * interface.py reads the types of every call from it, so declarations stay plain: const, a type, a star, a name. Arrays
 * are C-contiguous, with their shapes in the comments. Numbers from outside (poses, pixels) may be anything, NaN and
 * infinity included.
 */
#ifndef FLYAROUND_KERNELS_H
#define FLYAROUND_KERNELS_H

#include <stddef.h>
#include <stdint.h>

#ifdef _WIN32
#define KERNEL __declspec(dllexport)
#else
#define KERNEL __attribute__((visibility("default")))
#endif

/* Faces and the tree that orders them (geometry/faces.py): T faces, N nodes, M members of all nodes. */
struct faces {
    const double *corners;   /* (T, 4, 3) [m], the last twice where there are three */
    const double *normals;   /* (T, 3) outward */
    const double *offset;    /* (T,) plane n.x = offset [m] */
    const double *middles;   /* (T, 3) mean of the corners [m] */
    const double *plane;     /* (N, 4) of each node; zero at leaves */
    const int64_t *children; /* (N, 2) in front of and behind it, -1 none; each node is one node's child at most */
    const int64_t *first;    /* (N + 1,) where each node's members begin */
    const int64_t *members;  /* (M,) faces */
    int64_t faces, nodes;
};

/* A pinhole's picture: pixel = focal * x / z + centre, then (pixel - corner + 0.5) * scale - 0.5. */
struct view {
    double fx, fy, cx, cy; /* [px] */
    double x0, y0;         /* the region's first pixel */
    double across, down;   /* drawn pixels per picture pixel */
};

/* The Sun's picture. */
struct sun {
    const double *axes;  /* (3, 3) of the picture and the direction to the Sun, target frame */
    const double *at;    /* origin (2,), then pitch [m] */
    const float *height; /* (side, side) [m] */
    const void *seen;    /* (side, side) face + 1: uint16 or int32 */
    int64_t side, bytes; /* of each of ``seen`` */
};

/* shadow_map.py's ShadowMapTable: pictures from S directions. */
struct sun_table {
    const double *frames; /* (3, S, 3) axes of each picture and its direction */
    const double *origin; /* (S, 2) [m] */
    const double *pitch;  /* (S,) [m] */
    const float *height;  /* (S, side, side) [m] */
    int64_t directions, side;
};

/* The drawn craft and the picture, for the Sun's search. */
struct sun_image {
    const int32_t *seen;   /* (h * fine, w * fine) face + 1 */
    const void *centre;    /* (h, w) label at a patch pixel's middle: uint8 or uint16 */
    const uint8_t *good;   /* (labels,) whether pixels of it may be looked at */
    const float *gray;     /* (h, w) */
    const int64_t *group;  /* (T,) of each face */
    int64_t h, w, fine, groups, labels, bytes; /* of each of ``centre`` */
    float darkest;         /* least of ``gray`` */
};

/* wireframe.py's EdgeSamples. */
struct samples {
    const double *points;   /* (S, 3) [m] */
    const double *tangents; /* (S, 3) */
    const double *radius;   /* (S,) signed offset of a round member's outline [m] */
    const double *normals;  /* (S, 2, 3) of the faces beside, zero where there is none */
    const int64_t *faces;   /* (S,) how many there are */
    int64_t n;
};

/* wireframe.py's OccludingTriangles. */
struct occluders {
    const double *v0, *e1, *e2, *n; /* (T, 3) [m], [m^2] */
    int64_t triangles;
};

/* A Gaussian as OpenCV makes it: 2 reach + 1 taps, symmetric; a reach of zero is no blur. */
struct gaussian {
    const float *taps;
    int64_t reach;
};

/* What a picture shows of a brightness (response.py, Response): its noise before it is cut off at zero, 0 where the
 * scale cuts nothing off; where the scale ends; its tables. */
struct response {
    double sigma, full;
    const float *lift, *share; /* (2 REACH STEPS + 1,) of tables */
    const double *x, *below;   /* (entries,) of means, times sigma */
    int64_t entries;
    int64_t end; /* where the scale ends, in steps of the tables */
};

/* A drawn craft that moves. */
struct pose_motion {
    const int32_t *seen;  /* (h f, w f) face + 1 */
    const double *level;  /* (256,) brightness of each group */
    const float *behind;  /* (h, w) what the background differs from its level by, or NULL */
    const double *normal; /* (faces, 3) outward, target frame */
    const double *offset; /* (faces,) plane n.x = offset [m] */
    int64_t faces;
    const double *R, *t;           /* camera from target: (3, 3), (3,) [m] */
    double u, v, step_u, step_v;   /* normalised coordinates of the first drawn pixel, and from one to the next */
};

/* rasteriser.py's order_faces: faces that look at C (3,) [m], the farthest first, into out (M,).
 *
 * Fuchs, Kedem and Naylor (1980): from any place everything behind a node's plane is farther than what is on it.
 * Returns how many; -1 where memory is short.
 */
KERNEL int64_t fly_order_faces(const struct faces *f, const double *C, int64_t *out);

/* rasteriser.py's draw_faces: faces order (n,) seen by a pinhole at R (3, 3), t (3,) into seen (h, w), which holds
 * zeros. */
KERNEL void fly_draw_faces(const struct faces *f, const int64_t *order, int64_t n, const double *R,
    const double *t, const struct view *view, double least, int exact, int32_t *seen, int64_t h, int64_t w);

/* rasteriser.py's fill_faces: polygons p (n, 4, 2) into seen (h, w), which holds zeros, as order (n,) + 1. */
KERNEL void fly_fill_faces(const double *p, const int64_t *order, int64_t n, double least, int exact,
    int32_t *seen, int64_t h, int64_t w);

/* variants.py's _middle: mean column and row of the pixels of seen (h, w) that show the craft; returns how many. */
KERNEL int64_t fly_mean_pixel(const int32_t *seen, int64_t h, int64_t w, double *out);

/* shadow_map.py's ShadowMap.of but for its order: polygons p (n, 4, 2) of faces order (n,) on the Sun's picture of
 * side^2 pixels, with where it begins, its pixels and their first middle [m].
 *
 * axes : (3, 3) of the picture and the direction to the Sun. out : origin (2,), then pitch [m].
 */
KERNEL void fly_shadow_map_polygons(const struct faces *f, const int64_t *order, int64_t n, const double *axes,
    int64_t side, double *p, double *out);

/* Heights (side, side) [m] along the Sun's direction of what it sees (side, side); -1000 where that is nothing.
 *
 * at : origin (2,), then pitch [m]. Returns 0; -1 where memory is short.
 */
KERNEL int fly_shadow_map_heights(const struct faces *f, const double *axes, const double *at,
    const int32_t *seen, int64_t side, float *height);

/* shadow_map.py's ShadowMap.shadows: drawn pixels (h, w) that look at the Sun but lie behind something, into dark (h, w),
 * which holds zeros.
 *
 * seen : (h, w) face + 1 at the pose R (3, 3), t (3,). Returns 0; -1 where memory is short.
 */
KERNEL int fly_shadows(const struct faces *f, const struct sun *sun, const struct view *view, const double *R,
    const double *t, const int32_t *seen, int64_t h, int64_t w, uint8_t *dark);

/* ShadowMapTable.find but for the choice: what is left by each of the directions some (n,), into costs (n,).
 *
 * dim : brightness that is as good as none. most : points that are looked at. Returns how many were, whose costs
 * stand where they are 40; -1 where memory is short.
 */
KERNEL int64_t fly_sun_costs(const struct faces *f, const struct sun_table *table,
    const struct sun_image *picture, const struct view *view, const double *R, const double *t, double dim,
    int64_t most, const int64_t *some, int64_t n, double *costs);

/* visibility.py's visible_samples from C (3,) [m]: visible (S,) and outline (S,). Returns 0; -1 where memory is
 * short. */
KERNEL int fly_visible_samples(const struct samples *s, const struct occluders *o, const double *C,
    uint8_t *visible, uint8_t *outline);

/* Levels and picture of a drawn craft (face_gains.py, shade, but for faces that are saturated and what is behind).
 *
 * seen : (h f, w f) face + 1. dark : the same, not 0 in shadow, or NULL. labels : (faces + 1,) group + 1 of each.
 * groups : how many labels there are with the background's. gray : (h, w) the picture, sigma its noise.
 * Out: group (h f, w f), centre and core (h, w), picture (h, w), level and area (256,), shown : the background's mean
 * value; empty : (h, w) the background's share of each pixel, unless NULL.
 * Returns the number of groups, 0 where a byte holds too few, -1 where there is no memory.
 */
KERNEL int64_t fly_face_gains(const int32_t *seen, const uint8_t *dark, const uint16_t *labels, int64_t faces,
    int64_t groups, const float *gray, int64_t h, int64_t w, int64_t f, double sigma, const struct response *r,
    uint8_t *group, uint8_t *centre, uint8_t *core, float *picture, double *level, int64_t *area,
    double *shown, float *empty);

/* What the background differs from its level by, and its part of the picture.
 *
 * gray : (h, w) the picture, shown the background's mean value on it, level its brightness. core, centre : (h, w) as of
 * fly_face_gains. empty : (h, w) the background's share of each pixel. blur : of means of 4 x 4. Out: behind (h, w), and
 * empty times it added to picture (h, w). Returns -1 where there is no memory; h and w are 2 at least.
 */
KERNEL int64_t fly_background(const float *gray, const uint8_t *core, const uint8_t *centre, int64_t h,
    int64_t w, double shown, double level, const struct response *r, const struct gaussian *blur,
    const float *empty, float *behind, float *picture);

/* Bounded squared deviations of the picture from the drawn craft, in units of the noise, summed.
 *
 * picture : (h, w) drawn, as sharp as it was drawn. optics : blur of the optics. gray : (h, w) the picture through
 * score's blur, noise that of its pixels. bound : of a squared deviation. none : (h, w) deviations without the craft,
 * which hold where the craft, through cover's blur, covers no more than covered; NULL where they hold nowhere.
 * Returns -1 where there is no memory.
 */
KERNEL double fly_photometric_cost(const float *picture, const uint8_t *group, int64_t h, int64_t w, int64_t f,
    const struct gaussian *optics, const struct response *r, const float *gray, const struct gaussian *score,
    double noise, double bound, const float *none, const struct gaussian *cover, double covered);

/* Derivatives (6, h, w) of the drawn picture by turn and shift, not blurred (motion_images.py); -1 : no memory. */
KERNEL int64_t fly_image_jacobian(const struct pose_motion *m, const uint8_t *group, int64_t h, int64_t w,
    int64_t f, float *out);

/* Normal matrix of a step's rows: brightnesses of groups, the six of the pose, and the residual.
 *
 * d's arrays : the craft drawn at the pose, m what moves it, centre (h, w) groups at middles, picture (h, w) drawn.
 * gray : (h, w) the picture through blur. optics : blur of the optics; both : it and blur together. noise : of gray
 * where it is blurred. slack, tukey : see fly_robust_weights. most : groups whose brightness is found.
 * Out: G (n + 7, n + 7) with room for MOST + 7, and sum of the weights.
 * Returns n + 1000 times the rows that count, -1 where there is no memory.
 */
KERNEL int64_t fly_normal_equations(const struct pose_motion *m, const uint8_t *group, const uint8_t *centre,
    const float *picture, const float *gray, int64_t h, int64_t w, int64_t f, const struct response *r,
    const struct gaussian *optics, const struct gaussian *blur, const struct gaussian *both, double noise,
    double slack, double tukey, int64_t most, double *G, double *weights);

/* edge_field.py's shrink: pixels (h, w) of so many bytes each, stride of them from row to row, into out (high,
 * wide). */
KERNEL int64_t fly_area_average(const void *pixels, int64_t bytes, int64_t stride, int64_t h, int64_t w,
    int64_t high, int64_t wide, float *out);

/* Into out (3,): the mask's median over strips of three rows, step strips apart; how many of these pixels lie well
 * inside the scale, by noise of that size; and the median over them. h and w at least three; -1 where there is no
 * memory.
 */
KERNEL int64_t fly_noise(const void *image, int64_t bytes, int64_t stride, int64_t h, int64_t w,
    int64_t step, double full_scale, double *out);

/* Segments of a picture (h, w), two each way at least: x1 y1 x2 y2 [px of it] into out (most, 4); how many, -1 where
 * there is no memory.
 */
KERNEL int64_t fly_line_segments(const uint8_t *picture, int64_t h, int64_t w, double least, int64_t most,
    double *out);

/* Checksum of the sources and flags that the library was compiled from (hatch_build.py). */
KERNEL const char *fly_sources(void);

/* Checksum of this header. */
KERNEL const char *fly_interface(void);

/* Size of each structure, then the offsets of its fields, in the order of this header, into out (room,). Returns how
 * many numbers there are.
 */
KERNEL int64_t fly_layout(int64_t *out, int64_t room);

#endif
