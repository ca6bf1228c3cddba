// Radiance [W m-2 sr-1] of the target in a tile that it fills evenly: between those at the corners, see smooth_corners.frag.
#include "common/bands.glsl"
flat in vec4 v_corners; // at the pixels in the tile's corners, upper ones first
#if BANDS == 3
flat in vec4 v_green, v_blue;
#endif
flat in vec2 v_first_px;
layout(location = 0) out vec4 out_radiance;
layout(location = 1) out float out_coverage;
void main() {
    vec2 f = (gl_FragCoord.xy - 0.5 - v_first_px) / float(TILE_PX - 1);
#define BETWEEN(c) mix(mix(c.x, c.y, f.x), mix(c.z, c.w, f.x), f.y)
#if BANDS == 3
    out_radiance = vec4(BETWEEN(v_corners), BETWEEN(v_green), BETWEEN(v_blue), 1.0);
#else
    out_radiance = OUT(BETWEEN(v_corners));
#endif
    out_coverage = 1.0;
}
