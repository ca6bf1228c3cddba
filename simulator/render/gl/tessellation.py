"""Tessellation stages that bend a mesh through the lens, generated for whatever a vertex shader hands on.

The rasteriser draws straight edges, a lens bent ones. Each triangle is cut, edge by edge, into pieces short enough
that a straight one is within a hundredth of a pixel of the bent, and only then goes through the lens. Triangles
small enough already pass as they are. Everything that the vertex shader hands on is interpolated in space.
"""

from __future__ import annotations

import re

_OUTPUT = re.compile(r"^\s*((?:flat|noperspective|smooth|centroid)\s+)?out\s+(\w+)\s+(\w+)\s*;", re.MULTILINE)
_WHOLE = {"int", "uint", "ivec2", "ivec3", "ivec4", "uvec2", "uvec3", "uvec4"}


def outputs(vertex_source: str) -> list[tuple[str, str, str]]:
    """(qualifier, type, name) of each output that a vertex shader's text declares outside of inactive branches."""
    return [((q or "").strip(), t, n) for q, t, n in _OUTPUT.findall(_active(vertex_source))]


def _active(source: str) -> str:
    """The text less the branches that the ``#define`` lines above leave out; ``#if`` of a plain name only."""
    defined = dict(re.findall(r"^#define (\w+)[ \t]*(.*)$", source, re.MULTILINE))
    kept: list[str] = []
    stack: list[bool] = []
    for line in source.splitlines():
        if match := re.match(r"\s*#\s*if(n?)def\s+(\w+)", line):
            stack.append((match[2] in defined) != (match[1] == "n"))
        elif match := re.match(r"\s*#\s*if\b\s*(\w*)\s*$", line):
            stack.append(defined.get(match[1], "0").strip() != "0")
        elif re.match(r"\s*#\s*if\b", line):
            stack.append(True)
        elif re.match(r"\s*#\s*else\b", line):
            stack[-1] = not stack[-1]
        elif re.match(r"\s*#\s*endif\b", line):
            stack.pop()
        elif all(stack):
            kept.append(line)
    return "\n".join(kept)


def control_stage(vertex_source: str, most_pieces: int) -> str:
    """GLSL of the stage that decides how finely a triangle is cut, an edge into ``most_pieces`` at most."""
    handed = outputs(vertex_source)
    declared = "".join(f"{q} in {t} {n}[];\nout {t} c_{n}[];\n" for q, t, n in handed)
    copied = "".join(f"    c_{n}[gl_InvocationID] = {n}[gl_InvocationID];\n" for _, _, n in handed)
    return f"""layout(vertices = 3) out;
{declared}
void main() {{
    gl_out[gl_InvocationID].gl_Position = gl_in[gl_InvocationID].gl_Position;
{copied}    if (gl_InvocationID == 0) {{
        vec3 a = gl_in[0].gl_Position.xyz, b = gl_in[1].gl_Position.xyz, c = gl_in[2].gl_Position.xyz;
        vec3 pieces = min(vec3(edge_pieces(b, c), edge_pieces(c, a), edge_pieces(a, b)), vec3({most_pieces}.0));
        gl_TessLevelOuter[0] = pieces.x;
        gl_TessLevelOuter[1] = pieces.y;
        gl_TessLevelOuter[2] = pieces.z;
        gl_TessLevelInner[0] = max(pieces.x, max(pieces.y, pieces.z));
    }}
}}
"""


def evaluation_stage(vertex_source: str) -> str:
    """GLSL of the stage that puts the pieces' corners through the lens."""
    handed = outputs(vertex_source)
    declared = "".join(f"in {t} c_{n}[];\n{q} out {t} {n};\n" for q, t, n in handed)
    blended = "".join(
        # GL takes a triangle's flat values from its last vertex
        f"    {n} = c_{n}[2];\n"
        if t in _WHOLE or q == "flat"
        else f"    {n} = w.x * c_{n}[0] + w.y * c_{n}[1] + w.z * c_{n}[2];\n"
        for q, t, n in handed
    )
    return f"""layout(triangles, equal_spacing, ccw) in;
{declared}
void main() {{
    vec3 w = gl_TessCoord;
    vec3 p = w.x * gl_in[0].gl_Position.xyz + w.y * gl_in[1].gl_Position.xyz + w.z * gl_in[2].gl_Position.xyz;
{blended}    gl_Position = u_lens_clip_from_image * vec4(lens_homogeneous(p), 1.0);
}}
"""
