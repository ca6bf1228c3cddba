// What a lattice sample sees: material and normal. Back faces of open shells are lit from their own side.
#include "target/pack.glsl"
in vec3 v_normal;
flat in uint v_material;
layout(location = 0) out uint out_surface;
#ifdef TEXTURED
#include "target/texture.glsl"
#endif
void main() {
    // the lattice's axes are a reflection of the image's, which is itself upside down to OpenGL: two flips, so
    // counter-clockwise stays the outside (see simulator/render/lattice.py, projection.py)
    vec3 n = normalize(gl_FrontFacing ? v_normal : -v_normal);
#ifdef TEXTURED
    write_texel(n);
#endif
    out_surface = pack_surface(v_material, n);
}
