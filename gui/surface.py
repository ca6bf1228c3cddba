"""The surface of the console: Dear ImGui's context and fonts, and pictures as textures, in an OpenGL context."""

from __future__ import annotations

import logging
import os
import time
from abc import ABC, abstractmethod
from contextlib import contextmanager, suppress
from importlib.resources import files
from typing import TYPE_CHECKING, Any, Self

import cv2
import numpy as np

from flyaround.gui import icons, style
from flyaround.simulator.errors import missing_extra

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    import moderngl

    from flyaround.gui.keyboard import Keys
    from flyaround.simulator.runtime.arrays import ByteArray

    ImageSource = ByteArray | Callable[[], ByteArray]

FONT_PX = 16.0
SOFTWARE = ("llvmpipe", "softpipe", "swrast")
"""Drivers that draw on the CPU."""


def import_parts(*, off_screen: bool = False) -> tuple[Any, Any]:
    """Return the modules ``imgui_bundle`` and ``glfw``, loaded in the order that makes them share one libglfw.

    Parameters
    ----------
    off_screen : bool, optional
        True to use OpenGL by EGL. The first call decides for the process.

    Raises
    ------
    UserError
        If the extra is not installed.
    """
    try:
        # PyOpenGL reports each missing accelerator
        logging.getLogger("OpenGL").setLevel(logging.WARNING)
        if off_screen:
            os.environ["PYOPENGL_PLATFORM"] = "egl"
        import imgui_bundle  # noqa: PLC0415 - an optional part
        import OpenGL  # noqa: PLC0415

        # checking every call doubles its cost; moderngl's error state is read once per frame
        OpenGL.ERROR_CHECKING = False
        import glfw  # noqa: PLC0415
        from imgui_bundle.python_backends import glfw_backend  # noqa: F401, PLC0415
    except ImportError as error:
        raise missing_extra("the console", "gui", error) from error
    return imgui_bundle, glfw


