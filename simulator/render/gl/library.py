"""Direct calls of the OpenGL library, for functions that moderngl lacks or calls with the GIL held."""

from __future__ import annotations

import ctypes
import sys
from functools import lru_cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import moderngl

_LIBRARIES = {
    "darwin": ("/System/Library/Frameworks/OpenGL.framework/OpenGL",),
    "win32": ("opengl32",),
}
_LINUX = ("libGL.so.1", "libOpenGL.so.0")
_GL_POINTS = 0  # GL_POINTS


@lru_cache(maxsize=1)
def gl_library() -> ctypes.CDLL | None:
    """Return the OpenGL library, or ``None`` if Python cannot find it."""
    for name in _LIBRARIES.get(sys.platform, _LINUX):
        try:
            library = ctypes.CDLL(name)
            library.glTexImage2D.argtypes = [*[ctypes.c_int] * 8, ctypes.c_void_p]
            library.glGenTextures.argtypes = [ctypes.c_int, ctypes.c_void_p]
            library.glDeleteTextures.argtypes = [ctypes.c_int, ctypes.c_void_p]
        except (OSError, AttributeError):
            continue
        return library
    return None


def draw_one_point(array: moderngl.VertexArray) -> None:
    """Draw the first vertex of an array of points with the GIL released; moderngl would hold it."""
    library = gl_library()
    if library is None:
        array.render(vertices=1)
        return
    array.render(vertices=0)  # binds program and vertices
    library.glDrawArrays(_GL_POINTS, 0, 1)
