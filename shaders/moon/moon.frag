// Radiance of the Moon [W m-2 sr-1], behind or below the target.
//
// Compile-time switches: GLOBE: the globe may hide it. AIR: the globe's air may dim it. COVERED: the target may be in
// front. SMOOTH: tiles of ground only, values interpolated between their corners. MAP_AT_CORNERS: the albedo, too.
#include "atmosphere/air.glsl"
#include "globe/geometry.glsl"
#include "globe/aerial.glsl"
#include "moon/point.glsl"
uniform sampler2D t_coverage;
// Large craters: slopes along u and v, brightness, deviation of slopes within a texel; simulator/celestial/craters.py.
uniform sampler2D t_broad;
uniform sampler2D t_fine;    // the same for small craters
#if SMOOTH
in vec4 v_place, v_tilt, v_light, v_incident;
#if MAP_AT_CORNERS
in float v_albedo;
#endif
#endif
layout(location = 0) out vec4 out_radiance;

// Radiance of the ground [W m-2 sr-1].
color ground_radiance(MoonPoint g) {
    float level = g.light.w;
#if SAMPLES == 1
    level -= 0.25 * log2(max(g.light.y, 0.02)); // anisotropic footprint at oblique view: a compromise
#endif
#if MAP_AT_CORNERS
    float albedo = v_albedo;
#else
    float albedo = moon_albedo(g);
#endif
    vec4 broad = textureLod(t_broad, g.place.zw / BROAD_KM, level - log2(BROAD_KM / 1024.0));
    vec4 fine = textureLod(t_fine, mat2(0.8, 0.6, -0.6, 0.8) * g.place.zw / FINE_KM, level - log2(FINE_KM / 1024.0));
    // maria (dark) are younger: fewer and smaller craters
    float age = clamp(albedo * 1.6 - 0.7, 0.15, 1.0);
    vec2 wall = (broad.xy - 0.5) * (2.0 * SLOPE_MAX * age);
    vec2 small = (fine.xy - 0.5) * mat2(0.8, 0.6, -0.6, 0.8) * (2.0 * SLOPE_MAX * (0.5 + 0.5 * age));
#if SAMPLES > 1
    // small craters fade near the shadow of a crater wall, where they would cast no shadows
    small *= smoothstep(0.0, 0.1, g.light.x - dot(wall, g.tilt.xy));
#endif
    vec2 slope = wall + small;
    albedo *= 1.0 + 0.8 * (fine.z + broad.z - 1.0);
    float facet = inversesqrt(1.0 + dot(slope, slope));
    // with the Sun below the horizon, facets that face it are in shadow
    float dawn = smoothstep(-0.03, 0.05, g.light.x);
    vec2 cosines = (g.light.xy - vec2(dot(slope, g.tilt.xy), dot(slope, g.tilt.zw))) * facet;
    // slopes below a texel's size: parts of the texel may face the Sun although their mean does not
    vec2 hidden = vec2(broad.w * age, fine.w * (0.5 + 0.5 * age)) * DEVIATION_MAX;
    float lit = 0.5 * (cosines.x + sqrt(cosines.x * cosines.x + 0.32 * dot(hidden, hidden) * dot(g.tilt.xy, g.tilt.xy)));
    // small craters on a wall that faces away from the Sun are dark, except for walls below a texel's size
    float behind = g.light.x - dot(wall, g.tilt.xy) + hidden.x * length(g.tilt.xy);
    lit *= smoothstep(-0.03, 0.03, behind);
    float from_sun = reflected(lit * dawn, cosines.y, g.light.z);
    return (BAND(g.incident) * from_sun + g.incident.w) * albedo * BAND(u_moon_albedo) * BAND(u_moon_irradiance) * (1.0 / PI);
}

void main() {
    vec2 pixel = gl_FragCoord.xy - 0.5;
    float open = 1.0;
#if COVERED
    open -= textureLod(t_coverage, gl_FragCoord.xy / vec2(textureSize(t_coverage, 0)), 0.0).x;
#endif
#if !SMOOTH
    MoonRay ray = moon_ray(pixel);
    float share = moon_share(ray);
    open *= share;
#endif
    if (open <= 0.0) discard;
    color through = color(1.0);
#if GLOBE
    GlobeRay past = globe_ray(pixel);
    if (!past.away) {
        through *= 1.0 - limb_share(past);
#if AIR
        if (past.perigee2 < u_globe_limits.y) {
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
#if SMOOTH
    color radiance = ground_radiance(MoonPoint(v_place, v_tilt, v_light, v_incident));
#elif SAMPLES == 1
    color radiance = ground_radiance(moon_point(ray, moon_depth(ray, share), 1.0));
#else
    // a grazing view stretches the pixel's footprint: several rays per pixel, on a rank-1 lattice
    color radiance = color(0.0);
    float inside = 1e-6;
    for (int k = 0; k < SAMPLES; ++k) {
        vec2 at = vec2(float(k), mod(float(k) * float(STRIDE), float(SAMPLES))) + 0.5;
        MoonRay one = moon_ray(pixel + at / float(SAMPLES) - 0.5);
        // weight of a ray across the limb; 1.4: hides the steps of texture filtering, 1/256 texel
        float part = moon_share(one);
        inside += part;
        radiance += part * ground_radiance(moon_point(one, moon_depth(one, part), 1.4 * inversesqrt(float(SAMPLES))));
    }
    radiance *= 1.0 / inside;
#endif
    out_radiance = OUT(radiance * through * open);
}
