// Draws an image tile as a point: a square of whole pixels, without the diagonal of two triangles.
in vec2 in_pixel; // centre of the tile, image pixels; edges lie at .5
uniform vec4 u_window; // x0, y0, width, height of the viewport [px]
void main() {
    gl_Position = vec4((in_pixel + 0.5 - u_window.xy) / u_window.zw * 2.0 - 1.0, 0.0, 1.0);
    gl_PointSize = float(TILE_PX);
}
