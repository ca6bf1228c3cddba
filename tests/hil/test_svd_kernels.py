"""The C kernels: built where a compiler is, said where not, and the same answers as numpy."""

from __future__ import annotations

import shutil
import zipfile
from dataclasses import replace
from typing import TYPE_CHECKING

import msgspec
import numpy as np
import pytest

from hil.board.errors import KernelError
from hil.board.svd import BoardModel, CameraIntrinsics, PoseEstimator, shade
from hil.board.svd import quaternion as quat
from hil.board.svd.kernels import library
from simulator.targets.board_file import board_record
from simulator.targets.library import load_target

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

CAMERA = CameraIntrinsics(200, 160, 400.0, 400.0, 99.5, 79.5)

needs_compiler = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler here")


@pytest.fixture
def choose(monkeypatch: pytest.MonkeyPatch) -> Iterator[pytest.MonkeyPatch]:
    """The environment, looked at anew by this test and by the next."""
    library._loaded.cache_clear()
    yield monkeypatch
    monkeypatch.undo()
    library._loaded.cache_clear()


@pytest.fixture(scope="module")
def tango() -> BoardModel:
    return BoardModel.from_dict(msgspec.to_builtins(board_record(load_target("tango"))))


def some_pose(model: BoardModel, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Anywhere in view, now and then cut off by the picture's border."""
    t = np.array([0.0, 0.0, model.radius_m * rng.uniform(4, 12)])
    return quat.matrix(quat.normalise(rng.normal(size=4))), t + rng.normal(size=3) * model.radius_m * 0.4


@needs_compiler
def test_kernels_are_compiled_once_and_kept(choose: pytest.MonkeyPatch, tmp_path: Path) -> None:
    choose.setenv("FLYAROUND_CACHE_DIR", str(tmp_path))
    choose.setenv("FLYAROUND_KERNELS", "native")
    assert library.kernels() == "native"
    made = list((tmp_path / "kernels").iterdir())
    assert [p.suffix for p in made] == [".so"]
    when = made[0].stat().st_mtime_ns
    library._loaded.cache_clear()
    assert library.library() is not None
    assert made[0].stat().st_mtime_ns == when


def test_without_a_compiler_numpy_works_and_says_why(choose: pytest.MonkeyPatch, tmp_path: Path) -> None:
    choose.setenv("FLYAROUND_CACHE_DIR", str(tmp_path))
    choose.setenv("CC", "no-such-compiler")
    assert library.library() is None
    assert library.kernels().startswith("numpy (no C compiler was found")
    choose.setenv("CC", "false")
    library._loaded.cache_clear()
    assert "false fails" in library.kernels()
    choose.setenv("FLYAROUND_KERNELS", "numpy")
    library._loaded.cache_clear()
    assert library.kernels() == "numpy (FLYAROUND_KERNELS asks for it)"


def test_kernels_that_cannot_be_had_are_refused_in_one_sentence(
    choose: pytest.MonkeyPatch, tmp_path: Path, tango: BoardModel
) -> None:
    choose.setenv("FLYAROUND_CACHE_DIR", str(tmp_path))
    choose.setenv("FLYAROUND_KERNELS", "fast")
    with pytest.raises(KernelError, match="'fast': choose one of auto, numpy, native"):
        PoseEstimator(tango, CAMERA)
    choose.setenv("FLYAROUND_KERNELS", "native")
    choose.setenv("CC", "no-such-compiler")
    with pytest.raises(KernelError, match="no C compiler was found"):
        PoseEstimator(tango, CAMERA)


def test_an_array_of_another_kind_is_refused() -> None:
    with pytest.raises(ValueError, match="float32"):
        library.address(np.zeros((2, 3)), "float32")
    with pytest.raises(ValueError, match="float64"):
        library.address(np.zeros((4, 6))[:, ::2], "float64")
    with pytest.raises(ValueError, match="float64"):
        library.address(np.zeros((2, 3)), "float64", (3, 2))


def test_the_bundle_carries_the_sources(tmp_path: Path) -> None:
    from hil.host.bundle import write_bundle

    write_bundle(tmp_path / "board.pyz", [])
    names = zipfile.ZipFile(tmp_path / "board.pyz").namelist()
    assert {f"hil/board/svd/kernels/{name}" for name in library.SOURCES} <= set(names)


@needs_compiler
def test_polygons_are_filled_to_the_pixel_as_by_opencv() -> None:
    rng = np.random.default_rng(4)
    for k in range(300):
        middle, size = rng.uniform(-50, 250, (40, 1, 2)), rng.choice([3, 20, 60, 300, 6000])
        a = np.sort(rng.uniform(0, 2 * np.pi, (40, 4)), axis=1)
        if k % 3 == 0:
            a[:, 3] = a[:, 2]
        # slender ones cross over themselves when they are rounded to sixteenths
        p = middle + size * np.stack([np.cos(a), np.sin(a) * rng.choice([1, 0.02])], axis=-1)
        p = p[:, ::-1] if k % 2 and k % 3 else p
        some = rng.permutation(40)
        one, other = (
            fill(p, some, (180, 200), 0.5, exact=k % 5 == 0) for fill in (shade.fill_faces, shade._filled)
        )
        np.testing.assert_array_equal(one, other)


@needs_compiler
def test_faces_are_ordered_and_drawn_as_by_numpy(tango: BoardModel) -> None:
    faces, rng = tango.faces, np.random.default_rng(5)
    empty = shade.Canvas(np.zeros((64, 80), np.float32), 1.0, 10.0, 5.0, 2.2, 3, tall=1.02)
    for k in range(40):
        R, t = some_pose(tango, rng)
        order = faces._order(-R.T @ t)
        np.testing.assert_array_equal(faces.order(-R.T @ t), order)
        canvas = replace(empty, exact=bool(k % 2))
        p = (CAMERA.pixels(faces.corners[order] @ R.T + t) - (10.0, 5.0) + 0.5) * canvas.scale - 0.5
        seen = shade.draw_faces(faces, order, CAMERA, R, t, canvas)
        # a corner within a rounding of a sixteenth's middle may fall either way
        assert np.mean(seen != shade._filled(p, order, seen.shape, 0.5, exact=canvas.exact)) < 1e-4
        assert seen.any()


@needs_compiler
def test_poses_that_are_none_draw_nothing_and_harm_nothing(tango: BoardModel) -> None:
    faces = tango.faces
    canvas = shade.Canvas(np.zeros((16, 16), np.float32), 1.0, 0.0, 0.0, 1.0, 3)
    for place in ([np.nan] * 3, [0, 0, np.inf], [0, 0, -5.0], [1e30, 0, 1.0], [0, 0, 0]):
        R, t = np.eye(3), np.array(place, float)
        some = faces.order(-t)
        seen = shade.draw_faces(faces, np.arange(len(faces.corners)), CAMERA, R, t, canvas)
        assert len(some) <= len(faces.corners)
        assert seen.min() >= 0
        assert seen.max() <= len(faces.corners)
    nothing = replace(canvas, gray=np.zeros((0, 4), np.float32))
    assert shade.draw_faces(faces, np.arange(9), CAMERA, np.eye(3), np.array([0, 0, 4.0]), nothing).size == 0
