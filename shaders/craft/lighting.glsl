// Radiance of a target surface lit by the Sun (shadowed), the sky (occluded), lamps, and the target's other parts.
#include "craft/brdf.glsl"
#include "craft/shadow.glsl"
#ifdef CRINKLE
#include "craft/crinkle.glsl"
#endif
#ifdef CELLS
#include "craft/cells.glsl"
#endif
#ifdef LAMP
#include "craft/lamp.glsl"
#endif

// Baked on the atlas of charts (simulator/baking/radiance_transfer.py): sky visibility in direction w, as a + b . w with
// b in xyz and a in w; and irradiance from the target's other parts, per band [W m-2].
uniform sampler2D t_sky_visibility;
uniform sampler2D t_interreflection;

// Irradiance of the sky on a plate of normal n (camera frame) [W m-2]. See simulator/scene/illumination/irradiance.py.
color sky_irradiance(vec3 n) {
    color e = SKY(0) + SKY(1) * n.x + SKY(2) * n.y + SKY(3) * n.z;
    e += SKY(4) * (n.x * n.y) + SKY(5) * (n.y * n.z) + SKY(6) * (n.z * n.x);
    e += SKY(7) * (3.0 * n.z * n.z - 1.0) + SKY(8) * (n.x * n.x - n.y * n.y);
    float c2 = dot(n, u_globe_rim.xyz);
    c2 *= c2;
    e += SKY(9) * ((35.0 * c2 - 30.0) * c2 + 3.0) * 0.125;
    return max(e, color(0.0));
}

// Radiance of the Earth's disc in direction d [W m-2 sr-1].
color earth_radiance(vec3 d) {
#if BANDS == 1
    return max(dot(u_globe_radiance[0], vec4(d, 1.0)), 0.0);
#else
    vec4 q = vec4(d, 1.0);
    return max(vec3(dot(u_globe_radiance[0], q), dot(u_globe_radiance[1], q), dot(u_globe_radiance[2], q)), 0.0);
#endif
}

// Lobe width alpha, widened by the Sun's disc: half the disc's angular radius is added in quadrature. Exact for a mirror
// (the peak is the disc's radiance); for a wide lobe the peak is right to second order.
float sun_alpha(float roughness) {
    float a2 = roughness * roughness * roughness * roughness, s = 0.5 * u_sun_direction.w;
    return sqrt(min(a2 + s * s, 1.0));
}

// Sky visibility for light from around direction m on a face of normal n, relative to an unobstructed plate [1].
float sky_visibility_towards(vec4 visibility, vec3 n, vec3 m) {
    // 1.008: an unobstructed face must reach 1 despite the texture's 8-bit rounding
    return clamp(1.008 * (visibility.w + 0.667 * dot(visibility.xyz, m)) / (0.5 + 0.5 * max(dot(n, m), -0.8)), 0.0, 1.0);
}

// Properties of a surface for one direction of light: normal and view, colours and lobe.
struct Surface {
    vec3 n, v;      // camera frame
    float n_v;
    color diffuse;  // reflectance over pi
    color f0;
    color again;    // light of all bounces between microfacets over that of the first
    float coat;     // fraction that is clear coated
#ifdef CLEARCOAT
    color film;     // reflectance of the coat at normal incidence
#if BANDS > 1
    color slant;    // additional reflectance at grazing view
#endif
#endif
#ifdef CRINKLE
    float creased;  // fraction of the specular light scattered by creases below any pixel's size; -1: not a blanket
#endif
#ifdef BRUSHED
    vec3 across;    // unit tangent across the grain
    float stretch;  // widens the lobe across the grain: alpha -> mix(alpha, 1, stretch)
#endif
};

#ifdef CLEARCOAT
// Fresnel reflectance of the clear coat at an angle of this cosine.
color coat_fresnel(Surface s, float cosine) {
    color f = s.film;
#if BANDS > 1
    f += s.slant * (1.0 - cosine);
#endif
    return (f + (color(1.0) - f) * pow5(1.0 - cosine)) * s.coat;
}
#endif

