// The Earth and its air behind the target: radiance to add [W m-2 sr-1].
// Space: Earth-fixed axes, the polar one stretched so that the WGS84 ellipsoid is the unit sphere.
// SMOOTH: the cell is all ground, away from limb and poles. COVERED: the target may be in front. MOON: the Moon may.
#include "atmosphere/air.glsl"
#include "earth/geometry.glsl"
#include "earth/aerial.glsl"
#include "earth/point.glsl"
#include "earth/surface.glsl"
#if MOON
#include "moon/disc.glsl"
#endif

#if SMOOTH
#define STAGE in
#include "earth/plane.glsl"
#define AT(name) (v_##name[0] + x.x * v_##name[1] + x.y * v_##name[2])
#if HIGH
#define BELOW AT(below)
#else
#define BELOW vec4(0.0)
#endif
#endif
uniform sampler2D t_coverage;
layout(location = 0) out vec4 out_radiance;

void main() {
    float open = 1.0;
#if COVERED
    open -= texelFetch(t_coverage, ivec2(gl_FragCoord.xy), 0).x;
    if (open <= 0.0) discard;
#endif
#if MOON
    open *= 1.0 - moon_share(moon_ray(gl_FragCoord.xy - 0.5)); // the Moon in front, seen from its orbit
#endif
#if SMOOTH
    vec2 x = (gl_FragCoord.xy - v_middle.xy) * v_middle.z;
    vec4 at = AT(uv_plane), sun = AT(sun); // sun: toward, sharp, glint
    GroundPoint g = GroundPoint(
        at.xy, at.zw, BELOW, sun.xy, sun.z, 0.0, AT(rough), AT(tone), sun.w, AT(light), AT(lamps), AT(haze)
    );
    color radiance = surface_radiance(g);
#else
    EarthRay ray = earth_ray(gl_FragCoord.xy - 0.5);
    if (ray.away || ray.perigee2 > u_earth_limits.y) discard;
    float share = limb_share(ray); // of the pixel that the ground fills
    color radiance = color(0.0);
    if (share > 0.0) radiance = share * surface_radiance(ground_point(ray));
    if (share < 1.0) radiance += (1.0 - share) * air_radiance(ray);
#endif
    out_radiance = OUT(radiance * open);
}
