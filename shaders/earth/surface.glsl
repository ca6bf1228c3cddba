// The Earth's surface below the air: land, ocean, clouds and night lights, each with its own optics.
// Switches (0 or 1, fixed at compile time): CLOUDS, GLINT, NIGHT, ICE, OCEAN_COLOUR; SMOOTH: one level of detail for all pixels; FAR: pixels may
// be wider than 1.6 km; UNLIT: neither Sun nor Moon shine there; HIGH: every layer looked up at its own place; ONE_OPTICS: land, sea and cloud reflect alike (the counter-example).

uniform sampler2D t_map;    // square roots of land reflectance, cloud opacity and light of lamps, distance to the coast
#if BANDS == 3
uniform sampler2D t_colour; // square root of land reflectance per band
#endif
uniform sampler2D t_detail; // simulator/celestial/detail_noise.py; UNLIT: as t_city
#if HIGH
uniform sampler2D t_terrain; // assets/earth/terrain_detail_1024.png
#endif
#if NIGHT
uniform sampler2D t_city;   // simulator/celestial/city_lights.py
#endif
#if ICE
uniform sampler2D t_ice;    // share of the sea under ice; simulator/celestial/sea_ice.py
#endif
#if OCEAN_COLOUR
uniform sampler2D t_ocean_colour; // square root of what shallow water reflects more than deep; simulator/celestial/ocean_colour.py
#endif

// llvmpipe samples a whole row of pixels at once when they share a level, and one texel quad at a time when not.
#if SMOOTH
uniform vec3 u_level;       // of the maps, of the detail, and of a texel of 1 km
#define MAP_LEVEL u_level.x
#define DETAIL_LEVEL u_level.y
#define KM_LEVEL u_level.z
#else
#define MAP_LEVEL (-log2(g.sharp * TEXEL_KM))
#define DETAIL_LEVEL (-log2(g.sharp * DETAIL_TEXEL_KM))
#define KM_LEVEL (-log2(g.sharp))
#endif

#if BANDS == 1
// of the light from the ground, what clear air sends down again, and what it scatters towards the camera over what it lets
// through: PythonicDISORT 1.8, Rayleigh, aerosol of 0.05 and ozone
const float DOWN = 0.082, ASIDE = 0.064;
const float SEA = 0.022;      // reflectance of the water's body: clear ocean, in band (Morel & Maritorena 2001)
#else
const vec3 DOWN = vec3(0.054, 0.092, 0.175), ASIDE = vec3(0.046, 0.080, 0.193);
const vec3 SEA = vec3(0.006, 0.020, 0.048);
#endif
const float COAST_KM_PER_UNIT = 73.8;   // the coast channel: 255 counts of 1/8 pixel of 1/48 degree
const float FLOE = 0.62;      // reflectance of the pack, between 0.8 to 0.9 of April and 0.4 of late July (Perovich et al. 2002, JGR 107, 8044)
const float WARP_KM = 9.0;   // HIGH: twice the largest displacement of the land's map
const float SHARPEN = 0.75;   // HIGH: unsharp mask of the land's map
const float ROCK = 1.25;      // HIGH: contrast of bare rock where land is as rough as can be
const float GRAVEL = 0.55;    // HIGH: additional reflectance of valley floors over the rock beside them
const float HALO = 0.025;     // HIGH: optical depth, as `thin` counts it, at a cloud's edge
const float FLANK = 0.4;      // HIGH: light that a cloud's side lacks of its top's
const float GLOW = 0.15;      // HIGH: share of lamps' light that comes from the air about them: an estimate
const float MASS_LEVEL = 4.0; // HIGH: level of the detail that shows a cloud's width: 3.7 km
const float EDDY = 0.05;      // HIGH: displacement of films by eddies [tiles of the detail]
const float LEE = 1.6, LEE_KM = 9.0; // HIGH: greatest calm at a coast, and over what distance it fades
const float RELIEF_KM = 0.35; // height of a deck's puffs of full contrast; of puffs that stand apart up to four times as much

