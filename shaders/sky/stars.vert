// Draws a star as a point. in_pixel: image position [px], (0, 0) at the centre of the first pixel.
uniform vec2 u_size;
in vec2 in_pixel;
in vec3 in_radiance;
flat out vec2 v_pixel;
flat out vec3 v_radiance;
void main() {
    v_pixel = in_pixel;
    v_radiance = in_radiance;
    gl_Position = vec4((in_pixel + 0.5) / u_size * 2.0 - 1.0, 0.0, 1.0);
    gl_PointSize = 3.0; // covers the tent filter, which is two pixels wide
}
