"""The window: glfw, its OpenGL context, Dear ImGui's backend, fonts, the picture's texture."""

from __future__ import annotations

import logging
from contextlib import contextmanager, suppress
from importlib.resources import files
from typing import TYPE_CHECKING, Any, Self

import cv2
import numpy as np

from flyaround.gui import style
from flyaround.gui.keyboard import Keyboard
from flyaround.simulator.errors import UserError, missing_extra

if TYPE_CHECKING:
    from collections.abc import Iterator

    import moderngl

    from flyaround.simulator.runtime.arrays import ByteArray

NO_DISPLAY = (
    "no window can be opened here (no X or Wayland display answers); start flyaround sim in a desktop "
    "session, or on a virtual screen with: xvfb-run -s '-screen 0 1280x800x24' flyaround sim"
)
FONT_PX = 16.0
MOST_DROPPED = 4
"""Files of one drop that are opened."""
SOFTWARE = ("llvmpipe", "softpipe", "swrast")
"""Drivers that draw on the processor."""


def import_parts() -> tuple[Any, Any]:
    """The modules ``imgui_bundle`` and ``glfw``, loaded in the order that gives both one libglfw.

    Raises
    ------
    UserError
        If the extra is not installed.
    """
    try:
        # PyOpenGL reports each optional accelerator that it does without
        logging.getLogger("OpenGL").setLevel(logging.WARNING)
        import imgui_bundle  # noqa: PLC0415 - an optional part
        import OpenGL  # noqa: PLC0415

        # every call checked costs as much as the call; moderngl's error state is read once a frame
        OpenGL.ERROR_CHECKING = False
        import glfw  # noqa: PLC0415
        from imgui_bundle.python_backends import glfw_backend  # noqa: F401, PLC0415
    except ImportError as error:
        raise missing_extra("the console", "gui", error) from error
    return imgui_bundle, glfw


