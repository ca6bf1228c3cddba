// The slope of a pixel's sample weights as one integer, exact under additive blending in a float's 24-bit significand.
const float STEEPEST = 3.25; // slope [px-1]; a steeper one makes weights far from the edge negative

// Ten bits per coordinate, above them the number of edges. The coordinates are used only where that number is one.
const float SLOPE_STEPS = 127.0, SLOPE_ZERO = 511.0, SLOPE_ROW = 1024.0, ONE_EDGE = 1048576.0;

float packed_slope(vec2 slope) {
    vec2 q = floor(slope * SLOPE_STEPS + (SLOPE_ZERO + 0.5));
    return ONE_EDGE + q.y * SLOPE_ROW + q.x;
}

// If all samples lie on one side of the edge, the value holds the sliver beyond them instead of a slope.
// First coordinate: the sliver's fraction of the pixel. Second: the direction to it, as the distance along the square
// with the corners (1, 0), (0, 1), (-1, 0), (0, -1), in codes that no slope uses.
const float LOWEST = 98.0, HIGHEST = 924.0; // range of a slope's second coordinate
const float QUARTER = 49.0;                 // direction codes per side of the square
const float LARGEST_SLIVER = 0.25;          // fraction of a pixel
float packed_sliver(vec2 towards, float area) {
    float x = towards.x / (abs(towards.x) + abs(towards.y));
    float code = min(floor(QUARTER * (towards.y < 0.0 ? 3.0 + x : 1.0 - x)), 4.0 * QUARTER - 1.0);
    code += code < LOWEST ? 0.0 : HIGHEST + 1.0 - LOWEST;
    return ONE_EDGE + code * SLOPE_ROW + floor(min(area / LARGEST_SLIVER, 1.0) * (SLOPE_ROW - 1.0) + 0.5);
}

// The only edge in or near a pixel; slope and beyond are 0 where there are several.
struct LoneEdge {
    vec2 slope;    // of the sample weights [px-1]
    float beyond;  // fraction of the pixel that lies beyond all of its samples
    vec2 towards;  // unit vector to that part
};
LoneEdge lone_edge(float sum) {
    int whole = int(sum);
    float x = float(whole & 1023), y = float((whole >> 10) & 1023), alone = whole >> 20 == 1 ? 1.0 : 0.0;
    float is_slope = y < LOWEST || y > HIGHEST ? 0.0 : 1.0;
    float turn = (y < LOWEST ? y + 0.5 : y - (HIGHEST + 0.5 - LOWEST)) / QUARTER;
    vec2 towards = vec2(abs(turn - 2.0) - 1.0, turn < 2.0 ? 1.0 - abs(turn - 1.0) : abs(turn - 3.0) - 1.0);
    vec2 slope = (vec2(x, y) - SLOPE_ZERO) * (alone * is_slope / SLOPE_STEPS);
    return LoneEdge(slope, x * (alone * (1.0 - is_slope) * LARGEST_SLIVER / (SLOPE_ROW - 1.0)), normalize(towards));
}
