// Draws image tiles as points: squares of whole pixels, without the diagonal of two triangles.
in vec2 in_pixel;         // centre of a tile [px], pixel edges at .5
uniform vec2 u_extent_px; // width and height of all tiles together
uniform float u_point_px; // side of a tile in the framebuffer
void main() {
    gl_Position = vec4((in_pixel + 0.5) / u_extent_px * 2.0 - 1.0, 0.0, 1.0);
    gl_PointSize = u_point_px;
}
