"""Uniforms that a vertex shader hands on to its fragments as flat inputs.

A software driver reads a uniform once for each lane of a vector, some 24 instructions (llvmpipe of Mesa 22.3:
offsets are bounded, taken apart and gathered even where they are constant), and a flat input in one. On a GPU both are
free. What a fragment shader computes is the same to the last bit. Worth 19 ms of 800, and a seventh of the Moon's pass.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    import moderngl

    from flyaround.simulator.render.gl.uniform_block import Field

LEAST_SLOTS = 15
"""Vectors of four that every OpenGL 4.1 hands on (MAX_VARYING_VECTORS)."""
SPARE_SLOTS = 4
"""Of those that the driver has, left to what shaders hand on by themselves."""
_PLAIN = re.compile(r"^uniform (float|vec[234]|mat[34]|u?int|[iu]vec[234]) ([\w, ]+);.*$", re.MULTILINE)
_WORD = re.compile(r"\w+")
_MAIN = re.compile(r"^void main\(\)", re.MULTILINE)


def rewriter(context: moderngl.Context) -> Callable[[str, str, Sequence[Field]], tuple[str, str]]:
    """`flat_varyings` with the slots that a driver has, for `ProgramLibrary`."""
    slots = int(context.info.get("GL_MAX_VARYING_VECTORS", LEAST_SLOTS)) - SPARE_SLOTS
    return lambda vertex, fragment, fields: flat_varyings(vertex, fragment, fields, slots)


def flat_varyings(vertex: str, fragment: str, fields: Iterable[Field], slots: int) -> tuple[str, str]:
    """Both shaders' texts, the fragment's uniforms made flat inputs that the vertex shader fills.

    Members of blocks come first, in the order of ``fields``, then plain uniforms. Those that find no slot left stay
    uniforms, as do arrays where an index is not a number.

    Parameters
    ----------
    vertex, fragment : includes expanded, without the heads that declare the blocks. fields : of all blocks.
    slots : vectors of four to be used, at most. A matrix takes one a column, all else one.
    """
    values: list[tuple[str, str, str]] = []  # type, expression, name as an input
    words = set(_WORD.findall(fragment))
    for field in fields:
        name = field.name
        if name not in words:
            continue
        if not field.count:
            values.append((field.glsl_type, name, f"v_{name}"))
            continue
        indices = re.findall(rf"\b{name}\b(?:\[(\d+)\])?", fragment)
        if all(indices):
            numbers = sorted({int(k) for k in indices})
            values += [(field.glsl_type, f"{name}[{k}]", f"v_{name}_{k}") for k in numbers]
    plain = [
        (kind, name.strip())
        for kind, names in _PLAIN.findall(fragment)
        for name in names.split(",")
        if "[" not in name
    ]
    values += [(kind, name, f"v_{name}") for kind, name in plain]
    kept = []
    for kind, expression, name in values:
        slots -= int(kind[3]) if kind.startswith("mat") else 1
        if slots < 0:
            break
        kept.append((kind, expression, name))
    for _, expression, name in kept:
        end = "" if expression.endswith("]") else r"\b"
        text = re.escape(expression)
        # whole words; a pattern that begins with a text is found at once, one that begins with \b letter by letter
        fragment = re.sub(rf"{text}(?<!\w{text}){end}", name, fragment)
    # a declaration of plain uniforms is by now one of their inputs' names
    taken = {name: (kind, expression) for kind, expression, name in kept}
    fragment = _PLAIN.sub(lambda found: _declared(found, taken), fragment)
    known = {name.strip() for _, names in _PLAIN.findall(vertex) for name in names.split(",")}
    plain_names = {name for _, name in plain}
    declared = "".join(
        f"uniform {kind} {expression};\n"
        for kind, expression, _ in kept
        if expression in plain_names and expression not in known
    )
    inputs = "".join(
        f"flat in {kind} {name};\n" for kind, expression, name in kept if expression not in plain_names
    )
    outputs = "".join(f"flat out {kind} {name};\n" for kind, _, name in kept)
    fill = "".join(f"    {name} = {expression};\n" for _, expression, name in kept)
    vertex = _MAIN.sub("void own_main()", vertex)
    return (
        f"{vertex}\n{declared}{outputs}void main() {{\n    own_main();\n{fill}}}\n",
        inputs + fragment,
    )


def _declared(found: re.Match[str], taken: dict[str, tuple[str, str]]) -> str:
    """A fragment's declaration of plain uniforms, as inputs those that are ``taken``."""
    kind, names = found.group(1), [name.strip() for name in found.group(2).split(",")]
    return " ".join(f"{'flat in' if name in taken else 'uniform'} {kind} {name};" for name in names)
