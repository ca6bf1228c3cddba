"""The C kernels: built where a compiler is, said where not, and the same answers as numpy."""

from __future__ import annotations

import inspect
import os
import re
import subprocess
import sys
import zipfile
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import msgspec
import numpy as np
import pytest

from flyaround.hil.board.errors import KernelError
from flyaround.hil.board.svd import BoardModel, CameraIntrinsics, PoseEstimator
from flyaround.hil.board.svd.geometry import quaternion as quat
from flyaround.hil.board.svd.hypotheses.hypothesis import Hypothesis, PoseFit
from flyaround.hil.board.svd.model import rasteriser as shade
from flyaround.hil.board.svd.model.face_gains import shade as shaded
from flyaround.hil.board.svd.model.rasteriser import order_faces
from flyaround.hil.board.svd.model.shadow_map import ShadowMap, ShadowMapTable
from flyaround.hil.board.svd.model.visibility import occluders, sample_edges, visible_samples
from flyaround.hil.board.svd.native import arrays, backend, compiler
from flyaround.hil.board.svd.native.learned.attitude_likelihood import likelihood
from flyaround.hil.board.svd.propose.learned.attitude_basis import even_attitudes, turning_bumps
from flyaround.hil.board.svd.propose.learned.learned_proposal import network_for
from flyaround.hil.board.svd.propose.learned.network_input import ImageCrop, network_inputs
from flyaround.hil.board.svd.propose.learned.view_subspaces import HARMONICS, _circle
from flyaround.hil.board.svd.propose.variants import _middle
from flyaround.hil.board_model.write import board_record
from flyaround.hil.evaluate.metrics import compose, summarise
from flyaround.simulator.targets.library import load_target

CAMERA = CameraIntrinsics(200, 160, 400.0, 400.0, 99.5, 79.5)

needs_compiler = pytest.mark.usefixtures("native_kernels")


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
    assert backend.describe_backend() == "native"
    made = list((tmp_path / "kernels").iterdir())
    assert [p.suffix for p in made] == [".so"]
    when = made[0].stat().st_mtime_ns
    backend._loaded.cache_clear()
    assert backend.native_library() is not None
    assert made[0].stat().st_mtime_ns == when


def test_without_a_compiler_numpy_works_and_says_why(choose: pytest.MonkeyPatch, tmp_path: Path) -> None:
    choose.setenv("FLYAROUND_CACHE_DIR", str(tmp_path))
    choose.delenv("FLYAROUND_KERNELS", raising=False)
    choose.setenv("CC", "no-such-compiler")
    assert backend.native_library() is None
    assert backend.describe_backend().startswith("numpy (no C compiler was found")
    choose.setenv("CC", "false")
    backend._loaded.cache_clear()
    assert "false fails" in backend.describe_backend()
    choose.setenv("FLYAROUND_KERNELS", "numpy")
    backend._loaded.cache_clear()
    assert backend.describe_backend() == "numpy (FLYAROUND_KERNELS asks for it)"


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


