// Radiance [W m-2 sr-1] and coverage [1] of the target, per image pixel, from the G-buffer's samples.
// The samples of a pixel are grouped into surfaces by material and normal; each group is shaded once.
#include "common/bands.glsl"
#define FLAT flat in
#include "craft/flat_inputs.glsl"
#ifdef FLAT_INPUTS
#define u_intrinsics v_intrinsics
#define u_sun_direction v_sun_direction
#define u_globe_rim v_globe_rim
#define u_globe_radiance v_globe_radiance
#define u_nadir_direction v_nadir_direction
#define u_pattern v_pattern
#define u_window v_window
#define u_texel v_texel.xy
#define u_slope_texel v_texel.zw
#define u_camera_from_target v_camera_from_target
#if BANDS == 1
#define u_shadow v_shadow
#define u_light_from_camera v_light_from_camera
#endif
#else
uniform vec2 u_texel, u_slope_texel; // 1 / size of the sample images, and of the slope image
uniform vec4 u_window;               // x0, y0, width, height of the pixels that hold the target
#endif
#include "common/rays.glsl"
#include "craft/sample_pattern.glsl"
#include "craft/lighting.glsl"
#include "craft/packed_samples.glsl"
#ifdef EXACT_AREAS
#include "craft/packed_sums.glsl"
#else
#include "craft/packed_slope.glsl"
#endif
#ifdef BRUSHED
#define GRAIN(k) u_material_grain[k]
#else
#define GRAIN(k) vec4(0.0)
#endif

uniform usampler2D t_surface;
uniform sampler2D t_depth;
uniform sampler2D t_slope; // slope of the sample weights at edges, from edge.frag
#ifdef TEXTURED
uniform sampler2D t_texel;     // reflectance per band and metalness of each sample
uniform sampler2D t_detail;    // normal (camera frame) and roughness of each sample
#endif

layout(location = 0) out vec4 out_radiance;
layout(location = 1) out float out_coverage;

// Distance past a pixel's corner [px] at which the nearest sample lies beyond any edge that cuts off the corner.
const float NEXT_PX = 0.3;

// Samples belong to one surface if their normal codes differ by fewer steps than this (5 to 10 degrees).
const int SAME_NORMAL = int(0.085 * CODE_SCALE);
// Normal codes of a flat face differ by at most this, the rounding of the interpolation.
const int FLAT_STEPS = 2;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    ivec2 origin = pixel_index(pixel);
    // textureLod, as llvmpipe needs 126 instructions for texelFetch but few for a lookup without filter
    vec2 place = (vec2(origin) + 0.5) * u_texel;
#define AT(i, j) (place + vec2(i, j) * u_texel)
#define FETCH(k, i, j) uvec2 words##k = textureLod(t_surface, AT(i, j), 0.0).xy; uint g##k = surface_of(words##k);
    FOR_EACH_SAMPLE(FETCH)
    int covered = 0;
    uint differs = 0u;
    vec4 edge = textureLod(t_slope, (gl_FragCoord.xy - u_window.xy) * u_slope_texel, 0.0);
#ifdef EXACT_AREAS
    vec3 steep, even;
    unpack_two(edge.xyz, steep, even);
    vec2 slope = edge.w < 1.5 ? steep.xy : vec2(0.0);
    const float share_of_own = 1.0;
#else
    LoneEdge lone = lone_edge(edge.x);
    vec2 slope = lone.slope;
    // a sliver that holds no sample takes its surface from the nearest sample of the pixel next to it
    ivec2 next = sample_near(lone.towards * (0.5 * (abs(lone.towards.x) + abs(lone.towards.y)) + NEXT_PX));
    FETCH(_next, next.x, next.y)
    float next_weight = float(SAMPLES) * lone.beyond, share_of_own = 1.0 - lone.beyond;
    if (lone.beyond == 0.0) g_next = 0u;
#endif
    float weight_covered = 0.0;
