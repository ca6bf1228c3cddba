// Tent filter over the four pixels nearest to a star; its weights always sum to 1.
#include "common/bands.glsl"
uniform sampler2D t_coverage;
flat in vec2 v_pixel;
flat in vec3 v_radiance;
layout(location = 0) out vec4 out_radiance;
void main() {
    vec2 w = max(1.0 - abs(gl_FragCoord.xy - 0.5 - v_pixel), 0.0);
    float open = 1.0 - texelFetch(t_coverage, ivec2(gl_FragCoord.xy), 0).x;
    out_radiance = OUT(BAND(v_radiance) * (w.x * w.y * open));
}
