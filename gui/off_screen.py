"""The console without a window: drawn to a texture under EGL, for scripts, tests and machines without a display."""

from __future__ import annotations

import time
from typing import Any

from flyaround.gui.keyboard import Keys
from flyaround.gui.surface import Surface, import_parts
from flyaround.simulator.render.gl.context import create_context


class OffScreen(Surface):
    """A surface without display, keys and pointer; commands come from a script.

    A process has either such surfaces or windows, because PyOpenGL is loaded for one of them.

    Parameters
    ----------
    size : tuple of int
        Width and height in pixels.
    """

    def __init__(self, size: tuple[int, int]) -> None:
        import_parts(off_screen=True)
        self._size = size
        self._drawn_s = 0.0
        context = create_context()
        texture = context.texture(size, 4)
        super().__init__(context, context.framebuffer([texture]), 1.0)
        self.keys = Keys()

    def _renderer(self) -> Any:  # noqa: ANN401 - of a foreign module
        from imgui_bundle.python_backends.opengl_backend_programmable import (  # noqa: PLC0415 - an optional part
            ProgrammablePipelineRenderer,
        )

        return ProgrammablePipelineRenderer()

    def _take_input(self) -> None:
        io = self.imgui.get_io()
        io.display_size = self.imgui.ImVec2(*self.size)
        now = self.seconds
        io.delta_time = max(now - self._drawn_s, 1e-4)
        self._drawn_s = now

    def _show(self) -> None:
        self.context.finish()

    @property
    def open(self) -> bool:
        """True: nobody can close it."""
        return True

    @property
    def size(self) -> tuple[float, float]:
        """Width and height in pixels."""
        return float(self._size[0]), float(self._size[1])

    def wait(self, longest_s: float) -> bool:
        """Let time pass; no input comes."""
        time.sleep(longest_s)
        return False
