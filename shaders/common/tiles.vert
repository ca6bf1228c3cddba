// Tiles of the image as points: squares of whole pixels, without the diagonal that two triangles would have.
in vec2 in_pixel;         // middle of a tile [px], edges of pixels at .5
uniform vec2 u_extent_px; // of all tiles
uniform float u_point_px; // side of a tile in the framebuffer
void main() {
    gl_Position = vec4((in_pixel + 0.5) / u_extent_px * 2.0 - 1.0, 0.0, 1.0);
    gl_PointSize = u_point_px;
}
