"""Training the keypoint network of a craft; needs the extra `train`."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from flyaround.hil.board.estimation import CameraIntrinsics
from flyaround.hil.board.estimation.result import PoseResult
from flyaround.hil.board.hybrid.decide.confidence import UNCALIBRATED, Evidence, confidence
from flyaround.hil.board.hybrid.estimator import PoseEstimator
from flyaround.hil.board.hybrid.propose.keypoints.calibration import Calibration
from flyaround.hil.board.hybrid.propose.keypoints.head import KeypointHead
from flyaround.hil.board.hybrid.propose.keypoints.network import network_for, trunk_bytes
from flyaround.hil.board.hybrid.propose.keypoints.network_input import INPUT_PX
from flyaround.hil.board.hybrid.propose.keypoints.network_output import BIN_WIDTH, HALF_RANGE
from flyaround.hil.evaluate.method_choice import board_model
from flyaround.hil.evaluate.pose_errors import frame_record
from flyaround.simulator.errors import UserError
from flyaround.simulator.targets.installed import network_file
from flyaround.simulator.targets.library import load_target

if TYPE_CHECKING:
    from pathlib import Path

torch = pytest.importorskip("torch", reason="the extra 'train'")
pytest.importorskip("onnx", reason="the extra 'train'")

from flyaround.hil.train.fitting import Budget  # noqa: E402 - needs PyTorch
from flyaround.hil.train.keypoints import fit, head_training  # noqa: E402
from flyaround.hil.train.keypoints.calibrate import Answer, fitted_calibration  # noqa: E402
from flyaround.hil.train.keypoints.head_training import train_head  # noqa: E402
from flyaround.hil.train.keypoints.samples import HARD, Batch, image_pyramid, sample  # noqa: E402
from flyaround.hil.train.keypoints.trunk_file import fold, from_onnx, to_onnx, unfold  # noqa: E402
from flyaround.hil.train.keypoints.view_files import Drawing, earths_of, render_views  # noqa: E402
from tools.studies.randomisation import VARIANTS  # noqa: E402

CRAFT = "cubesat-1u"

# Evidence whose logit is determined by the network's term alone, near the middle of its range
NEUTRAL = Evidence(0.45, 0.5, 0.0, 0.1, 0.5, 0.5, 0.0, 0.01, 0.003, 100, 300.0, True, 0.3, 0.95, 0.5)


@pytest.fixture(scope="module")
def drawing(tmp_path_factory: pytest.TempPathFactory) -> Drawing:
    made = Drawing(tmp_path_factory.mktemp("views"), (CRAFT,), 30, 5)
    render_views(made, 1, lambda _done, _total: None)
    return made


def test_keypoints_lie_where_the_craft_is(drawing: Drawing) -> None:
    model = board_model(load_target(CRAFT))
    points = (head_training.keypoints_m(model) - model.centre_m) / model.radius_m
    views = head_training.load_views(drawing, points)
    rng = np.random.default_rng(1)
    batch = sample(views, image_pyramid(earths_of(drawing)), np.arange(20), rng, HARD)
    assert batch.inputs.shape == (20, 2, INPUT_PX, INPUT_PX)
    assert np.isfinite(batch.inputs).all()
    # views turned by chance: the spread of a craft's keypoints stays within its sphere
    spread = np.linalg.norm(batch.points - batch.points.mean(axis=1, keepdims=True), axis=-1)
    assert spread.max() < 2.2
    assert 0 < batch.present.sum() <= 20


@pytest.mark.parametrize("name", VARIANTS)
def test_a_left_out_randomisation_changes_pictures_and_keeps_labels(drawing: Drawing, name: str) -> None:
    model = head_training.board_model(head_training.load_target(CRAFT))
    points = (head_training.keypoints_m(model) - model.centre_m) / model.radius_m
    views, earths = head_training.load_views(drawing, points), image_pyramid(earths_of(drawing))

    def first(variant: str) -> Batch:
        return sample(views, earths, np.arange(20), np.random.default_rng(1), VARIANTS[variant])

    left_out, everything = first(name), first("everything")
    assert np.array_equal(left_out.points[0], everything.points[0])
    assert np.array_equal(left_out.present, everything.present)
    assert np.array_equal(left_out.inputs, everything.inputs) == (name == "everything")


def test_the_wanted_distribution_has_its_mean_at_the_keypoint() -> None:
    points = torch.tensor([[[0.1, -0.6]]])
    shape, within = fit.target_distributions(points)
    centres = (torch.arange(shape.shape[-1]) + 0.5) * BIN_WIDTH - HALF_RANGE
    assert (shape * centres).sum(-1)[0, 0].tolist() == pytest.approx([0.1, -0.6], abs=1e-3)
    assert within.all()
    _, beyond = fit.target_distributions(torch.tensor([[[2.0, 0.0]]]))
    assert beyond[0, 0].tolist() == [0.0, 1.0]


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_trunk_with_restored_normalisations_is_the_same_function() -> None:
    shipped = from_onnx(trunk_bytes())
    seen, other = torch.rand(2, 4, 2, INPUT_PX, INPUT_PX, generator=torch.Generator().manual_seed(1))
    wanted = shipped(other).detach()
    restored = unfold(shipped, seen)
    assert torch.allclose(restored(other), wanted, atol=1e-3 * float(wanted.abs().max()))
    # and it is written as it was read, to half precision
    again = from_onnx(to_onnx(fold(restored)))
    assert torch.allclose(again(other), wanted, atol=2e-2 * float(wanted.abs().max()))


def test_a_head_keeps_its_weights_between_file_and_training() -> None:
    shipped = network_for(board_model(load_target("tango")))
    assert shipped is not None
    arrays = head_training.arrays_of(head_training.state_of(shipped.head))
    assert all(np.array_equal(arrays[key], value) for key, value in shipped.head.weights.items())


def test_a_head_is_trained_stopped_and_goes_on_with_the_same_weights(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(head_training, "CHECKPOINT_STEPS", 2)
    given = {"views": 30, "budget": Budget(steps=6), "seed": 3, "workers": 1}
    report = train_head(CRAFT, tmp_path / "whole.npz", **given)
    assert report.steps == 6
    assert 0 < report.median_px < 200

    def stop(done: float, text: str) -> None:
        if text.startswith("2 steps"):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train_head(CRAFT, tmp_path / "stopped.npz", **given, report=stop)
    assert not (tmp_path / "stopped.npz").exists()
    train_head(CRAFT, tmp_path / "stopped.npz", **given)
    assert not (tmp_path / "stopped.npz.partial").exists()
    whole, stopped = ((tmp_path / name).read_bytes() for name in ("whole.npz", "stopped.npz"))
    a, b = (KeypointHead.read(data, "x") for data in (whole, stopped))
    assert all(np.array_equal(a.weights[k], b.weights[k]) for k in a.weights)


def test_an_overconfident_estimator_is_calibrated() -> None:
    # answers whose true logit is 1.5 below that of the craft that the confidence was fitted on, drawn by chance
    rng = np.random.default_rng(7)

    def answer(network: float) -> Answer:
        evidence = replace(NEUTRAL, network=network)
        truth = confidence(evidence)
        is_right = rng.random() < truth / (truth + np.exp(1.5) * (1 - truth))
        turn_rad = np.radians(0.4 if is_right else 90.0)
        score = frame_record(
            (1, 0, 0, 0),
            (0, 0, 10),
            (np.cos(turn_rad / 2), np.sin(turn_rad / 2), 0, 0),
            (0, 0, 10),
            accepted=False,
            covariance=np.diag([np.radians(0.1)] * 3 + [0.01] * 3) ** 2,
        )
        return Answer(score, evidence, PoseResult(False, "", None, None, 0.0))

    many = fitted_calibration([answer(z) for z in rng.uniform(-12, 0, 4000)])
    assert many.frames == 4000
    for network in (-8.0, -4.0, -1.0):
        evidence = replace(NEUTRAL, network=network)
        wanted = np.log(confidence(evidence) / (1 - confidence(evidence))) - 1.5
        p = confidence(replace(evidence, calibration=many))
        assert np.log(p / (1 - p)) == pytest.approx(wanted, abs=0.3)
    # regressors that did not vary keep their weights
    assert many.weights[1:10] == pytest.approx(UNCALIBRATED.weights[1:10], abs=1e-6)
    # each right pose is four predicted sigmas off, and all come to lie at the bound
    assert many.covariance_factor == pytest.approx(16 / 12.592, rel=1e-3)
    # few answers change little
    few = fitted_calibration([answer(-4.0) for _ in range(3)])
    assert (
        abs(
            confidence(replace(NEUTRAL, network=-4.0, calibration=few))
            - confidence(replace(NEUTRAL, network=-4.0, calibration=UNCALIBRATED))
        )
        < 0.3
    )
    assert fitted_calibration([]) == UNCALIBRATED
    # weights of few answers do not make it bolder than the common ones, lowered
    bold = Calibration((20.0, *[0.0] * 11), frames=50)
    assert confidence(replace(NEUTRAL, calibration=bold)) < confidence(NEUTRAL)


def test_a_head_is_calibrated_on_other_frames(tmp_path: Path) -> None:
    report = train_head(CRAFT, tmp_path / "a.npz", views=25, budget=Budget(steps=2), calibration_frames=4)
    head = KeypointHead.read((tmp_path / "a.npz").read_bytes(), "a.npz")
    assert head.calibration is not None
    assert head.calibration.frames == report.frames <= 4
    assert report.wrong <= report.accepted <= report.frames
    # the estimator uses it
    model = replace(board_model(load_target(CRAFT)), network=head.to_bytes())
    assert (
        PoseEstimator(model, CameraIntrinsics(100, 100, 90.0, 90.0, 49.5, 49.5)).setup.calibration
        == head.calibration
    )


def test_a_trained_head_goes_with_its_target(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FLYAROUND_DATA_DIR", str(tmp_path))
    target = load_target(CRAFT)
    assert network_for(board_model(target)) is None
    network_file(CRAFT).parent.mkdir(parents=True)
    train_head(CRAFT, network_file(CRAFT), views=25, budget=Budget(steps=2))
    network = network_for(board_model(target))
    assert network is not None
    assert network.head.craft == CRAFT


def test_a_craft_with_too_few_keypoints_is_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(head_training, "keypoints_m", lambda _model: np.zeros((24, 3)))
    with pytest.raises(UserError, match="distinct keypoints"):
        train_head(CRAFT, tmp_path / "a.npz", views=25, budget=Budget(steps=1))
    assert list(tmp_path.iterdir()) == []


def test_a_stopped_run_of_other_views_or_a_damaged_state_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(head_training, "CHECKPOINT_STEPS", 1)

    def stop(done, text):
        if text.startswith("1 steps"):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train_head(CRAFT, tmp_path / "a.npz", views=25, budget=Budget(steps=3), report=stop)
    for changed in ({"views": 50}, {"views": 25, "seed": 4}):
        with pytest.raises(UserError, match="another target, number or seed"):
            train_head(CRAFT, tmp_path / "a.npz", budget=Budget(steps=3), **changed)
    (tmp_path / "a.npz.partial" / "head.pt").write_bytes(b"PK nothing")
    with pytest.raises(UserError, match="not a checkpoint of a training"):
        train_head(CRAFT, tmp_path / "a.npz", views=25, budget=Budget(steps=3))


def test_a_craft_that_a_board_cannot_draw_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(head_training, "board_model", lambda target: replace(board_model(target), faces=None))
    with pytest.raises(UserError, match="decimate"):
        train_head(CRAFT, tmp_path / "a.npz", views=25, budget=Budget(steps=1))
