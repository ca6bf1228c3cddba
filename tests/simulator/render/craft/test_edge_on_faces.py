"""Faces seen edge-on, whose raster depth is imprecise, do not show through faces in front of them."""

import itertools

import numpy as np
import pytest

from flyaround.simulator.targets.model import Material, Part
from tools.validation.bare_scene import bare_scene, bare_target, flat_plate, square_camera

pytestmark = pytest.mark.gl

BEHIND_M, DEEP_M, RANGE_M, FOCAL_PX = 0.03, 0.002, 6.0, 500.0


def _walls(n):
    """Walls 2 mm deep behind a floor, in planes of one line along y: what a solar cell's side is."""
    y = np.linspace(-0.4, 0.4, n + 1)
    corners = [
        [(0.0, a, BEHIND_M), (0.0, b, BEHIND_M), (0.0, b, BEHIND_M + DEEP_M), (0.0, a, BEHIND_M + DEEP_M)]
        for a, b in itertools.pairwise(y)
    ]
    positions = np.array(corners, np.float32).reshape(-1, 3)
    return Part(
        name="walls",
        material="m",
        positions_m=positions,
        normals=np.tile(np.array([1, 0, 0], np.float32), (len(positions), 1)),
        triangles=np.concatenate([np.array([[0, 1, 2], [0, 2, 3]]) + 4 * k for k in range(n)]),
    )


def test_walls_seen_edge_on_do_not_show_through_the_floor_before_them(renderer):
    floor = flat_plate("floor", (-0.45, 0.45), (-0.5, 0.5), 0.0)
    target = bare_target([floor, _walls(8)], [Material(name="m", base_color=(0.5,) * 3)])
    camera = square_camera(64, FOCAL_PX)
    rng = np.random.default_rng(5)
    shown = 0
    for _ in range(150):
        # the walls' plane passes the eye within a thousandth of a pixel, and so do many pixels' centres
        aside_m = rng.uniform(-1, 1, 2) * 1e-3 / FOCAL_PX * RANGE_M
        turn = np.arctan2(*rng.choice([(1, 1), (1, 2), (3, 4), (0, 1), (2, 3)]))
        scene = bare_scene(target, camera, (*aside_m, RANGE_M), (0, 0, turn))
        parts = renderer.surfaces(scene, target, layers=True).parts
        shown += int(np.count_nonzero(parts == 2))
    assert shown == 0
