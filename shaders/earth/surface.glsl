// The Earth's surface below the air: land, ocean, clouds and night lights, each with its own optics.
//
// Compile-time switches, 0 or 1: CLOUDS, GLINT, NIGHT, ICE, OCEAN_COLOUR turn on what they name.
// SMOOTH: one level of detail for all pixels. FAR: pixels may be wider than 1.6 km. UNLIT: neither Sun nor Moon shines.
// HIGH: every layer has its own texture lookup.
// ONE_OPTICS: land, sea and cloud reflect alike (a deliberately wrong model, for comparison).

// Square root of land reflectance (x), cloud cover (y), square root of city light (z), distance to the coast (w).
uniform sampler2D t_map;
#if BANDS == 3
uniform sampler2D t_colour; // square root of land reflectance per band
#endif
uniform sampler2D t_detail; // noise of simulator/celestial/detail_noise.py; if UNLIT and not HIGH, the same as t_city
#if HIGH
uniform sampler2D t_terrain; // assets/earth/terrain_detail_1024.png
#endif
#if NIGHT
uniform sampler2D t_city;   // simulator/celestial/city_lights.py
#endif
#if ICE
uniform sampler2D t_ice;    // fraction of the sea under ice; simulator/celestial/sea_ice.py
#endif
#if OCEAN_COLOUR
// Square root of the reflectance of shallow water in excess of deep water; simulator/celestial/ocean_colour.py.
uniform sampler2D t_ocean_colour;
#endif

// Level of detail. llvmpipe samples faster where it is uniform.
#if SMOOTH
uniform vec3 u_level;       // for t_map, for t_detail, and for texels of 1 km
#define MAP_LEVEL u_level.x
#define DETAIL_LEVEL u_level.y
#define KM_LEVEL u_level.z
#else
#define MAP_LEVEL (-log2(g.sharp * TEXEL_KM))
#define DETAIL_LEVEL (-log2(g.sharp * DETAIL_TEXEL_KM))
#define KM_LEVEL (-log2(g.sharp))
#endif

#if BANDS == 1
// DOWN: fraction of the ground's light that clear air scatters back to the ground. ASIDE: fraction that it scatters to
// the camera over its transmittance. Computed with PythonicDISORT 1.8: Rayleigh, aerosol of optical depth 0.05, ozone.
const float DOWN = 0.082, ASIDE = 0.064;
const float SEA = 0.022;      // water-leaving reflectance of clear ocean, band mean (Morel & Maritorena 2001)
#else
const vec3 DOWN = vec3(0.054, 0.092, 0.175), ASIDE = vec3(0.046, 0.080, 0.193);
const vec3 SEA = vec3(0.006, 0.020, 0.048);
#endif
const float COAST_KM_PER_UNIT = 73.8;   // the coast channel: 255 counts of 1/8 pixel of 1/48 degree
// Reflectance of pack ice: 0.8 to 0.9 in April, 0.4 in late July (Perovich et al. 2002, JGR 107, 8044).
const float FLOE = 0.62;
// Used by HIGH and chosen by eye:
const float WARP_KM = 9.0;    // twice the largest displacement of t_map's lookups
const float SHARPEN = 0.75;   // amount of the land map's unsharp mask
const float ROCK = 1.25;      // contrast of bare rock on the roughest land
const float GRAVEL = 0.55;    // excess reflectance of valley floors over the rock beside them
const float HALO = 0.025;     // scaled optical depth (see GroundPoint.thin) at a cloud's edge
const float VALLEY = 1.2;     // relative loss of light per unit of `over` below the surroundings
const float FLANK = 0.4;      // fraction by which a cloud's side is darker than its top
const float GLOW = 0.15;      // fraction of the lamps' light that is scattered by the air about them
const float MASS_LEVEL = 4.0; // level of t_detail that shows a cloud's width: 3.7 km
const float EDDY = 0.05;      // displacement of surface films by eddies [tiles of t_detail]
const float LEE = 1.6, LEE_KM = 9.0; // calm at a coast in the lee, and the distance over which it decays
// Height of the puffs in a closed cloud deck; up to four times as much for separate puffs. Chosen by eye.
const float RELIEF_KM = 0.35;

