// Metallic-roughness reflection of glTF 2.0: Lambert diffuse, GGX specular, clear coat.
#include "common/bands.glsl"
#include "common/unit.glsl"

// GGX distribution of normals [sr-1]. Walter et al. (2007), Microfacet models for refraction, eq. 33.
float distribution_ggx(float n_h, float alpha) {
    float a2 = alpha * alpha;
    float d = max((n_h * a2 - n_h) * n_h + 1.0, a2); // a2 is its minimum, which rounding may miss
    return a2 / (PI * d * d);
}

#ifdef CRINKLE
// Beckmann distribution of normals [sr-1]: Gaussian slopes. Walter et al. (2007), eq. 25.
float distribution_beckmann(float n_h, float alpha) {
    float c2 = max(n_h * n_h, 1e-4), a2 = alpha * alpha;
    return exp((c2 - 1.0) / (c2 * a2)) / (PI * a2 * c2 * c2);
}
#endif

// Height-correlated Smith visibility, G / (4 n_l n_v) [1]. Heitz (2014), Understanding the masking-shadowing
// function, eq. 99.
float visibility_smith(float n_l, float n_v, float alpha) {
    float a2 = alpha * alpha;
    float v = n_l * sqrt((n_v - n_v * a2) * n_v + a2);
    float l = n_v * sqrt((n_l - n_l * a2) * n_l + a2);
    return 0.5 / max(v + l, 1e-6); // 1e-6: both cosines may be 0
}

#ifdef BRUSHED
// Anisotropic GGX lobe of brushed metal: distribution times visibility [sr-1]. alpha: across and along the grain.
// Heitz (2014), Understanding the masking-shadowing function, eqs. 85, 86 and 99.
float brushed_lobe(vec3 n, vec3 across, vec3 v, vec3 l, vec3 h, vec2 alpha) {
    vec3 along = cross(n, across);
    vec3 q = vec3(dot(across, h) / alpha.x, dot(along, h) / alpha.y, dot(n, h));
    float q2 = max(dot(q, q), 1e-7);
    float n_v = max(dot(n, v), 1e-3), n_l = max(dot(n, l), 0.0);
    float hidden_v = n_l * length(vec3(alpha * vec2(dot(across, v), dot(along, v)), n_v));
    float hidden_l = n_v * length(vec3(alpha * vec2(dot(across, l), dot(along, l)), n_l));
    return 0.5 / (PI * alpha.x * alpha.y * q2 * q2 * max(hidden_v + hidden_l, 1e-6));
}

// Roughness of the isotropic lobe with the same directional albedo as a brushed one [1]. Fitted to integrals over lobes
// of roughness 0.2 to 0.65 and stretch 0.1 to 0.8, all view directions: rms error of the albedo 0.03, grazing 0.18.
float brushed_roughness(float roughness, float stretch, float n_v, float across_v) {
    float along = roughness * roughness, across = mix(along, 1.0, stretch);
    float share = clamp(0.46 + 0.275 * (1.0 - n_v * n_v) - 0.45 * across_v * across_v, 0.0, 1.0);
    return sqrt(sqrt(mix(along * along, across * across, share)));
}
#endif

float pow5(float x) { float x2 = x * x; return x2 * x2 * x; }

// Fresnel reflectance, Schlick (1994), eq. 15.
color fresnel_schlick(color f0, float v_h) { return f0 + (color(1.0) - f0) * pow5(1.0 - v_h); }

// Directional albedo f0 x + y of the GGX lobe with height-correlated masking, single scattering, at the view cosine n_v.
// Polynomials in sqrt(n_v) and roughness r, fitted to numeric integrals (20,000 samples, 40 x 30 nodes), rms error 0.006.
// Test: tests/simulator/render/craft/test_lighting.py.
vec2 directional_albedo(float r, float n_v) {
    float m = sqrt(n_v);
    float whole = ((((-38.63337 * r + 110.10903) * r - 102.19394) * r + 32.92679) * r - 2.29593);
    whole = whole * m + ((((44.41101 * r - 175.98399) * r + 200.16812) * r - 74.48436) * r + 5.71478);
    whole = whole * m + ((((37.42138 * r - 0.23155) * r - 79.85882) * r + 48.28341) * r - 4.61465);
    whole = whole * m + ((((-52.37844 * r + 84.04295) * r - 29.60000) * r - 4.90857) * r + 1.25132);
    whole = whole * m + ((((12.19726 * r - 23.79158) * r + 13.97816) * r - 2.17902) * r + 0.95749);
    float grazing = ((((148.74303 * r - 326.27229) * r + 224.00756) * r - 41.40432) * r - 4.48512);
    grazing = grazing * m + ((((-398.20089 * r + 886.91014) * r - 625.99288) * r + 126.14619) * r + 9.63422);
    grazing = grazing * m + ((((368.27273 * r - 837.05454) * r + 613.19932) * r - 138.37540) * r - 4.68118);
    grazing = grazing * m + ((((-130.50348 * r + 306.07797) * r - 237.78629) * r + 63.58060) * r - 1.89464);
    grazing = grazing * m + ((((11.81405 * r - 29.89354) * r + 26.68440) * r - 9.94485) * r + 1.42021);
    whole = clamp(whole, 0.05, 1.0);
    grazing = clamp(grazing, 0.0, whole);
    return vec2(whole - grazing, grazing);
}

// Reflectance at normal incidence of a surface under a clear coat of refractive index 1.5, from that in air.
// Guy & Agopian (2018), Physically based rendering in Filament, section 4.9.3.
color under_coat(color f0) {
    color root = sqrt(f0);
    color ratio = (color(1.0) - 5.0 * root) / (color(5.0) - root);
    return ratio * ratio;
}
