// The slope of a pixel's weights in one number that additive blending keeps whole, in the 24 bits of a 32-bit float.
const float STEEPEST = 3.25; // slope [px-1]; weights turn negative far from the edge where it is steeper

// Ten bits a coordinate, above them the number of edges. Where that is not one, all that is asked is that it is not.
const float SLOPE_STEPS = 127.0, SLOPE_ZERO = 511.0, SLOPE_ROW = 1024.0, ONE_EDGE = 1048576.0;

float packed_slope(vec2 slope) {
    vec2 q = floor(slope * SLOPE_STEPS + (SLOPE_ZERO + 0.5));
    return ONE_EDGE + q.y * SLOPE_ROW + q.x;
}

// Where a pixel's samples all lie on one side of its edge they cannot be weighed. In place of a slope the value then encodes which
// way the edge lies, as a second coordinate that no slope has: of a turn of four, along the square of corners (1, 0),
// (0, 1), (-1, 0), (0, -1); and as the first what share of the pixel lies beyond it.
const float LOWEST = 98.0, HIGHEST = 924.0; // second coordinates of slopes
const float QUARTER = 49.0;                 // codes below and above those, a quarter of a turn
const float LARGEST_SLIVER = 0.25;          // share of a pixel
float packed_sliver(vec2 towards, float area) {
    float x = towards.x / (abs(towards.x) + abs(towards.y));
    float code = min(floor(QUARTER * (towards.y < 0.0 ? 3.0 + x : 1.0 - x)), 4.0 * QUARTER - 1.0);
    code += code < LOWEST ? 0.0 : HIGHEST + 1.0 - LOWEST;
    return ONE_EDGE + code * SLOPE_ROW + floor(min(area / LARGEST_SLIVER, 1.0) * (SLOPE_ROW - 1.0) + 0.5);
}

// The contribution of a single edge that crosses the pixel or passes by it.
struct LoneEdge {
    vec2 slope;    // of the samples' weights [px-1]
    float beyond;  // share of the pixel that lies beyond all of its samples
    vec2 towards;  // direction to it, a unit vector
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
