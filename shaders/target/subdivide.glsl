// How finely an edge must be cut so that straight pieces follow the bent image.
#include "target/lens.glsl"
const float TOLERANCE_PX = 0.01; // of a piece's middle; an inner point of a triangle adds up three edges' errors

// Pieces of the edge between two camera points, the same whichever triangle asks.
float edge_pieces(vec3 p, vec3 q) {
    bool swap = p.x != q.x ? p.x > q.x : p.y != q.y ? p.y > q.y : p.z > q.z;
    vec3 a = swap ? q : p, b = swap ? p : q;
    vec3 ha = lens_homogeneous(a), hb = lens_homogeneous(b);
    if (a.z <= 0.0 || b.z <= 0.0) return 64.0;
    float error = 0.0;
    for (int k = 1; k < 4; ++k) {
        float t = 0.25 * float(k);
        vec3 straight = mix(ha, hb, t), bent = lens_homogeneous(mix(a, b, t));
        error = max(error, length(straight.xy / straight.z - bent.xy / bent.z));
    }
    // the error of a piece falls with the square of its length; the quarters see at least 3/4 of the middle's
    return clamp(ceil(sqrt(error * u_lens_limits.z / TOLERANCE_PX)), 1.0, 64.0);
}