// Reflectance of the sea above deep open water: ocean colour and ice. It hardly changes within two by two pixels.
struct Waters {
    color bright_water; // reflectance of shallow or turbid water over that of deep water
    float ice;   // share of the sea under ice
};
// Ocean colour and ice at a ground point.
Waters waters_at(GroundPoint g) {
    Waters w = Waters(color(0.0), 0.0);
#if OCEAN_COLOUR
    color root = BAND(textureLod(t_ocean_colour, g.uv, MAP_LEVEL - 1.0));
#if HIGH
    // banks end at a wall, raggedly; sand lies on them in bars and drifts
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

// The detail at the clouds' height and on the ground. HIGH looks up both; else one look-up serves for both: on the ground
// under a clear sky, at the clouds' height where they hide it.
struct Detail { vec4 cloud, ground; };
vec2 detail_place(GroundPoint g, vec4 map) { return g.plane + g.lift * (float(CLOUDS) * clamp(2.0 * map.y, 0.0, 1.0)); }
Detail detail_at(GroundPoint g, vec2 place) {
    vec4 both = textureLod(t_detail, place, DETAIL_LEVEL);
    return Detail(both, both);
}

// Optical properties of a surface that hardly change within two by two pixels: its dependence on the detail's channels.
struct Surface {
    color land;    // mean reflectance of the land
    color patchy;  // change of the land's with the detail's last channel, over it
    float hilly;   // and with the rise towards the Sun [km]
    float shore;   // 0.5 plus the distance inland from the mean coast [px]
    float wriggle; // change of that with the detail's first channel
    color sea;     // reflectance of the open sea
    color waves;   // its change with the detail's first channel
    float share;   // of the ground under cloud; over one where it has no gaps
    float thick;   // of clouds: optical depth, as `thin` counts it, in their middles
    float veil;    // and between them
    float mean;    // FAR: of one cloud that is even and returns as much
    float region;  // HIGH: kind of cloud
    float wind;    // HIGH: calm of the region, 0..1
    float lit;     // root of the light of lamps over that of the map's brightest texels
};

// The surface at a ground point. map: of t_map there; land_uv: of the maps where the land is read.
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
    // the map's own contrast of 5 to 20 km, which its making and its magnification took; from far away nothing did
    float sharpen = SHARPEN * clamp(1.0 - 0.5 * MAP_LEVEL, 0.0, 1.0);
    root = max(root + sharpen * (root - LAND_ROOT(max(MAP_LEVEL, 0.0) + 2.0)), 0.3 * root);
#endif
    color reflectance = root * root;
    // deserts and snow are uniform: there is no patchy vegetation
#if BANDS == 1
    float pale = reflectance;
    s.patchy = GRAIN - clamp(1.4 * pale - 0.1, 0.0, 0.6);
#else
    // brighter land is yellower: fields beside woods
    float pale = reflectance.x;
    s.patchy = (GRAIN - clamp(1.4 * pale - 0.1, 0.0, 0.6)) * vec3(1.25, 1.0, 0.7);
#endif
    s.land = reflectance * g.tone * mix(1.0, g.shine, clamp(1.4 - 6.0 * pale, 0.0, 1.0));
#if HIGH
    s.hilly = 0.0; // hills are those of the valleys
#else
    s.hilly = 2.2 * g.rough;
#endif
    // the coast wriggles below the map's texels
    s.wriggle = 3.0 * g.sharp;
    s.shore = (map.w * COAST_KM_PER_UNIT - (1.5 + 128.0 / 255.0 * COAST_KM_PER_UNIT)) * g.sharp + 0.5;
    color sea = SEA;
#if OCEAN_COLOUR
    sea += waters.bright_water;
#endif
    s.sea = 0.85 * sea;
    s.waves = 0.3 * sea; // plankton and wind
#if GLINT && !HIGH
    s.sea += 0.9 * g.glint;
    s.waves += 0.2 * g.glint; // cat's paws
#endif
    // the map's cover is a share of the ground, over which the optical depth rises from the clouds' edges with the
    // detail, whose histogram is even; where it is larger they are thicker too
    float cover = clamp(map.y * 1.06 - 0.04, 0.0, 1.0), cover2 = cover * cover, cover4 = cover2 * cover2;
    s.share = 0.08 + cover * (1.42 - 0.5 * cover) + 0.6 * cover4;
    s.thick = (1.15 + 18.0 * cover4 * cover2) * min(10.0 * cover, 1.0);
    s.veil = 0.12 * cover2;
    s.mean = cover * (0.95 + cover * (0.14 + cover2 * (11.7 * cover2 * cover - 1.44)));
    s.lit = map.z;
#if NIGHT
    // its root's mean over wider texels is less than the root of the mean: by so much around the Earth's cities
    float wide = max(MAP_LEVEL, 0.0);
    s.lit *= exp2(wide * (0.06 + 0.025 * wide));
#endif
    return s;
}

