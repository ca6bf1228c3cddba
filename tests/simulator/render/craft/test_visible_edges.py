"""Edges close beside others are known, and left out only where both show nearer than the samples tell apart."""

from types import SimpleNamespace

import numpy as np
import pytest

from flyaround.simulator.baking.mesh_edges import edge_gaps, find_edges
from flyaround.simulator.render.craft.visible_edges import EdgeCamera, VisibleEdges
from flyaround.simulator.render.projection import PixelRect
from tests.harness.boxes import closed_box
from tools.validation.bare_scene import square_camera

GAP_M, THICK_M = 2e-3, 2.3e-3


@pytest.fixture
def edges(tmp_path, monkeypatch):
    """Of two plates in the plane z = 0, a gap apart in x."""
    monkeypatch.setenv("FLYAROUND_CACHE_DIR", str(tmp_path))
    plates = (
        closed_box("left", (-0.4, -0.3, 0.0), (-GAP_M / 2, 0.3, THICK_M)),
        closed_box("right", (GAP_M / 2, -0.3, 0.0), (0.4, 0.3, THICK_M)),
    )
    return find_edges(plates, {"m": 1}, is_closed=True)


def test_the_two_sides_of_a_gap_and_of_a_plate_know_each_other(edges):
    beside = edge_gaps(edges)
    middle = edges.vertices_m[edges.ends].mean(axis=1)
    length = np.ptp(edges.vertices_m[edges.ends], axis=1).max(axis=1)
    along_gap = (np.abs(middle[:, 0]) < GAP_M) & (length > 0.5)
    assert along_gap.sum() == 4
    normals = edges.planes[edges.faces[along_gap], 2]
    # through the faces in the plates' planes across the gap; through the gap's walls across the plate
    expected = np.where(np.abs(normals) > 0.5, GAP_M, THICK_M)
    assert beside[along_gap] == pytest.approx(expected, rel=1e-4)
    outer = (np.abs(middle[:, 0]) > 0.39) & (length > 0.5)
    assert outer.sum() == 4
    of_plane = np.abs(edges.planes[edges.faces[outer], 2]) > 0.5
    assert np.all(np.isinf(beside[outer][of_plane]))
    assert beside[outer][~of_plane] == pytest.approx(THICK_M, rel=1e-4)


@pytest.mark.parametrize(("focal_px", "in_gap"), [(1000.0, 0), (3000.0, 4)])
def test_a_pair_is_drawn_once_it_is_wide_enough(edges, focal_px, in_gap):
    mesh = SimpleNamespace(shells=(), radius_m=0.5)
    camera_from_target = np.eye(4)
    camera_from_target[2, 3] = 5.0  # the gap is 0.4 and 1.2 pixels wide; the camera looks at the faces z = 0
    view = EdgeCamera(square_camera(512, focal_px), PixelRect(0, 0, 512, 512), 4.9, camera_from_target)
    seen = VisibleEdges(edges, mesh)
    drawn, _ = seen.numbers(view, pairs=False)
    places = seen.edges.vertices_m[seen.edges.ends[drawn]]
    long = np.ptp(places, axis=1)[:, 1] > 0.5
    middle = places.mean(axis=1)[long]
    assert np.count_nonzero(np.abs(middle[:, 0]) < GAP_M) == in_gap  # both walls of the gap are seen
    outer = np.abs(middle[:, 0]) > 0.39
    assert np.count_nonzero(outer) == 2
    assert np.all(middle[outer, 2] == 0)  # what looks away is not drawn
    everything, outlines = seen.numbers(view, pairs=True)
    assert set(drawn) <= set(everything)
    assert len(everything) == 10
    assert sum(outlines) == 8  # all but the gap's two sides, both faces of which are seen
