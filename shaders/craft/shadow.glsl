// Share of the Sun's disc that a point of the target sees past the target itself.
#if SHADOW_WINDOW == 0
float sun_visibility(vec3 p_m, vec3 n, float share, float bent) { return 0.0; } // no sunlight at all
#else
uniform sampler2D t_shadow; // depth along the sunlight, in this frame's range (simulator/render/gl/depth_buffer.py)

// Of a texel along the normal: relief so low on a flat face throws no shadow. The map's own rounding needs a hundredth.
const float FLAT_BIAS = 0.06;

// Visibility of the Sun, 0..1.
//
// Percentage-closer soft shadows (Fernando 2005, SIGGRAPH sketches) over one window of SHADOW_WINDOW^2 texels: those
// nearer to the Sun than the receiver's own plane are blockers; their mean distance times the Sun's angular radius is
// the radius of the penumbra's kernel, a disc like the Sun. The plane's depth is followed from texel to texel, so that
// a slanted face does not shade itself.
// p_m: camera frame [m]; n: unit geometric normal; share: of the pixel's area that the surface fills.
// bent: 1 where normals differ within the pixel, so that facets stand for something round; 0 where n is the face's own.
float sun_visibility(vec3 p_m, vec3 n, float share, float bent) {
    float n_l = dot(n, u_sun_direction.xyz);
    // nearer to the Sun than its surface by a part of a texel along the normal, more at grazing light: what facets differ
    // from their smooth normal. Along the light, so that no shadow's edge moves.
    float slope = sqrt(max(1.0 - n_l * n_l, 0.0));
    vec3 q = (u_light_from_camera * vec4(p_m, 1.0)).xyz;
    q.z -= u_shadow.y * mix(FLAT_BIAS, 0.25 + 0.75 * slope, bent) / max(n_l, 0.15);
    vec3 m = mat3(u_light_from_camera) * n;
    float size = 1.0 / u_shadow.z;
    vec2 at = q.xy * size - 0.5;
    vec2 base = floor(at) - float(SHADOW_WINDOW / 2 - 1);
    vec2 f = at - base;
    // depth of the receiver's plane per texel; beyond 6 (80 degrees) light is grazing and the plane no longer known
    vec2 g = clamp(-m.xy / min(m.z, -1e-30) * (u_shadow.y * size), -6.0, 6.0) * u_shadow.y;
    const float REACH = float(SHADOW_WINDOW / 2) - 0.5; // with half a texel more, all of the disc is in the window
    const float REACH2 = REACH * REACH;
    vec2 corner = (base + 1.0) * u_shadow.z;
    // depth [m] of the blockers above the plane, and how much of the search disc they fill
    float depth_sum = 0.0, blocked = 0.0;
#define SHADOW_BLOCK(k, i, j) \
    vec4 x##k = vec4(float(i), float(i) + 1.0, float(i) + 1.0, float(i)) - f.x; \
    vec4 y##k = vec4(float(j) + 1.0, float(j) + 1.0, float(j), float(j)) - f.y; \
    vec4 d##k = (q.z + g.x * x##k + g.y * y##k) - textureGather(t_shadow, corner + vec2(i, j) * u_shadow.z); \
    { vec4 near = clamp((0.5 + 0.5 * REACH - (0.5 / REACH) * x##k * x##k) - (0.5 / REACH) * y##k * y##k, 0.0, 1.0); \
    near = mix(vec4(0.0), near, greaterThanEqual(d##k, vec4(0.0))); \
    blocked += dot(near, vec4(1.0)); \
    depth_sum += dot(near, d##k); }
    FOR_EACH_SHADOW_BLOCK(SHADOW_BLOCK)
    float penumbra = depth_sum / max(blocked, 1e-3) * u_sun_direction.w / u_shadow.y;
    // What the pixel holds of the receiver's plane, as the Sun sees it: by how many texels half a pixel to the right, and
    // half a pixel down, move the point. The filter is the ellipse of the two, wider by the sharpest edge's radius and
    // the penumbra's: widths add in squares.
    vec3 v = -normalize(p_m), l = u_sun_direction.xyz;
    float n_v = max(dot(n, v), 0.05);
    vec2 half_px = (0.5 * sqrt(share) * size * p_m.z / n_v) / u_intrinsics.xy;
    vec2 right = (mat3(u_light_from_camera) * (vec3(n_v, 0.0, 0.0) - n.x * v)).xy * half_px.x;
    vec2 down = (mat3(u_light_from_camera) * (vec3(0.0, n_v, 0.0) - n.y * v)).xy * half_px.y;
    vec3 area = vec3(right * right + down * down, right.x * right.y + down.x * down.y); // xx, yy, xy
    float sharpest2 = u_shadow.w * u_shadow.w;
    float round2 = min(penumbra * penumbra + sharpest2, REACH2);
    area *= min(1.0, (REACH2 - round2) / max(area.x + area.y, 1e-6)); // no wider than the window
    float spread2 = 0.5 * (area.x + area.y) + sharpest2;
    area.xy += round2;
    float size2 = area.x * area.y - area.z * area.z;
    float sharpness = 0.5 * sqrt(2.0 * size2 / (area.x + area.y));
    area *= sharpness / size2;
    float inside = 0.5 + sharpness;
#if SHADOW_WINDOW > 4
    // The filter spreads over the receiver's plane, but the camera does not see all of that. A blocker d above the plane
    // hides the plane under itself; its shadow shows where the camera's ray from it, which passes at `beside` times d from
    // there across the light, meets no blocker. Low ones show a strip of that width along the edges that look that way;
    // high ones all of their shadow.
    vec3 beside = v * (n_l / n_v) - l;
    vec2 strip = (mat3(u_light_from_camera) * beside).xy * (size * u_shadow.x / u_shadow.y);
    vec2 strips = abs(strip);
    float relief = length(strip) * inversesqrt(spread2);
    float lit = 0.0, dark = 0.0;
#define SHADOW_FILTER(k, i, j) \
    x##k = clamp(inside - (area.y * x##k * x##k + area.x * y##k * y##k - 2.0 * area.z * x##k * y##k), 0.0, 1.0); \
    { vec4 above = step(1e-9, d##k), high = clamp(d##k * relief, 0.0, 1.0), under = 1.0 - above; \
    lit += dot(x##k, under); \
    float top = max(max(d##k.x, d##k.y), max(d##k.z, d##k.w)); \
    vec2 left = above.wx * under.zy, right = under.wx * above.zy; \
    vec2 low = above.wz * under.xy, upper = under.wz * above.xy; \
    vec2 a = strip.x > 0.0 ? left : right, b = strip.y > 0.0 ? low : upper; \
    float mean = dot(x##k, vec4(0.25)), edge = 2.0 * mean * top * (strips.x * (a.x + a.y) + strips.y * (b.x + b.y)); \
    float h = clamp(top * relief, 0.0, 1.0); \
    dark += dot(x##k, high * high) + (1.0 - h) * edge; \
    any_dark += dot(x##k, above); }
    float any_dark = 0.0;
    FOR_EACH_SHADOW_BLOCK(SHADOW_FILTER)
    float visible = lit > 0.0 ? lit / (lit + dark) : 1.0 - step(1e-4, any_dark);
#else
    // The filter spreads over the receiver's plane, but the camera does not see all of that: a blocker hides the plane
    // under itself, and with it most of its shadow where Sun and camera stand alike. Its texel counts by the share of
    // the filter's width by which its shadow is seen beside it: cells 1 mm proud of a panel do not blacken their gaps.
    // Both widths are measured across the light.
    vec3 beside = l - v * (n_l / n_v);
    float seen = length(beside - l * dot(l, beside));
    float relief = seen * inversesqrt(spread2) / u_shadow.y;
    float open = 0.0, dark = 0.0;
#define SHADOW_FILTER(k, i, j) \
    x##k = clamp((inside - area.y * x##k * x##k) - area.x * y##k * y##k + (2.0 * area.z * x##k) * y##k, 0.0, 1.0); \
    y##k = clamp(d##k * relief, 0.0, 1.0); \
    open += dot(mix(vec4(0.0), x##k, lessThanEqual(d##k, vec4(0.0))), vec4(1.0)); \
    dark += dot(x##k, y##k);
    FOR_EACH_SHADOW_BLOCK(SHADOW_FILTER)
    float visible = 1.0 - dark / max(open + dark, 1e-4);
#endif
    return n_l > 0.0 ? visible : 0.0;
}
#endif
