// Crinkled insulation: the normal of a blanket creased into random flat facets.

// Pseudo-random direction of a lattice cell, components -1..1. Integer hash of Jarzynski & Olano (2020), Hash
// functions for GPU rendering, JCGT 9(3), pcg3d.
vec3 cell_tilt(ivec3 cell) {
    uvec3 v = uvec3(cell) * 1664525u + 1013904223u;
    v.x += v.y * v.z; v.y += v.z * v.x; v.z += v.x * v.y;
    v ^= v >> 16u;
    v.x += v.y * v.z; v.y += v.z * v.x; v.z += v.x * v.y;
    return vec3(v >> 8u) / 8388607.5 - 1.0;
}

// Smoothly blended tilt of the cells around a point in units of one cell.
vec3 tilt_at(vec3 x) {
    vec3 base = floor(x), f = x - base;
    f = f * f * (3.0 - 2.0 * f);
    ivec3 c = ivec3(base);
    vec3 a = mix(mix(cell_tilt(c), cell_tilt(c + ivec3(1, 0, 0)), f.x),
                 mix(cell_tilt(c + ivec3(0, 1, 0)), cell_tilt(c + ivec3(1, 1, 0)), f.x), f.y);
    vec3 b = mix(mix(cell_tilt(c + ivec3(0, 0, 1)), cell_tilt(c + ivec3(1, 0, 1)), f.x),
                 mix(cell_tilt(c + ivec3(0, 1, 1)), cell_tilt(c + ivec3(1, 1, 1)), f.x), f.y);
    return mix(a, b, f.z);
}

// One set of parallel folds: the side of the crease on which x lies, as a tilt along the folds' normal.
vec3 fold(vec3 x, vec3 across, float per_m, float wander) {
    return across * (fract(dot(x, across) * per_m + wander) < 0.5 ? 1.0 : -1.0);
}

// Normal n at the point p_m (both camera frame): folds in six directions, 25 to 90 mm apart, that wander, cut the
// blanket into flat facets; a soft billow of 70 mm lies under them.
vec3 crinkled(vec3 n, vec3 p_m, float amplitude) {
    mat3 R = mat3(u_camera_from_target);
    vec3 x = (p_m - u_camera_from_target[3].xyz) * R; // R transposed times: into the target frame
    vec3 billow = tilt_at(x * 14.0);
    vec3 tilt = 0.7 * billow;
    tilt += 0.30 * fold(x, vec3(0.68, 0.36, 0.64), 11.0, 0.30 * billow.x);
    tilt += 0.30 * fold(x, vec3(-0.48, 0.80, 0.36), 13.0, 0.30 * billow.y);
    tilt += 0.25 * fold(x, vec3(0.30, -0.50, 0.81), 17.0, 0.30 * billow.z);
    tilt += 0.20 * fold(x, vec3(0.89, -0.41, -0.20), 23.0, 0.22 * billow.y);
    tilt += 0.15 * fold(x, vec3(0.10, 0.95, -0.30), 31.0, 0.22 * billow.z);
    tilt += 0.15 * fold(x, vec3(-0.60, -0.15, 0.79), 40.0, 0.22 * billow.x);
    return normalize(n + amplitude * 0.5 * (R * tilt));
}
