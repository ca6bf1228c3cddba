// Vertices of the target in the sample buffer, in whole steps of 1/256 of a sample's distance.
//
// Every rasteriser rounds vertices to such steps or finer ones, and from there on works without rounding. But where a
// vertex lies half-way between two steps, the arithmetic before the rounding decides, and drivers' differ. So vertices are
// rounded here: what a driver makes of them then lies next to a whole step, and it finds the same one.
#include "target/lens.glsl"
const float SUBSTEPS = 256.0;
const float FARTHEST = 2097152.0; // steps from the buffer's corner: products of ways between ends and a remainder fit 32 bits

vec4 pattern_clip(vec3 p_m) { return clip_of(u_pattern_clip, u_camera_from_target, p_m); }

// Of a vertex before the camera; whole numbers.
vec2 in_substeps(vec4 clip) {
    vec2 half_steps = (0.5 * SUBSTEPS) * u_pattern_px.xy;
    precise vec2 at = clip.xy * (1.0 / clip.w) * half_steps + half_steps;
    return floor(at + 0.5);
}

// The clip coordinates of the nearest whole step; behind the camera none is.
vec4 at_whole_substeps(vec4 clip) {
    vec2 at = in_substeps(clip);
    bool near = clip.w > 0.0 && max(abs(at.x), abs(at.y)) < FARTHEST;
    return near ? vec4((at / ((0.5 * SUBSTEPS) * u_pattern_px.xy) - 1.0) * clip.w, clip.zw) : clip;
}
