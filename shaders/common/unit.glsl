// The unit vector along v; `otherwise` where v has no direction: opposite normals that meet, texture coordinates all alike.
vec3 unit_or(vec3 v, vec3 otherwise) {
    float length2 = dot(v, v);
    return length2 > 1e-20 ? v * inversesqrt(length2) : otherwise; // 1e-20: of smaller ones the squares lose their digits
}

// Some unit vector across a unit vector.
vec3 any_across(vec3 n) { return unit_or(cross(n, vec3(0.3, 0.9, 0.2)), vec3(0.9487, -0.3162, 0.0)); }
