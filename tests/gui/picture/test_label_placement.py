"""Names over the picture: none on another one or on a mark, all inside the picture, and they do not jump about."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flyaround.gui.picture.label_placement import MARK_PX, PlacedLabel, place_labels
from flyaround.gui.picture.truth_overlay import Marker
from flyaround.gui.picture.view_settings import Overlays
from flyaround.simulator.piloting.session import FlightSession
from flyaround.simulator.scenario.load import load_scenario

PLACE = (0.0, 0.0, 930.0, 580.0)
LINE = 16.0
Box = tuple[float, float, float, float]
coordinate = st.tuples(st.floats(20, 900), st.floats(20, 560))


def box_of(label: PlacedLabel, size: tuple[float, float]) -> Box:
    return (*label.corner, label.corner[0] + size[0], label.corner[1] + size[1])


def overlap(a: Box, b: Box) -> bool:
    return min(a[2], b[2]) > max(a[0], b[0]) and min(a[3], b[3]) > max(a[1], b[1])


def sizes_of(names: list[str]) -> list[tuple[float, float]]:
    return [(7.5 * len(n), LINE) for n in names]


def keypoints(scale: float) -> tuple[list[tuple[float, float]], list[str]]:
    session = FlightSession.of(load_scenario("tango-flyaround"))
    marks = Marker(session.plan.target).marks(session.scene(), Overlays(keypoints=True, names=True))
    shown = [(p, n) for p, seen, n in marks.keypoints if seen != "hidden"]
    return [(scale * p[0], scale * p[1]) for p, _ in shown], [n for _, n in shown]


@pytest.mark.parametrize("scale", [0.48, 0.2, 0.1])
def test_names_of_a_craft_do_not_overlap(scale: float) -> None:
    points, names = keypoints(scale)
    sizes = sizes_of(names)
    placed = place_labels(points, sizes, (0.0, 0.0, 1920 * scale, 1200 * scale))
    boxes = [box_of(p, s) for p, s in zip(placed, sizes, strict=True) if p is not None]
    assert not any(overlap(a, b) for a, b in combinations(boxes, 2))
    if scale > 0.15:
        assert len(boxes) == len(names)


@given(points=st.lists(coordinate, min_size=1, max_size=25))
def test_no_name_lies_on_another_or_on_a_mark(points: list[tuple[float, float]]) -> None:
    sizes = [(40.0 + 5 * (k % 5), LINE) for k in range(len(points))]
    taken = [(400.0, 200.0, 100.0, 60.0)]
    placed = place_labels(points, sizes, PLACE, obstacles=taken)
    boxes = [box_of(p, s) for p, s in zip(placed, sizes, strict=True) if p is not None]
    assert not any(overlap(a, b) for a, b in combinations(boxes, 2))
    for k, label in enumerate(placed):
        if label is None:
            continue
        box = box_of(label, sizes[k])
        assert box[0] >= 0
        assert box[1] >= 0
        assert box[2] <= PLACE[2]
        assert box[3] <= PLACE[3]
        assert not overlap(box, (400.0, 200.0, 500.0, 260.0))
        for j, (x, y) in enumerate(points):
            assert j == k or not overlap(box, (x - MARK_PX, y - MARK_PX, x + MARK_PX, y + MARK_PX))


def test_a_name_that_moved_away_is_led_to_its_point() -> None:
    points = [(300.0 + 3 * k, 300.0) for k in range(14)]
    placed = place_labels(points, [(60.0, LINE)] * 14, PLACE)
    assert sum(p is not None for p in placed) >= 12
    assert any(p is not None and p.lead is not None for p in placed)


def test_names_stay_where_they_were() -> None:
    points = [(300.0, 300.0), (310.0, 300.0), (500.0, 100.0)]
    sizes = [(60.0, LINE)] * 3
    first = place_labels(points, sizes, PLACE)
    kept = [None if p is None else p.choice for p in first]
    moved = [(x + 2.0, y + 1.0) for x, y in points]
    again = place_labels(moved, sizes, PLACE, last_choices=kept)
    assert [None if p is None else p.choice for p in again] == kept
    assert np.isfinite([p.corner for p in again if p is not None]).all()
