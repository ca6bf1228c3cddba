"""The compiled library for this processor: found in lib/, checked, and loaded once.

Wheels and board.pyz carry what hatch_build.py compiled; nothing is compiled where an estimate runs.
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
import hashlib
import os
import platform
import sys
import tempfile
from importlib.resources import files
from pathlib import Path
from typing import Any, Dict, Optional, Tuple

import numpy as np

from flyaround.hil.board.errors import KernelError
from flyaround.hil.board.hybrid.native.interface import FUNCTIONS, checksum, layout

# As sha256sum writes them, of each file of the folder.
CHECKSUMS = "SHA256SUMS"

SYSTEMS = {"linux": ("linux", ".so"), "darwin": ("macos", ".dylib"), "win32": ("windows", ".dll")}

# Names that the same processor has on different systems.
PROCESSORS = {"amd64": "x86_64", "arm64": "aarch64"}

CURE = (
    "install the wheel of this platform, or run `python hatch_build.py` in a checkout; "
    "svd-2018 and svd-thesis (--method) need no library"
)


def library() -> ctypes.CDLL:
    """Return the library with all its types declared.

    Raises
    ------
    KernelError
        If none can be used here; the message is one sentence.
    """
    loaded, text = _loaded()
    if loaded is None:
        raise KernelError(text)
    return loaded


def is_available() -> bool:
    """Return True if the library can be used here."""
    return _loaded()[0] is not None


def describe_library() -> str:
    """Return ``native`` and the loaded file, or ``none`` and the reason, in brackets."""
    loaded, text = _loaded()
    return f"native ({text})" if loaded is not None else f"none ({text})"


@functools.lru_cache(maxsize=None)
def _loaded() -> Tuple[Optional[ctypes.CDLL], str]:
    """Return the library and its name, or None and the reason."""
    try:
        name = choose_library()
        return load_library(name), name
    except KernelError as error:
        return None, str(error)


def library_folder() -> Any:  # noqa: ANN401 - a Path, or its like inside a zip
    """Return the folder of the libraries."""
    return files("flyaround.hil.board.hybrid.native").joinpath("lib")


def choose_library() -> str:
    """Return the name of the widest library that this processor runs.

    Raises
    ------
    KernelError
        If there is none.
    """
    system, ending = SYSTEMS.get(sys.platform, (sys.platform, ""))
    machine = _machine(system)
    wider = [f"{system}-{machine}-avx2{ending}"] if _has_avx2() else []
    there = [name for name in sorted(_checksums()) if library_folder().joinpath(name).is_file()]
    for name in (*wider, f"{system}-{machine}{ending}"):
        if name in there:
            return name
    has = ", ".join(name.rsplit(".", 1)[0] for name in there) or "none"
    raise KernelError(
        f"the estimator has no compiled library for {system}-{machine} (there are: {has}): {CURE}"
    )


def load_library(name: str) -> ctypes.CDLL:
    """Load one library of the folder and declare its functions.

    Raises
    ------
    KernelError
        If it is not the file that was installed, of another version, or cannot run here.
    """
    where = library_folder().joinpath(name)
    try:
        data = where.read_bytes()
    except (OSError, KeyError) as error:
        raise KernelError(f"the estimator's library {where} cannot be read ({error}): {CURE}") from error
    # a truncated library may crash the process that loads it
    if hashlib.sha256(data).hexdigest() != _checksums().get(name):
        raise KernelError(f"the estimator's library {where} is damaged or of another build: {CURE}")
    try:
        loaded = ctypes.CDLL(str(where)) if isinstance(where, Path) else _load_bytes(name, data)
        _declare(loaded)
    except (OSError, AttributeError) as error:
        raise KernelError(f"the estimator's library {where} does not load here ({error}): {CURE}") from error
    _check(loaded, str(where))
    return loaded


def _declare(loaded: ctypes.CDLL) -> None:
    """Set the types of all functions.

    Raises
    ------
    AttributeError
        If one is missing.
    """
    for name, (result, arguments) in FUNCTIONS.items():
        function = getattr(loaded, name)
        function.restype, function.argtypes = result, arguments


def _check(loaded: ctypes.CDLL, where: str) -> None:
    """Raise KernelError unless the library was made from the header that Python reads."""
    expected = layout()
    offsets = np.zeros(len(expected), np.int64)
    count = loaded.fly_layout(offsets, len(offsets))
    if (
        loaded.fly_interface().decode() != checksum()
        or count != len(expected)
        or offsets.tolist() != expected
    ):
        raise KernelError(f"the estimator's library {where} belongs to another version of Flyaround: {CURE}")


def _load_bytes(name: str, data: bytes) -> ctypes.CDLL:
    """Load a library out of a zip: from memory where Linux lets it, else from a file of this user alone."""
    if hasattr(os, "memfd_create"):
        with contextlib.suppress(OSError):  # may be forbidden
            memory = os.memfd_create(name)
            try:
                with os.fdopen(os.dup(memory), "wb") as file:
                    file.write(data)
                return ctypes.CDLL(f"/proc/self/fd/{memory}")
            finally:
                os.close(memory)
    with tempfile.TemporaryDirectory(prefix="flyaround-") as folder:
        path = Path(folder) / name
        path.write_bytes(data)
        # it stays loaded when its file is gone
        return ctypes.CDLL(str(path))


def _checksums() -> Dict[str, str]:
    """Return the checksum of each library that came with this program."""
    try:
        rows = library_folder().joinpath(CHECKSUMS).read_text(encoding="utf-8").splitlines()
    except (OSError, KeyError):  # a zip has its own
        return {}
    pairs = [row.split("  ", 1) for row in rows if "  " in row]
    return {name: digest for digest, name in pairs}


def _machine(system: str) -> str:
    """Return the processor of the Python that runs: a 64-bit kernel may run a 32-bit one."""
    machine = platform.machine().lower()
    wide = sys.maxsize > 2**32
    if system == "linux" and not wide and machine in ("armv7l", "armv8l", "aarch64"):
        return "armv7"
    if not wide:
        return f"{machine} (32 bits)"
    machine = PROCESSORS.get(machine, machine)
    return "arm64" if system == "macos" and machine == "aarch64" else machine


def _has_avx2() -> bool:
    """Return True if Linux says that the processor has AVX2."""
    try:
        cpuinfo = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return False
    return any("avx2" in line.split() for line in cpuinfo.splitlines() if line.startswith("flags"))
