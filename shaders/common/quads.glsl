// Two by two pixels in one fragment: four values in one texel (one band), or twelve in three texels (three bands).
// Order: upper left, upper right, lower left, lower right.

// Writes the four pixels of a fragment.
#if BANDS == 1
layout(location = 0) out vec4 out_quad;
void send_quad(float quad[4]) { out_quad = vec4(quad[0], quad[1], quad[2], quad[3]); }
#else
layout(location = 0) out vec4 out_first;
layout(location = 1) out vec4 out_middle;
layout(location = 2) out vec4 out_last;
void send_quad(vec3 quad[4]) {
    out_first = vec4(quad[0], quad[1].x);
    out_middle = vec4(quad[1].yz, quad[2].xy);
    out_last = vec4(quad[2].z, quad[3]);
}
#endif

// Reads the four pixels of an image at this fragment, in the same order.
vec2 between_four(sampler2D image) { return 2.0 * gl_FragCoord.xy / vec2(textureSize(image, 0)); }
vec4 four_of(sampler2D image) { return textureGather(image, between_four(image)).wzxy; }
#if BANDS == 1
#define FOUR_COLORS(image, name) vec4 name = four_of(image);
#else
#define FOUR_COLORS(image, name) vec3 name[4]; { \
        vec2 at = between_four(image); \
        vec4 red = textureGather(image, at, 0).wzxy, green = textureGather(image, at, 1).wzxy; \
        vec4 blue = textureGather(image, at, 2).wzxy; \
        for (int k = 0; k < 4; ++k) name[k] = vec3(red[k], green[k], blue[k]); \
    }
#endif
