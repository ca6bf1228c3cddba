// The lens, forward. CPU twin: simulator/camera/lens/distortion.py; OpenCV's models and order of coefficients.
// u_lens_k: k1 k2 k3 k4; u_lens_m: k5 k6 p1 p2; u_lens_limits: radius of use, model (1 Brown-Conrady,
// 2 Kannala-Brandt), focal length [px].

// Distorted image coordinates of undistorted ones, both over the focal length [1].
vec2 lens_distort(vec2 q) {
    float s = dot(q, q);
    if (u_lens_limits.y > 1.5) {
        float r = sqrt(s);
        float a = atan(r), t = a * a;
        float series = 1.0 + t * (u_lens_k.x + t * (u_lens_k.y + t * (u_lens_k.z + t * u_lens_k.w)));
        // 1e-3: near the axis atan(r) / r is its own first term
        return q * (r < 1e-3 ? 1.0 + s * (u_lens_k.x - 1.0 / 3.0) : a / r * series);
    }
    float top = 1.0 + s * (u_lens_k.x + s * (u_lens_k.y + s * u_lens_k.z));
    float bottom = 1.0 + s * (u_lens_k.w + s * (u_lens_m.x + s * u_lens_m.y));
    vec2 p = u_lens_m.zw;
    float xy2 = 2.0 * q.x * q.y;
    return q * (top / bottom) + vec2(p.x * xy2 + p.y * (s + 2.0 * q.x * q.x), p.x * (s + 2.0 * q.y * q.y) + p.y * xy2);
}

// Camera point [m] -> (x z, y z, z) of the distorted image: linear clipping works on it as on the point itself.
// Beyond the radius of use the image goes on in proportion, so that nothing folds back.
vec3 lens_homogeneous(vec3 p) {
    float across = length(p.xy), limit = u_lens_limits.x;
    if (p.z > 0.0 && across <= limit * p.z) return vec3(lens_distort(p.xy / p.z) * p.z, p.z);
    return vec3(lens_distort(p.xy * (limit / across)) * (across / limit), p.z);
}