def test_who_asks_is_told_what_runs(
    choose: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from flyaround.__main__ import run
    from flyaround.cli.doctor import _kernels
    from flyaround.hil.board.__main__ import main

    choose.setenv("FLYAROUND_KERNELS", "numpy")
    assert (
        compose([summarise([])], backend.describe_backend()).kernels
        == "numpy (FLYAROUND_KERNELS asks for it)"
    )
    assert not _kernels().ok
    backend._loaded.cache_clear()
    choose.setenv("FLYAROUND_KERNELS", "slow")
    assert "choose one of" in _kernels().advice
    pinhole = {key: value for key, value in vars(CAMERA).items() if not key.startswith("distortion")}
    (tmp_path / "camera.json").write_bytes(msgspec.json.encode(pinhole))
    cv2.imwrite(str(tmp_path / "a.png"), np.arange(32000, dtype=np.uint8).reshape(160, 200))
    camera = str(tmp_path / "camera.json")
    assert run(["estimate", str(tmp_path / "a.png"), "--target", "tango", "--camera", camera]) == 2
    assert "'slow': choose one of auto, numpy, native" in capsys.readouterr().err
    assert main(["tcp://127.0.0.1:9", "--model", str(tmp_path / "x.json")]) == 2
    assert "'slow': choose one of auto, numpy, native" in capsys.readouterr().err


def test_an_array_of_another_kind_is_refused() -> None:
    with pytest.raises(ValueError, match="float32"):
        arrays.checked_pointer(np.zeros((2, 3)), "float32")
    kept = np.arange(6.0)
    kept.flags.writeable = False
    assert arrays.checked_pointer(kept, "float64") == kept.ctypes.data
    assert arrays.checked_pointer(kept.reshape(2, 3), "float64") == kept.ctypes.data
    fresh = np.zeros((3, 2))
    assert arrays.checked_pointer(fresh, "float64", (3, 2)) == fresh.ctypes.data
    assert arrays.checked_pointer(np.zeros((0, 3)), "float64", (0, 3)) >= 0
    with pytest.raises(ValueError, match="float64"):
        arrays.checked_pointer(np.zeros((4, 6))[:, ::2], "float64")
    with pytest.raises(ValueError, match="float64"):
        arrays.checked_pointer(np.zeros((2, 3)), "float64", (3, 2))


def test_the_bundle_carries_the_sources(tmp_path: Path) -> None:
    from flyaround.hil.host.bundle import write_bundle

    write_bundle(tmp_path / "board.pyz", [])
    names = zipfile.ZipFile(tmp_path / "board.pyz").namelist()
    assert {f"hil/board/svd/native/{name}" for name in compiler.SOURCES} <= set(names)


@needs_compiler
def test_each_c_function_stands_behind_a_numpy_function_of_the_same_arguments() -> None:
    def arguments(function: object) -> list[str]:
        return list(inspect.signature(function).parameters)

    assert len(backend.TWINS) >= 17
    calls = set()
    for name, twin in backend.TWINS.items():
        assert len(arguments(twin.native)) == len(arguments(twin.reference)) + 1, name
        assert twin.native.__module__.startswith("flyaround.hil.board.svd.native."), name
        assert not twin.reference.__module__.startswith("flyaround.hil.board.svd.native."), name
        calls.add(Path(inspect.getfile(twin.native)))
    # every file that calls C has a twin in it, and what it calls was compiled
    native = Path(backend.__file__).parent
    asked = {p: set(re.findall(r"library\.(fly_\w+)", p.read_text())) for p in native.rglob("*.py")}
    assert {path for path, names in asked.items() if names} <= calls
    assert all(hasattr(backend.native_library(), name) for names in asked.values() for name in names)


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
            fill(p, some, (180, 200), 0.5, exact=k % 5 == 0)
            for fill in (shade.fill_faces, shade.fill_faces.reference)
        )
        np.testing.assert_array_equal(one, other)


@needs_compiler
def test_faces_are_ordered_and_drawn_as_by_numpy(tango: BoardModel) -> None:
    faces, rng = tango.faces, np.random.default_rng(5)
    empty = shade.ImagePatch(np.zeros((64, 80), np.float32), 1.0, 10.0, 5.0, 2.2, 3, tall=1.02)
    for k in range(40):
        R, t = some_pose(tango, rng)
        order = order_faces.reference(faces, -R.T @ t)
        np.testing.assert_array_equal(order_faces(faces, -R.T @ t), order)
        canvas = replace(empty, exact=bool(k % 2))
        p = (CAMERA.pixels(faces.corners[order] @ R.T + t) - (10.0, 5.0) + 0.5) * canvas.scale - 0.5
        seen = shade.draw_faces(faces, order, CAMERA, R, t, canvas)
        # a corner within a rounding of a sixteenth's middle may fall either way
        assert (
            np.mean(seen != shade.fill_faces.reference(p, order, seen.shape, 0.5, exact=canvas.exact)) < 1e-4
        )
        assert seen.any()


def by_numpy(choose: pytest.MonkeyPatch) -> None:
    """From here on numpy does everything."""
    choose.setenv("FLYAROUND_KERNELS", "numpy")
    backend._loaded.cache_clear()


@needs_compiler
@pytest.mark.parametrize("kind", [np.int32, np.uint16])
def test_the_suns_pictures_and_shadows_are_numpys(
    tango: BoardModel, choose: pytest.MonkeyPatch, kind: type
) -> None:
    faces, rng = tango.faces, np.random.default_rng(6)
    canvas = shade.ImagePatch(np.zeros((100, 120), np.float32), 1.0, 10.0, 5.0, 1.6, 2, tall=1.02)
    poses = [some_pose(tango, rng) for _ in range(8)]
    suns = rng.normal(size=(8, 3))
    seen = [shade.draw_faces(faces, order_faces(faces, -R.T @ t), CAMERA, R, t, canvas) for R, t in poses]

    def drawn() -> list[tuple[ShadowMap, np.ndarray]]:
        of = [ShadowMap.of(faces, d, 96) for d in suns]
        of = [replace(s, seen=s.seen.astype(kind)) for s in of]
        return [
            (s, s.shadows(faces, one, canvas, CAMERA, R, t))
            for s, one, (R, t) in zip(of, seen, poses, strict=True)
        ]

    native = drawn()
    by_numpy(choose)
    differ = shaded_px = 0
    for (one, dark), (other, reference) in zip(native, drawn(), strict=True):
        np.testing.assert_allclose(one.height, other.height, atol=2e-6)
        assert np.mean(one.seen != other.seen) < 1e-4
        differ, shaded_px = differ + int((dark != reference).sum()), shaded_px + int(reference.sum())
    assert shaded_px > 2000
    assert differ <= 1e-3 * shaded_px


