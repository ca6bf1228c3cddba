// A tile of the image as a point, with the radiance at its corners.
in vec2 in_pixel; // centre of the tile, image pixels; edges lie at .5
in vec4 in_corners;
flat out vec4 v_corners;
#if BANDS == 3
in vec4 in_green;
in vec4 in_blue;
flat out vec4 v_green, v_blue;
#endif
flat out vec2 v_first_px;
uniform vec4 u_window; // x0, y0, width, height of the viewport [px]
void main() {
    gl_Position = vec4((in_pixel + 0.5 - u_window.xy) / u_window.zw * 2.0 - 1.0, 0.0, 1.0);
    gl_PointSize = float(TILE_PX);
    v_first_px = in_pixel - 0.5 * float(TILE_PX - 1);
    v_corners = in_corners;
#if BANDS == 3
    v_green = in_green;
    v_blue = in_blue;
#endif
}
