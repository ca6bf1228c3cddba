// The atmosphere's physics. CPU twin: simulator/scene/illumination/atmosphere.py; the names are the same.
// Lengths in metres from the Earth's centre, in the space where the ellipsoid is a sphere.
#include "common/bands.glsl"

// Density relative to sea level of Rayleigh scatterers and aerosol, and of ozone relative to its peak [1].
vec3 density(float height_m) {
    float h = max(height_m, 0.0);
    return vec3(exp(-h * u_air_shape.x), exp(-h * u_air_shape.y), max(1.0 - abs(h - OZONE_HEIGHT_M) / OZONE_HALF_WIDTH_M, 0.0));
}

// Extinction [m-1] of a density triple.
color extinction_m(vec3 d) {
    return d.x * BAND(u_air_rayleigh) + d.y * BAND(u_air_mie_extinction) + d.z * BAND(u_air_ozone);
}

// Rayleigh phase function [sr-1].
float rayleigh_phase(float c) { return 3.0 / (16.0 * PI) * (1.0 + c * c); }

// Phase function of Cornette & Shanks (1992) [sr-1].
float mie_phase(float c, float g) {
    float k = 3.0 / (8.0 * PI) * (1.0 - g * g) / (2.0 + g * g);
    float x = max(1.0 + g * g - 2.0 * g * c, 1e-4); // 1e-4: rounding at c = 1
    return k * (1.0 + c * c) / (x * sqrt(x));
}
