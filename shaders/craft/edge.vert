// Draws a mesh edge as a rectangle in the image: as long as the edge, slightly wider than a pixel's diagonal.
in vec3 in_start_m; // target frame
in vec3 in_end_m;
in float in_corner; // 0..3: end = in_corner / 2, side = in_corner mod 2
#ifdef EXACT_AREAS
in float in_material; // index; negative where the edge's first face is right of start to end, seen from outside
flat out vec4 v_part;
#endif
uniform vec4 u_window; // x0, y0, width, height of the pixels that hold the target
// Inputs of edge.frag, described there; constant along an edge.
flat out vec3 v_across, v_along, v_area;
flat out ivec3 v_line;
#include "craft/sample_pattern.glsl"
#include "craft/lens.glsl"
#include "craft/substeps.glsl"

void main() {
    vec4 a = clip_of(u_pattern_clip, u_camera_from_target, in_start_m);
    vec4 b = clip_of(u_pattern_clip, u_camera_from_target, in_end_m);
    vec2 from = in_substeps(a, u_pattern_px.xy), to = in_substeps(b, u_pattern_px.xy), along = to - from;
    // the same in the image, relative to the centre of the window's first pixel [px]
    ivec2 first = pixel_index(ivec2(u_window.xy));
    vec2 middle = vec2(first) + vec2(0.5 - PATTERN_PHASE, 0.5);
    vec2 start = pixel_from_pattern(from / SUBSTEPS - middle), end = pixel_from_pattern(to / SUBSTEPS - middle);
    vec2 unit = pixel_from_pattern(along / SUBSTEPS);
    float per_length = inversesqrt(max(dot(unit, unit), 1e-12));
    unit *= per_length;
    vec2 n = vec2(-unit.y, unit.x);

    if (max(max(abs(from.x), abs(from.y)), max(abs(to.x), abs(to.y))) > FARTHEST) {
        // drivers clip so long an edge, and round differently: use a shorter piece of nearly the same line
        vec2 to_buffer = (0.5 * SUBSTEPS) * u_pattern_px.xy - from;
        from = floor(from + along * clamp(dot(to_buffer, along) / dot(along, along), 0.0, 1.0));
        along = floor(along * (0.25 * FARTHEST / max(abs(along.x), abs(along.y))) + 0.5);
    }
    // The sign of the cross product of the edge and the vector to a sample tells the sample's side. It is an integer,
    // and differs between samples by multiples of 256: one step. The edge lies at fraction / 256 of a step.
    ivec2 d = ivec2(along);
    vec2 to_sample = 0.5 * SUBSTEPS - from, whole = floor(to_sample / SUBSTEPS);
    ivec2 place = first + ivec2(whole), rest = ivec2(to_sample - whole * SUBSTEPS);
    int fraction = rest.y * d.x - rest.x * d.y;
    // top-left rule: a sample on the edge counts as slightly farther along the first axis, or else along the second
    int on_edge = d.y < 0 || (d.y == 0 && d.x > 0) ? 256 : 255;
    int limit = (fraction + on_edge) >> 8;
    ivec2 s = PATTERN_S, t = PATTERN_T;
    v_line = ivec3(t.x * d.x - s.x * d.y, t.y * d.x - s.y * d.y, place.y * d.x - place.x * d.y + limit);
    v_along = vec3(along, float(256 * limit - fraction) / SUBSTEPS);

    // the part of a unit square beyond a line is the difference of two triangles; scaled so that area = height squared
    vec2 across = pixel_from_pattern(along);
    float step_px = inversesqrt(max(dot(across, across), 1e-12)) / float(SAMPLES);
    v_across = vec3(n, step_px);
    vec2 size = max(abs(n), 1e-4);
    v_area = vec3(0.5 * (size.x + size.y), 0.5 * abs(size.x - size.y), step_px) * inversesqrt(2.0 * size.x * size.y);
#ifdef EXACT_AREAS
    v_part = sign(in_material) * vec4(equal(ivec4(int(abs(in_material) + 0.5) & 3), ivec4(0, 1, 2, 3)));
#endif
    float side = mod(in_corner, 2.0) > 0.5 ? -REACH_PX : REACH_PX;
    vec2 corner = (in_corner > 1.5 ? end : start) - n * side;
    gl_Position = vec4((corner + 0.5) / u_window.zw * 2.0 - 1.0, 0.0, 1.0);
    if (a.w <= 0.0 || b.w <= 0.0) gl_Position = vec4(2.0, 2.0, 2.0, 1.0); // discard: the edge reaches behind the camera
}