@needs_compiler
@pytest.mark.parametrize("pixels", [60, 500, 10**6])
def test_the_sun_is_sought_as_by_numpy(tango: BoardModel, choose: pytest.MonkeyPatch, pixels: int) -> None:
    faces, rng = tango.faces, np.random.default_rng(7)
    table = ShadowMapTable.of(faces, 60)
    empty = shade.ImagePatch(rng.uniform(0, 90, (100, 120)).astype(np.float32), 1.0, 10.0, 5.0, 1.6, 2)
    for grouped in (faces, faces.grouped(40)):
        # bytes number few groups, two of them many
        R, t = some_pose(tango, rng)
        canvas = replace(empty)
        seen = shade.draw_faces(grouped, order_faces(grouped, -R.T @ t), CAMERA, R, t, canvas)
        shading, some = shaded(grouped, seen, canvas), np.arange(3, 60, 2)
        costs = [table._costs(grouped, shading, canvas, CAMERA, R, t, some, pixels)]
        found = [table.find(grouped, shading, canvas, CAMERA, R, t, 4, pixels)]
        by_numpy(choose)
        costs.append(table._costs(grouped, shading, canvas, CAMERA, R, t, some, pixels))
        found.append(table.find(grouped, shading, canvas, CAMERA, R, t, 4, pixels))
        every = table._costs(grouped, shading, canvas, CAMERA, R, t, np.arange(60), pixels)
        choose.delenv("FLYAROUND_KERNELS")
        backend._loaded.cache_clear()
        np.testing.assert_allclose(costs[0], costs[1], rtol=1e-5)
        # of directions that leave as much either may be named
        left = [every[by] for by in found]
        np.testing.assert_allclose(left[0], left[1], rtol=1e-5)
    nothing = replace(shading, area=np.zeros_like(shading.area))
    assert table.find(grouped, nothing, canvas, CAMERA, R, t, 4, pixels) == []


@needs_compiler
def test_the_middle_of_what_is_seen_is_numpys(tango: BoardModel, choose: pytest.MonkeyPatch) -> None:
    craft = SimpleNamespace(model=tango, camera=CAMERA)
    canvas = shade.ImagePatch(np.zeros((64, 80), np.float32), 1.0, 10.0, 5.0, 2.2, 3)
    poses = [
        Hypothesis(PoseFit(np.array([0.5, 0.5, -0.5, 0.5]), np.array([x, 0.1, 4.0])), Any) for x in (0.2, 9.0)
    ]
    native = [_middle(craft, canvas, c) for c in poses]
    by_numpy(choose)
    np.testing.assert_allclose(native, [_middle(craft, canvas, c) for c in poses], atol=1e-3)
    assert np.isnan(native[1]).all()


@needs_compiler
@pytest.mark.parametrize("radius_m", [0.0, 0.02])
def test_what_hides_the_wireframe_is_numpys(tango: BoardModel, radius_m: float) -> None:
    samples, occ, rng = sample_edges(tango, 0.01), occluders(tango), np.random.default_rng(9)
    # round members besides: their outline lies beside them
    samples = replace(samples, radius_m=np.where(samples.edge % 3 == 0, radius_m, samples.radius_m))
    differ = hidden = 0
    for _ in range(12):
        R, t = some_pose(tango, rng)
        ours, reference = (
            see(samples, occ, -R.T @ t) for see in (visible_samples, visible_samples.reference)
        )
        np.testing.assert_array_equal(ours[1], reference[1])
        differ += int((ours[0] != reference[0]).sum())
        hidden += int((~reference[0]).sum())
    assert hidden > 2000
    # a sample on a hiding part's very edge may fall either way
    assert differ <= 1e-3 * hidden
    for place in ([np.nan] * 3, [np.inf, 0, 0], [0, 0, 0]):
        assert len(visible_samples(samples, occ, np.array(place, float))[0]) == len(samples)


