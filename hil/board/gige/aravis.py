"""Binding of Aravis's C library through ctypes: the calls needed to configure, trigger and read a camera.

Unlike Aravis's Python binding, this works in any interpreter without compiling, virtual environments included.
"""

from __future__ import annotations

import ctypes
import ctypes.util
from ctypes import POINTER, byref, c_char_p, c_double, c_int, c_size_t, c_uint, c_uint64, c_void_p
from functools import lru_cache
from typing import Any, Dict, Tuple

from flyaround.hil.link.errors import LinkError

LIBRARY_NAMES = ("libaravis-0.8.so.0", "libaravis-0.8.0.dylib")
NOT_INSTALLED = (
    "a gige:// camera is read with Aravis 0.8, which is not installed: apt-get install libaravis-0.8-0"
    " (on macOS: brew install aravis)"
)

# Flag of arv_camera_gv_set_stream_options
NO_PACKET_SOCKET = 1
# Value of ArvBufferStatus
SUCCESS = 0

# Result and argument types; a call whose last argument is GERROR reports its error through it.
GERROR = POINTER(c_void_p)
SIGNATURES: Dict[str, Tuple[Any, ...]] = {
    "arv_camera_new": (c_void_p, c_char_p, GERROR),
    "arv_camera_get_device": (c_void_p, c_void_p),
    "arv_camera_is_gv_device": (c_int, c_void_p),
    "arv_gv_device_is_controller": (c_int, c_void_p),
    "arv_camera_get_vendor_name": (c_char_p, c_void_p, GERROR),
    "arv_camera_get_model_name": (c_char_p, c_void_p, GERROR),
    "arv_camera_get_sensor_size": (None, c_void_p, POINTER(c_int), POINTER(c_int), GERROR),
    "arv_camera_get_region": (None, c_void_p, *([POINTER(c_int)] * 4), GERROR),
    "arv_camera_set_region": (None, c_void_p, c_int, c_int, c_int, c_int, GERROR),
    "arv_camera_get_pixel_format": (c_uint, c_void_p, GERROR),
    "arv_camera_get_pixel_format_as_string": (c_char_p, c_void_p, GERROR),
    "arv_camera_set_pixel_format_from_string": (None, c_void_p, c_char_p, GERROR),
    "arv_camera_set_exposure_time": (None, c_void_p, c_double, GERROR),
    "arv_camera_set_gain": (None, c_void_p, c_double, GERROR),
    "arv_camera_set_frame_rate": (None, c_void_p, c_double, GERROR),
    "arv_camera_set_trigger": (None, c_void_p, c_char_p, GERROR),
    "arv_camera_clear_triggers": (None, c_void_p, GERROR),
    "arv_camera_software_trigger": (None, c_void_p, GERROR),
    "arv_camera_gv_get_packet_size": (c_uint, c_void_p, GERROR),
    "arv_camera_gv_set_packet_size": (None, c_void_p, c_int, GERROR),
    "arv_camera_gv_auto_packet_size": (c_uint, c_void_p, GERROR),
    "arv_camera_gv_set_stream_options": (None, c_void_p, c_int),
    "arv_camera_get_payload": (c_uint, c_void_p, GERROR),
    "arv_camera_create_stream": (c_void_p, c_void_p, c_void_p, c_void_p, GERROR),
    "arv_camera_start_acquisition": (None, c_void_p, GERROR),
    "arv_camera_stop_acquisition": (None, c_void_p, GERROR),
    "arv_buffer_new_allocate": (c_void_p, c_size_t),
    "arv_buffer_get_status": (c_int, c_void_p),
    "arv_buffer_get_data": (c_void_p, c_void_p, POINTER(c_size_t)),
    "arv_buffer_get_image_width": (c_int, c_void_p),
    "arv_buffer_get_image_height": (c_int, c_void_p),
    "arv_buffer_get_image_x": (c_int, c_void_p),
    "arv_buffer_get_image_y": (c_int, c_void_p),
    "arv_buffer_get_image_pixel_format": (c_uint, c_void_p),
    "arv_buffer_get_frame_id": (c_uint64, c_void_p),
    "arv_buffer_get_timestamp": (c_uint64, c_void_p),
    "arv_stream_push_buffer": (None, c_void_p, c_void_p),
    "arv_stream_timeout_pop_buffer": (c_void_p, c_void_p, c_uint64),
    "arv_stream_get_info_uint64_by_name": (c_uint64, c_void_p, c_char_p),
    "g_object_unref": (None, c_void_p),
    "g_error_free": (None, c_void_p),
}


class _Error(ctypes.Structure):
    """GLib's GError structure."""

    _fields_ = (("domain", ctypes.c_uint32), ("code", c_int), ("message", c_char_p))


class AravisError(LinkError):
    """Error that Aravis reports for a call."""


class Aravis:
    """The Aravis library, with its functions called by name.

    Raises
    ------
    LinkError
        If the library is not installed, or lacks one of the functions.
    """

    def __init__(self) -> None:
        library = _load()
        self._functions: Dict[str, Any] = {}
        for name, (result, *arguments) in SIGNATURES.items():
            try:
                function = getattr(library, name)
            except AttributeError:
                raise LinkError(f"Aravis's library lacks {name}: install Aravis 0.8.20 or later") from None
            function.restype, function.argtypes = result, arguments
            self._functions[name] = function

    def __call__(self, name: str, *arguments: Any) -> Any:  # noqa: ANN401 - the function's result
        """Call a function, and raise if it reports an error.

        Raises
        ------
        AravisError
            If the function reports an error.
        """
        function = self._functions[name]
        if SIGNATURES[name][-1] is not GERROR:
            return function(*arguments)
        error = c_void_p()
        result = function(*arguments, byref(error))
        if error.value:
            message = ctypes.cast(error, POINTER(_Error)).contents.message or b"it does not say why"
            self._functions["g_error_free"](error)
            raise AravisError(" ".join(message.decode("utf-8", "replace").split()))
        return result

    def sensor_size(self, camera: int) -> Tuple[int, int]:
        """Return the width and height of a camera's detector [px]."""
        width, height = c_int(), c_int()
        self("arv_camera_get_sensor_size", camera, byref(width), byref(height))
        return width.value, height.value

    def region(self, camera: int) -> Tuple[int, int, int, int]:
        """Return x, y, width and height of the region that a camera reads [px]."""
        x, y, width, height = (c_int() for _ in range(4))
        self("arv_camera_get_region", camera, byref(x), byref(y), byref(width), byref(height))
        return x.value, y.value, width.value, height.value

    def buffer_bytes(self, buffer: int) -> bytes:
        """Return a copy of a buffer's contents."""
        size = c_size_t()
        data = self("arv_buffer_get_data", buffer, byref(size))
        return ctypes.string_at(data, size.value) if data else b""


@lru_cache(maxsize=1)
def load_aravis() -> Aravis:
    """Load the library, once.

    Raises
    ------
    LinkError
        If the library is not installed, or lacks one of the functions.
    """
    return Aravis()


def _load() -> ctypes.CDLL:
    path = ctypes.util.find_library("aravis-0.8")
    for name in (*LIBRARY_NAMES, *([path] if path else [])):
        try:
            return ctypes.CDLL(name)
        except OSError:
            continue
    raise LinkError(NOT_INSTALLED)