#define WEIGHT(i, j) (share_of_own + dot(slope, sample_offset(ivec2(i, j))))
#define COUNT_AS(k, w) if (g##k != 0u) { ++covered; weight_covered += w; }
#define COUNT(k, i, j) COUNT_AS(k, WEIGHT(i, j)) differs |= g##k ^ g0;
    FOR_EACH_SAMPLE(COUNT)
#ifndef EXACT_AREAS
    COUNT_AS(_next, next_weight)
    if (lone.beyond > 0.0) differs |= g_next ^ g0;
#endif
    if (covered == 0) discard;
    weight_covered = clamp(weight_covered, 0.0, float(SAMPLES));
#ifdef EXACT_AREAS
    // Several edges: scale the weights of each material to its exact area. The difference is taken from the materials
    // that have no edge here (the surface behind the parts), or from all of them if there is none.
    vec4 missing = vec4(even.xy, steep.z, even.z), owned = vec4(0.0);
#define MATERIAL_CLASS(g) vec4(equal(ivec4(int(material_of(g)) & 3), ivec4(0, 1, 2, 3)))
#define OWNED(k, i, j) owned += MATERIAL_CLASS(g##k);
    FOR_EACH_SAMPLE(OWNED)
    missing *= step(0.5, owned);
    vec4 under = owned * vec4(equal(missing, vec4(0.0)));
    under = dot(under, vec4(1.0)) > 0.5 ? under : owned;
    missing -= under * (dot(missing, vec4(1.0)) / max(dot(under, vec4(1.0)), 1.0));
    // not at a silhouette against the background, which hidden edges could move
    missing *= edge.w > 1.5 && covered == SAMPLES ? 1.0 : 0.0;
    vec4 scale = max(1.0 + missing / max(owned, vec4(1.0)), 0.0);
#define SPREAD(d) spread = max(spread, max(d.x, d.y))
#else
#define SPREAD(d)
#endif
#ifdef TEXTURED
    differs = 1u; // texels may differ within a surface
#define ADD_TEXEL(i, j) texel += textureLod(t_texel, AT(i, j), 0.0); \
            detail += textureLod(t_detail, AT(i, j), 0.0);
#else
#define ADD_TEXEL(i, j)
#endif
#ifdef EXACT_AREAS
    // A pixel with one evenly lit surface is shaded once. Otherwise each quarter of the pixel is shaded separately, as
    // sunlight and sky visibility differ between them.
    bool quarters = differs != 0u || edge.w > 0.5;
    // Parallel surfaces at different depths are different surfaces, too.
#define CAMERA_Z(k, i, j) float z##k = camera_z(textureLod(t_depth, AT(i, j), 0.0).x);
    FOR_EACH_SAMPLE(CAMERA_Z)
    vec3 ray = camera_ray(vec2(pixel));
