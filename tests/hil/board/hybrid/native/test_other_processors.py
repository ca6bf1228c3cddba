"""Libraries of other processors: run where an emulator is, and their exported functions looked at where none can be."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from flyaround.hil.board.hybrid.native import interface, library

ROOT = Path(__file__).parents[5]
NATIVE = Path(str(library.library_folder())).parent

# Emulator, where Debian's packages libc6-*-cross put the C library, and zig's name.
EMULATED = {
    "linux-aarch64": ("qemu-aarch64-static", "/usr/aarch64-linux-gnu", "aarch64-linux-gnu.2.17"),
    "linux-armv7": ("qemu-arm-static", "/usr/arm-linux-gnueabihf", "arm-linux-gnueabihf.2.17"),
}
BEGIN = {"dylib": b"\xcf\xfa\xed\xfe", "dll": b"MZ"}


def answers(name: str, target: str, folder: Path, *emulator: str) -> str:
    """Return checksums of the answers of one library's functions."""
    made, compiled = folder / name, NATIVE / "lib" / f"{name}.so"
    zig = [sys.executable, "-m", "ziglang", "cc", "-std=c99", "-fno-sanitize=undefined", "-target", target]
    source = ROOT / "tests" / "harness" / "known_answers.c"
    subprocess.run(
        [*zig, f"-I{NATIVE}", "-o", made, source, compiled, f"-Wl,-rpath,{compiled.parent}"], check=True
    )
    return subprocess.run([*emulator, made], check=True, capture_output=True, text=True).stdout


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize("name", EMULATED)
def test_boards_processors_give_the_same_bits(name: str, tmp_path: Path) -> None:
    pytest.importorskip("ziglang")
    emulator, system, target = EMULATED[name]
    here = library.choose_library().rsplit(".", 1)[0]
    if shutil.which(emulator) is None or not Path(system).is_dir() or not here.startswith("linux-x86_64"):
        pytest.skip(f"needs {emulator}, {system} and an x86-64 Linux machine")
    expected = answers(here, "x86_64-linux-gnu.2.17", tmp_path)
    assert len(expected.splitlines()) == 8
    assert answers(name, target, tmp_path, emulator, "-L", system) == expected


@pytest.mark.slow
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("name", ["macos-arm64", "macos-x86_64", "windows-x86_64"])
def test_libraries_that_nobody_runs_here_export_every_function(name: str) -> None:
    pytest.importorskip("ziglang")
    environment = os.environ | {"FLYAROUND_WHEEL_PLATFORM": name}
    subprocess.run([sys.executable, ROOT / "hatch_build.py"], check=True, env=environment, cwd=ROOT)
    (made,) = (NATIVE / "lib").glob(f"{name}.*")
    data = made.read_bytes()
    assert data.startswith(BEGIN[made.suffix[1:]])
    # stripped: no other names are left
    assert [f for f in interface.FUNCTIONS if f"{f}\0".encode() not in data] == []
    assert interface.checksum().encode() in data


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_no_function_reads_or_writes_beside_its_arrays(tmp_path: Path) -> None:
    """All tests of the library again, by one that stops at the first such access and at undefined arithmetic."""
    # the checks look for C++'s exceptions when they are loaded, which is before anything that throws one
    runtime = [
        subprocess.run(["cc", f"-print-file-name={name}"], capture_output=True, text=True, check=True).stdout
        for name in ("libasan.so", "libstdc++.so")
        if shutil.which("cc")
    ]
    if not runtime or not all(Path(name.strip()).is_absolute() for name in runtime):
        pytest.skip("there is no compiler with an address sanitizer")
    made = tmp_path / library.choose_library()
    flags = (
        "-std=c99 -O1 -g -ffp-contract=off -fPIC -shared -fsanitize=address,undefined -fno-sanitize-recover"
    )
    defines = ['-DFLYAROUND_SOURCES="checked"', f'-DFLYAROUND_INTERFACE="{interface.checksum()}"']
    code = sorted(NATIVE.rglob("*.c"))
    subprocess.run(["cc", *flags.split(), *defines, f"-I{NATIVE}", "-o", made, *code, "-lm"], check=True)
    environment = os.environ | {
        "FLYAROUND_TESTED_LIBRARY": str(made),
        "LD_PRELOAD": " ".join(name.strip() for name in runtime),
        "ASAN_OPTIONS": "detect_leaks=0",
    }
    here = Path(__file__).parent
    drawn = [here.parent / f"test_{name}.py" for name in ("face_rasteriser", "stages")]
    files = sorted(str(f) for f in (*here.glob("test_kernels*.py"), *drawn))
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "pytest",
            "-q",
            "-x",
            "-p",
            "tested_library",
            "-p",
            "no:cacheprovider",
            *files,
        ],
        env=environment | {"PYTHONPATH": str(ROOT / "tests" / "harness")},
        capture_output=True,
        text=True,
        check=False,
        cwd=ROOT,
    )
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
