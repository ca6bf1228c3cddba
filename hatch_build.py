"""Compile the estimator's C into the shared libraries that wheels and board.pyz carry.

hatchling runs it for every wheel and editable install; ``python hatch_build.py`` does the same in a checkout. With
ziglang installed it compiles for all Linux processors that boards have, and for ``FLYAROUND_WHEEL_PLATFORM`` where that
names another platform; with a C compiler alone, for this machine.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import platform
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

PLATFORM_VARIABLE = "FLYAROUND_WHEEL_PLATFORM"

NATIVE = Path("flyaround/hil/board/hybrid/native")

CHECKSUMS = "SHA256SUMS"

# Sums stay in order and products are not fused, so that every processor computes the same bits.
FLAGS = (
    "-std=c99",
    "-O3",
    "-ffp-contract=off",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-fno-sanitize=undefined",
    "-fvisibility=hidden",
    "-fPIC",
    "-shared",
    "-s",
)


class Variant(NamedTuple):
    """One library of a platform.

    Parameters
    ----------
    name : of its file, with the ending. target : zig's triple. cpu : zig's name of the least processor, or its default.
    flags : for any compiler.
    """

    name: str
    target: str
    cpu: str = ""
    flags: tuple[str, ...] = ()


class Platform(NamedTuple):
    """A platform that wheels are made for.

    Parameters
    ----------
    tag : of its wheel. variants : its libraries, for any processor first.
    """

    tag: str
    variants: tuple[Variant, ...]


# glibc of 2012 and macOS of 2020: older than those of any numpy 2 wheel.
PLATFORMS = {
    "linux-x86_64": Platform(
        "manylinux_2_17_x86_64",
        (
            Variant("linux-x86_64.so", "x86_64-linux-gnu.2.17"),
            Variant("linux-x86_64-avx2.so", "x86_64-linux-gnu.2.17", flags=("-mavx2",)),
        ),
    ),
    "linux-aarch64": Platform(
        "manylinux_2_17_aarch64", (Variant("linux-aarch64.so", "aarch64-linux-gnu.2.17"),)
    ),
    "linux-armv7": Platform(
        "manylinux_2_17_armv7l",
        # NEON flushes denormal numbers to zero; without it the answers are IEEE's
        (Variant("linux-armv7.so", "arm-linux-gnueabihf.2.17", "generic+v7a+vfp3d16"),),
    ),
    "macos-x86_64": Platform("macosx_11_0_x86_64", (Variant("macos-x86_64.dylib", "x86_64-macos.11.0"),)),
    "macos-arm64": Platform("macosx_11_0_arm64", (Variant("macos-arm64.dylib", "aarch64-macos.11.0"),)),
    "windows-x86_64": Platform("win_amd64", (Variant("windows-x86_64.dll", "x86_64-windows-gnu"),)),
}

# Processors of boards: board.pyz carries the libraries of these.
BOARDS = ("linux-x86_64", "linux-aarch64", "linux-armv7")


class CompileHook(BuildHookInterface):  # type: ignore[type-arg]
    """Puts the libraries into the wheel and tags it with its platform."""

    PLUGIN_NAME = "custom"

    def dependencies(self) -> list[str]:
        """Ziglang where this machine's compiler is missing or cannot make what is requested."""
        return [] if os.environ.get(PLATFORM_VARIABLE) is None and c_compiler() else ["ziglang"]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile; an editable install finds the libraries in the checkout."""
        wanted = wheel_platform()
        files = compile_libraries(Path(self.root), wanted)
        build_data["pure_python"] = False
        build_data["tag"] = f"py3-none-{wheel_tag(wanted)}"
        if version != "editable":
            build_data["force_include"].update({str(file): str(NATIVE / "lib" / file.name) for file in files})


def wheel_platform() -> str:
    """Name of the platform that the wheel is for: what the environment asks for, else this machine's."""
    wanted = os.environ.get(PLATFORM_VARIABLE) or this_platform()
    if wanted not in PLATFORMS:
        raise SystemExit(
            f"no wheel can be made for {wanted!r}: set {PLATFORM_VARIABLE} to one of {', '.join(PLATFORMS)}"
        )
    return wanted


def this_platform() -> str:
    """Operating system and processor of the Python that runs this, as ``PLATFORMS`` names them."""
    system = {"linux": "linux", "darwin": "macos", "win32": "windows"}.get(sys.platform, sys.platform)
    machine = platform.machine().lower()
    machine = {"amd64": "x86_64", "arm64": "arm64" if system == "macos" else "aarch64"}.get(machine, machine)
    if system == "linux" and machine in {"armv7l", "armv8l", "aarch64"} and sys.maxsize < 2**32:
        machine = "armv7"
    return f"{system}-{machine}"


