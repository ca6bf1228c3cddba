// Packs two by two pixels of an image into one fragment (common/quads.glsl).
#include "common/bands.glsl"
#include "common/quads.glsl"
uniform sampler2D t_image;
void main() {
    FOUR_COLORS(t_image, value)
    color quad[4];
    for (int k = 0; k < 4; ++k) quad[k] = value[k];
    send_quad(quad);
}
