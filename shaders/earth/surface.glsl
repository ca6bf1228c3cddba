// The Earth's surface under its air: land, ocean, clouds and night lights, each with its own optics.
// Switches (0 or 1, fixed at compile time): AIR, CLOUDS, GLINT, NIGHT.

uniform sampler2D t_map;    // square root of land reflectance, cloud cover, night lights, distance to the coast
#if BANDS == 3
uniform sampler2D t_colour; // square root of land reflectance per band
#endif
uniform sampler2D t_detail; // simulator/render/noise.py

#if BANDS == 1
const float SEA = 0.022;      // reflectance of the water's body: clear ocean, in band (Morel & Maritorena 2001)
#else
const vec3 SEA = vec3(0.006, 0.020, 0.048);
#endif
const float CLOUD = 0.78;     // reflectance of thick cloud
const float CLOUD_KM = 1.5;   // height whose shadow falls beside the cloud
const float RELIEF_KM = 0.9;  // height of a puff of full contrast, for its own shading
const float CITY = 2.0e-3;    // radiance of a city's brightest texels [W m-2 sr-1 per band]; VIIRS: 100-200 nW cm-2 sr-1

// Radiance that a ground point sends to the camera [W m-2 sr-1].
color surface_radiance(GroundPoint g) {
    vec4 map = textureLod(t_map, g.uv, g.level - log2(TEXEL_KM));

    vec4 broad = textureLod(t_detail, g.plane, g.level - log2(BROAD_KM / 512.0));
    vec2 fine_plane = TURN * g.plane * (BROAD_KM / FINE_KM);
    vec4 fine = textureLod(t_detail, fine_plane, g.level - log2(FINE_KM / 512.0));

    // slopes of the detail, for relief and for the shadows of clouds
    float slant = clamp(g.mu, 0.12, 1.0); // 0.12: shadows longer than eight heights are the terminator's own dusk
    vec2 broad_slope = (broad.yz - 0.5) * (2.0 / GRADIENT_SCALE * 512.0); // per tile
    vec2 fine_slope = (fine.yz - 0.5) * (2.0 / GRADIENT_SCALE * 512.0);

    // land and sea
    float coast_km = (map.w - 128.0 / 255.0) * COAST_KM_PER_UNIT + (broad.x - 0.5) * 2.2 + (fine.x - 0.5) * 1.4;
    float land = clamp(coast_km / (exp2(g.level)) + 0.5, 0.0, 1.0);
#if BANDS == 1
    color reflectance = map.x * map.x;
#else
    color root = textureLod(t_colour, g.uv, g.level - log2(TEXEL_KM)).xyz;
    color reflectance = root * root;
#endif
    // patches, and hills that turn to and from the Sun
    vec2 slope_km = broad_slope * (0.55 / BROAD_KM) + (fine_slope * TURN) * (0.45 / FINE_KM);
    float rise = dot(slope_km, g.toward); // of the detail per km towards the Sun
    float hills = clamp(-1.1 * rise / slant, -0.45, 0.45);
    reflectance *= 1.0 + 0.26 * (broad.w - 0.5) + 0.42 * (fine.w - 0.5) + hills;
    color sea = SEA * (0.85 + 0.3 * broad.x); // plankton and wind
    color ground = mix(sea, reflectance, land) * (1.0 / PI);
#if GLINT
    ground += color((1.0 - land) * g.glint * (0.8 + 0.4 * fine.x)); // cat's paws
#endif
#if CLOUDS
    // the map is a cover: the detail, whose histogram is even, is cut where just that share remains
    float cover = clamp(map.y * 1.3 - 0.05, 0.0, 1.0);
    float present = smoothstep(0.0, 0.12, cover);
    float puff = clamp((broad.x * 0.55 + fine.x * 0.45 - 0.5) * 1.4 + 0.5, 0.0, 1.0);
    float soft = 0.10 + 0.22 * cover;
    float cut = 1.06 - cover;
    float cloud = smoothstep(cut - soft, cut + soft, puff) * present;
    cloud = max(cloud, 0.55 * cover * cover); // the veil between the puffs
    // shadow beside the cloud: the cover a cloud's height further towards the Sun, to first order
    float shadow = smoothstep(cut - soft, cut + soft, puff + clamp(rise * CLOUD_KM / slant, -0.25, 0.25)) * present;
    ground *= 1.0 - 0.55 * shadow;
    float relief = clamp(1.0 - RELIEF_KM * rise / slant, 0.45, 1.35);
    ground = mix(ground, color(CLOUD / PI) * (relief * mix(0.72, 1.0, puff)), cloud);
#endif
    color radiance = ground * g.light * BAND(u_earth_irradiance);
#if NIGHT
    float dark = 1.0 - smoothstep(-0.10, 0.02, g.mu);
    float streets = fine.x * fine.x * fine.w;              // bright points and dark blocks, 1/6 on average
    float lamps = map.z * map.z * map.z * dark * CITY * 6.0 * streets;
#if CLOUDS
    lamps *= 1.0 - 0.8 * cloud;
#endif
    radiance += color(lamps);
#endif
    return radiance * g.through + g.haze * BAND(u_earth_irradiance);
}
