"""The OpenGL context: headless EGL, or the caller's own, checked for its version."""

from __future__ import annotations

import os
import platform
from dataclasses import dataclass
from typing import Any, Protocol

import moderngl

from flyaround.simulator.errors import UserError
from flyaround.simulator.render.gl.fences import draw_to

REQUIRED_VERSION = 410  # OpenGL 4.1, the last one on macOS
HOW_TO_GET_EGL = (
    "install Mesa's EGL, e.g. `sudo apt-get install libegl1 libgl1-mesa-dri`, or the GPU vendor's driver"
)
_SOFTWARE_NAMES = ("llvmpipe", "softpipe", "swrast", "software rasterizer")


@dataclass(frozen=True)
class GlInfo:
    """The OpenGL driver. It is recorded with every image, because the image's bytes depend on it.

    Parameters
    ----------
    vendor : str
        GL_VENDOR.
    renderer : str
        GL_RENDERER.
    version : str
        GL_VERSION.
    threads : int
        Number of threads of a software driver; 0 for a GPU.
    is_software : bool
        True if the driver draws on the CPU.
    """

    vendor: str
    renderer: str
    version: str
    threads: int
    is_software: bool


def create_context(device_index: int | None = None) -> moderngl.Context:
    """Create a headless OpenGL context by EGL, without any window system.

    Parameters
    ----------
    device_index : int, optional
        Index of the EGL device; ``None`` leaves the choice to EGL.

    Returns
    -------
    moderngl.Context
        Context that is current in this thread.

    Raises
    ------
    UserError
        If EGL or the device is missing, or its OpenGL is older than 4.1.
    """
    _disable_avx_for_narrow_vectors()
    options: dict[str, Any] = {"backend": "egl"}
    if device_index is not None:
        options["device_index"] = device_index
    try:
        context = _create_context(options)
    except Exception as error:
        # moderngl raises bare Exception from its loader
        on_device = "" if device_index is None else f" on device {device_index}"
        advice = HOW_TO_GET_EGL if device_index is None else "leave the device out, or name one that there is"
        raise UserError(f"no headless OpenGL by EGL{on_device} ({error}); {advice}") from error
    check_version(context)
    return context


def _create_context(options: dict[str, Any]) -> moderngl.Context:
    """Create a context of the required version, or else of any version, for `check_version` to report.

    NVIDIA's driver creates exactly the requested version, 3.3 by default. Mesa creates the newest that it has.
    """
    try:
        return moderngl.create_context(require=REQUIRED_VERSION, standalone=True, **options)
    except Exception:  # noqa: BLE001 - the loader raises nothing else
        return moderngl.create_context(standalone=True, **options)


def _disable_avx_for_narrow_vectors() -> None:
    """Disable AVX in Mesa's software driver if 128-bit vectors are set.

    With AVX on 128-bit vectors, Mesa 22.3 with LLVM 15 writes out of bounds when it draws the Earth. Only the
    environment variable can cause this, because processors with AVX default to 256-bit vectors.
    """
    if os.environ.get("LP_NATIVE_VECTOR_WIDTH") == "128" and platform.machine() in {"x86_64", "AMD64"}:
        os.environ.setdefault("GALLIUM_OVERRIDE_CPU_CAPS", "sse4.1")


def check_version(context: moderngl.Context) -> None:
    """Raise ``UserError`` if the context is older than OpenGL 4.1."""
    if context.version_code < REQUIRED_VERSION:
        version = context.info["GL_VERSION"]
        raise UserError(
            f"OpenGL 4.1 is needed and the driver has {version}; "
            "update the GPU vendor's driver, or draw in software by Mesa's (20.3 or newer)"
        )


def describe(context: moderngl.Context) -> GlInfo:
    """Return vendor, renderer, version and the number of threads of a software driver."""
    renderer = str(context.info["GL_RENDERER"])
    is_software = any(name in renderer.lower() for name in _SOFTWARE_NAMES)
    threads = 0
    if is_software:
        # llvmpipe uses one thread per available core unless LP_NUM_THREADS is set
        threads = int(os.environ.get("LP_NUM_THREADS", "") or len(os.sched_getaffinity(0)))
    return GlInfo(
        vendor=str(context.info["GL_VENDOR"]),
        renderer=renderer,
        version=str(context.info["GL_VERSION"]),
        threads=threads,
        is_software=is_software,
    )


class Releasable(Protocol):
    """A driver resource that is freed explicitly."""

    def release(self) -> None:
        """Free the resource."""


def release(context: moderngl.Context, *resources: Releasable) -> None:
    """Free resources, even if one is the current framebuffer.

    moderngl re-binds the framebuffer that it believes current after several calls, and a freed one would cause
    GL_INVALID_OPERATION, so the default framebuffer is made current first.
    """
    draw_to(context.detect_framebuffer(0))
    for resource in resources:
        resource.release()
