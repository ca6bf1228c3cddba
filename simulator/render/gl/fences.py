"""Fences of a software driver, kept until its threads have left them: Mesa's frees one too early.

With each batch of drawing (a scene) llvmpipe makes a fence, in which every thread counts itself when it has done its
share. Whoever draws frees it as soon as the count is full, which is read without the fence's lock, and once another
scene was handed over. The last thread may still be between counting and letting go of the lock. One that the system
takes the processor from just there, as happens under load, goes on in memory that belongs to somebody else by then:
"corrupted double-linked list", or worse (lp_fence_signalled and lp_setup_get_empty_scene of Mesa 22.3, and of 2026).

A sync object of OpenGL holds a fence. So one is taken before what is drawn next can end the scene, and freed when a
later scene is known to be done: the threads begin with one only when all have left the one before.
"""

from __future__ import annotations

import ctypes
from functools import lru_cache
from typing import TYPE_CHECKING

from flyaround.simulator.render.gl.library import gl_library

if TYPE_CHECKING:
    from collections.abc import Callable

    import moderngl

_COMMANDS_COMPLETE, _ALREADY_SIGNALED = 0x9117, 0x911A
_AT_LEAST = 16
"""Fences that are taken before the older ones are looked at."""


class Fences:
    """Those of one context, as long as they may be in use.

    Parameters
    ----------
    library : OpenGL. Its calls keep Python's lock: a thread that waits for it would have it a hundred times as long.
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
        """Have the driver begin with what it was told, as `flush` does, and keep that scene's fence."""
        self._new.append(self._fence())
        if len(self._new) < _AT_LEAST:
            return
        # to look at a sync object lets go of its fence: this one is there to be looked at, and another holds the same
        if self._later is not None and self._look(self._later, 0, 0) != _ALREADY_SIGNALED:
            return
        for fence in (*self._old, self._later):
            self._free(fence)
        self._old, self._new = self._new, [self._fence()]
        self._later = self._fence()

    @property
    def held(self) -> int:
        """Number of fences that are kept."""
        return len(self._old) + len(self._new)

    def _fence(self) -> int | None:
        fence: int | None = self._make(_COMMANDS_COMPLETE, 0)
        return fence


def keep_fences(context: moderngl.Context) -> None:
    """Have `flush` and `draw_to` keep the fences of a context from here on; for software drivers."""
    library = gl_library()
    if context.extra is None and library is not None and hasattr(library, "glFenceSync"):
        context.extra = Fences(library)


def flush(context: moderngl.Context) -> None:
    """Have the driver begin with what it was told; a software driver collects it until it is asked for the picture.

    Where OpenGL has no name that Python finds, the driver begins when the next image is drawn or this one is read: to
    wait here until it is done would cost more than that.
    """
    if isinstance(context.extra, Fences):
        context.extra.hold()
        return
    begin = _gl_flush()
    if begin is not None:
        begin()


def draw_to(framebuffer: moderngl.Framebuffer) -> None:
    """Make a framebuffer current; every pass does so by this: to draw into another one ends a scene."""
    context = framebuffer.ctx
    if isinstance(context.extra, Fences) and context.fbo is not framebuffer:
        context.extra.hold()
    framebuffer.use()


@lru_cache(maxsize=1)
def _gl_flush() -> Callable[[], None] | None:
    """The call, which keeps Python's lock."""
    library = gl_library()
    return None if library is None else ctypes.PYFUNCTYPE(None)(("glFlush", library))
