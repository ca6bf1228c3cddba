// Radiance of the Earth and its air [W m-2 sr-1], added behind the target.
// Coordinates: Earth-fixed axes, the polar one stretched so that the WGS84 ellipsoid is the unit sphere.
//
// Compile-time switches, 0 or 1:
// SMOOTH: the tile is all ground, away from limb and poles. AIR_ONLY: the tile has no ground.
// COVERED: the target may be in front. MOON: the Moon may be in front.
// QUADS: a fragment is two by two pixels of a smooth tile.
// MAGNIFIED: texels of the map are wider than six pixels, so the map is extrapolated linearly over the four pixels.
#include "atmosphere/air.glsl"
#include "globe/geometry.glsl"
#include "globe/aerial.glsl"
#include "earth/point.glsl"
#include "earth/surface.glsl"
#if MOON
#include "moon/disc.glsl"
#endif

#if SMOOTH
#define STAGE in
#include "earth/tile_plane.glsl"
#define AT(name) (v_##name[0] + x.x * v_##name[1] + x.y * v_##name[2])
#if HIGH
#define LIFT AT(lift)
#define RIPPLE AT(ripple)
#else
#define LIFT vec4(v_lift, at.xy)
#define RIPPLE 0.0
#endif

// The ground in a pixel. x: position from the tile's centre [half tiles].
GroundPoint ground_at(vec2 x) {
    vec4 at = AT(uv_plane), sun = AT(sun); // sun: toward, sharp, glint
    vec4 lift = LIFT;
    vec4 matter = AT(matter); // rough, thin, white, shine
    return GroundPoint(
        at.xy, at.zw, lift.xy, lift.zw, sun.xy, sun.z, 0.0, matter.x, matter.y, matter.z, matter.w, AT(tone), sun.w, RIPPLE, AT(light), AT(lamps), AT(haze)
    );
}
#endif
uniform sampler2D t_coverage;
uniform sampler2D t_radiance; // QUADS, COVERED: radiance of the target there
#if QUADS
#include "common/quads.glsl"

void main() {
    vec2 x = (2.0 * gl_FragCoord.xy - v_middle.xy) * v_middle.z;
    float step_x = 0.5 * v_middle.z; // from the centre of the four pixels to the centre of one
    GroundPoint middle = ground_at(x);
    Waters waters = waters_at(middle);
#if MAGNIFIED && !HIGH
    vec4 map = ground_map(middle);
    Surface surface = surface_at(middle, map, middle.uv, waters);
    vec2 place = detail_place(middle, map);
    // screen derivatives, shared by neighbours, so that values are continuous
#define SLOPE(type, value, name) type name##_x = 0.25 * dFdx(value), name##_y = 0.25 * dFdy(value);
    SLOPE(vec2, place, place)
    SLOPE(color, surface.land, land)
    SLOPE(float, surface.shore, shore)
    SLOPE(float, surface.share, share)
    SLOPE(float, surface.lit, lit)
#define ALONG(value, name) (value + side.x * name##_x + side.y * name##_y)
#endif
#if COVERED
    FOUR_COLORS(t_radiance, before)
    vec4 covered = four_of(t_coverage);
#endif
    color quad[4];
    for (int k = 0; k < 4; ++k) {
        vec2 side = vec2(float((k & 1) * 2 - 1), float((k & 2) - 1));
        GroundPoint g = ground_at(x + step_x * side);
        // values that hardly differ between the four pixels
        g.toward = middle.toward;
        g.sharp = middle.sharp;
        g.rough = middle.rough;
        g.thin = middle.thin;
        g.white = middle.white;
        g.tone = middle.tone;
        g.lamps = middle.lamps;
#if MAGNIFIED && !HIGH
        Surface s = surface;
        // max: the shared slope may extrapolate below 0
        s.land = max(ALONG(surface.land, land), 0.0);
        s.shore = ALONG(surface.shore, shore);
        s.share = max(ALONG(surface.share, share), 0.08);
        s.lit = max(ALONG(surface.lit, lit), 0.0);
        quad[k] = surface_radiance(g, s, waters, detail_at(g, ALONG(place, place)));
#elif HIGH && OCEAN_COLOUR
        quad[k] = ground_radiance(g, waters_at(g)); // banks have sharp edges
#else
        quad[k] = ground_radiance(g, waters);
#endif
#if COVERED
        quad[k] = before[k] + (1.0 - covered[k]) * quad[k];
#endif
    }
    send_quad(quad);
}
#else
layout(location = 0) out vec4 out_radiance;

void main() {
    float open = 1.0;
#if COVERED
    open -= textureLod(t_coverage, gl_FragCoord.xy / vec2(textureSize(t_coverage, 0)), 0.0).x;
    if (open <= 0.0) discard;
#endif
#if MOON
    open *= 1.0 - moon_share(moon_ray(gl_FragCoord.xy - 0.5)); // the Moon in front, as seen from lunar orbit
#endif
#if SMOOTH
    vec2 x = (gl_FragCoord.xy - v_middle.xy) * v_middle.z;
    GroundPoint g = ground_at(x);
    color radiance = ground_radiance(g, waters_at(g));
#else
    GlobeRay ray = globe_ray(gl_FragCoord.xy - 0.5);
    if (ray.away || ray.perigee2 > u_globe_limits.y) discard;
#if AIR_ONLY
    color radiance = air_radiance(ray);
#else
    float share = limb_share(ray); // fraction of the pixel that the ground fills
    color radiance = color(0.0);
    if (share > 0.0) {
#if AIR
        GroundAir air = table_air(ray);
#else
        GroundAir air = GroundAir(color(0.0), color(1.0), 0.0);
#endif
        GroundPoint g = ground_point(ray, air);
        radiance = share * ground_radiance(g, waters_at(g));
    }
    if (share < 1.0) radiance += (1.0 - share) * air_radiance(ray);
#endif
#endif
    out_radiance = OUT(radiance * open);
}
#endif
