// G-buffer samples in two 32-bit words. First word: material index in the high bits, then the code of the normal.
//
// The code is the normal's two stereographic coordinates, projected from the pole away from the camera (z > 0). They are
// smooth over all visible normals (0 facing the camera, length 1 at the silhouette), so triangles can interpolate
// them and a sample only rounds them. Snyder (1987), Map projections, USGS professional paper 1395, chapter 21.
#if LENS
const float CODE_RANGE = 4.0; // reached by a surface seen edge-on 62 degrees off the axis
#else
const float CODE_RANGE = 1.25; // a smooth normal at the silhouette may face away from the camera by 12 degrees
#endif
const int CODE_MASK = (1 << NORMAL_BITS) - 1;
const float CODE_CENTER = 0.5 * float(CODE_MASK);
const float CODE_SCALE = CODE_CENTER / CODE_RANGE;

// Code of a unit normal in the camera frame, in steps from the centre.
vec2 normal_steps(vec3 n) {
    vec2 p = n.xy / max(1.0 - n.z, 1e-6);
    return CODE_SCALE * p * min(1.0, CODE_RANGE * inversesqrt(max(dot(p, p), 1e-12)));
}

// Code of the opposite normal, for back faces.
vec2 opposite_steps(vec2 steps) {
    vec2 p = -steps * (CODE_SCALE * CODE_SCALE / max(dot(steps, steps), 1e-6));
    return p * min(1.0, CODE_RANGE * CODE_SCALE * inversesqrt(max(dot(p, p), 1e-12)));
}

// First word of a sample. material_word: the material index, shifted to its bits.
uint pack_surface(int material_word, vec2 steps) {
    ivec2 q = ivec2(steps + (CODE_CENTER + 0.5));
    return uint(material_word | (q.x << NORMAL_BITS) | q.y);
}

// Material index shifted to its bits in the first word.
int material_word(float number) { return int(number + 0.5) << (2 * NORMAL_BITS); }

// Second word of a sample: the frame's stamp in the high bits, then coordinates in the atlas of charts, 0..1. A sample
// with another stamp is from an earlier frame and counts as empty, so the image need not be cleared every frame.
const int CHART_BITS = 14;
const uint CHART_MASK = (1u << uint(CHART_BITS)) - 1u;
uniform uint u_stamp; // shifted to its bits
uint pack_chart(vec2 chart) {
    ivec2 q = ivec2(chart * float(CHART_MASK) + 0.5);
    return u_stamp | uint((q.x << CHART_BITS) | q.y);
}

// Chart code of the back of an open shell; light is baked for front faces only.
uint no_chart() { return u_stamp | (CHART_MASK << uint(CHART_BITS)) | CHART_MASK; }

// First word of a sample, 0 if this frame drew nothing there.
uint surface_of(uvec2 words) { return words.y >> uint(2 * CHART_BITS) == u_stamp >> uint(2 * CHART_BITS) ? words.x : 0u; }

// Camera z [m] from a sample's depth; inverse of simulator/render/projection.py. Stamp k uses the depths from 16^-k
// to 16 times that (simulator/render/gl/depth_buffer.py). Depths of earlier frames become the largest.
float camera_z(float depth) {
    float near = u_pattern.z, far = u_pattern.w;
    float scale = uintBitsToFloat((127u + 4u * (u_stamp >> uint(2 * CHART_BITS))) << 23u);
    return near * far / (far - min((depth * scale - 1.0) / 15.0, 1.0) * (far - near));
}

// Coordinates in the atlas of charts, 0..1, from a sample's second word.
vec2 chart_of(uint word) {
    return vec2((word >> uint(CHART_BITS)) & CHART_MASK, word & CHART_MASK) / float(CHART_MASK);
}

// Material index from a sample's first word.
uint material_of(uint word) { return word >> uint(2 * NORMAL_BITS); }

// The normal's code as integers, which may be summed and averaged.
ivec2 normal_code(uint word) {
    return ivec2(int(word >> uint(NORMAL_BITS)) & CODE_MASK, int(word) & CODE_MASK);
}

// Unit normal in the camera frame from a code.
vec3 decode_normal(vec2 code) {
    vec2 p = (code - CODE_CENTER) / CODE_SCALE;
    float r2 = dot(p, p);
    return vec3(2.0 * p, r2 - 1.0) / (1.0 + r2);
}