// BRDF [sr-1] for light from the unit vector l. alpha, coat_alpha: lobe widths, already widened by the light's own size.
color reflected(Surface s, vec3 l, float n_l, float alpha, float coat_alpha) {
    vec3 h = unit_or(s.v + l, s.n); // light from straight behind has no half vector
    float n_h = clamp(dot(s.n, h), 0.0, 1.0), v_h = clamp(dot(s.v, h), 0.0, 1.0);
    color f = fresnel_schlick(s.f0, v_h);
#ifdef BRUSHED
    float lobe = brushed_lobe(s.n, s.across, s.v, l, h, vec2(mix(alpha, 1.0, s.stretch), alpha));
#else
    float lobe = distribution_ggx(n_h, alpha) * visibility_smith(n_l, s.n_v, alpha);
#endif
#ifdef CRINKLE
    // slopes of facets have a Gaussian distribution, without the long tails of GGX
    if (s.creased >= 0.0) lobe = distribution_beckmann(n_h, alpha) * visibility_smith(n_l, s.n_v, alpha);
    if (s.creased > 0.0)
        lobe = mix(lobe, distribution_ggx(n_h, CREASED_ALPHA) * visibility_smith(n_l, s.n_v, CREASED_ALPHA), s.creased);
#endif
    color out_light = (color(1.0) - f) * s.diffuse + f * s.again * lobe;
#ifdef CLEARCOAT
    color fc = coat_fresnel(s, v_h);
    out_light = out_light * (color(1.0) - fc) + fc * distribution_ggx(n_h, coat_alpha) * visibility_smith(n_l, s.n_v, coat_alpha);
#endif
    return out_light;
}

#ifdef LIGHT_POINTS
#include "craft/area_lights.glsl"
#endif