// Ocean colour and ice at a ground point; may be shared by two by two pixels.
struct Waters {
    color bright_water; // excess reflectance of shallow or turbid water over deep water
    float ice;   // fraction of the sea under ice
};
Waters waters_at(GroundPoint g) {
    Waters w = Waters(color(0.0), 0.0);
#if OCEAN_COLOUR
    color root = BAND(textureLod(t_ocean_colour, g.uv, MAP_LEVEL - 1.0));
#if HIGH
    // ragged, steep edges of banks, with sand bars on them
    vec4 bars = textureLod(t_detail, g.plane, DETAIL_LEVEL);
    vec2 aside = (bars.wx - 0.5) * (WARP_KM / (2.0 * PI * EARTH_KM)) * vec2(1.0 / max(sin(PI * g.uv.y), 0.05), 2.0);
    root = BAND(textureLod(t_ocean_colour, g.uv + aside, MAP_LEVEL - 1.0));
    root = max(root + 0.6 * (root - BAND(textureLod(t_ocean_colour, g.uv, max(MAP_LEVEL, 0.0) + 1.5))), 0.3 * root);
    root *= 1.0 + 0.45 * (bars.w - 0.5);
#endif
    w.bright_water = OCEAN_COLOUR_SCALE * root * root;
#endif
#if ICE
    w.ice = textureLod(t_ice, g.uv, MAP_LEVEL - ICE_LEVEL).x;
#endif
    return w;
}

// Texel of the Earth's map under a ground point.
vec4 ground_map(GroundPoint g) { return textureLod(t_map, g.uv, MAP_LEVEL); }

// Noise t_detail at the clouds' height and on the ground. HIGH looks up both. Otherwise one lookup serves for both: at
// the ground under clear sky, at the clouds' height under cloud.
struct Detail { vec4 cloud, ground; };
vec2 detail_place(GroundPoint g, vec4 map) { return g.plane + g.lift * (float(CLOUDS) * clamp(2.0 * map.y, 0.0, 1.0)); }
Detail detail_at(GroundPoint g, vec2 place) {
    vec4 both = textureLod(t_detail, place, DETAIL_LEVEL);
    return Detail(both, both);
}

// Optical properties of the surface without its noise; may be shared by two by two pixels.
// Noise channels are those of t_detail, 0..1. Optical depths of clouds are scaled as GroundPoint.thin.
struct Surface {
    color land;    // mean reflectance of the land
    color patchy;  // relative change of the land's reflectance with noise channel w
    float hilly;   // relative change of the land's reflectance with the rise towards the Sun [km]
    float shore;   // 0.5 plus the distance inland from the mean coast [px]
    float wriggle; // change of `shore` with noise channel x [px]
    color sea;     // reflectance of the open sea
    color waves;   // change of the sea's reflectance with noise channel x
    float share;   // fraction of the ground under cloud; above 1 for a deck without gaps
    float thick;   // optical depth in the middle of clouds
    float present; // HIGH: fraction of the clouds' light and shadow, which falls to 0 where the map has no cloud
    float veil;    // optical depth between clouds
    float mean;    // FAR: optical depth of uniform cloud with the same mean reflectance
    float region;  // HIGH: regional noise, 0..1, for the kind of cloud
    float wind;    // HIGH: regional noise, 0..1, for the calm of the sea
    float lit;     // square root of the city light over that of the brightest texels
};

