// Light that leaves a surface of the target: the Sun with shadows, the sky with occlusion, the craft's own parts.
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

// Baked on the atlas of charts, simulator/baking/radiance_transfer.py: visibility of the sky, a + b . w over directions w, and
// irradiance from the craft's other parts, per band [W m-2].
uniform sampler2D t_sky_visibility;
uniform sampler2D t_interreflection;

// Irradiance of the sky on a plate of normal n, camera frame [W m-2]; simulator/scene/illumination/irradiance.py.
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

// Width of a lobe of the given roughness under the Sun's disc: half the disc's radius in the half vector's angle, added
// in squares. Exact for a mirror (the disc's own radiance) and, to second order, for the peak of a wide lobe.
float sun_alpha(float roughness) {
    float a2 = roughness * roughness * roughness * roughness, s = 0.5 * u_sun_direction.w;
    return sqrt(min(a2 + s * s, 1.0));
}

// Visibility of the sky towards m: share of the light from around direction m that reaches a face of normal n, over what an open plate gets [1].
float sky_visibility_towards(vec4 visibility, vec3 n, vec3 m) {
    // 1.008: eight bits hold the visibility, and an open face must not lose by their rounding
    return clamp(1.008 * (visibility.w + 0.667 * dot(visibility.xyz, m)) / (0.5 + 0.5 * max(dot(n, m), -0.8)), 0.0, 1.0);
}

// Properties of a surface for one direction of light: normal and view, colours and lobe.
struct Surface {
    vec3 n, v;      // camera frame
    float n_v;
    color diffuse;  // reflectance over pi
    color f0;
    color again;    // over the first bounce between microfacets
    float coat;     // share that is clear coated
#ifdef CLEARCOAT
    color film;     // reflectance of the coat at normal incidence
#if BANDS > 1
    color slant;    // additional reflectance at grazing view
#endif
#endif
#ifdef CRINKLE
    float creased;  // share of the gloss that is scattered by creases too fine for any picture; -1: no blanket
#endif
#ifdef BRUSHED
    vec3 across;    // unit vector along the surface, across the grain
    float stretch;  // by which the lobe is wider that way: alpha -> mix(alpha, 1, stretch)
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

// Radiance over the irradiance of a face that looks at the light; l: unit vector to it.
// alpha, coat_alpha: widths of the lobes, the light's own included.
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
    // slopes of facets are spread as a Gaussian, without the tails of a rough metal
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

// Radiance that leaves one surface towards the camera [W m-2 sr-1].
// base: reflectance per band, metallic; surface: roughness, clear coat (one more: with films), its roughness, crinkle
// (negative: mottle); p_m: camera frame [m].
// geometric: the face's normal, which shadows are cut at; n: the one that light falls on.
// chart: place in the atlas of charts; lit: share of the Sun's disc that it sees.
// grain: direction of the brushing, target frame; w: how much it stretches the lobe, 0..1, negative around the axis.
color shade(vec4 base, vec4 surface, vec4 grain, vec3 geometric, vec3 n, vec3 p_m, vec2 chart, float lit) {
    vec3 v = -normalize(p_m);
#ifdef CRINKLE
    float creased = -1.0;
    if (surface.w > 0.0) {
        float tape;
        creased = 0.0;
        n = crinkled(n, v, p_m, surface.w, surface.x, tape);
        if (base.w > 0.0) { // foil: its part that is not a mirror has a wider lobe
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
    float n_v = max(dot(n, v), 1e-3); // 1e-3: a normal averaged at the silhouette may look away
    vec3 l = u_sun_direction.xyz;
    float n_l = max(dot(n, l), 0.0) * step(0.0, dot(geometric, l));
    color albedo = BAND(base);
    color f0 = mix(color(0.04), albedo, base.w);
    // beyond one: a cover glass with films on it and on the cell below
    bool films = surface.y > 1.0;
    surface.y -= float(films);
#ifdef CLEARCOAT
    f0 = mix(f0, under_coat(f0), surface.y);
#endif
    color diffuse = albedo * ((1.0 - base.w) / PI);
#ifdef BRUSHED
    vec3 axis = mat3(u_camera_from_target) * grain.xyz;
    // brushed along the axis; or around it, as a lathe leaves metal
    vec3 across = grain.w > 0.0 ? cross(n, axis) : axis - dot(axis, n) * n;
    float length2 = dot(across, across);
    // a face that looks along the grain shows no direction
    across = length2 > 1e-4 ? across * inversesqrt(length2) : any_across(n);
    float stretch = length2 > 1e-4 ? grain.w * grain.w : 0.0;
    vec2 e = directional_albedo(brushed_roughness(surface.x, stretch, n_v, dot(across, v)), n_v);
#else
    vec2 e = directional_albedo(surface.x, n_v);
#endif
#ifdef CRINKLE
    if (creased > 0.0) e = mix(e, directional_albedo(sqrt(CREASED_ALPHA), n_v), creased);
#endif
    // light that bounces several times between microfacets: Turquin (2019), Practical multiple scattering compensation
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

    // the sky: its unhidden share, and the light of the craft's other parts instead of the rest
    mat3 R = mat3(u_camera_from_target);
    vec3 n_target = geometric * R, r = reflect(-v, n);
    vec4 visibility = textureLod(t_sky_visibility, chart, 0.0);
    visibility.xyz = (visibility.xyz - 0.5) * (2.0 * LARGEST_SLOPE);
    color interreflection = BAND(textureLod(t_interreflection, chart, 0.0));
#ifndef CLOSED
    if (min(chart.x, chart.y) > 0.9999) { // the back of an open shell: nothing is baked there
        visibility = vec4(0.75 * n_target, 0.5);
        interreflection = color(0.0);
    }
#endif
    vec3 m = unit_or(n_target + u_nadir_direction.w * (u_nadir_direction.xyz * R), n_target);
    color ambient = sky_irradiance(n) * sky_visibility_towards(visibility, n_target, m) + interreflection;
    // mean radiance of the parts that hide the sky, in the mirror direction
    float hidden = max(1.0 - sky_visibility_towards(visibility, n_target, n_target), 0.05);
    float mirrored = sky_visibility_towards(visibility, n_target, r * R);
    color own = interreflection * (min((1.0 - mirrored) / hidden, 2.0) / PI), earth = earth_radiance(r) * mirrored;
    float rim = dot(r, u_globe_rim.xyz) - u_globe_rim.w;
    float blur = surface.x * surface.x + 0.02;
#ifdef CRINKLE
    float wide = blur + CREASED_BLUR * step(1e-3, creased); // the limb is veiled, and facets are no plane mirrors
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