class Window:
    """One window with its OpenGL context; made and used by the main thread only.

    Parameters
    ----------
    title : of the window. size : width and height in screen units.
    """

    def __init__(self, title: str, size: tuple[int, int]) -> None:
        bundle, self._glfw = import_parts()
        import moderngl  # noqa: PLC0415 - after the optional parts were found
        from imgui_bundle.python_backends.glfw_backend import GlfwRenderer  # noqa: PLC0415

        self.imgui = bundle.imgui
        self.implot = bundle.implot
        self._native = self._open(title, size)
        self._windowed: tuple[int, int, int, int] | None = None
        self.context = moderngl.create_context(require=330)
        self.gl_renderer = str(self.context.info["GL_RENDERER"])
        self.software = any(name in self.gl_renderer.lower() for name in SOFTWARE)
        self.imgui.create_context()
        self.implot.create_context()
        io = self.imgui.get_io()
        io.set_ini_filename("")
        io.config_flags |= self.imgui.ConfigFlags_.docking_enable
        # panels are moved by their titles, so that a drag in a picture or a map is the picture's
        io.config_windows_move_from_title_bar_only = True
        self._backend = GlfwRenderer(self._native)
        self.keys = Keyboard(
            self.imgui,
            self._glfw,
            self._native,
            on_key=self._backend.keyboard_callback,
            on_letter=self._backend.char_callback,
        )
        self._glfw.set_key_callback(self._native, self.keys.queue.key)
        self._glfw.set_char_callback(self._native, self.keys.queue.letter)
        # a key that is down when the window loses the focus must not stay down
        self._glfw.set_window_focus_callback(
            self._native, lambda _, focused: io.add_focus_event(bool(focused))
        )
        self._dropped: list[str] = []
        self._glfw.set_drop_callback(self._native, lambda _, paths: self._dropped.extend(paths))
        self._monitor_scale = max(self._glfw.get_window_content_scale(self._native)[0], 1.0)
        self._growth = 1.0
        self.capture = False
        self.captured: ByteArray | None = None
        self.text_font, self.figure_font = self._load_fonts()
        self.font_scale = 1.0
        self._textures: dict[str, tuple[moderngl.Texture, object, tuple[int, int] | None]] = {}

    def _open(self, title: str, size: tuple[int, int]) -> Any:  # noqa: ANN401 - a foreign handle
        glfw = self._glfw
        glfw.ERROR_REPORTING = False
        if not glfw.init():
            raise UserError(NO_DISPLAY)
        for hint, value in (
            (glfw.CONTEXT_VERSION_MAJOR, 3),
            (glfw.CONTEXT_VERSION_MINOR, 3),
            (glfw.OPENGL_PROFILE, glfw.OPENGL_CORE_PROFILE),
            (glfw.OPENGL_FORWARD_COMPAT, glfw.TRUE),
            (glfw.SCALE_TO_MONITOR, glfw.TRUE),
        ):
            glfw.window_hint(hint, value)
        native = glfw.create_window(*size, title, None, None)
        if not native:
            glfw.terminate()
            raise UserError(
                "the window system gives no OpenGL 3.3 context; install Mesa's drivers "
                "(Debian and Ubuntu: apt-get install libgl1-mesa-dri libglx-mesa0)"
            )
        glfw.set_window_size_limits(native, 480, 360, glfw.DONT_CARE, glfw.DONT_CARE)
        glfw.make_context_current(native)
        # the loop paces itself: waiting for the screen would hold the keys up
        glfw.swap_interval(0)
        return native

    def _load_fonts(self) -> tuple[Any, Any]:
        fonts = self.imgui.get_io().fonts
        folder = files("imgui_bundle") / "assets" / "fonts"
        size = FONT_PX * self._monitor_scale
        text = fonts.add_font_from_file_ttf(str(folder / "Roboto" / "Roboto-Regular.ttf"), size)
        figures = fonts.add_font_from_file_ttf(str(folder / "Inconsolata-Medium.ttf"), size)
        return text, figures

    # --- one turn of the loop

    @property
    def open(self) -> bool:
        """Whether the operator has not closed it."""
        return not self._glfw.window_should_close(self._native)

    @property
    def seconds(self) -> float:
        """Monotonic time."""
        return float(self._glfw.get_time())

    @property
    def framebuffer_size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        width, height = self._glfw.get_framebuffer_size(self._native)
        return int(width), int(height)

    @property
    def scale(self) -> float:
        """Size of letters and panels: the monitor's, and a little more in a large window."""
        return self._monitor_scale * self._growth * self.font_scale

    def close(self) -> None:
        """Ask the loop to end."""
        self._glfw.set_window_should_close(self._native, True)

    def wait(self, longest_s: float) -> bool:
        """Take what input there is, waiting for it at most so long; whether some came."""
        start = self.seconds
        self._glfw.wait_events_timeout(longest_s)
        return bool(self.keys.queue) or self.seconds - start < 0.9 * longest_s

    @contextmanager
    def frame(self) -> Iterator[None]:
        """Draw what the body lays out."""
        self.keys.queue.deliver()
        self._backend.process_inputs()
        height = self.imgui.get_io().display_size.y
        self._growth = min(max(height / self._monitor_scale / 900.0, 1.0), 1.5)
        self.imgui.get_style().font_scale_main = self._growth * self.font_scale
        self.imgui.new_frame()
        try:
            yield
        except BaseException:
            # a panel that failed left parts of itself open, which is not what is to be told
            with suppress(RuntimeError):
                self.imgui.end_frame()
            raise
        self.imgui.render()
        self.context.screen.use()
        self.context.viewport = (0, 0, *self.framebuffer_size)
        self.context.clear(*style.GROUND)
        self._backend.render(self.imgui.get_draw_data())
        if self.capture:
            # before the swap: afterwards the back buffer holds nothing one may rely on
            self.captured = self._read_pixels()
        self._glfw.swap_buffers(self._native)

    @property
    def size(self) -> tuple[float, float]:
        """Width and height in screen units."""
        width, height = self._glfw.get_window_size(self._native)
        return float(width), float(height)

    def gamepad(self) -> tuple[str, tuple[float, ...], tuple[bool, ...]] | None:
        """Name, axes and buttons of the first gamepad that has a standard mapping; None where none is plugged in."""
        glfw = self._glfw
        for k in range(glfw.JOYSTICK_1, glfw.JOYSTICK_LAST + 1):
            if not (glfw.joystick_present(k) and glfw.joystick_is_gamepad(k)):
                continue
            state = glfw.get_gamepad_state(k)
            if state is None:
                continue
            name = glfw.get_gamepad_name(k)
            return (
                name.decode(errors="replace") if isinstance(name, bytes) else str(name),
                tuple(float(a) for a in state.axes),
                tuple(bool(b) for b in state.buttons),
            )
        return None

    def take_dropped(self) -> list[str]:
        """Files that were dropped on the window since the last question."""
        dropped, self._dropped = self._dropped[:MOST_DROPPED], []
        return dropped

    def copy(self, text: str) -> None:
        """Put a text on the clipboard."""
        self.imgui.set_clipboard_text(text)

    def toggle_full_screen(self) -> None:
        """The whole monitor, or back to the window that was."""
        glfw = self._glfw
        if self._windowed is not None:
            x, y, width, height = self._windowed
            glfw.set_window_monitor(self._native, None, x, y, width, height, glfw.DONT_CARE)
            self._windowed = None
            return
        monitor = glfw.get_primary_monitor()
        if not monitor:
            return
        self._windowed = (*glfw.get_window_pos(self._native), *glfw.get_window_size(self._native))
        mode = glfw.get_video_mode(monitor)
        glfw.set_window_monitor(
            self._native, monitor, 0, 0, mode.size.width, mode.size.height, mode.refresh_rate
        )

    # --- pixels

    def show_picture(
        self, view: str, key: object, image: np.ndarray, bits: int, *, size: tuple[float, float] | None = None
    ) -> Any:  # noqa: ANN401 - an imgui handle
        """The picture as a texture for ``imgui.image``; uploaded when ``key`` is a new one.

        Parameters
        ----------
        view : who shows it; each has a texture of its own.
        image : (H, W) or (H, W, 3) digital numbers of ``bits`` bits.
        size : on the screen, where it is known. A software driver is then handed a picture of that size: OpenCV scales
            it in a tenth of the time.
        """
        ratio = self.imgui.get_io().display_framebuffer_scale
        scaled = (
            (max(round(size[0] * ratio.x), 1), max(round(size[1] * ratio.y), 1))
            if size is not None and self.software
            else None
        )
        texture, shown, shown_size = self._textures.get(view, (None, None, None))
        if texture is None or key is not shown or scaled != shown_size:
            eight = image if bits == 8 else (image >> max(bits - 8, 0)).astype(np.uint8)
            if scaled is not None:
                smaller = scaled[0] < eight.shape[1]
                eight = cv2.resize(
                    eight, scaled, interpolation=cv2.INTER_AREA if smaller else cv2.INTER_LINEAR
                )
            texture = self._upload(texture, eight, whole_pixels=scaled is not None)
            self._textures[view] = (texture, key, scaled)
        return self.imgui.ImTextureRef(texture.glo)

    def _upload(
        self, texture: moderngl.Texture | None, image: ByteArray, *, whole_pixels: bool
    ) -> moderngl.Texture:
        height, width = image.shape[:2]
        components = 1 if image.ndim == 2 else 3
        if texture is None or (texture.size, texture.components) != ((width, height), components):
            if texture is not None:
                texture.release()
            texture = self.context.texture((width, height), components, alignment=1)
            texture.swizzle = "RRR1" if components == 1 else "RGB1"
            texture.repeat_x = texture.repeat_y = False
            # a texel a pixel needs no interpolation
            kind = self.context.NEAREST if whole_pixels else self.context.LINEAR
            texture.filter = (kind, kind)
        texture.write(np.ascontiguousarray(image).tobytes(), alignment=1)
        return texture

    def _read_pixels(self) -> ByteArray:
        """(H, W, 3) what was drawn, top row first."""
        width, height = self.framebuffer_size
        screen = self.context.screen
        screen.viewport = (0, 0, width, height)
        data = screen.read(viewport=(0, 0, width, height), components=3, alignment=1)
        return np.ascontiguousarray(np.frombuffer(data, np.uint8).reshape(height, width, 3)[::-1])

    def release(self) -> None:
        """Close the window and free what it held."""
        for texture, _, _ in self._textures.values():
            texture.release()
        self._backend.shutdown()
        self.implot.destroy_context()
        self.imgui.destroy_context()
        self._glfw.destroy_window(self._native)
        self._glfw.terminate()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.release()
