// Uniforms as flat inputs of a tile's fragments. llvmpipe reads a uniform lane by lane, in some 24 instructions a component,
// and a flat input in one. At most 28 vectors of the 32 that it has. FLAT: `flat out` or `flat in`.
#ifdef FLAT_INPUTS
FLAT vec4 v_intrinsics, v_sun_direction, v_globe_rim, v_nadir_direction, v_pattern, v_window, v_globe_radiance[BANDS];
FLAT vec4 v_texel; // xy: u_texel; zw: u_slope_texel
FLAT mat4 v_camera_from_target;
#if BANDS == 1
FLAT vec4 v_sky[3], v_shadow; // four coefficients of the sky to a vector
FLAT mat4 v_light_from_camera;
#define SKY(k) v_sky[(k) / 4][(k) % 4]
#ifdef CELLS
#if CELLS <= 2
#define FLAT_CELLS
FLAT vec4 v_cells[4 * CELLS];
#endif
#endif
#else
FLAT vec4 v_sky[10];
#define SKY(k) v_sky[k].xyz
#endif
#else
#define SKY(k) BAND(u_sky[k])
#endif
