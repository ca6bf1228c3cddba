"""The C kernels: compiled once where a C compiler is found, and loaded; numpy does the same where none is."""

from __future__ import annotations

import ctypes
import functools
import hashlib
import os
import pkgutil
import platform
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any, Callable, Optional, Tuple

import numpy as np

from hil.board.errors import KernelError
from hil.board.svd.native.library_cache import load_cached, own_folder, store

Array = np.ndarray

# One subject each; the header first. They travel in the wheel and in the board's bundle as text.
SOURCES = (
    "raster/face_mesh.h",
    "images/area_average.h",
    "photometric/image_formation.h",
    "photometric/image_jacobian.h",
    "photometric/robust_means.h",
    "photometric/residuals.h",
    "photometric/coverage.h",
    "raster/shadow_map.h",
    "raster/rasteriser.c",
    "raster/shadow_map.c",
    "raster/sun_search.c",
    "photometric/image_formation.c",
    "photometric/face_gains.c",
    "photometric/robust_means.c",
    "photometric/photometric_cost.c",
    "photometric/background.c",
    "photometric/image_jacobian.c",
    "photometric/residuals.c",
    "photometric/coverage.c",
    "photometric/normal_equations.c",
    "raster/visibility.c",
    "learned/attitude_likelihood.c",
    "images/area_average.c",
    "learned/network_input.c",
    "learned/subspace_match.c",
    "learned/convolution.c",
    "images/noise.c",
    "images/line_segments.c",
)

# No sum in another order and no product joined to a sum, so that all machines of a kind give the same numbers; nobody
# asks for errno or traps.
FLAGS = (
    "-std=c99",
    "-O3",
    "-ffp-contract=off",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-fPIC",
    "-shared",
)

# Where a processor has it, eight numbers at once instead of four: each of them rounds as it does alone.
WIDE = {"avx2": "-mavx2"}

# What chooses: auto (native where it can be), numpy, native (or refuse).
CHOICE = "FLYAROUND_KERNELS"
CHOICES = ("auto", "numpy", "native")

# Numbers that arrays hold: made once, for to compare with a name makes a dtype of it each time.
KINDS = {
    kind: np.dtype(kind)
    for kind in ("bool", "uint8", "uint16", "int16", "int32", "int64", "float32", "float64")
}

_FIRST: Callable[[Any], ctypes.c_char] = ctypes.c_char.from_buffer

# A compiler that takes longer is stopped [s].
LONGEST_S = 600.0


def library() -> Optional[ctypes.CDLL]:
    """The kernels, None where numpy does their work.

    Raises
    ------
    KernelError
        If ``FLYAROUND_KERNELS`` is none of ``CHOICES``, or asks for what cannot be had: one sentence.
    """
    return _loaded()[0]


def kernels() -> str:
    """``native``, or ``numpy`` with the reason in brackets."""
    handle, reason = _loaded()
    return "native" if handle is not None else f"numpy ({reason})"


@functools.lru_cache(maxsize=None)
def _loaded() -> Tuple[Optional[ctypes.CDLL], str]:
    """The kernels or None, and why there are none."""
    choice = os.environ.get(CHOICE, "") or "auto"
    if choice not in CHOICES:
        raise KernelError(f"{CHOICE} is {choice!r}: choose one of {', '.join(CHOICES)}, or leave it unset")
    if choice == "numpy":
        return None, f"{CHOICE} asks for it"
    try:
        return _compiled(), ""
    except (OSError, KernelError) as error:
        if choice == "native":
            raise KernelError(
                f"{CHOICE} asks for native kernels, but {error}; install a C compiler, or set it to auto"
            ) from error
        return None, str(error)


def cache_folder() -> Path:
    """``kernels`` in ``FLYAROUND_CACHE_DIR`` or in the user's cache folder."""
    chosen = os.environ.get("FLYAROUND_CACHE_DIR")
    if chosen:
        return Path(chosen) / "kernels"
    user = os.environ.get("XDG_CACHE_HOME")
    return (Path(user) if user else Path("~").expanduser() / ".cache") / "flyaround" / "kernels"


