// The supersampling pattern in a shader; see simulator/render/craft/sample_pattern.py.

// Image coordinates [px] from pattern coordinates, both relative to the same point.
vec2 pixel_from_pattern(vec2 st) {
    vec2 s = vec2(PATTERN_S), t = vec2(PATTERN_T);
    return vec2(s.y * st.y - t.y * st.x, t.x * st.x - s.x * st.y) / float(SAMPLES);
}

// Offset [px] of a sample from its pixel's centre.
vec2 sample_offset(ivec2 at) { return pixel_from_pattern(vec2(at) + vec2(PATTERN_PHASE, 0.0)); }

// The sample nearest to a point [px from the pixel's centre], as steps along the pattern's axes.
ivec2 sample_near(vec2 place) {
    vec2 steps = vec2(dot(vec2(PATTERN_S), place) - PATTERN_PHASE, dot(vec2(PATTERN_T), place));
    return ivec2(floor(steps + 0.5));
}

// Index in the sample buffer of the sample at a pixel's centre.
ivec2 pixel_index(ivec2 pixel) {
    ivec2 s = PATTERN_S * pixel, t = PATTERN_T * pixel;
    return ivec2(s.x + s.y, t.x + t.y) - ivec2(u_pattern.xy);
}
