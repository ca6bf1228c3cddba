"""Programs in C of the tests and examples, compiled with every warning an error."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
COMPILER = shutil.which("gcc") or shutil.which("cc")
FLAGS = [
    "-std=c99",
    "-Wall",
    "-Wextra",
    "-Werror",
    "-O1",
    "-fsanitize=undefined,address",
    "-fno-sanitize-recover",
]


def compiled(source: Path, folder: Path, *flags: str) -> Path:
    """The program of a source beside the protocol's header; the test is skipped without a compiler."""
    if COMPILER is None:
        pytest.skip("no C compiler on this machine: install gcc to run this")
    program = folder / source.stem
    command = [COMPILER, *FLAGS, *flags, "-I", str(ROOT / "docs"), str(source), "-o", str(program), "-lm"]
    subprocess.run(command, check=True, timeout=120)
    return program
