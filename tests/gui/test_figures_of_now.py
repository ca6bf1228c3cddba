"""Figures are of the time on the clock, however old the picture is; a picture beside them tells its age."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from flyaround.gui import style
from flyaround.gui.canvas import Canvas
from flyaround.gui.console import Console
from flyaround.gui.panels.all import PANELS
from flyaround.gui.picture.feed import Feed, Picture
from flyaround.gui.picture.label_images import LABELS
from flyaround.gui.views.lvlh_map import LvlhMap
from flyaround.simulator.camera.lens.camera_model import reduced_camera
from flyaround.simulator.frame import Frame, take_frame
from flyaround.simulator.render.renderer import Renderer
from tests.harness.flown_console import console_flying
from tests.harness.headless_imgui import HeadlessWindow
from tests.harness.legibility import VERTEX, array_of
from tests.harness.no_renderer import NoRenderer

TURNS, RATE = 10, 500


@pytest.fixture(scope="module")
def console() -> Iterator[Console]:
    """A console at 500x whose pictures stay as they were at the start."""
    console = console_flying("tango-flyaround")
    session = console.session
    scene = session.scene()
    scene = replace(scene, camera=reduced_camera(scene.camera, 8), quality="draft")
    with Renderer() as renderer:
        frame: Frame = take_frame(renderer, scene, session.plan.target, labels=LABELS)
    picture = Picture(frame, session.state, session.plan.target, 8)
    console.feed.newest = picture
    for name in ("orbit-camera", "labels"):
        console.feeds.setdefault(name, Feed(NoRenderer())).newest = picture
    console.options.overlays.docking = True
    console.do("time.rate", str(RATE))
    for _ in range(TURNS):
        console.pass_time(100)
    assert console.session.t_s == pytest.approx(TURNS * RATE / 10)
    yield console
    console.close()


def texts(name: str, console: Console, window: HeadlessWindow, monkeypatch: pytest.MonkeyPatch) -> str:
    """Everything that a panel writes, in one text."""
    written: list[str] = []

    def noting(draw: Any) -> Any:
        def letters(canvas: Canvas, at: Any, text: str, *rest: Any, **options: Any) -> None:
            written.append(text)
            draw(canvas, at, text, *rest, **options)

        return letters

    for kind in (Canvas.text, Canvas.plain_text, Canvas.label):
        monkeypatch.setattr(Canvas, kind.__name__, noting(kind))
    panel = next(p for p in PANELS if p.name == name)(window)
    for _ in range(2):
        written.clear()
        window.noted.clear()
        with window.panel(name, 1000.0, 780.0):
            panel.draw(console)
    return "\n".join(written + [n.label for n in window.noted if n.what == "text"])


@pytest.mark.parametrize("name", ["camera", "chaser", "plots", "docking"])
def test_figures_are_of_the_time_on_the_clock(
    name: str, console: Console, window: HeadlessWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    session = console.session
    world, docking = session.craft.world, session.craft.docking
    x, y, z = world.position_lvlh_m
    axial = f"{docking.figures(session.craft.chaser, session.flight).axial_m:z.2f} m"
    expected = {
        "camera": [f"{world.range_m:9.3f} m", f"{x:+z9.3f} m", "T+00:08:20.0   500x"[2:], axial],
        "chaser": [" ".join(f"{v:+z8.3f}" for v in (x, y, z))],
        "plots": [f"Range [m]: {world.range_m:.4g}"],
        "docking": [axial],
    }[name]
    shown = texts(name, console, window, monkeypatch)
    for figure in expected:
        assert figure in shown


def test_the_position_over_the_view_stands_below_its_frame(
    console: Console, window: HeadlessWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown = texts("camera", console, window, monkeypatch)
    assert 0 < shown.index("IN TARGET'S LVLH") < shown.index("RADIAL")


@pytest.mark.parametrize("name", ["camera", "orbit-camera", "depth", "parts", "keypoints"])
def test_an_old_picture_tells_its_age(
    name: str, console: Console, window: HeadlessWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert f"{console.session.t_s:.1f} s old (sim)" in texts(name, console, window, monkeypatch)


def test_the_drift_on_the_map_begins_at_the_chaser(console: Console, window: HeadlessWindow) -> None:
    panel = LvlhMap(window)
    console.do("map.place", 0.0, 0.0, 0.0, 60.0)
    r, g, b, _ = (round(255 * c) for c in style.ORANGE)
    for _ in range(4):
        console.pass_time(100)
        with window.panel("map", 600.0, 780.0):
            panel.draw(console)
        lists = window.plain.get_draw_data().cmd_lists
        vertices = np.concatenate([array_of(part.vtx_buffer, VERTEX) for part in lists])
        drawn_at = vertices["at"][(vertices["colour"] & 0xFFFFFF) == (r | g << 8 | b << 16)]
        for port in panel.ports:
            here = np.array(port.at(np.array(console.session.craft.world.position_lvlh_m)))
            assert np.linalg.norm(drawn_at - here, axis=1).min() < 4.0


def test_figures_follow_a_seek(console: Console) -> None:
    before = np.array(console.telemetry.position_lvlh_m)
    console.do("timeline.seek", 20.0)
    assert console.telemetry.t_s == console.session.t_s == pytest.approx(20.0)
    assert np.linalg.norm(before - console.telemetry.position_lvlh_m) > 0.1
