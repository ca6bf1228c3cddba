"""The compiled library: the one for this processor, checked before it is loaded, refused in one sentence."""

from __future__ import annotations

import importlib.util
import platform
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

import flyaround
from flyaround.hil.board.errors import KernelError
from flyaround.hil.board.svd.native import interface, library

ROOT = Path(__file__).parents[5]
FOLDER = library.library_folder()


def build() -> object:
    """The program that compiles them."""
    spec = importlib.util.spec_from_file_location("hatch_build", ROOT / "hatch_build.py")
    assert spec is not None
    assert spec.loader is not None
    module = sys.modules["hatch_build"] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of Linux's libraries that the loader looks into."""
    copy = tmp_path / "lib"
    copy.mkdir()
    for path in (*FOLDER.glob("linux-*"), FOLDER / library.CHECKSUMS):
        shutil.copy(path, copy)
    monkeypatch.setattr(library, "library_folder", lambda: copy)
    return copy


def sealed(folder: Path) -> None:
    """Make the files of a folder those that were installed."""
    build().write_checksums(folder)


def refusal() -> str:
    with pytest.raises(KernelError) as told:
        library.load_library(library.choose_library())
    sentence = str(told.value)
    assert "\n" not in sentence
    assert "svd-2018" in sentence
    return sentence


def test_the_library_here_is_made_of_the_sources_here() -> None:
    made = build()
    name = library.choose_library()
    (variant,) = (v for p in made.PLATFORMS.values() for v in p.variants if v.name == name)
    told = library.load_library(name).fly_sources().decode()
    compilers = [c for c in (made.zig(), made.c_compiler()) if c]
    assert told in [made.variant_checksum(FOLDER.parent, variant, c) for c in compilers], (
        "the C has changed: run `python hatch_build.py`"
    )


def test_each_structure_has_the_size_and_offsets_of_c() -> None:
    here = library.load_library(library.choose_library())
    expected = interface.layout()
    offsets = np.zeros(len(expected) + 5, np.int64)
    assert here.fly_layout(offsets, len(offsets)) == len(expected)
    assert offsets[: len(expected)].tolist() == expected
    assert here.fly_interface().decode() == interface.checksum()


def test_an_array_of_another_kind_is_refused_before_the_call() -> None:
    with pytest.raises(TypeError, match="takes taps, reach"):
        interface.STRUCTURES["gaussian"](taps=None)
    kept = interface.STRUCTURES["gaussian"](taps=np.ones(3, np.float32), reach=1)
    assert kept.arrays[0].dtype == np.float32
    with pytest.raises(TypeError, match="float32"):
        interface.STRUCTURES["gaussian"](taps=np.ones(3), reach=1)


@pytest.mark.parametrize("cut", [0, 1, 64, 5000, -1])
def test_a_truncated_library_is_not_loaded(folder: Path, cut: int) -> None:
    path = folder / library.choose_library()
    path.write_bytes(path.read_bytes()[:cut])
    assert "is damaged" in refusal()


def test_a_library_that_was_changed_or_taken_away_is_not_loaded(folder: Path) -> None:
    name = library.choose_library()
    data = bytearray((folder / name).read_bytes())
    data[len(data) // 2] ^= 1
    (folder / name).write_bytes(bytes(data))
    assert "is damaged" in refusal()
    for path in folder.glob("linux-x86_64*"):
        path.unlink()
    if platform.machine() == "x86_64":
        assert "no compiled library for linux-x86_64 (there are: linux-aarch64, linux-armv7)" in refusal()
    shutil.rmtree(folder)
    assert "there are: none" in refusal()


def test_a_library_of_another_platform_is_refused(folder: Path) -> None:
    others = [p for p in folder.glob("linux-a*.so") if p.name != library.choose_library()]
    if not others:
        pytest.skip("no library of another processor was compiled")
    shutil.copy(others[0], folder / library.choose_library())
    sealed(folder)
    assert "does not load here" in refusal()
    (folder / library.choose_library()).write_bytes(b"no library at all")
    sealed(folder)
    assert "does not load here" in refusal()


@pytest.mark.parametrize(
    ("system", "machine", "bits", "says"),
    [
        ("linux", "riscv64", 64, "for linux-riscv64 ("),
        ("linux", "armv6l", 32, "for linux-armv6l (32 bits) ("),
        ("linux", "i686", 32, "for linux-i686 (32 bits) ("),
        ("linux", "", 64, "for linux- ("),
        ("freebsd14", "amd64", 64, "for freebsd14-x86_64 ("),
        ("darwin", "arm64", 64, "for macos-arm64 ("),
        ("win32", "ARM64", 64, "for windows-aarch64 ("),
    ],
)
def test_an_unknown_processor_is_told_which_there_are(
    monkeypatch: pytest.MonkeyPatch, folder: Path, system: str, machine: str, bits: int, says: str
) -> None:
    monkeypatch.setattr(library.sys, "platform", system)
    monkeypatch.setattr(library.sys, "maxsize", 2 ** (bits - 1) - 1)
    monkeypatch.setattr(library.platform, "machine", lambda: machine)
    sentence = refusal()
    assert says in sentence
    assert "there are: linux-" in sentence


@pytest.mark.parametrize("machine", ["armv7l", "armv8l", "aarch64"])
def test_a_32_bit_python_on_any_arm_kernel_gets_the_32_bit_library(
    monkeypatch: pytest.MonkeyPatch, folder: Path, machine: str
) -> None:
    (folder / "linux-armv7.so").write_bytes(b"")
    sealed(folder)
    monkeypatch.setattr(library.sys, "platform", "linux")
    monkeypatch.setattr(library.sys, "maxsize", 2**31 - 1)
    monkeypatch.setattr(library.platform, "machine", lambda: machine)
    assert library.choose_library() == "linux-armv7.so"


def test_a_library_of_another_version_is_refused(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(library, "checksum", lambda: "0" * 64)
    assert "belongs to another version" in refusal()
    monkeypatch.undo()
    monkeypatch.setattr(library, "layout", lambda: [*interface.layout(), 8])
    assert "belongs to another version" in refusal()


def test_it_is_loaded_out_of_a_zip(tmp_path: Path) -> None:
    package = Path(flyaround.__path__[0]) / "hil" / "board"
    inner = "flyaround/hil/board"
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        for name in ("flyaround/__init__.py", "flyaround/hil/__init__.py", f"{inner}/svd/__init__.py"):
            archive.writestr(name, "")
        for path in (package / "__init__.py", package / "errors.py", *(package / "svd/native").rglob("*")):
            if path.is_file() and path.suffix in {".py", ".h", ".so", ""}:
                archive.write(path, f"{inner}/{path.relative_to(package).as_posix()}")
    said = (
        "from flyaround.hil.board.svd.native import library;"
        "print(type(library.library_folder()).__name__, library.describe_library())"
    )
    blocked = f"import os; del os.memfd_create; {said}"
    for program in (said, blocked):
        done = subprocess.run(
            [sys.executable, "-I", "-c", f"import sys; sys.path.insert(0, 'a.zip'); {program}"],
            capture_output=True,
            text=True,
            check=True,
            cwd=tmp_path,
            env={"TMPDIR": str(tmp_path), "PATH": ""},
        )
        assert done.stdout.strip() == f"Path native ({library.choose_library()})"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.zip"]
