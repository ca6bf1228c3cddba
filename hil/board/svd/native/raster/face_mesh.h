/* What the kernels share. Each mirrors a numpy function of hil/board/svd and gives its numbers to rounding; that
 * function is the reference, and runs wherever nothing was compiled. Arrays are C-contiguous, their shapes in the
 * comments; numbers from outside (poses, pixels) may be anything, NaN and infinity included.
 */
#ifndef FLYAROUND_FACE_MESH_H
#define FLYAROUND_FACE_MESH_H

#include <stddef.h>
#include <stdint.h>

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

#endif
