"""The camera's picture is as large as its view allows, and its figures stand in what is left."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from flyaround.gui import style
from flyaround.gui.canvas import Canvas
from flyaround.gui.picture.feed import Picture
from flyaround.gui.views.camera import CameraView, Row
from flyaround.simulator.frame import NO_RADIANCE, Frame
from tests.harness.headless_imgui import HeadlessWindow
from tests.harness.pointer import Pointer

GROUPS = tuple(
    tuple(Row("RANGE", "    10.000 m", style.INK, "") for _ in range(count)) for count in (2, 3, 4, 5)
)
IMAGE = (960, 600)


@pytest.mark.parametrize(
    ("place", "groups", "where"),
    [
        ((0.0, 24.0, 932.0, 708.0), GROUPS, "below"),
        ((0.0, 24.0, 800.0, 300.0), GROUPS, "right"),
        ((0.0, 24.0, 960.0, 610.0), GROUPS, "over"),
        ((0.0, 24.0, 932.0, 708.0), (), "over"),
    ],
)
def test_figures_stand_where_the_picture_leaves_room(
    window: HeadlessWindow, place: tuple[float, float, float, float], groups: tuple, where: str
) -> None:
    view = CameraView(window)
    with window.panel("view", 1000.0, 780.0):
        box, beside = view._placed(Canvas(window), place, IMAGE, groups)
    # the picture is never smaller for its figures
    assert box.width == pytest.approx(min(place[2], place[3] * 1.6))
    if where == "over":
        assert beside is None
        return
    assert beside is not None
    if where == "below":
        assert (box.y, beside[1]) == (place[1], place[1] + box.height)
        assert beside[3] == pytest.approx(place[3] - box.height)
    else:
        assert (box.x, beside[0]) == (place[0], place[0] + box.width)


@pytest.mark.parametrize("width", [480.0, 615.0, 932.0])
@pytest.mark.parametrize(
    "badge",
    [
        "PAUSED  LOOKING BACK  STATION KEEPING / TRACK, 12.3° OFF",
        "STATION KEEPING LVLH / TRACK TARGET / BRAKE / KEEP OUT",
        "GUIDANCE",
    ],
)
def test_the_mode_leaves_the_time_legible(window: HeadlessWindow, width: float, badge: str) -> None:
    view = CameraView(window)
    flying = Row("", badge, style.WARN, ""), Row("", "652 ms  480x300", style.QUIET, "")
    moment = Row("UTC", "2026-08-20 09:33:11.153", style.INK, ""), *GROUPS[1][1:]
    with window.panel("view", 1000.0, 780.0):
        view._corners(Canvas(window), (0.0, 24.0, width, 390.0), (flying, moment, *GROUPS[2:]))
    plates = view._plates
    for k, (x, y, wide, tall) in enumerate(plates):
        assert x >= 0
        assert x + wide <= width
        for u, v, broad, high in plates[:k]:
            assert x >= u + broad or u >= x + wide or y >= v + high or v >= y + tall, "two plates overlap"


@pytest.mark.parametrize("size", [(1280, 800), (1920, 1080)])
@pytest.mark.parametrize("layout", ["first", "dock", "fly"])
@pytest.mark.parametrize("docking", [False, True])
def test_the_warning_of_the_exposure_covers_nothing(
    monkeypatch: pytest.MonkeyPatch, size: tuple[int, int], layout: str, *, docking: bool
) -> None:
    boxes: dict[str, tuple[float, ...]] = {}
    real = Canvas.plain_text

    def noting(canvas: Canvas, at: tuple[float, float], text: str, *rest: Any, **options: Any) -> None:
        width, height = canvas.size(text)
        boxes[text] = (*at, at[0] + width, at[1] + height)
        real(canvas, at, text, *rest, **options)

    screen = Pointer("tango-flyaround", size)
    console = screen.console
    session, scene = console.session, console.session.scene()
    image = np.zeros((scene.camera.height_px, scene.camera.width_px), np.uint8)
    console.feed.newest = Picture(Frame(scene, image, NO_RADIANCE), session.state, session.plan.target, 1)
    console.do_line(f"layout.{layout}")
    console.do("overlay.docking", docking)
    for _ in range(6):
        screen.turn()
    monkeypatch.setattr(Canvas, "plain_text", noting)
    screen.turn()
    screen.close()
    warning = next(text for text in boxes if text.startswith("dark at"))
    covered = [
        text for text, box in boxes.items() if text and text != warning and overlap(box, boxes[warning])
    ]
    assert not covered


def overlap(a: tuple[float, ...], b: tuple[float, ...]) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]