class Surface(ABC):
    """A surface of the console, used by the main thread only.

    A subclass opens the OpenGL context and Dear ImGui's renderer, and provides time and input.

    Parameters
    ----------
    context : Context
        Current OpenGL context.
    target : Framebuffer
        Framebuffer to draw into.
    monitor_scale : float
        Pixels per screen unit.
    """

    keys: Keys

    def __init__(self, context: moderngl.Context, target: moderngl.Framebuffer, monitor_scale: float) -> None:
        bundle, _ = import_parts()
        self._opened_s = time.monotonic()
        self.imgui, self.implot, self.ctx = bundle.imgui, bundle.implot, bundle.imgui_ctx
        self.context, self._target, self._monitor_scale = context, target, monitor_scale
        self.gl_renderer = str(context.info["GL_RENDERER"])
        self.software = any(name in self.gl_renderer.lower() for name in SOFTWARE)
        self.imgui.create_context()
        self.implot.create_context()
        io = self.imgui.get_io()
        io.set_ini_filename("")
        io.config_flags |= self.imgui.ConfigFlags_.docking_enable
        # panels are moved by their titles, so that pictures and maps can be dragged
        io.config_windows_move_from_title_bar_only = True
        self._backend: Any = self._renderer()
        self._growth = 1.0
        self.capture = False
        self.captured: ByteArray | None = None
        self.text_font, self.figure_font = self._load_fonts()
        self.font_scale = 1.0
        self.flaw = ""  # what is wrong with a typed value, for the message line
        self._textures: dict[str, tuple[moderngl.Texture, object, tuple[int, int] | None]] = {}

    def _load_fonts(self) -> tuple[Any, Any]:
        fonts = self.imgui.get_io().fonts
        folder = files("imgui_bundle") / "assets" / "fonts"
        size = FONT_PX * self._monitor_scale
        text = fonts.add_font_from_file_ttf(str(folder / "Roboto" / "Roboto-Regular.ttf"), size)
        if (folder / icons.FONT).is_file():
            merged = self.imgui.ImFontConfig()
            merged.merge_mode = True
            merged.glyph_min_advance_x = merged.glyph_max_advance_x = size  # aligns titles in menus
            fonts.add_font_from_file_ttf(str(folder / icons.FONT), 0.85 * size, merged)
        figures = fonts.add_font_from_file_ttf(str(folder / "Inconsolata-Medium.ttf"), size)
        return text, figures

    # --- provided by subclasses

    @abstractmethod
    def _renderer(self) -> Any:  # noqa: ANN401 - of a foreign module
        """Return Dear ImGui's renderer for the current context."""

    @abstractmethod
    def _take_input(self) -> None:
        """Pass size, time and input of the next frame to Dear ImGui."""

    @abstractmethod
    def _show(self) -> None:
        """Show the drawn frame."""

    @property
    @abstractmethod
    def open(self) -> bool:
        """True until the operator closes it."""

    @property
    def seconds(self) -> float:
        """Monotonic time since it was opened [s]."""
        return time.monotonic() - self._opened_s

    @property
    @abstractmethod
    def size(self) -> tuple[float, float]:
        """Width and height in screen units."""

    @property
    def framebuffer_size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        return int(self.size[0]), int(self.size[1])

    def stay_open(self) -> None:  # noqa: B027 - only a window has a close button
        """Take back the operator's request to close it."""

    @abstractmethod
    def wait(self, longest_s: float) -> bool:
        """Process input events, waiting at most ``longest_s`` for one; return True if there were any."""

    def gamepad(self) -> tuple[str, tuple[float, ...], tuple[bool, ...]] | None:
        """Return name, axes and buttons of the first gamepad with a standard mapping; None without one."""
        return None

    def take_dropped(self) -> list[str]:
        """Return the files dropped on the window since the last call."""
        return []

    def hide(self) -> None:  # noqa: B027 - nothing to do where there is no screen
        """Take the window off the screen."""

    def toggle_full_screen(self) -> None:  # noqa: B027 - nothing to do where there is no monitor
        """Fill the whole monitor, or return to the window."""

    # --- one turn of the loop

    @property
    def scale(self) -> float:
        """Size of text and panels: the monitor's scale, slightly enlarged in a large window."""
        return self._monitor_scale * self._growth * self.font_scale

    @contextmanager
    def frame(self) -> Iterator[None]:
        """Draw what the body lays out."""
        self._take_input()
        height = self.imgui.get_io().display_size.y
        self._growth = min(max(height / self._monitor_scale / 900.0, 1.0), 1.5)
        self.imgui.get_style().font_scale_main = self._growth * self.font_scale
        self.imgui.new_frame()
        try:
            yield
        except BaseException:
            # a failed panel leaves open items, which is not the error to report
            with suppress(RuntimeError):
                self.imgui.end_frame()
            raise
        self.imgui.render()
        self._target.use()
        self.context.viewport = (0, 0, *self.framebuffer_size)
        self.context.clear(*style.GROUND)
        self._backend.render(self.imgui.get_draw_data())
        if self.capture:
            # before it is shown, after which a window's back buffer is undefined
            self.captured = self._read_pixels()
        self._show()

    # --- pixels

    def show_picture(
        self, view: str, key: object, image: ImageSource, *, size: tuple[float, float] | None = None
    ) -> Any:  # noqa: ANN401 - an imgui handle
        """Return a picture as a texture for ``imgui.image``, uploaded if ``key`` is new.

        Parameters
        ----------
        view : str
            Name of the view; each has its own texture.
        key : object
            Object that stands for the picture's content, compared by identity.
        image : ByteArray or callable
            (H, W) or (H, W, 3) screen values, or a function that computes them for a new ``key``.
        size : tuple of float, optional
            Size on the screen, if known; the picture is then scaled by OpenCV, which takes a tenth of a software
            driver's time.
        """
        scaled = None
        if size is not None and self.software:
            ratio = self.imgui.get_io().display_framebuffer_scale
            scaled = (max(round(size[0] * ratio.x), 1), max(round(size[1] * ratio.y), 1))
        texture, shown, shown_size = self._textures.get(view, (None, None, None))
        if texture is None or key is not shown or scaled != shown_size:
            eight: np.ndarray = image() if callable(image) else image
            if scaled is not None:
                kind = cv2.INTER_AREA if scaled[0] < eight.shape[1] else cv2.INTER_LINEAR
                eight = cv2.resize(eight, scaled, interpolation=kind)
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
            # one texel per pixel needs no interpolation
            kind = self.context.NEAREST if whole_pixels else self.context.LINEAR
            texture.filter = (kind, kind)
        texture.write(np.ascontiguousarray(image).tobytes(), alignment=1)
        return texture

    def _read_pixels(self) -> ByteArray:
        """Return the (H, W, 3) drawn pixels, top row first."""
        width, height = self.framebuffer_size
        data = self._target.read(viewport=(0, 0, width, height), components=3, alignment=1)
        return np.ascontiguousarray(np.frombuffer(data, np.uint8).reshape(height, width, 3)[::-1])

    def release(self) -> None:
        """Free its resources."""
        for texture, _, _ in self._textures.values():
            texture.release()
        self._backend.shutdown()
        self.implot.destroy_context()
        self.imgui.destroy_context()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.release()
