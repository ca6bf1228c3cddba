// The Earth's surface under its air: land, ocean, clouds and night lights, each with its own optics.
// Switches (0 or 1, fixed at compile time): CLOUDS, GLINT, NIGHT, ICE, SHOALS; SMOOTH: one level of detail for all pixels; HIGH: every
// layer looked up at its own place; ONE_OPTICS: land, sea and cloud reflect alike (the counter-example).

uniform sampler2D t_map;    // square roots of land reflectance and cloud opacity, night lights, distance to the coast
#if BANDS == 3
uniform sampler2D t_colour; // square root of land reflectance per band
#endif
uniform sampler2D t_detail; // simulator/render/noise.py
#if ICE
uniform sampler2D t_ice;    // share of the sea under ice; simulator/render/sea_ice.py
#endif
#if SHOALS
uniform sampler2D t_shoals; // square root of what shallow water reflects more than deep; simulator/render/shoals.py
#endif

// llvmpipe samples a whole row of pixels at once when they share a level, and one texel quad at a time when not.
#if SMOOTH
uniform vec2 u_level;       // of the maps and of the detail
#define MAP_LEVEL u_level.x
#define DETAIL_LEVEL u_level.y
#else
#define MAP_LEVEL (-log2(g.sharp * TEXEL_KM))
#define DETAIL_LEVEL (-log2(g.sharp * DETAIL_TEXEL_KM))
#endif

#if BANDS == 1
const float SEA = 0.022;      // reflectance of the water's body: clear ocean, in band (Morel & Maritorena 2001)
#else
const vec3 SEA = vec3(0.006, 0.020, 0.048);
#endif
const float COAST_KM_PER_UNIT = 73.8;   // the coast channel: 255 counts of 1/8 pixel of 1/48 degree
const float CLOUD = 0.84;     // reflectance of thick cloud
const float FLOE = 0.62;      // reflectance of snow on ice, between winter's and that of melting (Perovich et al. 2002)
const float WARP_KM = 12.0;   // HIGH: twice the largest displacement of the land's map
const float SHARPEN = 0.55;   // HIGH: unsharp mask of the land's map
const float ROCK = 1.1;       // HIGH: contrast of bare rock where land is as rough as can be
const float RELIEF_KM = 0.9;  // height of a puff of full contrast, for its own shading

// What makes the sea brighter than deep open water; it hardly changes within two by two pixels.
struct Waters {
    color shoal; // reflectance of shallow or turbid water over that of deep water
    float ice;   // share of the sea under ice
};
Waters waters_at(GroundPoint g) {
    Waters w = Waters(color(0.0), 0.0);
#if SHOALS
    color root = BAND(textureLod(t_shoals, g.uv, MAP_LEVEL - 1.0));
    w.shoal = SHOAL_SCALE * root * root;
#endif
#if ICE
    w.ice = textureLod(t_ice, g.uv, MAP_LEVEL - ICE_LEVEL).x;
#endif
    return w;
}

vec4 ground_map(GroundPoint g) { return textureLod(t_map, g.uv, MAP_LEVEL); }

