// A surface sample's first word of 32 bits: material number above, the normal's two stereographic coordinates below it.
//
// Stereographic coordinates of a unit normal, seen from the pole that looks away from the camera (z > 0): they are
// smooth over everything that can be visible (0 facing the camera, length 1 at the silhouette), so a triangle
// interpolates them and a sample only rounds them. Snyder (1987), Map projections, USGS paper 1395, chapter 21.
#if LENS
const float CODE_RANGE = 4.0; // 62 degrees off the axis a surface seen edge-on looks so far away from the camera
#else
const float CODE_RANGE = 1.25; // a normal may look away from the camera by 12 degrees: smooth shading at silhouettes
#endif
const int CODE_MASK = (1 << NORMAL_BITS) - 1;
const float CODE_CENTER = 0.5 * float(CODE_MASK);
const float CODE_SCALE = CODE_CENTER / CODE_RANGE;

// Stereographic coordinates of a unit normal in the camera frame, in steps of the code from its centre.
vec2 normal_steps(vec3 n) {
    vec2 p = n.xy / max(1.0 - n.z, 1e-6);
    return CODE_SCALE * p * min(1.0, CODE_RANGE * inversesqrt(max(dot(p, p), 1e-12)));
}

// The same for the opposite normal, of a back face.
vec2 opposite_steps(vec2 steps) {
    vec2 p = -steps * (CODE_SCALE * CODE_SCALE / max(dot(steps, steps), 1e-6));
    return p * min(1.0, CODE_RANGE * CODE_SCALE * inversesqrt(max(dot(p, p), 1e-12)));
}

// First word of a sample. material_word: the material's number, shifted to its place.
uint pack_surface(int material_word, vec2 steps) {
    ivec2 q = ivec2(steps + (CODE_CENTER + 0.5));
    return uint(material_word | (q.x << NORMAL_BITS) | q.y);
}

// A material number in its place in the first word.
int material_word(float number) { return int(number + 0.5) << (2 * NORMAL_BITS); }

// The second word of a sample: the frame's stamp above, a place in the atlas of charts, 0..1, below it. Samples with
// another stamp are of earlier frames and hold nothing: so the image need not be cleared each time.
const int CHART_BITS = 14;
const uint CHART_MASK = (1u << uint(CHART_BITS)) - 1u;
uniform uint u_stamp; // in its place
uint pack_chart(vec2 chart) {
    ivec2 q = ivec2(chart * float(CHART_MASK) + 0.5);
    return u_stamp | uint((q.x << CHART_BITS) | q.y);
}

// Code of the back of an open shell, which has no chart: light is baked on fronts.
uint no_chart() { return u_stamp | (CHART_MASK << uint(CHART_BITS)) | CHART_MASK; }

// The first word, 0 where the frame drew nothing.
uint surface_of(uvec2 words) { return words.y >> uint(2 * CHART_BITS) == u_stamp >> uint(2 * CHART_BITS) ? words.x : 0u; }

// Camera z [m] of a sample's depth; inverse of simulator/render/projection.py. Stamp k has depths from 16^-k
// to 16 times that, see simulator/render/gl/depth_buffer.py. Older ones are as far as can be.
float camera_z(float depth) {
    float near = u_pattern.z, far = u_pattern.w;
    float scale = uintBitsToFloat((127u + 4u * (u_stamp >> uint(2 * CHART_BITS))) << 23u);
    return near * far / (far - min((depth * scale - 1.0) / 15.0, 1.0) * (far - near));
}

// Place in the atlas of charts, 0..1, of a sample's second word.
vec2 chart_of(uint word) {
    return vec2((word >> uint(CHART_BITS)) & CHART_MASK, word & CHART_MASK) / float(CHART_MASK);
}

// Material number of a sample's first word.
uint material_of(uint word) { return word >> uint(2 * NORMAL_BITS); }

// The two coordinates as whole numbers; sums of them may be averaged.
ivec2 normal_code(uint word) {
    return ivec2(int(word >> uint(NORMAL_BITS)) & CODE_MASK, int(word) & CODE_MASK);
}

// Unit normal, camera frame, of a code.
vec3 decode_normal(vec2 code) {
    vec2 p = (code - CODE_CENTER) / CODE_SCALE;
    float r2 = dot(p, p);
    return vec3(2.0 * p, r2 - 1.0) / (1.0 + r2);
}
