// What the lattice samples of a pixel miss of an edge's area, as a slope of their weights.
//
// Samples place an edge only as well as they are dense. But where an edge crosses a pixel is known from the mesh, and so
// is the pixel's area on either side. Weights 1 + slope . x, for samples at x (pixels from the pixel's centre), keep
// their sum, and give the samples below the edge its area when slope = n (N area - count) / sum of n . x over them.
// A hidden edge does nothing: both its sides show one surface.
// A pixel that several edges cross or pass by (a gap between cells, a strut) keeps equal weights, which are right on the
// average for bodies thinner than a pixel. With EXACT_AREAS (preset `high`), what the samples miss of each edge's area
// adds up: where all of the edges end parts of one material, that material's share of the pixel is known, and so is what
// it leaves to others.
#include "target/lattice.glsl"
#include "target/slope.glsl"
flat in vec2 v_across;
noperspective in float v_distance;
#ifdef EXACT_AREAS
#include "target/twofold.glsl"
flat in vec4 v_part; // one at the material's number modulo four, its sign that of the edge's first face
// Of the triangles drawn so many end a part by their edge's first face, so many by its second.
uniform ivec2 u_outlines;
// Sums over edges, two in a number (twofold): slope.x [px-1] and the samples that are missing to the area of parts that end
// here whose material's number leaves 0 when divided by four; slope.y and those of 1; those of 2 and of 3; and how many
// edges cross the pixel or pass by it.
layout(location = 0) out vec4 out_slope;
#else
layout(location = 0) out float out_slope; // packed_slope
#endif

// Area of the unit square around 0 where n . x < d, n a unit vector: a difference of triangles.
float area_below(vec2 n, float d) {
    vec2 m = max(abs(n), 1e-4);
    float t = d + 0.5 * (m.x + m.y);
    vec4 q = max(vec4(t, t - m.x, t - m.y, t - m.x - m.y), 0.0);
    q *= q;
    return clamp((q.x - q.y - q.z + q.w) / (2.0 * m.x * m.y), 0.0, 1.0);
}

void main() {
    vec2 n = v_across;
    float d = v_distance, count = 0.0, moment = 0.0;
#define BELOW(k, i, j) { float at = dot(n, sample_offset(ivec2(i, j))); \
        float below = float(at < d); count += below; moment += below * at; }
    FOR_EACH_SAMPLE(BELOW)
    // without samples on one side there is nothing to weigh
    float area = area_below(n, d), missed = area * float(SAMPLES) - count;
    float slope = abs(moment) > 1e-3 ? missed / moment : 0.0;
    vec2 steep = n * clamp(slope, -STEEPEST, STEEPEST);
#ifdef EXACT_AREAS
    // image rows run downwards: what is left of an edge has the smaller coordinate across it
    float side = gl_PrimitiveID < u_outlines.x ? 1.0 : gl_PrimitiveID < u_outlines.x + u_outlines.y ? -1.0 : 0.0;
    vec4 of_part = v_part * (side * whole_steps(missed));
    out_slope = vec4(twofold(vec3(whole_steps(steep), of_part.z), of_part.xyw), 1.0);
#else
    out_slope = packed_slope(steep);
#endif
}
