// Rays past or onto the globe, the body of the uniform block Globe.
// Coordinates: body axes in equatorial radii, the polar one stretched so that the ellipsoid is the unit sphere.
#include "common/rays.glsl"

struct GlobeRay {
    vec3 direction;   // unit vector
    float along;      // camera position along the ray; negative: the globe is ahead
    float perigee2;   // square of the ray's smallest distance from the centre
    float disc;       // 1 - perigee2: square of half the chord in the sphere; negative off the disc
    float pixel_rad;  // angular size of a pixel [rad]
    bool away;        // the globe is behind the camera
};

// The ray along a unit vector.
GlobeRay ray_along(vec3 direction, float pixel_rad) {
    GlobeRay ray;
    ray.direction = direction;
    ray.along = dot(u_globe_camera.xyz, ray.direction);
    // cross product, as b^2 - c loses precision near the limb
    vec3 moment = cross(u_globe_camera.xyz, ray.direction);
    ray.perigee2 = dot(moment, moment);
    ray.disc = 1.0 - ray.perigee2;
    ray.pixel_rad = pixel_rad;
    ray.away = ray.along >= 0.0;
    return ray;
}

// Ray of a pixel.
GlobeRay globe_ray(vec2 pixel) {
    vec3 d = mat3(u_globe_from_camera) * camera_ray(pixel);
    float scale = inversesqrt(dot(d, d));
    return ray_along(d * scale, ray_pixel_rad(pixel, scale));
}

// Fraction of the pixel inside the limb, 0..1, from the distance to the limb in pixels.
float limb_share(GlobeRay ray) {
    float slope = 2.0 * sqrt(ray.perigee2) * -ray.along * ray.pixel_rad;
    return clamp(ray.disc / slope + 0.5, 0.0, 1.0);
}

// Cosine of the azimuth between ray and Sun around the camera's zenith.
float sun_azimuth(GlobeRay ray) {
    float mu = -ray.along * u_globe_camera.w;          // cosine of the angle from the nadir; w: 1 / radius
    float horizontal = sqrt(max(1.0 - mu * mu, 1e-9)); // 1e-9: the azimuth is irrelevant straight down
    float azimuth = (dot(ray.direction, u_globe_sun.xyz) + mu * u_globe_sun.w) / (horizontal * u_globe_limits.x);
    return clamp(azimuth, -1.0, 1.0);
}
