"""What the studies change on purpose: the model's corners, one step of a method at a time."""

from __future__ import annotations

import numpy as np
import pytest

from hil.board.svd import CameraIntrinsics, make_estimator
from hil.board.svd.faithful.estimator import FaithfulEstimator
from hil.evaluate.frame_record import frame_record
from hil.evaluate.metrics import summarise
from hil.evaluate.study import FEW, LADDER, PUBLISHED, table, wrong_model
from hil.evaluate.worker import board_model
from simulator.targets.library import load_target


def test_a_wrong_model_is_wrong_by_what_was_asked_and_stays_joined() -> None:
    model = board_model(load_target("cubesat-1u"))
    wrong = wrong_model(model, 0.005)
    before = np.array([p for e in model.wireframe for p in (e.a_m, e.b_m)])
    after = np.array([p for e in wrong.wireframe for p in (e.a_m, e.b_m)])
    shift = after - before
    assert np.std(shift) == pytest.approx(0.005, rel=0.35)
    for k in range(len(before)):
        same = np.linalg.norm(before - before[k], axis=1) < 1e-6
        assert np.ptp(shift[same], axis=0).max() == 0
    assert wrong.sha256 != model.sha256
    # the drawn faces bend with the wireframe, and still look outwards
    assert model.faces is not None
    assert wrong.faces is not None
    assert np.std(wrong.faces.corners - model.faces.corners) == pytest.approx(0.005, rel=0.35)
    assert np.median((wrong.faces.normals * model.faces.normals).sum(axis=1)) > 0.9
    assert np.array_equal(wrong_model(model, 0.005).vertices_m, wrong.vertices_m)


def test_each_rung_takes_one_step_more() -> None:
    model = board_model(load_target("cubesat-1u"))
    camera = CameraIntrinsics(320, 240, 500.0, 500.0, 159.5, 119.5)
    configs = []
    for choice in (FEW[0], *LADDER[:3]):
        estimator = make_estimator(model, camera, choice.method, choice.solver, choice.streams, choice.steps)
        assert isinstance(estimator, FaithfulEstimator)
        configs.append(estimator.config)
    assert [c.streams[-1] for c in configs] == ["sh", "lsd", "lsd", "lsd"]
    assert [c.regions for c in configs] == ["cdf", "cdf", "proposed", "proposed"]
    assert [c.top for c in configs] == [5, 5, 5, 50]
    assert LADDER[1].label == "svd-thesis +lsd +regions"


def test_no_method_of_the_studies_is_measured_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "hil.board.svd.methods.FaithfulEstimator", lambda _model, _camera, config: str(config)
    )
    model, camera = None, CameraIntrinsics(320, 240, 500.0, 500.0, 159.5, 119.5)
    made = {make_estimator(model, camera, c.method, c.solver, c.streams, c.steps) for c in PUBLISHED}  # type: ignore[arg-type]
    assert len(made) == len(PUBLISHED) == len({c.label for c in PUBLISHED})


def test_the_table_says_what_was_not_there() -> None:
    record = frame_record([1, 0, 0, 0], [0, 0, 5], None, None, accepted=False)
    text = table([("none", summarise([record], method="none", failures=["edges"]))])
    assert "| none | 0 % (0-79) | 0 % (0-79) | 0 % (0-79) | 0 of 0 | -, - | - (-) | 1 edges | - |" in text
