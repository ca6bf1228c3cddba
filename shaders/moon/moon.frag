// The Moon behind the target, or below it [W m-2 sr-1]. EARTH: the Earth may hide it, AIR: and its air dim it.
#include "atmosphere/air.glsl"
#include "earth/geometry.glsl"
#include "earth/aerial.glsl"
#include "moon/disc.glsl"
uniform sampler2D t_coverage;
uniform sampler2D t_moon;    // normal albedo over its mean on the near side, / 2.5
uniform sampler2D t_broad;   // slopes along u and v, brightness of craters; simulator/render/moon/craters.py
uniform sampler2D t_fine;    // the same of smaller ones
uniform sampler2D t_phase;   // phase function over that of zero phase, by the phase angle over pi
uniform sampler2D t_umbra;   // share of the Sun's light per band, by the angle from the axis of the Earth's shadow
layout(location = 0) out vec4 out_radiance;

const float MOON_KM = 1737.4;
const float TEXEL_KM = 2.665;                  // of the map, at the equator
const float BROAD_KM = 403.0, FINE_KM = 63.0;  // periods of the two tiles of craters

// Stereographic plane of each hemisphere, and the image there of a tangent vector, its length kept.
vec2 crater_plane(vec3 p) { return p.xy / (1.0 + abs(p.z)) * 2.0 + vec2(0.12, -0.08) * p.z; }
vec2 crater_vector(vec3 p, vec3 w) { return w.xy - p.xy * (sign(p.z) * w.z / (1.0 + abs(p.z))); }

// Reflected over incident light, times pi: Lommel-Seeliger with the phase function of the whole disc.
float reflected(float mu_sun, float mu_view, float cosine) {
    // where the Sun grazes it, some of it is in the shade of what is smaller than the pixel
    float lit = mu_sun * clamp(mu_sun * 20.0, 0.0, 1.0);
    float phase = textureLod(t_phase, vec2(acos(clamp(cosine, -1.0, 1.0)) * (1.0 / PI), 0.5), 0.0).x;
    return 2.0 * lit / (lit + max(mu_view, 0.02)) * phase; // 0.02: a facet seen edge-on
}

// Radiance of the ground where a ray meets it [W m-2 sr-1]; footprint: of what the ray stands for, over the pixel's.
color ground_radiance(MoonRay ray, float share, float footprint) {
    float depth = moon_depth(ray, share);
    float t = -ray.along - depth;
    vec3 p = normalize(u_moon_camera.xyz + t * ray.direction);
    vec3 view = -ray.direction, sun = u_moon_sun.xyz, earth = u_moon_earth.xyz;
    // longitude from the camera's meridian, so that the angle's jump is never in view
    vec2 meridian = u_moon_meridian.xy;
    float east = atan(meridian.x * p.y - meridian.y * p.x, dot(meridian, p.xy));
    vec2 uv = vec2((east + u_moon_meridian.z) * (0.5 / PI) + 0.5, 0.5 - asin(clamp(p.z, -1.0, 1.0)) / PI);
    float mu_view = max(dot(p, view), 0.0);
    float level = log2(footprint * t * ray.pixel_rad * MOON_KM * inversesqrt(max(mu_view, 0.02)));
    float albedo = textureLod(t_moon, uv, level - log2(TEXEL_KM)).x * 2.5;
    vec2 plane = crater_plane(p) * MOON_KM;
    vec4 broad = textureLod(t_broad, plane / BROAD_KM, level - log2(BROAD_KM / 1024.0));
    vec4 fine = textureLod(t_fine, mat2(0.8, 0.6, -0.6, 0.8) * plane / FINE_KM, level - log2(FINE_KM / 1024.0));
    // the maria are younger: fewer and smaller craters
    float age = clamp(albedo * 1.6 - 0.7, 0.15, 1.0);
    vec2 slope = (broad.xy - 0.5) * (2.0 * SLOPE_MAX * age) + (fine.xy - 0.5) * mat2(0.8, 0.6, -0.6, 0.8) * (2.0 * SLOPE_MAX);
    albedo *= 1.0 + 0.35 * (fine.z - 0.5) + 0.25 * (broad.z - 0.5);
    float facet = inversesqrt(1.0 + dot(slope, slope));
    float mu_sun = dot(p, sun);
    float tilt_sun = dot(slope, crater_vector(p, sun - mu_sun * p));
    float tilt_view = dot(slope, crater_vector(p, view - mu_view * p));
    // facets that face the Sun below the horizon lie in the shadow of others
    float dawn = smoothstep(-0.03, 0.05, mu_sun);
    float from_sun = reflected((mu_sun - tilt_sun) * facet * dawn, (mu_view - tilt_view) * facet, dot(view, sun));
    float from_earth = reflected(dot(p, earth), mu_view, dot(view, earth)) * u_moon_earth.w;
    color sunlight = BAND(textureLod(t_umbra, vec2(length(cross(p + u_moon_shadow.xyz, u_moon_shadow_axis.xyz)) / u_moon_shadow.w, 0.5), 0.0));
    return (sunlight * from_sun + from_earth) * albedo * BAND(u_moon_albedo) * BAND(u_moon_irradiance) * (1.0 / PI);
}

void main() {
    vec2 pixel = gl_FragCoord.xy - 0.5;
    float open = 1.0 - texelFetch(t_coverage, ivec2(gl_FragCoord.xy), 0).x;
    MoonRay ray = moon_ray(pixel);
    float share = moon_share(ray);
    open *= share;
    if (open <= 0.0) discard;
    color through = color(1.0);
#if EARTH
    EarthRay past = earth_ray(pixel);
    if (!past.away) {
        through *= 1.0 - limb_share(past);
#if AIR
        if (past.perigee2 < u_earth_limits.y) {
            vec2 uv = table_uv(past, false);
#if BANDS == 1
            through *= textureLod(t_air, uv, 0.0).z;
#else
            through *= textureLod(t_air_transmittance, uv, 0.0).xyz;
#endif
        }
#endif
    }
#endif
#if SAMPLES == 1
    color radiance = ground_radiance(ray, share, 1.0);
#else
    // a grazing view stretches the ground under a pixel: rays on a lattice of rank one, none in the other's row or column
    color radiance = color(0.0);
    float inside = 1e-6;
    for (int k = 0; k < SAMPLES; ++k) {
        vec2 at = vec2(float(k), mod(float(k) * float(STRIDE), float(SAMPLES))) + 0.5;
        MoonRay one = moon_ray(pixel + at / float(SAMPLES) - 0.5);
        // a ray that comes over the limb comes in by degrees; 1.4: what textures are filtered by, 1/256 texel, must not show
        float part = moon_share(one);
        inside += part;
        radiance += part * ground_radiance(one, part, 1.4 * inversesqrt(float(SAMPLES)));
    }
    radiance *= 1.0 / inside;
#endif
    out_radiance = OUT(radiance * through * open);
}
