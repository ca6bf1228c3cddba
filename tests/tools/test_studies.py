"""What the studies change on purpose: the model's corners, one setting of a method at a time."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from flyaround.hil.board.estimation import CameraIntrinsics
from flyaround.hil.board.methods import make_estimator
from flyaround.hil.board.svd.pipeline import PublishedEstimator
from flyaround.hil.evaluate.method_choice import board_model
from flyaround.hil.evaluate.pose_errors import frame_record
from flyaround.hil.evaluate.result_rows import EvaluatedFrame
from flyaround.simulator.dataset.capture import capture
from flyaround.simulator.recipes.plan import plan_recipe
from flyaround.simulator.targets.library import load_target
from tools.studies.paired_tables import mcnemar, paired
from tools.studies.published_methods import (
    PUBLISHED,
    compared,
)


def test_no_method_of_the_studies_is_measured_twice() -> None:
    model = board_model(load_target("cubesat-1u"))
    camera = CameraIntrinsics(320, 240, 500.0, 500.0, 159.5, 119.5)
    made = [make_estimator(model, camera, c.method, c.solver, c.streams) for c in PUBLISHED]
    configs = {e.config for e in made if isinstance(e, PublishedEstimator)}
    assert len(configs) == len(PUBLISHED) == len({c.label for c in PUBLISHED})


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


@pytest.mark.slow
@pytest.mark.gl
def test_the_cost_on_a_board_is_printed_by_stage(tmp_path: Path) -> None:
    capture(plan_recipe("eval-black", 2, seed=21), tmp_path / "set")
    done = subprocess.run(
        [sys.executable, "-m", "tools.studies.board_cost", str(tmp_path / "set")],
        check=True,
        capture_output=True,
        text=True,
    )
    assert "all: 1 frames, " in done.stdout
    assert "memory: " in done.stdout
