// Writes camera z [m] of the nearest surface at the pixel's centre. With LAYERS also its unit normal (camera frame,
// towards the camera) and its part number (from 1; 0 is the background).
in float v_z_m;
layout(location = 0) out float out_z_m;
#if LAYERS
#include "common/unit.glsl"
in vec3 v_position_m;
in vec3 v_normal;
flat in float v_part;
layout(location = 1) out vec4 out_surface;
#endif
void main() {
    out_z_m = v_z_m;
#if LAYERS
    // back faces of open shells get the opposite normal; a smoothed normal that faces away from the camera is
    // projected perpendicular to the view direction
    vec3 away = normalize(v_position_m);
    vec3 face = cross(dFdx(v_position_m), dFdy(v_position_m));
    vec3 n = unit_or(v_normal, -away);
    if (dot(n, face) * dot(away, face) > 0.0) n = -n;
    n -= max(dot(n, away), 0.0) * away;
    out_surface = vec4(unit_or(n, -away), v_part);
#endif
}
