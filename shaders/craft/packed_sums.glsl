// Two fixed-point sums in one float, exact in its 24-bit significand under additive blending.
const float PACKED_STEPS = 4096.0, PACKED_STEP = 1.0 / 128.0;

// A value in steps of PACKED_STEP, rounded; sums between -16 and 16 fit.
float whole_steps(float value) { return floor(value * (1.0 / PACKED_STEP) + 0.5); }
vec2 whole_steps(vec2 value) { return floor(value * (1.0 / PACKED_STEP) + 0.5); }

// Packs two values, both in steps.
vec3 pack_two(vec3 high, vec3 low) { return high * PACKED_STEPS + low; }

void unpack_two(vec3 sum, out vec3 high, out vec3 low) {
    high = floor(sum * (1.0 / PACKED_STEPS) + 0.5);
    low = (sum - high * PACKED_STEPS) * PACKED_STEP;
    high *= PACKED_STEP;
}
