// Radiance of the Sun's disc [W m-2 sr-1], behind the target, the globe and the air.
#include "atmosphere/air.glsl"
#include "globe/geometry.glsl"
#include "globe/aerial.glsl"
#include "moon/disc.glsl"
uniform sampler2D t_coverage;
uniform vec4 u_sun_disc; // xyz: direction, camera frame; w: sine of the angular radius
uniform vec4 u_sun_full_irradiance; // per band [W m-2]
layout(location = 0) out vec4 out_radiance;

void main() {
    vec2 pixel = gl_FragCoord.xy - 0.5;
    vec3 d = normalize(camera_ray(pixel));
    float pixel_rad = ray_pixel_rad(pixel, d.z);
    float s = length(cross(d, u_sun_disc.xyz)); // sine of the angle from the centre
    float edge = clamp((u_sun_disc.w - s) / pixel_rad + 0.5, 0.0, 1.0);
    if (edge <= 0.0) discard;
    float x = min(s / u_sun_disc.w, 1.0);
    float profile = (1.0 - LIMB_DARKENING * (1.0 - sqrt(1.0 - x * x))) / (1.0 - LIMB_DARKENING / 3.0); // mean 1 over the disc
    color radiance = BAND(u_sun_full_irradiance) * (profile * edge / (PI * u_sun_disc.w * u_sun_disc.w));
#if MOON
    radiance *= 1.0 - moon_share(moon_ray(pixel));
#endif
#if GLOBE
    GlobeRay ray = globe_ray(pixel);
    if (!ray.away) {
        radiance *= 1.0 - limb_share(ray);
#if AIR
        if (ray.perigee2 < u_globe_limits.y) {
            vec2 uv = table_uv(ray, false);
#if BANDS == 1
            radiance *= textureLod(t_air, uv, 0.0).z;
#else
            radiance *= textureLod(t_air_transmittance, uv, 0.0).xyz;
#endif
        }
#endif
    }
#endif
    out_radiance = OUT(radiance * (1.0 - texelFetch(t_coverage, ivec2(gl_FragCoord.xy), 0).x));
}
