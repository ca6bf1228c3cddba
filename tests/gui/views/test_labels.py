"""The views of labels: a picture of another time carries its age."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from flyaround.gui.canvas import Canvas
from flyaround.gui.panels.all import PANELS
from flyaround.gui.picture.feed import Feed, Picture
from flyaround.gui.picture.further import LABEL_VIEWS
from flyaround.gui.picture.view_settings import OVERLAYS
from flyaround.gui.views.labels import DepthView
from flyaround.simulator.camera.lens.camera_model import reduced_camera
from flyaround.simulator.frame import NO_RADIANCE, Frame
from tests.harness.flown_console import console_flying
from tests.harness.headless_imgui import HeadlessWindow
from tests.harness.no_renderer import NoRenderer

pytest.importorskip("imgui_bundle", reason="the gui extra is not installed")


@pytest.mark.parametrize(
    ("age_s", "rate", "said"),
    [(0.0, 1, None), (40.0, 1, "40.0 s old"), (40.0, 100, "40.0 s old (sim)")],
)
def test_an_old_picture_of_labels_says_so(
    monkeypatch: pytest.MonkeyPatch, age_s: float, rate: float, said: str | None
) -> None:
    written: list[str] = []
    monkeypatch.setattr(Canvas, "text", lambda _canvas, _at, text, *_rest: written.append(text))
    console = console_flying("tango-space-10m")
    session = console.session
    scene = session.scene()
    scene = replace(scene, camera=reduced_camera(scene.camera, 8), t_s=session.t_s - age_s)
    shape = scene.camera.height_px, scene.camera.width_px
    depth = np.full(shape, np.nan, np.float32)
    depth[10:20, 10:20] = np.linspace(9.0, 9.4, 10, dtype=np.float32)
    truth: Any = SimpleNamespace(box_px=None)
    frame = Frame(scene, np.zeros(shape, np.uint8), NO_RADIANCE, truth=truth, layers={"depth": depth})
    console.feeds[LABEL_VIEWS] = Feed(NoRenderer())
    console.feeds[LABEL_VIEWS].newest = Picture(frame, session.state, session.plan.target, 8)
    session.clock.rate = rate
    window = HeadlessWindow()
    try:
        with window.panel("Depth", 600.0, 400.0):
            DepthView(window).draw(console)
    finally:
        window.close()
        console.close()
    assert [text for text in written if "old" in text] == ([said] if said else [])


def test_what_shows_the_truth_says_so() -> None:
    titles = {p.name: p.title for p in PANELS}
    assert all(titles[name].startswith("True ") for name in ("depth", "parts", "keypoints"))
    for name in ("keypoints", "box", "axes", "wireframe"):
        assert OVERLAYS[name].startswith("True "), name
    assert OVERLAYS["estimate"] == "Estimated pose"
