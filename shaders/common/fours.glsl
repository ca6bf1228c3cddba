// Two by two pixels in one fragment: four values of one band in a texel, or three of three bands in three texels, in
// the order in which the image's rows hold them.
#if BANDS == 1
layout(location = 0) out vec4 out_four;
void send_four(float four[4]) { out_four = vec4(four[0], four[1], four[2], four[3]); }
#else
layout(location = 0) out vec4 out_first;
layout(location = 1) out vec4 out_middle;
layout(location = 2) out vec4 out_last;
void send_four(vec3 four[4]) {
    out_first = vec4(four[0], four[1].x);
    out_middle = vec4(four[1].yz, four[2].xy);
    out_last = vec4(four[2].z, four[3]);
}
#endif

// What an image holds at the middle of pixel k of the four: upper left, upper right, lower left, lower right.
#define PIXEL(image, k) textureLod(image, (2.0 * gl_FragCoord.xy + vec2((k) & 1, (k) >> 1) - 0.5) / vec2(textureSize(image, 0)), 0.0)
