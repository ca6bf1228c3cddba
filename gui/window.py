"""The window of the console: glfw, its OpenGL context, keys and dropped files."""

from __future__ import annotations

from typing import Any

from flyaround.gui.keyboard import Keyboard
from flyaround.gui.surface import Surface, import_parts
from flyaround.simulator.errors import UserError

MOST_DROPPED = 4
"""Largest number of files of one drop that are opened."""
CURSORS = {"text_input": "IBEAM", "resize_ew": "HRESIZE", "resize_ns": "VRESIZE", "hand": "HAND"}
"""Forms of the pointer in glfw by their names in Dear ImGui."""


def no_display(command: str) -> str:
    """Return the message that no display answers, with two ways to start ``command``."""
    return (
        f"no window can be opened here (no X or Wayland display answers); start {command} in a desktop session, or on "
        f"a virtual screen with: xvfb-run -s '-screen 0 1280x800x24' {command}"
    )


def open_glfw(
    glfw: Any,  # noqa: ANN401 - a foreign module
    size: tuple[int, int],
    title: str,
    monitor: object = None,
    **hints: int,
) -> Any:  # noqa: ANN401 - a foreign handle
    """Return a new window with an OpenGL 3.3 context, which is made current; None if that fails.

    Parameters
    ----------
    glfw : module
        The glfw module.
    size : tuple of int
        Width and height in screen coordinates.
    title : str
        Title of the window.
    monitor : object, optional
        Monitor to fill.
    hints : int
        Further glfw hints, by name.
    """
    all_hints = {"CONTEXT_VERSION_MAJOR": 3, "CONTEXT_VERSION_MINOR": 3}
    all_hints |= {"OPENGL_PROFILE": glfw.OPENGL_CORE_PROFILE, "OPENGL_FORWARD_COMPAT": glfw.TRUE}
    for hint, value in (all_hints | hints).items():
        glfw.window_hint(getattr(glfw, hint), value)
    native = glfw.create_window(*size, title, monitor, None)
    if native:
        glfw.make_context_current(native)
    return native


