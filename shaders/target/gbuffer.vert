// Target vertices into the sample lattice; normals into the camera frame.
in vec3 in_position_m;
in vec3 in_normal;
in float in_material;
out vec3 v_normal;
flat out uint v_material;
#ifdef TEXTURED
in vec2 in_uv;
out vec2 v_uv;
out vec3 v_position_m; // camera frame
#endif
void main() {
    gl_Position = u_lattice_clip_from_target * vec4(in_position_m, 1.0);
    v_normal = mat3(u_camera_from_target) * in_normal;
    v_material = uint(in_material + 0.5);
#ifdef TEXTURED
    v_uv = in_uv;
    v_position_m = (u_camera_from_target * vec4(in_position_m, 1.0)).xyz;
#endif
}