// Reflectance of cloud over that of endless cloud; over: from its edge, 0, to the middle of the thickest, 1. Two-stream: for
// thick cloud this is the asymptotic theory of Kokhanovsky & Nauss (2006, ACP 6, 5537).
float cloud_reflectance(float over, float thick, float veil, float thin) {
    float depth = thick * over * over + veil;
    return depth / (depth + thin * (1.15 - over));
}

// Logarithm of how much less the slopes of the sea vary: wind of the region, gusts and streaks, swell, slicks. The mean of
// the variance is kept. All from 0 to 1, of even histograms; slicks are where the last is a half.
// Their films halve the variance or more (Cox & Munk 1954).
float sea_calm(float region, float gusts, float streaks, float swell, float films) {
    float slick = (films - 0.5) * 20.0;
    return 0.8 * region + 0.8 * gusts + 0.5 * streaks + 0.3 * swell + 0.9 * region * exp(-slick * slick) - 1.19;
}

// A sum x of two numbers from 0 to 1 of even histograms, with weights 1 - b and b (b at most a half), made even.
float even_sum(float x, float b) {
    float rise = min(x, b);
    float middle = max(min(x, 1.0 - b) - b, 0.0);
    float fall = min(1.0 - x, b);
    return (0.5 * (rise * rise + b * b - fall * fall) + b * middle) / (b * (1.0 - b));
}

