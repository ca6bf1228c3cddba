// The ray of a pixel, camera frame, not normalised: z is 1 at the centre of an undistorted image.
vec3 camera_ray(vec2 pixel) { return vec3((pixel - u_intrinsics.zw) / u_intrinsics.xy, 1.0); }
