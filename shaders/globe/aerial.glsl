// Radiance of the air along rays that miss the ground, from this frame's table (shaders/atmosphere/table.frag).

#if AIR
#if BANDS == 1
uniform sampler2D t_air;
#else
uniform sampler2D t_air_rayleigh;
uniform sampler2D t_air_mie;
uniform sampler2D t_air_transmittance;
#endif

// Table coordinates of a ray; see shaders/atmosphere/table.frag.
vec2 table_uv(GlobeRay ray, bool ground_ray) {
    float v = sqrt(clamp(ground_ray ? ray.disc : -ray.disc / (u_globe_limits.y - 1.0), 0.0, 1.0));
    float row = v * float(ROWS - 1) + (ground_ray ? 0.5 : float(ROWS) + 0.5);
    float column = (sun_azimuth(ray) * 0.5 + 0.5) * float(COLUMNS - 1) + 0.5;
    return vec2(column / float(COLUMNS), row / float(2 * ROWS));
}
#endif

// Radiance of the air with nothing behind it [W m-2 sr-1].
color air_radiance(GlobeRay ray) {
#if AIR
    vec2 uv = table_uv(ray, false);
    float c = dot(ray.direction, u_globe_sun.xyz);
    float pr = rayleigh_phase(c), pm = mie_phase(c, u_air_shape.z);
#if BANDS == 1
    vec4 light = textureLod(t_air, uv, 0.0);
    color scattered = light.x * pr + light.y * pm;
#else
    color scattered = textureLod(t_air_rayleigh, uv, 0.0).xyz * pr + textureLod(t_air_mie, uv, 0.0).xyz * pm;
#endif
    return scattered * BAND(u_globe_irradiance);
#else
    return color(0.0);
#endif
}
