// Densities, extinction and phase functions of the atmosphere. CPU twin with the same names:
// simulator/scene/illumination/atmosphere.py. Radii in metres, in coordinates where the ellipsoid is a sphere.
#include "common/bands.glsl"

// Density of air and of aerosol relative to sea level, and of ozone relative to its peak [1].
vec3 density(float height_m) {
    float h = max(height_m, 0.0);
    vec4 fall = u_air_falls[0] * max(h - u_air_layers[0], 0.0);
    fall += u_air_falls[1] * max(h - u_air_layers[1], 0.0) + u_air_falls[2] * max(h - u_air_layers[2], 0.0);
    return vec3(exp(-dot(fall, vec4(1.0))), exp(-h * u_air_shape.y), max(1.0 - abs(h - OZONE_HEIGHT_M) / OZONE_HALF_WIDTH_M, 0.0));
}

// Extinction coefficient [m-1]; d: densities from density().
color extinction_m(vec3 d) {
    return d.x * BAND(u_air_rayleigh) + d.y * BAND(u_air_mie_extinction) + d.z * BAND(u_air_ozone);
}

// Rayleigh phase function [sr-1].
float rayleigh_phase(float c) { return 3.0 / (16.0 * PI) * (1.0 + c * c); }

// Phase function of Cornette & Shanks (1992) [sr-1].
float mie_phase(float c, float g) {
    float k = 3.0 / (8.0 * PI) * (1.0 - g * g) / (2.0 + g * g);
    float x = max(1.0 + g * g - 2.0 * g * c, 1e-4); // 1e-4: guards against rounding at c = 1
    return k * (1.0 + c * c) / (x * sqrt(x));
}

// Path of a ray from space through the airglow, relative to a vertical path [1]. perigee2: square of its smallest radius
// [m2]. The emission profile (r^2 - low^2) (high^2 - r^2) has a closed-form integral. CPU twin: airglow_path.
float airglow_path(bool ground_ray, float perigee2) {
    float low = u_air_shape.x, high = u_air_shape.w, middle = 0.5 * (low + high);
    if (ground_ray) return middle * inversesqrt(middle * middle - perigee2); // thin layer: no cancellation
    float a = low * low - perigee2, b = high * high - perigee2;
    vec2 t = sqrt(max(vec2(a, b), 0.0));
    vec2 whole = t * (t * t * ((a + b) / 3.0 - 0.2 * t * t) - a * b);
    float thick = high - low;
    return 3.0 * (whole.y - whole.x) / (middle * middle * thick * thick * thick);
}
