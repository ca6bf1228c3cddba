"""References to the fences of Mesa's software driver, which frees a fence while a thread may still use it.

With each batch of drawing (a scene) llvmpipe creates a fence, in which every thread counts itself after its share. The
drawing thread frees it once the count, read without the fence's lock, is complete and another scene was submitted. The
last thread may still be between counting and unlocking. If the system preempts it there, as happens under load, it
continues in memory that belongs to somebody else: "corrupted double-linked list", or worse (lp_fence_signalled and
lp_setup_get_empty_scene of Mesa 22.3 and of 2026).

An OpenGL sync object holds a reference to a fence. So a sync object is created before the next drawing can end the
scene. It is deleted once a later scene is complete, because threads start a scene only after all have left the previous
one.
"""

from __future__ import annotations

import ctypes
from functools import lru_cache
from typing import TYPE_CHECKING

from flyaround.simulator.render.gl.library import gl_library

if TYPE_CHECKING:
    from collections.abc import Callable

    import moderngl

# constants of OpenGL
_COMMANDS_COMPLETE, _ALREADY_SIGNALED = 0x9117, 0x911A
_CHECK_COUNT = 16
"""Number of fences held before the oldest are checked."""


class Fences:
    """The fences of one context that may be in use.

    Parameters
    ----------
    library : ctypes.CDLL
        OpenGL library. It is called with the GIL held, because reacquiring it could take longer than the
        call.
    """

    def __init__(self, library: ctypes.CDLL) -> None:
        call = ctypes.PYFUNCTYPE
        self._create = call(ctypes.c_void_p, ctypes.c_uint, ctypes.c_uint)(("glFenceSync", library))
        self._wait = call(ctypes.c_uint, ctypes.c_void_p, ctypes.c_uint, ctypes.c_uint64)(
            ("glClientWaitSync", library)
        )
        self._delete = call(None, ctypes.c_void_p)(("glDeleteSync", library))
        self._old: list[int | None] = []
        self._new: list[int | None] = []
        self._later: int | None = None

    def hold(self) -> None:
        """Start the driver's queued commands, as `flush` does, and hold the fence of their scene."""
        self._new.append(self._fence())
        if len(self._new) < _CHECK_COUNT:
            return
        # a wait releases the fence of its sync object, so one object is for waiting and another holds the fence
        if self._later is not None and self._wait(self._later, 0, 0) != _ALREADY_SIGNALED:
            return
        for fence in (*self._old, self._later):
            self._delete(fence)
        self._old, self._new = self._new, [self._fence()]
        self._later = self._fence()

    @property
    def held(self) -> int:
        """Number of fences held."""
        return len(self._old) + len(self._new)

    def _fence(self) -> int | None:
        fence: int | None = self._create(_COMMANDS_COMPLETE, 0)
        return fence


def keep_fences(context: moderngl.Context) -> None:
    """Let `flush` and `draw_to` hold the fences of a context; needed for software drivers."""
    library = gl_library()
    if context.extra is None and library is not None and hasattr(library, "glFenceSync"):
        context.extra = Fences(library)


def flush(context: moderngl.Context) -> None:
    """Start the driver's queued commands. A software driver would otherwise collect them until the image is read.

    If the OpenGL library cannot be called directly, nothing is done. Drawing then starts at the next change of the
    framebuffer or at the read-back.
    """
    if isinstance(context.extra, Fences):
        context.extra.hold()
        return
    begin = _gl_flush()
    if begin is not None:
        begin()


def draw_to(framebuffer: moderngl.Framebuffer) -> None:
    """Make a framebuffer current. Every pass must use this function, because the change ends a scene of the driver."""
    context = framebuffer.ctx
    if isinstance(context.extra, Fences) and context.fbo is not framebuffer:
        context.extra.hold()
    framebuffer.use()


@lru_cache(maxsize=1)
def _gl_flush() -> Callable[[], None] | None:
    """Return glFlush as a function that holds the GIL, or None."""
    library = gl_library()
    return None if library is None else ctypes.PYFUNCTYPE(None)(("glFlush", library))
