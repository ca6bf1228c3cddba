// Irradiance on the ground, and the air between ground and camera.
#if AIR && (BANDS == 3 || MOONLIT) && !defined(MARCH)
uniform sampler2D t_ground; // irradiance on level ground over the Sun's, against mu
#endif

#if AIR && (BANDS == 3 || MOONLIT)
// Irradiance on level ground over that above the air [1]; mu: cosine of the Sun's (or Moon's) zenith angle.
color daylight(float mu) {
    float x = clamp((mu - GROUND_MU_MIN) / (1.0 - GROUND_MU_MIN), 0.0, 1.0);
    float column = (x * float(GROUND_SAMPLES - 1) + 0.5) / float(GROUND_SAMPLES);
    return BAND(textureLod(t_ground, vec2(column, 0.5), 0.0));
}
#endif

// Air between the camera and a ground point.
struct GroundAir {
    color haze;    // radiance over the Sun's irradiance [sr-1]
    color through; // transmittance
    float light;   // irradiance on level ground over the Sun's [1]; only if BANDS == 1
};

// Rayleigh and Mie in-scatter times their phase functions [sr-1]. direction: unit vector of the ray.
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