// Radiance that a ground point sends to the camera [W m-2 sr-1]; map: of t_map there.
color surface_radiance(GroundPoint g, vec4 map, Waters waters) {
#if HIGH
    vec4 detail = textureLod(t_detail, g.plane + g.lift, DETAIL_LEVEL);
    vec4 under = textureLod(t_detail, g.plane, DETAIL_LEVEL);
#else
    // one look-up serves both: on the ground under a clear sky, at the clouds' height where they hide it
    vec4 detail = textureLod(t_detail, g.plane + g.lift * (float(CLOUDS) * clamp(2.0 * map.y, 0.0, 1.0)), DETAIL_LEVEL);
    vec4 under = detail;
#endif
    float puff = detail.x; // of cloud
    float rise = dot(detail.yz - 0.5, g.toward); // of the puff towards the Sun, per km of height

    float hill = dot(under.yz - 0.5, g.toward);  // the same of the ground

    // land and sea; the coast wriggles below the map's texels
    float coast_km = map.w * COAST_KM_PER_UNIT + (under.x * 3.0 - (1.5 + 128.0 / 255.0 * COAST_KM_PER_UNIT));
    float land = clamp(coast_km * g.sharp + 0.5, 0.0, 1.0);
#if HIGH
    // fields, woods and towns end raggedly and not as the map's texels blur them: it is read up to WARP_KM aside
    vec2 aside = (under.xw - 0.5) * WARP_KM * vec2(1.0 / max(sin(PI * g.uv.y), 0.05), 2.0) / (2.0 * PI * EARTH_KM);
    map.xz = textureLod(t_map, g.uv + aside, MAP_LEVEL).xz;
#define LAND_UV (g.uv + aside)
#else
#define LAND_UV g.uv
#endif
#if BANDS == 1
#define LAND_ROOT(level) textureLod(t_map, LAND_UV, level).x
    color root = map.x;
#else
#define LAND_ROOT(level) textureLod(t_colour, LAND_UV, level).xyz
    color root = LAND_ROOT(MAP_LEVEL);
#endif
#if HIGH
    // the map's own contrast of 5 to 20 km, which its making and its magnification took
    root = max(root + SHARPEN * (root - LAND_ROOT(max(MAP_LEVEL, 0.0) + 2.0)), 0.3 * root);
#endif
    color reflectance = root * root;
    // patches, and hills that turn to and from the Sun
    // deserts and snow are even: what grows patchily elsewhere does not grow there
#if BANDS == 1
    float patchy = GRAIN - clamp(2.2 * reflectance - 0.27, 0.0, 0.45);
#else
    // what is brighter is yellower: fields beside woods
    vec3 patchy = (GRAIN - clamp(2.2 * reflectance.x - 0.27, 0.0, 0.45)) * vec3(1.25, 1.0, 0.7);
#endif
    reflectance *= g.tone * (1.0 + patchy * (under.w - 0.5) - clamp(2.2 * hill * g.rough, -0.6, 0.6));
#if HIGH
    // bare rock and wadis, the finer half of the relief: as rough as the land is
    const mat2 turn = mat2(1.84, 1.38, -1.38, 1.84);
    vec4 rock = textureLod(t_detail, turn * g.plane, DETAIL_LEVEL + 1.2);
    float bank = dot(turn * g.toward, rock.yz - 0.5) / 2.3;
    reflectance *= 1.0 + g.rough * (ROCK * (rock.w - 0.5) - clamp(3.2 * bank, -0.6, 0.6));
#endif
    reflectance = min(reflectance, color(0.75)); // fresh snow
#if BANDS == 3
    // snow is white whatever grows under it
    reflectance = mix(reflectance, vec3(dot(reflectance, vec3(1.0 / 3.0))), clamp(0.5 * g.tone.y - 1.0, 0.0, 1.0));
#endif
    color sea = SEA;
#if SHOALS
    sea += waters.shoal;
#endif
    sea *= 0.85 + 0.3 * under.x; // plankton and wind
#if GLINT
#if HIGH
    // wind in gusts, and slicks: calm water shines more in the middle of the glint, less around it
    float gusts = textureLod(t_detail, mat2(0.9, 0.7, -0.2, 0.25) * g.plane, DETAIL_LEVEL).x;
    float calm = 1.2 * gusts + 0.4 * under.x - 0.8; // less of the variance's logarithm
    sea += color(g.glint * exp(calm + (g.ripple + 1.0) * (1.0 - exp(calm))));
#else
    sea += color(g.glint * (0.9 + 0.2 * under.x)); // cat's paws
#endif
#endif
#if ICE
    // floes and leads: the detail, whose histogram is even, is cut where just that share remains
    float floes = clamp((waters.ice - under.x) * 7.0 + 0.5, 0.0, 1.0) * min(waters.ice * 20.0, 1.0);
#if !SMOOTH
    // from far away the detail is averaged before it is cut
    floes = mix(floes, waters.ice, clamp(-0.3 * log2(g.sharp) - 0.2, 0.0, 1.0));
#endif
    // where they drift apart they are young, thin or wet
    sea = mix(sea, color(FLOE * (0.62 + 0.34 * waters.ice + 0.16 * under.w)), floes);
#endif
    color ground = mix(sea, reflectance, land);
#if CLOUDS
    // the map is a cover: the detail, whose histogram is even, is cut where just that share remains
#if HIGH
    map.y = textureLod(t_map, g.cloud_uv, MAP_LEVEL).y;
#endif
    float cover = clamp(map.y * 1.15 - 0.05, 0.0, 1.0);
    float present = min(cover * 10.0, 1.0);
    float scale = 1.0 / (0.14 + 0.30 * cover); // one over half the width of a cloud's edge
    float over = (puff + cover) * scale + (1.0 - 1.06 * scale); // depth of the cloud, 0 at its edge
    float depth = max(over, 0.0);
    depth *= depth * 0.9 * present;             // optical depth times one minus its asymmetry
    depth = max(depth, 1.2 * cover * cover);    // the veil between the puffs
    float cloud = depth / (1.0 + depth);        // two-stream reflectance
#if !SMOOTH
    // from far away the puffs are averaged before they are cut: their mean then is a curve of the cover
    float blurred = clamp(-0.2 * log2(g.sharp) - 0.2, 0.0, 1.0);
    cloud = mix(cloud, cover * (0.698 + cover * (0.772 - 0.738 * cover)), blurred);
#endif
    // shadow beside the cloud: the cover a cloud's height further towards the Sun, to first order
#if HIGH
    // exactly: the puff that the Sun's ray to this ground meets
    float shading = textureLod(t_detail, g.plane + g.toward * (CLOUD_KM / (2.0 * SLOPE_PER_KM * DETAIL_KM)), DETAIL_LEVEL).x - puff;
#else
    float shading = clamp(rise * CLOUD_KM, -0.25, 0.25);
#endif
    float shadow = clamp(0.5 * (over + shading * scale), 0.0, 1.0) * present;
#if ONE_OPTICS
    ground = mix(ground, color(CLOUD), cover);
#else
    ground -= ground * (0.55 * shadow);
    float relief = clamp(1.0 - RELIEF_KM * rise, 0.45, 1.35);
    ground = mix(ground, color(CLOUD * relief * (0.72 + 0.28 * puff)), cloud);
#endif
#endif
    color radiance = ground * g.light + g.haze;
#if NIGHT
    color lamp_tint = color(1.0);
    float lit = map.z * map.z; // the map's levels are nearly logarithms of the light: its fourth power is drawn
    // streets along the valleys, bright crossings, dark blocks between them; nearly one on average
    float street = clamp(1.7 * under.w - 0.35, 0.0, 1.0);
    street *= street * street;
    float streets = street * street * (3.0 + 7.0 * under.x);
#if HIGH
    // blocks and crossings of a few hundred metres
    vec2 block = textureLod(t_detail, mat2(4.8, 3.6, -3.6, 4.8) * g.plane, DETAIL_LEVEL + 2.585).xw;
    float bright = clamp(1.6 * block.y - 0.25, 0.0, 1.0);
    streets = mix(streets, 0.5 + 0.5 * streets, 0.5) * bright * bright * (1.6 + 3.4 * block.x * block.x);
    // the middles of cities are built up
    streets = mix(streets, 1.0 + 0.6 * (block.x - 0.5), 0.8 * lit * lit * lit);
#if BANDS == 3
    // districts have lamps of their own: sodium here, white there
    lamp_tint = mix(vec3(1.05, 0.97, 0.8), vec3(0.75, 1.05, 2.3), smoothstep(0.45, 0.95, block.y));
#endif
#endif
    color lamps = g.lamps * (lit * lit * streets);
#if CLOUDS
    lamps *= 1.0 - 0.8 * cloud;
#endif
    radiance += lamps * lamp_tint;
#endif
    return radiance;
}
