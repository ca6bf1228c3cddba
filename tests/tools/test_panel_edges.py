"""Which edges are left out, and what the tables and the figure say of rows."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from flyaround.hil.evaluate.method_choice import board_model
from flyaround.simulator.targets.library import load_target
from tools.studies.panel_edges import (
    KINDS,
    LEFT_OUT,
    METHODS,
    PANEL,
    RangeRow,
    draw_figure,
    edges_table,
    kind_of,
    success_table,
    without,
)

if TYPE_CHECKING:
    from pathlib import Path


def test_a_model_without_its_panel_keeps_its_sphere() -> None:
    model = board_model(load_target("tango"))
    left = without(model, PANEL)
    assert {kind_of(e.name) for e in model.wireframe} == set(KINDS)
    assert {kind_of(e.name) for e in left.wireframe} == set(KINDS) - set(PANEL)
    assert left.sha256 != model.sha256
    assert left.radius_m == model.radius_m
    np.testing.assert_array_equal(left.centre_m, model.centre_m)
    assert without(model, ()) is model


def row(band: int, deg: float, share: float = 0.01, *, accepted: bool = True) -> RangeRow:
    error = (deg, share, accepted)
    names = [f"{method}; {edges}" for method in METHODS for edges in LEFT_OUT]
    return RangeRow(
        band, 5.0, dict.fromkeys(KINDS, 100.0), dict.fromkeys(KINDS, 0.5), 0.1, dict.fromkeys(names, error)
    )


def test_tables_count_what_is_right_and_what_was_accepted_wrongly(tmp_path: Path) -> None:
    rows = [row(0, 1.0), row(0, 3.0), row(0, 9.0), row(0, 2.0, 0.5, accepted=False), row(3, 0.5)]
    assert "| 2.5-4 | 4 | 100 px, 50 % |" in edges_table(rows)
    lines = success_table(rows).splitlines()
    assert len(lines) == 2 + len(METHODS) * len(LEFT_OUT)
    assert lines[2] == "| svd; all edges | 50 %, 2.00 deg, 3 (1) | 100 %, 0.50 deg, 1 (0) |"
    draw_figure(rows, tmp_path / "ranges.jpg")
    assert (tmp_path / "ranges.jpg").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("panel_strip_nx", "inside the panel"),
        ("panel_nynz", "outline of the panel"),
        ("rod", "antennas and rods"),
        ("side_box_pxnz", "instruments"),
    ],
)
def test_edges_have_kinds_by_their_names(name: str, kind: str) -> None:
    assert kind_of(name) == kind
