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

#if HIGH && CLOUDS && AIR && !SMOOTH
// Most frequent height of tropical deep clouds (Chae & Sherwood 2010, J. Atmos. Sci. 67, 248).
const float TALLEST_KM = 12.0;
// Light of a cloud's side over that of its top, as it sees half of the sky. Chosen by eye.
const float WALL = 0.75;

// Radiance along a ray that misses the ground: air, and clouds whose tops rise above the horizon.
color limb_radiance(GlobeRay ray) {
    color air = air_radiance(ray);
    float low_km = (sqrt(ray.perigee2) - 1.0) * EARTH_KM, hidden = 0.0;
    if (low_km > TALLEST_KM) return air;
    vec2 meridian = u_globe_meridian.xy;
    float pixel_km = -ray.along * ray.pixel_rad * EARTH_KM, level = log2(pixel_km / DETAIL_TEXEL_KM) + 1.0;
    vec3 zenith = u_globe_camera.xyz * u_globe_camera.w, ahead = normalize(ray.direction - dot(ray.direction, zenith) * zenith);
    // angles at the Earth's centre from the camera to the horizon and to the ray's lowest point
    float horizon = acos(u_globe_camera.w), lowest = acos(min(sqrt(ray.perigee2) * u_globe_camera.w, 1.0));
    for (int k = -3; k <= 3; ++k) {
        float turn = horizon + float(k) * (40.0 / EARTH_KM), off = turn - lowest;
        vec3 p = cos(turn) * zenith + sin(turn) * ahead;
        float east = atan(meridian.x * p.y - meridian.y * p.x, dot(meridian, p.xy));
        vec2 uv = vec2((east + u_globe_meridian.z) * (0.5 / PI) + 0.5, 0.5 - asin(clamp(p.z, -1.0, 1.0)) / PI);
        float cover = textureLod(t_map, uv, 0.0).y;
        // height of the tops: broad changes over 30 km, smaller ones between towers
        vec2 place = detail_plane(p) * (EARTH_KM / DETAIL_KM);
        float broad = textureLod(t_detail, place, 7.0).x, tower = textureLod(t_detail, place, level).x;
        float over = clamp(6.0 * (cover - 0.4 * broad), 0.0, 1.0);
        float above_km = over * (CLOUD_KM + (TALLEST_KM - CLOUD_KM) * cover * (0.7 * broad + 0.3 * tower)) - low_km - 0.5 * EARTH_KM * off * off;
        hidden = max(hidden, clamp(above_km / max(pixel_km, 1.5) + 0.5, 0.0, 1.0));
    }
    vec3 middle = normalize(u_globe_camera.xyz - ray.along * ray.direction);
    float mu = dot(middle, u_globe_sun.xyz);
    GlobeRay level_ray = ray;
    level_ray.disc = 0.0;
#if BANDS == 1
    color through = sqrt(textureLod(t_air, table_uv(ray, false), 0.0).z), light = table_air(level_ray).light;
    const float more = 1.0;
#else
    color through = sqrt(textureLod(t_air_transmittance, table_uv(ray, false), 0.0).xyz), light = daylight(mu);
    // light on the air behind the clouds over that on the air in front; they differ at dusk
    float ahead_mu = 0.03 * dot(ray.direction, u_globe_sun.xyz);
    color more = daylight(mu + ahead_mu) / max(daylight(mu - ahead_mu), color(1e-6));
#endif
    // half of the air is in front of the clouds
    float white = min(12.0 / 49.0 * (1.0 + 2.0 * max(mu, 0.0)) / max(mu, 0.05), 1.1);
    color cloud = air / (1.0 + more * through) + through * light * BAND(u_globe_irradiance) * (WALL * white / PI);
    return mix(air, cloud, hidden);
}
#define air_radiance limb_radiance
#endif

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
