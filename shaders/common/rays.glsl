// The ray that a pixel looks along. LENS (0 or 1): the lens bends light, and a texture holds what it undoes.
#if LENS
uniform sampler2D t_rays; // x / z, y / z, angle of a pixel [rad]; one pixel more on each side than the image
vec3 lens_ray(vec2 pixel) { return textureLod(t_rays, (pixel + 1.5) / vec2(textureSize(t_rays, 0)), 0.0).xyz; }

// The ray of a pixel, camera frame, not normalised: z is 1.
vec3 camera_ray(vec2 pixel) { return vec3(lens_ray(pixel).xy, 1.0); }

// Angle that a pixel spans [rad]; cosine: of the ray's angle from the axis.
float ray_pixel_rad(vec2 pixel, float cosine) { return lens_ray(pixel).z; }

// Length of a camera's focus [px] by which pixels would lie as densely around this one without a lens that bends.
float ray_focal_px(vec2 pixel) {
    vec3 ray = lens_ray(pixel);
    return 1.0 / (ray.z * pow(1.0 + dot(ray.xy, ray.xy), 0.75));
}

// Change from pixel to pixel, along a row and a column, of a vector's product with the ray.
vec2 ray_slope(vec2 pixel, vec3 n) {
    vec2 along = lens_ray(pixel + vec2(0.5, 0.0)).xy - lens_ray(pixel - vec2(0.5, 0.0)).xy;
    vec2 down = lens_ray(pixel + vec2(0.0, 0.5)).xy - lens_ray(pixel - vec2(0.0, 0.5)).xy;
    return vec2(dot(n.xy, along), dot(n.xy, down));
}
#else
vec3 camera_ray(vec2 pixel) { return vec3((pixel - u_intrinsics.zw) / u_intrinsics.xy, 1.0); }
float ray_pixel_rad(vec2 pixel, float cosine) { return cosine / u_intrinsics.x; }
float ray_focal_px(vec2 pixel) { return u_intrinsics.x; }
vec2 ray_slope(vec2 pixel, vec3 n) { return n.xy / u_intrinsics.xy; }
#endif
