// Vertices of the target in a buffer, in whole steps of 1/256 of its pixels (samples, or the labels' pixels).
//
// Every rasteriser rounds vertices to such steps or finer ones, and from there on works without rounding. But where a
// vertex lies half-way between two steps, the arithmetic before the rounding decides, and drivers' differ. So vertices are
// rounded here: what a driver makes of them then lies next to a whole step, and it finds the same one. Its planes are of
// these places, too: what a pixel's centre shows of a face then lies between the face's corners, in depth as in the image.
const float SUBSTEPS = 256.0;
const float FARTHEST = 2097152.0; // steps from the buffer's corner: products of ways between ends and a remainder fit 32 bits

// Position of a vertex in front of the camera, in a buffer of `size_px`; whole numbers.
vec2 in_substeps(vec4 clip, vec2 size_px) {
    vec2 half_steps = (0.5 * SUBSTEPS) * size_px;
    precise vec2 at = clip.xy * (1.0 / clip.w) * half_steps + half_steps;
    return floor(at + 0.5);
}

// The clip coordinates of the nearest whole step; behind the camera none is.
vec4 at_whole_substeps(vec4 clip, vec2 size_px) {
    vec2 at = in_substeps(clip, size_px);
    bool near = clip.w > 0.0 && max(abs(at.x), abs(at.y)) < FARTHEST;
    return near ? vec4((at / ((0.5 * SUBSTEPS) * size_px) - 1.0) * clip.w, clip.zw) : clip;
}
