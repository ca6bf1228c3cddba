// Air in front of the ground at tile corners, relative to the Sun's irradiance; read back by
// simulator/render/globe/air_pass.py. Computed by ray marching: a lookup in the frame's table would stall earth.vert until
// the table is drawn.
#include "atmosphere/march.glsl"
#include "globe/geometry.glsl"
in vec2 in_pixel; // a corner [px]
#if BANDS == 1
out vec3 v_air;     // radiance [sr-1], transmittance, irradiance on level ground
#else
out vec3 v_haze;    // radiance [sr-1]
out vec3 v_through; // transmittance
#endif

void main() {
    GlobeRay ray = globe_ray(in_pixel);
    AirLight light = air_light(true, sqrt(clamp(ray.disc, 0.0, 1.0)), sun_azimuth(ray));
    float c = dot(ray.direction, u_globe_sun.xyz);
    color haze = light.rayleigh * rayleigh_phase(c) + light.mie * mie_phase(c, u_air_shape.z);
#if BANDS == 1
    v_air = vec3(haze, light.through, ground_irradiance(dot(light.foot, light.sun) / u_air_radius.x));
#else
    v_haze = haze;
    v_through = light.through;
#endif
}
