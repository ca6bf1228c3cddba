// Light on the ground, and the air between it and the camera.
#if AIR && (BANDS == 3 || MOONLIT) && !defined(MARCH)
uniform sampler2D t_ground; // irradiance on level ground over the Sun's, by the cosine of its zenith angle
#endif

#if AIR && (BANDS == 3 || MOONLIT)
// Irradiance on level ground over that above the air, by the cosine of its source's zenith angle [1].
color daylight(float mu) {
    float x = clamp((mu - GROUND_MU_MIN) / (1.0 - GROUND_MU_MIN), 0.0, 1.0);
    float column = (x * float(GROUND_SAMPLES - 1) + 0.5) / float(GROUND_SAMPLES);
    return BAND(textureLod(t_ground, vec2(column, 0.5), 0.0));
}
#endif

// Air between the camera and a ground point.
struct GroundAir {
    color haze;    // its radiance over the Sun's irradiance [sr-1]
    color through; // transmittance
    float light;   // BANDS 1: irradiance on level ground over the Sun's
};

// In-scatter of both kinds as radiance; along a unit vector.
color scattered(color rayleigh, color mie, vec3 direction) {
    float c = dot(direction, u_globe_sun.xyz);
    return rayleigh * rayleigh_phase(c) + mie * mie_phase(c, u_air_shape.z);
}

#if AIR && !SMOOTH
// The air in front of a ray that meets the ground, from this frame's table.
GroundAir table_air(GlobeRay ray) {
    vec2 table = table_uv(ray, true);
#if BANDS == 1
    vec4 air = textureLod(t_air, table, 0.0);
    return GroundAir(scattered(air.x, air.y, ray.direction), air.z, air.w);
#else
    vec3 rayleigh = textureLod(t_air_rayleigh, table, 0.0).xyz, mie = textureLod(t_air_mie, table, 0.0).xyz;
    return GroundAir(scattered(rayleigh, mie, ray.direction), textureLod(t_air_transmittance, table, 0.0).xyz, 0.0);
#endif
}
#endif
