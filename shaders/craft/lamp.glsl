// A lamp on the chaser that shines along the camera's boresight. CPU twin: simulator/scene/illumination/lamp.py.
// LAMP: 1 led, 2 gaussian, 3 flat. u_lamp_place: xyz: position, camera frame [m]; w: shape parameter of the beam.

// Irradiance [W m-2] at p_m (camera frame [m]) on a face perpendicular to the beam; l: unit vector to the lamp.
color lamp_irradiance(vec3 p_m, out vec3 l) {
    vec3 d = u_lamp_place.xyz - p_m;
    float inverse2 = 1.0 / max(dot(d, d), 1e-4); // 1 cm: closer, the lamp is no point source
    l = d * sqrt(inverse2);
    float ahead = clamp(-l.z, 0.0, 1.0);
#if LAMP == 1
    float beam = pow(max(ahead, 1e-6), u_lamp_place.w);
#else
    float share = acos(ahead) * u_lamp_place.w;
#if LAMP == 2
    float beam = exp2(-share * share) * step(1e-6, ahead);
#else
    float beam = clamp((1.0 - share) / FLAT_EDGE + 0.5, 0.0, 1.0) * step(1e-6, ahead);
#endif
#endif
    return BAND(u_lamp_intensity) * (beam * inverse2);
}
