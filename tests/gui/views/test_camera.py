"""The camera's picture is as large as its view allows, and its figures stand in what is left."""

from __future__ import annotations

import pytest

from flyaround.gui import style
from flyaround.gui.canvas import Canvas
from flyaround.gui.views.camera import CameraView, Row
from tests.harness.headless_imgui import HeadlessWindow

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