#define ALONG(k, i, j) (z##k * (ray_n + dot(across, sample_offset(ivec2(i, j)))))
#define IN_PLANE(k, i, j) && abs(ALONG(k, i, j) - along) < thin_m
#define LEAD_PLANE(k, i, j) if (leads == k) { z_lead = z##k; along = ALONG(k, i, j); }
#define QUARTER(i, j) (int(sample_offset(ivec2(i, j)).x > 0.0) + 2 * int(sample_offset(ivec2(i, j)).y > 0.0))
#endif
    color sum = color(0.0);
    int left = covered;
    float weight_left = weight_covered;
    int group = 0;
    // do-while, as llvmpipe runs the body of a while loop once more after its test fails
    do {
        // the remaining sample nearest to the pixel's centre leads the group
        uint leader = 0u;
        uint chart = 0u;
        ivec2 at = ivec2(0);
#define LEAD(k, i, j) if (leader == 0u && g##k != 0u) { leader = g##k; chart = words##k.y; at = ivec2(i, j); }
#ifdef EXACT_AREAS
        int quarter = 0, leads = 0;
#define LEAD_QUARTER(k, i, j) if (leader == 0u && g##k != 0u) \
            { leader = g##k; chart = words##k.y; at = ivec2(i, j); quarter = QUARTER(i, j); leads = k; }
        FOR_EACH_SAMPLE_OF_QUARTERS(LEAD_QUARTER)
        // `along`: distance of the leader's plane from the camera [m]; thin_m: tolerance for rounded normals and depths
        vec3 facing = decode_normal(vec2(normal_code(leader)));
        vec2 across = ray_slope(vec2(pixel), facing);
        float ray_n = dot(facing, ray), along = 0.0, z_lead = 0.0;
        FOR_EACH_SAMPLE(LEAD_PLANE)
        // positive even where a smooth normal faces away from the camera, so that the leader is in its own group
        float thin_m = z_lead / ray_focal_px(vec2(pixel)) * (0.2 + 0.1 / max(-ray_n, 0.05));
#define GATHERS(k, i, j) && QUARTER(i, j) == quarter IN_PLANE(k, i, j)
        bool apart = quarters;
#else
        FOR_EACH_SAMPLE(LEAD)
        LEAD(_next, next.x, next.y)
#define GATHERS(k, i, j)
        bool apart = differs != 0u;
#endif
        uint material = material_of(leader);
        ivec2 code = normal_code(leader);
        vec2 mean_code = vec2(code);
#ifdef TEXTURED
        vec4 texel = vec4(0.0);
        vec4 detail = vec4(0.0);
#endif
        int members = left, spread = 0;
        float weight = weight_left;
        if (apart) {
            ivec2 total = ivec2(0);
            members = 0;
            weight = 0.0;
#define GATHER_AS(k, i, j, w) { ivec2 c = normal_code(g##k); ivec2 d = abs(c - code); \
            if (material_of(g##k) == material && max(d.x, d.y) < SAME_NORMAL GATHERS(k, i, j)) \
            { ++members; weight += w; total += c; SPREAD(d); g##k = 0u; ADD_TEXEL(i, j) } }
#define GATHER(k, i, j) GATHER_AS(k, i, j, WEIGHT(i, j))
            FOR_EACH_SAMPLE(GATHER)
#ifndef EXACT_AREAS
            GATHER_AS(_next, next.x, next.y, next_weight)
#endif
            mean_code = vec2(total) / float(members);
        }
#ifdef EXACT_AREAS
        weight *= dot(scale, MATERIAL_CLASS(leader));
        float bent = spread > FLAT_STEPS ? 1.0 : 0.0;
#else
        const float bent = 1.0;
#endif
        weight = clamp(weight, 0.0, weight_left);
        float z = camera_z(textureLod(t_depth, AT(at.x, at.y), 0.0).x);
        vec3 p_m = camera_ray(vec2(pixel) + sample_offset(at)) * z;
        float share = min(float(members) / float(SAMPLES), 1.0); // continue with the next sample
        vec4 base = u_material_color[material], surface = u_material_surface[material];
        vec3 geometric = decode_normal(mean_code), n = geometric;
#ifdef TEXTURED
        base = texel / float(members);
        surface.x = detail.w / float(members);
        n = unit_or(detail.xyz, geometric);
#endif
        float lit = sun_visibility(p_m, geometric, share, bent);
#ifdef EXACT_AREAS
        if (!quarters && abs(lit - 0.5) < 0.498) { // partly in shadow: shade again, by quarters
            quarters = true;
            members = 0;
            weight = 0.0;
        }
#endif
        left -= members;
        // the last group takes the remaining weight, so that no light is lost
        if (group == MAX_SURFACES - 1 || left == 0) weight = weight_left;
        weight_left -= weight;
        sum += shade(base, surface, GRAIN(material), geometric, n, p_m, chart_of(chart), lit) * weight;
        ++group;
    } while (group < MAX_SURFACES && left > 0);
    out_radiance = OUT(sum / float(SAMPLES));
    out_coverage = weight_covered / float(SAMPLES);
}
