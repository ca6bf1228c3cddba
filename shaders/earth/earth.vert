// A cell of the screen. Smooth cells carry the ground point of their corners; inside it is interpolated.
#include "atmosphere/air.glsl"
#include "earth/geometry.glsl"
#include "earth/aerial.glsl"
#include "earth/point.glsl"
uniform vec2 u_size; // of the image [px]
in vec2 in_pixel;    // corner of the cell [px], edges of pixels at .5

#if SMOOTH
noperspective out vec4 v_uv_plane;
noperspective out vec4 v_sun;   // toward, sharp, glint
noperspective out color v_light;
noperspective out color v_lamps;
noperspective out color v_haze;
noperspective out color v_tone;
noperspective out float v_rough;
#if HIGH
noperspective out vec4 v_below;
#endif
#endif

void main() {
    gl_Position = vec4((in_pixel + 0.5) / u_size * 2.0 - 1.0, 0.0, 1.0);
#if SMOOTH
    GroundPoint g = ground_point(earth_ray(in_pixel));
    v_uv_plane = vec4(g.uv, g.plane);
    v_sun = vec4(g.toward, g.sharp, g.glint);
    v_light = g.light;
    v_lamps = g.lamps;
    v_haze = g.haze;
    v_tone = g.tone;
    v_rough = g.rough;
#if HIGH
    v_below = g.below;
#endif
#endif
}
