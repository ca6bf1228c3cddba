// Target vertices into an image window, with their camera z [m].
uniform mat4 u_clip_from_target;
uniform vec4 u_camera_z;
in vec3 in_position_m;
out float v_z_m;
void main() {
    vec4 p = vec4(in_position_m, 1.0);
    gl_Position = u_clip_from_target * p;
    v_z_m = dot(u_camera_z, p);
}
