// Radiance at the corners of a tile of the image that no edge comes near, and whether all between them is interpolated.
//
// That holds where one face fills the tile, flat or slightly bent, the Sun lights all of it or nothing, and its middle
// confirms it. Faces may cut through each other without an edge of the mesh there: a straight cut leaves some sample of a tile's corner pixels
// on the other side, so all of those are looked at.
#include "common/rays.glsl"
#include "target/sample_pattern.glsl"
#include "target/lighting.glsl"
#include "target/packed_samples.glsl"
#ifdef BRUSHED
#define GRAIN(k) u_material_grain[k]
#else
#define GRAIN(k) vec4(0.0)
#endif
uniform usampler2D t_surface;
uniform sampler2D t_depth;
uniform vec2 u_texel;    // one over the sizes of the samples' images
uniform sampler2D t_tiles;  // the tiles' middles, image pixels
// At the corners' pixels: upper left, upper right, lower left, lower right. First NOTHING where the tile shows nothing of the
// target, UNEVEN where its pixels must be shaded.
layout(location = 0) out vec4 out_corners;
#if BANDS == 3
layout(location = 1) out vec4 out_green;
layout(location = 2) out vec4 out_blue;
#endif
const float NOTHING = -2.0, UNEVEN = -1.0;
const int FLAT_STEPS = 2;                     // normals of a flat face differ by no more than the interpolation's rounding
#ifdef BENT
const int MOST_BENT = int(0.04 * CODE_SCALE); // steps by which normals may differ in a tile: 2.3 to 4.6 degrees
#else
const int MOST_BENT = FLAT_STEPS; // a craft with few bent faces: the Sun on each corner of theirs costs all tiles a fifth
#endif
const float COPLANAR = 5e-5;                  // of the distance, by which the middle may lie off the corners' plane
const float AS_INTERPOLATED = 1e-3;           // of the radiance, by which the middle may differ
const float MOST_CONTRAST = 0.06;             // of the radiance, between corners: beside raised parts light from them bends
const float STEP = 2e-6;                      // of the box's depth in the shadow map: its own rounding and ours
const float MOST_TEXELS = 24.0;               // of the shadow map across a tile
const float SPAN = float(TILE_PX - 1);

// Pixel k of a tile: its corners, and one at its middle.
ivec2 place_in_tile(int k) { return k == 4 ? ivec2(TILE_PX / 2) : ivec2(k & 1, k >> 1) * (TILE_PX - 1); }
vec4 only(int k) { return vec4(equal(ivec4(k), ivec4(0, 1, 2, 3))); }

float between(vec4 corners, vec2 at) {
    vec2 f = at / SPAN;
    return mix(mix(corners.x, corners.y, f.x), mix(corners.z, corners.w, f.x), f.y);
}

// Whether a band's middle, and its corners' range, let the tile be interpolated.
bool is_smooth(vec4 corners, float middle) {
    vec2 low = min(corners.xy, corners.zw), high = max(corners.xy, corners.zw);
    float off = abs(between(corners, vec2(place_in_tile(4))) - middle);
    return off <= AS_INTERPOLATED * middle && max(high.x, high.y) - min(low.x, low.y) <= MOST_CONTRAST * middle;
}

// Share of the Sun that all of a flat tile sees, 0 or 1; negative where that is not the same everywhere, or not known.
// It is what `sun_visibility` gives where its window holds no blocker, or nothing else. p: the corners and the middle.
// asked: without it the tile is uneven whatever the Sun does, and its texels are not looked at.
float sun_on_all(vec3 p[5], vec3 n, bool asked) {
    float n_l = dot(n, u_sun_direction.xyz);
    if (n_l <= 0.0 || dot(u_sun_irradiance, vec4(1.0)) == 0.0) return 0.0;
    float size = 1.0 / u_shadow.z;
    vec3 m = mat3(u_light_from_camera) * n;
    vec2 g = -m.xy / min(m.z, -1e-30) * (u_shadow.y * size);
    bool known = max(abs(g.x), abs(g.y)) < 6.0;
    g = clamp(g, -6.0, 6.0) * u_shadow.y;
    vec3 q = (u_light_from_camera * vec4(p[4], 1.0)).xyz;
    q.z -= u_shadow.y * (0.25 + 0.75 * sqrt(max(1.0 - n_l * n_l, 0.0))) / max(n_l, 0.15);
    vec2 middle = q.xy * size - 0.5, low = middle, high = middle;
    for (int k = 0; k < 4; ++k) {
        vec2 at = (u_light_from_camera * vec4(p[k], 1.0)).xy * size - 0.5;
        low = min(low, at);
        high = max(high, at);
    }
    // and the windows of those
    low = floor(low) - float(SHADOW_WINDOW / 2 - 1);
    vec2 count = floor(high) + float(SHADOW_WINDOW / 2 + 1) - low;
    known = known && max(count.x, count.y) <= MOST_TEXELS;
    count = asked ? min(count, MOST_TEXELS) : vec2(0.0);
    float step_of_map = STEP * u_shadow_range.x;
    float above = -1.0, under = 1.0; // most and least height of the map over the plane
    float j = 0.0;
    do {
        float i = 0.0;
        do {
            vec2 texel = low + vec2(i, j);
            vec4 x = texel.x - middle.x + vec4(0.0, 1.0, 1.0, 0.0), y = texel.y - middle.y + vec4(1.0, 1.0, 0.0, 0.0);
            vec4 d = (q.z + g.x * x + g.y * y) - textureGather(t_shadow, (texel + 1.0) * u_shadow.z);
            above = max(above, max(max(d.x, d.y), max(d.z, d.w)));
            under = min(under, min(min(d.x, d.y), min(d.z, d.w)));
            i += 2.0;
        } while (i < count.x);
        j += 2.0;
    } while (j < count.y);
    // where Sun and camera stand alike a blocker hides what it shades
    vec3 v = -normalize(p[4]), l = u_sun_direction.xyz, beside = l - v * (n_l / max(dot(n, v), 0.05));
    bool shaded = under > 5.0 * step_of_map && length(beside - l * dot(l, beside)) > 0.1;
    return !known ? -1.0 : above < -step_of_map ? 1.0 : shaded ? 0.0 : -1.0;
}

