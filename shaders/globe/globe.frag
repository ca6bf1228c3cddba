// Radiance of a body with Lambertian ground, and of its air [W m-2 sr-1], added behind the target.
// Coordinates: see shaders/globe/geometry.glsl.
#include "atmosphere/air.glsl"
#include "globe/geometry.glsl"
#include "globe/aerial.glsl"
#include "globe/ground_air.glsl"
uniform sampler2D t_coverage;
uniform sampler2D t_albedo; // equirectangular, north up
layout(location = 0) out vec4 out_radiance;

// Albedo at the ellipsoid's normal n. along: distance from the camera; depth: half the ray's chord in the unit sphere.
float albedo_at(GlobeRay ray, vec3 n, float along, float depth) {
    // longitude relative to the camera's meridian, so that its discontinuity is never in view
    vec2 meridian = u_globe_meridian.xy;
    float east = atan(meridian.x * n.y - meridian.y * n.x, dot(meridian, n.xy));
    vec2 uv = vec2((east + u_globe_meridian.z) * (0.5 / PI) + 0.5, 0.5 - asin(clamp(n.z, -1.0, 1.0)) / PI);
    float footprint = along * ray.pixel_rad * inversesqrt(max(depth, 0.02)); // 0.02: limit at the limb
    return textureLod(t_albedo, uv, log2(footprint * float(textureSize(t_albedo, 0).y) / PI)).x;
}

void main() {
    float open = 1.0 - texelFetch(t_coverage, ivec2(gl_FragCoord.xy), 0).x;
    GlobeRay ray = globe_ray(gl_FragCoord.xy - 0.5);
    if (open <= 0.0 || ray.away || ray.perigee2 > u_globe_limits.y) discard;
    float share = limb_share(ray); // fraction of the pixel that the ground fills
    color radiance = color(0.0);
    if (share > 0.0) {
        float depth = sqrt(max(ray.disc, 0.0));
        float along = -ray.along - depth;
        vec3 p = u_globe_camera.xyz + along * ray.direction, sun = u_globe_sun.xyz;
        vec3 n = normalize(vec3(p.xy, p.z * u_globe_limits.z)); // normal of the ellipsoid in unstretched axes
        float mu = dot(n, normalize(vec3(sun.xy, sun.z / u_globe_limits.z)));
#if AIR
        GroundAir air = table_air(ray);
#if BANDS == 1
        color light = color(air.light);
#else
        color light = daylight(mu);
#endif
#else
        GroundAir air = GroundAir(color(0.0), color(1.0), 0.0);
        color light = color(max(mu, 0.0));
#endif
        light *= air.through * (albedo_at(ray, n, along, depth) / PI);
        radiance = share * (light + air.haze) * BAND(u_globe_irradiance);
    }
    if (share < 1.0) radiance += (1.0 - share) * air_radiance(ray);
    out_radiance = OUT(radiance * open);
}
