"""The newest accepted pose of a board is drawn over the view as the estimator's is, with its name."""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from flyaround.gui import style
from flyaround.gui.canvas import Canvas
from flyaround.gui.jobs.hil_session import HilSession
from flyaround.gui.picture.feed import Picture
from flyaround.hil.host.frame_record import FrameRecord
from flyaround.simulator.frame import Frame
from tests.harness.pointer import Pointer


@pytest.fixture
def screen(monkeypatch: pytest.MonkeyPatch) -> Iterator[Pointer]:
    made = Pointer("tango-flyaround")
    session = made.console.session
    made.console.do("time.pause")
    scene = session.scene()
    size = scene.camera.height_px, scene.camera.width_px
    frame = Frame(scene, np.zeros(size, np.uint8), np.zeros((*size, 1), np.float32))
    made.console.feed.newest = Picture(frame, session.state, session.plan.target, 1)
    monkeypatch.setattr(HilSession, "on", property(lambda hil: bool(hil.rows)))
    yield made
    made.console.jobs.hil.rows.clear()
    made.close()


def drawn(screen: Pointer, monkeypatch: pytest.MonkeyPatch) -> tuple[list[str], int]:
    """Return texts and number of lines in the colour of estimates."""
    texts, lines = [], []
    real_label, real_stroke = Canvas.label, Canvas.stroke

    def label(canvas: Canvas, at: Any, text: str, rgba: style.Rgba = style.INK, tip: str = "") -> None:
        texts.extend([text] * (rgba[:3] == style.ESTIMATE[:3]))
        real_label(canvas, at, text, rgba, tip)

    def stroke(canvas: Canvas, points: Any, rgba: style.Rgba, *more: Any, **options: Any) -> None:
        lines.extend([points] * (rgba[:3] == style.ESTIMATE[:3]))
        real_stroke(canvas, points, rgba, *more, **options)

    with monkeypatch.context() as patch:
        patch.setattr(Canvas, "label", label)
        patch.setattr(Canvas, "stroke", stroke)
        screen.turn()
    return texts, len(lines)


def row(screen: Pointer, outcome: str, **values: Any) -> FrameRecord:
    scene = screen.console.session.scene()
    pose = {"q_wxyz": scene.q_camera_from_target_wxyz, "t_m": scene.t_camera_from_target_m}
    columns = {
        "frame_id": 0,
        "epoch_utc": "",
        "t_s": scene.t_s,
        "exposure_s": 0.01,
        "confidence": 0.93,
        **pose,
    }
    return FrameRecord(outcome=outcome, **{**columns, **values})


def test_the_newest_accepted_pose_of_a_board_is_drawn(
    screen: Pointer, monkeypatch: pytest.MonkeyPatch
) -> None:
    rows = screen.console.jobs.hil.rows
    assert drawn(screen, monkeypatch) == ([], 0)
    rows.append(row(screen, "declined"))
    assert drawn(screen, monkeypatch) == ([], 0)
    rows.append(row(screen, "accepted"))
    rows.append(row(screen, "dropped:board", q_wxyz=None, t_m=None))
    texts, lines = drawn(screen, monkeypatch)
    assert texts == ["board: confidence 0.93"]
    assert lines > 5
    # beside the estimator's, which has a text of its own
    answer = SimpleNamespace(
        accepted=False,
        reason="no edges",
        stages={},
        stages_ms={},
        confidence=0.0,
        network="",
        q_camera_from_target_wxyz=None,
        t_camera_from_target_m=None,
    )
    estimates = screen.console.jobs.estimates
    estimates.newest = SimpleNamespace(method="hybrid", t_s=screen.console.session.t_s, answer=answer)
    monkeypatch.setattr(estimates, "on", True)
    assert [text.partition(":")[0] for text in drawn(screen, monkeypatch)[0]] == ["hybrid", "board"]
    estimates.newest = None
    screen.console.do("overlay.estimate", False)
    assert drawn(screen, monkeypatch) == ([], 0)


def test_an_old_pose_of_a_board_is_not_drawn(screen: Pointer, monkeypatch: pytest.MonkeyPatch) -> None:
    t_s = screen.console.session.t_s
    screen.console.jobs.hil.rows.append(row(screen, "accepted", t_s=t_s - 6.0))
    assert drawn(screen, monkeypatch) == ([], 0)
