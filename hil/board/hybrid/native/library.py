"""Loading of the compiled library for this processor: selected from lib/, verified, and loaded once.

Wheels and board.pyz contain the libraries compiled by hatch_build.py; nothing is compiled at run time.
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

# In the format of sha256sum, one line for each file of the folder.
CHECKSUMS = "SHA256SUMS"

SYSTEMS = {"linux": ("linux", ".so"), "darwin": ("macos", ".dylib"), "win32": ("windows", ".dll")}

# Names of the same processor on different systems.
PROCESSORS = {"amd64": "x86_64", "arm64": "aarch64"}

REMEDY = (
    "install the wheel of this platform, or run `python hatch_build.py` in a checkout; "
    "svd-2018 and svd-thesis (--method) need no library"
)


def library() -> ctypes.CDLL:
    """Return the library with the types of all functions declared.

    Returns
    -------
    CDLL
        The same loaded library at every call.

    Raises
    ------
    KernelError
        If no library can be used; the message is one sentence.
    """
    loaded, text = _load_best()
    if loaded is None:
        raise KernelError(text)
    return loaded


def is_available() -> bool:
    """Return True if a library can be used."""
    return _load_best()[0] is not None


def describe_library() -> str:
    """Describe the library that is loaded, or why there is none.

    Returns
    -------
    str
        ``native`` and the loaded file in brackets, or ``none`` and the reason in brackets.
    """
    loaded, text = _load_best()
    return f"native ({text})" if loaded is not None else f"none ({text})"


@functools.lru_cache(maxsize=None)
def _load_best() -> Tuple[Optional[ctypes.CDLL], str]:
    """Return the library and its name, or None and the reason."""
    try:
        name = choose_library()
        return load_library(name), name
    except KernelError as error:
        return None, str(error)


def library_folder() -> Any:  # noqa: ANN401 - a Path, or a Traversable inside a zip
    """Return the folder of the libraries."""
    return files("flyaround.hil.board.hybrid.native").joinpath("lib")


def choose_library() -> str:
    """Return the name of the library with the widest vector instructions that this processor supports.

    Raises
    ------
    KernelError
        If there is none.
    """
    system, ending = SYSTEMS.get(sys.platform, (sys.platform, ""))
    machine = _machine(system)
    wider = [f"{system}-{machine}-avx2{ending}"] if _has_avx2() else []
    available = [name for name in sorted(_checksums()) if library_folder().joinpath(name).is_file()]
    for name in (*wider, f"{system}-{machine}{ending}"):
        if name in available:
            return name
    has = ", ".join(name.rsplit(".", 1)[0] for name in available) or "none"
    raise KernelError(
        f"the estimator has no compiled library for {system}-{machine} (available: {has}): {REMEDY}"
    )


def load_library(name: str) -> ctypes.CDLL:
    """Load one library of the folder and declare its functions.

    Raises
    ------
    KernelError
        If the file is not the installed one, belongs to another version, or cannot be loaded.
    """
    where = library_folder().joinpath(name)
    try:
        data = where.read_bytes()
    except (OSError, KeyError) as error:
        raise KernelError(f"the estimator's library {where} cannot be read ({error}): {REMEDY}") from error
    # a truncated library may crash the process that loads it
    if hashlib.sha256(data).hexdigest() != _checksums().get(name):
        raise KernelError(f"the estimator's library {where} is damaged or from another build: {REMEDY}")
    try:
        loaded = ctypes.CDLL(str(where)) if isinstance(where, Path) else _load_bytes(name, data)
        _declare(loaded)
    except (OSError, AttributeError) as error:
        raise KernelError(f"the estimator's library {where} cannot be loaded ({error}): {REMEDY}") from error
    _check(loaded, str(where))
    return loaded


def _declare(loaded: ctypes.CDLL) -> None:
    """Set the result and argument types of all functions.

    Raises
    ------
    AttributeError
        If a function is missing.
    """
    for name, (result, arguments) in FUNCTIONS.items():
        function = getattr(loaded, name)
        function.restype, function.argtypes = result, arguments


def _check(loaded: ctypes.CDLL, where: str) -> None:
    """Raise KernelError unless the library was built from the header that Python parsed."""
    expected = layout()
    offsets = np.zeros(len(expected), np.int64)
    count = loaded.fly_layout(offsets, len(offsets))
    if (
        loaded.fly_interface().decode() != checksum()
        or count != len(expected)
        or offsets.tolist() != expected
    ):
        raise KernelError(
            f"the estimator's library {where} belongs to another version of Flyaround: {REMEDY}"
        )


def _load_bytes(name: str, data: bytes) -> ctypes.CDLL:
    """Load a library from a zip: through memory on Linux, otherwise through a private temporary file."""
    if hasattr(os, "memfd_create"):
        with contextlib.suppress(OSError):  # memfd_create may be forbidden
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
        # the library stays loaded after its file is removed
        return ctypes.CDLL(str(path))


def _checksums() -> Dict[str, str]:
    """Return the checksum of each library shipped with this program."""
    try:
        rows = library_folder().joinpath(CHECKSUMS).read_text(encoding="utf-8").splitlines()
    except (OSError, KeyError):  # a zip carries its own
        return {}
    pairs = [row.split("  ", 1) for row in rows if "  " in row]
    return {name: digest for digest, name in pairs}


def _machine(system: str) -> str:
    """Return the processor of the running interpreter: a 64-bit kernel may run a 32-bit one."""
    machine = platform.machine().lower()
    wide = sys.maxsize > 2**32
    if system == "linux" and not wide and machine in ("armv7l", "armv8l", "aarch64"):
        return "armv7"
    if not wide:
        return f"{machine} (32 bits)"
    machine = PROCESSORS.get(machine, machine)
    return "arm64" if system == "macos" and machine == "aarch64" else machine


def _has_avx2() -> bool:
    """Return True if Linux reports AVX2."""
    try:
        cpuinfo = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return False
    return any("avx2" in line.split() for line in cpuinfo.splitlines() if line.startswith("flags"))
