// Two sums in one number: additive blending of whole multiples, exact in the 24 bits of a 32-bit float.
const float TWOFOLD = 4096.0, TWOFOLD_STEP = 1.0 / 128.0;

// Sums of up to 16 in size, to 1/128.
vec3 twofold(vec3 high, vec3 low) {
    return floor(high / TWOFOLD_STEP + 0.5) * TWOFOLD + floor(low / TWOFOLD_STEP + 0.5);
}

void split_twofold(vec3 sum, out vec3 high, out vec3 low) {
    high = floor(sum / TWOFOLD + 0.5);
    low = (sum - high * TWOFOLD) * TWOFOLD_STEP;
    high *= TWOFOLD_STEP;
}