class Window(Surface):
    """One window with its OpenGL context.

    Parameters
    ----------
    title : str
        Title of the window.
    size : tuple of int
        Width and height in screen units.
    """

    def __init__(self, title: str, size: tuple[int, int]) -> None:
        _, self._glfw = import_parts()
        import moderngl  # noqa: PLC0415 - after the optional parts were found

        self._native = self._open(title, size)
        context = moderngl.create_context(require=330)
        scale = max(self._glfw.get_window_content_scale(self._native)[0], 1.0)
        super().__init__(context, context.screen, scale)
        self._windowed: tuple[int, int, int, int] | None = None
        self.keys: Keyboard = Keyboard(self.imgui, self._glfw, self._native, self._backend)
        self._glfw.set_key_callback(self._native, self.keys.queue.key)
        self._glfw.set_char_callback(self._native, self.keys.queue.letter)
        self._glfw.set_mouse_button_callback(self._native, self._queue_click)
        self._pointer = self._glfw.get_cursor_pos(self._native)
        self._glfw.set_cursor_pos_callback(self._native, self._move_pointer)
        # a window that moves under a still pointer reports no motion
        self._glfw.set_window_pos_callback(self._native, lambda *_: self._move_pointer(self._native))
        # keys that are down when the window loses focus must be released
        self._glfw.set_window_focus_callback(
            self._native, lambda _, focused: self.imgui.get_io().add_focus_event(bool(focused))
        )
        self._clicked_at = (-1.0, -1.0)
        self._cursor, self._cursors = "ARROW", dict[str, Any]()
        self._dropped: list[str] = []
        self._glfw.set_drop_callback(self._native, lambda _, paths: self._dropped.extend(paths))

    def _move_pointer(self, window: object, *place: float) -> None:
        """Note the place of the pointer at an event, and pass its present one to Dear ImGui."""
        self._pointer = place or self._glfw.get_cursor_pos(self._native)
        self._backend.mouse_callback(window)

    def _queue_click(self, window: object, button: int, action: int, modifiers: int) -> None:
        """Queue an event of a mouse button, which counts where the pointer was then, not where it has gone since."""
        place, io = self._pointer, self.imgui.get_io()
        if place != self._clicked_at:
            # Dear ImGui ignores a press on a tab that the pointer reached in the same frame
            self._clicked_at = place
            self.keys.queue.click(lambda: io.add_mouse_pos_event(*place))

        def take() -> None:
            io.add_mouse_pos_event(*place)
            self._backend.mouse_button_callback(window, button, action, modifiers)
            io.add_mouse_pos_event(*self._glfw.get_cursor_pos(self._native))

        self.keys.queue.click(take)

    def _open(self, title: str, size: tuple[int, int]) -> Any:  # noqa: ANN401 - a foreign handle
        glfw = self._glfw
        glfw.ERROR_REPORTING = False
        if not glfw.init():
            raise UserError(
                f"{no_display('flyaround sim')}, or, for a script, without any: flyaround sim --off-screen"
            )
        native = open_glfw(glfw, size, title, SCALE_TO_MONITOR=glfw.TRUE)
        if not native:
            glfw.terminate()
            raise UserError(
                "the window system gives no OpenGL 3.3 context; install Mesa's drivers "
                "(Debian and Ubuntu: apt-get install libgl1-mesa-dri libglx-mesa0)"
            )
        glfw.set_window_size_limits(native, 480, 360, glfw.DONT_CARE, glfw.DONT_CARE)
        # the loop paces itself: waiting for the display would delay keys
        glfw.swap_interval(0)
        return native

    def _renderer(self) -> Any:  # noqa: ANN401 - of a foreign module
        from imgui_bundle.python_backends.glfw_backend import GlfwRenderer  # noqa: PLC0415 - an optional part

        return GlfwRenderer(self._native)

    def _take_input(self) -> None:
        self.keys.queue.deliver()
        self._backend.process_inputs()

    def _show(self) -> None:
        glfw, imgui = self._glfw, self.imgui
        form = CURSORS.get(imgui.MouseCursor_(imgui.get_mouse_cursor()).name, "ARROW")
        if form != self._cursor:
            self._cursor = form
            self._cursors.setdefault(form, glfw.create_standard_cursor(getattr(glfw, f"{form}_CURSOR")))
            glfw.set_cursor(self._native, self._cursors[form])
        glfw.swap_buffers(self._native)

    @property
    def open(self) -> bool:
        """True until the operator closes the window."""
        return not self._glfw.window_should_close(self._native)

    @property
    def size(self) -> tuple[float, float]:
        """Width and height in screen units."""
        width, height = self._glfw.get_window_size(self._native)
        return float(width), float(height)

    @property
    def framebuffer_size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        width, height = self._glfw.get_framebuffer_size(self._native)
        return int(width), int(height)

    def hide(self) -> None:
        """Take the window off the screen."""
        self._glfw.hide_window(self._native)

    def stay_open(self) -> None:
        """Take back the operator's request to close it."""
        self._glfw.set_window_should_close(self._native, False)

    def wait(self, longest_s: float) -> bool:
        """Process input events, waiting at most ``longest_s`` for one; return True if there were any."""
        start = self.seconds
        self._glfw.wait_events_timeout(longest_s)
        return bool(self.keys.queue) or self.seconds - start < 0.9 * longest_s

    def gamepad(self) -> tuple[str, tuple[float, ...], tuple[bool, ...]] | None:
        """Return name, axes and buttons of the first gamepad with a standard mapping; None without one."""
        glfw = self._glfw
        for k in range(glfw.JOYSTICK_1, glfw.JOYSTICK_LAST + 1):
            # None if there is no joystick, or it has no mapping
            state = glfw.get_gamepad_state(k)
            if state is not None:
                axes, buttons = tuple(map(float, state.axes)), tuple(map(bool, state.buttons))
                return str(glfw.get_gamepad_name(k)), axes, buttons
        return None

    def take_dropped(self) -> list[str]:
        """Return the files dropped on the window since the last call."""
        dropped, self._dropped = self._dropped[:MOST_DROPPED], []
        return dropped

    def toggle_full_screen(self) -> None:
        """Fill the whole monitor, or return to the window."""
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
        size = mode.size.width, mode.size.height
        glfw.set_window_monitor(self._native, monitor, 0, 0, *size, mode.refresh_rate)

    def release(self) -> None:
        """Close the window and free its resources."""
        super().release()
        self._glfw.destroy_window(self._native)
        self._glfw.terminate()
