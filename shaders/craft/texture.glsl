// Reads a mesh's textures once per sample: reflectance, metalness, roughness, normal.
// A part without one of the textures uses a single white (or flat) texel instead.
in vec2 v_uv;
in vec3 v_position_m; // camera frame
uniform sampler2D t_base_color;         // sRGB, decoded by the sampler
uniform sampler2D t_metallic_roughness; // glTF 2.0, 3.9.2: roughness in green, metalness in blue
uniform sampler2D t_normal;
uniform vec4 u_base_factor;       // the material's linear RGB; w: 1 when it has a texture
uniform mat3 u_band_from_rgb;     // reflectance per band
uniform float u_normal_mapped;    // 1 when t_normal holds normals
layout(location = 1) out vec4 out_texel; // reflectance per band; w: metallic
layout(location = 2) out vec4 out_detail; // normal, camera frame; w: roughness

// Normal from the normal map, in the camera frame. The tangent frame comes from screen derivatives: Schueler (2006),
// Normal mapping without precomputed tangents, ShaderX 5. Green points up in the texture, against v.
vec3 mapped_normal(vec3 n) {
    vec3 px = dFdx(v_position_m), py = dFdy(v_position_m);
    vec2 ux = dFdx(v_uv), uy = dFdy(v_uv);
    vec3 across_y = cross(py, n), across_x = cross(n, px);
    vec3 tangent = across_y * ux.x + across_x * uy.x;
    vec3 bitangent = -(across_y * ux.y + across_x * uy.y);
    float size = inversesqrt(max(max(dot(tangent, tangent), dot(bitangent, bitangent)), 1e-30));
    // both axes are reversed if the sample pattern mirrors the image
    size *= sign(dot(cross(px, py), n)) * u_normal_mapped;
    vec3 t = texture(t_normal, v_uv).xyz * 2.0 - 1.0;
    return unit_or(tangent * (size * t.x) + bitangent * (size * t.y) + n * mix(1.0, t.z, u_normal_mapped), n);
}

void write_texel(vec3 n) {
    vec3 m = texture(t_metallic_roughness, v_uv).xyz;
    vec3 rgb = texture(t_base_color, v_uv).rgb * u_base_factor.rgb;
    vec4 base = u_material_color[v_material];
    out_texel = vec4(mix(base.xyz, u_band_from_rgb * rgb, u_base_factor.w), base.w * m.z);
    out_detail = vec4(mapped_normal(n), max(u_material_surface[v_material].x * m.y, 0.03));
}
