"""Uniform blocks generated from one field list, so that CPU and GPU agree on the layout."""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING

import moderngl
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike

    from flyaround.simulator.runtime.arrays import FloatArray

# GLSL type: (base alignment, size in bytes, numpy shape of float32), OpenGL 4.1 specification, 2.11.4 (std140)
_STD140: dict[str, tuple[int, int, tuple[int, ...]]] = {
    "float": (4, 4, ()),
    "vec2": (8, 8, (2,)),
    "vec3": (16, 12, (3,)),
    "vec4": (16, 16, (4,)),
    "mat4": (16, 64, (4, 4)),
}


@dataclass(frozen=True)
class Field:
    """One member of a block: GLSL type, name, array length (0: no array; vec4 and mat4 only)."""

    glsl_type: str
    name: str
    count: int = 0


class UniformBlock:
    """A std140 block: GLSL text, NumPy record and buffer.

    Parameters
    ----------
    context : Context
        OpenGL context.
    name : str
        Block name in GLSL.
    binding : int
        Binding point, one per block of the renderer.
    fields : tuple of Field
        Members in order. A ``mat4`` is set by a (4, 4) matrix that acts on columns.

    Raises
    ------
    ValueError
        If an array is of a type that std140 pads.
    """

    def __init__(self, context: moderngl.Context, name: str, binding: int, fields: tuple[Field, ...]) -> None:
        offset, names, formats, offsets = 0, [], [], []
        for member in fields:
            alignment, size, shape = _STD140[member.glsl_type]
            if member.count and size % 16:
                raise ValueError(f"{name}.{member.name}: std140 pads arrays of {member.glsl_type}; use vec4")
            offset = -(-offset // alignment) * alignment
            names.append(member.name)
            offsets.append(offset)
            formats.append((np.float32, ((member.count,) if member.count else ()) + shape))
            offset += size * max(member.count, 1)
        itemsize = -(-offset // 16) * 16
        self.name, self.binding, self.fields = name, binding, fields
        self.dtype = np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": itemsize})
        self._bytes = np.zeros(itemsize, np.uint8)
        record = np.ndarray((), self.dtype, self._bytes)
        # GLSL stores matrices column by column
        self._members = {
            f.name: np.swapaxes(record[f.name], -1, -2) if f.glsl_type == "mat4" else record[f.name]
            for f in fields
        }
        self._buffer = context.buffer(reserve=itemsize)
        self._last_values: Mapping[str, ArrayLike] | None = None

    @property
    def glsl(self) -> str:
        """GLSL declaration of the block."""
        members = "".join(
            f"    {f.glsl_type} {f.name}{f'[{f.count}]' if f.count else ''};\n" for f in self.fields
        )
        return f"layout(std140) uniform {self.name} {{\n{members}}};\n"

    def write(self, values: Mapping[str, ArrayLike]) -> None:
        """Fill, upload and bind the whole block; every member must be given.

        If ``values`` is the same immutable mapping as in the last call, it is not uploaded again.

        Raises
        ------
        KeyError
            If a member is missing (its value would be the last frame's) or unknown.
        """
        if values is self._last_values:
            self.bind()
            return
        self._last_values = None
        for name, member in self._members.items():
            member[...] = values[name]
        if len(values) != len(self._members):
            raise KeyError(f"block {self.name} has no member {sorted(values.keys() - self._members.keys())}")
        self._buffer.write(self._bytes)
        self._last_values = values if isinstance(values, MappingProxyType) else None
        self.bind()

    def bind(self) -> None:
        """Make the block current at its binding point."""
        self._buffer.bind_to_uniform_block(self.binding)

    def attach(self, program: moderngl.Program) -> None:
        """Connect the block to a program, if the program uses it."""
        block = program.get(self.name, None)
        if isinstance(block, moderngl.UniformBlock):
            block.binding = self.binding


def vec4_of_bands(bands: FloatArray) -> list[float]:
    """Return values of one or three bands as a vec4, padded with zeros."""
    return [*(float(v) for v in bands), *([0.0] * (4 - len(bands)))]
