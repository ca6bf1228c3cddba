"""Reference pass of the benchmark: a fixed amount of shading, by which results of machines are compared."""

from __future__ import annotations

import time
from typing import Self

import moderngl
import numpy as np

from flyaround.simulator.render.gl.context import create_context
from flyaround.simulator.render.gl.programs import FULL_SCREEN, ProgramLibrary

# Width and height of the texture [px]: with the Earth's maps of 8064 x 4032 it has in common that no cache holds it.
TEXTURE_SIZE = (4096, 2048)


class ReferencePass:
    """A full-screen pass with 64 multiply-adds, 8 exponentials and four trilinear fetches per pixel.

    It samples a 4096 x 2048 RGB texture and draws to RGBA16F, in a context of its own.

    Parameters
    ----------
    device_index : int, optional
        Index of the EGL device; None for the default one.

    Raises
    ------
    UserError
        If there is no OpenGL 4.1.
    """

    def __init__(self, *, device_index: int | None = None) -> None:
        self._context = context = create_context(device_index)
        noise = np.random.Generator(np.random.SFC64(0)).integers(0, 256, (*TEXTURE_SIZE[::-1], 3), np.uint8)
        texture = context.texture(TEXTURE_SIZE, 3, noise.tobytes(), alignment=1)
        texture.build_mipmaps()
        texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        self._program = ProgramLibrary(context, ()).get(FULL_SCREEN, "bench/reference.frag", {}, ("map",))
        self._program.bind_textures(map=texture)
        self._triangle = context.vertex_array(self._program.gl, [])
        self._targets: dict[tuple[int, int], moderngl.Framebuffer] = {}

    def laps_ms(self, size: tuple[int, int], count: int) -> list[float]:
        """Time ``count`` passes at a size (width, height) [px], after a warm-up pass.

        The context stays current.

        Returns
        -------
        list of float
            Time of each pass [ms], until the driver has finished it; the warm-up is left out.
        """
        context = self._context
        context.__enter__()  # type: ignore[no-untyped-call]
        if size not in self._targets:
            self._targets[size] = context.framebuffer([context.texture(size, 4, dtype="f2")])
        self._targets[size].use()
        self._program.set("size_px", size)
        laps = []
        for _ in range(count + 1):
            start = time.perf_counter()
            self._triangle.render(moderngl.TRIANGLES, vertices=3)
            context.finish()
            laps.append((time.perf_counter() - start) * 1e3)
        return laps[1:]

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._context.__enter__()  # type: ignore[no-untyped-call]
        self._context.release()
