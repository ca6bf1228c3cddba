"""The compiled library: the one for this processor, checked before it is loaded, refused in one sentence."""

from __future__ import annotations

import copy
import ctypes
import importlib.util
import json
import platform
import runpy
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest

import flyaround
from flyaround.__main__ import run
from flyaround.cli.doctor import _library
from flyaround.hil.board.__main__ import main as board
from flyaround.hil.board.errors import KernelError
from flyaround.hil.board.estimation import BoardModel, CameraIntrinsics
from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.hybrid.geometry.image_patch import ImagePatch
from flyaround.hil.board.hybrid.hypotheses.hypothesis import Hypothesis, PoseFit
from flyaround.hil.board.hybrid.image.edge_field import area_mean
from flyaround.hil.board.hybrid.image.line_segments import lsd_stream
from flyaround.hil.board.hybrid.image.noise import noise_sigma
from flyaround.hil.board.hybrid.model.face_gains import shade
from flyaround.hil.board.hybrid.model.rasteriser import draw_faces, order_faces
from flyaround.hil.board.hybrid.model.shadow_map import ShadowMap, ShadowMapTable
from flyaround.hil.board.hybrid.model.visibility import occluders, sample_edges, visible_samples
from flyaround.hil.board.hybrid.native import interface, library
from flyaround.hil.board.hybrid.propose.variants import _silhouette_centroid
from flyaround.hil.board.hybrid.refine import photometric
from flyaround.hil.board.hybrid.refine.motion_images import motion_images

ROOT = Path(__file__).parents[5]
FOLDER = library.library_folder()


