// Two sums in one number: additive blending of whole multiples, exact in the 24 bits of a 32-bit float.
const float TWOFOLD = 4096.0, TWOFOLD_STEP = 1.0 / 128.0;

// A value in steps; sums of up to 16 in size fit.
float whole_steps(float value) { return floor(value * (1.0 / TWOFOLD_STEP) + 0.5); }
vec2 whole_steps(vec2 value) { return floor(value * (1.0 / TWOFOLD_STEP) + 0.5); }

// Whole steps of two sums each.
vec3 twofold(vec3 high, vec3 low) { return high * TWOFOLD + low; }

void split_twofold(vec3 sum, out vec3 high, out vec3 low) {
    high = floor(sum * (1.0 / TWOFOLD) + 0.5);
    low = (sum - high * TWOFOLD) * TWOFOLD_STEP;
    high *= TWOFOLD_STEP;
}
