// Table of in-scatter and transmittance for all rays from this frame's camera (simulator/render/globe/air_pass.py).
// Columns: cosine of the azimuth between ray and Sun. Rows: rays that meet the ground, then rays that miss it.
#include "atmosphere/march.glsl"

#if BANDS == 1
// x: Rayleigh in-scatter and higher orders; y: Mie in-scatter (both over the phase function); z: transmittance; w:
// irradiance on the ground over the Sun's.
layout(location = 0) out vec4 out_light;
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
