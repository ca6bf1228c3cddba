// Solar cells: no two are alike, and contacts of silver lie on them.
// u_cells: four rows a lattice, as in simulator/render/craft/cell_lattice.py, but of places in the camera frame.
uniform vec4 u_cells[4 * CELLS];

// Share of a stretch about a place, `off` from the nearest line, that lies on lines `pitch` apart; one over its width [m-1].
float line_share(float off, float pitch, float half_wide, float per_m) {
    float line = clamp((half_wide - off) * per_m + 0.5, 0.0, min(1.0, 2.0 * half_wide * per_m));
    return mix(2.0 * half_wide / pitch, line, clamp(1.5 - 2.0 / (pitch * per_m), 0.0, 1.0)); // or it beats with pixels
}

// Reflectance of the films at the point p_m (camera frame) over their mean. Tilts the normal, adds contacts to the base.
// v: unit vector to the camera.
float cell_at(vec3 p_m, vec3 v, inout vec3 n, inout vec4 base) {
    vec4 p = vec4(p_m, 1.0);
    vec2 at = vec2(-1.0), pitch = vec2(1.0);
    float lattice = 0.0;
    // choices instead of branches: a software driver unrolls them
    for (int k = 0; k < CELLS; ++k) {
        vec4 size = u_cells[4 * k + 3];
        vec2 here = vec2(dot(u_cells[4 * k], p), dot(u_cells[4 * k + 1], p));
        vec2 outside = max(-here, here - size.xy);
        bool found = max(max(outside.x, outside.y), abs(dot(u_cells[4 * k + 2], p)) - CELL_RISE_M) < 0.0;
        at = found ? here : at;
        pitch = found ? size.zw : pitch;
        lattice = found ? float(k) : lattice;
    }
    if (at.x < 0.0) return 1.0;
    float per_m = max(u_intrinsics.x, u_intrinsics.y) / p_m.z * sqrt(max(dot(n, v), 0.05));
    float across_m = 0.5 * pitch.y; // between busbars, which lie along the longer side
    float metal = line_share(abs(fract(2.0 * at.y) - 0.5) * across_m, across_m, BUSBAR_M, per_m);
#if FINGERS
    metal += line_share((0.5 - abs(fract(at.x * pitch.x / FINGER_PITCH_M) - 0.5)) * FINGER_PITCH_M, FINGER_PITCH_M, FINGER_M, per_m);
#else
    metal += 2.0 * FINGER_M / FINGER_PITCH_M;
#endif
    base.xyz += (CONTACT - base.xyz) * min(metal, 1.0);
    float q = fract(dot(floor(at), vec2(0.7549, 0.5698)) + 0.3819 * lattice);
    vec3 h = fract(q * (1.0 + q) * vec3(43.7, 91.3, 57.9)) - 0.5;
    n += mat3(u_camera_from_target) * (h * (2.0 * CELL_TILT)); // longer by less than a rounding of the code
    return 1.0 + (2.0 * CELL_UNLIKE) * h.z;
}
