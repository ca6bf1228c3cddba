"""The free camera's view: the target is marked when it is too small to recognise."""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np
import pytest

from flyaround.gui.canvas import Canvas
from flyaround.gui.picture.feed import Feed, Picture
from flyaround.gui.picture.further import ORBIT_CAMERA
from flyaround.gui.picture.orbit_picture import orbit_scene
from flyaround.gui.picture.view_settings import ViewSettings
from flyaround.gui.views.letterbox import Letterbox
from flyaround.gui.views.orbit_camera import OrbitCameraView
from flyaround.simulator.frame import NO_RADIANCE, Frame
from flyaround.simulator.piloting.docking_port import radius_m
from flyaround.simulator.scenario.load import load_scenario
from tests.harness.flown_console import console_flying
from tests.harness.headless_imgui import HeadlessWindow
from tests.harness.no_renderer import NoRenderer

pytest.importorskip("imgui_bundle", reason="the gui extra is not installed")

VIEW = (600.0, 400.0)


def texts_of(
    monkeypatch: pytest.MonkeyPatch,
    target: str,
    diameter_units: float,
    turn_deg: tuple[float, float] = (0.0, 0.0),
) -> dict[str, tuple[float, ...]]:
    """Draw the target with this diameter; return each text's left, top, right and bottom."""
    written: dict[str, tuple[float, ...]] = {}

    def text(canvas: Canvas, at: tuple[float, float], text: str, *_rest: Any, **_options: Any) -> None:
        width, height = canvas.size(text)
        written[text] = (*at, at[0] + width, at[1] + height)

    monkeypatch.setattr(Canvas, "text", text)
    scenario = msgspec.structs.replace(load_scenario("tango-space-10m"), target=target)
    console = console_flying(scenario)
    session, look = console.session, console.options.orbit
    settings = ViewSettings(bands="mono", environment=session.scene().environment)
    # a preliminary scene gives the scale of the picture in the view
    camera = orbit_scene(session, settings, look, 1, "draft").camera
    box = Letterbox.fit((camera.width_px, camera.height_px), (0.0, 0.0, *VIEW))
    distance_m = camera.fx_px * box.scale * 2 * radius_m(session.plan.target) / diameter_units
    look.place(look.azimuth_deg + turn_deg[0], look.elevation_deg + turn_deg[1], distance_m)
    scene = orbit_scene(session, settings, look, 1, "draft")
    truth: Any = None
    image = np.zeros((camera.height_px, camera.width_px), np.uint8)
    frame = Frame(scene, image, NO_RADIANCE, truth=truth)
    console.feeds[ORBIT_CAMERA] = Feed(NoRenderer())
    console.feeds[ORBIT_CAMERA].newest = Picture(frame, session.state, session.plan.target, 1)
    window = HeadlessWindow()
    try:
        with window.panel("Orbit camera", *VIEW):
            OrbitCameraView(window).draw(console)
    finally:
        window.close()
        console.close()
    return written


@pytest.mark.parametrize(("diameter_units", "named"), [(60.0, False), (30.0, True), (12.0, True)])
@pytest.mark.parametrize("target", ["envisat", "tango", "cubesat-1u"])
def test_the_target_is_marked_by_its_projected_diameter(
    monkeypatch: pytest.MonkeyPatch, target: str, diameter_units: float, *, named: bool
) -> None:
    assert ("target" in texts_of(monkeypatch, target, diameter_units)) == named


@pytest.mark.parametrize("diameter_units", [40.0, 12.0, 4.0, 1.0])
@pytest.mark.parametrize("turn_deg", [(a, e) for a in range(0, 360, 45) for e in (-60.0, 0.0)])
def test_the_names_of_both_craft_do_not_touch(
    monkeypatch: pytest.MonkeyPatch, diameter_units: float, turn_deg: tuple[float, float]
) -> None:
    written = texts_of(monkeypatch, "tango", diameter_units, turn_deg)
    if "chaser" in written:
        a, b = written["target"], written["chaser"]
        gap = 2.0
        assert a[0] >= b[2] + gap or b[0] >= a[2] + gap or a[1] >= b[3] + gap or b[1] >= a[3] + gap
    assert "chaser" in written or any("out of view" in text for text in written)


@pytest.mark.parametrize(
    ("view", "divisor", "least"),
    [
        ((608, 256), 4, (304, 128)),
        ((960, 640), 4, (304, 128)),
        ((608, 256), 2, (304, 128)),
        ((320, 96), 4, (320, 96)),
    ],
)
def test_a_busy_machine_draws_no_blurred_picture(
    view: tuple[int, int], divisor: int, least: tuple[int, int]
) -> None:
    console = console_flying("tango-space-10m")
    look = console.options.orbit
    look.fill(*view)
    camera = orbit_scene(console.session, console.options.settings, look, divisor, "draft").camera
    assert camera.width_px >= least[0]
    assert camera.height_px >= least[1]
    console.close()
