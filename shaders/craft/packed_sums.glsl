// Two sums packed in one number: additive blending of whole multiples, exact in the 24 bits of a 32-bit float.
const float PACKED_STEPS = 4096.0, PACKED_STEP = 1.0 / 128.0;

// A value in steps; sums of up to 16 in size fit.
float whole_steps(float value) { return floor(value * (1.0 / PACKED_STEP) + 0.5); }
vec2 whole_steps(vec2 value) { return floor(value * (1.0 / PACKED_STEP) + 0.5); }

// Whole steps of two sums each.
vec3 pack_two(vec3 high, vec3 low) { return high * PACKED_STEPS + low; }

void unpack_two(vec3 sum, out vec3 high, out vec3 low) {
    high = floor(sum * (1.0 / PACKED_STEPS) + 0.5);
    low = (sum - high * PACKED_STEPS) * PACKED_STEP;
    high *= PACKED_STEP;
}
