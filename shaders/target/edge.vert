// One edge of the mesh as a rectangle of the image: as long as the edge, a little wider than a pixel's diagonal.
in vec3 in_start_m; // target frame
in vec3 in_end_m;
in float in_corner; // 0..3: end = number / 2, side = number mod 2
#ifdef EXACT_AREAS
in float in_material; // negative where the first face at the edge lies to the right of start to end, seen from outside
flat out vec4 v_part;
#endif
uniform vec4 u_window;    // pixels that hold the target: x0, y0, width, height
uniform vec2 u_lattice_px; // size of the lattice's buffer
flat out vec2 v_across;             // unit vector across the edge, in the image
noperspective out float v_distance; // of the edge from the pixel's centre, along v_across [px]
#include "target/lattice.glsl"

// Image position of a vertex in the window [px], rounded as the rasteriser rounds it: to 1/256 of a lattice step. So the
// edge passes the samples on the same side as the faces that meet there.
vec2 in_window(vec4 clip) {
    vec2 half_px = 0.5 * u_lattice_px; // in the order, and with the roundings, of llvmpipe's own viewport transform
    vec2 at = floor((clip.xy * (1.0 / clip.w) * half_px + half_px) * 256.0 + 0.5) / 256.0;
    vec2 st = at - vec2(pixel_index(ivec2(u_window.xy))) - vec2(0.5 - LATTICE_PHASE, 0.5);
    return pixel_from_lattice(st);
}

void main() {
    vec4 a = u_lattice_clip_from_target * vec4(in_start_m, 1.0);
    vec4 b = u_lattice_clip_from_target * vec4(in_end_m, 1.0);
    vec2 start = in_window(a), end = in_window(b);
    vec2 along = end - start;
    along *= inversesqrt(max(dot(along, along), 1e-12));
    v_across = vec2(-along.y, along.x);
#ifdef EXACT_AREAS
    v_part = sign(in_material) * vec4(equal(ivec4(int(abs(in_material) + 0.5) & 3), ivec4(0, 1, 2, 3)));
#endif
    v_distance = mod(in_corner, 2.0) > 0.5 ? -REACH_PX : REACH_PX;
    vec2 corner = (in_corner > 1.5 ? end : start) - v_across * v_distance;
    gl_Position = vec4((corner + 0.5) / u_window.zw * 2.0 - 1.0, 0.0, 1.0);
    if (a.w <= 0.0 || b.w <= 0.0) gl_Position = vec4(2.0, 2.0, 2.0, 1.0); // reaches behind the camera
}
