"""The bench's reference pass: a fixed amount of shading, so that figures of different machines compare."""

from __future__ import annotations

import time
from statistics import median
from typing import TYPE_CHECKING

import moderngl
import numpy as np

from simulator.render.context import create_context
from simulator.render.programs import FULL_SCREEN, ProgramLibrary

if TYPE_CHECKING:
    from collections.abc import Iterable

TEXTURE_SIZE = (4096, 2048)
REPEATS = 11
WARM_UP = 3


def reference_pass_ms(
    sizes: Iterable[tuple[int, int]], *, device_index: int | None = None
) -> dict[tuple[int, int], float]:
    """Median time of the reference pass at each size [ms], in a context of its own.

    One full-screen pass to RGBA16F of 64 multiply-adds, 8 exponentials and four trilinear fetches from a
    4096 x 2048 RGB texture per pixel.

    Raises
    ------
    UserError
        If there is no OpenGL 4.1.
    """
    context = create_context(device_index)
    noise = np.random.Generator(np.random.SFC64(0)).integers(0, 256, (*TEXTURE_SIZE[::-1], 3), np.uint8)
    texture = context.texture(TEXTURE_SIZE, 3, noise.tobytes(), alignment=1)
    texture.build_mipmaps()
    texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
    program = ProgramLibrary(context, ()).get(FULL_SCREEN, "bench/reference.frag", {}, ("map",))
    program.bind_textures(map=texture)
    triangle = context.vertex_array(program.gl, [])
    times: dict[tuple[int, int], float] = {}
    for size in sizes:
        target = context.framebuffer([context.texture(size, 4, dtype="f2")])
        target.use()
        program.set("size_px", size)
        laps = []
        for _ in range(REPEATS + WARM_UP):
            start = time.perf_counter()
            triangle.render(moderngl.TRIANGLES, vertices=3)
            context.finish()
            laps.append((time.perf_counter() - start) * 1e3)
        times[size] = median(laps[WARM_UP:])
    context.release()
    return times
