// A surface sample in 32 bits: material number (8), octahedral normal in the camera frame (12 + 12).
// Octahedral map: Cigolle et al. (2014), Survey of efficient representations for independent unit vectors, JCGT 3(2).
const float OCT_STEPS = 4095.0;

// Visible normals have z < 0 (towards the camera), so that pole is put where the map has no fold.
uint pack_surface(uint material, vec3 n) {
    n.z = -n.z;
    vec2 p = n.xy / (abs(n.x) + abs(n.y) + abs(n.z));
    if (n.z < 0.0) p = (1.0 - abs(p.yx)) * vec2(p.x >= 0.0 ? 1.0 : -1.0, p.y >= 0.0 ? 1.0 : -1.0);
    uvec2 q = uvec2(clamp(p * 0.5 + 0.5, 0.0, 1.0) * OCT_STEPS + 0.5);
    return (material << 24) | (q.x << 12) | q.y;
}

uint material_of(uint word) { return word >> 24; }

// The two octahedral coordinates, 0..4095; sums of them may be averaged.
ivec2 normal_code(uint word) { return ivec2((word >> 12) & 0xfffu, word & 0xfffu); }

vec3 decode_normal(vec2 code) {
    vec2 p = code / OCT_STEPS * 2.0 - 1.0;
    vec3 n = vec3(p, 1.0 - abs(p.x) - abs(p.y));
    float t = max(-n.z, 0.0);
    n.xy -= vec2(n.x >= 0.0 ? t : -t, n.y >= 0.0 ? t : -t);
    n.z = -n.z;
    return normalize(n);
}
