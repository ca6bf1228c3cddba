// Normalises v. Returns `otherwise` if v is nearly zero (opposite normals that cancel, degenerate texture coordinates).
vec3 unit_or(vec3 v, vec3 otherwise) {
    float length2 = dot(v, v);
    return length2 > 1e-20 ? v * inversesqrt(length2) : otherwise; // smaller squares underflow
}

// A unit vector perpendicular to the unit vector n.
vec3 any_across(vec3 n) { return unit_or(cross(n, vec3(0.3, 0.9, 0.2)), vec3(0.9487, -0.3162, 0.0)); }
