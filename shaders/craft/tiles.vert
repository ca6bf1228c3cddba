// Draws an image tile as a point: a square of whole pixels, without the diagonal of two triangles.
#include "common/bands.glsl"
#define FLAT flat out
#include "craft/flat_inputs.glsl"
in vec2 in_pixel; // centre of the tile, image pixels; edges lie at .5
uniform vec4 u_window; // x0, y0, width, height of the viewport [px]
#ifdef FLAT_INPUTS
uniform vec2 u_texel, u_slope_texel;
#ifdef FLAT_CELLS
uniform vec4 u_cells[4 * CELLS];
#endif
#endif
void main() {
    gl_Position = vec4((in_pixel + 0.5 - u_window.xy) / u_window.zw * 2.0 - 1.0, 0.0, 1.0);
    gl_PointSize = float(TILE_PX);
#ifdef FLAT_INPUTS
    v_intrinsics = u_intrinsics;
    v_sun_direction = u_sun_direction;
    v_globe_rim = u_globe_rim;
    v_nadir_direction = u_nadir_direction;
    v_pattern = u_pattern;
    v_window = u_window;
    v_texel = vec4(u_texel, u_slope_texel);
    v_camera_from_target = u_camera_from_target;
    for (int k = 0; k < BANDS; ++k) v_globe_radiance[k] = u_globe_radiance[k];
#if BANDS == 1
    v_shadow = u_shadow;
    v_light_from_camera = u_light_from_camera;
#endif
    for (int k = 0; k < 10; ++k) SKY(k) = BAND(u_sky[k]);
#ifdef FLAT_CELLS
    for (int k = 0; k < 4 * CELLS; ++k) v_cells[k] = u_cells[k];
#endif
#endif
}
