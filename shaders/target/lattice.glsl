// The sampling lattice in a shader; see simulator/render/target/sample_pattern.py.

// Image coordinates [px] of lattice coordinates, both relative to the same place.
vec2 pixel_from_lattice(vec2 st) {
    vec2 s = vec2(LATTICE_S), t = vec2(LATTICE_T);
    return vec2(s.y * st.y - t.y * st.x, t.x * st.x - s.x * st.y) / float(SAMPLES);
}

// Offset [px] of a lattice sample from its pixel's centre.
vec2 sample_offset(ivec2 at) { return pixel_from_lattice(vec2(at) + vec2(LATTICE_PHASE, 0.0)); }

// The sample that lies nearest to a place [px from the pixel's centre], as steps along the lattice's axes.
ivec2 sample_near(vec2 place) {
    vec2 steps = vec2(dot(vec2(LATTICE_S), place) - LATTICE_PHASE, dot(vec2(LATTICE_T), place));
    return ivec2(floor(steps + 0.5));
}

// Where in the lattice's buffer a pixel's own index is.
ivec2 pixel_index(ivec2 pixel) {
    ivec2 s = LATTICE_S * pixel, t = LATTICE_T * pixel;
    return ivec2(s.x + s.y, t.x + t.y) - ivec2(u_lattice.xy);
}
