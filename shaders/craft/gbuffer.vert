// Transforms target vertices to the sample buffer, and their normals to the camera frame and their code.
#include "craft/packed_samples.glsl"
#include "craft/lens.glsl"
#include "craft/substeps.glsl"
in vec3 in_position_m;
in vec3 in_normal;
in float in_material;
in vec2 in_chart;
out vec2 v_chart;
flat out int v_material_word;
#ifdef TEXTURED
in vec2 in_uv;
out vec2 v_uv;
out vec3 v_position_m; // camera frame
out vec3 v_normal;
flat out uint v_material;
#else
out vec2 v_steps;
#endif
void main() {
    gl_Position = at_whole_substeps(clip_of(u_pattern_clip, u_camera_from_target, in_position_m), u_pattern_px.xy);
    vec3 n = mat3(u_camera_from_target) * in_normal;
    v_chart = in_chart;
    v_material_word = material_word(in_material);
#ifdef TEXTURED
    v_normal = n;
    v_material = uint(in_material + 0.5);
    v_uv = in_uv;
    v_position_m = (u_camera_from_target * vec4(in_position_m, 1.0)).xyz;
#else
    v_steps = normal_steps(n);
#endif
}
