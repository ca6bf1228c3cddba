// The intersection of a ray with the Moon, and the light there: all values that vary smoothly between pixels.
#include "moon/disc.glsl"
uniform sampler2D t_moon;    // normal albedo over 2.5 times its mean on the near side
uniform sampler2D t_phase;   // phase function relative to phase 0, against phase angle / pi
uniform sampler2D t_umbra;   // transmitted fraction of sunlight per band, against the angle from the Earth's shadow axis

struct MoonPoint {
    vec4 place;     // xy: coordinates in the map; zw: position in crater_plane [km]
    vec4 tilt;      // in crater_plane, xy: horizontal direction to the Sun, zw: to the camera; length: sine of zenith angle
    vec4 light;     // xy: cosines of the zenith angles of Sun and camera; z: phase function; w: log2(footprint [km])
    vec4 incident;  // xyz: sunlight per band; w: reflected earthshine; both over the Sun's irradiance
};

// Stereographic coordinates of a unit vector in either hemisphere, and the image of a tangent vector with its length kept.
vec2 crater_plane(vec3 p) { return p.xy / (1.0 + abs(p.z)) * 2.0 + vec2(0.12, -0.08) * p.z; }
vec2 crater_vector(vec3 p, vec3 w) { return w.xy - p.xy * (sign(p.z) * w.z / (1.0 + abs(p.z))); }

float moon_phase(float cosine) { return textureLod(t_phase, vec2(acos(clamp(cosine, -1.0, 1.0)) * (1.0 / PI), 0.5), 0.0).x; }

// Radiance over irradiance at normal incidence, times pi: Lommel-Seeliger law with the phase function of the whole disc.
float reflected(float mu_sun, float mu_view, float phase) {
    // at grazing light, relief below the pixel's size casts shadows
    float lit = mu_sun * clamp(mu_sun * 20.0, 0.0, 1.0);
    return 2.0 * lit / (lit + max(mu_view, 0.02)) * phase; // 0.02: a facet seen edge-on
}

// depth: of moon_depth(); footprint: size of the ray's footprint over that of a pixel.
MoonPoint moon_point(MoonRay ray, float depth, float footprint) {
    MoonPoint g;
    float t = -ray.along - depth;
    vec3 p = normalize(u_moon_camera.xyz + t * ray.direction);
    vec3 view = -ray.direction, sun = u_moon_sun.xyz, earth = u_moon_earth.xyz;
    // longitude relative to the camera's meridian, so that its discontinuity is never in view
    vec2 meridian = u_moon_meridian.xy;
    float east = atan(meridian.x * p.y - meridian.y * p.x, dot(meridian, p.xy));
    g.place = vec4((east + u_moon_meridian.z) * (0.5 / PI) + 0.5, 0.5 - asin(clamp(p.z, -1.0, 1.0)) / PI, crater_plane(p) * MOON_KM);
    float mu_view = max(dot(p, view), 0.0), mu_sun = dot(p, sun);
    g.tilt = vec4(crater_vector(p, sun - mu_sun * p), crater_vector(p, view - mu_view * p));
    g.light = vec4(
        mu_sun, mu_view, moon_phase(dot(view, sun)),
        log2(footprint * t * ray.pixel_rad * MOON_KM * inversesqrt(max(mu_view, 0.02)))
    );
    float angle = length(cross(p + u_moon_shadow.xyz, u_moon_shadow_axis.xyz)) / u_moon_shadow.w;
    g.incident = vec4(
        textureLod(t_umbra, vec2(angle, 0.5), 0.0).xyz,
        reflected(dot(p, earth), mu_view, moon_phase(dot(view, earth))) * u_moon_earth.w
    );
    return g;
}

// Albedo from the map, relative to the mean of the near side.
float moon_albedo(MoonPoint g) { return textureLod(t_moon, g.place.xy, g.light.w - log2(TEXEL_KM)).x * 2.5; }
