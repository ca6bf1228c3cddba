"""Compiles the C once on the machine that runs it, and loads it from then on."""

from __future__ import annotations

import ctypes
import hashlib
import os
import pkgutil
import platform
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Tuple

from flyaround.hil.board.errors import KernelError
from flyaround.hil.board.svd.native.library_cache import load_cached, own_folder, store

# Headers first. They travel in the wheel and in the board's bundle as text.
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

# No reordered sums and no fused multiply-add, so that all machines of a kind give the same numbers; errno and traps are
# not asked for.
FLAGS = (
    "-std=c99",
    "-O3",
    "-ffp-contract=off",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-fPIC",
    "-shared",
)

# Wider vectors where the processor has them: each element rounds as it does alone.
SIMD_FLAGS = {"avx2": "-mavx2"}

# A compiler that takes longer is stopped [s].
LONGEST_S = 600.0


def library_folder() -> Path:
    """``kernels`` in ``FLYAROUND_CACHE_DIR`` or in the user's cache folder."""
    chosen = os.environ.get("FLYAROUND_CACHE_DIR")
    if chosen:
        return Path(chosen) / "kernels"
    user = os.environ.get("XDG_CACHE_HOME")
    return (Path(user) if user else Path("~").expanduser() / ".cache") / "flyaround" / "kernels"


def _simd_flags() -> Tuple[str, ...]:
    """Flags for the vector instructions that this processor has."""
    try:
        cpuinfo = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ()
    features = next((line.split() for line in cpuinfo.splitlines() if line.startswith("flags")), [])
    return tuple(flag for name, flag in SIMD_FLAGS.items() if name in features)


def compiled_library() -> ctypes.CDLL:
    """The shared library from the cache, or compiled now and cached if the folder is the user's alone.

    Raises
    ------
    KernelError
        If there is no compiler, or it cannot compile this. OSError : if nothing can be written or loaded.
    """
    compiler = shutil.which(os.environ.get("CC", "") or "cc")
    if compiler is None:
        raise KernelError("no C compiler was found (cc, or what CC names)")
    texts = {name: pkgutil.get_data("flyaround.hil.board.svd.native", name) or b"" for name in SOURCES}
    version = run_compiler((compiler, "--version"))
    flags = (*FLAGS, *_simd_flags())
    key = hashlib.sha256(repr((sorted(texts.items()), flags, version, platform.machine())).encode())
    stem = f"kernels-{key.hexdigest()[:20]}"
    with own_folder(library_folder()) as cache:
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
            run_compiler((compiler, *flags, f"-I{folder}", "-o", str(made), *sources, "-lm"))
            if cache:
                store(made, cache, stem)
                handle = load_cached(cache, stem)
            # a library stays loaded when its file is gone
            return handle if handle is not None else ctypes.CDLL(str(made))
        finally:
            shutil.rmtree(folder, ignore_errors=True)


def run_compiler(command: Tuple[str, ...]) -> str:
    """Standard output of a compiler run.

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
