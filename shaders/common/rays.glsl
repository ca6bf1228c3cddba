// The ray that a pixel looks along. LENS (0 or 1): the lens bends light, and a texture holds what it undoes.
#if LENS
uniform sampler2D t_rays; // x / z, y / z, angle of a pixel [rad]; one pixel more on each side than the image
vec3 lens_ray(vec2 pixel) { return textureLod(t_rays, (pixel + 1.5) / vec2(textureSize(t_rays, 0)), 0.0).xyz; }

// The ray of a pixel, camera frame, not normalised: z is 1.
vec3 camera_ray(vec2 pixel) { return vec3(lens_ray(pixel).xy, 1.0); }

// Angle that a pixel spans [rad]; cosine: of the ray's angle from the axis.
float ray_pixel_rad(vec2 pixel, float cosine) { return lens_ray(pixel).z; }
#else
vec3 camera_ray(vec2 pixel) { return vec3((pixel - u_intrinsics.zw) / u_intrinsics.xy, 1.0); }
float ray_pixel_rad(vec2 pixel, float cosine) { return cosine / u_intrinsics.x; }
#endif
