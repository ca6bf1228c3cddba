// Radiance of the Earth and its air along given rays around the nadir, read back by simulator/render/earth/shine.py.
#include "atmosphere/march.glsl"
#include "globe/geometry.glsl"
#include "globe/aerial.glsl"
#include "earth/point.glsl"
#include "earth/surface.glsl"
in vec4 in_ray; // unit vector, globe space; angular size of a sample [rad]
out color v_light; // [W m-2 sr-1]

void main() {
    GlobeRay ray = ray_along(in_ray.xyz, in_ray.w);
    bool ground_ray = ray.disc > 0.0;
    v_light = color(0.0);
#if AIR
    float v = sqrt(clamp(ground_ray ? ray.disc : -ray.disc / (u_globe_limits.y - 1.0), 0.0, 1.0));
    AirLight light = air_light(ground_ray, v, sun_azimuth(ray));
    GroundAir air = GroundAir(scattered(light.rayleigh, light.mie, ray.direction), light.through, 0.0);
#if BANDS == 1
    air.light = ground_irradiance(dot(light.foot, light.sun) / u_air_radius.x);
#endif
    v_light = air.haze * BAND(u_globe_irradiance);
#else
    GroundAir air = GroundAir(color(0.0), color(1.0), 0.0);
#endif
    if (ground_ray) {
        GroundPoint g = ground_point(ray, air);
        v_light = ground_radiance(g, waters_at(g));
    }
}