// Whether a highlight may hide between the corners and the middle.
bool may_glint(vec4 surface, vec3 n, vec3 p_m, float half_rad) {
    vec3 h = normalize(u_sun_direction.xyz - normalize(p_m));
    float alpha = sun_alpha(surface.x);
#ifdef CLEARCOAT
    if (surface.y > 0.0) alpha = min(alpha, sun_alpha(surface.z));
#endif
    return alpha < 3.0 * half_rad && length(cross(n, h)) < 3.0 * (half_rad + alpha);
}

void main() {
    ivec2 first = ivec2(texelFetch(t_tiles, ivec2(gl_FragCoord.xy), 0).xy - 0.5 * SPAN);
    uint any = 0u, material = 0u, differs = 0u;
    bool full = true;
    ivec2 low = ivec2(CODE_MASK), high = ivec2(0);
    vec4 z = vec4(0.0);
    float z_middle = 0.0;
    for (int k = 0; k < 5; ++k) {
        vec2 place = (vec2(pixel_index(first + place_in_tile(k))) + 0.5) * u_texel;
#define LOOK(n, i, j) { uint g = surface_of(textureLod(t_surface, place + vec2(i, j) * u_texel, 0.0).xy); \
        any |= g; full = full && g != 0u; ivec2 c = normal_code(g); low = min(low, c); high = max(high, c); \
        if (k == 0 && n == 0) material = material_of(g); differs |= material_of(g) ^ material; }
        FOR_EACH_SAMPLE(LOOK)
        z_middle = camera_z(textureLod(t_depth, place, 0.0).x);
        z += only(k) * z_middle;
    }
    vec3 n = decode_normal(0.5 * vec2(low + high));
    vec2 offset = sample_offset(ivec2(0));
    vec3 p[5];
    p[0] = camera_ray(vec2(first) + offset) * z.x;
    p[1] = camera_ray(vec2(first + place_in_tile(1)) + offset) * z.y;
    p[2] = camera_ray(vec2(first + place_in_tile(2)) + offset) * z.z;
    p[3] = camera_ray(vec2(first + place_in_tile(3)) + offset) * z.w;
    p[4] = camera_ray(vec2(first + place_in_tile(4)) + offset) * z_middle;
    vec4 base = u_material_color[material], surface = u_material_surface[material];
    ivec2 spread = high - low;
    int bent = max(spread.x, spread.y);
    bool interpolates = full && differs == 0u && bent <= MOST_BENT;
    interpolates = interpolates && abs(between(1.0 / z, vec2(place_in_tile(4))) * z_middle - 1.0) < COPLANAR;
    float wide = 0.5 * length(cross(normalize(p[0]), normalize(p[3]))) + 2.0 * float(bent) / CODE_SCALE;
    interpolates = interpolates && !may_glint(surface, n, p[4], wide);
#ifdef CRINKLE
    interpolates = interpolates && surface.w == 0.0; // its normals differ from pixel to pixel
#endif
    float lit = sun_on_all(p, n, interpolates);
    interpolates = interpolates && lit >= 0.0;
    vec4 red = vec4(0.0), green = vec4(0.0), blue = vec4(0.0);
    color middle = color(0.0);
    for (int k = 0; k < 5; ++k) {
        ivec2 at = first + place_in_tile(k);
        uvec2 words = textureLod(t_surface, (vec2(pixel_index(at)) + 0.5) * u_texel, 0.0).xy;
        vec3 p_m = camera_ray(vec2(at) + offset) * (k == 4 ? z_middle : dot(z, only(k)));
#ifdef BENT
        if (bent > FLAT_STEPS) {
            n = decode_normal(vec2(normal_code(words.x)));
            // the plane at the middle is not that of the corners
            interpolates = interpolates && abs(sun_visibility(p_m, n, 1.0, 1.0) - lit) < 1e-3;
        }
#endif
        middle = shade(base, surface, GRAIN(material), n, n, p_m, chart_of(words.y), max(lit, 0.0));
#if BANDS == 1
        red += only(k) * middle;
#else
        red += only(k) * middle.x;
        green += only(k) * middle.y;
        blue += only(k) * middle.z;
#endif
    }
#if BANDS == 1
    interpolates = interpolates && is_smooth(red, middle);
#else
    interpolates = interpolates && is_smooth(red, middle.x) && is_smooth(green, middle.y) && is_smooth(blue, middle.z);
    out_green = green;
    out_blue = blue;
#endif
    out_corners = interpolates ? red : vec4(any == 0u ? NOTHING : UNEVEN);
}
