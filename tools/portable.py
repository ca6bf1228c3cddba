"""Run the numerical tests as on other processors: change one factor at a time, then the worst combination.

``python tools/portable.py [FACTOR ...]`` passes ``PYTEST_ADDOPTS`` to the tests; ``JOBS`` is the number of test files
that run concurrently. A separate process first verifies that each factor has an effect, because a library may ignore an
environment variable. Factors that this machine's processor does not support are reported and omitted.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
_DRAWN = re.compile(r"^pytestmark = .*mark\.gl", re.MULTILINE)


def _simulator(*, drawn: bool) -> tuple[str, ...]:
    """Return the simulator's and the tools' test files marked ``gl`` as a whole, or all others."""
    files = [*ROOT.glob("tests/simulator/**/test_*.py"), *ROOT.glob("tests/tools/**/test_*.py")]
    paths = [p for p in files if bool(_DRAWN.search(p.read_text(encoding="utf-8"))) is drawn]
    return tuple(sorted(p.relative_to(ROOT).as_posix() for p in paths))


ESTIMATOR = ("tests/hil/board/*/**/test_*.py", "tests/hil/evaluate/test_*.py")
NUMERICAL = (*_simulator(drawn=False), *ESTIMATOR)
DRAWN = _simulator(drawn=True)
PICTURES = ("tests/flyaround/test_same_bytes.py", "tests/simulator/render/craft/test_target.py")

BLAS = """
import numpy, scipy.linalg, threadpoolctl
cores = {p["architecture"] for p in threadpoolctl.threadpool_info() if p["internal_api"] == "openblas"}
assert cores == {CORE}, f"OpenBLAS runs as {cores}"
"""
NUMPY = """
from numpy._core._multiarray_umath import __cpu_features__ as features
on = [name for name in {NAMES!r} if features[name]]
assert not on, f"NumPy still uses {on}"
"""
THREADS = """
import numpy, scipy.linalg, threadpoolctl
threads = {p["num_threads"] for p in threadpoolctl.threadpool_info() if p["internal_api"] == "openblas"}
assert threads == {NUMBER}, f"OpenBLAS uses {threads} threads"
"""
VECTORS = """
from flyaround.simulator.render.gl.context import create_context
info = create_context().info["GL_RENDERER"]
assert "{BITS} bits" in info, info
"""

# X86_V3 is AVX2 and FMA, X86_V4 and the others AVX-512; NumPy ignores names that it does not know (numpy 2.4's names).
AVX512 = ("X86_V4", "AVX512_ICL", "AVX512_SPR")
AVX2 = ("X86_V3", *AVX512)


@dataclass(frozen=True)
class Factor:
    """A property of a machine that changes how numbers are rounded.

    Parameters
    ----------
    name : str
        Name on the command line.
    environment : dict of str to str
        Variables that set it.
    shown : str
        Program that fails unless the variables have an effect.
    tests : tuple of str, optional
        Files of tests to run.
    needs : tuple of str, optional
        Flags that /proc/cpuinfo must list.
    """

    name: str
    environment: dict[str, str]
    shown: str
    tests: tuple[str, ...] = NUMERICAL
    needs: tuple[str, ...] = ()


def _blas(core: str, *needs: str) -> Factor:
    # among cores with the same 64-bit code OpenBLAS reports the oldest
    core_name = "Katmai" if core == "Prescott" else core
    return Factor(
        f"blas-{core.lower()}",
        {"OPENBLAS_CORETYPE": core},
        BLAS.replace("{CORE}", repr({core_name})),
        needs=needs,
    )


def _numpy(name: str, features: tuple[str, ...], *needs: str) -> Factor:
    return Factor(
        name,
        {"NPY_DISABLE_CPU_FEATURES": " ".join(features)},
        NUMPY.replace("{NAMES!r}", repr(features)),
        needs=needs,
    )


def _threads(number: int) -> Factor:
    names = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "LP_NUM_THREADS")
    # the library uses no more threads than there are processors
    most = min(number, os.cpu_count() or 1)
    return Factor(
        f"threads-{number}",
        dict.fromkeys(names, str(number)),
        THREADS.replace("{NUMBER}", f"{{{most}}}"),
        (*NUMERICAL, *PICTURES),
    )


def _vectors(bits: int) -> Factor:
    return Factor(
        f"vectors-{bits}", {"LP_NATIVE_VECTOR_WIDTH": str(bits)}, VECTORS.replace("{BITS}", str(bits)), DRAWN
    )


def factors() -> tuple[Factor, ...]:
    """Return all factors, with the worst combination last."""
    single = (
        _blas("Haswell", "avx2"),
        _blas("Prescott", "sse2"),
        _blas("SkylakeX", "avx512f", "avx512vl"),
        _numpy("numpy-no-avx512", AVX512, "avx512f"),
        _numpy("numpy-no-avx2", AVX2, "avx2"),
        _threads(1),
        _threads(2),
        _vectors(128),
        _vectors(256),
    )
    by_name = {factor.name: factor for factor in single}
    together = [by_name[n] for n in ("blas-prescott", "numpy-no-avx2", "threads-1", "vectors-128")]
    environment = {name: value for factor in together for name, value in factor.environment.items()}
    shown = "\n".join(factor.shown for factor in together)
    needs = tuple(sorted({flag for factor in together for flag in factor.needs}))
    return (*single, Factor("worst", environment, shown, (*NUMERICAL, *DRAWN), needs))


def _missing(factor: Factor) -> list[str]:
    """Return the processor features that a factor needs and that are missing."""
    try:
        flags = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").split()
    except OSError:
        return list(factor.needs)
    return [flag for flag in factor.needs if flag not in flags]


def _files(patterns: tuple[str, ...]) -> list[str]:
    return [str(path.relative_to(ROOT)) for pattern in patterns for path in sorted(ROOT.glob(pattern))]


def _shown(factor: Factor, environment: dict[str, str]) -> str:
    """Return the reason why a factor has no effect in an environment; empty if it has one."""
    command = [sys.executable, "-c", factor.shown]
    done = subprocess.run(command, env=environment, cwd=ROOT, capture_output=True, text=True, check=False)
    return (
        "" if done.returncode == 0 else (done.stderr.strip().splitlines() or ["ended without a message"])[-1]
    )


def run(factor: Factor) -> str:
    """Return ``passed`` or the failures; the tests' output goes to the terminal."""
    environment = {**os.environ, **factor.environment}
    if why := _shown(factor, environment):
        return f"has no effect: {why}"
    if not _shown(factor, dict(os.environ)):
        return "omitted: this machine already has this property, see make test"
    files = ("-n", os.environ.get("JOBS", "2"), "--dist", "loadfile", *_files(factor.tests))
    command = [sys.executable, "-m", "pytest", "-q", "-m", "not slow", *files]
    done = subprocess.run(command, env=environment, cwd=ROOT, check=False)
    return "passed" if done.returncode == 0 else f"pytest ended with {done.returncode}"


def main() -> int:
    """Run the named factors, by default all; return 1 if one does not pass."""
    known = factors()
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("factor", nargs="*", choices=[*(f.name for f in known), []], help="default: all")
    options = parser.parse_args()
    results = []
    for factor in known:
        if options.factor and factor.name not in options.factor:
            continue
        missing = _missing(factor)
        start = time.monotonic()
        print(f"\n== {factor.name}: {factor.environment}", flush=True)
        outcome = f"omitted: this processor has no {', '.join(missing)}" if missing else run(factor)
        results.append((factor.name, outcome, time.monotonic() - start))
    print()
    for name, outcome, seconds in results:
        print(f"{name:16} {seconds:6.0f} s  {outcome}")
    return int(any(outcome != "passed" and not outcome.startswith("left out") for _, outcome, _ in results))


if __name__ == "__main__":
    sys.exit(main())
