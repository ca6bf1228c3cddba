// Solar cells with silver contacts; reflectance and tilt vary slightly from cell to cell.
// u_cells: four rows per lattice, those of simulator/render/craft/cell_lattice.py for points in the camera frame.
#ifdef FLAT_CELLS
#define u_cells v_cells
#else
uniform vec4 u_cells[4 * CELLS];
#endif

// Fraction of an interval that lies on periodic lines. Lengths in periods. off: distance of the interval's centre from
// the nearest line; wide: width of a line; stretch: width of the interval; per: 1 / stretch.
float line_share(float off, float wide, float stretch, float per) {
    float line = clamp((0.5 * wide - off) * per + 0.5, 0.0, min(1.0, wide * per));
    return mix(wide, line, clamp(1.5 - 2.0 * stretch, 0.0, 1.0)); // the mean where lines are too dense: no moire
}

// Reflectance of the films at p_m relative to their mean [1]. Tilts the normal n, and mixes the contacts into base.
// v: unit vector to the camera. All vectors in the camera frame.
float cell_at(vec3 p_m, vec3 v, inout vec3 n, inout vec4 base) {
    vec4 p = vec4(p_m, 1.0);
    vec2 at = vec2(-1.0), pitch = vec2(1.0);
    float lattice = 0.0;
    // unrolled, with selects instead of branches: a software driver runs a loop slower
#define IN_LATTICE(k) { \
        vec4 size = u_cells[4 * k + 3]; \
        vec2 here = vec2(dot(u_cells[4 * k], p), dot(u_cells[4 * k + 1], p)); \
        vec2 outside = max(-here, here - size.xy); \
        bool found = max(max(outside.x, outside.y), abs(dot(u_cells[4 * k + 2], p)) - CELL_RISE_M) < 0.0; \
        at = found ? here : at; \
        pitch = found ? size.zw : pitch; \
        lattice = found ? float(k) : lattice; }
    FOR_EACH_LATTICE(IN_LATTICE)
    if (at.x < 0.0) return 1.0;
    float width_m = p_m.z / max(u_intrinsics.x, u_intrinsics.y) * inversesqrt(max(dot(n, v), 0.05));
    float per_m = 1.0 / width_m, per_pitch = 2.0 / pitch.y; // of busbars, which lie along the longer side
    float metal = line_share(abs(fract(2.0 * at.y) - 0.5), 2.0 * BUSBAR_M * per_pitch, width_m * per_pitch, per_m / per_pitch);
#if FINGERS
    metal += line_share(0.5 - abs(fract(at.x * pitch.x / FINGER_PITCH_M) - 0.5), 2.0 * FINGER_M / FINGER_PITCH_M,
        width_m / FINGER_PITCH_M, per_m * FINGER_PITCH_M);
#else
    metal += 2.0 * FINGER_M / FINGER_PITCH_M;
#endif
    base.xyz += (CONTACT - base.xyz) * min(metal, 1.0);
    float q = fract(dot(floor(at), vec2(0.7549, 0.5698)) + 0.3819 * lattice);
    vec3 h = fract(q * (1.0 + q) * vec3(43.7, 91.3, 57.9)) - 0.5;
    n += mat3(u_camera_from_target) * (h * (2.0 * CELL_TILT)); // not normalised: the change of length is negligible
    return 1.0 + (2.0 * CELL_UNLIKE) * h.z;
}
