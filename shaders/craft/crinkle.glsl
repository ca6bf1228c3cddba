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

// Low-pass weight of a wave in the mean over a pixel that spans so many of its periods: 1 below a quarter, 0 above 3/4.
float pass_weight(float periods) { return clamp(1.5 - 2.0 * periods, 0.0, 1.0); }

// One set of parallel folds: the side of the crease on which x lies, as a tilt along the folds' normal. Adds it to tilt
// as far as a pixel of width_m shows it; lost: and the variance of the rest.
void fold(vec3 x, vec3 across, float per_m, float wander, float size, float width_m, inout vec3 tilt, inout float lost) {
    float share = pass_weight(per_m * width_m);
    tilt += across * (fract(dot(x, across) * per_m + wander) < 0.5 ? size * share : -size * share);
    lost += size * size * (1.0 - share * share);
}

// Normal n at the point p_m (both camera frame): folds in six directions, 25 to 90 mm apart, that wander, cut the
// blanket into flat facets; a soft billow of 70 mm lies under them. Facets that a pixel holds many of make it rougher
// instead: their slopes' variance adds to the lobe's (Olano & Baker 2010, LEAN mapping), or far blankets would flicker.
vec3 crinkled(vec3 n, vec3 p_m, float amplitude, inout float roughness) {
    mat3 R = mat3(u_camera_from_target);
    vec3 x = (p_m - u_camera_from_target[3].xyz) * R; // R transposed times: into the target frame
    float width_m = p_m.z / (max(u_intrinsics.x, u_intrinsics.y) * sqrt(max(-dot(n, normalize(p_m)), 0.05)));
    vec3 billow = tilt_at(x * 14.0);
    float share = pass_weight(7.0 * width_m), lost = 0.18 * (1.0 - share * share);
    vec3 tilt = 0.7 * share * billow;
    fold(x, vec3(0.68, 0.36, 0.64), 11.0, 0.30 * billow.x, 0.30, width_m, tilt, lost);
    fold(x, vec3(-0.48, 0.80, 0.36), 13.0, 0.30 * billow.y, 0.30, width_m, tilt, lost);
    fold(x, vec3(0.30, -0.50, 0.81), 17.0, 0.30 * billow.z, 0.25, width_m, tilt, lost);
    fold(x, vec3(0.89, -0.41, -0.20), 23.0, 0.22 * billow.y, 0.20, width_m, tilt, lost);
    fold(x, vec3(0.10, 0.95, -0.30), 31.0, 0.22 * billow.z, 0.15, width_m, tilt, lost);
    fold(x, vec3(-0.60, -0.15, 0.79), 40.0, 0.22 * billow.x, 0.15, width_m, tilt, lost);
    float slope = 0.5 * amplitude;
    // alpha^2 is twice the variance of slopes; a third of it lies along each axis
    float alpha2 = roughness * roughness * roughness * roughness + lost * slope * slope * (2.0 / 3.0);
    roughness = sqrt(sqrt(min(alpha2, 1.0)));
    return unit_or(n + slope * (R * tilt), n);
}
