// The slope of a pixel's weights in one number that additive blending keeps whole, in the 24 bits of a 32-bit float.
const float STEEPEST = 4.0; // slope [px-1]; beyond, weights turn negative far from the edge; only slivers ask for it

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
