// Writes the G-buffer of one sample: material, normal, coordinates in the atlas of charts. Back faces of open shells get
// the opposite normal.
//
// The sample pattern's axes mirror the image's, and the image is upside down in OpenGL. The two flips cancel, so outer
// faces stay counter-clockwise (simulator/render/craft/sample_pattern.py, projection.py).
#include "craft/packed_samples.glsl"
flat in int v_material_word;
in vec2 v_chart;
layout(location = 0) out uvec2 out_surface; // two words, packed by packed_samples.glsl
#ifdef TEXTURED
in vec3 v_normal;
flat in uint v_material;
#include "common/unit.glsl"
#include "craft/texture.glsl"
void main() {
    vec3 n = unit_or(gl_FrontFacing ? v_normal : -v_normal, -normalize(v_position_m));
    write_texel(n);
    out_surface = uvec2(pack_surface(v_material_word, normal_steps(n)), gl_FrontFacing ? pack_chart(v_chart) : no_chart());
}
#else
in vec2 v_steps;
void main() {
#ifdef CLOSED
    out_surface = uvec2(pack_surface(v_material_word, v_steps), pack_chart(v_chart));
#else
    out_surface = uvec2(
        pack_surface(v_material_word, gl_FrontFacing ? v_steps : opposite_steps(v_steps)),
        gl_FrontFacing ? pack_chart(v_chart) : no_chart());
#endif
}
#endif
