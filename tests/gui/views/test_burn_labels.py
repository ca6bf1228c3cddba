"""Sizes of planned burns on the LVLH map."""

from itertools import combinations, product
from typing import Any

import numpy as np
import pytest

from flyaround.gui.canvas import Canvas, point
from flyaround.gui.views.lvlh_map import LvlhMap
from tests.harness.pointer import Pointer

Box = tuple[float, float, float, float]


def overlap(a: Box, b: Box) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


@pytest.mark.parametrize("size", [(1280, 800), (1920, 1080)])
def test_they_keep_off_the_target_the_scale_and_each_other(
    size: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: dict[str, list[Box]] = {}
    label = Canvas.label

    def noting(canvas: Canvas, at: tuple[float, float], text: str, *rest: Any, **options: Any) -> None:
        width, height = canvas.size(text)
        drawn.setdefault(text, []).append((at[0], at[1], at[0] + width, at[1] + height))
        label(canvas, at, text, *rest, **options)

    screen = Pointer("tango-space-10m", size)
    for line in ("layout.fly", "burn.plan 30 0 0.02 0", "burn.plan 60 0.02 0 0", "burn.plan 90 0 -0.03 0"):
        screen.console.do_line(line)
    for _ in range(4):
        screen.turn()
    monkeypatch.setattr(Canvas, "label", noting)
    screen.turn()
    sizes = [box for text, boxes in drawn.items() if text.endswith("m/s") for box in boxes]
    scales = [box for text, boxes in drawn.items() if text.endswith(" m") for box in boxes]
    view = next(panel for panel in screen.layout.panels if isinstance(panel, LvlhMap))
    targets = [(x - 5, y - 5, x + 5, y + 5) for x, y in (point(p.at(np.zeros(3))) for p in view.ports)]
    assert len(sizes) >= 4
    assert len(scales) == 2
    assert not [pair for pair in product(sizes, scales + targets) if overlap(*pair)]
    assert not [pair for pair in combinations(sizes, 2) if overlap(*pair)]
    screen.close()
