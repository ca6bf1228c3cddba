"""Shader programs: GLSL from the ``shaders`` package, with includes expanded, and blocks and textures bound by name."""

from __future__ import annotations

import re
from functools import cache
from importlib import resources
from typing import TYPE_CHECKING

import moderngl

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from flyaround.simulator.render.gl.uniform_block import UniformBlock

GLSL_VERSION = "#version 410 core"
FULL_SCREEN = "common/full_screen.vert"
RAYS_UNIT = 15
"""Texture unit of the lens rays. The samplers of the passes use units from 0 on."""
_WORD = re.compile(r"\w+")
_INCLUDE = re.compile(r'^\s*#include\s+"([^"]+)"\s*$', re.MULTILINE)


def read_source(path: str, expanded: set[str] | None = None) -> str:
    """Return the text of ``shaders/<path>`` with every ``#include "other/file.glsl"`` expanded once.

    Parameters
    ----------
    path : str
        Path inside the ``shaders`` package, with forward slashes.
    expanded : set of str, optional
        Files already expanded; each is included only once.
    """
    expanded = set() if expanded is None else expanded
    expanded.add(path)
    text = _text(path)

    def expand(match: re.Match[str]) -> str:
        name = match.group(1)
        return "" if name in expanded else read_source(name, expanded)

    return _INCLUDE.sub(expand, text)


@cache
def _text(path: str) -> str:
    """Return one file with continued lines joined: GLSL before 4.20 has no continuation."""
    return (
        resources.files("flyaround.shaders").joinpath(path).read_text(encoding="utf-8").replace("\\\n", " ")
    )


def _head(source: str, defines: Mapping[str, object]) -> str:
    """Return a shader's version directive, and those defines that the source or other defines mention.

    Without unused defines, more shaders have equal text, and the driver compiles those once.
    """
    mentioned = set(_WORD.findall(source + " ".join(str(value) for value in defines.values())))
    used_defines = (f"#define {k} {v}" for k, v in defines.items() if k.split("(")[0] in mentioned)
    return "\n".join([GLSL_VERSION, *used_defines]) + "\n"


class ProgramLibrary:
    """Compiles programs for one context and one set of uniform blocks.

    With ``lens`` set, programs are compiled for a distorting lens: they look up rays in a texture, and distort the
    target's vertices.

    Parameters
    ----------
    context : Context
        OpenGL context.
    blocks : iterable of UniformBlock
        Uniform blocks; each is declared in every shader and bound if used.
    constants : mapping, optional
        Preprocessor constants that every shader may use.
    """

    def __init__(
        self,
        context: moderngl.Context,
        blocks: Iterable[UniformBlock],
        constants: Mapping[str, object] | None = None,
    ) -> None:
        self._context = context
        self._blocks = tuple(blocks)
        self._constants = dict(constants or {})
        self._by_source: dict[tuple[object, ...], Program] = {}
        self._by_arguments: dict[tuple[object, ...], Program] = {}  # the same programs
        self.lens = False

    def __len__(self) -> int:
        """Return the number of compiled programs."""
        return len(self._by_source)

    def get(
        self,
        vertex: str,
        fragment: str | None,
        defines: Mapping[str, object],
        samplers: tuple[str, ...] = (),
        *,
        varyings: tuple[str, ...] = (),
    ) -> Program:
        """Return the program of two shader files, compiled at first use.

        Parameters
        ----------
        vertex : str
            Vertex shader, a path below ``shaders``.
        fragment : str or None
            ``None`` for a program that only captures its vertex shader's outputs (transform feedback).
        defines : mapping
            Preprocessor constants. The value ``""`` defines the bare name.
        samplers : tuple of str, optional
            Names of the samplers; sampler ``k`` reads texture unit ``k``.
        varyings : tuple of str, optional
            Vertex shader outputs to capture.
        """
        # passes call this in every frame, so equal arguments are looked up without sorting and formatting them
        values = tuple(defines.values())  # 1 and 1.0 are equal, but print differently
        arguments = (vertex, fragment, tuple(defines), values, tuple(map(type, values)), samplers, self.lens)
        if arguments in self._by_arguments:
            return self._by_arguments[arguments]
        key = (vertex, fragment, tuple(sorted((k, str(v)) for k, v in defines.items())), samplers, self.lens)
        if key not in self._by_source:
            all_defines = {"LENS": int(self.lens), **self._constants, **defines}
            blocks = "".join(block.glsl for block in self._blocks)

            def full_source(text: str) -> str:
                return _head(text, all_defines) + blocks + text

            source = full_source(read_source(vertex))
            self._by_source[key] = Program(
                self._context.program(
                    vertex_shader=source,
                    fragment_shader=None if fragment is None else full_source(read_source(fragment)),
                    varyings=varyings,
                ),
                samplers,
            )
            for block in self._blocks:
                block.attach(self._by_source[key].gl)
        self._by_arguments[arguments] = self._by_source[key]
        return self._by_source[key]


class Program:
    """A linked program; setting a uniform that the compiler removed does nothing."""

    def __init__(self, gl: moderngl.Program, samplers: tuple[str, ...]) -> None:
        self.gl = gl
        self._units = {name: unit for unit, name in enumerate(samplers)}
        self._values: dict[str, object] = {}
        for name, unit in self._units.items():
            self.set(name, unit)
        self.set("t_rays", RAYS_UNIT)

    def set(self, name: str, value: object) -> None:
        """Set a plain uniform by name: a number, or a tuple of numbers."""
        if self._values.get(name) == value:
            return
        member = self.gl.get(name, None)
        if isinstance(member, moderngl.Uniform):
            member.value = value
        self._values[name] = value

    def reads(self, sampler: str) -> bool:
        """Return True if the program was made with a sampler of this name."""
        return sampler in self._units

    def bind_textures(self, **textures: moderngl.Texture | moderngl.Texture3D) -> None:
        """Bind each named texture to the unit of its sampler.

        Raises
        ------
        KeyError
            If a name is not one of the program's samplers.
        """
        for name, texture in textures.items():
            texture.use(self._units[name])
