"""What the studies change on purpose: the model's corners, one setting of a method at a time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from flyaround.hil.board.estimation import CameraIntrinsics
from flyaround.hil.board.methods import make_estimator
from flyaround.hil.board.svd.pipeline import PublishedEstimator
from flyaround.hil.evaluate.method_choice import board_model
from flyaround.hil.evaluate.metrics import summarise
from flyaround.hil.evaluate.pose_errors import frame_record
from flyaround.hil.evaluate.result_rows import EvaluatedFrame
from flyaround.simulator.errors import UserError
from flyaround.simulator.targets.library import load_target
from tools.studies.paired_tables import mcnemar, paired, table, units_table, write_into_page
from tools.studies.published_methods import (
    PUBLISHED,
    compared,
    wrong_model,
)


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


def test_no_method_of_the_studies_is_measured_twice() -> None:
    model = board_model(load_target("cubesat-1u"))
    camera = CameraIntrinsics(320, 240, 500.0, 500.0, 159.5, 119.5)
    made = [make_estimator(model, camera, c.method, c.solver, c.streams) for c in PUBLISHED]
    configs = {e.config for e in made if isinstance(e, PublishedEstimator)}
    assert len(configs) == len(PUBLISHED) == len({c.label for c in PUBLISHED})


def test_the_table_says_what_was_not_there() -> None:
    record = frame_record([1, 0, 0, 0], [0, 0, 5], None, None, accepted=False)
    text = table([("none", summarise([record], method="none", failures=["edges"]))])
    assert "| none | 0 % (0-79) | 0 % (0-79) | 0 % (0-79) | 0 of 0 | -, - | - (-) | 1 edges |" in text


def answer(frame: int, method: str, error_deg: float, *, feasible: bool = True) -> EvaluatedFrame:
    turn = np.radians(error_deg) / 2
    q = (float(np.cos(turn)), float(np.sin(turn)), 0.0, 0.0)
    record = frame_record(
        [1, 0, 0, 0], [0, 0, 5], np.array(q), np.array([0, 0, 5.1]), accepted=True, feasible=feasible
    )
    return EvaluatedFrame(
        frame=frame, method=method, record=record, reason="", failure="", confidence=1.0, q_wxyz=q,
        t_m=(0.0, 0.0, 5.1), stages_ms={"pnp": 1.0}, counts={},
    )  # fmt: skip


def test_paired_counts_are_of_frames_that_both_have_and_their_probability_is_exact() -> None:
    rows = [answer(k, "a", 1.0 if k < 4 else 90.0) for k in range(12)]
    rows += [answer(k, "b", 1.0 if k >= 3 else 90.0) for k in range(11)]
    rows += [answer(20, "a", 90.0, feasible=False), answer(20, "b", 1.0, feasible=False)]
    assert paired(rows, "a", "b")[:2] == (7, 3)
    # 2 (1 + 10 + 45 + 120) / 1024
    assert paired(rows, "a", "b")[2] == pytest.approx(0.34375)
    assert mcnemar(0, 0) == mcnemar(1, 1) == 1.0
    assert mcnemar(0, 6) == pytest.approx(2 / 64)
    assert mcnemar(0, 2000) < 1e-99  # more than a float holds of ways to choose
    assert "| 7, 3 (0.34) |" in compared(rows, ["a", "b", "c"], "a").splitlines()[-1]


def test_the_table_of_units_counts_right_poses_apart_and_gives_radians() -> None:
    rows = [answer(k, "a", 2.0).record for k in range(6)] + [answer(9, "a", 180.0).record]
    every, _, right = units_table([("black", rows)]).splitlines()[2:]
    assert right == "| black, right within 10 deg | 6 of 7 | 0.1 (0.1-0.1) | 2 (2-2) | 2 | 0.035 |"
    assert "| 7 of 7 |" in every


def test_a_page_gets_its_table_and_keeps_the_rest(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("before\n<!-- study solvers eval-black -->\nold\n<!-- end -->\nafter\n<!-- end -->\n")
    write_into_page(page, "solvers", "eval-black", "| new |")
    assert page.read_text() == (
        "before\n<!-- study solvers eval-black -->\n| new |\n<!-- end -->\nafter\n<!-- end -->\n"
    )
    with pytest.raises(UserError, match="study solvers thesis"):
        write_into_page(page, "solvers", "thesis", "| new |")
