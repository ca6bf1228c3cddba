// Ground values of a smooth tile as planes over the tile: [0] mean, [1] slope to the right, [2] slope down, per half tile.
// STAGE: `out` in the vertex shader, `in` in the fragment shader.
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
flat STAGE vec2 v_lift; // constant over the tile
#endif
flat STAGE vec3 v_middle; // xy: the tile's centre as a gl_FragCoord [px]; z: 2 / side of the tile [px-1]
