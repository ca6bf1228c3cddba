// Where a pixel's ray meets the globe: the body that the block Globe describes.
#include "common/rays.glsl"

// Camera, ray and closest approach, in units of the globe's equatorial radius.
struct GlobeRay {
    vec3 direction;   // unit
    float along;      // camera's position along the ray; negative: the globe is ahead
    float perigee2;   // square of the ray's smallest distance from the centre
    float disc;       // 1 - perigee2, the square of the ray's depth under the sphere
    float pixel_rad;  // angle of a pixel [rad]
    bool away;
};

// The ray along a unit vector.
GlobeRay ray_along(vec3 direction, float pixel_rad) {
    GlobeRay ray;
    ray.direction = direction;
    ray.along = dot(u_globe_camera.xyz, ray.direction);
    // the cross product keeps its digits near the limb, where b^2 - c would lose them
    vec3 moment = cross(u_globe_camera.xyz, ray.direction);
    ray.perigee2 = dot(moment, moment);
    ray.disc = 1.0 - ray.perigee2;
    ray.pixel_rad = pixel_rad;
    ray.away = ray.along >= 0.0;
    return ray;
}

// The ray of a pixel past or onto the ellipsoid.
GlobeRay globe_ray(vec2 pixel) {
    vec3 d = mat3(u_globe_from_camera) * camera_ray(pixel);
    float scale = inversesqrt(dot(d, d));
    return ray_along(d * scale, ray_pixel_rad(pixel, scale));
}

// Share of the pixel inside the limb, 0..1: distance from the limb in pixels, by the slope of `disc`.
float limb_share(GlobeRay ray) {
    float slope = 2.0 * sqrt(ray.perigee2) * -ray.along * ray.pixel_rad;
    return clamp(ray.disc / slope + 0.5, 0.0, 1.0);
}

// Cosine of the azimuth between a ray and the Sun, about the camera's zenith.
float sun_azimuth(GlobeRay ray) {
    float mu = -ray.along * u_globe_camera.w;          // cosine of the angle from the nadir; w: 1 / radius
    float horizontal = sqrt(max(1.0 - mu * mu, 1e-9)); // 1e-9: straight down, where no azimuth matters
    float azimuth = (dot(ray.direction, u_globe_sun.xyz) + mu * u_globe_sun.w) / (horizontal * u_globe_limits.x);
    return clamp(azimuth, -1.0, 1.0);
}
