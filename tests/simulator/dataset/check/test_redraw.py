"""What only drawing again, or working out again by other means, can tell: images, shares, states and boxes."""

import dataclasses
import itertools
import json
import shutil

import cv2
import msgspec
import numpy as np
import pytest
from small_flight import small_flight
from typer.testing import CliRunner

from flyaround.cli.app import app
from flyaround.simulator.camera.lens.files import load_camera
from flyaround.simulator.dataset.capture import capture
from flyaround.simulator.dataset.check import redraw as check_picture
from flyaround.simulator.dataset.check import verify as check_module
from flyaround.simulator.dataset.check.feasibility import check_silhouette_inside, check_step_share
from flyaround.simulator.dataset.check.geometry import in_lens
from flyaround.simulator.dataset.check.keypoint_states import check_amodal_box, check_states, triangles_of
from flyaround.simulator.dataset.check.redraw import SAME_RENDERER_TOLERANCE, check_same_picture, sample
from flyaround.simulator.dataset.check.verify import check_dataset
from flyaround.simulator.dataset.formats.native import frame_paths, read_png
from flyaround.simulator.errors import UserError
from flyaround.simulator.frame import take_frame
from flyaround.simulator.imaging.image_formation import digitise_scene, expose_scene
from flyaround.simulator.labels.feasible import mono_signal
from flyaround.simulator.labels.layers import pixel_hash
from flyaround.simulator.labels.truth import read_truth
from flyaround.simulator.recipes.plan import plan_recipe
from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.targets.joined_mesh import joined_mesh

pytestmark = pytest.mark.gl


@pytest.fixture(scope="module")
def plan():
    plan = small_flight(320, times=(20.0, 35.0, 55.0))
    camera = plan.camera
    # longer, and to the side, so that the craft is cropped in some
    return dataclasses.replace(
        plan,
        camera=dataclasses.replace(camera, fx_px=camera.fx_px * 2.2, fy_px=camera.fy_px * 2.2, cx_px=20.0),
    )


@pytest.fixture(scope="module")
def dataset(plan, tmp_path_factory):
    folder = tmp_path_factory.mktemp("again") / "set"
    summary = capture(plan, folder, labels=("clean",))
    assert summary.quarantined == ()
    return folder


@pytest.fixture
def copy(dataset, tmp_path):
    return shutil.copytree(dataset, tmp_path / "copy")


def truth_of(folder, k):
    return read_truth(frame_paths(folder, k).truth)


def edit(folder, k, **values):
    path = frame_paths(folder, k).truth
    path.write_text(json.dumps(json.loads(path.read_text()) | values))


def test_a_fresh_data_set_is_drawn_again_and_right(dataset):
    report = check_dataset(dataset, redraw=1)
    assert report.faults == ()
    assert (report.n_redrawn, report.not_redrawn) == (3, "")
    assert check_dataset(dataset, redraw=0).n_redrawn == 0


def test_an_image_that_was_moved_with_its_hash_is_caught(copy):
    paths = frame_paths(copy, 1)
    image = np.roll(read_png(paths.image), 40, axis=1)
    cv2.imwrite(str(paths.image), image)
    edit(copy, 1, image_sha256=pixel_hash(image))
    found = check_dataset(copy)
    assert any("rendered again" in fault.what and fault.frame == 1 for fault in found.faults)
    # the clean twin tells too; without it nothing does
    assert all("rendered again" not in fault.what for fault in check_dataset(copy, redraw=0).faults)


@pytest.fixture(scope="module")
def pictures(dataset, plan):
    """Frames as they are, with their signals."""
    out = []
    with Renderer() as renderer:
        for k in range(3):
            truth = truth_of(dataset, k)
            paths = frame_paths(dataset, k)
            image, mask = read_png(paths.image), read_png(paths.mask)
            frame = take_frame(renderer, truth.scene, plan.target, labels=False)
            signal = expose_scene(truth.scene, frame.radiance)
            out.append((truth, image, mask.astype(np.uint8), signal))
    return out


def test_another_renderer_s_picture_is_the_same_one(pictures):
    """Another noise, a little more light, a part of a pixel."""
    rng = np.random.default_rng(1)
    for truth, image, mask, signal in pictures:
        other = dataclasses.replace(truth.scene, seed=truth.scene.seed + 1)
        warped = cv2.warpAffine(signal, np.float32([[1, 0, 0.08], [0, 1, -0.08]]), signal.shape[1::-1])
        rough = (warped * 1.003 + rng.normal(0, 1e-3, warped.shape)).astype(np.float32)
        again = digitise_scene(other, rough)
        assert not np.array_equal(again, image)
        assert check_same_picture(truth, image, again, mask) == []


