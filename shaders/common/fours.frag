// Two by two pixels of a one-channel image in one texel: upper left, upper right, lower left, lower right.
uniform sampler2D t_image;
layout(location = 0) out vec4 out_four;
void main() {
#define PIXEL(i, j) textureLod(t_image, (2.0 * gl_FragCoord.xy + vec2(i, j) - 0.5) / vec2(textureSize(t_image, 0)), 0.0).x
    out_four = vec4(PIXEL(0, 0), PIXEL(1, 0), PIXEL(0, 1), PIXEL(1, 1));
}
