// Metallic-roughness reflection of glTF 2.0: Lambert diffuse, GGX specular, clear coat.
#include "common/bands.glsl"

// GGX distribution of normals [sr-1]. Walter et al. (2007), Microfacet models for refraction, eq. 33.
float distribution_ggx(float n_h, float alpha) {
    float a2 = alpha * alpha;
    float d = (n_h * a2 - n_h) * n_h + 1.0;
    return a2 / (PI * d * d);
}

// Height-correlated Smith visibility, G / (4 n_l n_v) [1]. Heitz (2014), Understanding the masking-shadowing
// function, eq. 99.
float visibility_smith(float n_l, float n_v, float alpha) {
    float a2 = alpha * alpha;
    float v = n_l * sqrt((n_v - n_v * a2) * n_v + a2);
    float l = n_v * sqrt((n_l - n_l * a2) * n_l + a2);
    return 0.5 / max(v + l, 1e-6); // 1e-6: both cosines vanish at grazing light and view together
}

float pow5(float x) { float x2 = x * x; return x2 * x2 * x; }

// Fresnel reflectance, Schlick (1994), eq. 15.
color fresnel_schlick(color f0, float v_h) { return f0 + (color(1.0) - f0) * pow5(1.0 - v_h); }

// Directional albedo of GGX for F0 and F90 = 1: fit of Karis (2014), Physically based shading on mobile.
vec2 environment_brdf(float roughness, float n_v) {
    vec4 r = roughness * vec4(-1.0, -0.0275, -0.572, 0.022) + vec4(1.0, 0.0425, 1.04, -0.04);
    float a004 = min(r.x * r.x, exp2(-9.28 * n_v)) * r.x + r.y;
    return vec2(-1.04, 1.04) * a004 + r.zw;
}

// Reflectance at normal incidence of a surface under a clear coat of index 1.5 instead of in air: the coat's index is
// between the two. Romain Guy & Mathias Agopian (2018), Physically based rendering in Filament, section 4.9.3.
color under_coat(color f0) {
    color root = sqrt(f0);
    color ratio = (color(1.0) - 5.0 * root) / (color(5.0) - root);
    return ratio * ratio;
}
