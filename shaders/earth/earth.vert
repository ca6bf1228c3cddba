// A cell of the screen. Smooth cells carry the ground point of their corners; inside it is interpolated.
#include "atmosphere/air.glsl"
#include "earth/geometry.glsl"
#include "earth/aerial.glsl"
#include "earth/point.glsl"
uniform vec2 u_size; // of the image [px]
in vec2 in_pixel;    // corner of the cell [px], edges of pixels at .5

#if SMOOTH
out vec4 v_uv_plane;
out vec4 v_sun;   // toward, mu, level
out float v_glint;
out color v_light;
out color v_through;
out color v_haze;
#endif

void main() {
    gl_Position = vec4((in_pixel + 0.5) / u_size * 2.0 - 1.0, 0.0, 1.0);
#if SMOOTH
    GroundPoint g = ground_point(earth_ray(in_pixel));
    v_uv_plane = vec4(g.uv, g.plane);
    v_sun = vec4(g.toward, g.mu, g.level);
    v_glint = g.glint;
    v_light = g.light;
    v_through = g.through;
    v_haze = g.haze;
#endif
}
