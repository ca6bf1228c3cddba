// What the lattice samples of a pixel miss of an edge's area, as a slope of their weights.
//
// Samples place an edge only as well as they are dense. But where an edge crosses a pixel is known from the mesh, and so
// is the pixel's area on either side. Weights 1 + slope . x, for samples at x (pixels from the pixel's centre), keep
// their sum, and give the samples below the edge its area when slope = n (N area - count) / sum of n . x over them.
// A pixel that several edges cross or pass by keeps equal weights, which are right on the average for bodies thinner
// than a pixel. A hidden edge does nothing: both its sides show one surface.
#include "target/lattice.glsl"
flat in vec2 v_across;
noperspective in float v_distance;
layout(location = 0) out vec4 out_slope; // slope [px-1]; 0; 1: how many edges cross the pixel or pass by it

const float STEEPEST = 4.0; // beyond, weights turn negative far from the edge; only slivers ask for it

// Area of the unit square around 0 where n . x < d, n a unit vector: a difference of triangles.
// CPU twin: tests/gl/test_render_edges.py.
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
    float slope = abs(moment) > 1e-3 ? (area_below(n, d) * float(SAMPLES) - count) / moment : 0.0;
    out_slope = vec4(n * clamp(slope, -STEEPEST, STEEPEST), 0.0, 1.0);
}