def build() -> object:
    """The program that compiles them."""
    spec = importlib.util.spec_from_file_location("hatch_build", ROOT / "hatch_build.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of Linux's libraries that the loader looks into."""
    place = tmp_path / "lib"
    place.mkdir()
    for path in (*FOLDER.glob("linux-*"), FOLDER / library.CHECKSUMS):
        shutil.copy(path, place)
    monkeypatch.setattr(library, "library_folder", lambda: place)
    return place


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


@pytest.mark.parametrize(
    ("header", "sentence"),
    [
        (None, "has no kernels.h"),
        (
            interface.HEADER + b"\nKERNEL unsigned int f(int a);\n",
            "cannot read the declaration of a function",
        ),
        (interface.HEADER + b"\nKERNEL const double *f(int a);\n", "f returns a pointer to double"),
    ],
)
def test_a_header_that_cannot_be_read_whole_is_refused(
    header: bytes | None, sentence: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pkgutil.get_data", lambda *_: header)
    with pytest.raises((ImportError, ValueError), match=sentence):
        runpy.run_path(interface.__file__)


def test_an_array_of_another_kind_is_refused_before_the_call() -> None:
    here = library.load_library(library.choose_library())
    seen, out = np.ones((3, 4), np.int32), np.empty(2)
    assert here.fly_mean_pixel(seen, 3, 4, out) == 12
    for wrong in (seen.astype(np.int64), np.ones((3, 8), np.int32)[:, ::2], seen.tolist(), 7, seen.T):
        with pytest.raises(ctypes.ArgumentError, match="int32"):
            here.fly_mean_pixel(wrong, 3, 4, out)
    with pytest.raises(TypeError, match="takes taps, reach"):
        interface.STRUCTURES["gaussian"](taps=None)
    kept = interface.STRUCTURES["gaussian"](taps=np.ones(3, np.float32), reach=1)
    assert copy.deepcopy(kept).values["taps"].tolist() == [1, 1, 1]
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
        # a checkout that was installed without zig has those of other processors not
        others = ", ".join(sorted(path.stem for path in folder.glob("*.so"))) or "none"
        assert f"no compiled library for linux-x86_64 (available: {others})" in refusal()
    shutil.rmtree(folder)
    assert "available: none" in refusal()


def test_a_library_of_another_platform_is_refused(folder: Path) -> None:
    others = [p for p in folder.glob("linux-a*.so") if p.name != library.choose_library()]
    if not others:
        pytest.skip("no library of another processor was compiled")
    shutil.copy(others[0], folder / library.choose_library())
    sealed(folder)
    assert "cannot be loaded" in refusal()
    (folder / library.choose_library()).write_bytes(b"no library at all")
    sealed(folder)
    assert "cannot be loaded" in refusal()


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
    assert "available: linux-" in sentence


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
        for name in ("flyaround/__init__.py", "flyaround/hil/__init__.py", f"{inner}/hybrid/__init__.py"):
            archive.writestr(name, "")
        for path in (package / "__init__.py", package / "errors.py", *(package / "hybrid/native").rglob("*")):
            if path.is_file() and path.suffix in {".py", ".h", ".so", ""}:
                archive.write(path, f"{inner}/{path.relative_to(package).as_posix()}")
    said = (
        "from flyaround.hil.board.hybrid.native import library;"
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


def sums_of_everything(model: BoardModel) -> dict[str, bytes]:
    """Return the answer of every function of the library on one scene."""
    rng = np.random.default_rng(11)
    camera = CameraIntrinsics(200, 160, 400.0, 400.0, 99.5, 79.5)
    rough = cv2.GaussianBlur(rng.uniform(0, 255, (160, 200)), (0, 0), 3.0)
    picture = cv2.normalize(rough, None, 0, 255, cv2.NORM_MINMAX).astype(np.uint8)
    q, t = quat.normalise(rng.normal(size=4)), np.array([0.05, -0.02, 6.0 * model.radius_m])
    R, faces = quat.matrix(q), model.faces
    gray = cv2.resize(picture, (101, 77)).astype(np.float32)
    patch = ImagePatch(
        gray, 2.0, 8.0, 3.0, 1.8, 2, background_level=cv2.GaussianBlur(gray, (0, 0), 6), clipped=4.0
    )
    seen = draw_faces(faces, order_faces(faces, -R.T @ t), camera, R, t, patch)
    table = ShadowMapTable.from_faces(faces, 20)
    sun = ShadowMap.from_faces(faces, np.array([0.3, 0.4, 0.8]), 96)
    shading = shade(faces, seen, patch, sun.shadows(faces, seen, patch, camera, R, t))
    moving = shading, faces, patch, camera, R, t
    craft = SimpleNamespace(model=model, camera=camera)
    gram = photometric._gram(*moving, (0.5, 2.0, 2.06), 1.0, 0.2, 16.0, 40)
    answers = {
        "seen": (
            seen,
            sun.visible_face,
            sun.height,
            shading.group,
            shading.picture,
            shading.level,
            shading.background_offset,
        ),
        "sun": (table.height, table._costs(faces, shading, *moving[2:], np.arange(20), 500)),
        "visible": visible_samples(sample_edges(model, 0.02), occluders(model), -R.T @ t),
        "middle": (_silhouette_centroid(craft, patch, Hypothesis(PoseFit(q, t), Any)),),
        "step": (motion_images(*moving), *gram, photometric.explained(shading, patch)),
        "image": (area_mean(picture, 70, 50), noise_sigma(picture, 255.0), lsd_stream(gray, 3.0)),
    }
    return {name: b"".join(np.asarray(a).tobytes() for a in arrays) for name, arrays in answers.items()}


def test_wider_instructions_change_no_bit(tango: BoardModel, monkeypatch: pytest.MonkeyPatch) -> None:
    here = [name for name in library._checksums() if name.startswith(library.choose_library()[:12])]
    if len(here) < 2:
        pytest.skip("there is one library for this processor")
    called: set[str] = set()

    def every_answer(name: str) -> dict[str, bytes]:
        loaded = library.load_library(name)
        asked = SimpleNamespace(
            **{f: (lambda *a, f=f: called.add(f) or getattr(loaded, f)(*a)) for f in interface.FUNCTIONS}
        )
        monkeypatch.setattr(library, "_load_best", lambda: (asked, name))
        return sums_of_everything(tango)

    first, *others = (every_answer(name) for name in here)
    for other in others:
        assert [part for part in first if first[part] != other[part]] == []
    assert set(interface.FUNCTIONS) - called == {"fly_sources", "fly_interface", "fly_layout"}


def test_the_default_method_is_refused_without_a_library_and_the_published_ones_run(
    no_library: None, tango: BoardModel, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    camera = {"width_px": 200, "height_px": 160, "fx_px": 400.0, "fy_px": 400.0, "cx_px": 99.5, "cy_px": 79.5}
    (tmp_path / "camera.json").write_text(json.dumps(camera))
    picture = np.zeros((160, 200), np.uint8)
    cv2.fillConvexPoly(picture, np.array([[60, 40], [150, 50], [140, 120], [70, 110]]), 180)
    cv2.imwrite(str(tmp_path / "a.png"), picture)
    given = ["estimate", str(tmp_path / "a.png"), "--camera", str(tmp_path / "camera.json")]
    for more in (
        (),
        ("--method", "hybrid-track"),
    ):
        assert run([*given, *more]) == 2
        told = capsys.readouterr().err
        assert told.startswith("flyaround: the estimator has no compiled library for ")
        assert "(available: none)" in told
        assert "svd-2018 and svd-thesis (--method) need no library" in told
        assert len(told.splitlines()) == 1
    for more in (
        ("--method", "svd-2018"),
        ("--method", "svd-thesis"),
        ("--method", "svd-2018", "--streams", "wge,sh,lsd,harris"),
        ("--method", "svd-thesis", "--streams", "wge,sh,ellipse"),
    ):
        assert run([*given, *more, "--json"]) in (0, 1)
        said = json.loads(capsys.readouterr().out)
        assert said["kernels"].startswith("none (the estimator has no compiled library")
        assert "internal" not in said["reason"]
    assert board(["tcp://127.0.0.1:9", "--model", str(tmp_path / "x.json")]) == 2
    assert "no compiled library" in capsys.readouterr().err
    finding = _library()
    assert not finding.ok
    assert not finding.required
    assert "no compiled library" in finding.advice


def test_doctor_says_what_is_loaded() -> None:
    finding = _library()
    assert finding.ok
    assert finding.found == f"native ({library.choose_library()})"
