"""The tool that holds a target's outline against a picture of the craft."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from flyaround.simulator.targets.library import load_target
from tools.validation.outline import SIDES, fit_outline, main


def _outline(target, side, focal_px, range_m):
    """The craft's filled outline by one pass over its triangles, turned by 3 and 2 degrees off the side."""
    turn = cv2.Rodrigues(np.array([0.05, -0.035, 0.02]))[0]
    image = np.zeros((375, 600), np.uint8)
    for part in target.parts:
        seen = part.positions_m @ (turn @ np.array(SIDES[side], float)).T + (0.02, -0.03, range_m)
        uv = seen[:, :2] / seen[:, 2:] * focal_px + (299.5, 187)
        for triangle in np.rint(uv * 16).astype(np.int32)[part.triangles]:
            cv2.fillConvexPoly(image, triangle, 1, cv2.LINE_8, 4)
    return image


@pytest.mark.slow
def test_own_outline_is_found_and_a_missing_antenna_costs_overlap():
    target = load_target("tango", "low")
    own = fit_outline(_outline(target, "+y", 2200.0, 6.9), target, "+y")
    assert own.overlap > 0.985
    assert own.median_px <= 1.0
    bare = replace(target, parts=tuple(p for p in target.parts if p.name not in {"antenna_1", "rod"}))
    assert fit_outline(_outline(target, "+y", 2200.0, 6.9), bare, "+y").overlap < own.overlap - 0.015


def test_what_cannot_be_read_is_named(tmp_path, capsys):
    assert main([str(tmp_path / "none.png")]) == 2
    assert "cannot read picture" in capsys.readouterr().out
    dark, polygons = tmp_path / "dark.png", tmp_path / "outline.json"
    cv2.imwrite(str(dark), np.zeros((60, 80), np.uint8))
    assert main([str(dark)]) == 2
    assert "outline is empty" in capsys.readouterr().out
    polygons.write_text('{"polygon": 1}')
    assert main([str(dark), "--outline", str(polygons)]) == 2
    assert "JSON list of polygons" in capsys.readouterr().out