def wheel_tag(wanted: str) -> str:
    """Platform tag: of old systems, too, where zig pins their libc, else of this machine's own."""
    tag = PLATFORMS[wanted].tag
    return tag if zig() or not tag.startswith("manylinux") else tag.replace("manylinux_2_17", "linux")


def zig() -> tuple[str, ...]:
    """Zig's C compiler, from the package ziglang; empty without it."""
    return (sys.executable, "-m", "ziglang", "cc") if importlib.util.find_spec("ziglang") else ()


def c_compiler() -> tuple[str, ...]:
    """Return the installed C compiler, ``cc`` or that named by CC; empty if there is none."""
    found = shutil.which(os.environ.get("CC") or "cc")
    return (found,) if found else ()


def compile_libraries(root: Path, wanted: str) -> list[Path]:
    """Compile whatever is not up to date; return the libraries of ``wanted`` and of boards, and their checksums.

    Parameters
    ----------
    root : folder of the sources, a checkout or an unpacked sdist.
    """
    native = root / NATIVE
    compiler = zig()
    names = dict.fromkeys((wanted, *BOARDS))
    if not compiler:
        compiler, names = c_compiler(), dict.fromkeys((wanted,))
        if not compiler or wanted != this_platform():
            raise SystemExit(f"a library for {wanted} needs zig: pip install ziglang")
    (native / "lib").mkdir(exist_ok=True)
    variants = [variant for name in names for variant in PLATFORMS[name].variants]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        files = list(pool.map(lambda variant: compile_library(native, variant, compiler), variants))
    return [*files, write_checksums(native / "lib")]


def compile_library(native: Path, variant: Variant, compiler: tuple[str, ...]) -> Path:
    """Compile one library unless the one that is there was made from the same sources in the same way."""
    file = native / "lib" / variant.name
    flags = compiler_flags(variant, compiler)
    sources = variant_checksum(native, variant, compiler)
    if file.is_file() and sources.encode() in file.read_bytes():
        return file
    interface = hashlib.sha256(_text(native / "kernels.h")).hexdigest()
    defines = (f'-DFLYAROUND_SOURCES="{sources}"', f'-DFLYAROUND_INTERFACE="{interface}"', f"-I{native}")
    code = [str(path) for path in sorted(native.rglob("*.c"))]
    with tempfile.TemporaryDirectory(dir=file.parent) as folder:
        made = Path(folder) / variant.name
        command = (*compiler, *flags, *defines, "-o", str(made), *code, "-lm")
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise SystemExit(
                f"{variant.name} cannot be compiled: {done.stderr.strip() or done.stdout.strip()}"
            )
        made.replace(file)
    return file


def compiler_flags(variant: Variant, compiler: tuple[str, ...]) -> tuple[str, ...]:
    """Return the flags of one library."""
    target = ("-target", variant.target) if compiler == zig() else ()
    cpu = (f"-mcpu={variant.cpu}",) if target and variant.cpu else ()
    return (*FLAGS, *target, *cpu, *variant.flags)


def variant_checksum(native: Path, variant: Variant, compiler: tuple[str, ...]) -> str:
    """Checksum of the C, and of how it is compiled."""
    flags = compiler_flags(variant, compiler)
    files = sorted(path for kind in ("*.c", "*.h") for path in native.rglob(kind))
    texts = [(path.relative_to(native).as_posix(), _text(path)) for path in files]
    return hashlib.sha256(repr((texts, flags)).encode()).hexdigest()


def write_checksums(folder: Path) -> Path:
    """Write the checksums of all libraries in a folder, as ``sha256sum`` does."""
    files = sorted(path for path in folder.iterdir() if path.suffix in {".so", ".dylib", ".dll"})
    rows = [f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n" for path in files]
    (folder / CHECKSUMS).write_text("".join(rows), encoding="utf-8", newline="\n")
    return folder / CHECKSUMS


def _text(path: Path) -> bytes:
    """Contents with Unix line ends: checkouts on Windows may have others."""
    return path.read_bytes().replace(b"\r\n", b"\n")


if __name__ == "__main__":
    for path in compile_libraries(Path(__file__).parent, wheel_platform()):
        print(path)  # noqa: T201 - a program
