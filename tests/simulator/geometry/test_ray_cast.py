"""Ray casting: Embree and the grid meet the same places, by parallel rays and by rays of all directions."""

import numpy as np
import pytest

from flyaround.simulator.geometry.directions import spherical_fibonacci
from flyaround.simulator.geometry.ray_cast import EmbreeCaster, GridCaster
from flyaround.simulator.targets.library import load_target

CASTERS = [EmbreeCaster, GridCaster]


@pytest.fixture(scope="module")
def corners():
    return np.concatenate([p.positions_m[p.triangles] for p in load_target("tango").parts]).astype(float)


def _assert_same_hits(corners, origins, directions, least, most):
    (near, mine), (far, other) = (
        caster(corners).first_hits(origins, directions) for caster in (GridCaster, EmbreeCaster)
    )
    hit = mine >= 0
    assert least < hit.mean() < most
    # a ray through an edge may count to either side of it, and where parts touch there are two triangles
    assert ((other >= 0) != hit).mean() < 2e-3
    assert np.abs(near - far)[hit & (other >= 0)].max() < 1e-5
    assert np.isinf(near[~hit]).all()


@pytest.mark.parametrize("direction", [(0.3, -0.5, 0.8), (0.0, 0.0, -1.0)])
def test_embree_and_the_grid_meet_the_same_places_along_parallel_rays(corners, direction):
    pytest.importorskip("embreex")
    origins = np.random.default_rng(1).uniform(corners.min((0, 1)), corners.max((0, 1)), (3000, 3))
    unit = np.array(direction) / np.linalg.norm(direction)
    _assert_same_hits(corners, origins, unit, 0.2, 0.8)


def test_embree_and_the_grid_meet_the_same_places_along_rays_of_all_directions(corners):
    pytest.importorskip("embreex")
    # each direction comes five times, not in order
    directions = np.tile(spherical_fibonacci(40), (5, 1))
    aims = np.random.default_rng(2).uniform(corners.min((0, 1)), corners.max((0, 1)), (200, 3))
    _assert_same_hits(corners, aims - 3 * directions, directions, 0.3, 1.0)


@pytest.mark.parametrize("caster", CASTERS)
def test_rays_from_one_point_in_any_direction_meet_the_faces_of_a_box(caster):
    if caster is EmbreeCaster:
        pytest.importorskip("embreex")
    low, high = np.array([-1.0, -2.0, -3.0]), np.array([1.5, 2.5, 3.5])
    c = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    box = np.array([[c[q[0]], c[q[i]], c[q[i + 1]]] for q in quads for i in (1, 2)])
    directions = spherical_fibonacci(60)
    distance, triangle = caster(box).first_hits(np.zeros((60, 3)), directions)
    reach = np.where(directions > 0, high, low) / directions
    axis = reach.argmin(axis=1)
    assert distance == pytest.approx(reach.min(axis=1), rel=1e-6)
    assert np.array_equal(triangle // 2, 2 * axis + (directions[np.arange(60), axis] > 0))
    # outwards from beyond a corner nothing is met
    distance, triangle = caster(box).first_hits(np.tile(high + 1, (3, 1)), np.eye(3))
    assert triangle.tolist() == [-1, -1, -1]


@pytest.mark.parametrize("caster", CASTERS)
def test_no_rays_meet_nothing(caster, corners):
    if caster is EmbreeCaster:
        pytest.importorskip("embreex")
    distance, triangle = caster(corners[:4]).first_hits(np.zeros((0, 3)), np.zeros((0, 3)))
    assert len(distance) == len(triangle) == 0
