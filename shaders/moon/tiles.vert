// Corners of the Moon's tiles. With SMOOTH also the ground values there, which are interpolated.
#include "common/bands.glsl"
#include "moon/point.glsl"
uniform vec4 u_window; // x0, y0, width, height of the pixels that hold the Moon
in vec2 in_pixel;      // a corner [px], pixel edges at .5
#if SMOOTH
out vec4 v_place, v_tilt, v_light, v_incident;
#if MAP_AT_CORNERS
out float v_albedo;
#endif
#endif
void main() {
    gl_Position = vec4((in_pixel + 0.5 - u_window.xy) / u_window.zw * 2.0 - 1.0, 0.0, 1.0);
#if SMOOTH
    MoonRay ray = moon_ray(in_pixel);
    MoonPoint g = moon_point(ray, sqrt(max(ray.disc, 0.0)), 1.0);
    v_place = g.place;
    v_tilt = g.tilt;
    v_light = g.light;
    v_incident = g.incident;
#if MAP_AT_CORNERS
    v_albedo = moon_albedo(g);
#endif
#endif
}
