"""What large convex bodies hide: nothing that a straight line from the place meets, and most of what it does not."""

import numpy as np
import pytest

from flyaround.simulator.geometry.convex_shells import CLOSEST_M, Boxes, convex_bodies, find_shells, hidden
from flyaround.simulator.targets.builders.mesh import merge
from flyaround.simulator.targets.builders.solids import box, dome

BODY = box((-0.5, -0.3, -0.2), (0.4, 0.3, 0.2))


def corners_of(mesh):
    return mesh.positions_m.astype(np.float32).astype(float)[mesh.triangles]


def meets_body(place, points, toward):
    """Whether the body's inside is met on the straight way from each point (K, 3) to the place."""
    low, high = BODY.positions_m.min(axis=0), BODY.positions_m.max(axis=0)
    with np.errstate(divide="ignore"):
        a, b = (low - points) / toward, (high - points) / toward
    enters, leaves = np.minimum(a, b).max(axis=1), np.maximum(a, b).min(axis=1)
    return (np.maximum(enters, 0) < np.minimum(leaves, 1 if place[3] else np.inf)) & (leaves > 0)


@pytest.mark.parametrize("far", [0.0, 1.0])
def test_boxes_called_hidden_lie_behind_the_body_and_most_that_do_are_called_so(far):
    random = np.random.default_rng(4)
    shells = find_shells(convex_bodies([corners_of(BODY)], 1.0), 1.0)
    assert len(shells) == 1
    middles = random.uniform(-1, 1, (300, 3))
    corners = middles[:, None] + random.uniform(-0.04, 0.04, (300, 8, 3))
    boxes = Boxes.about(corners, 1e-3)  # each for itself
    called = behind = 0
    for _ in range(20):
        direction = random.normal(size=3)
        place = np.append(direction / np.linalg.norm(direction) * 2.5, far)
        found = hidden(shells, boxes, place, 1.0)[boxes.of]
        points = corners.reshape(-1, 3)
        blocked = meets_body(place, points, place[:3] - far * points).reshape(300, 8).all(axis=1)
        assert not np.any(found & ~blocked)
        called, behind = called + found.sum(), behind + blocked.sum()
    assert behind > 300
    assert called > 0.85 * behind


def test_a_place_inside_or_too_near_hides_nothing():
    shells = find_shells(convex_bodies([corners_of(BODY)], 1.0), 1.0)
    behind = Boxes.about(np.full((1, 3, 3), [-0.9, 0.0, 0.0]), 0.1)
    for x, expected in ((0.1, False), (0.4 + 0.5 * CLOSEST_M, False), (0.4 + 2 * CLOSEST_M, True)):
        assert hidden(shells, behind, np.array([x, 0.0, 0.0, 1.0]), 1.0)[0] == expected


def test_only_closed_convex_bodies_that_stand_apart_are_shells():
    opened = box((2, 0, 0), (3, 1, 1))
    opened = type(opened)(opened.positions_m, opened.normals, opened.triangles[2:])
    inner = box((-0.49, -0.29, -0.19), (0.39, 0.29, 0.22))  # little more than the body
    cap = dome((0, 4, 0), (0, 1, 0), 0.8, 0.8)
    parts = [corners_of(m) for m in (opened, merge([BODY, inner]), cap)]
    shells = find_shells(convex_bodies(parts, 1.0), 1.0)
    assert len(shells) == 1
    assert np.ptp(shells[0].ends_m.reshape(-1, 3), axis=0) == pytest.approx([0.9, 0.6, 0.4], abs=1e-6)
    # a large flat face's triangles are one plane, and its diagonal no edge
    assert (len(shells[0].planes), len(shells[0].ends_m)) == (6, 12)
