// Draws an image tile as a point: a square of whole pixels. For a smooth tile, ground values are computed at its corners
// and fitted by a plane (mean, and slopes right and down per half tile), which the fragment shader evaluates.
#include "atmosphere/air.glsl"
#include "globe/geometry.glsl"
#include "globe/aerial.glsl"
#include "earth/point.glsl"
uniform vec2 u_extent_px; // of all tiles
uniform float u_tile_px;  // side of a tile
in vec2 in_pixel;         // centre of the tile [px], pixel edges at .5

#if SMOOTH
// air in front of the four corners; the outputs of shaders/earth/tile_corners.vert, one component per attribute
#if !AIR
#define CORNER_AIR(k) GroundAir(color(0.0), color(1.0), 0.0)
#elif BANDS == 1
in vec4 in_air_0, in_air_1, in_air_2;
#define CORNER_AIR(k) GroundAir(in_air_0[k], in_air_1[k], in_air_2[k])
#else
in vec4 in_air_0, in_air_1, in_air_2, in_air_3, in_air_4, in_air_5;
#define CORNER_AIR(k) \
    GroundAir(vec3(in_air_0[k], in_air_1[k], in_air_2[k]), vec3(in_air_3[k], in_air_4[k], in_air_5[k]), 0.0)
#endif
#define STAGE out
#include "earth/tile_plane.glsl"
#endif

void main() {
    gl_Position = vec4((in_pixel + 0.5) / u_extent_px * 2.0 - 1.0, 0.0, 1.0);
#if QUADS
    gl_PointSize = 0.5 * u_tile_px;
#else
    gl_PointSize = u_tile_px;
#endif
#if SMOOTH
    v_middle = vec3(in_pixel + 0.5, 2.0 / u_tile_px);
#define START(type, name) v_##name[0] = v_##name[1] = v_##name[2] = type(0.0);
    FOR_EACH_VALUE(START)
#if !HIGH
    v_lift = vec2(0.0);
#endif
    for (int k = 0; k < 4; ++k) {
        vec2 corner = vec2(float((k & 1) * 2 - 1), float((k & 2) - 1));
        GroundPoint g = ground_point(globe_ray(in_pixel + corner * (0.5 * u_tile_px)), CORNER_AIR(k));
        vec4 at = vec4(g.uv, g.plane);
        vec4 sun = vec4(g.toward, g.sharp, g.glint);
#define ADD(value, name) { v_##name[0] += 0.25 * value; \
        v_##name[1] += (0.25 * corner.x) * value; v_##name[2] += (0.25 * corner.y) * value; }
        ADD(at, uv_plane)
        ADD(sun, sun)
        ADD(g.light, light)
        ADD(g.lamps, lamps)
        ADD(g.haze, haze)
        ADD(g.tone, tone)
        vec4 matter = vec4(g.rough, g.thin, g.white, g.shine);
        ADD(matter, matter)
#if HIGH
        ADD(vec4(g.lift, g.cloud_uv), lift)
        ADD(g.ripple, ripple)
#else
        v_lift += 0.25 * g.lift;
#endif
    }
#endif
}
