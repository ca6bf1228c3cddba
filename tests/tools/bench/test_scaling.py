"""How the cost of a frame grows with pixels and triangles."""

import numpy as np
import pytest

from tools.bench.scaling import bench_scaling, dimpled_sphere


def test_the_made_mesh_is_closed_and_as_fine_as_asked():
    part = dimpled_sphere(5000).parts[0]
    assert len(part.triangles) == pytest.approx(5000, rel=0.05)
    a, b, c = (part.positions_m[part.triangles[:, k]].astype(float) for k in range(3))
    normal = np.cross(b - a, c - a)
    # outward, and closed: the areas' vectors cancel, and the volume is the ball's
    assert (np.einsum("ij,ij->i", normal, a + b + c) > 0).all()
    assert np.abs(normal.sum(axis=0)).max() < 1e-6
    assert np.einsum("ij,ij->", a, np.cross(b, c)) / 6 == pytest.approx(4 / 3 * np.pi * 0.5**3, rel=0.02)


@pytest.mark.slow
@pytest.mark.gl
def test_cost_is_linear_in_pixels_and_less_than_linear_in_triangles():
    found = bench_scaling(triangles=(20_000, 160_000, 1_000_000))
    assert max(found.pixel_powers) < 1.15
    assert max(found.triangle_powers) < 1.0
