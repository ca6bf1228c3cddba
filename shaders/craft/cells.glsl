// Solar cells: no two are alike, and contacts of silver lie on them. u_cells: simulator/render/craft/cell_lattice.py.
uniform vec4 u_cells[4 * CELLS];

// Share of a stretch `width` about x that lies within `half_wide` of whole multiples of `pitch` [m].
float line_share(float x, float pitch, float half_wide, float width) {
    float off = (0.5 - abs(fract(x / pitch) - 0.5)) * pitch;
    return width < pitch ? clamp((half_wide - off) / width + 0.5, 0.0, min(1.0, 2.0 * half_wide / width))
                         : 2.0 * half_wide / pitch;
}

// Reflectance of the films at the point p_m (camera frame) over their mean. Tilts the normal, adds contacts to the base.
float cell_at(vec3 p_m, inout vec3 n, inout vec4 base) {
    mat3 R = mat3(u_camera_from_target);
    vec4 x = vec4((p_m - u_camera_from_target[3].xyz) * R, 1.0);
    for (int k = 0; k < CELLS; ++k) {
        vec2 at = vec2(dot(u_cells[4 * k], x), dot(u_cells[4 * k + 1], x));
        vec4 size = u_cells[4 * k + 3];
        if (abs(dot(u_cells[4 * k + 2], x)) > 0.004 || any(lessThan(at, vec2(0.0))) || any(greaterThan(at, size.xy))) continue;
        float width_m = p_m.z / (max(u_intrinsics.x, u_intrinsics.y) * sqrt(max(-dot(n, normalize(p_m)), 0.05)));
        vec2 in_m = (fract(at) - 0.5) * size.zw; // from the cell's middle
        bool longer = size.z > size.w;           // busbars lie along the longer side
        vec2 along = longer ? in_m : in_m.yx;
        float across_m = longer ? size.w : size.z;
        float metal = line_share(along.y + 0.25 * across_m, 0.5 * across_m, BUSBAR_M, width_m)
            + line_share(along.x, FINGER_PITCH_M, FINGER_M, width_m);
        base.xyz = mix(base.xyz, vec3(CONTACT), min(metal, 1.0));
        // Dave Hoskins (2014), Hash without sine
        vec3 h = fract(vec3(floor(at), float(k)) * vec3(0.1031, 0.1030, 0.0973) + 0.37);
        h += dot(h, h.yzx + 33.33);
        h = fract((h.xxy + h.yzz) * h.zyx) * 2.0 - 1.0;
        vec3 tilt = u_cells[4 * k].xyz * (size.z * h.x) + u_cells[4 * k + 1].xyz * (size.w * h.y);
        n = unit_or(n + CELL_TILT * (R * tilt), n);
        return 1.0 + CELL_UNLIKE * h.z;
    }
    return 1.0;
}
