// Correction of the samples' weights, as a slope, to the exact area beside an edge in a pixel.
//
// Samples place an edge only as well as they are dense. But where an edge crosses a pixel is known from the mesh, and so
// is the pixel's area on either side. Weights 1 + slope . x, for samples at x (pixels from the pixel's centre), keep
// their sum, and give the samples below the edge its area when slope = n (N area - count) / sum of n . x over them.
// Where all samples lie on one side, the edge's direction and the area beyond it are sent instead (packed_slope.glsl).
// A hidden edge does nothing: both its sides show one surface.
// A pixel that several edges cross or pass by (a gap between cells, a strut) keeps equal weights, which are right on the
// average for bodies thinner than a pixel. With EXACT_AREAS (preset `high`), what the samples miss of each edge's area
// adds up: where all of the edges end parts of one material, that material's share of the pixel is known, and so is what
// it leaves to others.
//
// A sample taken for one on the other side moves the edge by its share of the pixel. So sides are found as a rasteriser
// finds them, from vertices at whole substeps (substeps.glsl) by whole numbers: no driver's interpolation has a part in it.
#include "craft/sample_pattern.glsl"
#include "craft/packed_slope.glsl"
// All whole numbers here count steps across the edge: sample (i, j) is i * v_along.y - j * v_along.x of them from the
// pixel's own, and lies below the edge where that is less than v_line . (pixel, 1).
flat in vec3 v_across; // xy: n, unit vector across the edge in the image; z: a step [px]
flat in vec3 v_along;  // xy: along the edge in the sample buffer [substeps]; z: how far the edge lies before a whole step
flat in vec3 v_area;   // heights of the triangles whose areas differ by what an edge leaves of a pixel; a step in those
flat in ivec3 v_line;
#ifdef EXACT_AREAS
#include "craft/packed_sums.glsl"
flat in vec4 v_part; // one at the material's number modulo four, its sign that of the edge's first face
// Of the triangles drawn so many end a part by their edge's first face, so many by its second.
uniform ivec2 u_outlines;
// Sums over edges, two in a number (pack_two): slope.x [px-1] and the samples that are missing to the area of parts that end
// here whose material's number leaves 0 when divided by four; slope.y and those of 1; those of 2 and of 3; and how many
// edges cross the pixel or pass by it.
layout(location = 0) out vec4 out_slope;
#else
layout(location = 0) out float out_slope; // packed_slope
#endif

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    // the terms may wrap around, their sum does not; where it is rounded it is far from all samples'
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
    // without samples on one side there is nothing to weigh
    float slope = abs(moment) > 1e-3 ? missed / moment : 0.0;
    vec2 steep = v_across.xy * clamp(slope, -STEEPEST, STEEPEST);
#ifdef EXACT_AREAS
    // image rows run downwards: what is left of an edge has the smaller coordinate across it
    float side = gl_PrimitiveID < u_outlines.x ? 1.0 : gl_PrimitiveID < u_outlines.x + u_outlines.y ? -1.0 : 0.0;
    vec4 of_part = v_part * (side * whole_steps(missed));
    out_slope = vec4(pack_two(vec3(whole_steps(steep), of_part.z), of_part.xyw), 1.0);
#else
    bool none_below = count < 0.5;
    float beyond = none_below ? area : count > float(SAMPLES) - 0.5 ? 1.0 - area : 0.0;
    out_slope = beyond > 0.0 ? packed_sliver(none_below ? -v_across.xy : v_across.xy, beyond) : packed_slope(steep);
#endif
}
