// Rays past or onto the Moon, a sphere. Coordinates: Moon-fixed axes, in Moon radii.
#include "common/rays.glsl"

struct MoonRay {
    vec3 direction;   // unit vector
    float along;      // camera position along the ray; negative: the Moon is ahead
    float disc;       // 1 - square of the ray's smallest distance from the centre; positive on the disc
    float pixel_rad;  // angular size of a pixel [rad]
};

// Ray of a pixel.
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

// Change of `disc` per pixel perpendicular to the limb.
float moon_slope(MoonRay ray) {
    return 2.0 * sqrt(max(1.0 - ray.disc, 1e-6)) * max(-ray.along, 0.0) * ray.pixel_rad;
}

// Fraction of the pixel inside the limb, 0..1, from the distance to the limb in pixels.
float moon_share(MoonRay ray) {
    return ray.along < 0.0 ? clamp(ray.disc / moon_slope(ray) + 0.5, 0.0, 1.0) : 0.0;
}

// Half the chord of the ray in the sphere. For a pixel across the limb: of the ray through the middle of its inner part.
float moon_depth(MoonRay ray, float share) { return sqrt(max(ray.disc, 0.5 * share * moon_slope(ray))); }
