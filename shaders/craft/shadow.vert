// Transforms target vertices to the orthographic view from the Sun.
uniform mat4 u_light_clip_from_target;
in vec3 in_position_m;
void main() { gl_Position = u_light_clip_from_target * vec4(in_position_m, 1.0); }
