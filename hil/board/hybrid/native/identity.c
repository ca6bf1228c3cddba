/* What tells a library that Python may call from one that it may not: kernels.h. */
#include "kernels.h"

#define AT(structure, field) (int64_t)offsetof(struct structure, field)

static const int64_t layout[] = {
    (int64_t)sizeof(struct faces), AT(faces, corners), AT(faces, normals), AT(faces, offset),
    AT(faces, middles), AT(faces, plane), AT(faces, children), AT(faces, first), AT(faces, members),
    AT(faces, faces), AT(faces, nodes),
    (int64_t)sizeof(struct view), AT(view, fx), AT(view, fy), AT(view, cx), AT(view, cy), AT(view, x0),
    AT(view, y0), AT(view, across), AT(view, down),
    (int64_t)sizeof(struct sun), AT(sun, axes), AT(sun, at), AT(sun, height), AT(sun, seen), AT(sun, side),
    AT(sun, bytes),
    (int64_t)sizeof(struct sun_table), AT(sun_table, frames), AT(sun_table, origin), AT(sun_table, pitch),
    AT(sun_table, height), AT(sun_table, directions), AT(sun_table, side),
    (int64_t)sizeof(struct sun_image), AT(sun_image, seen), AT(sun_image, centre), AT(sun_image, good),
    AT(sun_image, gray), AT(sun_image, group), AT(sun_image, h), AT(sun_image, w), AT(sun_image, fine),
    AT(sun_image, groups), AT(sun_image, labels), AT(sun_image, bytes), AT(sun_image, darkest),
    (int64_t)sizeof(struct samples), AT(samples, points), AT(samples, tangents), AT(samples, radius),
    AT(samples, normals), AT(samples, faces), AT(samples, n),
    (int64_t)sizeof(struct occluders), AT(occluders, v0), AT(occluders, e1), AT(occluders, e2),
    AT(occluders, n), AT(occluders, triangles),
    (int64_t)sizeof(struct gaussian), AT(gaussian, taps), AT(gaussian, reach),
    (int64_t)sizeof(struct response), AT(response, sigma), AT(response, full), AT(response, lift),
    AT(response, share), AT(response, x), AT(response, below), AT(response, entries), AT(response, end),
    (int64_t)sizeof(struct pose_motion), AT(pose_motion, seen), AT(pose_motion, level),
    AT(pose_motion, behind), AT(pose_motion, normal), AT(pose_motion, offset), AT(pose_motion, faces),
    AT(pose_motion, R), AT(pose_motion, t), AT(pose_motion, u), AT(pose_motion, v), AT(pose_motion, step_u),
    AT(pose_motion, step_v),
};

const char *fly_sources(void) { return FLYAROUND_SOURCES; }

const char *fly_interface(void) { return FLYAROUND_INTERFACE; }

int64_t fly_layout(int64_t *out, int64_t room)
{
    const int64_t n = (int64_t)(sizeof layout / sizeof *layout);
    int64_t i;

    for (i = 0; i < n && i < room; i++)
        out[i] = layout[i];
    return n;
}
