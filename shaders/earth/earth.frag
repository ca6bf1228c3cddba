// The Earth and its air behind the target: radiance to add [W m-2 sr-1].
// Space: Earth-fixed axes, the polar one stretched so that the WGS84 ellipsoid is the unit sphere.
// SMOOTH: the cell is all ground, away from limb and poles. COVERED: the target may be in front. MOON: the Moon may.
// FOURS: a fragment is two by two pixels of a smooth cell; MAGNIFIED: the map's texels are wider
// than six pixels, so that the map is a plane over the four.
#include "atmosphere/air.glsl"
#include "earth/geometry.glsl"
#include "earth/aerial.glsl"
#include "earth/point.glsl"
#include "earth/surface.glsl"
#if MOON
#include "moon/disc.glsl"
#endif

#if SMOOTH
#define STAGE in
#include "earth/plane.glsl"
#define AT(name) (v_##name[0] + x.x * v_##name[1] + x.y * v_##name[2])
#if HIGH
#define LIFT AT(lift)
#define RIPPLE AT(ripple)
#else
#define LIFT vec4(v_lift, at.xy)
#define RIPPLE 0.0
#endif

// What a pixel sees of the ground; x: from the cell's middle, in half cells.
GroundPoint ground_at(vec2 x) {
    vec4 at = AT(uv_plane), sun = AT(sun); // sun: toward, sharp, glint
    vec4 lift = LIFT;
    return GroundPoint(
        at.xy, at.zw, lift.xy, lift.zw, sun.xy, sun.z, 0.0, AT(rough), AT(tone), sun.w, RIPPLE, AT(light), AT(lamps), AT(haze)
    );
}
#endif
uniform sampler2D t_coverage;
layout(location = 0) out vec4 out_radiance; // FOURS: of the upper left, upper right, lower left, lower right pixel

#if FOURS
void main() {
#if COVERED
    ivec2 first = 2 * ivec2(gl_FragCoord.xy);
#define OPEN(i, j) (1.0 - texelFetch(t_coverage, first + ivec2(i, j), 0).x)
    vec4 open = vec4(OPEN(0, 0), OPEN(1, 0), OPEN(0, 1), OPEN(1, 1));
    if (max(max(open.x, open.y), max(open.z, open.w)) <= 0.0) discard;
#endif
    vec2 x = (2.0 * gl_FragCoord.xy - v_middle.xy) * v_middle.z;
    float step_x = 0.5 * v_middle.z; // from the middle of the four to the middle of one
    GroundPoint middle = ground_at(x);
    Waters waters = waters_at(middle);
#if MAGNIFIED
    // neighbours share their slope, so that the map goes on without a step
    vec4 map = ground_map(middle), map_x = 0.25 * dFdx(map), map_y = 0.25 * dFdy(map);
#endif
    for (int k = 0; k < 4; ++k) {
        vec2 side = vec2(float((k & 1) * 2 - 1), float((k & 2) - 1));
        GroundPoint g = ground_at(x + step_x * side);
        // what hardly changes from one pixel to the next is taken at their middle
        g.toward = middle.toward;
        g.sharp = middle.sharp;
        g.rough = middle.rough;
        g.tone = middle.tone;
        g.lamps = middle.lamps;
#if MAGNIFIED
        // where a texel begins, its neighbour's slope may lead below darkness
        out_radiance[k] = surface_radiance(g, clamp(map + side.x * map_x + side.y * map_y, 0.0, 1.0), waters);
#else
        out_radiance[k] = surface_radiance(g, ground_map(g), waters);
#endif
    }
#if COVERED
    out_radiance *= open;
#endif
}
#else
void main() {
    float open = 1.0;
#if COVERED
    open -= texelFetch(t_coverage, ivec2(gl_FragCoord.xy), 0).x;
    if (open <= 0.0) discard;
#endif
#if MOON
    open *= 1.0 - moon_share(moon_ray(gl_FragCoord.xy - 0.5)); // the Moon in front, seen from its orbit
#endif
#if SMOOTH
    vec2 x = (gl_FragCoord.xy - v_middle.xy) * v_middle.z;
    GroundPoint g = ground_at(x);
    color radiance = surface_radiance(g, ground_map(g), waters_at(g));
#else
    EarthRay ray = earth_ray(gl_FragCoord.xy - 0.5);
    if (ray.away || ray.perigee2 > u_earth_limits.y) discard;
    float share = limb_share(ray); // of the pixel that the ground fills
    color radiance = color(0.0);
    if (share > 0.0) {
        GroundPoint g = ground_point(ray);
        radiance = share * surface_radiance(g, ground_map(g), waters_at(g));
    }
    if (share < 1.0) radiance += (1.0 - share) * air_radiance(ray);
#endif
    out_radiance = OUT(radiance * open);
}
#endif
