// Where a vertex goes. Without a lens straight to clip space; with one it stays in the camera frame until the
// generated stages (simulator/render/gl/tessellation.py) have cut its triangle small enough to bend.
#if LENS
vec4 raster_position(mat4 clip_from_target, vec3 p_m) { return u_lens_camera_from_target * vec4(p_m, 1.0); }
#else
vec4 raster_position(mat4 clip_from_target, vec3 p_m) { return clip_from_target * vec4(p_m, 1.0); }
#endif