// The surface at a ground point. map: t_map at g.uv; land_uv: where the land's reflectance is read.
Surface surface_at(GroundPoint g, vec4 map, vec2 land_uv, Waters waters) {
    Surface s;
#if BANDS == 1
#define LAND_ROOT(level) textureLod(t_map, land_uv, level).x
    color root = map.x;
#else
#define LAND_ROOT(level) textureLod(t_colour, land_uv, level).xyz
    color root = LAND_ROOT(MAP_LEVEL);
#endif
#if HIGH
    // restore contrast of 5 to 20 km that resampling and magnification removed; not needed from far away
    float sharpen = SHARPEN * clamp(1.0 - 0.5 * MAP_LEVEL, 0.0, 1.0);
    root = max(root + sharpen * (root - LAND_ROOT(max(MAP_LEVEL, 0.0) + 2.0)), 0.3 * root);
#endif
    color reflectance = root * root;
    // deserts and snow are uniform, without patches of vegetation
#if BANDS == 1
    float pale = reflectance;
    s.patchy = GRAIN - clamp(1.4 * pale - 0.1, 0.0, 0.6);
#else
    // bright patches are yellower: fields beside woods
    float pale = reflectance.x;
    s.patchy = (GRAIN - clamp(1.4 * pale - 0.1, 0.0, 0.6)) * vec3(1.25, 1.0, 0.7);
#endif
    s.land = reflectance * g.tone * mix(1.0, g.shine, clamp(1.4 - 6.0 * pale, 0.0, 1.0));
#if HIGH
    s.hilly = 0.0; // t_terrain gives the hills
#else
    s.hilly = 2.2 * g.rough;
#endif
    // a ragged coast at scales below the map's texels
    s.wriggle = 3.0 * g.sharp;
    s.shore = (map.w * COAST_KM_PER_UNIT - (1.5 + 128.0 / 255.0 * COAST_KM_PER_UNIT)) * g.sharp + 0.5;
    color sea = SEA;
#if OCEAN_COLOUR
    sea += waters.bright_water;
#endif
    s.sea = 0.85 * sea;
    s.waves = 0.3 * sea; // variation by plankton and wind
#if GLINT && !HIGH
    s.sea += 0.9 * g.glint;
    s.waves += 0.2 * g.glint; // gusts
#endif
    // Polynomials of the map's cloud cover. The noise has a uniform histogram, so a threshold on it gives the wanted
    // fraction of ground under cloud. Optical depth rises from the edge of a cloud, and with the cover.
    float cover = clamp(map.y * 1.06 - 0.04, 0.0, 1.0), cover2 = cover * cover, cover4 = cover2 * cover2;
    s.share = 0.08 + cover * (1.42 - 0.5 * cover) + 0.6 * cover4;
    s.thick = 1.15 + 18.0 * cover4 * cover2;
#if HIGH
    // deep clouds stay bright until their depth is nearly 0, and then vanish within a count of the map: fade their light
    s.present = min(5.0 * cover, 1.0);
#else
    s.thick *= min(10.0 * cover, 1.0);
    s.present = 1.0;
#endif
    s.veil = 0.12 * cover2;
    s.mean = cover * (0.95 + cover * (0.14 + cover2 * (11.7 * cover2 * cover - 1.44)));
    s.lit = map.z;
    return s;
}

// Reflectance of cloud relative to that of infinite optical depth [1]. over: 0 at its edge, 1 in the middle. Two-stream;
// for thick cloud this is the asymptotic theory of Kokhanovsky & Nauss (2006, ACP 6, 5537).
float cloud_reflectance(float over, float thick, float veil, float thin) {
    float depth = thick * over * over + veil;
    return depth / (depth + thin * (1.15 - over));
}

// Natural logarithm of the factor by which the variance of the sea's slopes is reduced; the mean variance is preserved.
// Arguments: noise of uniform histogram, 0..1. Slicks, whose films at least halve the variance (Cox & Munk 1954), lie
// where `films` is 0.5. seen: 1 where films are wider than a pixel, 0 where only their mean is seen.
float sea_calm(float region, float gusts, float streaks, float swell, float films, float seen) {
    float slick = (films - 0.5) * 20.0;
    slick = 0.0886 + seen * (exp(-slick * slick) - 0.0886);
    return 0.8 * region + 0.8 * gusts + 0.5 * streaks + 0.3 * swell + 0.9 * region * slick - 1.19;
}

// Maps the weighted sum x of two uniform variables, with weights 1 - b and b <= 0.5, to a uniform variable (its CDF).
float even_sum(float x, float b) {
    float rise = min(x, b);
    float middle = max(min(x, 1.0 - b) - b, 0.0);
    float fall = min(1.0 - x, b);
    return (0.5 * (rise * rise + b * b - fall * fall) + b * middle) / (b * (1.0 - b));
}

