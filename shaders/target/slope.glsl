// The slope of a pixel's weights in one number that additive blending keeps whole, in the 24 bits of a 32-bit float.
const float STEEPEST = 3.25; // slope [px-1]; weights turn negative far from the edge where it is steeper

// Where a pixel's samples all lie on one side of its edge they cannot be weighed. What is beyond the edge is told in place
// of a slope, by a vector towards it that is longer than slopes are; so long for none, and so much longer for all of a pixel.
const float SLIVER = 3.35, SLIVER_BY_AREA = 2.6;
const float LEAST_SLIVER = 0.002, LARGEST_SLIVER = 0.25; // of a pixel
vec2 sliver(vec2 towards, float area) { return towards * (SLIVER + SLIVER_BY_AREA * min(area, LARGEST_SLIVER)); }

// Share of the pixel that a slope, or what is in its place, says to lie beyond the samples.
float sliver_area(vec2 slope) {
    float area = (length(slope) - SLIVER) * (1.0 / SLIVER_BY_AREA);
    return area > 0.0 ? area : 0.0;
}

// Ten bits a coordinate, above them the number of edges. Where that is not one, all that is asked is that it is not.
const float SLOPE_STEPS = 127.0, SLOPE_ZERO = 511.0, SLOPE_ROW = 1024.0, ONE_EDGE = 1048576.0;

float packed_slope(vec2 slope) {
    vec2 q = floor(slope * SLOPE_STEPS + (SLOPE_ZERO + 0.5));
    return ONE_EDGE + q.y * SLOPE_ROW + q.x;
}

// The slope where one edge crosses the pixel or passes by it, else none.
vec2 lone_slope(float sum) {
    int whole = int(sum);
    vec2 slope = (vec2(whole & 1023, (whole >> 10) & 1023) - SLOPE_ZERO) * (1.0 / SLOPE_STEPS);
    return whole >> 20 == 1 ? slope : vec2(0.0);
}
