// Camera ray of a pixel. LENS (0 or 1): the lens distorts, and a texture holds the undistorted rays.
#if LENS
uniform sampler2D t_rays; // x / z, y / z, angular size of a pixel [rad]; one pixel wider than the image on each side
vec3 lens_ray(vec2 pixel) { return textureLod(t_rays, (pixel + 1.5) / vec2(textureSize(t_rays, 0)), 0.0).xyz; }

// Ray of a pixel in the camera frame, with z = 1.
vec3 camera_ray(vec2 pixel) { return vec3(lens_ray(pixel).xy, 1.0); }

// Angular size of a pixel [rad]; cosine: of the angle between ray and optical axis.
float ray_pixel_rad(vec2 pixel, float cosine) { return lens_ray(pixel).z; }

// Focal length [px] of the distortion-free camera whose pixels have the same size around this ray.
float ray_focal_px(vec2 pixel) {
    vec3 ray = lens_ray(pixel);
    return 1.0 / (ray.z * pow(1.0 + dot(ray.xy, ray.xy), 0.75));
}

// Derivative of dot(n, camera_ray) by the pixel coordinates [px-1].
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