@pytest.mark.parametrize(
    "change",
    [
        lambda x: np.roll(x, 40, axis=1),
        lambda x: np.roll(x, 2, axis=0),
        lambda x: x[:, ::-1],
        lambda x: x[::-1],
        lambda x: (x * 0.8).astype(x.dtype),
        lambda x: x[:-1],
        np.zeros_like,
    ],
)
def test_another_picture_is_not(pictures, change):
    for truth, image, mask, _ in pictures:
        assert check_same_picture(truth, np.ascontiguousarray(change(image)), image, mask)


def test_another_renderer_s_light_does_not_make_a_step_share_wrong(pictures, plan, monkeypatch):
    """A little more light, and steps near the noise are on its other side."""
    flipped = 0
    with Renderer() as renderer:
        for (truth, image, mask, _), factor in itertools.product(pictures, (0.993, 1.007)):
            frame = take_frame(renderer, truth.scene, plan.target, labels=False)
            radiance = frame.radiance * np.float32(factor)
            other = dataclasses.replace(
                frame,
                radiance=radiance,
                image=digitise_scene(truth.scene, expose_scene(truth.scene, radiance)),
            )
            assert not np.array_equal(other.image, image)
            monkeypatch.setattr(check_picture, "take_frame", lambda *_, found=other, **__: found)
            signal = np.asarray(expose_scene(truth.scene, radiance), float)
            flipped += bool(check_step_share(truth, plan.target, signal, SAME_RENDERER_TOLERANCE))
            assert check_picture.check_drawn_again(renderer, truth, image, mask, plan.target) == []
            half = msgspec.structs.replace(truth, wireframe_step_share=truth.wireframe_step_share / 2)
            assert check_picture.check_drawn_again(renderer, half, image, mask, plan.target)
    assert flipped


def test_shares_that_are_off_by_little_are_caught(copy, pictures, plan):
    assert any(0 < truth.silhouette_inside < 1 for truth, *_ in pictures)
    for k, (truth, _, _, signal) in enumerate(pictures):
        mono = np.asarray(signal if signal.ndim == 2 else signal.mean(axis=2), float)
        off = {}
        for name in ("silhouette_inside", "wireframe_step_share"):
            share = getattr(truth, name)
            by = {"silhouette_inside": 0.015, "wireframe_step_share": 0.01}[
                name
            ]  # an outline of 320 px is no better
            off[name] = share + by if share < 0.5 else share - by
        wrong = msgspec.structs.replace(truth, **off)
        assert check_silhouette_inside(truth, plan.target) == []
        assert "silhouette_inside" in check_silhouette_inside(wrong, plan.target)[0]
        assert check_step_share(truth, plan.target, mono, SAME_RENDERER_TOLERANCE) == []
        assert (
            "wireframe_step_share" in check_step_share(wrong, plan.target, mono, SAME_RENDERER_TOLERANCE)[0]
        )
        edit(copy, k, **off)
    faults = check_dataset(copy, redraw=1).faults
    for name in ("silhouette_inside", "wireframe_step_share"):
        assert {fault.frame for fault in faults if name in fault.what} == {0, 1, 2}


@pytest.mark.parametrize(("seed", "k", "camera"), [(2811, 37, None), (2811, 44, None), (4103, 108, "speed")])
def test_no_share_is_refused_of_a_craft_that_reaches_to_the_lens_or_is_cut_through_thin_antennas(
    seed, k, camera
):
    """A close CubeSat: its antennas are a pixel wide, 7 mm before the camera, or along the rows of what counts."""
    plan = plan_recipe("swisscube", k + 1, seed=seed, camera=camera)
    plan = dataclasses.replace(plan, camera=plan.camera.resized(384))
    with Renderer() as renderer:
        scene = plan.scene(k)
        truth = take_frame(renderer, scene, scene.target.drawn(plan.target)).truth
        assert 0 < truth.silhouette_inside < 1
        assert check_silhouette_inside(truth, scene.target.drawn(plan.target)) == []


@pytest.mark.parametrize("camera", ["speedplus", "fisheye-140"])
def test_no_step_share_is_refused_of_a_craft_whose_edges_end_beyond_the_lens(camera):
    """A CubeSat a decimetre before the camera: beyond its image the lens's series folds, and edges' ends lie there."""
    plan = plan_recipe("swisscube", 5, seed=91, camera=camera)
    plan = dataclasses.replace(plan, camera=plan.camera.resized(384))
    beyond = 0
    with Renderer() as renderer:
        for k in (3, 4):
            scene = plan.scene(k)
            target = scene.target.drawn(plan.target)
            frame = take_frame(renderer, scene, target)
            beyond += not in_lens(
                plan.camera, scene.camera_from_target.apply(joined_mesh(target).positions_m)
            ).all()
            mono = np.asarray(mono_signal(expose_scene(scene, frame.radiance)), float)
            assert check_step_share(frame.truth, target, mono, SAME_RENDERER_TOLERANCE) == []
    assert beyond