// Radiance from one surface towards the camera [W m-2 sr-1].
//
// base: xyz: reflectance per band; w: metallic.
// surface: x: roughness; y: clear coat 0..1, plus 1 with thin films; z: roughness of the coat; w: amplitude of the
//     crinkle, or if negative of the mottle.
// grain: xyz: direction of brushing, target frame; w: stretch of the lobe 0..1, negative if brushed around that axis.
// geometric: normal of the face, which limits light and shadow; n: shading normal.
// p_m: position in the camera frame [m]. chart: coordinates in the atlas of charts.
// lit: visible fraction of the Sun's disc.
color shade(vec4 base, vec4 surface, vec4 grain, vec3 geometric, vec3 n, vec3 p_m, vec2 chart, float lit) {
    vec3 v = -normalize(p_m);
#ifdef CRINKLE
    float creased = -1.0;
    if (surface.w > 0.0) {
        float tape;
        creased = 0.0;
        n = crinkled(n, v, p_m, surface.w, surface.x, tape);
        if (base.w > 0.0) { // foil: the part that is not mirror-like has a wider lobe
            creased = 1.0 - base.w;
            base *= vec4(vec3(1.0 - TAPE_DARKER * tape), 0.0);
            base.w = 1.0;
        }
    } else if (surface.w < 0.0) {
#ifdef WORN
        if (surface.w < -1.0) wear(n, v, p_m, -surface.w, base, surface.x);
        else
#endif
        base.xyz *= mottle(n, v, p_m, -surface.w);
    }
#endif
#ifdef CELLS
    float cell_film = 1.0;
    if (surface.y > 1.0) cell_film = cell_at(p_m, v, n, base);
#endif
    float n_v = max(dot(n, v), 1e-3); // 1e-3: an averaged normal at the silhouette may face away
    vec3 l = u_sun_direction.xyz;
    float n_l = max(dot(n, l), 0.0) * step(0.0, dot(geometric, l));
    color albedo = BAND(base);
    color f0 = mix(color(0.04), albedo, base.w);
    // above 1: a cover glass with thin films on it and on the cell below
    bool films = surface.y > 1.0;
    surface.y -= float(films);
#ifdef CLEARCOAT
    f0 = mix(f0, under_coat(f0), surface.y);
#endif
    color diffuse = albedo * ((1.0 - base.w) / PI);
#ifdef BRUSHED
    vec3 axis = mat3(u_camera_from_target) * grain.xyz;
    // brushed along the axis, or around it as by a lathe
    vec3 across = grain.w > 0.0 ? cross(n, axis) : axis - dot(axis, n) * n;
    float length2 = dot(across, across);
    // a face perpendicular to the grain has no direction of brushing
    across = length2 > 1e-4 ? across * inversesqrt(length2) : any_across(n);
    float stretch = length2 > 1e-4 ? grain.w * grain.w : 0.0;
    vec2 e = directional_albedo(brushed_roughness(surface.x, stretch, n_v, dot(across, v)), n_v);
#else
    vec2 e = directional_albedo(surface.x, n_v);
#endif
#ifdef CRINKLE
    if (creased > 0.0) e = mix(e, directional_albedo(sqrt(CREASED_ALPHA), n_v), creased);
#endif
    // multiple scattering between microfacets: Turquin (2019), Practical multiple scattering compensation for
    // microfacet models
    color again = color(1.0) + f0 * (1.0 / (e.x + e.y) - 1.0);
    Surface s;
    s.n = n;
    s.v = v;
    s.n_v = n_v;
    s.diffuse = diffuse;
    s.f0 = f0;
    s.again = again;
    s.coat = surface.y;
#ifdef CLEARCOAT
    s.film = films ? FILM : color(0.04);
#if BANDS > 1
    s.slant = films ? FILM_SLANT : color(0.0);
#endif
#ifdef CELLS
    if (films) s.film *= cell_film;
#endif
#endif
#ifdef CRINKLE
    s.creased = creased;
#endif
#ifdef BRUSHED
    s.across = across;
    s.stretch = stretch;
#endif
    color direct = color(0.0);
#if SHADOW_WINDOW
    direct = reflected(s, l, n_l, sun_alpha(surface.x), sun_alpha(surface.z)) * BAND(u_sun_irradiance) * (n_l * lit);
#endif
#ifdef LAMP
    {
        vec3 towards;
        color falling = lamp_irradiance(p_m, towards);
        float cosine = max(dot(n, towards), 0.0) * step(0.0, dot(geometric, towards));
        float wide = surface.x * surface.x, coat_wide = surface.z * surface.z;
        direct += reflected(s, towards, cosine, wide, coat_wide) * falling * cosine;
    }
#endif

    // ambient light: the visible part of the sky, and interreflection from the parts that hide the rest
    mat3 R = mat3(u_camera_from_target);
    vec3 n_target = geometric * R, r = reflect(-v, n);
    vec4 visibility = textureLod(t_sky_visibility, chart, 0.0);
    visibility.xyz = (visibility.xyz - 0.5) * (2.0 * LARGEST_SLOPE);
    color interreflection = BAND(textureLod(t_interreflection, chart, 0.0));
#ifndef CLOSED
    if (min(chart.x, chart.y) > 0.9999) { // back of an open shell: nothing is baked, so assume an open plate
        visibility = vec4(0.75 * n_target, 0.5);
        interreflection = color(0.0);
    }
#endif
    vec3 m = unit_or(n_target + u_nadir_direction.w * (u_nadir_direction.xyz * R), n_target);
    color ambient = sky_irradiance(n) * sky_visibility_towards(visibility, n_target, m) + interreflection;
    // `own`: mean radiance of the target's parts that hide the sky in the mirror direction
    float hidden = max(1.0 - sky_visibility_towards(visibility, n_target, n_target), 0.05);
    float mirrored = sky_visibility_towards(visibility, n_target, r * R);
    color own = interreflection * (min((1.0 - mirrored) / hidden, 2.0) / PI), earth = earth_radiance(r) * mirrored;
    float rim = dot(r, u_globe_rim.xyz) - u_globe_rim.w;
    float blur = surface.x * surface.x + 0.02;
#ifdef CRINKLE
    float wide = blur + CREASED_BLUR * step(1e-3, creased); // facets are curved, and the limb is soft
    float seen = smoothstep(-wide, wide, rim);
    if (creased > 0.0) {
        earth *= earth_mottle(r, blur);
        seen = mix(seen, smoothstep(-CREASED_ALPHA, CREASED_ALPHA, rim), creased);
    }
#else
    float seen = smoothstep(-blur, blur, rim);
#endif
    color gloss = (f0 * e.x + e.y) * again;
#ifdef LIGHT_POINTS
    direct += area_light(s, geometric, p_m, surface, color(1.0) - gloss);
#endif
    color sky = ambient * diffuse * (color(1.0) - gloss) + gloss * (earth * seen + own);
#ifdef CLEARCOAT
    {
        color fe = coat_fresnel(s, n_v);
        float coat_blur = surface.z * surface.z + 0.02;
#ifdef WORN
        if (creased < 0.0) earth *= earth_mottle(r, coat_blur);
#endif
        sky = sky * (color(1.0) - fe) + fe * (earth * smoothstep(-coat_blur, coat_blur, rim) + own);
    }
#endif
    return direct + sky;
}