#if HIGH
// Noise at the clouds' height, with smaller clouds added where the regional noise (0..1, about 300 km) is high.
const mat2 REGION = mat2(0.11, 0.06, -0.06, 0.11), SMALLER = mat2(2.5, 1.9, -1.9, 2.5);
vec4 cloud_detail(vec2 place, float region, float level) {
    vec4 broad = textureLod(t_detail, place, level), small = textureLod(t_detail, SMALLER * place, level + 1.65);
    small.yz = 0.5 + (small.yz - 0.5) * (SMALLER / 3.14); // smaller clouds are lower, too
    float b = clamp(0.4 * region - 0.04, 0.04, 0.3);
    vec4 both = mix(broad, small, b);
    both.x = even_sum(both.x, b);
    return both;
}
#endif

// Radiance of a ground point towards the camera [W m-2 sr-1].
color surface_radiance(GroundPoint g, Surface s, Waters waters, Detail detail) {
    float puff = detail.cloud.x;
#if CLOUDS
#if HIGH
    // the veil is cirrus at 9 km: fibres along the wind
    float fibre = textureLod(t_detail, mat2(0.30, 0.16, -0.75, 1.40) * (g.plane + (9.0 / CLOUD_KM) * g.lift), DETAIL_LEVEL).x;
    s.veil *= 3.0 * fibre * fibre; // mean 1 for a uniform histogram
    s.share *= 0.95; // compensates for the light of the halo
#endif
    float scale = 1.0 / s.share, over = 1.0 + (puff - 1.0) * scale; // 0 at a cloud's edge, at most 1
#if HIGH
    // halo of fragments and haze (Koren et al. 2007, Geophys. Res. Lett. 34, L08805); towers of different depth
    s.veil += HALO * min(2.0 * s.share, 1.0) * exp(6.0 * min(over, 0.0));
    s.thick *= 0.3 + 1.4 * detail.cloud.w;
    // tops of wider clouds are higher (Zhao & Di Girolamo 2007, doi:10.1029/2006JD007371): they are deeper, with a side in shade
    vec4 mass = textureLod(t_detail, g.plane + g.lift, max(DETAIL_LEVEL, MASS_LEVEL));
    float core = clamp(1.0 + (mass.x - 0.9) * scale, 0.0, 2.0);
    s.thick *= 0.25 + 1.6 * core * core;
#endif
    float cloud = s.present * cloud_reflectance(max(over, 0.0), s.thick, s.veil, g.thin);
#if FAR
    // wide pixels average the noise before the threshold: use the reflectance of the mean cover instead
#if HIGH
    // the pattern of `high` is coarser, and fades sooner; fitted to the light of `default`
    s.mean *= clamp(0.2 * KM_LEVEL - 0.15, 0.9, 1.0);
    cloud = mix(cloud, s.mean / (s.mean + g.thin), clamp(0.25 * KM_LEVEL - 0.2, 0.0, 1.0));
#else
    cloud = mix(cloud, s.mean / (s.mean + g.thin), clamp(0.2 * KM_LEVEL - 0.2, 0.0, 1.0));
#endif
#endif
#endif
#if UNLIT
    color radiance = g.haze;
#else
    vec4 under = detail.ground;
    // rise of clouds and of the ground towards the Sun, per km of height
    float level = 0.5 * (g.toward.x + g.toward.y);
    float rise = dot(detail.cloud.yz, g.toward) - level, hill = dot(under.yz, g.toward) - level;
    // land: patches of vegetation, and slopes towards and away from the Sun
    color reflectance = s.land * ((1.0 - 0.5 * s.patchy) + s.patchy * under.w - clamp(hill * s.hilly, -0.6, 0.6));
#if HIGH
    // ridges and wadis, stronger on rough land
    const mat2 turn = mat2(1.84, 1.38, -1.38, 1.84);
    vec4 rock = textureLod(t_terrain, turn * g.plane, DETAIL_LEVEL + 0.2);
    float bank = dot(turn * g.toward, rock.xy - 0.5) * (TERRAIN_SLOPE / (2.3 * SLOPE_PER_KM));
    float bare = clamp(2.2 * g.rough - 0.22, 0.12, 1.0); // sand and soil cover the rock of plains
    reflectance *= 1.0 + bare * (mix(ROCK * (rock.z - 0.5), GRAVEL, rock.w) - 0.25 * GRAVEL) - clamp(1.6 * bare * bank, -0.6, 0.6);
#endif
    reflectance = clamp(reflectance, 0.2 * s.land, color(SNOW_REFLECTANCE)); // lower limit: skylight on shaded slopes
#if BANDS == 3
    // snow hides the colour of the land
    reflectance = mix(reflectance, vec3(dot(reflectance, vec3(1.0 / 3.0))), clamp(0.5 * g.tone.y - 1.0, 0.0, 1.0));
#endif
    color sea = s.sea + s.waves * under.x;
#if GLINT && HIGH
    // eddies of about 10 km wind up the films into spirals (Munk et al. 2000, Proc. R. Soc. A 456, 1217)
    vec2 eddy = g.plane + EDDY * (textureLod(t_detail, 1.7 * g.plane, max(DETAIL_LEVEL, 4.5)).xw - 0.5);
    float streaks = textureLod(t_detail, mat2(2.2, 1.6, -0.30, 0.41) * eddy, DETAIL_LEVEL + 1.0).x;
    float gusts = textureLod(t_detail, mat2(0.62, 0.35, -0.22, 0.39) * g.plane, DETAIL_LEVEL - 0.5).x;
    float swell = textureLod(t_detail, mat2(5.1, -3.3, 16.5, 25.5) * g.plane, DETAIL_LEVEL + 4.0).x;
    float films = textureLod(t_detail, mat2(2.6, 1.9, -0.5, 0.7) * eddy, max(DETAIL_LEVEL, 3.0)).x;
    float calm = sea_calm(s.wind, gusts, streaks, swell, films, clamp(0.5 - KM_LEVEL, 0.0, 1.0)); // films are some 0.5 km wide
    // calm in the lee of land, varied by gusts
    calm += LEE * gusts * exp(min(s.shore - 0.5, 0.0) / (LEE_KM * g.sharp));
    sea += color(g.glint * exp(calm + (g.ripple + 1.0) * (1.0 - exp(calm))));
#endif
#if ICE
    // floes and leads: a threshold on noise of uniform histogram, which keeps the fraction of ice
    float floes = clamp((waters.ice - under.x) * 7.0 + 0.5, 0.0, 1.0) * min(waters.ice * 20.0, 1.0);
#if FAR
    // wide pixels average the noise before the threshold: use the fraction itself
    floes = mix(floes, waters.ice, clamp(0.3 * KM_LEVEL - 0.2, 0.0, 1.0));
#endif
    // loose ice is young, thin or wet, and darker
    sea = mix(sea, color(FLOE * (0.62 + 0.34 * waters.ice + 0.16 * under.w)), floes);
#endif
    color ground = mix(sea, reflectance, clamp(s.shore + s.wriggle * under.x, 0.0, 1.0));
#if CLOUDS
    // shadow of clouds: the cover where the ray to the Sun passes the clouds' height
#if HIGH
    // looked up there
    vec2 sunward = g.plane + g.toward * (CLOUD_KM / (2.0 * SLOPE_PER_KM * DETAIL_KM));
    float shading = (cloud_detail(sunward, s.region, DETAIL_LEVEL).x - puff) * scale;
#else
    // extrapolated by the slope
    float shading = clamp(rise * CLOUD_KM * scale, -1.0, 0.35);
#endif
#if ONE_OPTICS
    ground = mix(ground, color(1.0), min(s.share, 1.0));
#else
    float before = clamp(over + shading, 0.0, 1.0);
    ground -= ground * (0.7 * s.present * cloud_reflectance(before, s.thick, s.veil, g.thin));
#if HIGH
    // bright tops that the Sun reaches, and shaded valleys between them
    float whole = dot(mass.yz, g.toward) - level;
    float relief = clamp(1.0 - (2.0 * RELIEF_KM) * min(scale, 4.0) * (rise + 2.0 * whole), 0.4, 1.5);
    // valleys between tops return less light (Varnai & Davies 1999, J. Atmos. Sci. 56, 4206); 0.05 keeps a deck's mean
    relief *= 1.0 + 0.05 * min(s.share, 1.0) * clamp(MASS_LEVEL - DETAIL_LEVEL, 0.0, 1.0) + clamp(VALLEY * scale * (puff - mass.x), -0.45, 0.0);
    // at oblique view, sides hide part of the tops
    vec2 towards_camera = g.lift * (2.0 * SLOPE_PER_KM * DETAIL_KM);
    relief *= 1.0 - FLANK * clamp(-scale * dot(detail.cloud.yz - 0.5, towards_camera), 0.0, 1.0);
#else
    float relief = clamp(1.0 - RELIEF_KM * min(scale, 4.0) * rise, 0.5, 1.35);
#endif
    ground = mix(ground, color(g.white * relief), cloud);
#endif
#endif
#if AIR
    // Correction of the haze for the ground's albedo, as the air's tables assume the mean albedo. `wide` excludes the
    // glint, which is not diffuse. max: the haze has no moonlight, so the correction may exceed it.
    color wide = min(ground, color(1.0)), more = (wide - EARTH_ALBEDO) * (DOWN * wide + ASIDE);
    color radiance = max(more * g.light + g.haze, color(0.0)) + ground * g.light;
#else
    color radiance = ground * g.light + g.haze;
#endif
#endif
#if NIGHT
    // structure below the map's texels, of mean 1: streets in bright cells, towns and roads in dark ones
#if UNLIT && !HIGH
    vec4 city = detail.ground;
#else
    vec4 city = textureLod(t_city, g.plane, DETAIL_LEVEL);
#endif
    float streets = mix(city.z, city.y, clamp(1.5 * s.lit - 0.25, 0.0, 1.0)) * CITY_BRIGHTEST;
#if HIGH
    // smaller streets, and light that the air scatters about them (Sanchez de Miguel et al. 2020, Sci. Rep. 10, 7829)
    streets *= textureLod(t_city, mat2(2.9, 2.4, -2.4, 2.9) * g.plane, DETAIL_LEVEL + 1.9).y * CITY_BRIGHTEST;
    streets = mix(streets, 1.0, GLOW);
#endif
    color lamps = g.lamps * (s.lit * s.lit * streets);
#if CLOUDS
    lamps *= 1.0 - cloud;
#endif
#if BANDS == 3
    // lamps differ in colour by district
#if HIGH
    // white LEDs replace sodium lamps street by street
    lamps *= mix(vec3(1.20, 0.90, 0.40), vec3(0.82, 1.06, 1.85), clamp(2.2 * city.w - 0.6, 0.0, 1.0));
#else
    lamps *= mix(vec3(1.12, 0.95, 0.6), vec3(0.88, 1.05, 1.4), city.w);
#endif
#endif
    radiance += lamps;
#endif
    return radiance;
}

