// Rectangular area lights: diffuse boxes, lamps with a face. CPU twin: simulator/scene/illumination/area_light.py.
// A light is sampled at LIGHT_POINTS points, each for an equal patch of it and with its own shadow map.
uniform sampler2DShadow t_light_depth; // the maps, side by side

// Visibility of a patch from p_m past the target, 0..1: percentage-closer filter over two by two texels.
float patch_visibility(int k, vec3 p_m) {
    vec4 q = u_patch_map[k] * vec4(p_m, 1.0);
    return texture(t_light_depth, q.xyz / q.w);
}

// Integral of the GGX distribution over the half vectors that mirror a rectangle, 0..1, and their mean half vector.
//
// GGX slopes s have the density a2 / (pi (a2 + s.s)^2) (Heitz 2014, eqs. 84 and 85). Its integral over a polygon of
// slopes is Lambert's form factor of the polygon with the vertices (s / a, 1). So the rectangle's corners are mapped to
// the slopes of their half vectors, and Lambert's formula gives the integral. Unlike linearly transformed cosines (Heitz
// et al. 2016), which integrate over light directions, this needs no fitted table.
// to_corner: vectors to the corners, camera frame; t, b, n: tangent frame of the surface.
float mirrored_share(vec3 v, mat4x3 to_corner, vec3 t, vec3 b, vec3 n, float alpha, out vec3 mean) {
    vec3 q[4];
    for (int k = 0; k < 4; ++k) {
        vec3 h = unit_or(v + unit_or(to_corner[k], n), n);
        q[k] = normalize(vec3(dot(h, t), dot(h, b), alpha * max(dot(h, n), 0.02)));
    }
    vec3 total = vec3(0.0);
    for (int k = 0; k < 4; ++k) {
        vec3 x = cross(q[k], q[(k + 1) & 3]);
        float c = clamp(dot(q[k], q[(k + 1) & 3]), -1.0, 1.0), s2 = max(dot(x, x), 1e-12);
        // angle / sine; a series for small angles, as between the corners of a small light
        total += x * (c > 0.999 ? 1.0 + s2 / 6.0 : acos(c) * inversesqrt(s2));
    }
    total *= sign(total.z) * (0.5 / PI); // the winding depends on the side of the camera
    mean = normalize(t * (total.x * alpha) + b * (total.y * alpha) + n * max(total.z, 1e-6));
    return clamp(total.z, 0.0, 1.0);
}

// Radiance that a lobe reflects to the camera over that of the light [1], by reflectance and masking at the mean half
// vector.
color mirrored(Surface s, vec3 h, color f0, float alpha) {
    float v_h = clamp(dot(s.v, h), 0.0, 1.0);
    float n_l = max(2.0 * v_h * dot(s.n, h) - dot(s.n, s.v), 0.0);
    float masking = 4.0 * n_l * visibility_smith(n_l, s.n_v, alpha) * v_h / max(dot(s.n, h), 0.05);
    return fresnel_schlick(f0, v_h) * min(masking, 4.0);
}

// Radiance from a surface towards the camera due to all area lights [W m-2 sr-1].
// surface: as in shade(); kept: fraction of the light that the specular layer transmits.
color area_light(Surface s, vec3 geometric, vec3 p_m, vec4 surface, color kept) {
    vec3 t = s.v - s.n * dot(s.n, s.v);
    float length2 = dot(t, t);
    t = length2 > 1e-6 ? t * inversesqrt(length2) : any_across(s.n);
    vec3 b = cross(s.n, t);
    float alpha = surface.x * surface.x;
    color sum = color(0.0);
    for (int k = 0; k < int(u_light_count.x); ++k) {
        vec3 middle = u_light_middle[k].xyz - p_m, right = u_light_right[k].xyz, down = u_light_down[k].xyz;
        vec3 axis = u_light_axis[k].xyz;
        float exponent = u_light_axis[k].w, patch_m2 = u_light_right[k].w;
        if (dot(middle, axis) >= 0.0) continue; // behind the light
        float falling = 0.0, seen = 0.0, all = 1e-9;
#ifdef CLEARCOAT
        float coat_seen = 0.0, coat_all = 1e-9;
#endif
        for (int j = 0; j < LIGHT_POINTS; ++j) {
            int at = k * LIGHT_POINTS + j;
            vec3 d = u_patch_place[at].xyz - p_m;
            float inverse2 = 1.0 / max(dot(d, d), 1e-4); // 1 cm: nearer, the light is not a point
            vec3 l = d * sqrt(inverse2);
            float n_l = dot(s.n, l), g_l = dot(geometric, l), leaving = max(-dot(l, axis), 0.0);
            float beam = exponent > 0.0 ? pow(leaving, exponent) : step(1e-6, leaving);
            float lit = 0.0;
            if (min(n_l, g_l) > 0.0 && beam > 0.0) {
                // bias along the normal by part of a texel, more at grazing light
                vec3 lifted = p_m + (geometric * (u_light_count.y * sqrt(max(1.0 - g_l * g_l, 0.0)) + u_light_count.z)
                    + l * u_light_count.z) / sqrt(inverse2);
                lit = patch_visibility(at, lifted) * beam;
            }
            falling += max(n_l, 0.0) * leaving * inverse2 * lit;
            // widens the lobes by the size of the patch; the half vector turns by half the angle
            float wide2 = patch_m2 * inverse2 * (0.25 / PI), n_h = clamp(dot(s.n, unit_or(s.v + l, s.n)), 0.0, 1.0);
            float weight = distribution_ggx(n_h, sqrt(min(alpha * alpha + wide2, 1.0)));
            seen += weight * lit;
            all += weight;
#ifdef CLEARCOAT
            float coat_alpha = surface.z * surface.z;
            weight = distribution_ggx(n_h, sqrt(min(coat_alpha * coat_alpha + wide2, 1.0)));
            coat_seen += weight * lit;
            coat_all += weight;
#endif
        }
        mat4x3 corners = mat4x3(middle - right - down, middle + right - down, middle + right + down, middle - right + down);
        vec3 h;
        float share = mirrored_share(s.v, corners, t, b, s.n, max(alpha, 0.001), h) * (seen / all);
        color scattered = s.diffuse * kept, gloss = mirrored(s, h, s.f0, alpha) * s.again * share;
#ifdef CRINKLE
        if (s.creased > 0.0) { // nearly Lambertian for so wide a lobe
            scattered += s.f0 * (s.creased / PI);
            gloss *= 1.0 - s.creased;
        }
#endif
        color light = scattered * (falling * patch_m2) + gloss;
#ifdef CLEARCOAT
        float coat_alpha = max(surface.z * surface.z, 0.001);
        float coat = mirrored_share(s.v, corners, t, b, s.n, coat_alpha, h) * (coat_seen / coat_all);
        light = light * (color(1.0) - coat_fresnel(s, s.n_v)) + s.coat * mirrored(s, h, s.film, coat_alpha) * coat;
#endif
        sum += light * BAND(u_light_radiance[k]);
    }
    return sum;
}
