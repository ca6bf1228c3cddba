// Transforms target vertices to an image window at one sample per pixel. Outputs the label values: camera z [m] and,
// with LAYERS, position and normal in the camera frame, and part number.
#include "craft/lens.glsl"
#include "craft/substeps.glsl"
uniform vec2 u_label_px; // size of the window
uniform mat4 u_label_clip;
uniform mat4 u_label_camera_from_target;
in vec3 in_position_m;
out float v_z_m;
#if LAYERS
in vec3 in_normal;
in float in_part;
out vec3 v_position_m;
out vec3 v_normal;
flat out float v_part;
#endif
void main() {
    gl_Position = at_whole_substeps(clip_of(u_label_clip, u_label_camera_from_target, in_position_m), u_label_px);
    vec3 camera = (u_label_camera_from_target * vec4(in_position_m, 1.0)).xyz;
    v_z_m = camera.z;
#if LAYERS
    v_position_m = camera;
    v_normal = mat3(u_label_camera_from_target) * in_normal;
    v_part = in_part;
#endif
}
