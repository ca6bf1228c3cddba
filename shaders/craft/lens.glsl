// Target vertices as the camera sees them. With a lens they go through it one by one; the mesh is cut so finely that the
// straight lines between them follow the bent ones (simulator/render/craft/lens_bend.py). CPU twin of the lens:
// simulator/camera/lens/distortion.py; OpenCV's models and order of coefficients.
#if LENS
// u_lens_k: k1 k2 k3 k4; u_lens_m: k5 k6 p1 p2; u_lens_limits: radius of use, model (1 Brown-Conrady, 2 Kannala-Brandt).

// Distorted image coordinates of undistorted ones, both over the focal length [1].
vec2 lens_distort(vec2 q) {
    precise vec2 bent;
    float s = dot(q, q);
    if (u_lens_limits.y > 1.5) {
        float r = sqrt(s);
        float a = atan(r), t = a * a;
        float series = 1.0 + t * (u_lens_k.x + t * (u_lens_k.y + t * (u_lens_k.z + t * u_lens_k.w)));
        // 1e-3: near the axis atan(r) / r is its own first term
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

// Camera point [m] -> (x z, y z, z) of the distorted image: linear clipping works on it as on the point itself.
// Beyond the radius of use the image goes on in proportion, so that nothing folds back.
vec3 through_lens(vec3 p) {
    precise vec2 bent;
    float across = length(p.xy), limit = u_lens_limits.x;
    if (p.z > 0.0 && across <= limit * p.z) bent = lens_distort(p.xy / p.z) * p.z;
    else bent = lens_distort(p.xy * (limit / max(across, 1e-9))) * (across / limit);
    return vec3(bent, p.z);
}
#endif

// Clip coordinates of a place on the target. clip_from: by a matrix from the target, with a lens from behind the lens.
vec4 clip_of(mat4 clip_from, mat4 camera_from_target, vec3 p_m) {
#if LENS
    precise vec4 clip = clip_from * vec4(through_lens((camera_from_target * vec4(p_m, 1.0)).xyz), 1.0);
#else
    precise vec4 clip = clip_from * vec4(p_m, 1.0);
#endif
    return clip;
}
