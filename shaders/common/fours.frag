// Two by two pixels of a one-channel image in one texel: upper left, upper right, lower left, lower right.
uniform sampler2D t_image;
layout(location = 0) out vec4 out_four;
void main() {
    ivec2 at = 2 * ivec2(gl_FragCoord.xy);
#define PIXEL(i, j) texelFetch(t_image, at + ivec2(i, j), 0).x
    out_four = vec4(PIXEL(0, 0), PIXEL(1, 0), PIXEL(0, 1), PIXEL(1, 1));
}