def test_states_and_boxes_by_rays(dataset, plan):
    kinds = set()
    for k in range(3):
        truth = truth_of(dataset, k)
        assert check_states(truth, plan.target) == []
        assert check_amodal_box(truth, plan.target) == []
        for n, keypoint in enumerate(truth.keypoints):
            if keypoint.state == "out_of_frame":
                continue
            kinds.add(keypoint.state)
            for state in {"self_occluded", "shadowed", "visible", "eclipsed"} - {keypoint.state}:
                if state == "visible" and keypoint.state in {"saturated", "below_noise"}:
                    continue  # the picture tells these
                wrong = msgspec.structs.replace(keypoint, state=state)
                labels = (*truth.keypoints[:n], wrong, *truth.keypoints[n + 1 :])
                assert check_states(msgspec.structs.replace(truth, keypoints=labels), plan.target)
        for corner in range(4):
            box = list(truth.box_amodal_px)
            box[corner] += 1e-4
            assert check_amodal_box(msgspec.structs.replace(truth, box_amodal_px=tuple(box)), plan.target)
        assert check_amodal_box(msgspec.structs.replace(truth, box_amodal_px=None), plan.target)
    assert kinds >= {"self_occluded", "shadowed"}


def test_shares_states_and_boxes_of_a_lens_that_bends(plan):
    lens = dataclasses.replace(
        plan.camera,
        distortion=dataclasses.replace(
            plan.camera.distortion, model="brown_conrady", coefficients=(-0.1, 0.02, 1e-4, -1e-4, 0.0)
        ),
    )
    scene = dataclasses.replace(plan.scene(0), camera=lens)
    with Renderer() as renderer:
        frame = take_frame(renderer, scene, plan.target)
        wrong = check_picture.check_drawn_again(renderer, frame.truth, frame.image, frame.mask, plan.target)
    assert wrong == []
    for check in (check_silhouette_inside, check_states, check_amodal_box):
        assert check(frame.truth, plan.target) == []


def test_a_craft_that_reaches_beyond_what_a_fish_eye_is_known_for(plan):
    """There OpenCV's series folds back, and says nothing of the labels."""
    camera = load_camera("fisheye-140").resized(200)
    scene = dataclasses.replace(plan.scene(0), camera=camera, t_camera_from_target_m=(1.4, 0.6, 0.9))
    with Renderer() as renderer:
        truth = take_frame(renderer, scene, plan.target).truth
    assert not in_lens(camera, scene.camera_from_target.apply(triangles_of(plan.target).vertices_m)).all()
    for check in (check_silhouette_inside, check_amodal_box, check_states):
        assert check(truth, plan.target) == []


def test_without_opengl_a_check_says_that_no_image_was_drawn(dataset, monkeypatch):
    import flyaround.simulator.render.renderer as module

    def refuse(*_, **__):
        raise UserError("no OpenGL here; install one")

    monkeypatch.setattr(module, "Renderer", refuse)
    report = check_dataset(dataset)
    assert (report.n_redrawn, report.not_redrawn) == (0, "no OpenGL here; install one")
    assert report.faults == ()


def test_each_check_looks_at_other_frames_and_its_seed_repeats_it(dataset, monkeypatch):
    """The card's seed is known to whoever changes an image."""
    drawn = []
    monkeypatch.setattr(check_module, "sample", lambda frames, share, seed: drawn.append(seed) or [])
    first, second = (check_dataset(dataset).redraw_seed for _ in range(2))
    assert first != second
    assert check_dataset(dataset, redraw_seed=first).redraw_seed == first
    assert drawn == [first, second, first]
    monkeypatch.undo()
    got = CliRunner().invoke(app, ["check", str(dataset), "--json", "--redraw", "0", "--redraw-seed", "7"])
    assert json.loads(got.stdout)["redraw_seed"] == 7


def test_the_sample_is_a_share_and_at_least_three():
    frames = list(range(1000))
    assert len(sample(frames, 0.02, 5)) == 20
    assert sample(frames, 0.02, 5) == sample(frames, 0.02, 5) != sample(frames, 0.02, 6)
    assert len(sample(frames[:50], 0.02, 5)) == 3
    assert sample(frames[:2], 0.02, 5) == [0, 1]
    assert sample(frames, 1.0, 5) == frames
    assert sample(frames, 0, 5) == sample([], 1, 5) == []
