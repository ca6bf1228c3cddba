// Creased insulation blankets: slopes of the facets at up to three scales, tape along the seams; mottle and wear.
uniform sampler2D t_creases; // slopes along u and v, their deviation within a texel, mottle; simulator/baking/creases.py

// Planar mapping: a surface point projected along the target axis nearest to the normal.
struct PlanarPlace {
    vec2 uv;         // along the two other axes [m], shifted per side
    float width_m;   // size of a pixel on the surface
    float level;     // log2(width_m)
    int across;      // the projection axis, 0..2
};

// n: the face's normal; v: unit vector to the camera; all in the camera frame.
PlanarPlace planar_place(vec3 n, vec3 v, vec3 p_m) {
    mat3 R = mat3(u_camera_from_target);
    vec3 x = (p_m - u_camera_from_target[3].xyz) * R, a = n * R; // R transposed times: into the target frame
    vec3 size = abs(a) * vec3(1.0, 1.04, 0.96); // unequal: no flicker between two axes at 45 degrees
    int across = size.x > max(size.y, size.z) ? 0 : size.y > size.z ? 1 : 2;
    vec2 uv = across == 0 ? x.yz : across == 1 ? x.zx : x.xy;
    // an offset per side, so that opposite faces differ
    uv += 0.31 * sign(across == 0 ? a.x : across == 1 ? a.y : a.z) + float(across) * vec2(0.17, 0.41);
    float width_m = p_m.z / max(u_intrinsics.x, u_intrinsics.y) * inversesqrt(max(dot(n, v), 0.05));
    return PlanarPlace(uv, width_m, log2(width_m), across);
}

// Slopes, their deviation, and mottle from the texture at a width of tile_m. turn: cosine and sine of its rotation.
vec4 crease_tile(PlanarPlace place, float tile_m, vec2 turn) {
    mat2 T = mat2(turn.x, turn.y, -turn.y, turn.x);
    vec4 s = textureLod(t_creases, T * place.uv / tile_m, place.level + log2(CREASE_SIZE / tile_m));
    return vec4((s.xy * 2.0 - 1.0) * CREASE_SLOPE * T, s.z * CREASE_DEVIATION, s.w); // T transposed times
}

// Fraction of a pixel covered by strips along the lines of a grid. pitch: of the grid [m]; wide: half a strip's width [m].
float strips(PlanarPlace place, vec2 pitch, float wide) {
    vec2 off = (0.5 - abs(fract(place.uv / pitch) - 0.5)) * pitch;
    vec2 share = clamp((wide - off) / place.width_m + 0.5, 0.0, min(1.0, 2.0 * wide / place.width_m));
    return max(share.x, share.y);
}

// Radiance of the Earth in direction d relative to its mean [1], for cloud fields in smooth mirrors. blur: width [rad].
float earth_mottle(vec3 d, float blur) {
    vec3 down = u_nadir_direction.xyz, across = unit_or(cross(down, u_sun_direction.xyz), any_across(down));
    vec2 at = vec2(dot(d, across), dot(d, cross(down, across))) * CLOUDS_TILES;
    float level = textureLod(t_creases, at, log2(blur * (CREASE_SIZE * CLOUDS_TILES))).w;
    return max(1.0 + CLOUDS_CONTRAST * (level - 0.5), 0.2);
}

