"""Uniform blocks generated from one field list, so that the CPU's and the GPU's layout cannot disagree."""

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
    """One member of a block: GLSL type, name, length of the array (0: no array; vec4 and mat4 only)."""

    glsl_type: str
    name: str
    count: int = 0


class UniformBlock:
    """A std140 block: its GLSL text, its numpy record and its buffer.

    Parameters
    ----------
    name : block name in GLSL.
    binding : binding point, one per block of the renderer.
    fields : members in order. A ``mat4`` is given as the usual (4, 4) matrix acting on columns.
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
        self._written: Mapping[str, ArrayLike] | None = None

    @property
    def glsl(self) -> str:
        """Declaration to paste above ``main``."""
        members = "".join(
            f"    {f.glsl_type} {f.name}{f'[{f.count}]' if f.count else ''};\n" for f in self.fields
        )
        return f"layout(std140) uniform {self.name} {{\n{members}}};\n"

    def write(self, values: Mapping[str, ArrayLike]) -> None:
        """Fill and upload the whole block and bind it; every member must be given.

        A mapping that cannot be changed and was the last one written is not uploaded again.

        Raises
        ------
        KeyError
            If a member is missing: a stale value from the last frame would be a state leak.
        """
        if values is self._written:
            self.bind()
            return
        self._written = values if isinstance(values, MappingProxyType) else None
        for name, member in self._members.items():
            member[...] = values[name]
        if len(values) != len(self._members):
            raise KeyError(f"block {self.name} has no member {sorted(values.keys() - self._members.keys())}")
        self._buffer.write(self._bytes)
        self.bind()

    def bind(self) -> None:
        """Make the block current at its binding point."""
        self._buffer.bind_to_uniform_block(self.binding)

    def attach(self, program: moderngl.Program) -> None:
        """Connect a program that uses this block; one that does not is left alone."""
        block = program.get(self.name, None)
        if isinstance(block, moderngl.UniformBlock):
            block.binding = self.binding


def vec4_of_bands(bands: FloatArray) -> list[float]:
    """One or three bands as the vec4 of a uniform block."""
    return [*(float(v) for v in bands), *([0.0] * (4 - len(bands)))]
