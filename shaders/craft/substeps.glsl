// Rounds target vertices to 1/256 of a buffer's pixel (a sample, or a pixel of the labels).
//
// Every rasteriser rounds vertices to this grid or a finer one, and is exact from there on. For a vertex half-way
// between two steps, earlier rounding errors decide, and they differ between drivers. With vertices rounded here, all
// drivers find the same step. Depth is interpolated from the same positions, so it stays between the corners' depths.
const float SUBSTEPS = 256.0;
const float FARTHEST = 2097152.0; // steps from the buffer's corner; cross products in edge.vert then fit 32 bits

// Buffer position [substeps], as integers, of a vertex in front of the camera. size_px: size of the buffer.
vec2 in_substeps(vec4 clip, vec2 size_px) {
    vec2 half_steps = (0.5 * SUBSTEPS) * size_px;
    precise vec2 at = clip.xy * (1.0 / clip.w) * half_steps + half_steps;
    return floor(at + 0.5);
}

// Clip coordinates rounded to the nearest substep; unchanged behind the camera and beyond FARTHEST.
vec4 at_whole_substeps(vec4 clip, vec2 size_px) {
    vec2 at = in_substeps(clip, size_px);
    bool near = clip.w > 0.0 && max(abs(at.x), abs(at.y)) < FARTHEST;
    return near ? vec4((at / ((0.5 * SUBSTEPS) * size_px) - 1.0) * clip.w, clip.zw) : clip;
}
