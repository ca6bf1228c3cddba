// In-scatter and transmittance of every ray from this frame's camera; see simulator/render/globe/air_pass.py.
// Column: cosine of the azimuth between ray and Sun. Row: rays that meet the ground, then rays that miss it.
#include "atmosphere/march.glsl"

#if BANDS == 1
layout(location = 0) out vec4 out_light; // Rayleigh and higher orders, Mie in-scatter, without phase; transmittance; ground irradiance
#else
layout(location = 0) out vec4 out_rayleigh;
layout(location = 1) out vec4 out_mie;
layout(location = 2) out vec4 out_transmittance;
#endif

void main() {
    vec2 index = gl_FragCoord.xy - 0.5;
    bool ground_ray = index.y < float(ROWS) - 0.5;
    float v = (ground_ray ? index.y : index.y - float(ROWS)) / float(ROWS - 1);
    AirLight light = air_light(ground_ray, v, index.x / float(COLUMNS - 1) * 2.0 - 1.0);
#if BANDS == 1
    out_light = vec4(light.rayleigh, light.mie, light.through, ground_irradiance(dot(light.foot, light.sun) / u_air_radius.x));
#else
    out_rayleigh = vec4(light.rayleigh, 1.0);
    out_mie = vec4(light.mie, 1.0);
    out_transmittance = vec4(light.through, 1.0);
#endif
}