def _wide() -> Tuple[str, ...]:
    """Flags of what this processor has beside what all of its kind have."""
    try:
        told = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ()
    has = next((line.split() for line in told.splitlines() if line.startswith("flags")), [])
    return tuple(flag for name, flag in WIDE.items() if name in has)


def _compiled() -> ctypes.CDLL:
    """The library: as it was cached, or compiled now, and cached where the folder is the user's alone.

    Raises
    ------
    KernelError
        If there is no compiler, or it cannot compile this. OSError : if nothing can be written or loaded.
    """
    compiler = shutil.which(os.environ.get("CC", "") or "cc")
    if compiler is None:
        raise KernelError("no C compiler was found (cc, or what CC names)")
    texts = {name: pkgutil.get_data("hil.board.svd.native", name) or b"" for name in SOURCES}
    version = _said((compiler, "--version"))
    flags = (*FLAGS, *_wide())
    key = hashlib.sha256(repr((sorted(texts.items()), flags, version, platform.machine())).encode())
    stem = f"kernels-{key.hexdigest()[:20]}"
    with own_folder(cache_folder()) as cache:
        handle = load_cached(cache, stem) if cache else None
        if handle is not None:
            return handle
        # in a folder that is the user's alone
        folder = Path(tempfile.mkdtemp(prefix="flyaround-"))
        try:
            for name, text in texts.items():
                (folder / name).parent.mkdir(exist_ok=True)
                (folder / name).write_bytes(text)
            sources = [str(folder / name) for name in SOURCES if name.endswith(".c")]
            made = folder / "kernels.so"
            _said((compiler, *flags, f"-I{folder}", "-o", str(made), *sources, "-lm"))
            if cache:
                store(made, cache, stem)
                handle = load_cached(cache, stem)
            # a library stays loaded when its file is gone
            return handle if handle is not None else ctypes.CDLL(str(made))
        finally:
            shutil.rmtree(folder, ignore_errors=True)


def _said(command: Tuple[str, ...]) -> str:
    """What a program prints.

    Raises
    ------
    KernelError
        If it fails or takes too long.
    """
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=LONGEST_S)
    except subprocess.TimeoutExpired as error:
        raise KernelError(f"{command[0]} took more than {LONGEST_S:.0f} s") from error
    if done.returncode != 0:
        first = (done.stderr.strip() or done.stdout.strip() or "no message").splitlines()[0]
        raise KernelError(f"{command[0]} fails: {first}")
    return done.stdout


def address(a: Array, kind: str, shape: Optional[Tuple[int, ...]] = None) -> int:
    """Where a C-contiguous array begins, for a kernel; the caller keeps the array.

    Parameters
    ----------
    kind : its dtype, one of ``KINDS``. shape : what the kernel takes it for, where that is known.

    Raises
    ------
    ValueError
        If the array is another: a kernel would read beside it.
    """
    if a.dtype != KINDS[kind] or not a.flags.c_contiguous or (shape is not None and a.shape != shape):
        raise ValueError(f"a kernel takes {kind} {shape or ''}, not {a.dtype} {a.shape}")
    return begins(a)


def begins(a: Array) -> int:
    """The same of an array that the caller has just made, which is what it should be."""
    try:
        # a fifth of the time of what numpy tells itself
        return ctypes.addressof(_FIRST(a))
    except (TypeError, ValueError):
        # it must not be written to, or is empty
        return int(a.__array_interface__["data"][0])


def laid(a: Array, kind: str) -> Array:
    """The array as a kernel takes it: C-contiguous, of this dtype; itself where it is so."""
    return a if a.dtype == KINDS[kind] and a.flags.c_contiguous else np.ascontiguousarray(a, dtype=kind)
