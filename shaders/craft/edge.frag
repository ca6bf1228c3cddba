// Analytic antialiasing: sample weights that match the exact area of a pixel on each side of an edge.
//
// The mesh gives the line of an edge, and with it the exact area of the pixel on either side. A sample at x (pixels from
// the pixel's centre) gets the weight 1 + slope . x. These weights keep their sum N, the number of samples. With
// slope = n (N area - count) / sum of n . x, the sum over the `count` samples below the edge is N times the area there.
//
// - All samples on one side: the direction of the edge and the area beyond it are written instead (packed_slope.glsl).
// - Hidden edge: no effect, as both sides show the same surface.
// - Several edges in or near a pixel: equal weights, which are right on average for bodies thinner than a pixel.
// - The same with EXACT_AREAS (preset `high`): the area that the samples miss is summed over the edges. If all of them
//   bound parts of one material, the sum gives that material's fraction of the pixel.
//
// A sample on the wrong side would move the edge, so the test must agree with the rasteriser: it uses integers, from
// vertices rounded to substeps (substeps.glsl), and no interpolated value.
#include "craft/sample_pattern.glsl"
#include "craft/packed_slope.glsl"
// Integers count steps across the edge. Sample (i, j) is i * v_along.y - j * v_along.x steps from the pixel's origin,
// and below the edge if that is less than v_line . (pixel, 1).
flat in vec3 v_across; // xy: n, unit vector across the edge in the image; z: length of a step [px]
flat in vec3 v_along;  // xy: along the edge in the sample buffer [substeps]; z: from the edge to the next step [steps]
flat in vec3 v_area;   // xy: square roots of two triangles' areas, whose difference is the area; z: a step in that unit
flat in ivec3 v_line;
#ifdef EXACT_AREAS
#include "craft/packed_sums.glsl"
flat in vec4 v_part; // +1 or -1 (side of the edge's first face) at the material's index modulo 4, else 0
// Number of triangles whose edge bounds a part by its first face (drawn first), and by its second face (drawn next).
uniform ivec2 u_outlines;
// Sums over edges, xyz packed in pairs (pack_two). m[k]: samples missing from the area of materials of index k modulo 4.
// x: slope.x [px-1], m[0]; y: slope.y [px-1], m[1]; z: m[2], m[3]; w: number of edges in or near the pixel.
layout(location = 0) out vec4 out_slope;
#else
layout(location = 0) out float out_slope; // packed_slope
#endif

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    // integer terms may wrap around but their sum does not; a float rounds it only far from all samples
    float limit = float(v_line.x * pixel.x + v_line.y * pixel.y + v_line.z) + PATTERN_PHASE * v_along.y;
    float count = 0.0, moment = 0.0;
#define BELOW(k, i, j) { float at = (float(i) + PATTERN_PHASE) * v_along.y - float(j) * v_along.x; \
        float below = float(at < limit); count += below; moment += below * at; }
    FOR_EACH_SAMPLE(BELOW)
    moment *= v_across.z; // [px]
    float from_centre = limit - v_along.z;
    vec2 height = max(v_area.xy - abs(from_centre) * v_area.z, 0.0);
    float lesser = height.x * height.x - height.y * height.y, area = from_centre > 0.0 ? 1.0 - lesser : lesser;
    float missed = area * float(SAMPLES) - count;
    // no samples on one side: the weights cannot change the area
    float slope = abs(moment) > 1e-3 ? missed / moment : 0.0;
    vec2 steep = v_across.xy * clamp(slope, -STEEPEST, STEEPEST);
#ifdef EXACT_AREAS
    // image rows run downwards: the left side of an edge has the smaller coordinate across it
    float side = gl_PrimitiveID < u_outlines.x ? 1.0 : gl_PrimitiveID < u_outlines.x + u_outlines.y ? -1.0 : 0.0;
    vec4 of_part = v_part * (side * whole_steps(missed));
    out_slope = vec4(pack_two(vec3(whole_steps(steep), of_part.z), of_part.xyw), 1.0);
#else
    bool none_below = count < 0.5;
    float beyond = none_below ? area : count > float(SAMPLES) - 0.5 ? 1.0 - area : 0.0;
    out_slope = beyond > 0.0 ? packed_sliver(none_below ? -v_across.xy : v_across.xy, beyond) : packed_slope(steep);
#endif
}
