// Share of the Sun's disc that a point of the target sees past the target itself.
uniform sampler2DShadow t_shadow;

// Visibility of the Sun, 0..1, filtered over the blur of its disc (9 taps in a ring, hardware 2x2 each).
// p_m: camera frame [m]; n: unit geometric normal.
float sun_visibility(vec3 p_m, vec3 n) {
    float n_l = dot(n, u_sun_direction.xyz);
    if (n_l <= 0.0) return 0.0;
    // a point is tested slightly off its surface, along the normal, more at grazing light: by about the width of
    // the filter, which is what a flat face spans in depth under it
    float texel_m = u_shadow.x, radius = u_shadow.w;
    float slope = sqrt(max(1.0 - n_l * n_l, 0.0));
    vec3 q = (u_light_from_camera * vec4(p_m + n * (texel_m * (0.3 + (radius + 1.0) * slope)), 1.0)).xyz;
    float r = radius * u_shadow.z, d = 0.7071 * r;
    float sum = texture(t_shadow, q);
    sum += texture(t_shadow, q + vec3(d, d, 0.0)) + texture(t_shadow, q + vec3(-d, d, 0.0));
    sum += texture(t_shadow, q + vec3(d, -d, 0.0)) + texture(t_shadow, q + vec3(-d, -d, 0.0));
    if (sum == 0.0 || sum == 5.0) return sum / 5.0; // away from any shadow's edge
    sum += texture(t_shadow, q + vec3(r, 0.0, 0.0)) + texture(t_shadow, q + vec3(-r, 0.0, 0.0));
    sum += texture(t_shadow, q + vec3(0.0, r, 0.0)) + texture(t_shadow, q + vec3(0.0, -r, 0.0));
    return sum / 9.0;
}
