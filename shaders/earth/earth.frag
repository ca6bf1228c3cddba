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
noperspective in vec4 v_uv_plane;
noperspective in vec4 v_sun;
noperspective in color v_light;
noperspective in color v_lamps;
noperspective in color v_haze;
noperspective in color v_tone;
noperspective in float v_rough;
#if HIGH
noperspective in vec4 v_below;
#endif
#if HIGH
#define BELOW v_below
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
    GroundPoint g = GroundPoint(
        v_uv_plane.xy, v_uv_plane.zw, BELOW, v_sun.xy, v_sun.z, 0.0, v_rough, v_tone, v_sun.w, v_light, v_lamps, v_haze
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
