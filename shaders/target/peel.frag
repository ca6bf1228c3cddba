// The next surface along parallel rays: which triangle lies nearest behind those already seen.
uniform sampler2D t_before; // depth of the last one, 0..1
out uint out_triangle;      // from 1
void main() {
    // 1e-6: a surface is not behind itself
    if (gl_FragCoord.z <= texelFetch(t_before, ivec2(gl_FragCoord.xy), 0).x + 1e-6) discard;
    out_triangle = uint(gl_PrimitiveID) + 1u;
}