// Radiance of a ground point towards the camera, with the surface looked up at that point [W m-2 sr-1].
color ground_radiance(GroundPoint g, Waters waters) {
    vec4 map = ground_map(g);
    vec2 land_uv = g.uv;
#if HIGH
    vec4 region = textureLod(t_detail, REGION * g.plane, DETAIL_LEVEL - 3.0);
    Detail detail = Detail(cloud_detail(g.plane + g.lift, region.x, DETAIL_LEVEL), textureLod(t_detail, g.plane, DETAIL_LEVEL));
    // displace the lookups by up to WARP_KM / 2, for ragged edges of fields, woods and towns
    vec2 aside = (detail.ground.xw - 0.5) * WARP_KM;
    land_uv += aside * vec2(1.0 / max(sin(PI * g.uv.y), 0.05), 2.0) / (2.0 * PI * EARTH_KM);
    map.xz = textureLod(t_map, land_uv, MAP_LEVEL).xz;
    aside = (detail.cloud.xw - 0.5) * WARP_KM;
    map.y = textureLod(t_map, g.cloud_uv + aside * vec2(1.0 / max(sin(PI * g.uv.y), 0.05), 2.0) / (2.0 * PI * EARTH_KM), MAP_LEVEL).y;
#else
    Detail detail = detail_at(g, detail_place(g, map));
#endif
#if HIGH
    Surface s = surface_at(g, map, land_uv, waters);
    s.region = region.x;
    s.wind = region.w;
    s.thick *= 0.55 + 1.1 * region.w;
    return surface_radiance(g, s, waters, detail);
#else
    return surface_radiance(g, surface_at(g, map, land_uv, waters), waters, detail);
#endif
}