@pytest.mark.slow
@needs_compiler
def test_wider_instructions_change_no_bit(
    tango: BoardModel, choose: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    if not compiler._simd_flags():
        pytest.skip("this processor has none")
    choose.setenv("FLYAROUND_CACHE_DIR", str(tmp_path))
    faces, (R, t) = tango.faces, some_pose(tango, np.random.default_rng(11))
    net, bumps = network_for(tango), turning_bumps(even_attitudes(5))
    assert net is not None
    picture = cv2.GaussianBlur(np.random.default_rng(2).uniform(0, 255, (160, 200)), (0, 0), 3.0).astype(
        np.uint8
    )
    said = np.random.default_rng(3).normal(0, 4, (4, 768)).astype(np.float32)
    canvas = shade.ImagePatch(np.zeros((100, 120), np.float32), 1.0, 10.0, 5.0, 1.6, 2, tall=1.02)

    def answers() -> list[bytes]:
        backend._loaded.cache_clear()
        seen = shade.draw_faces(faces, order_faces(faces, -R.T @ t), CAMERA, R, t, canvas)
        sun = ShadowMap.of(faces, np.array([0.3, 0.4, 0.8]), 96)
        dark = sun.shadows(faces, seen, canvas, CAMERA, R, t)
        samples, native = sample_edges(tango, 0.02), backend.native_library()
        visible, _ = visible_samples(samples, occluders(tango), -R.T @ t)
        assert native is not None
        likely = likelihood(native, bumps, said, HARMONICS, _circle())
        looks = network_inputs(picture, 2.0, CAMERA, [ImageCrop.at(CAMERA, 90.0, 70.0, 80.0)])
        return [a.tobytes() for a in (seen, sun.height, dark, visible, likely, looks, *net(looks))]

    wide = answers()
    choose.setattr(compiler, "_simd_flags", lambda: ())
    assert answers() == wide
    assert len(list((tmp_path / "kernels").iterdir())) == 2


@needs_compiler
def test_poses_that_are_none_draw_nothing_and_harm_nothing(tango: BoardModel) -> None:
    faces = tango.faces
    canvas = shade.ImagePatch(np.zeros((16, 16), np.float32), 1.0, 0.0, 0.0, 1.0, 3)
    sun = ShadowMap.of(faces, np.array([0.2, 0.3, 0.9]), 64)
    for place in ([np.nan] * 3, [0, 0, np.inf], [0, 0, -5.0], [1e30, 0, 1.0], [0, 0, 0]):
        R, t = np.eye(3), np.array(place, float)
        some = order_faces(faces, -t)
        seen = shade.draw_faces(faces, np.arange(len(faces.corners)), CAMERA, R, t, canvas)
        assert len(some) <= len(faces.corners)
        assert seen.min() >= 0
        assert seen.max() <= len(faces.corners)
        # whatever a picture holds: numbers of faces that are not there
        wild = np.full_like(seen, 2**31 - 1)
        wild[::2] = -5
        dark = sun.shadows(faces, wild, canvas, CAMERA, R, t)
        assert not dark.any()
        sun.shadows(faces, np.maximum(seen, 1), canvas, CAMERA, R, t)
    nothing = replace(canvas, gray=np.zeros((0, 4), np.float32))
    assert shade.draw_faces(faces, np.arange(9), CAMERA, np.eye(3), np.array([0, 0, 4.0]), nothing).size == 0


@pytest.mark.slow
@needs_compiler
@pytest.mark.timeout(900)
def test_no_kernel_reads_or_writes_beside_its_arrays(tmp_path: Path) -> None:
    """All tests of the kernels again, by ones that stop at the first such access and at undefined arithmetic."""
    compiler = tmp_path / "checked-cc"
    compiler.write_text('#!/bin/sh\nexec cc -g -fsanitize=address,undefined -fno-sanitize-recover "$@"\n')
    compiler.chmod(0o755)
    # the checks look for C++'s exceptions when they are loaded, which is before anything that throws one
    runtime = [
        subprocess.run(["cc", f"-print-file-name={name}"], capture_output=True, text=True, check=True).stdout
        for name in ("libasan.so", "libstdc++.so")
    ]
    if not all(Path(name.strip()).is_absolute() for name in runtime):
        pytest.skip("this compiler has no address sanitizer")
    environment = os.environ | {
        "CC": str(compiler),
        "FLYAROUND_CACHE_DIR": str(tmp_path / "cache"),
        "LD_PRELOAD": " ".join(name.strip() for name in runtime),
        "ASAN_OPTIONS": "detect_leaks=0",
    }
    asked = "from flyaround.hil.board.svd.native.backend import describe_backend; print(describe_backend())"
    told = subprocess.run(
        [sys.executable, "-c", asked], env=environment, capture_output=True, text=True, check=True
    )
    assert told.stdout.strip() == "native", told.stderr
    files = sorted(str(f) for f in Path(__file__).parent.glob("test_kernels*.py"))
    # what compiles them once more does not finish in time on a busy machine
    which = ["-m", "not slow", "-k", "not compiled_once", "-p", "no:cacheprovider"]
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-x", *which, *files],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