#if HIGH
// The detail at the clouds' height, and smaller clouds added, here more and there less: by a region of some 300 km, from 0 to 1.
const mat2 REGION = mat2(0.11, 0.06, -0.06, 0.11), SMALLER = mat2(2.5, 1.9, -1.9, 2.5);
vec4 cloud_detail(vec2 place, float region, float level) {
    vec4 broad = textureLod(t_detail, place, level), small = textureLod(t_detail, SMALLER * place, level + 1.65);
    small.yz = 0.5 + (small.yz - 0.5) * (SMALLER / 3.14); // they are as much lower as they are smaller
    float b = clamp(0.7 * region - 0.06, 0.08, 0.5);
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
    // the veil is cirrus: fibres along the wind, 9 km high
    float fibre = textureLod(t_detail, mat2(0.30, 0.16, -0.75, 1.40) * (g.plane + (9.0 / CLOUD_KM) * g.lift), DETAIL_LEVEL).x;
    s.veil *= 3.0 * fibre * fibre; // a mean of one for an even histogram
    s.share *= 0.95; // the light of what is about clouds is taken from their edges
#endif
    float scale = 1.0 / s.share, over = 1.0 + (puff - 1.0) * scale; // 0 at the cloud's edge, 1 at most
#if HIGH
    // fragments and haze about clouds (Koren et al. 2007, Geophys. Res. Lett. 34, L08805), and towers of unlike depth
    s.veil += HALO * min(2.0 * s.share, 1.0) * exp(6.0 * min(over, 0.0));
    s.thick *= 0.3 + 1.4 * detail.cloud.w;
    // tops of wider clouds are higher (Zhao & Di Girolamo 2007, doi:10.1029/2006JD007371): they are deeper, with a side in shade
    vec4 mass = textureLod(t_detail, g.plane + g.lift, max(DETAIL_LEVEL, MASS_LEVEL));
    float core = clamp(1.0 + (mass.x - 0.85) * scale, 0.0, 2.0);
    s.thick *= 0.25 + 1.6 * core * core;
#endif
    float cloud = cloud_reflectance(max(over, 0.0), s.thick, s.veil, g.thin);
#if FAR
    // from far away the puffs are averaged before the threshold, so that their mean is that of the cover
    cloud = mix(cloud, s.mean / (s.mean + g.thin), clamp(0.2 * KM_LEVEL - 0.2, 0.0, 1.0));
#endif
#endif
#if UNLIT
    color radiance = g.haze;
#else
    vec4 under = detail.ground;
    // of the puff and of the ground towards the Sun, per km of height
    float level = 0.5 * (g.toward.x + g.toward.y);
    float rise = dot(detail.cloud.yz, g.toward) - level, hill = dot(under.yz, g.toward) - level;
    // land: patches, and hills that turn to and from the Sun
    color reflectance = s.land * ((1.0 - 0.5 * s.patchy) + s.patchy * under.w - clamp(hill * s.hilly, -0.6, 0.6));
#if HIGH
    // ridges and wadis, the finer half of the relief: as rough as the land is
    const mat2 turn = mat2(1.84, 1.38, -1.38, 1.84);
    vec4 rock = textureLod(t_terrain, turn * g.plane, DETAIL_LEVEL + 0.2);
    float bank = dot(turn * g.toward, rock.xy - 0.5) * (TERRAIN_SLOPE / (2.3 * SLOPE_PER_KM));
    float bare = clamp(2.2 * g.rough - 0.22, 0.12, 1.0); // plains are under sand and soil
    reflectance *= 1.0 + bare * (mix(ROCK * (rock.z - 0.5), GRAVEL, rock.w) - 0.25 * GRAVEL) - clamp(1.6 * bare * bank, -0.6, 0.6);
#endif
    reflectance = clamp(reflectance, 0.2 * s.land, color(SNOW_REFLECTANCE)); // slopes in shade have the sky's light
#if BANDS == 3
    // snow is white whatever grows under it
    reflectance = mix(reflectance, vec3(dot(reflectance, vec3(1.0 / 3.0))), clamp(0.5 * g.tone.y - 1.0, 0.0, 1.0));
#endif
    color sea = s.sea + s.waves * under.x;
#if GLINT && HIGH
    // eddies of ten kilometres wind films into spirals (Munk et al. 2000, Proc. R. Soc. A 456, 1217)
    vec2 eddy = g.plane + EDDY * (textureLod(t_detail, 1.7 * g.plane, max(DETAIL_LEVEL, 4.5)).xw - 0.5);
    float streaks = textureLod(t_detail, mat2(2.2, 1.6, -0.30, 0.41) * eddy, DETAIL_LEVEL + 1.0).x;
    float gusts = textureLod(t_detail, mat2(0.62, 0.35, -0.22, 0.39) * g.plane, DETAIL_LEVEL - 0.5).x;
    float swell = textureLod(t_detail, mat2(5.1, -3.3, 16.5, 25.5) * g.plane, DETAIL_LEVEL + 4.0).x;
    float films = textureLod(t_detail, mat2(2.6, 1.9, -0.5, 0.7) * eddy, max(DETAIL_LEVEL, 3.0)).x;
    float calm = sea_calm(s.wind, gusts, streaks, swell, films);
    // in the lee of land, over the first tens of kilometres, here more and there less
    calm += LEE * gusts * exp(min(s.shore - 0.5, 0.0) / (LEE_KM * g.sharp));
    sea += color(g.glint * exp(calm + (g.ripple + 1.0) * (1.0 - exp(calm))));
#endif
#if ICE
    // floes and leads: the detail, whose histogram is even, is cut where just that share remains
    float floes = clamp((waters.ice - under.x) * 7.0 + 0.5, 0.0, 1.0) * min(waters.ice * 20.0, 1.0);
#if FAR
    // from far away the detail is averaged before it is cut
    floes = mix(floes, waters.ice, clamp(0.3 * KM_LEVEL - 0.2, 0.0, 1.0));
#endif
    // where they drift apart they are young, thin or wet
    sea = mix(sea, color(FLOE * (0.62 + 0.34 * waters.ice + 0.16 * under.w)), floes);
#endif
    color ground = mix(sea, reflectance, clamp(s.shore + s.wriggle * under.x, 0.0, 1.0));
#if CLOUDS
    // shadow beside the cloud: the cover a cloud's height further towards the Sun, to first order
#if HIGH
    // exactly: the puff that the Sun's ray to this ground meets
    vec2 sunward = g.plane + g.toward * (CLOUD_KM / (2.0 * SLOPE_PER_KM * DETAIL_KM));
    float shading = (cloud_detail(sunward, s.region, DETAIL_LEVEL).x - puff) * scale;
#else
    float shading = clamp(rise * CLOUD_KM * scale, -1.0, 0.35);
#endif
#if ONE_OPTICS
    ground = mix(ground, color(1.0), min(s.share, 1.0));
#else
    float before = clamp(over + shading, 0.0, 1.0);
    ground -= ground * (0.7 * cloud_reflectance(before, s.thick, s.veil, g.thin));
#if HIGH
    // tops that the Sun reaches, and valleys of thick cloud in their shade
    float whole = dot(mass.yz, g.toward) - level;
    float relief = clamp(1.0 - (2.0 * RELIEF_KM) * min(scale, 4.0) * (rise + 2.0 * whole), 0.4, 1.5);
    // seen aslant, their sides hide a part of the tops
    vec2 towards_camera = g.lift * (2.0 * SLOPE_PER_KM * DETAIL_KM);
    relief *= 1.0 - FLANK * clamp(-scale * dot(detail.cloud.yz - 0.5, towards_camera), 0.0, 1.0);
#else
    float relief = clamp(1.0 - RELIEF_KM * min(scale, 4.0) * rise, 0.5, 1.35);
#endif
    ground = mix(ground, color(g.white * relief), cloud);
#endif
#endif
#if AIR
    // the air's tables have them for the mean Earth; a glint goes one way. Moonlight has no haze that could be less
    color wide = min(ground, color(1.0)), more = (wide - EARTH_ALBEDO) * (DOWN * wide + ASIDE);
    color radiance = max(more * g.light + g.haze, color(0.0)) + ground * g.light;
#else
    color radiance = ground * g.light + g.haze;
#endif
#endif
#if NIGHT
    // the map's cells are broken up into streets, where they are dark into towns and roads, each of a mean of one
#if UNLIT
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
    // districts have lamps of their own
#if HIGH
    // white diodes replace sodium street by street
    lamps *= mix(vec3(1.20, 0.90, 0.40), vec3(0.82, 1.06, 1.85), clamp(2.2 * city.w - 0.6, 0.0, 1.0));
#else
    lamps *= mix(vec3(1.12, 0.95, 0.6), vec3(0.88, 1.05, 1.4), city.w);
#endif
#endif
    radiance += lamps;
#endif
    return radiance;
}

// Radiance of a ground point, its surface looked up here [W m-2 sr-1].
color ground_radiance(GroundPoint g, Waters waters) {
    vec4 map = ground_map(g);
    vec2 land_uv = g.uv;
#if HIGH
    vec4 region = textureLod(t_detail, REGION * g.plane, DETAIL_LEVEL - 3.0);
    Detail detail = Detail(cloud_detail(g.plane + g.lift, region.x, DETAIL_LEVEL), textureLod(t_detail, g.plane, DETAIL_LEVEL));
    // fields, woods and towns end raggedly and not as the map's texels blur them: it is read up to WARP_KM aside
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
