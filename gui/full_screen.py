"""A full-screen monitor that shows pictures pixel by pixel, for a camera that looks at it."""

from __future__ import annotations

from typing import Any, Self

import moderngl

from flyaround.gui.surface import import_parts
from flyaround.gui.window import no_display, open_glfw
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.arrays import ByteArray

VERTEX = """#version 330
void main() {
    vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1);
    gl_Position = vec4(4.0 * corner - 1.0, 0.0, 1.0);
}"""
FRAGMENT = """#version 330
uniform sampler2D picture;
out vec4 colour;
void main() {
    colour = vec4(texelFetch(picture, ivec2(gl_FragCoord.xy), 0).rrr, 1.0);
}"""


class FullScreen:
    """A monitor filled by one picture, without border, pointer or scaling.

    Parameters
    ----------
    monitor : int, optional
        Index in the order of the window system.

    Raises
    ------
    UserError
        If there is no display or no such monitor.
    """

    def __init__(self, monitor: int = 0) -> None:
        _, self._glfw = import_parts()
        glfw = self._glfw
        glfw.ERROR_REPORTING = False
        if not glfw.init():
            raise UserError(no_display("flyaround hil display"))
        monitors = glfw.get_monitors()
        if not 0 <= monitor < len(monitors):
            glfw.terminate()
            raise UserError(f"there is no monitor {monitor}; there are {len(monitors)}, numbered from 0")
        mode = glfw.get_video_mode(monitors[monitor])
        size = (mode.size.width, mode.size.height)
        hints = {"AUTO_ICONIFY": glfw.FALSE, "REFRESH_RATE": mode.refresh_rate}
        self._window = open_glfw(glfw, size, "Flyaround display", monitors[monitor], **hints)
        if not self._window:
            glfw.terminate()
            raise UserError(f"monitor {monitor} gives no OpenGL 3.3 window; see flyaround doctor")
        glfw.set_input_mode(self._window, glfw.CURSOR, glfw.CURSOR_HIDDEN)
        glfw.swap_interval(1)
        self._context = moderngl.create_context(require=330)
        self._program: Any = self._context.program(vertex_shader=VERTEX, fragment_shader=FRAGMENT)
        self._triangle = self._context.vertex_array(self._program, [])
        width, height = glfw.get_framebuffer_size(self._window)
        self.size_px: tuple[int, int] = (int(width), int(height))
        self._texture = self._context.texture(self.size_px, 1, alignment=1)

    @property
    def open(self) -> bool:
        """True until it is closed or Escape is pressed."""
        glfw = self._glfw
        escape = glfw.get_key(self._window, glfw.KEY_ESCAPE) == glfw.PRESS
        return not (escape or glfw.window_should_close(self._window))

    def show(self, image: ByteArray) -> None:
        """Show (H, W) levels of the monitor's size; return when the monitor has taken them.

        Raises
        ------
        ValueError
            If the picture has another size.
        """
        if image.shape != self.size_px[::-1]:
            raise ValueError(f"a picture of {image.shape[::-1]} for a monitor of {self.size_px}")
        # OpenGL counts rows from the bottom
        self._texture.write(image[::-1].tobytes(), alignment=1)
        self._context.screen.use()
        self._context.viewport = (0, 0, *self.size_px)
        self._texture.use(0)
        self._triangle.render(self._context.TRIANGLES, vertices=3)
        self._glfw.swap_buffers(self._window)
        self._context.finish()
        self._glfw.poll_events()

    def close(self) -> None:
        """Close the window."""
        self._context.release()
        self._glfw.destroy_window(self._window)
        self._glfw.terminate()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
