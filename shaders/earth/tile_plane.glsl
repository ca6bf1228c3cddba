// Ground values at the corners of a smooth tile, as a plane over the tile: mean, slope to the right, slope down,
// each slope per half a tile. STAGE: out in the vertex shader, in in the fragment shader.
#if HIGH
#define FOR_EACH_VALUE(F) F(vec4, uv_plane) F(vec4, sun) F(color, light) F(color, lamps) F(color, haze) \
    F(color, tone) F(vec4, matter) F(vec4, lift) F(float, ripple)
#else
#define FOR_EACH_VALUE(F) F(vec4, uv_plane) F(vec4, sun) F(color, light) F(color, lamps) F(color, haze) \
    F(color, tone) F(vec4, matter)
#endif
#define DECLARE(type, name) flat STAGE type v_##name[3];
FOR_EACH_VALUE(DECLARE)
#if !HIGH
flat STAGE vec2 v_lift; // the same all over the tile
#endif
flat STAGE vec3 v_middle; // of the tile, in gl_FragCoord's sense [px]; two over the tile's side [px-1]
