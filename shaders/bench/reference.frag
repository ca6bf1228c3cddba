// Reference workload of the benchmark: 64 multiply-adds, 8 exponentials, four trilinear fetches. No physical unit.
uniform sampler2D map;
uniform vec2 size_px;
layout(location = 0) out vec4 color;

void main() {
    vec2 uv = gl_FragCoord.xy / size_px;
    vec4 a = vec4(uv, uv.yx);
    vec4 b = a * 0.5 + 0.25;
    for (int i = 0; i < 16; i++) a = a * b + b;  // 16 x 4 multiply-adds
    vec4 e = exp(-a) + exp(-b);                  // 8 exponentials
    vec3 t = vec3(0.0);
    for (int k = 0; k < 4; k++) t += texture(map, uv * (0.9 + 0.1 * float(k)) + 0.13 * float(k)).rgb;
    color = vec4(e.rgb + t, e.a);
}
