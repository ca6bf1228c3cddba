// Where a pixel's ray meets the Moon, a sphere. Space: the Moon's axes, in its radii.
#include "common/rays.glsl"

struct MoonRay {
    vec3 direction;   // unit
    float along;      // camera's position along the ray; negative: the Moon is ahead
    float disc;       // 1 - square of the ray's smallest distance from the centre
    float pixel_rad;  // angle of a pixel [rad]
};

// The ray of a pixel past or onto the Moon's sphere.
MoonRay moon_ray(vec2 pixel) {
    MoonRay ray;
    vec3 d = mat3(u_moon_from_camera) * camera_ray(pixel);
    float scale = inversesqrt(dot(d, d));
    ray.direction = d * scale;
    ray.along = dot(u_moon_camera.xyz, ray.direction);
    vec3 moment = cross(u_moon_camera.xyz, ray.direction);
    ray.disc = 1.0 - dot(moment, moment);
    ray.pixel_rad = ray_pixel_rad(pixel, scale);
    return ray;
}

// Change of `disc` over a pixel across the limb.
float moon_slope(MoonRay ray) {
    return 2.0 * sqrt(max(1.0 - ray.disc, 1e-6)) * max(-ray.along, 0.0) * ray.pixel_rad;
}

// Share of the pixel inside the limb, 0..1: distance from the limb in pixels, by the slope of `disc`.
float moon_share(MoonRay ray) {
    return ray.along < 0.0 ? clamp(ray.disc / moon_slope(ray) + 0.5, 0.0, 1.0) : 0.0;
}

// Depth under the limb at the pixel's middle; at the limb, at the middle of its inner part.
float moon_depth(MoonRay ray, float share) { return sqrt(max(ray.disc, 0.5 * share * moon_slope(ray))); }