// Normal of a blanket at p_m (both camera frame). The slope variance of facets smaller than a pixel is added to the
// roughness (Olano & Baker 2010, LEAN mapping), so that distant blankets do not flicker.
// tape: fraction of the pixel covered by tape, which lies flatter.
vec3 crinkled(vec3 n, vec3 v, vec3 p_m, float amplitude, inout float roughness, out float tape) {
    PlanarPlace place = planar_place(n, v, p_m);
    vec4 coarse = crease_tile(place, COARSE_M, vec2(0.8253, 0.5646));
    float lost = coarse.z * coarse.z;
    vec2 slope = coarse.xy;
#if CREASE_SCALES > 1
    vec4 fine = crease_tile(place, FINE_M, vec2(0.2675, 0.9636));
    slope += FINE_SHARE * fine.xy;
    lost += FINE_SHARE * FINE_SHARE * fine.z * fine.z;
#if CREASE_SCALES > 2
    vec4 finest = crease_tile(place, FINEST_M, vec2(0.7071, -0.7071));
    slope += FINEST_SHARE * finest.xy;
    lost += FINEST_SHARE * FINEST_SHARE * finest.z * finest.z;
#endif
    tape = strips(place, vec2(SEAM_U_M, SEAM_V_M), TAPE_M);
    float flat_share = 1.0 - 0.6 * tape;
    slope *= flat_share;
    lost *= flat_share * flat_share;
#else
    lost += FINE_SHARE * FINE_SHARE * CREASE_VARIANCE;
    tape = 0.0;
#endif
    slope *= amplitude;
    // alpha^2 is twice the variance of slopes along an axis
    float alpha2 = roughness * roughness * roughness * roughness + lost * amplitude * amplitude;
    roughness = sqrt(sqrt(min(alpha2, 1.0)));
    vec3 tilt = place.across == 0 ? vec3(0.0, slope) : place.across == 1 ? vec3(slope.y, 0.0, slope.x) : vec3(slope, 0.0);
    return unit_or(n - mat3(u_camera_from_target) * tilt, n);
}

// Reflectance of a matt surface relative to its mean [1]: mottle from weathering and handling, and dark joints.
float mottle(vec3 n, vec3 v, vec3 p_m, float amplitude) {
    PlanarPlace place = planar_place(n, v, p_m);
    float level = crease_tile(place, MOTTLE_M, vec2(1.0, 0.0)).w - 0.5;
    return 1.0 + amplitude * (2.0 * level - JOINT_DARKER * strips(place, vec2(JOINT_M), JOINT_WIDE_M));
}

#ifdef WORN
// Fraction of a pixel inside a disc. off: distance from the disc's centre [m]; width_m: of the pixel.
float disc_share(float off, float radius, float width_m) {
    float wide = min(2.0 * radius / width_m, 1.0);
    return clamp((radius - off) / width_m + 0.5, 0.0, 1.0) * wide * wide;
}

// Wear in flight: mottle of reflectance and gloss, tape around rods, fasteners beside the joints of sheets.
// code: integer part: kind of surface; fraction: amplitude of the mottle (simulator/render/craft/finishes.py).
void wear(vec3 n, vec3 v, vec3 p_m, float code, inout vec4 base, inout float roughness) {
    PlanarPlace place = planar_place(n, v, p_m);
    float amplitude = fract(code), level = 2.0 * crease_tile(place, MOTTLE_M, vec2(0.7648, 0.6442)).w - 1.0;
    float change = 1.0 + amplitude * level;
    roughness *= clamp(1.0 + 0.5 * level, 0.7, 1.3);
    if (code > 3.0) {
        change -= amplitude * JOINT_DARKER * strips(place, vec2(JOINT_M), JOINT_WIDE_M);
        vec2 joint = abs(abs((fract(place.uv / JOINT_M + 0.5) - 0.5) * JOINT_M) - FASTENER_ASIDE_M);
        vec2 along = (fract(place.uv.yx / FASTENER_PITCH_M) - 0.5) * FASTENER_PITCH_M;
        float off = min(length(vec2(joint.x, along.x)), length(vec2(joint.y, along.y)));
        float head = disc_share(off, FASTENER_M, place.width_m), rim = disc_share(off, 1.6 * FASTENER_M, place.width_m);
        base.xyz = mix(base.xyz * (1.0 - 0.4 * (rim - head)), vec3(FASTENER_HEAD), 0.7 * head);
    } else if (code > 2.0) {
        mat3 R = mat3(u_camera_from_target);
        vec2 out_m = ((p_m - u_camera_from_target[3].xyz) * R).xy; // rods point away from the target's z axis
        float off = abs(fract(length(out_m) / WRAP_PITCH_M) - 0.5) * WRAP_PITCH_M;
        change -= WRAP_DARKER * clamp((WRAP_M - off) / place.width_m + 0.5, 0.0, 1.0);
    }
    base.xyz *= change;
}
#endif
