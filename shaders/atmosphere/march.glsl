// Ray marching: in-scatter and transmittance along a ray from this frame's camera.
#include "atmosphere/air.glsl"

uniform sampler2D t_transmittance;
#define MARCH
uniform sampler2D t_ground;
uniform sampler2D t_multiple; // simulator/scene/illumination/multiple_scattering.py

// Transmittance of sunlight down to radius r_m [m] at the Sun's zenith cosine mu [1], with sunset at the horizon.
// Table mapping: Bruneton & Neyret (2008), section 4.
color transmittance_to_sun(float r_m, float mu) {
    float ground = u_air_radius.x, top = u_air_radius.y;
    float r = max(r_m, ground);
    float ratio = ground / r;
    float horizon = -sqrt(max(1.0 - ratio * ratio, 0.0));
    float x = clamp((mu - horizon) / (2.0 * u_air_radius.w) + 0.5, 0.0, 1.0);
    float share = x * x * (3.0 - 2.0 * x);
    float m = max(mu, horizon);
    float rim = sqrt(top * top - ground * ground);
    float rho = sqrt(max(r * r - ground * ground, 0.0));
    float d = -r * m + sqrt(max(r * r * (m * m - 1.0) + top * top, 0.0));
    float shortest = top - r, longest = rho + rim;
    vec2 size = vec2(textureSize(t_transmittance, 0));
    vec2 uv = vec2(clamp((d - shortest) / (longest - shortest), 0.0, 1.0), rho / rim);
    return BAND(textureLod(t_transmittance, (uv * (size - 1.0) + 0.5) / size, 0.0)) * share;
}

// Irradiance on level ground, direct and diffuse, over the Sun's [1].
color ground_irradiance(float mu) {
    float size = float(textureSize(t_ground, 0).x);
    float x = clamp((mu - GROUND_MU_MIN) / (1.0 - GROUND_MU_MIN), 0.0, 1.0);
    return BAND(textureLod(t_ground, vec2((x * (size - 1.0) + 0.5) / size, 0.5), 0.0));
}

// Mean radiance of light scattered twice or more, over the Sun's irradiance [sr-1]. CPU twin: MultipleScattering.
color multiple_scattering(float height_m, float mu_sun) {
    vec2 size = vec2(textureSize(t_multiple, 0));
    float row = sqrt(clamp(height_m / (u_air_radius.y - u_air_radius.x), 0.0, 1.0));
    float column = 0.5 + 0.5 * sign(mu_sun) * sqrt(abs(mu_sun));
    return BAND(textureLod(t_multiple, (vec2(column, row) * (size - 1.0) + 0.5) / size, 0.0));
}

// Radiance and transmittance of the air along a ray.
struct AirLight {
    color rayleigh;   // Rayleigh in-scatter, higher orders, airglow; over the Sun's irradiance and the phase function [1]
    color mie;        // Mie single in-scatter over the Sun's irradiance and the phase function [1]
    color through;    // transmittance
    vec3 foot;        // end of the ray [m]; the camera is on the z axis
    vec3 sun;         // unit vector to the Sun in those axes
};

// In-scatter and transmittance along a ray from the camera.
// v: row coordinate of the table, 0..1; 0 at the limb, 1 at the nadir (ground_ray) or at the top of the air.
// azimuth: cosine of the azimuth between ray and Sun.
AirLight air_light(bool ground_ray, float v, float azimuth) {
    float ground = u_air_radius.x, top = u_air_radius.y, camera = u_air_radius.z;
    float lift = top * top - ground * ground;
    // square of the ray's perigee radius [m2]
    float perigee2 = ground_ray ? ground * ground * (1.0 - v * v) : ground * ground + v * v * lift;
    float sine = min(sqrt(max(perigee2, 0.0)) / camera, 1.0), cosine = sqrt(1.0 - sine * sine);
    vec3 ray = vec3(sine * azimuth, sine * sqrt(max(1.0 - azimuth * azimuth, 0.0)), -cosine);
    vec3 sun = vec3(sqrt(max(1.0 - u_air_sun.x * u_air_sun.x, 0.0)), 0.0, u_air_sun.x);
    float to_perigee = camera * cosine;
    float half_air = sqrt(max(top * top - perigee2, 0.0));
    float start = max(to_perigee - half_air, 0.0);
    float end = ground_ray ? to_perigee - ground * v : to_perigee + half_air;
    float span = max(end - start, 0.0);
    color rayleigh = color(0.0), mie = color(0.0), depth = color(0.0), more = color(0.0);
    for (int k = 0; k < STEPS; ++k) {
        float x = (float(k) + 0.5) / float(STEPS);
        float t = start + span * (ground_ray ? 1.0 - (1.0 - x) * (1.0 - x) : x);
        float dt = span / float(STEPS) * (ground_ray ? 2.0 * (1.0 - x) : 1.0);
        vec3 p = vec3(0.0, 0.0, camera) + t * ray;
        // radius from the perigee, more precise than length(p)
        float r = sqrt(perigee2 + (t - to_perigee) * (t - to_perigee));
        vec3 d = density(r - ground);
        color step_depth = extinction_m(d) * dt;
        float mu_sun = dot(p, sun) / r;
        color half2 = 0.25 * step_depth * step_depth;
        // mean transmittance over the step, by the series of sinh(x) / x
        color arrives = exp(-(depth + 0.5 * step_depth)) * (1.0 + half2 * (1.0 / 6.0 + half2 / 120.0)) * dt;
        color light = transmittance_to_sun(r, mu_sun) * arrives;
        rayleigh += d.x * light;
        mie += d.y * light;
        more += (d.x * BAND(u_air_rayleigh) + d.y * BAND(u_air_mie_scattering)) * arrives * multiple_scattering(r - ground, mu_sun);
        depth += step_depth;
    }
    more += BAND(u_airglow) * airglow_path(ground_ray, perigee2);
    // readers multiply by the Rayleigh phase function, so light without a phase function is divided by it here
    rayleigh = rayleigh * BAND(u_air_rayleigh) + more / rayleigh_phase(dot(ray, sun));
    mie *= BAND(u_air_mie_scattering);
    return AirLight(rayleigh, mie, exp(-depth), vec3(0.0, 0.0, camera) + end * ray, sun);
}
