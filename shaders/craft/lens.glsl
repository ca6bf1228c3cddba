// Projection of target vertices, with the lens distortion applied per vertex. The mesh is subdivided so finely that
// straight edges approximate the distorted ones (simulator/render/craft/lens_bend.py). Models and order of coefficients:
// OpenCV's. CPU twin: simulator/camera/lens/distortion.py.
#if LENS
// u_lens_k: k1 k2 k3 k4; u_lens_m: k5 k6 p1 p2.
// u_lens_limits: x: largest undistorted radius [1]; y: model (1 Brown-Conrady, 2 Kannala-Brandt).

// Distorted image coordinates from undistorted ones, both in focal lengths [1].
vec2 lens_distort(vec2 q) {
    precise vec2 bent;
    float s = dot(q, q);
    if (u_lens_limits.y > 1.5) {
        float r = sqrt(s);
        float a = atan(r), t = a * a;
        float series = 1.0 + t * (u_lens_k.x + t * (u_lens_k.y + t * (u_lens_k.z + t * u_lens_k.w)));
        // 1e-3: first terms of the series near the axis
        bent = q * (r < 1e-3 ? 1.0 + s * (u_lens_k.x - 1.0 / 3.0) : a / r * series);
    } else {
        float top = 1.0 + s * (u_lens_k.x + s * (u_lens_k.y + s * u_lens_k.z));
        float bottom = 1.0 + s * (u_lens_k.w + s * (u_lens_m.x + s * u_lens_m.y));
        vec2 p = u_lens_m.zw;
        float xy2 = 2.0 * q.x * q.y;
        bent = q * (top / bottom)
            + vec2(p.x * xy2 + p.y * (s + 2.0 * q.x * q.x), p.x * (s + 2.0 * q.y * q.y) + p.y * xy2);
    }
    return bent;
}

// Camera-frame point [m] to (x z, y z, z) with distorted x, y, which clips as the point itself does.
// Beyond the largest radius the scale stays constant, so that the image does not fold back.
vec3 through_lens(vec3 p) {
    precise vec2 bent;
    float across = length(p.xy), limit = u_lens_limits.x;
    if (p.z > 0.0 && across <= limit * p.z) bent = lens_distort(p.xy / p.z) * p.z;
    else bent = lens_distort(p.xy * (limit / max(across, 1e-9))) * (across / limit);
    return vec3(bent, p.z);
}
#endif

// Clip coordinates of a target point. clip_from: matrix from the target frame, or with a lens from the distorted point.
vec4 clip_of(mat4 clip_from, mat4 camera_from_target, vec3 p_m) {
#if LENS
    precise vec4 clip = clip_from * vec4(through_lens((camera_from_target * vec4(p_m, 1.0)).xyz), 1.0);
#else
    precise vec4 clip = clip_from * vec4(p_m, 1.0);
#endif
    return clip;
}
