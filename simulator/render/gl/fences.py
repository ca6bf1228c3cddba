"""Fences of a software driver, kept until its threads have left them, because Mesa frees one too early.

With each batch of drawing (a scene) llvmpipe creates a fence, in which every thread counts itself after its share. The
drawing thread frees it once the count, read without the fence's lock, is complete and another scene was submitted. The
last thread may still be between counting and unlocking. If the system preempts it there, as happens under load, it
continues in memory that belongs to somebody else: "corrupted double-linked list", or worse (lp_fence_signalled and
lp_setup_get_empty_scene of Mesa 22.3 and of 2026).

An OpenGL sync object holds a reference to a fence. So one is created before the next drawing can end the scene, and
deleted once a later scene is complete: threads start a scene only after all have left the previous one.
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
_AT_LEAST = 16
"""Number of fences held before the oldest are checked."""


class Fences:
    """The fences of one context that may be in use.

    Parameters
    ----------
    library : ctypes.CDLL
        OpenGL library. Its calls keep Python's lock: reacquiring it could take a hundred times as long.
    """

    def __init__(self, library: ctypes.CDLL) -> None:
        call = ctypes.PYFUNCTYPE
        self._make = call(ctypes.c_void_p, ctypes.c_uint, ctypes.c_uint)(("glFenceSync", library))
        self._look = call(ctypes.c_uint, ctypes.c_void_p, ctypes.c_uint, ctypes.c_uint64)(
            ("glClientWaitSync", library)
        )
        self._free = call(None, ctypes.c_void_p)(("glDeleteSync", library))
        self._old: list[int | None] = []
        self._new: list[int | None] = []
        self._later: int | None = None

    def hold(self) -> None:
        """Have the driver start its queued commands, as `flush` does, and hold that scene's fence."""
        self._new.append(self._fence())
        if len(self._new) < _AT_LEAST:
            return
        # waiting on a sync object releases its fence: one object is for waiting, another keeps the fence
        if self._later is not None and self._look(self._later, 0, 0) != _ALREADY_SIGNALED:
            return
        for fence in (*self._old, self._later):
            self._free(fence)
        self._old, self._new = self._new, [self._fence()]
        self._later = self._fence()

    @property
    def held(self) -> int:
        """Number of fences held."""
        return len(self._old) + len(self._new)

    def _fence(self) -> int | None:
        fence: int | None = self._make(_COMMANDS_COMPLETE, 0)
        return fence


def keep_fences(context: moderngl.Context) -> None:
    """Have `flush` and `draw_to` hold the fences of a context from now on; for software drivers."""
    library = gl_library()
    if context.extra is None and library is not None and hasattr(library, "glFenceSync"):
        context.extra = Fences(library)


def flush(context: moderngl.Context) -> None:
    """Have the driver start its queued commands; a software driver collects them until the image is read.

    If the OpenGL library cannot be called directly this does nothing: drawing then starts with the next image or the
    read-back, and waiting here would cost more.
    """
    if isinstance(context.extra, Fences):
        context.extra.hold()
        return
    begin = _gl_flush()
    if begin is not None:
        begin()


def draw_to(framebuffer: moderngl.Framebuffer) -> None:
    """Make a framebuffer current; every pass uses this, because changing the framebuffer ends a scene."""
    context = framebuffer.ctx
    if isinstance(context.extra, Fences) and context.fbo is not framebuffer:
        context.extra.hold()
    framebuffer.use()


@lru_cache(maxsize=1)
def _gl_flush() -> Callable[[], None] | None:
    """Return glFlush called with Python's lock held, or None."""
    library = gl_library()
    return None if library is None else ctypes.PYFUNCTYPE(None)(("glFlush", library))
