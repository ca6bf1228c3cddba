// Self-shadowing of the target: the fraction of the Sun's disc visible from a point.
#if SHADOW_WINDOW == 0
float sun_visibility(vec3 p_m, vec3 n, float share, float bent) { return 0.0; } // no sunlight at all
#else
uniform sampler2D t_shadow; // depth along the sunlight, in this frame's range (simulator/render/gl/depth_buffer.py)

// Bias along the normal of flat faces [texels]. Lower relief casts no shadow. Rounding of the map alone needs 0.01.
const float FLAT_BIAS = 0.06;

// Visible fraction of the Sun's disc, 0..1.
//
// Percentage-closer soft shadows (Fernando 2005, SIGGRAPH sketches) over a window of SHADOW_WINDOW^2 texels. Texels
// nearer to the Sun than the receiver's plane are blockers. Their mean distance times the Sun's angular radius is the
// radius of the penumbra's disc-shaped kernel. Depth is compared with the plane at each texel (receiver plane depth
// bias), so that a slanted face does not shadow itself.
// p_m: camera frame [m]; n: unit geometric normal; share: fraction of the pixel that the surface fills.
// bent: 1 if normals differ within the pixel (facets of a curved surface), 0 on a flat face.
float sun_visibility(vec3 p_m, vec3 n, float share, float bent) {
    float n_l = dot(n, u_sun_direction.xyz);
    // bias by part of a texel along the normal, more at grazing light where facets differ from the smooth normal;
    // applied along the light, so that edges of shadows do not move
    float slope = sqrt(max(1.0 - n_l * n_l, 0.0));
    vec3 q = (u_light_from_camera * vec4(p_m, 1.0)).xyz;
    q.z -= u_shadow.y * mix(FLAT_BIAS, 0.25 + 0.75 * slope, bent) / max(n_l, 0.15);
    vec3 m = mat3(u_light_from_camera) * n;
    float size = 1.0 / u_shadow.z;
    vec2 at = q.xy * size - 0.5;
    vec2 base = floor(at) - float(SHADOW_WINDOW / 2 - 1);
    vec2 f = at - base;
    // depth gradient of the receiver's plane per texel; limited to 6 (80 degrees), as it is uncertain at grazing light
    vec2 g = clamp(-m.xy / min(m.z, -1e-30) * (u_shadow.y * size), -6.0, 6.0) * u_shadow.y;
    const float REACH = float(SHADOW_WINDOW / 2) - 0.5; // largest radius of a disc [texels]
    const float REACH2 = REACH * REACH;
    vec2 corner = (base + 1.0) * u_shadow.z;
    // sum of the blockers' heights above the plane, and of their weights in the search disc
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
    // Footprint of the pixel in the shadow map: the shifts [texels] for half a pixel to the right and half a pixel down.
    // The filter is their ellipse, widened by the penumbra's radius and by that of the sharpest edge, in quadrature.
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
    // The camera does not see all of the receiver's plane under the filter, as a blocker also hides part of its own
    // shadow. A blocker of height d shows a strip of its shadow, `beside` times d wide, along the edges on that side.
    // High blockers show all of their shadow.
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
    // The camera does not see all of the receiver's plane under the filter: if Sun and camera are in similar directions,
    // a blocker hides most of its own shadow. So its weight is the width of the visible strip of shadow over that of
    // the filter, both perpendicular to the light. Without this, cells 1 mm above a panel would darken their gaps.
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
