// The intersection of a ray with the ground, and the light there: all values that vary smoothly between pixels.
#include "globe/ground_air.glsl"

// Stereographic coordinates of a unit vector, each hemisphere from the opposite pole [1]; continuous at the equator.
// SHEAR shifts the hemispheres differently, so that they are no mirror images.
const vec2 SHEAR = vec2(0.12, -0.08);
vec2 detail_plane(vec3 p) { return p.xy / (1.0 + abs(p.z)) + SHEAR * p.z; }

// Derivative of detail_plane at p along the tangent vector w.
vec2 detail_vector(vec3 p, vec3 w) {
    float k = 1.0 / (1.0 + abs(p.z));
    return w.xy * k - p.xy * (sign(p.z) * w.z * k * k) + SHEAR * w.z;
}

// Unpolarised Fresnel reflectance of water, n = 1.34 (Schlick 1994).
float water_fresnel(float c) { return 0.0211 + 0.9789 * pow(1.0 - c, 5.0); }

#if AIR
// Fraction of direct sunlight in the irradiance `light` on level ground, band mean. Only direct light makes a glint.
// Air mass: Kasten & Young (1989).
float beam_share(float mu, float light) {
    mu = clamp(mu, 0.0, 1.0);
    float height_deg = degrees(asin(mu));
    float mass = 1.0 / (mu + 0.50572 * pow(height_deg + 6.07995, -1.6364));
    return min(mu * exp(-AIR_DEPTH * mass) / max(light, 1e-6), 1.0);
}
#endif

// x: radiance of the Sun glint over the irradiance [sr-1]. y: d ln(x) / d ln(variance of slopes) [1].
// Cox & Munk (1954), isotropic slopes, mean square slope 0.003 + 0.00512 U with the wind speed U = 6 m/s.
vec2 sun_glint(vec3 n, vec3 v, vec3 l, float n_v, float n_l) {
    const float variance = 0.0337;
    vec3 h = normalize(v + l);
    float c2 = max(dot(n, h), 1e-3);
    c2 *= c2;
    float slope2 = 1.0 / c2 - 1.0;
    float p = exp(-slope2 / variance) / (PI * variance);
    return vec2(water_fresnel(clamp(dot(v, h), 0.0, 1.0)) * p / (4.0 * n_v * c2 * c2), slope2 / variance - 1.0);
}

// Land reflectance of the two nearest months relative to August; simulator/celestial/seasons.py.
uniform sampler2D t_month_before;
uniform sampler2D t_month_after;
uniform float u_season;      // weight of the second month
uniform sampler2D t_ground_slopes;  // x: slope to the east; y: slope to the north; z: roughness

// A point of the ground in one pixel. Detail is the noise texture t_detail.
struct GroundPoint {
    vec2 uv;        // coordinates in the maps
    vec2 plane;     // coordinates in the detail on the ground [tiles]
    vec2 lift;      // from there to the coordinates at the clouds' height [tiles]
    vec2 cloud_uv;  // HIGH: coordinates in the maps under the visible cloud
    vec2 toward;    // dot product with the detail's slope channels: rise towards the Sun per km of height [km-1]
    float sharp;    // 1 / size of the pixel's footprint [km-1]
    float mu;       // cosine of the Sun's zenith angle
    float rough;    // roughness of the land, 0..1
    float thin;     // optical depth times (1 - asymmetry) of cloud with half the reflectance `white`
    float white;    // reflectance of cloud of infinite optical depth
    float shine;    // vegetation: reflectance towards the camera over its mean
    color tone;     // land: factor on the map's reflectance for season and slope towards the Sun
    float glint;    // radiance of the Sun glint over irradiance, times pi [1]
    float ripple;   // HIGH: d ln(glint) / d ln(variance of the sea's slopes) [1]
    color light;    // radiance at the camera of ground with reflectance 1 [W m-2 sr-1]
    color lamps;    // radiance at the camera of the night map's brightest texels [W m-2 sr-1]
    color haze;     // radiance of the air between ground and camera [W m-2 sr-1]
};

// Spectra of lamps per band, of sum 1: sodium at about 2000 K, white LEDs at 4000 K. The mix differs between cities (Small
// 2022, Technologies 10, 93).
#if BANDS == 3
const vec3 SODIUM = vec3(0.60, 0.33, 0.07), WHITE = vec3(0.42, 0.355, 0.225);
#endif
color city_lamps(vec3 p) {
#if BANDS == 1
    return CITY_MAX;
#else
    // mix of the lamps: waves of 150 to 400 km without a common period
    vec3 wave = sin(p.yzx * vec3(131.0, 157.0, 113.0) + 2.0 * sin(p.zxy * vec3(71.0, 83.0, 97.0)));
    return CITY_MAX * mix(SODIUM, WHITE, clamp(0.4 + 0.3 * (wave.x + wave.y + wave.z), 0.0, 1.0));
#endif
}

