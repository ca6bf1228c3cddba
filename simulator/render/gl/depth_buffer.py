"""Depth buffers that are rarely cleared: each use maps its depths to a range nearer than all earlier ones.

Scaling 32-bit float depths by powers of two is exact, so the image is the same in every range.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.simulator.render.gl.fences import draw_to
from flyaround.simulator.render.gl.library import gl_library

if TYPE_CHECKING:
    import moderngl

MAX_RANGES = 15
"""Number of depth ranges between two clears."""
# constants of OpenGL
_DEPTH_CLAMP = 0x864F
_TEXTURE_2D, _DEPTH_COMPONENT, _DEPTH_COMPONENT32F, _FLOAT = 0x0DE1, 0x1902, 0x8CAC, 0x1406


class DepthBuffer:
    """A depth texture and its current range. Range k = 1, 2, ... holds depths from 16^-k to 16^(1 - k).

    If the OpenGL library cannot be called directly, depths have 24 bits, the only format that moderngl creates, and are
    cleared before each use.
    """

    def __init__(self, context: moderngl.Context, size: tuple[int, int]) -> None:
        self._context = context
        self.texture = context.depth_texture(size)
        self.texture.compare_func = ""
        self.texture.filter = (context.NEAREST, context.NEAREST)
        self.texture.repeat_x = self.texture.repeat_y = False
        library = gl_library()
        self._range_count = 1 if library is None else MAX_RANGES
        self.number = 0
        if library is not None:
            self.texture.use(0)
            library.glTexImage2D(
                _TEXTURE_2D, 0, _DEPTH_COMPONENT32F, *size, 0, _DEPTH_COMPONENT, _FLOAT, None
            )

    @property
    def range(self) -> tuple[float, float]:
        """Nearest and farthest depth of the current range; of the first range before any use."""
        number = max(self.number, 1)
        return 16.0**-number, 16.0 ** (1 - number)

    def begin(self, framebuffer: moderngl.Framebuffer, *, clear: bool = False) -> None:
        """Make a framebuffer with this depth texture current, and start the next range. The first range is cleared.

        Parameters
        ----------
        framebuffer : Framebuffer
            Framebuffer with this depth texture.
        clear : bool, optional
            True to use the first range and clip at the near plane. Otherwise depths are clamped to the range, because
            rounding may move those of slivers out of it, and nothing may be nearer than the near plane.
        """
        self.number = 1 if clear else self.number % self._range_count + 1
        draw_to(framebuffer)
        if self.number == 1:
            framebuffer.clear()
        self._context.depth_clamp_range = self.range
        if clear:  # moderngl sets depth ranges only on clearing
            self._context.disable_direct(_DEPTH_CLAMP)

    def end(self) -> None:
        """Restore the full depth range."""
        self._context.depth_clamp_range = None