// The intersection of a ray with the ground, and the light there. air: the air in front of it.
GroundPoint ground_point(GlobeRay ray, GroundAir air) {
    GroundPoint g;
    float depth = sqrt(max(ray.disc, 0.0));
    float t = -ray.along - depth;
    vec3 p = u_globe_camera.xyz + t * ray.direction;
    vec3 n = normalize(vec3(p.xy, p.z * u_globe_limits.z)); // normal of the ellipsoid
    vec3 sun = u_globe_sun.xyz;
    g.mu = dot(p, sun);
    // footprint: geometric mean of its two axes; 0.02: at the limb the air hides finer structure
    float c_view = max(depth, 0.02);
    g.sharp = sqrt(c_view) / (t * ray.pixel_rad * EARTH_KM);
    // longitude relative to the camera's meridian, so that its discontinuity is never in view
    vec2 meridian = u_globe_meridian.xy;
    float east = atan(meridian.x * n.y - meridian.y * n.x, dot(meridian, n.xy));
    g.uv = vec2((east + u_globe_meridian.z) * (0.5 / PI) + 0.5, 0.5 - asin(clamp(n.z, -1.0, 1.0)) / PI);
    // intersection with the clouds' shell above the ground
    const float shell = 1.0 + CLOUD_KM / EARTH_KM;
    float earlier = -ray.along - sqrt(max(ray.disc + (shell * shell - 1.0), 0.0));
    vec3 above = (u_globe_camera.xyz + earlier * ray.direction) / shell;
    g.plane = detail_plane(p) * (EARTH_KM / DETAIL_KM);
    g.lift = detail_plane(above) * (EARTH_KM / DETAIL_KM) - g.plane;
#if HIGH
    vec2 across = vec2(atan(meridian.x * above.y - meridian.y * above.x, dot(meridian, above.xy)) - east, asin(clamp(p.z, -1.0, 1.0)) - asin(clamp(above.z, -1.0, 1.0)));
    g.cloud_uv = g.uv + across * vec2(0.5 / PI, 1.0 / PI);
#else
    g.cloud_uv = g.uv;
#endif
    float mu = g.mu, direct = 1.0;
#if MOONLIT
    // at the end of dusk the Moon replaces the Sun as the direct light; half-way neither casts shadows
    float dusk = smoothstep(-0.06, -0.18, g.mu);
    float mu_moon = dot(p, u_globe_moon.xyz);
    if (dusk > 0.5) { sun = u_globe_moon.xyz; mu = mu_moon; }
    direct = abs(2.0 * dusk - 1.0);
#endif
    // 0.12: shadows at most about eight heights long; beyond that the terminator itself is dark
    float slant = clamp(mu, 0.12, 1.0);
    vec3 level_sun = (sun - mu * p) * direct;
    g.toward = detail_vector(p, level_sun) * (2.0 * SLOPE_PER_KM / slant);
    // slopes of mountains, and seasons, both at the pixel's level of detail
    float coarse = -log2(g.sharp * 9.95);
    vec3 ground = textureLod(t_ground_slopes, g.uv, coarse).xyz;
    vec3 to_east = vec3(-n.y, n.x, 0.0) * inversesqrt(max(dot(n.xy, n.xy), 1e-6));
    vec3 to_north = cross(n, to_east);
    vec2 slope = (ground.xy - 128.0 / 255.0) * (2.0 * GROUND_SLOPE);
    float uphill = dot(slope, vec2(dot(level_sun, to_east), dot(level_sun, to_north)));
    g.rough = RELIEF * (0.15 + 0.85 * ground.z);
    color gain = mix(BAND(textureLod(t_month_before, g.uv, coarse - 1.0)), BAND(textureLod(t_month_after, g.uv, coarse - 1.0)), u_season);
    g.tone = exp2((gain - 128.0 / 255.0) * (OCTAVES * 255.0 / 127.0)) * clamp(1.0 - RELIEF * uphill / slant, 0.35, 1.7);
    g.glint = g.ripple = 0.0;
    // hot spot of vegetation: leaves hide their own shadows near the direction opposite the Sun
    float back = 0.5 - 0.5 * dot(ray.direction, sun);
    back *= back;
    g.shine = 1.0 + 0.37 * back * back;
    // backscatter of clouds: glory and hidden shadows. The whole Earth is up to a tenth brighter at 2 degrees than at 12
    // degrees from backscatter (Su et al. 2021, Front. Remote Sens. 2, 747859). Shape of the peak: chosen by eye.
    float glory = clamp((back - 0.865) * 7.4, 0.0, 1.0);
    // Escape functions 3 / 7 (1 + 2 mu) of the light and view angles (Kokhanovsky & Nauss 2006). Reflectance of infinite
    // cloud: the law of isotropic scatterers, within 8 % of discrete ordinates. 1.1: limit at grazing light and view.
    g.thin = (9.0 / 49.0 * 4.0 / 3.0) * (1.0 + 2.0 * max(mu, 0.0)) * (1.0 + 2.0 * c_view);
    g.white = min(g.thin / (max(mu, 0.0) + c_view), 1.1) * (1.0 + 0.3 * glory * glory * glory);
#if GLINT
    vec2 glint = sun_glint(n, -ray.direction, sun, c_view, mu);
    g.glint = direct * PI * glint.x * step(0.0, mu) / max(mu, 0.05);
#if AIR && BANDS == 1 && !MOONLIT
    g.glint *= beam_share(mu, air.light);
#elif AIR
    g.glint *= beam_share(mu, dot(vec3(daylight(mu)), vec3(1.0 / 3.0)));
#endif
    g.ripple = min(glint.y, 4.0); // 4: where the glint has a fiftieth of its peak
#endif
#if AIR
    color through = air.through;
    g.haze = air.haze;
#if BANDS == 1
    g.light = air.light;
#else
    g.light = daylight(g.mu);
#endif
#if MOONLIT
    g.light += daylight(mu_moon) * (u_globe_moon.w * dusk);
#endif
#else
    color through = color(1.0);
    g.light = color(max(g.mu, 0.0));
#if MOONLIT
    g.light += color(max(mu_moon, 0.0) * u_globe_moon.w * dusk);
#endif
    g.haze = color(0.0);
#endif
    g.light *= through * BAND(u_globe_irradiance) / PI;
    g.haze *= BAND(u_globe_irradiance);
    g.lamps = through * (city_lamps(p) * (1.0 - smoothstep(-0.10, 0.02, g.mu)));
    return g;
}
